//! Scenes as JSON: nothing is lost on the way there and back, patches do what RFC 7396 says, and whatever is wrong
//! with them is told with the path of the value.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::indexing_slicing,
    reason = "a test that panics has failed"
)]

use protocol::Fault::{OutOfRange, WrongType};
use protocol::scene::{AssignmentError, Process, Ramp, RampName, Refine, Scene};
use serde_json::{Value, json};

const DEMO: &str = include_str!("../../configs/scenes/demo.toml");
const EVERYTHING: &str = include_str!("support/everything.toml");

fn everything() -> Scene {
    Scene::parse(EVERYTHING, "everything.toml").unwrap()
}

#[test]
fn json_has_the_shape_of_the_file_with_everything_written_out() {
    let text = r#"
        [camera]
        mode = "fixed"
        place = { latitude_deg = 45.8, longitude_deg = 6.9, altitude_m = 9000 }
        [layers.relief]
        kind = "elevation"
        repository = "data/relief"
        [layers.photo]
        kind = "imagery"
        repository = "data/photo"
        [lenses.loupe]
        latitude_deg = 45.8
        longitude_deg = 6.9
        radius_m = 20000
        [lenses.loupe.layers.relief]
        scale = 2
    "#;
    let scene = Scene::parse(text, "s.toml").unwrap();
    let expected = json!({
        "planet": "earth",
        "camera": {
            "mode": "fixed",
            "place": {
                "latitude_deg": 45.8, "longitude_deg": 6.9, "altitude_m": 9000.0,
                "heading_deg": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0,
            },
        },
        "layers": {
            "relief": {
                "kind": "elevation", "repository": "data/relief",
                "priority": 0, "weight": 1.0, "opacity": 1.0, "blend": "normal",
                "scale": 1.0, "offset_m": 0.0, "datum_shift_m": 0.0, "clamp_m": [-500_000.0, 500_000.0],
            },
            "photo": {
                "kind": "imagery", "repository": "data/photo",
                "priority": 0, "weight": 1.0, "opacity": 1.0, "blend": "normal",
                "exposure_stops": 0.0, "contrast": 1.0, "saturation": 1.0, "gamma": 1.0,
                "channels": [0, 1, 2], "range": "automatic", "tint": [1.0, 1.0, 1.0],
            },
        },
        "lenses": {
            "loupe": {
                "latitude_deg": 45.8, "longitude_deg": 6.9, "radius_m": 20_000.0,
                "layers": { "relief": { "scale": 2.0 } },
            },
        },
        "light": { "sun": "camera", "ambient": 0.15, "relief": 1.0 },
        "atmosphere": { "enabled": true, "thickness_m": 80_000.0, "colour": [0.3, 0.55, 1.0] },
        "mesh": {
            "refine": "top-down", "tau": 1.0, "wireframe": false,
            "refinement": 3, "tile_px": 257.0, "deepest_level": 22,
        },
    });
    assert_eq!(scene.to_json(), expected);
}

#[test]
fn files_survive_the_way_through_json() {
    for text in [DEMO, EVERYTHING] {
        let scene = Scene::parse(text, "s.toml").unwrap();
        assert_eq!(Scene::from_json(&scene.to_json(), "json").unwrap(), scene);
        // And as the text that goes over the network.
        let sent: Value = serde_json::from_str(&scene.to_json().to_string()).unwrap();
        assert_eq!(Scene::from_json(&sent, "json").unwrap(), scene);
    }
    let mut scene = everything();
    scene.layers[0].repository = Some("\"\\ \n\t\u{1}\u{7f}\u{85} ü 🌍 ''' #]".into());
    assert_eq!(Scene::from_json(&scene.to_json(), "json").unwrap(), scene);
}

