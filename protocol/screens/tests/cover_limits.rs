//! Covers where it is hard: ragged and tiny maps, eyes on, behind and far from screens, limits, trembling heads.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod common;

use common::examine::{examine, examine_heads, pixels};
use common::{Random, fisheye, planar, siegen, smooth_screens};
use glam::DVec3;
use screens::{Cover, CoverLimits, SampledMap};

#[test]
fn islands_and_holes_of_a_map_are_covered() {
    // A measured map: what is shown has a ragged rim, islands smaller than the way between samples, and a hole.
    let shape = siegen(2);
    let size_px = [1200, 800];
    let whole = shape.channel_map(size_px, [0, 0, 1200, 800]);
    let shown = |x: f64, y: f64| {
        let (column, row) = (x.floor(), y.floor());
        let body = (column - 700.0).abs() < 250.0 + 40.0 * (row * 0.07).sin()
            && (row - 300.0).abs() < 220.0;
        let hole = (column - 760.0).powi(2) + (row - 260.0).powi(2) < 900.0;
        let island = (column - 73.0).abs() < 1.5 && (row - 741.0).abs() < 1.5;
        let lone = (column, row) == (1193.0, 5.0);
        (body && !hole) || island || lone
    };
    let map = |x: f64, y: f64| whole(x, y).filter(|_| shown(x, y));
    let found = pixels(&map, size_px, 1);
    assert!(found.iter().any(|pixel| (pixel.x, pixel.y) == (1193, 5)));
    examine_heads("islands", &map, size_px, DVec3::new(0.0, 1.5, 0.0), 1.0, 10);
    let nothing = |_: f64, _: f64| None;
    assert_eq!(
        Cover::of(&nothing, size_px, DVec3::Y, &CoverLimits::default()),
        Cover::default()
    );
    // A single pixel takes a single small view.
    let lone = |x: f64, y: f64| whole(x, y).filter(|_| (x, y) == (500.5, 300.5));
    let cover = Cover::of(&lone, size_px, DVec3::Y, &CoverLimits::default());
    let [part] = cover.parts.as_slice() else {
        panic!("{} parts", cover.parts.len())
    };
    assert_eq!((part.view.size_px, part.whole), ([16, 16], true));
    assert!(
        part.view
            .contains(part.view.project(whole(500.5, 300.5).unwrap() - DVec3::Y))
    );
}

#[test]
fn small_channels_are_covered() {
    for size_px in [[1, 1], [3, 2], [9, 40], [70, 7]] {
        let shape = siegen(1);
        let map = shape.channel_map(size_px, [0, 0, size_px[0], size_px[1]]);
        examine_heads("small", &map, size_px, DVec3::new(0.0, 1.5, 0.0), 1.0, 20);
    }
}

#[test]
fn eyes_anywhere_get_a_finite_cover() {
    let limits = CoverLimits::default();
    let size_px = [320, 200];
    for (name, shape, ..) in smooth_screens() {
        let map = shape.channel_map(size_px, [0, 0, 320, 200]);
        let sampled = SampledMap::new(&map, size_px).unwrap();
        let on_it = shape.point_m(0.47, 0.53).unwrap();
        let towards = shape.normal(0.47, 0.53).unwrap();
        let at_sample = map(160.0, 100.0).unwrap();
        let eyes = [
            on_it,
            at_sample,
            on_it + towards * 1e-4,
            on_it + towards * 0.01,
            on_it + towards * 0.1,
            on_it - towards * 0.1,
            on_it - towards * 3.0,
            on_it + towards * 50.0,
            DVec3::ZERO,
            DVec3::Y * 9e3,
        ];
        for eye_m in eyes {
            let cover = sampled.cover(eye_m, &limits);
            assert!(
                (1..=32).contains(&cover.parts.len()),
                "{name} {eye_m}: {}",
                cover.parts.len()
            );
            for part in &cover.parts {
                assert!(part.view.lower_left_m.is_finite() && part.view.forward().is_finite());
                assert!(
                    part.view
                        .size_m
                        .iter()
                        .all(|side| side.is_finite() && *side > 0.0)
                );
                assert!(
                    part.view
                        .size_px
                        .iter()
                        .all(|side| (16..=8192).contains(side))
                );
                assert!(part.view.sampling.is_finite() && part.view.sampling >= 0.0);
            }
            // Farther than a hand's breadth from the screen all is seen, and the telling of it holds.
            if eye_m == on_it - towards * 3.0 || eye_m == on_it + towards * 50.0 {
                let pixels = pixels(&map, size_px, 1);
                examine(name, &cover, &pixels, size_px, eye_m, &limits);
            }
        }
        for eye_m in [DVec3::NAN, DVec3::new(0.0, f64::INFINITY, 0.0)] {
            assert_eq!(sampled.cover(eye_m, &limits), Cover::default());
        }
    }
}

