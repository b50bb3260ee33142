//! Imports that are stopped: killed, cancelled, locked out, out of space.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod support;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use import::{ImportError, Progress, import};
use support::{Placement, Random, Values, options, run, write_bands, write_geotiff};
use tiff::encoder::colortype::{RGB16, RGB32Float};
use tiff::tags::ExtraSamples;
use tiles::Kind;

/// Set for the process that is to be killed.
const CHILD_SOURCE: &str = "IMPORT_TEST_SOURCE";
const CHILD_INTO: &str = "IMPORT_TEST_INTO";

const PLACEMENT: Placement = Placement {
    epsg: 4326,
    geographic: true,
    x: 10.0,
    y: 50.0,
    dx: 0.002,
    dy: 0.002,
    point: false,
};

fn source(directory: &Path) -> PathBuf {
    let path = directory.join("source.tif");
    write_geotiff(&path, 1600, 1200, PLACEMENT, None, |column, row| {
        let mut random = Random(u64::from(column / 3) << 32 | u64::from(row / 3));
        random.within(0.0, 3000.0) as f32
    });
    path
}

/// Cancels after so many steps, and keeps the notes.
struct Stopper<'cancel> {
    cancel: &'cancel AtomicBool,
    left: AtomicU64,
    notes: Mutex<Vec<String>>,
}

impl Progress for Stopper<'_> {
    fn phase(&self, _name: &str, _total: u64) {}
    fn advance(&self, steps: u64) {
        if self.left.fetch_sub(steps, Ordering::Relaxed) <= steps {
            self.cancel.store(true, Ordering::Relaxed);
        }
    }
    fn note(&self, line: &str) {
        self.notes.lock().unwrap().push(line.to_owned());
    }
}

fn same_tiles(one: &Path, other: &Path) {
    let [mut one, mut other] = [Values::open(one), Values::open(other)];
    let tiles = one.repository.tiles().unwrap();
    assert_eq!(tiles, other.repository.tiles().unwrap());
    for (tile, _) in tiles {
        assert_eq!(one.tile(tile), other.tile(tile));
    }
    assert_eq!(
        one.repository.load_index().unwrap(),
        other.repository.load_index().unwrap()
    );
}

fn staged_tiles(into: &Path) -> Vec<(PathBuf, std::time::SystemTime)> {
    fn walk(directory: &Path, found: &mut Vec<(PathBuf, std::time::SystemTime)>) {
        for entry in std::fs::read_dir(directory).into_iter().flatten().flatten() {
            if entry.path().is_dir() {
                walk(&entry.path(), found);
            } else if entry.path().extension().is_some_and(|e| e == "tile") {
                found.push((entry.path(), entry.metadata().unwrap().modified().unwrap()));
            }
        }
    }
    let mut found = Vec::new();
    walk(&into.join(".staging"), &mut found);
    found
}

/// Not a test of its own: what the process that is killed runs.
#[test]
fn child_import() {
    let (Ok(source), Ok(into)) = (std::env::var(CHILD_SOURCE), std::env::var(CHILD_INTO)) else {
        return;
    };
    let mut asked = options(Kind::Elevation, &[source.into()], Path::new(&into));
    asked.threads = Some(1);
    run(&asked).unwrap();
}

