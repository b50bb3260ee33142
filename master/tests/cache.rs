//! `terrawall cache`: the real program over cache directories that it has warmed, or that the test has filled.
#![allow(
    clippy::unwrap_used,
    clippy::indexing_slicing,
    reason = "a test that panics has failed"
)]

#[path = "cache/setup.rs"]
mod setup;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use disk_cache::{Claim, Config, DiskCache, Name};
use serde_json::Value;
use setup::{SCENE, Setup, driver};

/// A data set's first import.
const GROUP: &str = "0123456789abcdef0123456789abcdef-1";

fn terrawall(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrawall"));
    command.args(arguments).stdin(Stdio::null());
    command
}

/// Exit status, standard output and standard error.
fn outcome(arguments: &[&str]) -> (Option<i32>, String, String) {
    told(terrawall(arguments).output().unwrap())
}

fn told(output: Output) -> (Option<i32>, String, String) {
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (
        output.status.code(),
        text(output.stdout),
        text(output.stderr),
    )
}

fn succeed(arguments: &[&str]) -> String {
    let (status, result, complaint) = outcome(arguments);
    assert_eq!(status, Some(0), "{arguments:?}: {result}{complaint}");
    result
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&succeed(arguments)).unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A cache directory with `count` files of 1000 bytes.
fn filled(root: &Path, count: u8) {
    let cache = DiskCache::open(&Config::new(root, 1 << 20)).unwrap();
    for number in 0..count {
        let name = Name::new(GROUP, Path::new(&format!("3/{number}.tile"))).unwrap();
        let Claim::Fetch(lease) = cache.claim(&name) else {
            panic!("{name} is nobody's");
        };
        lease.publish(&[number; 1000]).unwrap();
    }
}

fn files_of(root: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut waiting = vec![root.to_owned()];
    while let Some(directory) = waiting.pop() {
        for entry in std::fs::read_dir(directory).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                waiting.push(path);
            } else if path.extension().is_some_and(|ending| ending == "cached") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// Flips one bit of a file's last byte.
fn damage(file: &Path) {
    let mut bytes = std::fs::read(file).unwrap();
    *bytes.last_mut().unwrap() ^= 4;
    std::fs::write(file, bytes).unwrap();
}

#[test]
fn what_is_broken_is_found_named_and_removed() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("cache");
    filled(&root, 5);
    let directory = text(&root);
    assert!(succeed(&["cache", "verify", directory]).contains("5 files"));
    let files = files_of(&root);
    damage(&files[1]);
    std::fs::write(&files[3], b"short").unwrap();
    for _ in 0..2 {
        let (status, result, complaint) = outcome(&["cache", "verify", directory]);
        assert_eq!(status, Some(1), "{result}");
        for (file, reason) in [(&files[1], "payload"), (&files[3], "truncated")] {
            let named = |line: &str| line.starts_with(text(file)) && line.contains(reason);
            assert!(result.lines().any(named), "{reason}: {result}");
        }
        assert!(
            result.contains("3 files") && result.contains("2 broken"),
            "{result}"
        );
        assert!(complaint.contains("--remove"), "{complaint}");
        assert_eq!(files_of(&root), files, "looking removes nothing");
    }
    let result = succeed(&["cache", "verify", directory, "--remove"]);
    assert!(result.contains("2 removed"), "{result}");
    assert_eq!(
        files_of(&root),
        [&files[0], &files[2], &files[4]].map(Clone::clone)
    );
    let result = succeed(&["cache", "verify", directory]);
    assert!(
        result.contains("3 files") && result.contains("0 broken"),
        "{result}"
    );
}