#[test]
fn a_patch_sets_removes_and_replaces() {
    let scene = everything();
    let patched = scene
        .patched(&json!({
            "planet": "mars",
            "light": { "ambient": 0.5, "sun": "camera" },
            "mesh": null,
            "layers": {
                "heights": { "scale": 3, "clamp_m": [0, 10] },
                "lines": null,
                "nowhere": null,
                "extra": { "kind": "slope", "opacity": 0.5 },
            },
            "lenses": { "second": null, "loupe": { "radius_m": 5.5, "layers": { "heights": { "scale": null, "offset_m": 7 } } } },
        }))
        .unwrap();
    let mut expected = scene.to_json();
    expected["planet"] = json!("mars");
    expected["light"]["ambient"] = json!(0.5);
    expected["light"]["sun"] = json!("camera");
    expected["mesh"] = json!({
        "refine": "top-down", "tau": 1.0, "wireframe": false,
        "refinement": 3, "tile_px": 257.0, "deepest_level": 22,
    });
    expected["layers"]["heights"]["scale"] = json!(3.0);
    expected["layers"]["heights"]["clamp_m"] = json!([0.0, 10.0]);
    let layers = expected["layers"].as_object_mut().unwrap();
    layers.remove("lines");
    layers.insert(
        "extra".into(),
        json!({
            "kind": "slope", "priority": 0, "weight": 1.0, "opacity": 0.5, "blend": "normal",
            "range_deg": [0.0, 45.0], "gentle": [1.0, 1.0, 0.85], "steep": [0.65, 0.1, 0.05],
        }),
    );
    expected["lenses"].as_object_mut().unwrap().remove("second");
    expected["lenses"]["loupe"]["radius_m"] = json!(5.5);
    expected["lenses"]["loupe"]["layers"]["heights"] = json!({ "offset_m": 7.0 });
    assert_eq!(patched.to_json(), expected);
    // The lens goes on with the layer's new scale, and with the layers at their new indices.
    let loupe = &patched.lenses[0];
    let names = |index: usize| patched.layers[loupe.layers[index].layer].name.as_str();
    assert_eq!(
        [names(0), names(1), names(2)],
        ["colours", "heights", "tones"]
    );
    let Process::Elevation(inside) = &loupe.layers[1].parameters.process else {
        panic!("elevation expected");
    };
    assert_eq!(
        (inside.scale, inside.offset_m, inside.datum_shift_m),
        (3.0, 7.0, 47.25)
    );
    // An empty patch changes nothing.
    assert_eq!(scene.patched(&json!({})).unwrap(), scene);
    // A list is replaced as a whole, also a list of objects.
    let keyframes = json!([
        { "time_s": 0, "place": { "latitude_deg": 1, "longitude_deg": 2, "altitude_m": 3 } },
        { "time_s": 1, "place": { "latitude_deg": 2, "longitude_deg": 2, "altitude_m": 3 } },
    ]);
    let demo = Scene::parse(DEMO, "demo.toml").unwrap();
    let demo = demo
        .patched(&json!({ "camera": { "keyframes": keyframes } }))
        .unwrap();
    assert_eq!(demo.camera.rests_after_s(), Some(1.0));
}

#[test]
fn a_ramp_by_name_takes_the_place_of_its_stops() {
    let scene = everything();
    let both = scene
        .patched(&json!({ "layers": { "tones": { "ramp": "sea" } } }))
        .unwrap_err();
    assert_eq!(
        (both.fault(), both.key()),
        (OutOfRange, "layers.tones.stops")
    );
    let named = json!({ "layers": { "tones": { "ramp": "sea", "stops": null } } });
    let named = scene.patched(&named).unwrap();
    assert_eq!(named.to_json()["layers"]["tones"]["ramp"], "sea");
    assert_eq!(named.to_json()["layers"]["tones"].get("stops"), None);
    let Process::Ramp(ramp) = &named.layers[7].parameters.process else {
        panic!("a ramp expected");
    };
    assert_eq!(*ramp, Ramp::named(RampName::Sea));
}

