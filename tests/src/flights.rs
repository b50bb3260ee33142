//! Walls that fly over data wherever they lie, with a disk cache of their own or a shared one.
//!
//! In: where repositories, cache and camera are. Out: the report, the whole wall's last picture, what was said. It judges
//! nothing.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use image::RgbImage;
use serde_json::Value;

use crate::{command, data, pictures};

/// A flight.
#[derive(Clone, Debug)]
pub struct Flight {
    /// Headless nodes side by side.
    pub nodes: u32,
    /// Pixels of each.
    pub size_px: [u32; 2],
    /// Frames a second.
    pub fps: f64,
    /// Frames; what remains of the path is not flown, and at its end the camera rests.
    pub frames: u64,
    /// Seconds and places, as scene files write them.
    pub path: Vec<(f64, String)>,
    /// Where repositories of elevation and imagery are.
    pub repositories: [String; 2],
    /// Lines of the wall's `[cache]`.
    pub cache: String,
    /// Variables of the program's environment.
    pub environment: Vec<(String, String)>,
}

/// What came of it.
#[derive(Debug)]
pub struct Flown {
    /// The report.
    pub report: Value,
    /// All outputs as one picture.
    pub picture: RgbImage,
    /// What was written to standard error.
    pub words: String,
}

/// A flight in progress.
#[derive(Debug)]
pub struct Flying {
    running: command::Running,
    folder: tempfile::TempDir,
}

impl Flight {
    /// Over the embedded data, which are here, with a cache in this directory.
    ///
    /// # Panics
    /// Where the data cannot be imported.
    #[must_use]
    pub fn here(cache: &Path) -> Self {
        let at = |name: &str| data::repositories().join(name).display().to_string();
        Self {
            nodes: 2,
            size_px: [96, 54],
            fps: 5.0,
            frames: 1,
            path: vec![(0.0, above_the_alps(5e5))],
            repositories: [at("elevation"), at("imagery")],
            cache: directory(cache),
            environment: Vec::new(),
        }
    }

    fn scene(&self) -> String {
        let mut scene = match self.path.as_slice() {
            [(_, place)] => format!("[camera]\nmode = \"fixed\"\nplace = {place}\n"),
            path => {
                let mut scene = "[camera]\nmode = \"path\"\nkeyframes = [\n".to_owned();
                for (time_s, place) in path {
                    let _ = writeln!(scene, "    {{ time_s = {time_s}, place = {place} }},");
                }
                scene + "]\n"
            }
        };
        for (name, kind, repository) in [
            ("relief", "elevation", &self.repositories[0]),
            ("colour", "imagery", &self.repositories[1]),
        ] {
            let _ = writeln!(
                scene,
                "[layers.{name}]\nkind = \"{kind}\"\nrepository = {repository:?}"
            );
        }
        scene
    }

    /// Takes off.
    ///
    /// # Panics
    /// Where the program cannot be started.
    #[must_use]
    pub fn start(&self) -> Flying {
        let mut wall = data::wall(self.nodes, self.size_px[0], self.size_px[1], self.fps);
        let _ = write!(wall, "\n[cache]\n{}\n", self.cache);
        let folder = data::folder(&[("wall.toml", &wall), ("scene.toml", &self.scene())]);
        let at = |name: &str| folder.path().join(name).display().to_string();
        let line = format!(
            "up {} --scene {} --headless --no-control --no-error --frames {} --capture {} --report {}",
            at("wall.toml"),
            at("scene.toml"),
            self.frames,
            at("pictures"),
            at("report.json")
        );
        let environment: Vec<(&str, &str)> = self
            .environment
            .iter()
            .map(|(name, value)| (name.as_str(), value.as_str()))
            .collect();
        let running = command::start_with(line.split_whitespace(), &environment);
        Flying { running, folder }
    }

    /// Flies to the end.
    ///
    /// # Panics
    /// Where the program fails.
    #[must_use]
    pub fn fly(&self) -> Flown {
        self.start().land()
    }
}

impl Flying {
    /// Waits for the end, whatever it is.
    #[must_use]
    pub fn end(self) -> command::Ran {
        self.running.wait()
    }

    /// Waits for the end.
    ///
    /// # Panics
    /// Where the program fails.
    #[must_use]
    pub fn land(self) -> Flown {
        let ran = self.running.wait();
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        let report = std::fs::read_to_string(self.folder.path().join("report.json"));
        Flown {
            report: serde_json::from_str(&report.expect("a report")).expect("a report in JSON"),
            picture: pictures::load(&self.folder.path().join("pictures/wall.png")),
            words: ran.stderr,
        }
    }
}

impl Flown {
    /// A number of the report, by its path of keys (RFC 6901).
    ///
    /// # Panics
    /// Where there is none.
    #[must_use]
    pub fn number(&self, key: &str) -> f64 {
        let value = self.report.pointer(key).and_then(Value::as_f64);
        value.unwrap_or_else(|| panic!("no number {key} in {:#}", self.report))
    }

    /// A count of what tile caches did.
    ///
    /// # Panics
    /// Where there is none.
    #[must_use]
    pub fn tiles(&self, key: &str) -> u64 {
        self.number(&format!("/tiles/{key}")) as u64
    }
}

/// The line of `[cache]` that names a directory.
#[must_use]
pub fn directory(cache: &Path) -> String {
    format!("directory = {:?}", cache.display().to_string())
}

/// A place over the Alps, looking straight down.
#[must_use]
pub fn above_the_alps(altitude_m: f64) -> String {
    format!(
        "{{ latitude_deg = 45.8, longitude_deg = 6.9, altitude_m = {altitude_m:.1}, pitch_deg = -90 }}"
    )
}

/// The files that a cache directory keeps tiles in, in order.
///
/// # Panics
/// Where it cannot be read.
#[must_use]
pub fn cached(root: &Path) -> Vec<PathBuf> {
    let (mut files, mut open) = (Vec::new(), vec![root.to_owned()]);
    while let Some(directory) = open.pop() {
        for entry in std::fs::read_dir(directory).expect("a directory") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|ending| ending == "cached") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}
