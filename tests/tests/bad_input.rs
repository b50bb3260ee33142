//! Wrong input of every kind: one paragraph that names the thing and what to do, and the right exit status.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::path::Path;

use tests::command::{self, Ran};
use tests::data;

/// Exit status of wrong usage or configuration.
const USAGE: i32 = 2;
/// Exit status of a failure.
const FAILED: i32 = 1;

/// The command must end with `code`, in one paragraph that holds all of `words`.
fn refused(ran: &Ran, code: i32, words: &[&str]) {
    assert_eq!(ran.code, Some(code), "{}", ran.stderr);
    let paragraph = ran.stderr.trim_end();
    assert!(
        paragraph.starts_with("terrawall: ") && !paragraph.contains('\n'),
        "not one paragraph:\n{paragraph}"
    );
    for word in words {
        assert!(
            paragraph.contains(word),
            "does not name \"{word}\": {paragraph}"
        );
    }
}

fn check(folder: &Path, text: &str) -> Ran {
    std::fs::write(folder.join("wall.toml"), text).unwrap();
    command::run(["check".as_ref(), folder.join("wall.toml").as_os_str()])
}

#[test]
fn usage_is_explained() {
    for (line, words) in [
        ("", vec!["Usage"]),
        ("up", vec!["WALL"]),
        ("fly", vec!["fly"]),
        ("up wall.toml --frames many", vec!["--frames"]),
        ("import --into x --kind elevation", vec!["SRC"]),
    ] {
        let ran = command::run(line.split_whitespace());
        assert_eq!(ran.code, Some(USAGE), "terrawall {line}");
        for word in words {
            assert!(
                ran.stderr.contains(word),
                "terrawall {line}: {}",
                ran.stderr
            );
        }
    }
    let help = command::run(["--help"]);
    assert_eq!(help.code, Some(0));
    for name in [
        "up", "master", "node", "import", "check", "verify", "inspect", "bench", "identity",
    ] {
        assert!(
            help.stdout.contains(&format!("\n  {name} ")),
            "--help must name {name}"
        );
    }
}

#[test]
fn a_wrong_wall_is_refused_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let good = data::wall(2, 96, 54, 60.0);
    let head = "head_m = [0.0, 1.108, 0.238]";
    assert_eq!(check(folder.path(), &good).code, Some(0));
    let change = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        good.replacen(from, to, 1)
    };
    for (text, words) in [
        (
            change("fps = 60.0", "fps = 60.0\ncolour = 3"),
            vec!["wall.toml:4", "colour"],
        ),
        (
            change("fps = 60.0", "fps = \"60 Hz\""),
            vec!["wall.toml:3", "fps"],
        ),
        (
            change(head, "head_cm = [0.0, 110.8, 23.8]"),
            vec!["wall.toml:", "head_cm"],
        ),
        (
            change("name = \"node1\"", "name = \"node0\""),
            vec!["wall.toml:", "node0"],
        ),
        (
            change("1.0, 0.0], top_left", "1.0, -700.0], top_left"),
            vec!["wall.toml:", "corners_m"],
        ),
        (
            change(head, "head_m = [0.0, 1.1, -1.5]"),
            vec!["wall.toml:", "head"],
        ),
        (
            change("size_px = [192, 54]", "size_px = [0, 54]"),
            vec!["wall.toml:", "size_px"],
        ),
        (
            change("canvas_px = [96, 0, 96, 54]", "canvas_px = [97, 0, 96, 54]"),
            vec!["wall.toml:", "canvas_px"],
        ),
        (
            change("observer = \"viewer\"", "observer = \"nobody\""),
            vec!["wall.toml:", "nobody", "viewer"],
        ),
        (change("[wall]", "[wall"), vec!["wall.toml:1"]),
    ] {
        refused(&check(folder.path(), &text), USAGE, &words);
    }
    let absent = folder.path().join("absent.toml");
    refused(
        &command::run(["check".as_ref(), absent.as_os_str()]),
        USAGE,
        &["absent.toml"],
    );
}

