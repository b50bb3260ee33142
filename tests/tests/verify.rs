//! Tiled equals single: the demonstration wall at six poses, real processes, not one pixel different.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use tests::{command, data, pictures};

/// Verifies one pose; the picture must also show something.
fn verify(pose: &str, least_colours: usize) {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    data::repositories();
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    command::succeed(&format!(
        "verify configs/walls/demo-2x2.toml --scene configs/scenes/{pose}.toml --report {} --difference {} --keep {}",
        at("report.json"),
        at("difference.png"),
        at("keep")
    ));
    let report: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(at("report.json")).unwrap()).unwrap();
    assert_eq!(report["pixels"], 1280 * 720, "{report}");
    assert_eq!(report["differing"], 0, "{report}");
    assert_eq!(report["max_channel_difference"], 0, "{report}");
    let difference = pictures::load(folder.path().join("difference.png").as_path());
    assert_eq!(pictures::colours(&difference), 1);
    let picture = pictures::load(folder.path().join("keep/tiled/wall.png").as_path());
    let colours = pictures::colours(&picture);
    assert!(
        colours >= least_colours,
        "{pose} shows only {colours} colours"
    );
}

#[test]
fn globe() {
    verify("verify-globe", 5000);
}

#[test]
fn limb() {
    verify("verify-limb", 2000);
}

#[test]
fn mountains() {
    verify("verify-mountains", 5000);
}

#[test]
fn pole() {
    verify("verify-pole", 500);
}

#[test]
fn horizon() {
    verify("verify-horizon", 500);
}

/// Fused layers, contour lines and the rim of a lens across the borders of the displays.
#[test]
fn layers() {
    verify("layers", 5000);
}
