//! Culling drops nothing that is visible, and drops most of what is not.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod common;

use std::collections::HashSet;

use common::{PLACES, Random, earth_like, view};
use geodesy::{Ellipsoid, Horizon, LatticePoint, Tile};
use glam::{DMat4, DVec3, DVec4};
use terrain::{Frustum, LodLimits, LodView, cull, select};

/// Lowest height drawn anywhere, as `earth_like` has it.
const FLOOR_M: f64 = -600.0;

/// True if the segment from eye to point meets the body at the floor: nothing behind it is visible.
fn hidden_by_the_planet(ellipsoid: &Ellipsoid, eye: DVec3, point: DVec3) -> bool {
    let axes = DVec3::new(
        ellipsoid.semi_major_m,
        ellipsoid.semi_major_m,
        ellipsoid.semi_minor_m,
    ) + FLOOR_M;
    let (from, step) = (eye / axes, (point - eye) / axes);
    let (a, b, c) = (
        step.length_squared(),
        from.dot(step),
        from.length_squared() - 1.0,
    );
    let root = b * b - a * c;
    root > 0.0 && {
        let entry = (-b - root.sqrt()) / a;
        entry > 0.0 && entry < 1.0
    }
}

fn random_frustum(random: &mut Random, eye: DVec3, ellipsoid: &Ellipsoid) -> Frustum {
    let down = -ellipsoid.normal_below(eye);
    let forward = (down + random.direction() * random.between(0.0, 2.0)).normalize();
    let side = forward.cross(random.direction()).normalize();
    let above = side.cross(forward);
    let (width, height) = (random.between(0.05, 1.5), random.between(0.05, 1.5));
    let shift = random.between(-0.5, 0.5);
    let mut corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y): (f64, f64)| forward + side * (width * (x + shift)) + above * (height * y));
    if random.below(2) == 0 {
        corners.reverse();
    }
    Frustum::from_corners(eye, corners)
}

#[test]
fn no_visible_point_is_culled() {
    let mut random = Random(3);
    let mut visible_points = 0;
    for round in 0..120 {
        let ellipsoid = [Ellipsoid::EARTH, Ellipsoid::MOON, Ellipsoid::MARS][round % 3];
        let (latitude, longitude) = PLACES[round % PLACES.len()];
        let normal = (Ellipsoid::normal(latitude, longitude)
            + random.direction() * random.between(0.0, 0.3))
        .normalize();
        let eye = ellipsoid.point(normal, 9100.0 + 10.0_f64.powf(random.between(1.0, 7.6)));
        let lod = LodView {
            eye,
            pixels_per_radian: 600.0,
        };
        let limits = LodLimits {
            deepest_level: 12,
            ..LodLimits::default()
        };
        let selection = select(&ellipsoid, &lod, &limits, &earth_like);
        let frusta = [(); 2].map(|()| random_frustum(&mut random, eye, &ellipsoid));
        let horizon = Horizon::new(&ellipsoid, FLOOR_M, eye);
        let kept = cull(&ellipsoid, &selection, &frusta, &horizon, &earth_like);
        assert!(kept.is_sorted());
        let kept: HashSet<Tile> = kept.into_iter().collect();
        for leaf in selection
            .leaves()
            .iter()
            .filter(|leaf| !kept.contains(leaf))
        {
            let (lowest_m, highest_m) = earth_like(*leaf);
            for sample in 0..200 {
                // Corners and edges first, then anywhere.
                let pick = |random: &mut Random| match sample {
                    0..40 => random.below(2) as i64 * 256,
                    _ => random.below(257) as i64,
                };
                let (mut i, mut j) = (pick(&mut random), pick(&mut random));
                match sample {
                    40..70 => i = 0,
                    70..100 => j = 256,
                    _ => {}
                }
                let normal = LatticePoint::of_tile(*leaf, i, j).normal();
                let height_m = match random.below(3) {
                    0 => lowest_m,
                    1 => highest_m,
                    _ => random.between(lowest_m, highest_m),
                };
                let point = ellipsoid.point(normal, height_m);
                let in_view = frusta.iter().any(|frustum| frustum.contains(point));
                assert!(
                    !in_view || hidden_by_the_planet(&ellipsoid, eye, point),
                    "{leaf} was culled, but {i}, {j} at {height_m} m is visible"
                );
            }
        }
        visible_points += kept.len();
    }
    assert!(visible_points > 1000, "the views saw something");
}

