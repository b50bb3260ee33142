//! Circles against what is written without them: Vincenty's geodesics, every node of a tile, exact distances.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::time::Instant;

use geodesy::{
    CELLS, Circle, CircleError, Ellipsoid, LatticePoint, MAX_CIRCLE_RADIUS_M, Relation, Tile,
    TilePosition, st_to_uv,
};
use glam::DVec3;
use proptest::prelude::*;

const PLANETS: [Ellipsoid; 3] = [Ellipsoid::EARTH, Ellipsoid::MOON, Ellipsoid::MARS];

fn any_planet() -> impl Strategy<Value = Ellipsoid> {
    (0..3_usize).prop_map(|n| PLANETS[n])
}

/// Tiles of all levels, as often as not in a corner, on an edge or in the middle (the poles, too) of a face.
fn any_tile() -> impl Strategy<Value = Tile> {
    (
        0..6_u8,
        0..=22_u8,
        any::<u32>(),
        any::<u32>(),
        0..6_u8,
        0..6_u8,
    )
        .prop_map(|(face, level, x, y, place_x, place_y)| {
            let last = (1_u64 << level) as u32 - 1;
            let along = |c: u32, place: u8| match place {
                0 => 0,
                1 => last,
                2 => last / 2 + u32::from(c & 1 == 1 && level > 0),
                _ => c & last,
            };
            Tile::new(face, level, along(x, place_x), along(y, place_y)).unwrap()
        })
}

/// The length of a node's step on the ground in metres, about.
fn sample_m(ellipsoid: &Ellipsoid, tile: Tile) -> f64 {
    1.57 * ellipsoid.semi_major_m / (CELLS << tile.level()) as f64
}

/// A circle whose rim passes by a place of the tile given in shares of its side, at about `beside_m`.
fn circle_by(
    ellipsoid: &Ellipsoid,
    tile: Tile,
    (share_x, share_y): (f64, f64),
    azimuth: f64,
    radius_log: f64,
    beside_m: f64,
) -> (Circle, DVec3, f64) {
    let place = normal_at(tile, 256.0 * share_x, 256.0 * share_y);
    let smallest_m = 0.1 * sample_m(ellipsoid, tile);
    let largest_m = MAX_CIRCLE_RADIUS_M.min(0.99 * std::f64::consts::PI * ellipsoid.semi_minor_m);
    let radius_m = smallest_m * (largest_m / smallest_m).powf(radius_log);
    let [east, north, _] = Ellipsoid::east_north_up(place);
    let away = east * azimuth.sin() + north * azimuth.cos();
    let angle = (radius_m + beside_m) / ellipsoid.semi_major_m;
    let (latitude, longitude) = Ellipsoid::angles_deg(place * angle.cos() + away * angle.sin());
    let circle = Circle::new(ellipsoid, latitude, longitude, radius_m).unwrap();
    (circle, Ellipsoid::normal(latitude, longitude), radius_m)
}

/// The normal at any place of a tile's own face, without the lattice.
fn normal_at(tile: Tile, i: f64, j: f64) -> DVec3 {
    TilePosition { tile, i, j }.normal()
}

/// Length of the chord over an arc on the sphere of the Gaussian mean radius.
fn chord_m(ellipsoid: &Ellipsoid, centre: DVec3, radius_m: f64) -> f64 {
    let e2 = 1.0 - (ellipsoid.semi_minor_m / ellipsoid.semi_major_m).powi(2);
    let w = (1.0 - e2 * centre.z * centre.z).sqrt();
    let meridian_m = ellipsoid.semi_major_m * (1.0 - e2) / w.powi(3);
    let mean_m = (meridian_m * ellipsoid.semi_major_m / w).sqrt();
    2.0 * mean_m * (0.5 * radius_m / mean_m).sin()
}

