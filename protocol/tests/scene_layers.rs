//! Layers and lenses of scenes: every kind with its defaults and with all its keys, and what comes from the wire.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::indexing_slicing,
    reason = "a test that panics has failed"
)]

use protocol::Fault::OutOfRange;
use protocol::ToNode;
use protocol::codec::{MAX_LARGE_BYTES, decode_to_node, encode_to_node};
use protocol::scene::{
    Aspect, Blend, Elevation, Fusion, Hillshade, Imagery, Isolines, LayerKind, LayerParameters,
    Lens, Process, Ramp, RampName, RampStop, Sar, SarMapping, Scene, Slope,
};

const CAMERA: &str = "
[camera]
mode = \"fixed\"
place = { latitude_deg = 45.8, longitude_deg = 6.9, altitude_m = 9000 }
";

/// One layer of each kind with every key, and a lens over some of them.
const EVERYTHING: &str = include_str!("support/everything.toml");

fn parse(layers: &str) -> Scene {
    Scene::parse(&format!("{CAMERA}{layers}"), "s.toml").unwrap()
}

fn process<'s>(scene: &'s Scene, name: &str) -> &'s Process {
    let found = scene.layers.iter().find(|layer| layer.name == name);
    &found.unwrap().parameters.process
}

#[test]
fn a_kind_alone_has_the_defaults() {
    for (kind, of_own, expected) in [
        ("elevation", true, LayerKind::Elevation),
        ("imagery", true, LayerKind::Imagery),
        ("sar", true, LayerKind::Sar),
        ("ramp", false, LayerKind::Ramp),
        ("isolines", false, LayerKind::Isolines),
        ("slope", false, LayerKind::Slope),
        ("aspect", false, LayerKind::Aspect),
        ("hillshade", false, LayerKind::Hillshade),
    ] {
        let repository = if of_own {
            "repository = \"data/x\""
        } else {
            ""
        };
        let scene = parse(&format!("[layers.x]\nkind = \"{kind}\"\n{repository}\n"));
        let layer = &scene.layers[0];
        assert_eq!(layer.kind(), expected);
        assert_eq!(layer.parameters, LayerParameters::new(expected));
        assert_eq!(layer.repository.as_deref(), of_own.then_some("data/x"));
        assert_eq!(expected.has_repository(), of_own);
        assert_eq!(expected.makes_heights(), kind == "elevation");
    }
    // What the defaults are is promised, too.
    let fusion = Fusion {
        priority: 0,
        weight: 1.0,
        opacity: 1.0,
        blend: Blend::Normal,
    };
    assert_eq!(Fusion::default(), fusion);
    let elevation = Elevation {
        scale: 1.0,
        offset_m: 0.0,
        datum_shift_m: 0.0,
        clamp_m: [-500_000.0, 500_000.0],
    };
    assert_eq!(Elevation::default(), elevation);
    let imagery = Imagery {
        exposure_stops: 0.0,
        contrast: 1.0,
        saturation: 1.0,
        gamma: 1.0,
        channels: [0, 1, 2],
        range: None,
        tint: [1.0; 3],
    };
    assert_eq!(Imagery::default(), imagery);
    let sar = Sar {
        mapping: SarMapping::Logarithmic,
        range: None,
        strength: 100.0,
        exponent: 0.7,
        tint: [1.0; 3],
    };
    assert_eq!(Sar::default(), sar);
    assert_eq!(Ramp::default(), Ramp::named(RampName::LandAndSea));
    assert_eq!(Slope::default().range_deg, [0.0, 45.0]);
    assert_eq!(Hillshade::default().azimuth_deg, 315.0);
}