/// A patch of everything | the fault | its key (`-`: none) | what the advice says.
const FAULTS: &str = r#"
{ "layers": { "heights": { "scale": 500 } } } | OutOfRange | layers.heights.scale | = 500: write a number within 0…100
{ "layers": { "heights": { "scale": 1e300 } } } | OutOfRange | layers.heights.scale | 0…100
{ "layers": { "heights": { "scale": "NaN" } } } | WrongType | layers.heights.scale | a number
{ "layers": { "heights": { "scale": true } } } | WrongType | layers.heights.scale | a number
{ "layers": { "heights": { "priority": 18446744073709551615 } } } | WrongType | layers.heights.priority | whole number
{ "layers": { "heights": { "clamp_m": [0, null] } } } | WrongType | layers.heights.clamp_m[1] | null
{ "layers": { "heights": { "clamp_m": [0, 1, 2] } } } | WrongType | layers.heights.clamp_m | list of 2
{ "layers": { "heights": { "opcity": 1 } } } | UnknownKey | layers.heights.opcity | did you mean opacity?
{ "layers": { "heights": { "blend": "screen" } } } | OutOfRange | layers.heights.blend | no white
{ "layers": { "heights": { "repository": null } } } | MissingKey | layers.heights.repository | repository =
{ "layers": { "heights": { "repository": "" } } } | OutOfRange | layers.heights.repository | terrawall import
{ "layers": { "heights": null } } | Name | lenses.loupe.layers.heights | no such layer
{ "layers": { "height": { "scale": 2 } } } | MissingKey | layers.height.kind | kind =
{ "layers": { "a.b\n": { "kind": "slope" } } } | Name | layers."a.b\u000A" | letters
{ "layers": { "tones": { "ramp": "alps", "stops": null } } } | OutOfRange | layers.tones.ramp | "land-and-sea"
{ "layers": { "tones": { "stops": [] } } } | OutOfRange | layers.tones.stops | 2…32
{ "layers": [] } | WrongType | layers | a table for each name
{ "layers": null } | MissingKey | layers | layers
{ "layers": { "heights": 5 } } | WrongType | layers.heights | a table
{ "lenses": { "loupe": { "radius_m": 0 } } } | OutOfRange | lenses.loupe.radius_m | above 0
{ "lenses": { "loupe": { "radius_m": -1.5 } } } | OutOfRange | lenses.loupe.radius_m | above 0
{ "lenses": { "loupe": { "layers": { "snow": { "scale": 2 } } } } } | Name | lenses.loupe.layers.snow | no such layer
{ "lenses": { "third": { "radius_m": 5 } } } | MissingKey | lenses.third.latitude_deg | latitude_deg =
{ "lens": {} } | UnknownKey | lens | lenses
{ "planet": "pluto" } | OutOfRange | planet | "moon"
{ "camera": { "mode": "path" } } | UnknownKey | camera.centre | keyframes
{ "mesh": { "refine": "topdown" } } | OutOfRange | mesh.refine | did you mean "top-down"?
{ "mesh": { "refine": true } } | WrongType | mesh.refine | a text
{ "mesh": { "tau": 0 } } | OutOfRange | mesh.tau | 0.05…100
{ "mesh": { "tau": -1 } } | OutOfRange | mesh.tau | 0.05…100
{ "mesh": { "tau": 1e300 } } | OutOfRange | mesh.tau | 0.05…100
{ "mesh": { "tau": "1 px" } } | WrongType | mesh.tau | a number
{ "mesh": { "wireframe": 1 } } | WrongType | mesh.wireframe | true or false
{ "mesh": { "refinement": 8 } } | OutOfRange | mesh.refinement | 0…7
{ "mesh": { "refinement": 300 } } | OutOfRange | mesh.refinement | 0…7
{ "light": { "sun": { "latitude_deg": 91 } } } | OutOfRange | light.sun.latitude_deg | -90…90
{ "atmosphere": { "colour": [0, 0, 3] } } | OutOfRange | atmosphere.colour[2] | 0…1
null | WrongType | - | object
[{}] | WrongType | - | object
"layers" | WrongType | - | object
"#;

#[test]
fn each_fault_of_a_patch_names_path_and_remedy() {
    let scene = everything();
    let cases = FAULTS.trim().lines();
    assert!(cases.clone().count() >= 30);
    for case in cases {
        let parts: Vec<&str> = case.split(" | ").collect();
        let [patch, fault, key, advice] = parts[..] else {
            panic!("not four parts: {case}");
        };
        let key = if key == "-" { "" } else { key };
        let patch: Value = serde_json::from_str(patch).expect(case);
        let error = scene.patched(&patch).expect_err(case);
        let message = error.to_string();
        assert_eq!(format!("{:?}", error.fault()), fault, "{case}: {message}");
        assert_eq!(error.key(), key, "{case}: {message}");
        assert!(message.contains(advice), "{case}: {message}");
        assert!(message.starts_with(key), "{case}: {message}");
        assert_eq!(error.position(), (0, 0), "{case}: {message}");
    }
    let mut deep = json!(1);
    for _ in 0..100 {
        deep = json!({ "x": deep });
    }
    let error = scene.patched(&json!({ "light": deep })).unwrap_err();
    assert!(error.to_string().contains("nested"), "{error}");
}