#[test]
fn a_killed_import_goes_on_where_it_stopped() {
    let directory = tempfile::tempdir().unwrap();
    let source = source(directory.path());
    let into = directory.path().join("killed");
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "child_import", "--nocapture"])
        .env(CHILD_SOURCE, &source)
        .env(CHILD_INTO, &into)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let began = Instant::now();
    while staged_tiles(&into).len() < 5 {
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "the import does not start"
        );
        assert!(
            child.try_wait().unwrap().is_none(),
            "the import ended before it could be killed"
        );
        std::thread::sleep(Duration::from_millis(1));
    }
    // While it works, no other may.
    let error = run(&options(
        Kind::Elevation,
        std::slice::from_ref(&source),
        &into,
    ))
    .unwrap_err();
    assert!(matches!(error, ImportError::Locked { .. }), "{error}");
    // On Unix this is SIGKILL.
    child.kill().unwrap();
    child.wait().unwrap();
    // Readers see that there is nothing yet, and never half a tile.
    assert!(!into.join("index.bin").exists());
    let finished = staged_tiles(&into);
    assert!(finished.len() >= 5);

    // Most of the rest, then a stop on request: the tiles of the killed process are untouched by then.
    let cancel = AtomicBool::new(false);
    let stopper = Stopper {
        cancel: &cancel,
        left: AtomicU64::new(finished.len() as u64 + 10),
        notes: Mutex::default(),
    };
    let asked = options(Kind::Elevation, std::slice::from_ref(&source), &into);
    assert!(matches!(
        import(&asked, &stopper, &cancel),
        Err(ImportError::Cancelled)
    ));
    let now = staged_tiles(&into);
    assert!(now.len() > finished.len());
    for tile in &finished {
        assert!(now.contains(tile), "{tile:?} was made again");
    }
    let report = run(&asked).unwrap();
    assert!(report.resumed);
    assert!(!into.join(".staging").exists() && !into.join(".import.lock").exists());

    let whole = directory.path().join("whole");
    let plain = run(&options(Kind::Elevation, &[source], &whole)).unwrap();
    assert_eq!(
        (plain.tiles, plain.bytes, plain.resumed),
        (report.tiles, report.bytes, false)
    );
    same_tiles(&into, &whole);
}

#[test]
fn raw_imagery_goes_on_where_it_stopped() {
    let directory = tempfile::tempdir().unwrap();
    for sample_type in [tiles::SampleType::U16, tiles::SampleType::F32] {
        let path = directory.path().join(format!("{sample_type:?}.tif"));
        let number = |column: u32, row: u32, band: usize| {
            let mut random = Random(u64::from(column / 3) << 32 | u64::from(row / 3));
            random.within(0.0, 60_000.0) + band as f64
        };
        let infrared = [ExtraSamples::Unspecified];
        let size = (1000, 700);
        if sample_type == tiles::SampleType::U16 {
            write_bands::<RGB16>(&path, size, PLACEMENT, None, &infrared, |c, r, b| {
                number(c, r, b) as u16
            });
        } else {
            write_bands::<RGB32Float>(&path, size, PLACEMENT, None, &infrared, |c, r, b| {
                number(c, r, b) as f32
            });
        }
        let [into, whole] =
            ["stopped", "whole"].map(|n| directory.path().join(format!("{n}{sample_type:?}")));
        let cancel = AtomicBool::new(false);
        let stopper = Stopper {
            cancel: &cancel,
            left: AtomicU64::new(30),
            notes: Mutex::default(),
        };
        // One thread takes the tiles in one order: some of those without data, some with.
        let mut asked = options(Kind::Imagery, std::slice::from_ref(&path), &into);
        asked.threads = Some(1);
        assert!(matches!(
            import(&asked, &stopper, &cancel),
            Err(ImportError::Cancelled)
        ));
        let finished = staged_tiles(&into);
        assert!(finished.len() >= 4, "{}", finished.len());
        assert!(run(&asked).unwrap().resumed);
        let plain = run(&options(Kind::Imagery, &[path], &whole)).unwrap();
        assert!(plain.tiles > finished.len() as u64 && !plain.resumed);
        same_tiles(&into, &whole);
        let dataset = Values::open(&into).repository.dataset().clone();
        assert_eq!((dataset.sample_type, dataset.channels), (sample_type, 4));
    }
}