#[test]
fn every_key_of_every_kind_is_read() {
    let scene = Scene::parse(EVERYTHING, "everything.toml").unwrap();
    let names: Vec<&str> = scene
        .layers
        .iter()
        .map(|layer| layer.name.as_str())
        .collect();
    assert_eq!(
        names,
        [
            "colours",
            "compass",
            "heights",
            "lines",
            "radar",
            "shade",
            "steepness",
            "tones"
        ]
    );
    let fusion = Fusion {
        priority: -7,
        weight: 2.5,
        opacity: 0.75,
        blend: Blend::Multiply,
    };
    assert_eq!(scene.layers[2].parameters.fusion, fusion);
    let expected = [
        (
            "heights",
            Process::Elevation(Elevation {
                scale: 2.0,
                offset_m: -10.5,
                datum_shift_m: 47.25,
                clamp_m: [-100.0, 9000.0],
            }),
        ),
        (
            "colours",
            Process::Imagery(Imagery {
                exposure_stops: 1.5,
                contrast: 1.25,
                saturation: 0.5,
                gamma: 2.0,
                channels: [3, 2, 1],
                range: Some([200.0, 3000.0]),
                tint: [1.0, 0.5, 0.25],
            }),
        ),
        (
            "radar",
            Process::Sar(Sar {
                mapping: SarMapping::Gamma,
                range: Some([0.0, 0.6]),
                strength: 40.0,
                exponent: 0.5,
                tint: [0.9, 1.0, 0.8],
            }),
        ),
        (
            "tones",
            Process::Ramp(Ramp {
                name: None,
                stops: vec![
                    RampStop {
                        height_m: -100.0,
                        colour: [0.0, 0.0, 0.5],
                    },
                    RampStop {
                        height_m: 4000.0,
                        colour: [1.0, 1.0, 1.0],
                    },
                ],
            }),
        ),
        (
            "lines",
            Process::Isolines(Isolines {
                spacing_m: 50.0,
                width_px: 1.5,
                bold_every: 10,
                bold_width_px: 3.0,
                colour: [0.1, 0.2, 0.3],
            }),
        ),
        (
            "steepness",
            Process::Slope(Slope {
                range_deg: [5.0, 60.0],
                gentle: [1.0, 1.0, 1.0],
                steep: [1.0, 0.0, 0.0],
            }),
        ),
        (
            "compass",
            Process::Aspect(Aspect {
                saturation: 0.6,
                brightness: 1.0,
                flat_below_deg: 2.0,
            }),
        ),
        (
            "shade",
            Process::Hillshade(Hillshade {
                azimuth_deg: 300.0,
                altitude_deg: 30.0,
                exaggeration: 3.0,
            }),
        ),
    ];
    for (name, expected) in &expected {
        assert_eq!(process(&scene, name), expected, "{name}");
    }
}

#[test]
fn a_lens_takes_what_it_does_not_give_from_the_layer() {
    let scene = Scene::parse(EVERYTHING, "everything.toml").unwrap();
    let [loupe, second] = &scene.lenses[..] else {
        panic!("two lenses expected, found {:?}", scene.lenses);
    };
    assert_eq!((loupe.name.as_str(), loupe.radius_m), ("loupe", 20_000.0));
    assert_eq!((loupe.latitude_deg, loupe.longitude_deg), (45.9, 6.87));
    assert_eq!((second.name.as_str(), second.layers.len()), ("second", 0));
    let layers: Vec<usize> = loupe.layers.iter().map(|inside| inside.layer).collect();
    assert_eq!(layers, [0, 2, 7]);
    let [colours, heights, tones] = &loupe.layers[..] else {
        panic!("three layers expected");
    };
    // The keys are told in the order of the kind, not of the text.
    assert_eq!(colours.given, ["opacity", "saturation", "range"]);
    let mut expected = scene.layers[0].parameters.clone();
    expected.fusion.opacity = 0.5;
    let Process::Imagery(imagery) = &mut expected.process else {
        panic!("imagery expected");
    };
    (imagery.saturation, imagery.range) = (0.0, None);
    assert_eq!(colours.parameters, expected);
    let Process::Elevation(elevation) = &heights.parameters.process else {
        panic!("elevation expected");
    };
    assert_eq!((elevation.scale, elevation.datum_shift_m), (4.0, 47.25));
    assert_eq!(heights.given, ["scale"]);
    let expected = Process::Ramp(Ramp::named(RampName::Hypsometric));
    assert_eq!(tones.parameters.process, expected);
    assert_eq!(tones.given, ["ramp"]);
}

