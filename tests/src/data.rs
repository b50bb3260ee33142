//! The embedded data, imported, and walls and scenes small enough for tests.
//!
//! In: nothing. Out: paths and texts. The repositories are those that `make data` builds.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

use crate::{command, sources};

/// The folder with the repositories `elevation` and `imagery`, imported where they are missing or old.
pub fn repositories() -> PathBuf {
    static READY: OnceLock<()> = OnceLock::new();
    READY.get_or_init(|| {
        if std::env::var_os("TERRAWALL").is_some() {
            return; // an installed program is tested with the data that are there
        }
        let mut make = Command::new("make");
        make.args(["--no-print-directory", "data"])
            .current_dir(sources::root());
        command::forget_package(&mut make);
        let made = make.status();
        assert!(made.expect("make runs").success(), "make data failed");
    });
    sources::root().join("out/data")
}

/// One of the embedded source files.
pub fn embedded(name: &str) -> PathBuf {
    sources::root().join("tests/data").join(name)
}

/// Whether there is a Vulkan driver to render with. Without one a test says that it was skipped, and fails
/// where `REQUIRE_GPU` is set, as `make test` sets it.
pub fn driver() -> bool {
    let folders = [
        "/etc/vulkan",
        "/usr/share/vulkan",
        "/usr/local/share/vulkan",
        "/usr/local/etc/vulkan",
    ];
    let present = std::env::var_os("VK_DRIVER_FILES").is_some()
        || std::env::var_os("VK_ICD_FILENAMES").is_some()
        || folders.iter().any(|folder| {
            let drivers = std::fs::read_dir(PathBuf::from(folder).join("icd.d"));
            drivers
                .into_iter()
                .flatten()
                .flatten()
                .any(|file| file.path().extension().is_some_and(|e| e == "json"))
        });
    skip_unless(present, "a Vulkan driver (run make setup)")
}

/// Returns `present`; says loudly that a test is skipped without it, or fails where `REQUIRE_GPU` is set.
pub fn skip_unless(present: bool, what: &str) -> bool {
    assert!(
        present || std::env::var_os("REQUIRE_GPU").is_none(),
        "this test needs {what}"
    );
    if !present {
        eprintln!("SKIPPED: this test needs {what}");
    }
    present
}

/// A wall of `nodes` headless hosts named `node0`, `node1`… side by side, each `width`×`height` pixels.
pub fn wall(nodes: u32, width: u32, height: u32, fps: f64) -> String {
    let (canvas, pitch_m, bottom_m) = (nodes * width, 0.004, 1.0);
    let (half_m, height_m) = (
        f64::from(canvas) * pitch_m / 2.0,
        f64::from(height) * pitch_m,
    );
    // The head is before the middle, so near that the wall is 49° high.
    let mut text = format!(
        "[wall]\nname = \"test\"\nfps = {fps:.1}\n\n\
         [[observers]]\nname = \"viewer\"\nhead_m = [0.0, {:.3}, {:.3}]\n\n\
         [[screens]]\nname = \"front\"\nkind = \"planar\"\nobserver = \"viewer\"\nsize_px = [{canvas}, {height}]\n\
         corners_m = {{ bottom_left = [{:.3}, {bottom_m:.1}, 0.0], bottom_right = [{half_m:.3}, {bottom_m:.1}, 0.0], \
         top_left = [{:.3}, {:.3}, 0.0] }}\n",
        bottom_m + height_m / 2.0,
        height_m * 1.1,
        -half_m,
        -half_m,
        bottom_m + height_m
    );
    for node in 0..nodes {
        let _ = write!(
            text,
            "\n[[hosts]]\nname = \"node{node}\"\n[[hosts.outputs]]\nname = \"out\"\nsize_px = [{width}, {height}]\n\
             headless = true\nchannels = [{{ screen = \"front\", canvas_px = [{}, 0, {width}, {height}] }}]\n",
            node * width
        );
    }
    text
}

/// A scene with the embedded data and a camera that holds still over Africa, all of the globe in view.
pub fn scene() -> String {
    let data = repositories();
    format!(
        "[camera]\nmode = \"fixed\"\n\
         place = {{ latitude_deg = 10.0, longitude_deg = 15.0, altitude_m = 12e6, pitch_deg = -90.0 }}\n\n\
         [layers.relief]\nkind = \"elevation\"\nrepository = \"{0}/elevation\"\n\n\
         [layers.colour]\nkind = \"imagery\"\nrepository = \"{0}/imagery\"\n",
        data.display()
    )
}

/// A folder that vanishes with the test, holding these files.
pub fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).expect("a writable folder");
    }
    folder
}