/// T. Vincenty, "Direct and inverse solutions of geodesics on the ellipsoid", Survey Review 23 (176), 1975.
fn vincenty_m(ellipsoid: &Ellipsoid, from: DVec3, to: DVec3) -> f64 {
    let (a, b) = (ellipsoid.semi_major_m, ellipsoid.semi_minor_m);
    let f = 1.0 - b / a;
    let reduced = |n: DVec3| ((1.0 - f) * n.z).atan2(n.x.hypot(n.y)).sin_cos();
    let ((sin_u1, cos_u1), (sin_u2, cos_u2)) = (reduced(from), reduced(to));
    // The difference of longitudes without that of two large numbers.
    let l = (from.x * to.y - from.y * to.x).atan2(from.x * to.x + from.y * to.y);
    let mut lambda = l;
    for _ in 0..200 {
        let (sin_lambda, cos_lambda) = lambda.sin_cos();
        let sin_sigma = (cos_u2 * sin_lambda).hypot(cos_u1 * sin_u2 - sin_u1 * cos_u2 * cos_lambda);
        if sin_sigma == 0.0 {
            return 0.0;
        }
        let cos_sigma = sin_u1 * sin_u2 + cos_u1 * cos_u2 * cos_lambda;
        let sigma = sin_sigma.atan2(cos_sigma);
        let sin_alpha = cos_u1 * cos_u2 * sin_lambda / sin_sigma;
        let cos2_alpha = 1.0 - sin_alpha * sin_alpha;
        let cos_2m = if cos2_alpha > 1e-15 {
            cos_sigma - 2.0 * sin_u1 * sin_u2 / cos2_alpha
        } else {
            0.0
        };
        let c = f / 16.0 * cos2_alpha * (4.0 + f * (4.0 - 3.0 * cos2_alpha));
        let inner = cos_2m + c * cos_sigma * (2.0 * cos_2m * cos_2m - 1.0);
        let next = l + (1.0 - c) * f * sin_alpha * (sigma + c * sin_sigma * inner);
        if (next - lambda).abs() < 1e-15 {
            let u2 = cos2_alpha * (a * a - b * b) / (b * b);
            let big_a = 1.0 + u2 / 16384.0 * (4096.0 + u2 * (-768.0 + u2 * (320.0 - 175.0 * u2)));
            let big_b = u2 / 1024.0 * (256.0 + u2 * (-128.0 + u2 * (74.0 - 47.0 * u2)));
            let cube = big_b / 6.0
                * cos_2m
                * (4.0 * sin_sigma * sin_sigma - 3.0)
                * (4.0 * cos_2m * cos_2m - 3.0);
            let square = cos_sigma * (2.0 * cos_2m * cos_2m - 1.0);
            let less = big_b * sin_sigma * (cos_2m + big_b / 4.0 * (square - cube));
            return b * big_a * (sigma - less);
        }
        lambda = next;
    }
    panic!("no geodesic from {from} to {to}");
}

#[test]
fn vincenty_is_what_others_print() {
    // Flinders Peak to Buninyong, the Geocentric Datum of Australia Technical Manual: 54,972.271 m on GRS80.
    let grs80 = Ellipsoid::new(6_378_137.0, 6_378_137.0 * (1.0 - 1.0 / 298.257_222_101)).unwrap();
    let degrees = |d: f64, m: f64, s: f64| d.signum() * (d.abs() + m / 60.0 + s / 3600.0);
    let from = Ellipsoid::normal(
        degrees(-37.0, 57.0, 3.720_30),
        degrees(144.0, 25.0, 29.524_40),
    );
    let to = Ellipsoid::normal(
        degrees(-37.0, 39.0, 10.156_10),
        degrees(143.0, 55.0, 35.383_90),
    );
    assert!((vincenty_m(&grs80, from, to) - 54_972.271).abs() < 1e-3);
}