#[test]
fn what_is_in_a_cache_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("cache");
    filled(&root, 3);
    std::fs::write(root.join("note.txt"), "mine").unwrap();
    let bytes: u64 = files_of(&root)
        .iter()
        .map(|file| file.metadata().unwrap().len())
        .sum();
    let report = &json(&["cache", "stat", text(&root), "--json"])[0];
    assert_eq!(report["files"], 3);
    assert_eq!(report["bytes"], bytes);
    assert_eq!(report["foreign_files"], 1);
    assert_eq!(report["budget_bytes"], Value::Null);
    assert_eq!(report["groups"][0]["group"], GROUP);
    assert_eq!(report["groups"][0]["data_set"], Value::Null);
    // While a process uses it, its budget and what it fetches are told.
    let cache = DiskCache::open(&Config::new(&root, 7_000_000)).unwrap();
    let name = Name::new(GROUP, Path::new("4/new.tile")).unwrap();
    let Claim::Fetch(lease) = cache.claim(&name) else {
        panic!("{name} is nobody's");
    };
    let report = &json(&["cache", "stat", text(&root), "--json"])[0];
    assert_eq!(report["leases"], 1);
    lease.publish(b"new").unwrap();
    let report = &json(&["cache", "stat", text(&root), "--json"])[0];
    assert_eq!(
        (&report["leases"], &report["files"]),
        (&0.into(), &4.into())
    );
    assert_eq!(report["budget_bytes"], 7_000_000);
    let table = succeed(&["cache", "stat", text(&root)]);
    for part in [GROUP, "1 processes", "7.0 MB", "1 foreign"] {
        assert!(table.contains(part), "{part}: {table}");
    }
    // The same directory as this user's own.
    std::fs::rename(&root, folder.path().join("terrawall")).unwrap();
    let mut command = terrawall(&["cache", "stat", "--json"]);
    let (status, result, _) = told(
        command
            .env("XDG_CACHE_HOME", folder.path())
            .output()
            .unwrap(),
    );
    assert_eq!(status, Some(0));
    let report: Value = serde_json::from_str(&result).unwrap();
    assert_eq!(report[0]["files"], 4);
}

#[test]
fn a_cache_is_emptied_when_somebody_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("cache");
    filled(&root, 4);
    std::fs::write(root.join("note.txt"), "mine").unwrap();
    let (status, _, complaint) = outcome(&["cache", "clear", text(&root)]);
    assert_eq!(status, Some(2));
    assert!(complaint.contains("--yes"), "{complaint}");
    assert_eq!(files_of(&root).len(), 4);
    let result = succeed(&["cache", "clear", text(&root), "--yes"]);
    assert!(result.contains("removed 4 files"), "{result}");
    assert!(files_of(&root).is_empty());
    assert!(root.join("note.txt").is_file());
    let report = &json(&["cache", "stat", text(&root), "--json"])[0];
    assert_eq!(report["files"], 0);
}

#[test]
fn what_is_no_cache_is_named_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let (missing, file) = (folder.path().join("missing"), folder.path().join("file"));
    std::fs::write(&file, "text").unwrap();
    for command in ["stat", "verify", "clear"] {
        for (path, remedy) in [(&missing, "--wall"), (&file, "is a file")] {
            let (status, _, complaint) = outcome(&["cache", command, text(path)]);
            assert_eq!(status, Some(2), "{command} {}: {complaint}", path.display());
            for part in [text(path), remedy] {
                assert!(complaint.contains(part), "{command}: {complaint}");
            }
        }
    }
    // A name that has neither home nor variable.
    let mut homeless = terrawall(&["cache", "stat"]);
    homeless.env_remove("HOME").env_remove("XDG_CACHE_HOME");
    let (status, _, complaint) = told(homeless.output().unwrap());
    assert_eq!(status, Some(2));
    assert!(complaint.contains("directory ="), "{complaint}");
    let (status, _, complaint) = outcome(&["cache", "stat", text(&file), "--wall", "wall.toml"]);
    assert_eq!(status, Some(2));
    assert!(complaint.contains("cannot be used with"), "{complaint}");
}

#[test]
fn help_tells_what_each_command_does() {
    for (command, parts) in [
        ("stat", ["--repository", "Foreign files"]),
        ("verify", ["No tile is decoded", "Exit status"]),
        ("clear", ["--yes", "Nothing is lost but time"]),
        ("warm", ["without drawing", "cache.disk_mib"]),
    ] {
        let help = succeed(&["cache", command, "--help"]);
        // Lines break where the terminal ends.
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        for part in parts.into_iter().chain(["Examples:"]) {
            assert!(help.contains(part), "{command}, {part}: {help}");
        }
    }
}

