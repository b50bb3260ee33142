//! The oracle against cases that are known and against a slower way to the same number; and the cells of eyes.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod common;
mod oracle_ground;

use std::collections::HashSet;
use std::time::Instant;

use common::Random;
use geodesy::{Ellipsoid, LatticePoint, Tile};
use glam::DVec3;
use oracle_ground::{Ground, Leaf, eye_in, eye_over, random_tile, width_m};
use terrain::{
    EyeCell, Marks, RefineView, TileGeometryError, allowances, eye_cell, measure, triangles,
};

/// The two triangles above and below a diagonal, or the four of the smallest mesh.
fn coarsest(leaf: &Leaf) -> (Vec<terrain::Vertex>, Vec<u32>) {
    leaf.mesh(&Marks::new())
}

#[test]
fn the_angle_is_that_of_plain_trigonometry() {
    let mut random = Random(51);
    for round in 0..12 {
        let tile = random_tile(&mut random, round + 2);
        let relief_m = 0.1 * width_m(&Ellipsoid::MARS, tile);
        let leaf = Leaf::new(
            &Ellipsoid::MARS,
            tile,
            Ground::Fractal,
            relief_m,
            random.next(),
        );
        let eye = eye_over(&mut random, &leaf, 1.5, 0.4);
        let mut marks = Marks::new();
        for mark in [
            [128, 0],
            [64, 64],
            [0, 128],
            [64, 0],
            [64, 128],
            [0, 64],
            [128, 64],
            [96, 32],
        ] {
            marks.set(mark[0], mark[1]);
        }
        let measured = leaf.measure(&marks, eye, 1000.0);
        let mut largest = 0.0_f64;
        let corners = triangles(&marks);
        for y in 0..=256_u16 {
            for x in 0..=256_u16 {
                let height_m = leaf.heights_m[usize::from(y) * 257 + usize::from(x)];
                let normal = LatticePoint::of_tile(tile, i64::from(x), i64::from(y)).normal();
                let truth = leaf.ellipsoid.point(normal, height_m) - eye;
                for corners in &corners {
                    let [a, b, c] =
                        corners.map(|[x, y]| DVec3::new(f64::from(x), f64::from(y), 0.0));
                    let p = DVec3::new(f64::from(x), f64::from(y), 0.0);
                    let area = |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - p).z;
                    let weights = [area(b, c, p), area(c, a, p), area(a, b, p)]
                        .map(|part| part / area(a, b, c));
                    if weights.iter().any(|weight| *weight < 0.0) {
                        continue;
                    }
                    let drawn = corners.iter().zip(weights).map(|(corner, weight)| {
                        (leaf.vertex(*corner).point().to_ecef() - eye) * weight
                    });
                    largest = largest.max(truth.angle_between(drawn.sum()));
                }
            }
        }
        let px = largest * 1000.0;
        assert!(
            (measured.max_px - px).abs() < 1e-4 * px,
            "{measured:?}, not {px}"
        );
        assert_eq!((measured.samples, measured.uncovered), (257 * 257, 0));
    }
}

#[test]
fn a_needle_is_found_where_it_stands() {
    let tile: Tile = "2/12/2000/1000".parse().unwrap();
    let ellipsoid = Ellipsoid::EARTH;
    let mut heights_m = vec![0.0; 257 * 257];
    heights_m[100 * 257 + 37] = 50.0;
    let leaf = Leaf::of_heights(&ellipsoid, tile, heights_m);
    let normal = LatticePoint::of_tile(tile, 37, 100).normal();
    // Seen from the side at 10 km; the ground's own curvature adds a little to the 50 m.
    let foot = ellipsoid.point(normal, 0.0);
    let eye = foot + normal.any_orthonormal_vector() * 10_000.0;
    let (vertices, indices) = coarsest(&leaf);
    let found = measure(
        &ellipsoid,
        tile,
        &leaf.heights_m,
        &vertices,
        &indices,
        eye,
        1000.0,
    );
    assert_eq!(found.worst, [37, 100]);
    assert!((found.max_px - 5.0).abs() < 0.1, "{found:?}");
    // From straight above it does not show.
    let above = ellipsoid.point(normal, 10_000.0);
    let found = measure(
        &ellipsoid,
        tile,
        &leaf.heights_m,
        &vertices,
        &indices,
        above,
        1000.0,
    );
    assert!(found.max_px < 0.1, "{found:?}");
    // Without a number it is no sample.
    let mut lacking = leaf.heights_m.clone();
    lacking[100 * 257 + 37] = f64::NAN;
    let found = measure(&ellipsoid, tile, &lacking, &vertices, &indices, eye, 1000.0);
    assert_eq!((found.samples, found.uncovered), (257 * 257 - 1, 0));
    assert!(found.max_px < 0.2, "{found:?}");
}