#[test]
fn json_that_is_no_scene_is_refused_with_its_origin() {
    let mut value = everything().to_json();
    value["layers"]["heights"]["scale"] = json!(-1);
    let error = Scene::from_json(&value, "the answer").unwrap_err();
    assert_eq!(
        error.to_string(),
        "the answer: layers.heights.scale = -1: write a number within 0…100"
    );
    value["layers"]["heights"]["scale"] = Value::Null;
    let error = Scene::from_json(&value, "the answer").unwrap_err();
    assert_eq!(
        (error.fault(), error.key()),
        (WrongType, "layers.heights.scale")
    );
    for value in [json!(1), json!([]), Value::Null] {
        let error = Scene::from_json(&value, "the answer").unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("the answer: this is no JSON object"),
            "{error}"
        );
    }
    assert_eq!(
        Scene::from_json(&json!({}), "").unwrap_err().key(),
        "camera"
    );
}

#[test]
fn assignments_are_patches() {
    let cases = [
        (
            "relief.scale=2",
            json!({ "layers": { "relief": { "scale": 2 } } }),
        ),
        (
            " relief.scale = -2.5e1 ",
            json!({ "layers": { "relief": { "scale": -25.0 } } }),
        ),
        (
            "photo.blend=screen",
            json!({ "layers": { "photo": { "blend": "screen" } } }),
        ),
        (
            "photo.blend=\"screen\"",
            json!({ "layers": { "photo": { "blend": "screen" } } }),
        ),
        (
            "photo.tint=[1, 0.5, 0]",
            json!({ "layers": { "photo": { "tint": [1, 0.5, 0] } } }),
        ),
        (
            "photo.range=null",
            json!({ "layers": { "photo": { "range": null } } }),
        ),
        (
            "photo.repository=a=b",
            json!({ "layers": { "photo": { "repository": "a=b" } } }),
        ),
        (
            "photo.opacity=NaN",
            json!({ "layers": { "photo": { "opacity": "NaN" } } }),
        ),
        ("layers.photo=null", json!({ "layers": { "photo": null } })),
        (
            "layers.light.weight=0",
            json!({ "layers": { "light": { "weight": 0 } } }),
        ),
        ("light.ambient=0.3", json!({ "light": { "ambient": 0.3 } })),
        ("planet=moon", json!({ "planet": "moon" })),
        (
            "lenses.a.radius_m=5",
            json!({ "lenses": { "a": { "radius_m": 5 } } }),
        ),
        (
            "lenses.a.layers.relief.scale=5",
            json!({ "lenses": { "a": { "layers": { "relief": { "scale": 5 } } } } }),
        ),
        ("photo.x=", json!({ "layers": { "photo": { "x": "" } } })),
    ];
    for (text, expected) in cases {
        assert_eq!(Scene::assignment(text).unwrap(), expected, "{text}");
    }
    for text in ["", "relief.scale", "relief"] {
        let expected = AssignmentError::NoValue(text.to_owned());
        assert_eq!(Scene::assignment(text).unwrap_err(), expected, "{text}");
    }
    for text in [
        "=2",
        "scale=2",
        ".scale=2",
        "relief.=2",
        "relief..scale=2",
        "a b.c=2",
        "relief.clamp_m[0]=2",
        "a.b.c.d.e.f.g.h=2",
    ] {
        let error = Scene::assignment(text).unwrap_err();
        assert!(
            matches!(error, AssignmentError::NoPath(_)),
            "{text}: {error}"
        );
        assert!(error.to_string().contains("LAYER.PARAMETER"), "{error}");
    }
    let texts = [
        "heights.scale=2",
        "light.ambient=0.5",
        "heights.scale=4",
        "heights.offset_m=null",
        "layers.lines=null",
        "mesh.tau=0.5",
        "mesh.refine=off",
        "mesh.wireframe=false",
    ];
    let patch = Scene::assignments(texts).unwrap();
    let expected = json!({
        "layers": { "heights": { "scale": 4, "offset_m": null }, "lines": null },
        "light": { "ambient": 0.5 },
        "mesh": { "tau": 0.5, "refine": "off", "wireframe": false },
    });
    assert_eq!(patch, expected);
    let patched = everything().patched(&patch).unwrap();
    let Process::Elevation(heights) = &patched.layers[2].parameters.process else {
        panic!("elevation expected");
    };
    assert_eq!(
        (heights.scale, heights.offset_m, patched.layers.len()),
        (4.0, 0.0, 7)
    );
    assert_eq!(
        (
            patched.mesh.tau,
            patched.mesh.refine,
            patched.mesh.wireframe
        ),
        (0.5, Refine::Off, false)
    );
}