#[test]
fn a_path_is_read_once_and_then_from_the_disk() {
    if !driver() {
        return;
    }
    let setup = Setup::new();
    let cache = setup.path("cache");
    let first_view = setup.summary(&["--seconds", "0"]);
    let tiles = |summary: &Value| summary["tiles"].as_u64().unwrap();
    assert_eq!(first_view["views"], 1);
    assert_eq!(first_view["repository_reads"], first_view["tiles"]);
    let path = setup.summary(&[]);
    assert_eq!((&path["views"], &path["hosts"]), (&9.into(), &2.into()));
    // From near by there is more to see, and what the first view had is there already.
    assert!(tiles(&path) > tiles(&first_view), "{path}");
    assert_eq!(path["already_there"], first_view["tiles"]);
    assert_eq!(path["repository_reads"], tiles(&path) - tiles(&first_view));
    let files = files_of(&cache);
    assert_eq!(files.len() as u64, tiles(&path));
    let again = setup.summary(&[]);
    assert_eq!(again["repository_reads"], 0);
    assert_eq!(again["already_there"], path["tiles"]);
    assert_eq!(files_of(&cache), files);

    let scene = setup.path("scene.toml");
    let line = ["cache", "stat", text(&cache), "--scene", text(&scene)];
    let report = &json(&[&line[..], &["--json"]].concat())[0];
    assert_eq!(report["groups"][0]["data_set"], "relief");
    assert_eq!(report["groups"][0]["current"], true);
    assert_eq!(report["bytes"], path["bytes"]);

    // A broken file is removed, and only it is read again.
    damage(&files[2]);
    let (status, result, _) = outcome(&["cache", "verify", text(&cache)]);
    assert_eq!(status, Some(1));
    assert!(result.contains(text(&files[2])), "{result}");
    succeed(&["cache", "verify", text(&cache), "--remove"]);
    assert_eq!(files_of(&cache).len(), files.len() - 1);
    assert_eq!(setup.summary(&[])["repository_reads"], 1);
    succeed(&["cache", "verify", text(&cache)]);
    succeed(&["cache", "clear", text(&cache), "--yes"]);
    assert!(files_of(&cache).is_empty());
}

#[test]
fn a_warmed_view_is_drawn_without_the_repository() {
    if !driver() {
        return;
    }
    let setup = Setup::new();
    let (_, layers) = SCENE.split_once("\n\n").unwrap();
    let camera = "[camera]\nmode = \"fixed\"\nplace = { latitude_deg = 22, longitude_deg = 24, \
                  altitude_m = 2e5, pitch_deg = -60 }";
    std::fs::write(setup.path("scene.toml"), format!("{camera}\n\n{layers}")).unwrap();
    setup.summary(&[]);
    // Nothing can be read from the repository any more but its description.
    let relief = setup.path("relief");
    for entry in std::fs::read_dir(&relief).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            std::fs::remove_dir_all(path).unwrap();
        }
    }
    let (wall, scene, shots) = (
        setup.path("wall.toml"),
        setup.path("scene.toml"),
        setup.path("shots"),
    );
    let mut line = vec!["up", text(&wall), "--scene", text(&scene), "--headless"];
    line.extend(["--no-control", "--frames", "1", "--capture", text(&shots)]);
    line.extend(["--json", "--no-error"]);
    let report = json(&line);
    assert!(shots.join("wall.png").is_file());
    assert_eq!(report["tiles"]["repository_reads"], 0, "{report}");
    assert!(
        report["tiles"]["disk_hits"].as_u64().unwrap() > 0,
        "{report}"
    );
}

