//! The scene of layers in the README: its lens changes what lies within it and nothing else, and layers without weight
//! are not there. Real processes, real data.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use image::RgbImage;
use tests::{command, data, pictures, sources};

/// The wall and the scene of `make layers`, at half the size and with absolute paths.
fn wall_and_scene() -> (String, String) {
    let read = |file: &str| std::fs::read_to_string(sources::root().join(file)).unwrap();
    let wall = read("configs/walls/single.toml")
        .replace("1280", "640")
        .replace("720", "360");
    let data = data::repositories();
    let scene =
        read("configs/scenes/layers.toml").replace("../../out/data", data.to_str().unwrap());
    (wall, scene)
}

/// The scene without the tables whose names begin so.
fn without(scene: &str, tables: &[&str]) -> String {
    let mut kept = String::new();
    let mut keep = true;
    for line in scene.lines() {
        if let Some(table) = line.strip_prefix('[') {
            keep = !tables.iter().any(|name| table.starts_with(name));
        }
        if keep {
            kept.push_str(line);
            kept.push('\n');
        }
    }
    assert!(kept.len() < scene.len(), "{tables:?} were there");
    kept
}

/// The first picture of a scene's camera path.
fn picture(wall: &str, scene: &str) -> RgbImage {
    let folder = data::folder(&[("wall.toml", wall), ("scene.toml", scene)]);
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    command::succeed(&format!(
        "up {} --scene {} --headless --no-control --frames 1 --capture {}",
        at("wall.toml"),
        at("scene.toml"),
        at("out")
    ));
    pictures::load(&folder.path().join("out/wall.png"))
}

/// How far channels may differ outside the lens: its rim makes the tiles around it finer.
const FINER: u8 = 40;

/// Pixels in which two pictures really differ: how many, and their first and last columns and rows.
fn extent(a: &RgbImage, b: &RgbImage) -> (u32, [u32; 4]) {
    let differing = a.enumerate_pixels().filter(|(x, y, pixel)| {
        let other = b.get_pixel(*x, *y);
        let pairs = pixel.0.iter().zip(other.0);
        pairs.into_iter().any(|(a, b)| a.abs_diff(b) > FINER)
    });
    let differing: Vec<_> = differing.collect();
    let count = differing.len() as u32;
    let extent = differing
        .into_iter()
        .fold([u32::MAX, 0, u32::MAX, 0], |[x0, x1, y0, y1], (x, y, _)| {
            [x0.min(x), x1.max(x), y0.min(y), y1.max(y)]
        });
    (count, extent)
}

#[test]
fn a_lens_changes_its_inside_and_layers_without_weight_change_nothing() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let (wall, scene) = wall_and_scene();
    let with_lens = picture(&wall, &scene);
    let plain = without(&scene, &["lenses."]);
    let without_lens = picture(&wall, &plain);
    let bare = without(&plain, &["layers.heights", "layers.shade"]);
    let differing = pictures::differing(&without_lens, &picture(&wall, &bare));
    assert_eq!(differing, 0, "hidden layers show");

    // The lens stands right of the middle and touches no border of the picture.
    let (differing, [left, right, top, bottom]) = extent(&with_lens, &without_lens);
    let share = f64::from(differing) / f64::from(640 * 360);
    assert!(
        (0.1..0.5).contains(&share),
        "the lens fills {share} of the picture"
    );
    assert!(
        left > 200 && right < 630 && top > 40 && bottom < 330,
        "columns {left}–{right}, rows {top}–{bottom}"
    );
}
