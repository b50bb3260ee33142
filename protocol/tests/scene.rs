//! Scenes: the shipped files are valid, and every way to get one wrong is told with its place and remedy.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::path::Path;

use protocol::scene::{LayerKind, Refine, Scene, Sun};
use protocol::{Camera, Fault};

const DEMO: &str = include_str!("../../configs/scenes/demo.toml");

#[test]
fn every_shipped_scene_is_valid() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/scenes");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap();
        let scene = Scene::parse(&text, &path.to_string_lossy()).unwrap();
        assert!(
            scene
                .layers
                .iter()
                .any(|layer| layer.kind() == LayerKind::Elevation)
        );
        assert!(
            scene
                .layers
                .iter()
                .any(|layer| layer.kind() == LayerKind::Imagery)
        );
        names.push(path.file_stem().unwrap().to_string_lossy().into_owned());
    }
    for name in [
        "demo",
        "verify-globe",
        "verify-limb",
        "verify-mountains",
        "verify-pole",
        "verify-horizon",
    ] {
        assert!(names.iter().any(|found| found == name), "{name} is missing");
    }
}

#[test]
fn the_demo_flies_for_four_seconds_or_more_and_rests_over_the_whole_earth() {
    let scene = Scene::parse(DEMO, "demo.toml").unwrap();
    let rests_s = scene.camera.rests_after_s().unwrap();
    assert!(rests_s * 30.0 >= 120.0);
    let pose = scene.camera.pose(&scene.planet, rests_s + 10.0);
    let position = scene.planet.to_geodetic(pose.position_m.into());
    assert!(position.height_m > 1.2e7);
}

#[test]
fn each_fault_names_place_key_and_remedy() {
    use Fault::{Geometry, MissingKey, Name, OutOfRange, Syntax, UnknownKey, WrongType};
    let second = "time_s = 2.5";
    let cases: &[(&str, &str, Fault, &str, &str)] = &[
        ("\"earth\"", "\"erde\"", OutOfRange, "planet", "\"moon\""),
        (
            "\"earth\"",
            "{ semi_major_m = 1, semi_minor_m = -1 }",
            OutOfRange,
            "planet",
            "positive",
        ),
        (
            "mode = \"path\"",
            "mode = \"spline\"",
            OutOfRange,
            "camera.mode",
            "\"orbit\"",
        ),
        (
            "mode = \"path\"",
            "mode = \"fixed\"",
            UnknownKey,
            "camera.looped",
            "mode, place",
        ),
        (
            second,
            "time_s = 0.0",
            OutOfRange,
            "camera.keyframes[1].time_s",
            "order of time",
        ),
        (
            second,
            "time = 2.5",
            UnknownKey,
            "camera.keyframes[1].time",
            "did you mean time_s?",
        ),
        (
            "latitude_deg = 46.06",
            "latitude_deg = 146.06",
            OutOfRange,
            "camera.keyframes[0].place.latitude_deg",
            "-90…90",
        ),
        (
            "latitude_deg = 46.06",
            "latitude = 46.06",
            UnknownKey,
            "camera.keyframes[0].place.latitude",
            "latitude_deg",
        ),
        (
            "altitude_m = 12000",
            "altitude_km = 12",
            UnknownKey,
            "camera.keyframes[0].place.altitude_km",
            "altitude_m",
        ),
        (
            "altitude_m = 12000, ",
            "",
            MissingKey,
            "camera.keyframes[0].place.altitude_m",
            "altitude_m = 9000",
        ),
        (
            "latitude_deg = 46.06, longitude_deg = 6.42",
            "latitude_deg = -46, longitude_deg = -173",
            Geometry,
            "camera.keyframes[1].place",
            "in between",
        ),
        (
            "looped = false",
            "looped = true",
            Geometry,
            "camera.keyframes[4].place",
            "repeat the first place",
        ),
        (
            "looped = false",
            "looped = 0",
            WrongType,
            "camera.looped",
            "true or false",
        ),
        (
            "[layers.colours]",
            "[layers.\"the colours\"]",
            Name,
            "layers.\"the colours\"",
            "letters",
        ),
        ("[layers.colours]", "[[layers]]", Syntax, "", "not TOML"),
        (
            "kind = \"imagery\"",
            "kind = \"image\"",
            OutOfRange,
            "layers.colours.kind",
            "\"imagery\"",
        ),
        (
            "\"../../out/data/imagery\"",
            "\"\"",
            OutOfRange,
            "layers.colours.repository",
            "terrawall import",
        ),
        (
            "sun = \"camera\"",
            "sun = \"noon\"",
            OutOfRange,
            "light.sun",
            "latitude_deg",
        ),
        (
            "sun = \"camera\"",
            "sun = { latitude_deg = 99, longitude_deg = 0 }",
            OutOfRange,
            "light.sun.latitude_deg",
            "-90…90",
        ),
        (
            "ambient = 0.2",
            "ambient = 2",
            OutOfRange,
            "light.ambient",
            "0…1",
        ),
        (
            "ambient = 0.2",
            "ambience = 0.2",
            UnknownKey,
            "light.ambience",
            "ambient",
        ),
    ];
    for (from, to, fault, key, advice) in cases {
        assert!(DEMO.contains(from), "the demo scene has no {from}");
        let error = Scene::parse(&DEMO.replacen(from, to, 1), "s.toml").expect_err(to);
        let text = error.to_string();
        assert_eq!(error.fault(), *fault, "{from} → {to}: {text}");
        assert_eq!(error.key(), *key, "{from} → {to}: {text}");
        assert!(text.contains(advice), "{from} → {to}: {text}");
        assert!(text.starts_with("s.toml:"), "{text}");
    }
}