#[test]
fn broken_staged_tiles_are_made_again() {
    let directory = tempfile::tempdir().unwrap();
    let source = source(directory.path());
    let into = directory.path().join("broken");
    let cancel = AtomicBool::new(false);
    let stopper = Stopper {
        cancel: &cancel,
        left: AtomicU64::new(8),
        notes: Mutex::default(),
    };
    let asked = options(Kind::Elevation, std::slice::from_ref(&source), &into);
    assert!(import(&asked, &stopper, &cancel).is_err());
    let (tile, _) = &staged_tiles(&into)[0];
    let bytes = std::fs::read(tile).unwrap();
    std::fs::write(tile, &bytes[..bytes.len() / 2]).unwrap();
    assert!(run(&asked).unwrap().resumed);
    let whole = directory.path().join("whole");
    run(&options(Kind::Elevation, &[source], &whole)).unwrap();
    same_tiles(&into, &whole);
}

#[test]
fn other_arguments_discard_what_was_unfinished() {
    let directory = tempfile::tempdir().unwrap();
    let source = source(directory.path());
    let into = directory.path().join("other");
    let cancel = AtomicBool::new(false);
    let stopper = Stopper {
        cancel: &cancel,
        left: AtomicU64::new(8),
        notes: Mutex::default(),
    };
    let mut asked = options(Kind::Elevation, std::slice::from_ref(&source), &into);
    assert!(import(&asked, &stopper, &cancel).is_err());
    asked.nodata = Some(7.0);
    let cancel = AtomicBool::new(false);
    let stopper = Stopper {
        cancel: &cancel,
        left: AtomicU64::new(u64::MAX),
        notes: Mutex::default(),
    };
    let report = import(&asked, &stopper, &cancel).unwrap();
    assert!(!report.resumed);
    let notes = stopper.notes.lock().unwrap();
    assert!(
        notes.iter().any(|note| note.contains("discarded")),
        "{notes:?}"
    );
}

#[test]
fn a_kill_while_publishing_loses_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let source = source(directory.path());
    let whole = directory.path().join("whole");
    run(&options(
        Kind::Elevation,
        std::slice::from_ref(&source),
        &whole,
    ))
    .unwrap();
    // The state of a process that was killed half-way through its renames: some tiles moved, the rest staged.
    let into = directory.path().join("half");
    let cancel = AtomicBool::new(false);
    let stopper = Stopper {
        cancel: &cancel,
        left: AtomicU64::new(3),
        notes: Mutex::default(),
    };
    let asked = options(Kind::Elevation, &[source], &into);
    assert!(import(&asked, &stopper, &cancel).is_err());
    let staged = into.join(".staging/tiles");
    std::fs::remove_dir_all(&staged).unwrap();
    copy(&whole, &staged);
    let tiles = Values::open(&whole).repository.tiles().unwrap();
    let description = std::fs::read_to_string(into.join(".staging/manifest.json")).unwrap();
    let mut manifest: serde_json::Value = serde_json::from_str(&description).unwrap();
    let dataset = tiles::Dataset::new("half", Kind::Elevation, tiles::SampleType::I32, 1);
    let mut described = serde_json::to_value(&dataset).unwrap();
    described["quantum_m"] = manifest["dataset"]["quantum_m"].clone();
    manifest["dataset"] = described;
    manifest["publishing"] = serde_json::json!({"revision": 0, "deepest_level": tiles.last().unwrap().0.level(), "sources": []});
    std::fs::write(into.join(".staging/manifest.json"), manifest.to_string()).unwrap();
    let half = tiles::Repository::create(&into, dataset).unwrap();
    let store = tiles::Repository::open(&staged).unwrap();
    for (tile, _) in &tiles[..tiles.len() / 2] {
        let to = half.path_of(*tile);
        std::fs::create_dir_all(to.parent().unwrap()).unwrap();
        std::fs::rename(store.path_of(*tile), to).unwrap();
    }
    run(&asked).unwrap();
    same_tiles(&into, &whole);
    assert_eq!(
        tiles::Repository::open(&into).unwrap().dataset().revision,
        1
    );
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().flatten() {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}