#[test]
fn named_ramps_are_valid_and_differ() {
    let names = ["land-and-sea", "land", "sea", "grey", "hypsometric"];
    let mut ramps: Vec<Ramp> = Vec::new();
    for name in names {
        let scene = parse(&format!("[layers.x]\nkind = \"ramp\"\nramp = \"{name}\"\n"));
        let Process::Ramp(ramp) = process(&scene, "x") else {
            panic!("a ramp expected");
        };
        assert!((2..=32).contains(&ramp.stops.len()));
        assert!(ramp.stops.is_sorted_by(|a, b| a.height_m < b.height_m));
        assert!(!ramps.contains(ramp), "{name} has the stops of another");
        ramps.push(ramp.clone());
    }
    // The shore is a sharp edge: water just below 0 m is blue, land at 0 m is green.
    let shore = RampName::LandAndSea.stops();
    let land = shore.iter().position(|stop| stop.height_m == 0.0).unwrap();
    let [red, green, blue] = shore[land].colour;
    assert!(green > red && green > blue);
    let [red, _, blue] = shore[land - 1].colour;
    assert!(blue > red && shore[land - 1].height_m > -1.0);
}

/// 8 layers of elevation and 8 others, each with the longest ramp where it has one, and 8 lenses over all.
fn largest() -> Scene {
    let long = |name: &str, index: usize| format!("{name}{index}{}", "x".repeat(56));
    let path = "r".repeat(4096);
    let mut text = CAMERA.to_owned();
    let stops: Vec<String> = (0..32)
        .map(|index| format!("{{ height_m = {index}, colour = [0.1, 0.2, 0.3] }}"))
        .collect();
    let stops = format!("stops = [{}]\n", stops.join(", "));
    let mut inside = String::new();
    for index in 0..8 {
        let (heights, ramp) = (long("heights", index), long("ramp", index));
        text += &format!("[layers.{heights}]\nkind = \"elevation\"\nrepository = \"{path}\"\n");
        text += &format!("[layers.{ramp}]\nkind = \"ramp\"\n{stops}");
        inside += &format!(
            "[lenses.LENS.layers.{heights}]\nscale = 3\noffset_m = 1\ndatum_shift_m = 4\n"
        );
        inside += &format!("[lenses.LENS.layers.{ramp}]\nopacity = 0.5\n{stops}");
    }
    for index in 0..8 {
        let lens = long("lens", index);
        text += &format!("[lenses.{lens}]\nlatitude_deg = 1\nlongitude_deg = 2\nradius_m = 3\n");
        text += &inside.replace("LENS", &lens);
    }
    Scene::parse(&text, "largest.toml").unwrap()
}

#[test]
fn more_layers_or_lenses_than_can_be_shown_are_refused() {
    let scene = largest();
    assert_eq!((scene.layers.len(), scene.lenses.len()), (16, 8));
    for (kind, advice) in [("elevation", "of kind"), ("imagery", "other kinds")] {
        let mut more = scene.clone();
        let mut layer = more.layers[0].clone();
        layer.name = "zzz".into();
        layer.parameters = LayerParameters::new(match kind {
            "elevation" => LayerKind::Elevation,
            _ => LayerKind::Imagery,
        });
        more.layers.push(layer);
        let error = more.validate().unwrap_err();
        assert_eq!((error.fault(), error.key()), (OutOfRange, "layers"));
        assert!(error.to_string().contains(advice), "{error}");
        assert!(error.to_string().contains("there are 9"), "{error}");
    }
    let mut more = scene;
    let lens = Lens {
        name: "zzz".into(),
        ..more.lenses[0].clone()
    };
    more.lenses.push(lens);
    let error = more.validate().unwrap_err();
    assert_eq!((error.fault(), error.key()), (OutOfRange, "lenses"));
}

#[test]
fn the_largest_scene_fits_a_message() {
    let scene = largest();
    let message = ToNode::Scene {
        revision: u64::MAX,
        scene: Box::new(scene),
    };
    let bytes = encode_to_node(&message).unwrap();
    assert!(
        bytes.len() > 100_000 && bytes.len() < MAX_LARGE_BYTES / 2,
        "{}",
        bytes.len()
    );
    assert_eq!(decode_to_node(&bytes).unwrap(), message);
}