#[test]
fn optional_parts_have_defaults_and_all_forms_are_read() {
    let text = r#"
        planet = { semi_major_m = 1_000_000, semi_minor_m = 990e3 }
        layers = {}
        [camera]
        mode = "orbit"
        place = { latitude_deg = 0, longitude_deg = 0, altitude_m = 1e6, pitch_deg = -90 }
        centre = { latitude_deg = 90, longitude_deg = 0 }
        degrees_per_second = 6
        [light]
        sun = { latitude_deg = 23.4, longitude_deg = -60 }
        [atmosphere]
        enabled = false
        [mesh]
        refinement = 3
    "#;
    let scene = Scene::parse(text, "s.toml").unwrap();
    assert_eq!(scene.planet.semi_minor_m, 990_000.0);
    assert_eq!(
        scene.light.sun,
        Sun::Fixed {
            latitude_deg: 23.4,
            longitude_deg: -60.0
        }
    );
    assert!(!scene.atmosphere.enabled);
    assert_eq!(
        (
            scene.mesh.refinement,
            scene.mesh.tile_px,
            scene.mesh.deepest_level
        ),
        (3, 257.0, 22)
    );
    assert_eq!(
        (scene.mesh.refine, scene.mesh.tau, scene.mesh.wireframe),
        (Refine::TopDown, 1.0, false)
    );
    assert!(matches!(scene.camera, Camera::Orbit(_)));
}

#[test]
fn repositories_are_resolved_from_the_scene_file() {
    let text = DEMO.replacen(
        "\"../../out/data/imagery\"",
        "\"https://example.org/imagery\"",
        1,
    );
    let scene = Scene::parse(&text, "demo.toml")
        .unwrap()
        .resolve(Path::new("/wall/configs/scenes"))
        .unwrap();
    assert_eq!(
        scene.layers[1].repository.as_deref(),
        Some("/wall/configs/scenes/../../out/data/elevation")
    );
    assert_eq!(
        scene.layers[0].repository.as_deref(),
        Some("https://example.org/imagery")
    );
}
