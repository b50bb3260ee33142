//! What a frame's covers cost. Prints times; run with
//! `cargo test --release -p screens --test timing -- --ignored --nocapture`.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
#![allow(clippy::print_stdout, reason = "printing is what it is for")]

mod common;

use std::hint::black_box;
use std::time::Instant;

use common::{fisheye, siegen};
use glam::DVec3;
use screens::{CoverLimits, SampledMap, pixel_density};

fn fastest_us<T>(mut work: impl FnMut() -> T) -> f64 {
    (0..30)
        .map(|_| {
            let start = Instant::now();
            black_box(work());
            start.elapsed().as_secs_f64() * 1e6
        })
        .fold(f64::INFINITY, f64::min)
}

#[test]
#[ignore = "prints times"]
fn frames_of_channels() {
    let eyes = [
        DVec3::new(0.03, 1.78, 0.0),
        DVec3::new(0.4, 1.6, 0.5),
        DVec3::new(-1.1, 1.5, -0.6),
    ];
    let limits = CoverLimits::default();
    let channels = [
        (
            "a wall of Siegen",
            siegen(1),
            [1920, 1200],
            [0, 0, 1920, 1200],
        ),
        (
            "a quarter of a dome",
            fisheye(180.0),
            [4096; 2],
            [2048, 2048, 1920, 1200],
        ),
        (
            "a whole dome",
            fisheye(180.0),
            [2048; 2],
            [0, 0, 2048, 2048],
        ),
    ];
    for (name, shape, canvas_px, rect_px) in channels {
        let size_px = [rect_px[2], rect_px[3]];
        let map = shape.channel_map(canvas_px, rect_px);
        let build_us = fastest_us(|| SampledMap::new(&map, size_px));
        let sampled = SampledMap::new(&map, size_px).unwrap();
        println!("{name}: built in {:.1} ms", build_us / 1e3);
        for eye_m in eyes {
            let cover_us = fastest_us(|| sampled.cover(black_box(eye_m), &limits));
            let channel_us = fastest_us(|| sampled.density(black_box(eye_m)));
            let canvas_us = fastest_us(|| pixel_density(&shape, canvas_px, black_box(eye_m)));
            let cover = sampled.cover(eye_m, &limits);
            let views_px: u32 = cover
                .parts
                .iter()
                .map(|part| part.view.size_px.iter().product::<u32>())
                .sum();
            let growth = f64::from(views_px) / f64::from(size_px[0] * size_px[1]);
            println!(
                "  {} parts, {growth:.2} view pixels to a pixel: cover {cover_us:.0} µs, density of the channel {channel_us:.0} µs, of the canvas {canvas_us:.0} µs",
                cover.parts.len()
            );
        }
    }
}