#[test]
fn scenes_from_the_wire_are_checked() {
    type Spoil = fn(&mut Scene);
    fn elevation(parameters: &mut LayerParameters) -> &mut Elevation {
        match &mut parameters.process {
            Process::Elevation(elevation) => elevation,
            other => panic!("elevation expected, found {other:?}"),
        }
    }
    let cases: &[(Spoil, &str)] = &[
        (
            |scene| elevation(&mut scene.layers[2].parameters).scale = f64::NAN,
            "layers.heights.scale",
        ),
        (
            |scene| elevation(&mut scene.layers[2].parameters).offset_m = f64::INFINITY,
            "layers.heights.offset_m",
        ),
        (
            |scene| elevation(&mut scene.layers[2].parameters).clamp_m[1] = f64::NAN,
            "layers.heights.clamp_m[1]",
        ),
        (
            |scene| scene.layers[2].parameters.fusion.weight = f64::NEG_INFINITY,
            "layers.heights.weight",
        ),
        (
            |scene| scene.layers[2].parameters.fusion.priority = i32::MIN,
            "layers.heights.priority",
        ),
        (
            |scene| scene.layers[2].parameters.fusion.blend = Blend::Screen,
            "layers.heights.blend",
        ),
        (
            |scene| scene.layers[2].repository = None,
            "layers.heights.repository",
        ),
        (
            |scene| scene.layers[7].repository = Some("x".into()),
            "layers.tones.repository",
        ),
        (
            |scene| scene.layers[0].repository = Some("a\0b".into()),
            "layers.colours.repository",
        ),
        (|scene| scene.layers.swap(0, 1), "layers"),
        (|scene| scene.layers[0].name = "compass".into(), "layers"),
        (|scene| scene.layers[0].name = "a.b".into(), "layers"),
        (|scene| scene.lenses.swap(0, 1), "lenses"),
        (|scene| scene.lenses[0].name = String::new(), "lenses"),
        (
            |scene| scene.lenses[0].radius_m = f64::NAN,
            "lenses.loupe.radius_m",
        ),
        (
            |scene| scene.lenses[0].radius_m = 0.0,
            "lenses.loupe.radius_m",
        ),
        (
            |scene| scene.lenses[0].latitude_deg = f64::NAN,
            "lenses.loupe.latitude_deg",
        ),
        (
            |scene| scene.lenses[0].layers[0].layer = 99,
            "lenses.loupe.layers",
        ),
        (
            |scene| scene.lenses[0].layers.swap(0, 1),
            "lenses.loupe.layers",
        ),
        (
            |scene| scene.lenses[0].layers[1].layer = 3,
            "lenses.loupe.layers.lines",
        ),
        (
            |scene| elevation(&mut scene.lenses[0].layers[1].parameters).scale = f64::NAN,
            "lenses.loupe.layers.heights.scale",
        ),
        // Values that the lens does not give are the layer's.
        (
            |scene| elevation(&mut scene.lenses[0].layers[1].parameters).offset_m = 9.0,
            "lenses.loupe.layers.heights",
        ),
        (
            |scene| scene.lenses[0].layers[1].given.push("gamma".into()),
            "lenses.loupe.layers.heights",
        ),
        (
            |scene| scene.lenses[0].layers[0].given.reverse(),
            "lenses.loupe.layers.colours",
        ),
        (
            |scene| scene.lenses[0].layers[2].given.push("stops".into()),
            "lenses.loupe.layers.tones",
        ),
        (
            |scene| scene.lenses[0].layers[2].given.clear(),
            "lenses.loupe.layers.tones",
        ),
        (
            |scene| {
                if let Process::Ramp(ramp) = &mut scene.layers[7].parameters.process {
                    ramp.name = Some(RampName::Sea);
                }
            },
            "layers.tones.ramp",
        ),
        (
            |scene| {
                if let Process::Ramp(ramp) = &mut scene.layers[7].parameters.process {
                    ramp.stops[1].height_m = f64::NAN;
                }
            },
            "layers.tones.stops[1].height_m",
        ),
        (
            |scene| {
                if let Process::Imagery(imagery) = &mut scene.layers[0].parameters.process {
                    imagery.range = Some([1.0, f64::INFINITY]);
                }
            },
            "layers.colours.range[1]",
        ),
    ];
    let scene = Scene::parse(EVERYTHING, "everything.toml").unwrap();
    scene.validate().unwrap();
    for (index, (spoil, key)) in cases.iter().enumerate() {
        let mut spoilt = scene.clone();
        spoil(&mut spoilt);
        let error = spoilt
            .validate()
            .expect_err(&format!("case {index}: {key}"));
        assert_eq!(error.key(), *key, "case {index}: {error}");
        assert_eq!(error.position(), (0, 0));
        let message = ToNode::Scene {
            revision: 1,
            scene: Box::new(spoilt),
        };
        assert!(
            decode_to_node(&encode_to_node(&message).unwrap()).is_err(),
            "{key}"
        );
    }
}