#[test]
fn tiles_that_cannot_be_had_or_kept_are_told() {
    if !driver() {
        return;
    }
    let setup = Setup::new();
    std::fs::write(setup.path("small.toml"), setup.wall(1)).unwrap();
    let (status, _, complaint) = setup.warm("small.toml", &[]);
    assert_eq!(status, Some(1));
    for part in ["cache.disk_mib = 1", "write about disk_mib =", "small.toml"] {
        assert!(complaint.contains(part), "{complaint}");
    }
    succeed(&["cache", "clear", text(&setup.path("cache")), "--yes"]);
    // A root that is in the index, but not there.
    let mut tiles = Vec::new();
    let mut waiting = vec![setup.path("relief")];
    while let Some(directory) = waiting.pop() {
        for entry in std::fs::read_dir(directory).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                waiting.push(path);
            } else if path.extension().is_some_and(|ending| ending == "tile") {
                tiles.push(path);
            }
        }
    }
    tiles.sort();
    std::fs::remove_file(&tiles[0]).unwrap();
    let (status, result, complaint) = setup.warm("wall.toml", &["--seconds", "0"]);
    assert_eq!(status, Some(1), "{result}{complaint}");
    for part in ["1 tiles cannot be had", "\"relief\"", "its file is missing"] {
        assert!(complaint.contains(part), "{complaint}");
    }
}

#[test]
fn a_wall_is_warmed_on_a_machine_that_has_not_its_adapters_and_short_memory_is_told() {
    if !driver() {
        return;
    }
    let setup = Setup::new();
    let (whole, complaint) = {
        let wall = setup
            .wall(64)
            .replace("headless = true", "headless = true\ngpu = 7");
        std::fs::write(setup.path("other.toml"), wall).unwrap();
        let (status, result, complaint) = setup.warm("other.toml", &["--json"]);
        assert_eq!(status, Some(0), "{complaint}");
        let result: Value = serde_json::from_str(&result).unwrap();
        (result["tiles"].as_u64().unwrap(), complaint)
    };
    assert!(!complaint.contains("mesh.tile_px"), "{complaint}");
    succeed(&["cache", "clear", text(&setup.path("cache")), "--yes"]);
    let small = setup.wall(64).replace("gpu_mib = 256", "gpu_mib = 1");
    std::fs::write(setup.path("little.toml"), small).unwrap();
    let (status, result, complaint) = setup.warm("little.toml", &["--json"]);
    assert_eq!(status, Some(0), "{complaint}");
    let result: Value = serde_json::from_str(&result).unwrap();
    assert!(result["tiles"].as_u64().unwrap() < whole, "{result}");
    for part in ["node0: 1 MiB of graphics memory", "raise cache.gpu_mib"] {
        assert!(complaint.contains(part), "{complaint}");
    }
}

#[test]
fn a_flight_that_is_interrupted_goes_on_later() {
    use rustix::process::{Pid, Signal, kill_process};
    if !driver() {
        return;
    }
    let setup = Setup::new();
    let (wall, scene) = (setup.path("wall.toml"), setup.path("scene.toml"));
    let line = ["cache", "warm", text(&wall), "--scene", text(&scene)];
    // Long beyond all patience, so that it cannot end by itself.
    let long = ["--seconds", "80000", "--step", "0.1"];
    let child = terrawall(&[&line[..], &long[..]].concat())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let cache = setup.path("cache");
    for _ in 0..600 {
        if cache.is_dir() && !files_of(&cache).is_empty() {
            break;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    let (status, result, complaint) = told(child.wait_with_output().unwrap());
    assert_eq!(status, Some(1), "{result}{complaint}");
    assert!(complaint.contains("goes on from there"), "{complaint}");
    succeed(&["cache", "verify", text(&cache)]);
    let there = files_of(&cache).len();
    assert!(there > 0);
    assert_eq!(setup.summary(&[])["already_there"], there);
}

#[test]
fn a_path_that_cannot_be_flown_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("none.toml");
    let (status, _, complaint) =
        outcome(&["cache", "warm", text(&missing), "--scene", text(&missing)]);
    assert_eq!(status, Some(2));
    assert!(complaint.contains("none.toml"), "{complaint}");
    for (more, hint) in [
        (["--step", "0"], "0.1 to 86400"),
        (["--seconds", "nan"], "0 to 86400"),
        (["--seconds", "90000"], "0 to 86400"),
    ] {
        let line = [
            &["cache", "warm", "w.toml", "--scene", "s.toml"][..],
            &more[..],
        ]
        .concat();
        let (status, _, complaint) = outcome(&line);
        assert_eq!(status, Some(2), "{more:?}");
        assert!(complaint.contains(hint), "{more:?}: {complaint}");
    }
}