/// What a rim's distance along a geodesic may differ from the radius.
fn rim_bound_m(ellipsoid: &Ellipsoid, radius_m: f64) -> f64 {
    let f = 1.0 - ellipsoid.semi_minor_m / ellipsoid.semi_major_m;
    radius_m * f * (radius_m / ellipsoid.semi_major_m).powi(2) + 1e-7 + 1e-10 * radius_m
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(3000) })]

    #[test]
    fn the_rim_is_near_the_geodesic_circle(
        ellipsoid in any_planet(),
        (latitude_deg, longitude_deg) in (
            prop_oneof![Just(90.0), Just(-90.0), Just(0.0), -90.0_f64..90.0],
            prop_oneof![Just(180.0), Just(-45.0), -180.0_f64..180.0],
        ),
        radius_log in -2.0_f64..6.698_97,
        azimuth in 0.0_f64..6.3,
    ) {
        let radius_m = 10.0_f64.powf(radius_log).min(0.7 * std::f64::consts::PI * ellipsoid.semi_minor_m);
        let circle = Circle::new(&ellipsoid, latitude_deg, longitude_deg, radius_m).unwrap();
        let centre = Ellipsoid::normal(latitude_deg, longitude_deg);
        prop_assert!(circle.contains(centre));
        let [east, north, _] = Ellipsoid::east_north_up(centre);
        let away = east * azimuth.sin() + north * azimuth.cos();
        let along = |angle: f64| (centre * angle.cos() + away * angle.sin()).normalize();
        let (mut inside, mut outside) = (0.0, 1.2 * radius_m / ellipsoid.semi_minor_m);
        prop_assert!(!circle.contains(along(outside)));
        for _ in 0..80 {
            let middle = 0.5 * (inside + outside);
            if circle.contains(along(middle)) { inside = middle } else { outside = middle }
        }
        let distance_m = vincenty_m(&ellipsoid, centre, along(inside));
        let bound_m = rim_bound_m(&ellipsoid, radius_m);
        prop_assert!((distance_m - radius_m).abs() <= bound_m, "{distance_m} of {radius_m}, within {bound_m}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1500) })]

    #[test]
    fn the_relation_is_never_wrong(
        ellipsoid in any_planet(),
        tile in any_tile(),
        share in (-0.1_f64..1.1, -0.1_f64..1.1),
        azimuth in 0.0_f64..6.3,
        radius_log in 0.0_f64..1.0,
        beside in prop_oneof![Just(0.0), -3.0_f64..3.0, -40.0_f64..40.0, -700.0_f64..700.0],
    ) {
        let sample_m = sample_m(&ellipsoid, tile);
        let (circle, centre, radius_m) =
            circle_by(&ellipsoid, tile, share, azimuth, radius_log, beside * sample_m);
        let (latitude, longitude) = Ellipsoid::angles_deg(centre);
        let other = |radius_m: f64| Circle::new(&ellipsoid, latitude, longitude, radius_m).ok();
        // How far beside the tile a rim may pass and still count as touching it.
        let (larger, smaller) = (other(radius_m + 20.0 * sample_m), other(radius_m - 20.0 * sample_m));
        let (mut all, mut none, mut all_of_smaller, mut none_of_larger) = (true, true, true, true);
        for j in -1..=CELLS + 1 {
            for i in -1..=CELLS + 1 {
                let normal = LatticePoint::of_tile(tile, i, j).normal();
                let inside = circle.contains(normal);
                all &= inside;
                none &= !inside;
                all_of_smaller &= smaller.is_some_and(|c| c.contains(normal));
                none_of_larger &= larger.is_some_and(|c| !c.contains(normal));
            }
        }
        let relation = circle.relation(tile);
        match relation {
            Relation::Inside => prop_assert!(all),
            Relation::Outside => prop_assert!(none),
            // Beyond, straight-line distance hardly grows along the ground, and more tiles are left open.
            Relation::Border => prop_assert!(
                radius_m > 1.8 * ellipsoid.semi_minor_m
                    || !all_of_smaller && !none_of_larger,
                "border is said of {tile} far from the rim"
            ),
        }
    }
}

/// The farthest point of a tile, in samples from the rim, that the polynomial puts on the wrong side. Points of the
/// lattice moved by (di, dj), the border of one node included where it lies on the tile's own face.
fn worst_samples(
    ellipsoid: &Ellipsoid,
    tile: Tile,
    (circle, centre, radius_m): (Circle, DVec3, f64),
    (di, dj): (f64, f64),
    value: &dyn Fn(f64, f64) -> f64,
) -> f64 {
    let centre_point = ellipsoid.point(centre, 0.0);
    let chord_m = chord_m(ellipsoid, centre, radius_m);
    let tiles = f64::from(1_u32 << tile.level());
    let cube = |c: u32, n: f64| {
        let s = (f64::from(c) + n / CELLS as f64) / tiles;
        (0.0..=1.0).contains(&s).then(|| st_to_uv(s))
    };
    let point = |u: f64, v: f64| ellipsoid.point(tile.face().cube_point(u, v).normalize(), 0.0);
    let mut worst = 0.0_f64;
    for row in -1..=CELLS + 1 {
        let j = (row as f64 + dj).min(257.0);
        let Some(v) = cube(tile.y(), j) else { continue };
        for column in -1..=CELLS + 1 {
            let i = (column as f64 + di).min(257.0);
            let Some(u) = cube(tile.x(), i) else { continue };
            let inside = value((i - 128.0) / 137.0, (j - 128.0) / 137.0) <= 0.0;
            let here = point(u, v);
            let distance_m = here.distance(centre_point);
            if inside == (distance_m <= chord_m) {
                continue;
            }
            let step = |i: f64, j: f64| {
                point(cube(tile.x(), i).unwrap(), cube(tile.y(), j).unwrap()).distance(here)
            };
            let towards = |n: f64| if n < 128.0 { n + 1.0 } else { n - 1.0 };
            let sample_m = step(towards(i), j).min(step(i, towards(j)));
            worst = worst.max((distance_m - chord_m).abs() / sample_m);
        }
    }
    assert!(worst == 0.0 || circle.relation(tile) == Relation::Border);
    worst
}

/// The polynomial as a GPU evaluates it.
fn in_f32(degree: usize, coefficients: &[f64]) -> impl Fn(f64, f64) -> f64 {
    let coefficients: Vec<f32> = coefficients.iter().map(|c| *c as f32).collect();
    move |x, y| {
        let (x, y) = (x as f32, y as f32);
        let along = |row: &[f32]| row.iter().rev().fold(0.0_f32, |sum, c| sum * x + c);
        let rows = coefficients.chunks(degree + 1).rev();
        f64::from(rows.fold(0.0_f32, |sum, row| sum * y + along(row)))
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(600) })]

    #[test]
    fn the_polynomial_has_the_rim_where_it_is(
        ellipsoid in any_planet(),
        tile in prop_oneof![3 => any_tile(), 1 => any_tile().prop_map(|tile| tile.ancestor(tile.level() % 4))],
        share in (0.0_f64..1.0, 0.0_f64..1.0),
        azimuth in 0.0_f64..6.3,
        radius_log in 0.0_f64..1.0,
        offset in (0.0_f64..1.0, 0.0_f64..1.0),
    ) {
        let circle = circle_by(&ellipsoid, tile, share, azimuth, radius_log, 0.0);
        let polynomial = circle.0.polynomial(tile);
        prop_assert!((1..=8).contains(&polynomial.degree));
        prop_assert_eq!(polynomial.coefficients.len(), (polynomial.degree + 1).pow(2));
        prop_assert!(tile.level() < 5 || polynomial.degree == 4);
        let bound = if tile.level() == 0 { 0.25 } else { 0.1 };
        let worst = worst_samples(&ellipsoid, tile, circle, offset, &|x, y| polynomial.at(x, y));
        let on_gpu = in_f32(polynomial.degree, &polynomial.coefficients);
        let worst_f32 = worst_samples(&ellipsoid, tile, circle, offset, &on_gpu);
        prop_assert!(worst <= bound, "{worst} samples");
        prop_assert!(worst_f32 <= bound, "{worst_f32} samples in f32");
    }
}

