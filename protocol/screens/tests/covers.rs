//! Views cover screens: every output pixel's direction lies in its part's view, and none is undersampled.
//! Against brute force over all pixels, with slopes taken anew.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod common;

use common::examine::examine_heads;
use common::{fisheye, grid, points_of, siegen, smooth_screens};
use glam::DVec3;
use screens::{Cover, CoverLimits, PointsAt};

#[test]
fn a_hundred_heads_see_every_pixel_of_every_screen() {
    for (name, shape, room_m, radius_m) in smooth_screens() {
        // Pixels about as wide as high.
        let canvas_px = match name {
            "arc" => [480, 120],
            "ring" => [760, 100],
            "grid" => [400, 120],
            "fisheye" | "wide fisheye" => [200, 200],
            _ => [240, 160],
        };
        let map = shape.channel_map(canvas_px, [0, 0, canvas_px[0], canvas_px[1]]);
        let (parts, share) = examine_heads(name, &map, canvas_px, room_m, radius_m, 100);
        assert!(
            parts <= 25 && share < 10.0,
            "{name}: {parts} parts, {share}"
        );
    }
}

#[test]
fn a_hundred_heads_see_every_pixel_of_a_surface_of_points() {
    for at in [PointsAt::CellCentres, PointsAt::Corners] {
        let shape = points_of(&siegen(1), 61, 43, at);
        let map = shape.channel_map([240, 160], [0, 0, 240, 160]);
        examine_heads(
            "points",
            &map,
            [240, 160],
            DVec3::new(0.0, 1.5, 0.0),
            1.2,
            100,
        );
    }
    // One point for each pixel.
    let shape = points_of(&fisheye(180.0), 160, 160, PointsAt::CellCentres);
    let map = shape.channel_map([160; 2], [0, 0, 160, 160]);
    examine_heads(
        "points of a dome",
        &map,
        [160; 2],
        DVec3::new(0.0, 1.5, 0.0),
        2.5,
        30,
    );
}

#[test]
fn channels_that_are_cut_from_a_canvas_are_covered() {
    // A projector shows a part of a dome's canvas, with a bit of its circle.
    let shape = fisheye(180.0);
    let map = shape.channel_map([4096; 2], [2600, 2100, 960, 1600]);
    let (parts, share) = examine_heads(
        "part of a dome",
        &map,
        [960, 1600],
        DVec3::new(0.0, 1.5, 0.0),
        2.0,
        4,
    );
    assert!(parts <= 4 && share < 6.0, "{parts} {share}");
    let shape = siegen(1);
    let map = shape.channel_map([1920, 1200], [0, 0, 1920, 1200]);
    let (parts, share) = examine_heads("wall", &map, [1920, 1200], common::SIEGEN_HEAD, 0.3, 4);
    assert!(parts <= 2 && share < 4.0, "{parts} {share}");
}

#[test]
fn segments_of_siegen_take_one_view_each_from_where_they_were_aligned() {
    for wall in 0..4 {
        let shape = siegen(wall);
        let map = shape.channel_map([1920, 1200], [0, 0, 1920, 1200]);
        let cover = Cover::of(
            &map,
            [1920, 1200],
            common::SIEGEN_HEAD,
            &CoverLimits::default(),
        );
        let [part] = cover.parts.as_slice() else {
            panic!("{} parts", cover.parts.len())
        };
        assert_eq!(part.rect_px, [0, 0, 1920, 1200]);
        // Upright: the walls are, and so is the head.
        assert!(part.view.right.y.abs() < 0.02, "{}", part.view.right);
        assert!(part.view.sampling >= 1.0 && part.view.sampling < 1.02);
    }
}

#[test]
fn poles_of_grids_do_not_ask_for_endless_views() {
    let shape = grid([-180.0, 180.0], [-90.0, 90.0]);
    let map = shape.channel_map([400, 200], [0, 0, 400, 200]);
    let (parts, share) = examine_heads(
        "whole sphere",
        &map,
        [400, 200],
        DVec3::new(0.0, 1.5, 0.0),
        1.0,
        10,
    );
    assert!(parts <= 32 && share < 12.0, "{parts} {share}");
}
