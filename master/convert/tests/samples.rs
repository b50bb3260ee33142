//! What samples of the three formats become: small ones to the letter, large ones by their facts, and all of them as
//! walls whose references and sizes hold.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::indexing_slicing,
    reason = "a test that panics has failed"
)]

mod common;

use std::collections::HashSet;

use common::{SAMPLES, SCHEMA};
use convert::{Converted, convert};
use toml_edit::{DocumentMut, Item, TableLike};

fn converted(name: &str) -> Converted {
    let (_, text, format) = SAMPLES.iter().find(|(sample, ..)| *sample == name).unwrap();
    convert(text, name, *format).unwrap()
}

fn document(name: &str) -> DocumentMut {
    converted(name).toml.parse().unwrap()
}

fn tables<'d>(table: &'d dyn TableLike, key: &str) -> Vec<&'d dyn TableLike> {
    let Some(list) = table.get(key).and_then(Item::as_array_of_tables) else {
        return Vec::new();
    };
    list.iter().map(|table| table as &dyn TableLike).collect()
}

fn text<'d>(table: &'d dyn TableLike, key: &str) -> &'d str {
    table.get(key).and_then(Item::as_str).unwrap_or_default()
}

fn numbers(item: &Item) -> Vec<f64> {
    let number = |value: &toml_edit::Value| {
        value
            .as_float()
            .or_else(|| value.as_integer().map(|n| n as f64))
            .unwrap()
    };
    item.as_array().unwrap().iter().map(number).collect()
}

fn has_lost(converted: &Converted, part: &str) -> bool {
    converted
        .lost
        .iter()
        .any(|lost| lost.to_string().contains(part))
}

#[test]
fn desks_become_these_files() {
    let cases = [
        ("desk.qvr", include_str!("samples/desk.qvr.toml")),
        ("desk.json", include_str!("samples/desk.json.toml")),
        ("desk.eqc", include_str!("samples/desk.eqc.toml")),
    ];
    for (name, expected) in cases {
        let found = converted(name).toml;
        assert_eq!(found, expected, "{name} became:\n{found}");
    }
}

/// Every key is one of the schema.
#[test]
fn files_have_the_schemas_keys_only() {
    fn check(name: &str, path: &str, table: &dyn TableLike) {
        let (_, known) = SCHEMA.iter().find(|(known, _)| *known == path).unwrap();
        for (key, item) in table.iter() {
            assert!(known.contains(&key), "{name}: {path}.{key}");
            let path = if path.is_empty() {
                key.to_owned()
            } else {
                format!("{path}.{key}")
            };
            if let Some(list) = item.as_array_of_tables() {
                list.iter().for_each(|table| check(name, &path, table));
            } else if let Some(table) = item.as_table_like() {
                check(name, &path, table);
            }
        }
    }
    for (name, ..) in SAMPLES {
        check(name, "", document(name).as_table());
    }
}

/// References, squares, right angles and regions: what a wall file is checked for.
#[test]
fn files_describe_walls_that_hold() {
    for (name, ..) in SAMPLES {
        let document = document(name);
        let root = document.as_table();
        let names = |key: &str| -> HashSet<String> {
            let list = tables(root, key);
            let set: HashSet<_> = list.iter().map(|t| text(*t, "name").to_owned()).collect();
            assert_eq!(set.len(), list.len(), "{name}: {key}");
            set
        };
        let (observers, trackers) = (names("observers"), names("trackers"));
        let (screens, hosts) = (names("screens"), names("hosts"));
        assert!(!observers.is_empty() && !screens.is_empty() && !hosts.is_empty());
        for observer in tables(root, "observers") {
            let tracker = text(observer, "tracker");
            assert!(tracker.is_empty() || trackers.contains(tracker));
        }
        for screen in tables(root, "screens") {
            assert!(observers.contains(text(screen, "observer")), "{name}");
            let size = numbers(screen.get("size_px").unwrap());
            let Some(corners) = screen.get("corners_m").and_then(Item::as_table_like) else {
                assert!((size[0] - size[1]).abs() < 0.5, "{name}: a dome is square");
                continue;
            };
            let corner = |key: &str| {
                let list = numbers(corners.get(key).unwrap());
                glam::DVec3::new(list[0], list[1], list[2])
            };
            let right = corner("bottom_right") - corner("bottom_left");
            let up = corner("top_left") - corner("bottom_left");
            let aside = right.dot(up).abs() / right.length().max(up.length());
            assert!(aside < 1e-4, "{name}: {aside}");
            let aspect = (size[0] / right.length()) / (size[1] / up.length());
            assert!((aspect - 1.0).abs() <= 0.02, "{name}: {aspect}");
        }
        for host in tables(root, "hosts") {
            for output in tables(host, "outputs") {
                let size = numbers(output.get("size_px").unwrap());
                assert!(output.get("window").is_some() != output.get("headless").is_some());
                let channels = tables(output, "channels");
                assert!(!channels.is_empty());
                for channel in channels {
                    let screen = tables(root, "screens")
                        .into_iter()
                        .find(|screen| text(*screen, "name") == text(channel, "screen"))
                        .unwrap();
                    let whole = numbers(screen.get("size_px").unwrap());
                    let canvas = numbers(channel.get("canvas_px").unwrap());
                    let place = numbers(channel.get("output_px").unwrap());
                    for axis in 0..2 {
                        assert!(canvas[axis] >= 0.0 && canvas[axis + 2] >= 1.0);
                        assert!(canvas[axis] + canvas[axis + 2] <= whole[axis], "{name}");
                        assert!(place[axis] >= 0.0);
                        assert!(place[axis] + canvas[axis + 2] <= size[axis], "{name}");
                    }
                    assert!(channel.get("eye").is_none() || output.get("stereo").is_none());
                }
            }
        }
    }
}