#[test]
fn a_wrong_scene_is_refused_before_anything_starts() {
    let folder = data::folder(&[("wall.toml", &data::wall(1, 96, 54, 60.0))]);
    let good = data::scene();
    for (from, to, words) in [
        (
            "mode = \"fixed\"",
            "mode = \"fixed\"\nspeed = 3",
            vec!["scene.toml:", "speed"],
        ),
        (
            "altitude_m = 12e6",
            "altitude_km = 12e3",
            vec!["scene.toml:", "altitude_km"],
        ),
        (
            "latitude_deg = 10.0",
            "latitude_deg = 100.0",
            vec!["scene.toml:", "latitude_deg", "90"],
        ),
        (
            "[layers.colour]",
            "[layers.relief]",
            vec!["scene.toml:", "duplicate key"],
        ),
        (
            "[layers.relief]",
            "[[layers]]\nname = \"relief\"",
            vec!["scene.toml:", "layers", "[layers."],
        ),
        (
            "[layers.colour]",
            "[layers.colour]\nexposure_stops = 99",
            vec!["scene.toml:", "layers.colour.exposure_stops", "16"],
        ),
        (
            "[layers.colour]",
            "[layers.ground]\nkind = \"ramp\"\nramp = \"rainbow\"\n[layers.colour]",
            vec!["scene.toml:", "layers.ground.ramp", "land-and-sea"],
        ),
        (
            "[layers.colour]",
            "[lenses.loupe]\nlatitude_deg = 0\nlongitude_deg = 0\nradius_m = 0\n[layers.colour]",
            vec!["scene.toml:", "lenses.loupe.radius_m", "above 0"],
        ),
        (
            "kind = \"imagery\"",
            "kind = \"photo\"",
            vec!["scene.toml:", "photo", "imagery"],
        ),
    ] {
        assert!(good.contains(from), "{from}");
        std::fs::write(folder.path().join("scene.toml"), good.replacen(from, to, 1)).unwrap();
        let (wall, scene) = (
            folder.path().join("wall.toml"),
            folder.path().join("scene.toml"),
        );
        let ran = command::run([
            "up".as_ref(),
            wall.as_os_str(),
            "--scene".as_ref(),
            scene.as_os_str(),
        ]);
        refused(&ran, USAGE, &words);
    }
}

#[test]
fn a_wrong_source_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let into = folder.path().join("repository");
    let import = |source: &Path, kind: &str, more: &[&str]| {
        let mut words = vec![
            "import",
            source.to_str().unwrap(),
            "--kind",
            kind,
            "--into",
            into.to_str().unwrap(),
        ];
        words.extend(more);
        command::run(words)
    };
    let bmng = data::embedded("bmng.jpg");
    let ran = import(&bmng, "imagery", &[]);
    assert!(matches!(ran.code, Some(FAILED | USAGE)), "{}", ran.stderr);
    refused(&ran, ran.code.unwrap(), &["bmng.jpg", "--extent"]);
    assert!(!into.join("dataset.toml").exists());

    let whole = std::fs::read(data::embedded("etopo5.tif")).unwrap();
    for (name, length) in [
        ("half.tif", whole.len() / 2),
        ("head.tif", 6),
        ("empty.tif", 0),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, &whole[..length]).unwrap();
        refused(&import(&path, "elevation", &[]), FAILED, &[name]);
        assert!(!into.join("dataset.toml").exists(), "{name}");
    }
    let absent = folder.path().join("absent.tif");
    let ran = import(&absent, "elevation", &[]);
    refused(&ran, ran.code.unwrap_or(-1), &["absent.tif"]);
}

#[test]
fn what_is_no_repository_is_said_so() {
    let folder = data::folder(&[("notes.txt", "no tiles here")]);
    let ran = command::run(["inspect".as_ref(), folder.path().as_os_str()]);
    let code = ran.code.unwrap_or(-1);
    assert!(matches!(code, FAILED | USAGE), "{}", ran.stderr);
    refused(
        &ran,
        code,
        &[folder.path().to_str().unwrap(), "dataset.toml"],
    );
}

/// A calibration archive with something wrong, or a wall that asks for something else than it holds.
#[test]
fn wrong_calibration_files_are_named_with_a_remedy() {
    let walls = tests::sources::root().join("configs/walls");
    let archive = std::fs::read(walls.join("pair.mpcdi")).unwrap();
    let wall = std::fs::read_to_string(walls.join("pair-mpcdi.toml")).unwrap();
    let check_with = |archive: Option<&[u8]>, wall: &str| {
        let folder = tempfile::tempdir().unwrap();
        if let Some(bytes) = archive {
            std::fs::write(folder.path().join("pair.mpcdi"), bytes).unwrap();
        }
        check(folder.path(), wall)
    };
    let fine = check_with(Some(&archive), &wall);
    assert_eq!(fine.code, Some(0), "{}", fine.stderr);
    let half = &archive[..archive.len() / 2];
    let mut spoilt = archive.clone();
    spoilt[300..2000].fill(0x55);
    let file = "pair.mpcdi";
    for (archive, wall, words) in [
        (None, wall.clone(), vec![file]),
        (Some(&b""[..]), wall.clone(), vec![file]),
        (Some(half), wall.clone(), vec![file]),
        (Some(&spoilt[..]), wall.clone(), vec![file]),
        (
            Some(&archive[..]),
            wall.replace("region = \"right\"", "region = \"middle\""),
            vec![file, "middle", "left", "right"],
        ),
        (
            Some(&archive[..]),
            wall.replace(", region = \"right\"", ""),
            vec![file, "calibration.region", "left, right"],
        ),
        (
            Some(&archive[..]),
            wall.replacen(
                "size_px = [1280, 800]\ncalibration",
                "size_px = [1280, 600]\ncalibration",
                1,
            ),
            vec![file, "1280×800", "1280×600"],
        ),
    ] {
        refused(&check_with(archive, &wall), USAGE, &words);
    }
}

