//! Pictures of a made-up planet: tiled equals single, what does not change is not drawn, and small
//! budgets still converge. Needs a device, as in `device_tests`.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use glam::DVec3;

use crate::canvas::PixelRect;
use crate::outputs::OutputPlan;
use crate::renderer::{EyeView, ViewPoint};
use crate::test_planet::{
    CANVAS, Planet, channel, empty_output, output, picture, settle, view, views,
};

#[test]
fn tiled_pictures_equal_the_single_one_bit_for_bit() {
    let Some(planet) = Planet::new() else { return };
    let whole = PixelRect {
        x: 0,
        y: 0,
        width: CANVAS[0],
        height: CANVAS[1],
    };
    let mut single = planet.renderer(&[output(whole)], 512 << 20);
    // Odd sizes and places, so that nothing falls on convenient borders.
    let parts = [
        (0, 0, 101, 77),
        (101, 0, 219, 77),
        (0, 77, 37, 103),
        (37, 77, 283, 103),
    ]
    .map(|(x, y, width, height)| PixelRect {
        x,
        y,
        width,
        height,
    });
    let mut tiled = parts.map(|part| planet.renderer(&[output(part)], 512 << 20));
    for view in views() {
        settle(&mut single, &view);
        let whole = picture(&single);
        let shades: std::collections::HashSet<&[u8]> = whole.rgba.chunks(4).collect();
        assert!(shades.len() > 100, "the picture shows something");
        for (renderer, part) in tiled.iter_mut().zip(parts) {
            settle(renderer, &view);
            let piece = picture(renderer);
            for (row, line) in piece.rgba.chunks((part.width * 4) as usize).enumerate() {
                let first = ((part.y as usize + row) * CANVAS[0] as usize + part.x as usize) * 4;
                let expected = &whole.rgba[first..first + line.len()];
                assert!(
                    line == expected,
                    "row {row} of the part at {},{} differs",
                    part.x,
                    part.y
                );
            }
        }
    }
}

#[test]
fn a_node_with_several_channels_composes_them() {
    let Some(planet) = Planet::new() else { return };
    let whole = PixelRect {
        x: 0,
        y: 0,
        width: CANVAS[0],
        height: CANVAS[1],
    };
    let mut single = planet.renderer(&[output(whole)], 512 << 20);
    let left = PixelRect {
        x: 0,
        y: 0,
        width: 100,
        height: 180,
    };
    let right = PixelRect {
        x: 220,
        y: 0,
        width: 100,
        height: 180,
    };
    let two = OutputPlan {
        channels: vec![channel(0, right, [0, 0]), channel(0, left, [100, 0])],
        ..empty_output("two", [200, 180])
    };
    let mut swapped = planet.renderer(&[two], 512 << 20);
    let view = &views()[0];
    settle(&mut single, view);
    settle(&mut swapped, view);
    let (whole, swapped) = (picture(&single), picture(&swapped));
    for row in 0..180 {
        let line = &whole.rgba[row * 1280..(row + 1) * 1280];
        let made = &swapped.rgba[row * 800..(row + 1) * 800];
        assert_eq!(&made[..400], &line[880..]);
        assert_eq!(&made[400..], &line[..400]);
    }
}

#[test]
fn two_eyes_share_tiles_without_sharing_seams() {
    let Some(planet) = Planet::new() else { return };
    let [width, height] = CANVAS;
    let rect = PixelRect {
        x: 0,
        y: 0,
        width,
        height,
    };
    let below = |view: usize| channel(view, rect, [0, view as u32 * height]);
    let both = OutputPlan {
        channels: vec![below(0), below(1)],
        ..empty_output("both", [width, 2 * height])
    };
    // The same place from near and far: the same tiles beside neighbours of other levels.
    let (far, near) = (view(46.0, 46.0, 3e6, -60.0), view(46.0, 46.0, 9e5, -60.0));
    let pair = ViewPoint {
        eyes: vec![far.eyes[0], near.eyes[0]],
        views: vec![
            far.views[0],
            EyeView {
                eye: 1,
                ..near.views[0]
            },
        ],
        ..far.clone()
    };
    let mut together = planet.renderer(&[both], 2048 << 20);
    settle(&mut together, &pair);
    let made = picture(&together);
    let mut alone = planet.renderer(&[output(rect)], 512 << 20);
    for (half, view) in made.rgba.chunks(made.rgba.len() / 2).zip([far, near]) {
        settle(&mut alone, &view);
        assert!(
            half == picture(&alone).rgba.as_slice(),
            "one eye's picture is not its own"
        );
    }
}

#[test]
fn what_does_not_change_is_not_drawn_again() {
    let Some(planet) = Planet::new() else { return };
    let whole = PixelRect {
        x: 0,
        y: 0,
        width: CANVAS[0],
        height: CANVAS[1],
    };
    let mut renderer = planet.renderer(&[output(whole)], 512 << 20);
    let [first, second, ..] = views();
    settle(&mut renderer, &first);
    for _ in 0..5 {
        assert!(!renderer.draw(&first, 1).unwrap().redrawn);
    }
    assert!(renderer.draw(&second, 1).unwrap().redrawn);
    settle(&mut renderer, &second);
    assert!(!renderer.draw(&second, 1).unwrap().redrawn);
    renderer.set_sun(DVec3::Z);
    assert!(
        renderer.draw(&second, 1).unwrap().redrawn,
        "light is part of the picture"
    );
}

#[test]
fn the_smallest_budget_still_converges_and_then_loads_nothing() {
    let Some(planet) = Planet::new() else { return };
    let whole = PixelRect {
        x: 0,
        y: 0,
        width: CANVAS[0],
        height: CANVAS[1],
    };
    let mut renderer = planet.renderer(&[output(whole)], 0);
    // As a wall eight times as dense sees it: far more tiles than the least budget holds.
    let view = &ViewPoint {
        pixels_per_radian: 3200.0,
        ..views()[0].clone()
    };
    let settled = settle(&mut renderer, view);
    let px = settled.achieved_tile_px;
    assert!(px > 100.0, "quality drops and says so: split at {px} px");
    assert!(settled.drawn_tiles <= 31, "{settled:?}");
    let before = renderer.cache().counters();
    for _ in 0..20 {
        let again = renderer.draw(view, 1).unwrap();
        assert!(!again.redrawn && again.converged, "{again:?}");
    }
    assert_eq!(
        before.repository_reads,
        renderer.cache().counters().repository_reads
    );
}