#[test]
fn what_no_triangle_covers_is_counted() {
    let tile: Tile = "1/5/3/3".parse().unwrap();
    let leaf = Leaf::new(&Ellipsoid::EARTH, tile, Ground::Flat, 0.0, 1);
    let eye = eye_over(&mut Random(3), &leaf, 2.0, 0.7);
    let (vertices, indices) = coarsest(&leaf);
    let run = |indices: &[u32]| {
        measure(
            &leaf.ellipsoid,
            tile,
            &leaf.heights_m,
            &vertices,
            indices,
            eye,
            1000.0,
        )
    };
    assert_eq!(run(&indices).uncovered, 0);
    // One of four triangles is missing: its inside and its hypotenuse, without the two ends' legs.
    let rest = run(&indices[3..]);
    assert_eq!(rest.uncovered, 128 * 128);
    assert_eq!(rest.samples + rest.uncovered, 257 * 257);
    // An index out of range and a triangle without area cover nothing.
    assert_eq!(run(&[0, 1, 60_000, 0, 0, 1]).uncovered, 257 * 257);
    assert_eq!(run(&[]).samples, 0);
}

#[test]
fn cells_hold_their_eyes_and_last() {
    let mut random = Random(52);
    let ellipsoid = Ellipsoid::EARTH;
    for round in 0..200 {
        let tile = random_tile(&mut random, round % 18);
        let width_m = width_m(&ellipsoid, tile);
        let range_m = (-0.05 * width_m, 0.1 * width_m);
        let normal = LatticePoint::of_tile(tile, 256, 0).normal();
        let distance_m = width_m * 10_f64.powf(random.between(-1.0, 3.0));
        let eye = ellipsoid.point(normal, range_m.1) + random.direction() * distance_m;
        let cell = eye_cell(&ellipsoid, tile, range_m, eye);
        assert_eq!(
            cell.to_bits(),
            eye_cell(&ellipsoid, tile, range_m, eye).to_bits()
        );
        assert!(eye.distance(cell.centre) <= cell.radius_m);
        if cell.radius_m == 0.0 {
            assert_eq!(cell, EyeCell::exact(eye));
            continue;
        }
        let foot = ellipsoid.point(normal, 0.0);
        assert!(cell.radius_m < eye.distance(foot) / 16.0, "{cell:?}");
        // Nearly all steps that are small against the cell lead to the same one.
        let steps = (0..200).filter(|_| {
            let step = random.direction() * (0.01 * cell.radius_m);
            eye_cell(&ellipsoid, tile, range_m, eye + step) != cell
        });
        let changed = steps.count();
        assert!(changed < 150, "{changed} of 200 at {tile}");
        // Whatever eye is in the cell is near it, whatever cell it has itself.
        let other = eye_in(&mut random, &cell);
        assert!(other.distance(cell.centre) <= cell.radius_m);
    }
    // Leaves at one distance change together: a mesh depends on all cells around it.
    let eye = ellipsoid.point(DVec3::X, 3_000_000.0);
    let tiles = (28..36_u32).map(|n| Tile::new(0, 6, n, 31).unwrap());
    let centres: HashSet<[u64; 4]> = tiles
        .map(|tile| eye_cell(&ellipsoid, tile, (0.0, 1.0), eye).to_bits())
        .collect();
    assert_eq!(centres.len(), 1);
    // Far, near and nowhere.
    let tile: Tile = "0/6/31/31".parse().unwrap();
    for eye in [DVec3::NAN, DVec3::INFINITY, ellipsoid.point(DVec3::X, 0.5)] {
        assert_eq!(eye_cell(&ellipsoid, tile, (0.0, 1.0), eye).radius_m, 0.0);
    }
}

#[test]
fn tables_and_measurements_are_quick() {
    let ellipsoid = Ellipsoid::EARTH;
    let mut random = Random(53);
    let fastest = |run: &mut dyn FnMut()| {
        let times = (0..30).map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64()
        });
        times.fold(f64::INFINITY, f64::min)
    };
    for level in [2, 12] {
        let tile = random_tile(&mut random, level);
        let relief_m = 0.1 * width_m(&ellipsoid, tile);
        let leaf = Leaf::new(&ellipsoid, tile, Ground::Fractal, relief_m, 5);
        let eye = eye_over(&mut random, &leaf, 3.0, 0.5);
        let view = RefineView {
            eye,
            pixels_per_radian: 1200.0,
            tau_px: 1.0,
        };
        let cell = EyeCell::exact(eye);
        let geometry_s = fastest(&mut || {
            std::hint::black_box(TileGeometryError::new(&ellipsoid, tile));
        });
        let table_s = fastest(&mut || {
            std::hint::black_box(allowances(
                &leaf.geometry,
                &leaf.blocks,
                leaf.unit_m,
                &view,
                &cell,
            ));
        });
        let cell_s = fastest(&mut || {
            std::hint::black_box(eye_cell(&ellipsoid, tile, (0.0, 1.0), eye));
        });
        let marks = leaf.refine(&leaf.table(&view, &cell));
        let (vertices, indices) = leaf.mesh(&marks);
        let measure_s = fastest(&mut || {
            std::hint::black_box(measure(
                &ellipsoid,
                tile,
                &leaf.heights_m,
                &vertices,
                &indices,
                eye,
                1200.0,
            ));
        });
        eprintln!(
            "level {level}: geometry {:.1} µs, table {:.1} µs, cell {:.2} µs, measure {:.2} ms for {} triangles",
            geometry_s * 1e6,
            table_s * 1e6,
            cell_s * 1e6,
            measure_s * 1e3,
            indices.len() / 3
        );
        // Generous, for a machine that others use too.
        assert!(table_s < 300e-6 && geometry_s < 2e-3 && measure_s < 0.1);
    }
}
