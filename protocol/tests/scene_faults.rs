//! Layers and lenses in scene files: every way to get one wrong is told with its place and remedy.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::indexing_slicing,
    reason = "a test that panics has failed"
)]

use protocol::Fault::WrongType;
use protocol::scene::Scene;

const CAMERA: &str = "
[camera]
mode = \"fixed\"
place = { latitude_deg = 45.8, longitude_deg = 6.9, altitude_m = 9000 }
";

/// One layer of each kind with every key, and a lens over some of them.
const EVERYTHING: &str = include_str!("support/everything.toml");

/// What of that file is replaced | by what (`-`: nothing) | the fault | its key | what the advice says.
const FAULTS: &str = r#"
refine = "bottom-up" | refine = "bottomup" | OutOfRange | mesh.refine | did you mean "bottom-up"?
refine = "bottom-up" | refine = "none" | OutOfRange | mesh.refine | "top-down"
refine = "bottom-up" | refine = true | WrongType | mesh.refine | a text
refine = "bottom-up" | refined = "off" | UnknownKey | mesh.refined | did you mean refine?
tau = 2.5 | tau = 0 | OutOfRange | mesh.tau | 0.05…100
tau = 2.5 | tau = -2.5 | OutOfRange | mesh.tau | 0.05…100
tau = 2.5 | tau = 0.049 | OutOfRange | mesh.tau | 0.05…100
tau = 2.5 | tau = 100.1 | OutOfRange | mesh.tau | 0.05…100
tau = 2.5 | tau = nan | OutOfRange | mesh.tau | finite
tau = 2.5 | tau = -inf | OutOfRange | mesh.tau | finite
tau = 2.5 | tau = "2.5" | WrongType | mesh.tau | a number
wireframe = true | wireframe = 1 | WrongType | mesh.wireframe | true or false
scale = 2.0 | scale = 500 | OutOfRange | layers.heights.scale | 0…100
scale = 2.0 | scale = nan | OutOfRange | layers.heights.scale | finite
scale = 2.0 | scale = inf | OutOfRange | layers.heights.scale | finite
scale = 2.0 | scale = "2" | WrongType | layers.heights.scale | a number
scale = 2.0 | scales = 2 | UnknownKey | layers.heights.scales | did you mean scale?
scale = 2.0 | datum_shift = 2 | UnknownKey | layers.heights.datum_shift | datum_shift_m
scale = 2.0 | gamma = 2 | UnknownKey | layers.heights.gamma | clamp_m
offset_m = -10.5 | offset_m = -1e6 | OutOfRange | layers.heights.offset_m | -100000…100000
datum_shift_m = 47.25 | datum_shift_m = 1001 | OutOfRange | layers.heights.datum_shift_m | -1000…1000
clamp_m = [-100.0, 9000] | clamp_m = [9000, -100] | OutOfRange | layers.heights.clamp_m | smaller
clamp_m = [-100.0, 9000] | clamp_m = [7, 7] | OutOfRange | layers.heights.clamp_m | smaller
clamp_m = [-100.0, 9000] | clamp_m = [-600000, 0] | OutOfRange | layers.heights.clamp_m[0] | 500000
clamp_m = [-100.0, 9000] | clamp_m = 7 | WrongType | layers.heights.clamp_m | list of 2
priority = -7 | priority = -1001 | OutOfRange | layers.heights.priority | -1000…1000
priority = -7 | priority = 5000000000 | OutOfRange | layers.heights.priority | -1000…1000
priority = -7 | priority = 1.5 | WrongType | layers.heights.priority | a whole number
weight = 2.5 | weight = -1 | OutOfRange | layers.heights.weight | 0…1000
opacity = 0.75 | opacity = 1.01 | OutOfRange | layers.heights.opacity | 0…1
blend = "multiply" | blend = "screen" | OutOfRange | layers.heights.blend | no white
blend = "multiply" | blend = "multipli" | OutOfRange | layers.heights.blend | did you mean "multiply"?
exposure_stops = 1.5 | exposure_stops = 17 | OutOfRange | layers.colours.exposure_stops | -16…16
contrast = 1.25 | contrast = 9 | OutOfRange | layers.colours.contrast | 0…8
gamma = 2.0 | gamma = 0 | OutOfRange | layers.colours.gamma | 0.1…10
channels = [3, 2, 1] | channels = [3, 16, 1] | OutOfRange | layers.colours.channels[1] | 0…15
channels = [3, 2, 1] | channels = [3, 2, -1] | OutOfRange | layers.colours.channels[2] | 0…15
channels = [3, 2, 1] | channels = [3, 2] | WrongType | layers.colours.channels | channels = [0,1,2]
range = [200, 3000] | range = "auto" | OutOfRange | layers.colours.range | "automatic"
range = [200, 3000] | range = [1e12, 1e12] | OutOfRange | layers.colours.range | smaller
tint = [1.0, 0.5, 0.25] | tint = [1.0, 0.5, 2] | OutOfRange | layers.colours.tint[2] | 0…1
mapping = "gamma" | mapping = "reinhard" | OutOfRange | layers.radar.mapping | "logarithmic"
range = [0.0, 0.6] | range = [-1, 0.6] | OutOfRange | layers.radar.range[0] | 0…
strength = 40 | strength = 0.5 | OutOfRange | layers.radar.strength | 1…1000000
exponent = 0.5 | exponent = 0 | OutOfRange | layers.radar.exponent | 0.01…1
height_m = -100 | height_m = 5000 | OutOfRange | layers.tones.stops[1].height_m | rise
height_m = -100 | height = -100 | UnknownKey | layers.tones.stops[0].height | height_m
height_m = -100 | height_m = -6e5 | OutOfRange | layers.tones.stops[0].height_m | 500000
[0.0, 0.0, 0.5] | [0.0, -1, 0.5] | OutOfRange | layers.tones.stops[0].colour[1] | 0…1
stops = [{ height_m = -100 | ramp = "sea"\nstops = [{ height_m = -100 | OutOfRange | layers.tones.stops | remove one of the two
spacing_m = 50 | spacing_m = 0 | OutOfRange | layers.lines.spacing_m | 0.01…100000
width_px = 1.5 | width_px = 21 | OutOfRange | layers.lines.width_px | 0.1…20
bold_every = 10 | bold_every = -1 | OutOfRange | layers.lines.bold_every | 0…100
bold_every = 10 | bold_every = 101 | OutOfRange | layers.lines.bold_every | 0…100
range_deg = [5, 60] | range_deg = [5, 91] | OutOfRange | layers.steepness.range_deg[1] | 0…90
flat_below_deg = 2 | flat_below_deg = -2 | OutOfRange | layers.compass.flat_below_deg | 0…90
azimuth_deg = 300 | azimuth_deg = 361 | OutOfRange | layers.shade.azimuth_deg | 0…360
kind = "hillshade" | kind = "hilshade" | OutOfRange | layers.shade.kind | did you mean "hillshade"?
kind = "hillshade" | - | MissingKey | layers.shade.kind | kind =
kind = "hillshade" | kind = "hillshade"\nrepository = "x" | UnknownKey | layers.shade.repository | elevation of the scene
repository = "data/radar" | - | MissingKey | layers.radar.repository | repository =
radius_m = 20000 | radius_m = 0 | OutOfRange | lenses.loupe.radius_m | above 0
radius_m = 20000 | radius_m = -5 | OutOfRange | lenses.loupe.radius_m | above 0
radius_m = 20000 | radius_m = 5000001 | OutOfRange | lenses.loupe.radius_m | 5000000
radius_m = 20000 | - | MissingKey | lenses.loupe.radius_m | radius_m = 20000
radius_m = 20000 | radius_km = 20 | UnknownKey | lenses.loupe.radius_km | did you mean radius_m?
latitude_deg = 45.9 | latitude_deg = 91 | OutOfRange | lenses.loupe.latitude_deg | -90…90
longitude_deg = 6.87 | longitude_deg = 360 | OutOfRange | lenses.loupe.longitude_deg | -180…180
[lenses.loupe.layers.heights] | [lenses.loupe.layers.height] | Name | lenses.loupe.layers.height | did you mean heights?
[lenses.loupe.layers.heights] | [lenses.loupe.layers.snow] | Name | lenses.loupe.layers.snow | one of colours, compass
scale = 4.0 | scale = 400 | OutOfRange | lenses.loupe.layers.heights.scale | 0…100
scale = 4.0 | blend = "screen" | OutOfRange | lenses.loupe.layers.heights.blend | no white
scale = 4.0 | kind = "sar" | UnknownKey | lenses.loupe.layers.heights.kind | remove it
scale = 4.0 | repository = "x" | UnknownKey | lenses.loupe.layers.heights.repository | remove it
scale = 4.0 | gamma = 4 | UnknownKey | lenses.loupe.layers.heights.gamma | scale
ramp = "hypsometric" | ramp = "hypsometrik" | OutOfRange | lenses.loupe.layers.tones.ramp | did you mean "hypsometric"?
ramp = "hypsometric" | ramp = "alps" | OutOfRange | lenses.loupe.layers.tones.ramp | "land-and-sea"
[lenses.second] | [lenses."a.b"] | Name | lenses."a.b" | letters
"#;

#[test]
fn each_fault_of_layers_and_lenses_names_place_key_and_remedy() {
    let cases = FAULTS.trim().lines();
    assert!(cases.clone().count() >= 65);
    for case in cases {
        let parts: Vec<&str> = case.split(" | ").collect();
        let [from, to, fault, key, advice] = parts[..] else {
            panic!("not five parts: {case}");
        };
        let to = if to == "-" {
            String::new()
        } else {
            to.replace("\\n", "\n")
        };
        assert_eq!(
            EVERYTHING.matches(from).count(),
            1,
            "{from} must be there once"
        );
        let text = EVERYTHING.replacen(from, &to, 1);
        let error = Scene::parse(&text, "s.toml").expect_err(case);
        let message = error.to_string();
        assert_eq!(format!("{:?}", error.fault()), fault, "{case}: {message}");
        assert_eq!(error.key(), key, "{case}: {message}");
        assert!(message.contains(advice), "{case}: {message}");
        let (line, column) = error.position();
        let place = format!("s.toml:{line}:{column}: {key}");
        assert!(message.starts_with(&place), "{case}: {message}");
        // A wrong value is pointed at itself.
        let value = to.rsplit_once("= ").map_or(&*to, |(_, value)| value);
        let rest = text.lines().nth(line - 1).unwrap().chars().skip(column - 1);
        let rest: String = rest.collect();
        if fault == "OutOfRange" && !key.ends_with(']') && !key.contains("stops") {
            assert!(
                rest.starts_with(value),
                "{case}: {message} points at {rest}"
            );
        }
    }
}

#[test]
fn the_old_list_of_layers_is_told_the_new_form() {
    let text = format!(
        "{CAMERA}[[layers]]\nname = \"relief\"\nkind = \"elevation\"\nrepository = \"x\"\n"
    );
    let error = Scene::parse(&text, "s.toml").unwrap_err();
    assert_eq!((error.fault(), error.key()), (WrongType, "layers"));
    assert!(error.to_string().contains("[layers.relief]"), "{error}");
    let text = format!("{CAMERA}\n[layers]\n[[lenses]]\nname = \"a\"\n");
    let error = Scene::parse(&text, "s.toml").unwrap_err();
    assert_eq!((error.fault(), error.key()), (WrongType, "lenses"));
    assert!(error.to_string().contains("[lenses."), "{error}");
}

#[test]
fn a_ramp_has_2_to_32_stops() {
    for (count, fine) in [(0, false), (1, false), (2, true), (32, true), (33, false)] {
        let stops: Vec<String> = (0..count)
            .map(|index| format!("{{ height_m = {index}, colour = [0, 0, 0] }}"))
            .collect();
        let text = format!(
            "{CAMERA}[layers.x]\nkind = \"ramp\"\nstops = [{}]\n",
            stops.join(", ")
        );
        let result = Scene::parse(&text, "s.toml");
        assert_eq!(result.is_ok(), fine, "{count} stops");
        if let Err(error) = result {
            assert_eq!(error.key(), "layers.x.stops");
        }
    }
}
