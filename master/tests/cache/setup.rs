//! What `terrawall cache warm` needs in a test: a tiny repository, a path over it, a wall of two hosts.
//!
//! In: nothing. Out: a folder with all of it, and runs of the program over it. It judges nothing but their exit status.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{outcome, succeed, text};

/// Side of the tiny source grid.
const SIDE: i32 = 90;

/// A wall of two hosts, a scene that flies over a tiny repository, and where they keep what.
pub(super) struct Setup {
    folder: tempfile::TempDir,
}

impl Setup {
    pub(super) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let setup = Self { folder };
        let mut grid = Vec::new();
        for row in 0..=SIDE {
            for column in 0..=SIDE {
                grid.extend((50 * (SIDE - row) + 5 * column).to_le_bytes());
            }
        }
        std::fs::write(setup.path("plane.raw"), grid).unwrap();
        let size = format!("{0}x{0}", SIDE + 1);
        let (source, into) = (setup.path("plane.raw"), setup.path("relief"));
        let mut line = vec!["import", text(&source), "--into", text(&into)];
        line.extend(["--kind", "elevation", "--extent", "0,0,45,45"]);
        line.extend([
            "--registration",
            "node",
            "--raw-type",
            "i32",
            "--level",
            "3",
        ]);
        line.extend(["--raw-size", &size]);
        succeed(&line);
        std::fs::write(setup.path("scene.toml"), SCENE).unwrap();
        std::fs::write(setup.path("wall.toml"), setup.wall(64)).unwrap();
        setup
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(super) fn wall(&self, disk_mib: u64) -> String {
        let mut wall = format!(
            "[wall]\nname = \"test\"\nfps = 10.0\n\n\
             [cache]\ndirectory = \"{}\"\nram_mib = 64\ngpu_mib = 256\ndisk_mib = {disk_mib}\n\n\
             [[observers]]\nname = \"viewer\"\nhead_m = [0.0, 1.4, 2.0]\n\n\
             [[screens]]\nname = \"front\"\nkind = \"planar\"\nobserver = \"viewer\"\nsize_px = [512, 144]\n\
             corners_m = {{ bottom_left = [-1.5, 1.0, 0.0], bottom_right = [1.5, 1.0, 0.0], \
             top_left = [-1.5, 1.84375, 0.0] }}\n",
            self.path("cache").display()
        );
        for host in 0..2 {
            wall.push_str(&format!(
                "\n[[hosts]]\nname = \"node{host}\"\n[[hosts.outputs]]\nname = \"out\"\nsize_px = [256, 144]\n\
                 headless = true\nchannels = [{{ screen = \"front\", canvas_px = [{}, 0, 256, 144] }}]\n",
                256 * host
            ));
        }
        wall
    }

    /// The arguments, and what they came to.
    pub(super) fn warm(&self, wall: &str, more: &[&str]) -> (Option<i32>, String, String) {
        let (wall, scene) = (self.path(wall), self.path("scene.toml"));
        let mut line = vec!["cache", "warm", text(&wall), "--scene", text(&scene)];
        line.extend(more);
        outcome(&line)
    }

    pub(super) fn summary(&self, more: &[&str]) -> Value {
        let (status, result, complaint) = self.warm("wall.toml", &[&["--json"], more].concat());
        assert_eq!(status, Some(0), "{result}{complaint}");
        serde_json::from_str(&result).unwrap()
    }
}

pub(super) const SCENE: &str = "\
[camera]
mode = \"path\"
looped = false
keyframes = [
    { time_s = 0, place = { latitude_deg = 20, longitude_deg = 20, altitude_m = 8e6, pitch_deg = -90 } },
    { time_s = 2, place = { latitude_deg = 22, longitude_deg = 24, altitude_m = 2e5, pitch_deg = -60 } },
]

[layers.relief]
kind = \"elevation\"
repository = \"relief\"
";

/// Whether there is a Vulkan driver; fails where there must be one.
pub(super) fn driver() -> bool {
    let named = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];
    let folders = [
        "/etc/vulkan",
        "/usr/share/vulkan",
        "/usr/local/share/vulkan",
        "/usr/local/etc/vulkan",
    ];
    let present = named.iter().any(|name| std::env::var_os(name).is_some())
        || folders.iter().any(|folder| {
            let drivers = std::fs::read_dir(Path::new(folder).join("icd.d"));
            let mut drivers = drivers.into_iter().flatten().flatten();
            drivers.any(|file| file.path().extension().is_some_and(|e| e == "json"))
        });
    assert!(
        present || std::env::var_os("REQUIRE_GPU").is_none(),
        "this test needs a Vulkan driver (run make setup)"
    );
    if !present {
        eprintln!("SKIPPED: this test needs a Vulkan driver (run make setup)");
    }
    present
}
