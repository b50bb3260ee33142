//! One cache for a whole wall: each tile is read once, whatever happens to the files; and memory that is too small.
//!
//! In: real walls over the embedded data, cache directories that are damaged between runs. Out: verdicts on counts and
//! pixels. Kills of single processes are the disk cache's own tests' business.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::path::Path;

use image::RgbImage;
use tests::flights::{self, Flight, above_the_alps, cached};
use tests::{command, data, pictures};

/// What the wall shows with an empty cache of its own.
fn with_own_cache(flight: &Flight) -> RgbImage {
    let folder = tempfile::tempdir().unwrap();
    let flight = Flight {
        cache: flights::directory(&folder.path().join("cache")),
        ..flight.clone()
    };
    flight.fly().picture
}

#[test]
fn four_nodes_read_each_tile_once() {
    if !data::driver() {
        return;
    }
    let _alone = command::alone();
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("cache");
    let flight = Flight {
        nodes: 4,
        frames: 30,
        path: vec![(0.0, above_the_alps(6e6)), (5.0, above_the_alps(1e5))],
        ..Flight::here(&cache)
    };
    let cold = flight.fly();
    let kept = cached(&cache).len() as u64;
    let distinct = cold.tiles("distinct");
    assert!(distinct > 30, "{distinct} tiles are no test");
    assert_eq!(
        cold.tiles("repository_reads"),
        distinct,
        "{:#}",
        cold.report
    );
    assert_eq!(kept, distinct);
    assert!(cold.tiles("disk_hits") > 0, "nobody took what others read");
    let warm = flight.fly();
    // Another flight may look a little further ahead; what was there is not read again.
    let new = cached(&cache).len() as u64 - kept;
    assert_eq!(warm.tiles("repository_reads"), new, "{:#}", warm.report);
    assert!(new <= distinct / 2, "{new} of {distinct}");
    assert_eq!(pictures::differing(&warm.picture, &cold.picture), 0);
    // A view at rest is the same in all runs, to the last tile.
    let still = Flight {
        nodes: 4,
        frames: 5,
        path: vec![(0.0, above_the_alps(1e5))],
        ..flight
    };
    let first = still.fly();
    let second = still.fly();
    assert_eq!(second.tiles("repository_reads"), 0, "{:#}", second.report);
    assert_eq!(pictures::differing(&first.picture, &cold.picture), 0);
    assert_eq!(pictures::differing(&second.picture, &cold.picture), 0);
}

/// Damages a file in one of the ways that disks, copies and people have.
fn damage(file: &Path, other: &Path, way: usize) {
    let mut bytes = std::fs::read(file).unwrap();
    match way {
        0 => bytes.truncate(bytes.len() / 2),
        1 => {
            let middle = bytes.len() / 2;
            bytes[middle] ^= 0x10;
        }
        2 => bytes.extend_from_slice(&[7; 1000]),
        // A sound file, but of another tile.
        3 => bytes = std::fs::read(other).unwrap(),
        4 => bytes.iter_mut().take(64).for_each(|byte| *byte = 0),
        5 => bytes.clear(),
        // The version is among the first bytes; no version has these.
        _ => bytes[8..16].fill(0xee),
    }
    std::fs::write(file, bytes).unwrap();
}

#[test]
fn damaged_and_foreign_files_cost_no_pixel() {
    if !data::driver() {
        return;
    }
    let _alone = command::alone();
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("cache");
    let flight = Flight {
        frames: 3,
        ..Flight::here(&cache)
    };
    let expected = with_own_cache(&flight);
    assert!(pictures::colours(&expected) > 100);
    let first = flight.fly();
    assert_eq!(pictures::differing(&first.picture, &expected), 0);
    let files = cached(&cache);
    // The last one stays as it is, to be put in the place of others.
    let (other, damaged) = files.split_last().unwrap();
    let sound: Vec<Vec<u8>> = damaged.iter().map(|f| std::fs::read(f).unwrap()).collect();
    for (number, file) in damaged.iter().enumerate() {
        damage(file, other, number % 7);
    }
    let again = flight.fly();
    assert_eq!(pictures::differing(&again.picture, &expected), 0);
    // What was needed was replaced, by the very same. How far ahead a node looks depends on time, so that some may not
    // have been looked at: they make room for the next flight.
    let mut replaced = 0;
    for (file, sound) in damaged.iter().zip(&sound) {
        if std::fs::read(file).is_ok_and(|bytes| bytes == *sound) {
            replaced += 1;
        } else if let Err(error) = std::fs::remove_file(file) {
            assert_eq!(error.kind(), std::io::ErrorKind::NotFound, "{error}");
        }
    }
    let enough = damaged.len() as u64 / 2;
    assert!(
        enough > 7 && replaced > enough,
        "{replaced} of {}",
        damaged.len()
    );
    // Both nodes may notice one that one of them replaces.
    let corrupt = again.tiles("corrupt");
    assert!(
        (replaced..=2 * damaged.len() as u64).contains(&corrupt),
        "{corrupt}"
    );
    assert!(
        again.tiles("repository_reads") >= replaced,
        "{:#}",
        again.report
    );
    // They are sound now.
    let mended = flight.fly();
    assert_eq!(mended.tiles("corrupt"), 0, "{:#}", mended.report);
    assert_eq!(pictures::differing(&mended.picture, &expected), 0);

    // Another wall's data: tiles of the same numbers, other samples.
    let others = Flight {
        repositories: [
            data::repositories().join("etopo5").display().to_string(),
            flight.repositories[1].clone(),
        ],
        path: vec![(0.0, above_the_alps(4e4))],
        ..flight.clone()
    };
    let near = Flight {
        path: others.path.clone(),
        ..flight
    };
    let (coarse, fine) = (with_own_cache(&others), with_own_cache(&near));
    assert!(pictures::differing(&coarse, &fine) > 100, "both look alike");
    for (flight, expected) in [(&others, &coarse), (&near, &fine), (&others, &coarse)] {
        assert_eq!(pictures::differing(&flight.fly().picture, expected), 0);
    }
}

