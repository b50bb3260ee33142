//! What `convert` makes of other systems' configurations are walls: every sample is accepted, and checked.
//!
//! In: the samples that the converter's own tests have. Out: verdicts of the real program. It judges no sentence of a list of
//! what is lost; the converter's own tests do.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::path::{Path, PathBuf};

use calibration::{Calibration, Gamma, Mapping, Region, Uplift, mpcdi};
use protocol::Wall;
use tests::{command, sources};

/// Fewest samples there must be, so that a folder that moved does not pass.
const FEWEST: usize = 10;

/// The samples that the converter's own tests have.
fn samples() -> Vec<PathBuf> {
    let folder = sources::root().join("master/convert/tests/samples");
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder)
        .expect("the samples")
        .map(|entry| entry.unwrap().path())
        .filter(|path| {
            let ending = path.extension().and_then(|ending| ending.to_str());
            ending.is_some_and(|ending| ["qvr", "json", "eqc"].contains(&ending))
        })
        .collect();
    found.sort();
    assert!(found.len() >= FEWEST, "{found:?}");
    found
}

/// Every sample is converted to a wall that the program accepts: by its parser, and by `check`, whose warnings may be many
/// but which finds no error.
#[test]
fn every_sample_becomes_a_wall() {
    let folder = tempfile::tempdir().unwrap();
    let mut calibrated = 0;
    for sample in samples() {
        let name = sample.file_name().unwrap().to_str().unwrap();
        let made = folder.path().join(format!("{name}.toml"));
        let arguments = [
            "convert".as_ref(),
            sample.as_os_str(),
            "--into".as_ref(),
            made.as_os_str(),
        ];
        let ran = command::run(arguments);
        assert_eq!(ran.code, Some(0), "{name}: {}", ran.stderr);
        let text = std::fs::read_to_string(&made).unwrap();
        let wall = Wall::parse(&text, name).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(
            !wall.observers.is_empty() && !wall.screens.is_empty(),
            "{name} has nobody, or nothing to look at"
        );
        for host in &wall.hosts {
            assert!(!host.outputs.is_empty(), "{name}: {}", host.name);
        }
        calibrated += write_calibrations(&wall, folder.path());
        let checked = command::run(["check".as_ref(), made.as_os_str()]);
        assert_eq!(checked.code, Some(0), "{name}: {}", checked.stderr);
        assert!(checked.stdout.contains(" screen"), "{}", checked.stdout);
    }
    assert!(calibrated > 0, "no sample has a calibration any more");
}

/// Writes the archives that a wall names: the samples come without them. Returns how many there are.
fn write_calibrations(wall: &Wall, folder: &Path) -> usize {
    let outputs = wall.hosts.iter().flat_map(|host| &host.outputs);
    let channels = outputs.flat_map(|output| &output.channels);
    let mut count = 0;
    for (channel, named) in
        channels.filter_map(|channel| Some((channel, channel.calibration.as_ref()?)))
    {
        let region = Region {
            name: "sample".to_owned(),
            size_px: channel.size_px,
            mapping: Mapping::Identity,
            alpha: None,
            beta: None,
            gamma: Gamma::default(),
            uplift: Uplift::default(),
            canvas: None,
            distortion: None,
        };
        let archive = Calibration {
            regions: vec![region],
            ..Calibration::default()
        };
        let file = folder.join(&named.file);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, mpcdi::write(&archive).unwrap()).unwrap();
        count += 1;
    }
    count
}

/// The program reads back all tables of the files that the converter writes,
/// for a desk of each system.
#[test]
fn desks_keep_their_screens_hosts_and_observers() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["desk.qvr", "desk.json", "desk.eqc"] {
        let sample = sources::root()
            .join("master/convert/tests/samples")
            .join(name);
        let made = folder.path().join(format!("{name}.toml"));
        let ran = command::run([
            "convert".as_ref(),
            sample.as_os_str(),
            "--into".as_ref(),
            made.as_os_str(),
        ]);
        assert_eq!(ran.code, Some(0), "{name}: {}", ran.stderr);
        let text = std::fs::read_to_string(&made).unwrap();
        let wall = Wall::parse(&text, name).unwrap();
        let document: toml::Table = text.parse().unwrap();
        let of = |table: &toml::Table, key: &str| {
            table
                .get(key)
                .and_then(toml::Value::as_array)
                .map_or(0, Vec::len)
        };
        assert_eq!(wall.screens.len(), of(&document, "screens"), "{name}");
        assert_eq!(wall.hosts.len(), of(&document, "hosts"), "{name}");
        assert_eq!(wall.observers.len(), of(&document, "observers"), "{name}");
        assert_eq!(wall.trackers.len(), of(&document, "trackers"), "{name}");
        assert!(wall.pixels_per_radian() > 100.0, "{name}");
    }
}