#[test]
fn circles_that_are_none_are_refused() {
    let earth = Ellipsoid::EARTH;
    for radius_m in [0.0, -1.0, f64::NAN, f64::INFINITY, 5_000_000.1] {
        let error = Circle::new(&earth, 10.0, 20.0, radius_m).unwrap_err();
        assert!(matches!(error, CircleError::BadRadius(_)), "{error}");
    }
    for (latitude, longitude) in [(90.1, 0.0), (f64::NAN, 0.0), (0.0, -180.1), (0.0, f64::NAN)] {
        let error = Circle::new(&earth, latitude, longitude, 1.0).unwrap_err();
        assert!(matches!(error, CircleError::BadCentre { .. }), "{error}");
    }
    assert!(Circle::new(&earth, -90.0, 180.0, MAX_CIRCLE_RADIUS_M).is_ok());
}

#[test]
fn a_circle_may_hold_a_small_planet_whole() {
    let rock = Ellipsoid::new(900.0, 700.0).unwrap();
    let circle = Circle::new(&rock, 30.0, 40.0, 3000.0).unwrap();
    assert!(circle.contains(-Ellipsoid::normal(30.0, 40.0)));
    for root in Tile::ROOTS {
        assert_eq!(circle.relation(root), Relation::Inside);
        let polynomial = circle.polynomial(root);
        assert!(polynomial.at(0.0, 0.0) < 0.0 && polynomial.at(-1.0, 1.0) < 0.0);
    }
}

#[test]
fn a_circle_is_inside_only_where_it_is() {
    let circle = Circle::new(&Ellipsoid::EARTH, 46.5, 8.0, 100_000.0).unwrap();
    let centre = Ellipsoid::normal(46.5, 8.0);
    for level in 0..=22 {
        let within = TilePosition::of_normal(centre, level).tile;
        // Tiles are a little less than 10,000 km / 2^level wide.
        let expected = if level < 7 {
            Relation::Border
        } else {
            Relation::Inside
        };
        if !(7..=8).contains(&level) {
            assert_eq!(circle.relation(within), expected, "{within}");
        }
        let opposite = TilePosition::of_normal(-centre, level).tile;
        assert_eq!(circle.relation(opposite), Relation::Outside);
    }
}

#[test]
#[ignore = "measures time"]
fn times() {
    let circle = Circle::new(&Ellipsoid::EARTH, 46.5, 8.0, 300_000.0).unwrap();
    let centre = Ellipsoid::normal(47.5, 8.5);
    for level in [0, 1, 2, 3, 4, 8] {
        let tile = TilePosition::of_normal(centre, level).tile;
        let fastest_us = |work: &dyn Fn()| {
            let once = |_| {
                let start = Instant::now();
                work();
                start.elapsed().as_secs_f64() * 1e6
            };
            (0..200).map(once).fold(f64::INFINITY, f64::min)
        };
        let polynomial_us = fastest_us(&|| {
            assert!(std::hint::black_box(circle.polynomial(tile)).degree > 0);
        });
        let relation_us = fastest_us(&|| {
            std::hint::black_box(circle.relation(std::hint::black_box(tile)));
        });
        eprintln!("level {level}: polynomial {polynomial_us:.1} us, relation {relation_us:.2} us");
    }
}