#[test]
fn limits_hold_and_are_told_of() {
    let shape = siegen(1);
    let map = shape.channel_map([1920, 1200], [0, 0, 1920, 1200]);
    let sampled = SampledMap::new(&map, [1920, 1200]).unwrap();
    let eye_m = DVec3::new(0.3, 1.6, 0.2);
    let few = CoverLimits {
        most_px: 1000,
        ..CoverLimits::default()
    };
    let cover = sampled.cover(eye_m, &few);
    examine(
        "few pixels",
        &cover,
        &pixels(&map, [1920, 1200], 7),
        [1920, 1200],
        eye_m,
        &few,
    );
    assert!(cover.parts.iter().all(|part| part.view.is_undersampled() && part.view.size_px.iter().max() == Some(&992)));
    let narrow = CoverLimits {
        half_angle_deg: 12.0,
        ..CoverLimits::default()
    };
    let cover = sampled.cover(eye_m, &narrow);
    examine(
        "narrow",
        &cover,
        &pixels(&map, [1920, 1200], 7),
        [1920, 1200],
        eye_m,
        &narrow,
    );
    assert!(
        (8..=16).contains(&cover.parts.len()),
        "{}",
        cover.parts.len()
    );
    // Too few parts: wider ones, as long as they are at all planar; and what they leave out is told.
    let one = CoverLimits {
        half_angle_deg: 12.0,
        most_parts: 1,
        ..CoverLimits::default()
    };
    let cover = sampled.cover(eye_m, &one);
    assert!(cover.parts.len() == 1 && cover.parts[0].whole);
    let dome = fisheye(200.0);
    let map = dome.channel_map([512; 2], [0, 0, 512, 512]);
    let cover = Cover::of(&map, [512; 2], DVec3::new(0.0, 1.5, 0.0), &one);
    assert!(cover.parts.len() == 1 && !cover.parts[0].whole);
    // Limits that are none.
    let wild = CoverLimits {
        half_angle_deg: f64::NAN,
        most_px: 0,
        most_growth: f64::NAN,
        most_parts: 0,
    };
    let cover = sampled.cover(eye_m, &wild);
    assert!(cover.parts.len() == 1 && cover.parts[0].view.size_px.iter().max() == Some(&64));
    let wide = CoverLimits {
        half_angle_deg: 1e9,
        ..CoverLimits::default()
    };
    assert_eq!(sampled.cover(eye_m, &wide).parts.len(), 1);
    for size_px in [[0, 5], [20_000, 5]] {
        assert_eq!(Cover::of(&map, size_px, eye_m, &wide), Cover::default());
    }
}

#[test]
fn covers_seldom_change_while_a_head_barely_moves() {
    let shape = siegen(1);
    let map = shape.channel_map([1920, 1200], [0, 0, 1920, 1200]);
    let sampled = SampledMap::new(&map, [1920, 1200]).unwrap();
    let mut random = Random(29);
    let what = |cover: &Cover| {
        cover
            .parts
            .iter()
            .map(|part| (part.rect_px, part.view.size_px))
            .collect::<Vec<_>>()
    };
    let mut changes = 0;
    for _ in 0..200 {
        let eye_m = DVec3::new(0.0, 1.5, 0.0) + random.within(1.0);
        // A tenth of a millimetre: what a tracker trembles.
        let near_m = eye_m + random.direction() * 1e-4;
        let [here, near] =
            [eye_m, near_m].map(|eye_m| sampled.cover(eye_m, &CoverLimits::default()));
        changes += u32::from(what(&here) != what(&near));
        for (here, near) in here
            .parts
            .iter()
            .zip(&near.parts)
            .filter(|_| what(&here).len() == what(&near).len())
        {
            assert!(
                here.rect_px != near.rect_px || here.view.right.distance(near.view.right) < 1e-3
            );
        }
    }
    assert!(changes <= 20, "{changes}");
}

#[test]
fn planes_need_one_view_of_about_their_size() {
    let shape = planar();
    let map = shape.channel_map([1506, 1000], [0, 0, 1506, 1000]);
    // 3 m in front of its middle.
    let eye_m = shape.point_m(0.5, 0.5).unwrap() + shape.normal(0.5, 0.5).unwrap() * 3.0;
    let cover = Cover::of(&map, [1506, 1000], eye_m, &CoverLimits::default());
    let [part] = cover.parts.as_slice() else {
        panic!("{} parts", cover.parts.len())
    };
    // 1 % reserve and 2 pixels of margin, up to a multiple of 16.
    let [width, height] = part.view.size_px;
    assert!(width == 1536 && height == 1024, "{width} {height}");
    assert!(part.view.forward().dot(shape.normal(0.5, 0.5).unwrap()) < -0.9999);
}