#[test]
fn a_small_cache_costs_no_pixel_and_an_impossible_one_is_refused() {
    if !data::driver() {
        return;
    }
    let _alone = command::alone();
    let folder = tempfile::tempdir().unwrap();
    let flight = Flight {
        frames: 3,
        ..Flight::here(&folder.path().join("cache"))
    };
    let expected = with_own_cache(&flight);
    let small = Flight {
        cache: format!("{}\ndisk_mib = 1", flight.cache),
        ..flight.clone()
    };
    for _ in 0..2 {
        let flown = small.fly();
        assert_eq!(pictures::differing(&flown.picture, &expected), 0);
        let bytes: u64 = cached(&folder.path().join("cache"))
            .iter()
            .map(|file| file.metadata().unwrap().len())
            .sum();
        // Two nodes may each be a tile ahead of whoever keeps the budget.
        assert!(bytes <= 3 << 20, "{bytes} bytes");
    }
    // Whoever may do everything cannot make a directory where a file is, either. Without the cache that the wall asks
    // for it is not shown: all nodes would read everything.
    let file = folder.path().join("file");
    std::fs::write(&file, "mine").unwrap();
    let forbidden = Flight {
        cache: flights::directory(&file.join("cache")),
        ..flight
    };
    let ran = forbidden.start().end();
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    for word in ["file/cache", "Not a directory", "name another directory"] {
        assert!(ran.stderr.contains(word), "{word}: {}", ran.stderr);
    }
    assert_eq!(std::fs::read(&file).unwrap(), b"mine");
}

/// With a quarter of the graphics memory that a view needs it comes to rest, coarser, and says so; and then nothing is
/// loaded any more.
#[test]
fn memory_that_is_too_small_is_told_and_loads_nothing_to_and_fro() {
    if !data::driver() {
        return;
    }
    let _alone = command::alone();
    let folder = tempfile::tempdir().unwrap();
    let view = |name: &str, gpu_mib: u64, frames| {
        let cache = folder.path().join(name);
        Flight {
            nodes: 1,
            size_px: [1024, 576],
            frames,
            path: vec![(0.0, above_the_alps(3e5))],
            cache: format!("{}\ngpu_mib = {gpu_mib}", flights::directory(&cache)),
            ..Flight::here(&cache)
        }
        .fly()
    };
    // As much as it needs: the least power of two that changes nothing.
    let asked_px = 257.0;
    let enough = view("enough", ENOUGH_MIB, 1);
    assert_eq!(enough.number("/achieved_tile_px"), asked_px);
    let scarce = ENOUGH_MIB / 4;
    let (short, long) = (view("short", scarce, 40), view("long", scarce, 80));
    let achieved_px = short.number("/achieved_tile_px");
    assert!(achieved_px > asked_px * 1.3, "{achieved_px}");
    assert!(short.words.contains("cache.gpu_mib"), "{}", short.words);
    for flown in [&short, &long] {
        assert_eq!(flown.report["converged"], true, "{:#}", flown.report);
        assert!(flown.number("/achieved_tau") >= 1.0);
    }
    // Eight seconds more, and not a tile more.
    for key in ["distinct", "repository_reads", "disk_hits"] {
        assert_eq!(long.tiles(key), short.tiles(key), "{key}");
    }
    assert_eq!(long.number("/achieved_tile_px"), achieved_px);
    assert_eq!(pictures::differing(&long.picture, &short.picture), 0);
}

/// Graphics memory that holds that view.
const ENOUGH_MIB: u64 = 256;
