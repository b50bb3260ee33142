//! Imports by the real program: values, refinement, interruption and a full disk.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use serde_json::Value;
use tests::{command, data};

/// Side of the tiny source grids.
const SIDE: i32 = 90;

/// Heights of a plane over latitude and longitude, in whole metres: any bilinear reading is exact.
fn plane(latitude_deg: f64, longitude_deg: f64) -> f64 {
    100.0 * latitude_deg + 10.0 * longitude_deg
}

/// A headerless grid of i16 of [`plane`] between 0° and 45°, nodes on the edges.
fn write_plane(path: &Path) {
    let mut bytes = Vec::new();
    for row in 0..=SIDE {
        for column in 0..=SIDE {
            let (latitude_deg, longitude_deg) =
                (f64::from(SIDE - row) / 2.0, f64::from(column) / 2.0);
            bytes.extend((plane(latitude_deg, longitude_deg) as i16).to_le_bytes());
        }
    }
    std::fs::write(path, bytes).unwrap();
}

fn inspect(repository: &Path, latitude_deg: f64, longitude_deg: f64) -> Value {
    let line = format!(
        "inspect {} --at {latitude_deg},{longitude_deg} --json",
        repository.display()
    );
    serde_json::from_str(&command::succeed(&line)).unwrap()
}

#[test]
fn an_imported_plane_reads_back_as_a_plane() {
    let folder = tempfile::tempdir().unwrap();
    let (source, into) = (
        folder.path().join("plane.raw"),
        folder.path().join("repository"),
    );
    write_plane(&source);
    command::succeed(&format!(
        "import {} --kind elevation --extent 0,0,45,45 --registration node --raw-size {2}x{2} --raw-type i16 --into {}",
        source.display(),
        into.display(),
        SIDE + 1
    ));
    for (latitude_deg, longitude_deg) in [
        (10.0, 20.0),
        (33.25, 7.125),
        (1.0, 44.0),
        (44.5, 0.5),
        (22.123, 31.415),
    ] {
        let found = inspect(&into, latitude_deg, longitude_deg);
        assert_eq!(found["valid"], true, "{found}");
        assert!(
            found["level"].is_u64() && !found["tile"].is_null(),
            "{found}"
        );
        let (value, expected) = (
            found["value"].as_f64().unwrap(),
            plane(latitude_deg, longitude_deg),
        );
        // Half of the smaller difference between neighbouring samples of the source.
        assert!(
            (value - expected).abs() <= 2.5,
            "at {latitude_deg}, {longitude_deg}: {value}, not {expected}"
        );
    }
    assert_eq!(inspect(&into, -30.0, 100.0)["valid"], false);
    let whole = command::succeed(&format!("inspect {} --json", into.display()));
    assert!(
        serde_json::from_str::<Value>(&whole).unwrap().is_object(),
        "{whole}"
    );
}

#[test]
fn the_embedded_data_show_known_places() {
    let repositories = data::repositories();
    // Mont Blanc and Chamonix from the fine cell; the Dead Sea, Everest's massif and the Mariana Trench from the globe.
    for (latitude_deg, longitude_deg, low, high) in [
        (45.8326, 6.8652, 4600.0, 4810.0),
        (45.9237, 6.8694, 1000.0, 1150.0),
        (27.99, 86.92, 4500.0, 8850.0),
        (11.35, 142.2, -11000.0, -8000.0),
    ] {
        let found = inspect(&repositories.join("elevation"), latitude_deg, longitude_deg);
        let value = found["value"].as_f64().unwrap();
        assert!(
            (low..=high).contains(&value),
            "{latitude_deg}, {longitude_deg}: {found}"
        );
    }
    let sahara = inspect(&repositories.join("imagery"), 23.0, 10.0);
    let channels: Vec<f64> = sahara["value"]
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect();
    assert!(
        channels.len() == 3 && channels[0] > channels[2] + 20.0,
        "{sahara}"
    );
}

#[test]
fn an_import_that_is_killed_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let (killed, whole) = (folder.path().join("killed"), folder.path().join("whole"));
    let line = |into: &Path| {
        let source = data::embedded("etopo5.tif");
        format!(
            "import {} --kind elevation --into {}",
            source.display(),
            into.display()
        )
    };
    let running = command::start(line(&killed).split_whitespace());
    std::thread::sleep(Duration::from_millis(1500));
    running.signal("KILL");
    let _ = running.wait();
    command::succeed(&line(&killed));
    command::succeed(&line(&whole));
    for (latitude_deg, longitude_deg) in [
        (0.0, 0.0),
        (46.5, 8.0),
        (-89.9, 30.0),
        (10.0, 179.99),
        (35.3, -45.0),
    ] {
        let [a, b] = [&killed, &whole].map(|into| inspect(into, latitude_deg, longitude_deg));
        assert_eq!(a, b);
    }
}

#[test]
fn a_full_disk_is_told_and_leaves_the_repository_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let mounted = Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=3m", "terrawall-test"])
        .arg(folder.path())
        .output()
        .is_ok_and(|output| output.status.success());
    if !mounted {
        // Only root may mount, and not in every container: this is no matter of the graphics driver.
        eprintln!("SKIPPED: a full disk needs the right to mount a small file system");
        return;
    }
    let into = folder.path().join("repository");
    let source = data::embedded("etopo5.tif");
    let ran = command::run([
        "import".as_ref(),
        source.as_os_str(),
        "--kind".as_ref(),
        "elevation".as_ref(),
        "--into".as_ref(),
        into.as_os_str(),
    ]);
    let (code, message, published) = (ran.code, ran.stderr, into.join("dataset.toml").exists());
    let unmounted = Command::new("umount").arg(folder.path()).status();
    assert_eq!(code, Some(1), "{message}");
    assert!(
        message.contains("full") || message.contains("No space"),
        "{message}"
    );
    assert!(
        !published,
        "a repository without its tiles must not look complete"
    );
    assert!(unmounted.is_ok_and(|status| status.success()));
}