/// Calibrations that can be read, and yet do not belong to their screen: the left one has points of the room, the right one
/// places on the canvas.
#[test]
fn calibrations_that_light_something_else_than_their_screen_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let wall = tests::viewer::made::calibrated_cylinder(folder.path()).to_string();
    let odd = |changes: &[(&str, &str)]| {
        let mut wall = wall.clone();
        for (from, to) in changes {
            assert!(wall.contains(from), "{from} is not in\n{wall}");
            wall = wall.replace(from, to);
        }
        let ran = check(folder.path(), &wall);
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        let lines = ran.stdout.lines().filter(|line| line.contains("odd: "));
        lines.map(str::to_owned).collect::<Vec<String>>()
    };
    assert_eq!(odd(&[]), Vec::<String>::new());
    // The screen elsewhere, and then the head with it, so that it sees the points from behind.
    let foot = "foot_m = [0.0, 0.0, 0.0]";
    let moved = odd(&[(foot, "foot_m = [0.0, 0.0, -0.6]")]);
    let behind = odd(&[
        (foot, "foot_m = [0.0, 0.0, -5.0]"),
        ("head_m = [0.0, 1.6, 0.0]", "head_m = [0.0, 1.6, -5.0]"),
    ]);
    let astray = "what output \"projection/left\" lights is";
    let unseen = "of what output \"projection/left\" lights from the front";
    for (said, sentences) in [(&moved, &[astray][..]), (&behind, &[astray, unseen])] {
        for sentence in sentences {
            let named = said.iter().filter(|line| line.contains(sentence));
            assert_eq!(named.count(), 1, "{said:#?}");
        }
        assert!(!said.iter().any(|line| line.contains("right")), "{said:#?}");
    }
}

/// Screens, eyes and trackers that make no sense.
#[test]
fn wrong_rooms_are_named_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let walls = tests::sources::root().join("configs/walls");
    let text = |name: &str| std::fs::read_to_string(walls.join(name)).unwrap();
    let (dome, cave, lab) = (
        text("dome-5.toml"),
        text("cave-4.toml"),
        text("vrlab-siegen.toml"),
    );
    for (wall, from, to, words) in [
        (
            &dome,
            "radius_m = 4.0",
            "radius_m = -4.0",
            vec!["radius_m", "-4"],
        ),
        (
            &dome,
            "azimuth_deg = [-50.0, 50.0]",
            "azimuth_deg = [50.0, -50.0]",
            vec!["azimuth_deg"],
        ),
        (
            &dome,
            "kind = \"sphere\"",
            "kind = \"ball\"",
            vec!["kind", "sphere"],
        ),
        (
            &dome,
            "blend_px = { left = 192, right = 192 }",
            "blend_px = { left = 1920, right = 192 }",
            vec!["blend_px", "ramps"],
        ),
        (&dome, "gamma = 2.2", "gamma = 22.0", vec!["gamma"]),
        (
            &dome,
            "black_level = 0.003",
            "black_level = 3",
            vec!["black_level"],
        ),
        (
            &cave,
            "eye = \"left\"",
            "eye = \"third\"",
            vec!["eye", "centre"],
        ),
        (
            &cave,
            "tracker = \"glasses\"",
            "tracker = \"hat\"",
            vec!["tracker", "glasses"],
        ),
        (
            &cave,
            "z = [0.0, 1.0, 0.0]",
            "z = [0.0, -1.0, 0.0]",
            vec!["to_room", "right-handed"],
        ),
        (
            &cave,
            "Head@tracker:3883",
            "tracker:3883",
            vec!["DEVICE@HOST"],
        ),
        (
            &cave,
            "eye_separation_m = 0.063",
            "eye_separation_m = 63.0",
            vec!["eye_separation_m", "0.063"],
        ),
        (
            &lab,
            "aligned_from_m = [0.0, 1.78, 0.0]",
            "aligned_from_m = [0.0, 1.78, 9.0]",
            vec!["aligned_from_m"],
        ),
        (
            &lab,
            "source = \"0.0.0.0:5000\"",
            "source = \"everywhere\"",
            vec!["source", "0.0.0.0:5000"],
        ),
        (
            &lab,
            "radius_m = 2.4912",
            "radius_m = 2.2",
            vec!["radius_m"],
        ),
    ] {
        let spoilt = wall.replacen(from, to, 1);
        assert_ne!(&spoilt, wall, "{from} is not in the wall");
        let mut words = words;
        words.push("wall.toml:");
        refused(&check(folder.path(), &spoilt), USAGE, &words);
    }
}