#[test]
fn a_qvr_cave_has_four_walls_and_a_tracked_guest() {
    let found = converted("cave.qvr");
    for part in [
        "source = \"DTrack@tracker-host:3884\"",
        "body = 2",
        "looks_deg = [90.0, 0.0, 0.0]",
        "tracker = \"glasses\"",
        "bottom_left = [-1.5, 0.0, 1.5], bottom_right = [-1.5, 0.0, -1.5]",
        "window = { position_px = [0, 0], fullscreen = true, monitor = 1 }",
        // Not square: 1600 × 1200 on 3 m × 3 m.
        "canvas_px = [0, 0, 1200, 1200]\noutput_px = [200, 0]",
        // No size on a square wall.
        "size_px = [1080, 1080]",
    ] {
        assert!(found.toml.contains(part), "{part}\n{}", found.toml);
    }
    for part in [
        "quad buffers",
        "warp-plugin a b",
        "wand",
        "render_resolution_factor 0.5",
        ":1",
    ] {
        assert!(has_lost(&found, part), "{part}");
    }
}

#[test]
fn a_qvr_cluster_shares_screens_between_eyes() {
    let found = converted("cluster.qvr");
    assert_eq!(
        tables(document("cluster.qvr").as_table(), "screens").len(),
        2
    );
    assert_eq!(found.toml.matches("screen = \"wall-left\"").count(), 2);
    for part in [
        "eye = \"left\"",
        "eye = \"right\"",
        "head_m = [0.0, 1.8, 0.5]",
        "looks_deg = [20.0, 10.0, 0.0]",
        "name = \"first viewer\"",
    ] {
        assert!(found.toml.contains(part), "{part}\n{}", found.toml);
    }
    for part in [
        "parallelogram",
        "ssh node-a env",
        "head-mounted",
        "moved by 20.0 mm",
    ] {
        assert!(has_lost(&found, part), "{part}\n{}", found.toml);
    }
}

#[test]
fn an_sgct_cave_keeps_its_tracker_and_meshes() {
    let found = converted("cave.json");
    for part in [
        "name = \"four walls\"",
        "fps = 120",
        "stereo = \"checkerboard\"\nswap_eyes = true",
        "calibration = { file = \"warps/front.mpcdi\" }",
        "unit_m = 0.5",
        // The inverse of 90° down about x turns the tracker's z, up, into the room's y.
        "to_room = { origin_m = [0.0, 0.25, -1.0], x = [1.0, 0.0, 0.0], y = [0.0, 0.0, 1.0], z = [0.0, -1.0, 0.0] }",
        "to_head = { offset_m = [0.0, -0.0625, 0.0], looks_deg = [0.0, 0.0, 0.0] }",
        "bottom_left = [-1.5, 0.0, 1.5], bottom_right = [1.5, 0.0, 1.5], top_left = [-1.5, 0.0, -1.5]",
        "output_px = [3000, 0]",
    ] {
        assert!(found.toml.contains(part), "{part}\n{}", found.toml);
    }
    for part in ["warps/right.sgc", "front.png", "swapinterval", "stick"] {
        assert!(has_lost(&found, part), "{part}");
    }
}