#[test]
fn horizon_and_frustum_drop_most_of_the_planet() {
    let ellipsoid = Ellipsoid::EARTH;
    let everything = |eye: DVec3| {
        // Three pyramids of nearly a right angle and their opposites see all around.
        let mut frusta = Vec::new();
        for (a, b, c) in [
            (DVec3::X, DVec3::Y, DVec3::Z),
            (DVec3::Y, DVec3::Z, DVec3::X),
            (DVec3::Z, DVec3::X, DVec3::Y),
        ] {
            for axis in [a, -a] {
                frusta.push(Frustum::from_corners(
                    eye,
                    [axis + b + c, axis - b + c, axis - b - c, axis + b - c],
                ));
            }
        }
        frusta
    };
    for (latitude, longitude) in PLACES {
        let lod = view(&ellipsoid, latitude, longitude, 500_000.0);
        // Fine everywhere, to count area rather than what selection already made coarse.
        let limits = LodLimits {
            deepest_level: 5,
            tile_px: 1.0,
            most_tiles: 10_000,
        };
        let selection = select(&ellipsoid, &lod, &limits, &|_| (-500.0, 9000.0));
        assert_eq!(selection.leaves().len(), 6 * 1024);
        let horizon = Horizon::new(&ellipsoid, -500.0, lod.eye);
        let kept = cull(
            &ellipsoid,
            &selection,
            &everything(lod.eye),
            &horizon,
            &|_| (-500.0, 9000.0),
        );
        // The cap within the horizon is 3.6 % of the globe; mountains and whole tiles make it more.
        let share = kept.len() as f64 / selection.leaves().len() as f64;
        assert!(
            share > 0.036 && share < 0.12,
            "{share} at {latitude}, {longitude}"
        );

        let forward = -lod.eye.normalize();
        let (side, above) = forward.any_orthonormal_pair();
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y): (f64, f64)| forward + side * (0.3 * x) + above * (0.17 * y));
        let frusta = [Frustum::from_corners(lod.eye, corners)];
        let narrow = cull(&ellipsoid, &selection, &frusta, &horizon, &|_| {
            (-500.0, 9000.0)
        });
        assert!(
            !narrow.is_empty() && narrow.len() * 5 < kept.len(),
            "{} of {}",
            narrow.len(),
            kept.len()
        );
        assert!(narrow.iter().all(|tile| kept.contains(tile)));
    }
    assert!(
        cull(
            &ellipsoid,
            &select(
                &ellipsoid,
                &view(&ellipsoid, 0.0, 0.0, 1e6),
                &LodLimits::default(),
                &earth_like
            ),
            &[],
            &Horizon::new(&ellipsoid, FLOOR_M, DVec3::X * 1e7),
            &earth_like
        )
        .is_empty()
    );
}

#[test]
fn a_projection_matrix_makes_the_same_pyramid_as_its_corners() {
    let mut random = Random(4);
    for _ in 0..100 {
        let eye = random.direction() * 7e6;
        let back = random.direction();
        let right = back.cross(random.direction()).normalize();
        let up = back.cross(right);
        let (left, width) = (random.between(-1.0, 0.2), random.between(0.2, 1.5));
        let (bottom, height) = (random.between(-1.0, 0.2), random.between(0.2, 1.5));
        // Off-axis, reversed depth, infinite far plane.
        let near = 0.1;
        let projection = DMat4::from_cols(
            DVec4::new(2.0 / width, 0.0, 0.0, 0.0),
            DVec4::new(0.0, 2.0 / height, 0.0, 0.0),
            DVec4::new(
                (2.0 * left + width) / width,
                (2.0 * bottom + height) / height,
                0.0,
                -1.0,
            ),
            DVec4::new(0.0, 0.0, near, 0.0),
        );
        let rotation = DMat4::from_cols(
            right.extend(0.0),
            up.extend(0.0),
            back.extend(0.0),
            DVec4::W,
        )
        .transpose();
        let by_matrix = Frustum::from_view_projection(eye, &(projection * rotation));
        let corner =
            |x: f64, y: f64| right * (left + x * width) + up * (bottom + y * height) - back;
        let by_corners = Frustum::from_corners(
            eye,
            [
                corner(0.0, 0.0),
                corner(1.0, 0.0),
                corner(1.0, 1.0),
                corner(0.0, 1.0),
            ],
        );
        let (mut inside, mut outside) = (0, 0);
        for _ in 0..200 {
            let (x, y) = (random.between(-0.5, 1.5), random.between(-0.5, 1.5));
            let near_the_side = [x, y]
                .iter()
                .any(|c| c.abs() < 1e-6 || (c - 1.0).abs() < 1e-6);
            let sign = if random.below(8) == 0 { -1.0 } else { 1.0 };
            let point = eye + corner(x, y) * (sign * random.between(1.0, 1e6));
            let expected = sign > 0.0 && x > 0.0 && x < 1.0 && y > 0.0 && y < 1.0;
            if !near_the_side {
                assert_eq!(by_matrix.contains(point), expected);
                assert_eq!(by_corners.contains(point), expected);
            }
            if expected { inside += 1 } else { outside += 1 }
        }
        assert!(inside > 10 && outside > 10);
        assert_eq!(by_matrix.eye(), by_corners.eye());
    }
}
