//! `terrawall check`: what it says of the shipped walls, of walls with one mistake each, and the plans that it draws.
//! In: wall files. Out: verdicts on findings and on SVG. Nothing is rendered here.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::indexing_slicing,
    reason = "a test that panics has failed"
)]

#[path = "check/odd.rs"]
mod odd;
#[path = "check/plan.rs"]
mod plan;

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// The text of a shipped wall.
fn shipped(name: &str) -> String {
    std::fs::read_to_string(walls().join(format!("{name}.toml"))).unwrap()
}

fn walls() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/walls")
}

/// Runs `terrawall check` on a file; standard output, if it succeeds.
fn check(file: &Path, options: &[&str]) -> String {
    let ran = Command::new(env!("CARGO_BIN_EXE_terrawall"))
        .arg("check")
        .arg(file)
        .args(options)
        .output()
        .unwrap();
    let said = String::from_utf8(ran.stderr).unwrap();
    assert!(ran.status.success(), "{}: {said}", file.display());
    String::from_utf8(ran.stdout).unwrap()
}

/// The findings of a wall's text.
fn findings(text: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("wall.toml");
    std::fs::write(&file, text).unwrap();
    serde_json::from_str(&check(&file, &["--json"])).unwrap()
}

/// What is odd about a wall.
fn warnings(text: &str) -> Vec<String> {
    let findings = findings(text);
    let warnings = findings["warnings"].as_array().unwrap();
    let texts = warnings.iter().map(|it| it.as_str().unwrap().to_owned());
    texts.collect()
}

/// The names of all shipped walls.
fn all() -> Vec<String> {
    let files = std::fs::read_dir(walls()).unwrap();
    let names = files.filter_map(|file| {
        let path = file.unwrap().path();
        let is_wall = path.extension().is_some_and(|end| end == "toml");
        is_wall.then(|| path.file_stem().unwrap().to_str().unwrap().to_owned())
    });
    names.collect()
}

#[test]
fn nothing_is_odd_about_shipped_walls_but_pixels_behind_bezels() {
    let names = all();
    assert!(names.len() >= 7, "{names:?}");
    for name in names {
        let said = check(&walls().join(format!("{name}.toml")), &[]);
        let odd: Vec<&str> = said.lines().filter(|line| line.contains("odd: ")).collect();
        if name.contains("bezels") {
            assert!(odd.len() == 1 && odd[0].contains("behind bezels"), "{said}");
        } else {
            assert!(odd.is_empty() && said.contains("nothing odd"), "{said}");
        }
    }
}

#[test]
fn screens_are_told_of_in_figures() {
    let close = |value: &Value, expected: f64, tolerance: f64| {
        let found = value.as_f64().unwrap();
        assert!(
            (found - expected).abs() <= tolerance,
            "{found}, not {expected}"
        );
    };
    // A segment of Siegen: an arc of 49.5° on a radius of 2.4912 m, seen from its axis. Its middle row is 0.48 m below the
    // head, by which it is farther away.
    let siegen = findings(&shipped("vrlab-siegen"));
    let wall = &siegen["screens"][1];
    assert_eq!(wall["kind"], "cylinder");
    assert_eq!(wall["size_px"], serde_json::json!([1050, 1400]));
    let angle = 2.0 * (1.0421_f64 / 2.4912).asin();
    close(&wall["size_m"][0], 2.4912 * angle, 0.01);
    let field_of_view = angle * 2.4912 / 2.4912_f64.hypot(0.48 * 1.05);
    close(
        &wall["field_of_view_deg"][0],
        field_of_view.to_degrees(),
        0.1,
    );
    close(&wall["distance_m"], 2.4912, 1e-6);
    assert_eq!(
        wall["outputs"],
        serde_json::json!({ "centre": 0, "left": 1, "right": 1 })
    );
    // The densest is between the columns' density at the middle of the chord and twice that.
    let sparsest = wall["pixels_per_radian"]["sparsest"].as_f64().unwrap();
    let densest = wall["pixels_per_radian"]["densest"].as_f64().unwrap();
    assert!(sparsest > 1000.0 && densest > sparsest && densest < 2.0 * sparsest);
    assert_eq!(siegen["trackers"][0]["observers"][0], "viewer");
    close(&siegen["observers"][0]["left_eye_m"][0], -0.0315, 1e-6);
    // Keys that programs know since there are only planes.
    for key in [
        "name",
        "fps",
        "hosts",
        "outputs",
        "pixels",
        "pixels_per_radian",
    ] {
        assert!(!siegen[key].is_null(), "{key}");
    }
    assert_eq!(siegen["outputs"], 12);

    let dome = findings(&shipped("dome-5"));
    let top = &dome["screens"][4];
    assert_eq!(top["kind"], "sphere");
    // Across the circle: 76° of a radius of 4 m.
    close(&top["size_m"][0], 4.0 * 76.0_f64.to_radians(), 0.01);

    let single = findings(&shipped("single"));
    let monitor = &single["screens"][0];
    assert_eq!(monitor["kind"], "planar");
    close(&monitor["size_m"][0], 0.64, 1e-9);
    close(&monitor["distance_m"], 0.6, 1e-9);
    let degrees = 2.0 * (0.32_f64 / 0.6).atan().to_degrees();
    close(&monitor["field_of_view_deg"][0], degrees, 1e-6);
    close(&monitor["pixels_per_radian"]["sparsest"], 1200.0, 1e-6);
    assert_eq!(monitor["outputs"]["centre"], 1);
}

#[test]
fn calibrated_channels_are_told_of_where_they_fall() {
    let file = walls().join("pair-mpcdi.toml");
    let pair: Value = serde_json::from_str(&check(&file, &["--json"])).unwrap();
    let channels = pair["calibrated"].as_array().unwrap();
    let named: Vec<&str> = channels
        .iter()
        .map(|channel| channel["output"].as_str().unwrap())
        .collect();
    assert_eq!(named, ["projection/left", "projection/right"]);
    let densest = |of: &Value| of["pixels_per_radian"]["densest"].as_f64().unwrap();
    let most = channels.iter().map(densest).fold(0.0, f64::max);
    // The canvas has as many rows for as much height, but each projector stands askew and shows a little more.
    let canvas = densest(&pair["screens"][0]);
    assert!(most > canvas && most < 1.1 * canvas, "{most} {canvas}");
    assert_eq!(pair["pixels_per_radian"].as_f64(), Some(most));
    let said = check(&file, &[]);
    let words =
        "output projection/left: 1280×800 pixels on screen front by pair.mpcdi, region left, ";
    assert!(said.contains(words), "{said}");
}

#[test]
fn the_text_names_kinds_sizes_and_eyes() {
    let said = check(&walls().join("vrlab-siegen.toml"), &[]);
    for words in [
        "6 screens, 6 hosts, 12 outputs",
        "screen wall-1: cylinder, 1050×1400 pixels",
        "screen floor-6: planar, 1400×1050 pixels, 3.19×2.41 m, 1.78 m away",
        "pixels to a radian, shown by 1 output for the left eye and 1 output for the right eye",
    ] {
        assert!(said.contains(words), "{words} is not in\n{said}");
    }
}