#[test]
fn an_sgct_cluster_has_a_cropped_dome_and_turned_planes() {
    let found = converted("cluster.json");
    for part in [
        "stereo = \"side-by-side\"\nswap_eyes = true",
        "kind = \"sphere\"\ncentre_m = [0.0, 0.0, 0.0]\nradius_m = 6.0\ntilt_deg = 27.0\nfisheye_deg = 170.0",
        "size_px = [1728, 1728]",
        // A quarter is cropped above, an eighth below.
        "eye = \"right\"\ncanvas_px = [0, 432, 1728, 1080]\noutput_px = [96, 0]",
        "looks_deg = [-90.0, 10.0, -5.0]",
        "name = \"127.0.0.1-2\"",
    ] {
        assert!(found.toml.contains(part), "{part}\n{}", found.toml);
    }
    for part in [
        "CylindricalProjection",
        "spout",
        "no tracker of this file",
        "distance is not stated",
    ] {
        assert!(has_lost(&found, part), "{part}");
    }
}

#[test]
fn an_equalizer_cave_has_four_walls_in_one_output() {
    let found = converted("cave.eqc");
    for part in [
        "headless = true\ngpu = 1",
        "output_px = [400, 0]",
        "head_m = [0.0, 1.7, 0.0]\neye_separation_m = 0.06\ntracker = \"guest tracker\"",
        "source = \"head@tracker\"",
        "to_head = { offset_m = [0.0, 1.7, 0.0], looks_deg = [0.0, 0.0, 0.0] }",
        "name = \"east\"",
    ] {
        assert!(found.toml.contains(part), "{part}\n{}", found.toml);
    }
    for part in [
        "parallelogram",
        "type HMD",
        "NV_group 1",
        "focus_distance 1.5",
        "layout 1",
    ] {
        assert!(has_lost(&found, part), "{part}\n{}", found.toml);
    }
}

#[test]
fn an_equalizer_cluster_cuts_tiles_from_one_screen() {
    let found = converted("cluster.eqc");
    for part in [
        "name = \"tiles\"\nobserver = \"guests\"\nsize_px = [3840, 1080]",
        "eye = \"right\"\ncanvas_px = [1920, 0, 1920, 1080]",
        "gpu = 1",
        "name = \"node-1\"",
        "stereo = \"anaglyph-green-magenta\"",
        // The wall of the view holds over that of the canvas, on the right half of the window.
        "bottom_left = [-0.5, -0.5, -2.0], bottom_right = [0.5, -0.5, -2.0], top_left = [-0.5, 0.625, -2.0]",
        "output_px = [480, 0]",
    ] {
        assert!(found.toml.contains(part), "{part}\n{}", found.toml);
    }
    for part in [
        "helper",
        "load_equalizer",
        "launch_command",
        "opencv_camera",
        "CORE 2",
        "renderer",
    ] {
        assert!(has_lost(&found, part), "{part}\n{}", found.toml);
    }
}

#[test]
fn compounds_with_walls_show_and_others_are_listed() {
    let found = converted("compounds.eqc");
    for part in [
        // a is the lower half of the window and of the wall, b the upper ones.
        "screen = \"a\"\ncanvas_px = [0, 0, 800, 300]\noutput_px = [0, 300]",
        "screen = \"b\"\ncanvas_px = [0, 0, 800, 300]\noutput_px = [0, 0]",
        "bottom_left = [-1.0, -0.25, -2.0]",
        "size_px = [800, 1200]",
    ] {
        assert!(found.toml.contains(part), "{part}\n{}", found.toml);
    }
    assert!(has_lost(&found, "quad"));
    assert!(has_lost(&found, "range"));
}

#[test]
fn lists_are_in_the_order_of_the_source() {
    for (name, ..) in SAMPLES.iter().filter(|(name, ..)| !name.ends_with(".json")) {
        let lines: Vec<u32> = converted(name)
            .lost
            .iter()
            .filter_map(|lost| {
                lost.place
                    .strip_prefix("line ")?
                    .split(' ')
                    .next()?
                    .parse()
                    .ok()
            })
            .collect();
        assert!(lines.len() > 1 || *name == "desk.qvr");
        assert!(lines.is_sorted(), "{name}: {lines:?}");
    }
}
