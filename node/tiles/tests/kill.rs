//! A writer that is killed at any moment leaves whole tiles or none.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod common;

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use common::{dataset, pyramid, tile_data};
use tiles::{Repository, TileData};

const ROOT: &str = "TILES_KILL_TEST_ROOT";

/// The child: writes all tiles over and over until it is killed.
#[test]
#[ignore = "run by the test below as a process of its own"]
fn write_until_killed() {
    let Some(root) = std::env::var_os(ROOT) else {
        return;
    };
    let repository = Repository::open(&PathBuf::from(root)).unwrap();
    loop {
        for tile in pyramid(2) {
            let bytes = tile_data(tile).encode_plain().unwrap();
            repository.write_atomic(tile, &bytes).unwrap();
        }
    }
}

#[test]
fn a_killed_writer_leaves_whole_tiles() {
    let root = tempfile::tempdir().unwrap();
    let repository = Repository::create(root.path(), dataset()).unwrap();
    for round in 0..12_u64 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--ignored", "--exact", "write_until_killed"])
            .env(ROOT, root.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let start = Instant::now();
        while repository.tiles().unwrap().is_empty() {
            assert!(
                start.elapsed() < Duration::from_secs(20),
                "the child writes nothing"
            );
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(Duration::from_micros(3_700 * round));
        child.kill().unwrap();
        child.wait().unwrap();
        let tiles = repository.tiles().unwrap();
        assert!(!tiles.is_empty());
        for (tile, _) in tiles {
            let bytes = repository.read(tile).unwrap().unwrap();
            assert_eq!(
                TileData::decode_tile(&bytes, tile).unwrap(),
                tile_data(tile)
            );
            repository.remove(tile).unwrap();
        }
    }
    // What was under way lies apart, where no reader looks.
    let strays = std::fs::read_dir(root.path()).unwrap();
    let mut names: Vec<_> = strays
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert!(
        names
            .iter()
            .all(|name| [".parts", "0", "1", "2", "dataset.toml"].contains(&name.as_str()))
    );
}
