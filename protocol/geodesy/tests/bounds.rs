//! Hulls, balls and horizons are conservative: they hold every point of a tile, and hide none that is visible.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use geodesy::{Ball, CELLS, Ellipsoid, Horizon, LatticePoint, Tile, TileHull};
use glam::DVec3;
use proptest::prelude::*;

fn any_ellipsoid() -> impl Strategy<Value = Ellipsoid> {
    prop_oneof![
        Just(Ellipsoid::EARTH),
        Just(Ellipsoid::MOON),
        Just(Ellipsoid::MARS),
        (0.55_f64..1.8).prop_map(|ratio| Ellipsoid::new(1e6, ratio * 1e6).unwrap()),
    ]
}

fn any_tile() -> impl Strategy<Value = Tile> {
    (0..6_u8, 0..=22_u8, any::<u32>(), any::<u32>()).prop_map(|(face, level, x, y)| {
        let last = (1_u64 << level) as u32 - 1;
        Tile::new(face, level, x & last, y & last).unwrap()
    })
}

/// Lattice nodes, corners and edges often.
fn any_node() -> impl Strategy<Value = (i64, i64)> {
    let along =
        || prop_oneof![1 => Just(0), 1 => Just(CELLS), 1 => Just(CELLS / 2), 5 => 0..=CELLS];
    (along(), along())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(8000) })]

    #[test]
    fn hull_and_ball_hold_the_tile(
        ellipsoid in any_ellipsoid(),
        tile in any_tile(),
        (i, j) in any_node(),
        lowest_m in -12_000.0_f64..9000.0,
        thickness_m in prop_oneof![Just(0.0), 0.0_f64..20_000.0],
        share in prop_oneof![Just(0.0), Just(1.0), 0.0_f64..=1.0],
        (x, y, z) in (-1.0_f64..1.0, -1.0_f64..1.0, -1.0_f64..1.0),
    ) {
        let highest_m = lowest_m + thickness_m;
        let hull = TileHull::new(&ellipsoid, tile, lowest_m, highest_m);
        let normal = LatticePoint::of_tile(tile, i, j).normal();
        let point = ellipsoid.point(normal, lowest_m + share * thickness_m);
        prop_assert!(point.distance(hull.ball.centre) <= hull.ball.radius_m, "outside the ball");

        // A point is in a convex hull if no plane parts it from all corners. Planes at random, and those that
        // are likeliest to: upright ones along the sides, and level ones.
        let middle = LatticePoint::of_tile(tile, CELLS / 2, CELLS / 2).normal();
        let node = |i, j| LatticePoint::of_tile(tile, i, j).normal();
        let corners = [node(0, 0), node(CELLS, 0), node(CELLS, CELLS), node(0, CELLS)];
        let mut planes = vec![DVec3::new(x, y, z), middle, -middle, normal, -normal];
        for n in 0..4 {
            let upright = corners[n].cross(corners[(n + 1) % 4]).normalize();
            let feet = ellipsoid.point(corners[(n + 1) % 4], lowest_m) - ellipsoid.point(corners[n], lowest_m);
            let along = normal.cross(feet).normalize_or_zero();
            planes.extend([upright, -upright, along, -along, upright + 0.01 * DVec3::new(x, y, z)]);
        }
        for plane in planes {
            let Some(plane) = plane.try_normalize() else { continue };
            let reach = hull.corners.iter().map(|c| c.dot(plane)).fold(f64::NEG_INFINITY, f64::max);
            prop_assert!(
                point.dot(plane) <= reach + 1e-9,
                "{} m beyond the hull of {tile} along {plane}", point.dot(plane) - reach
            );
        }
    }

    #[test]
    fn hulls_are_not_wasteful(ellipsoid in any_ellipsoid(), tile in any_tile()) {
        let size = ellipsoid.semi_major_m / f64::from(1_u32 << tile.level());
        let hull = TileHull::new(&ellipsoid, tile, 0.0, 0.0);
        let near_sphere = (ellipsoid.semi_minor_m / ellipsoid.semi_major_m - 1.0).abs() < 0.01;
        if near_sphere {
            prop_assert!(hull.ball.radius_m < 1.3 * size + 1e-3);
            let spread = hull.corners.iter().map(|c| c.distance(hull.ball.centre)).fold(0.0, f64::max);
            prop_assert!(spread < 2.5 * size + 1e-3, "{spread} for a tile of {size}");
        }
    }

    #[test]
    fn the_horizon_hides_nothing_visible(
        ellipsoid in any_ellipsoid(),
        (x, y, z) in (-1.0_f64..1.0, -1.0_f64..1.0, -1.0_f64..1.0),
        (p, q, r) in (-1.0_f64..1.0, -1.0_f64..1.0, -1.0_f64..1.0),
        altitude_log in 0.0_f64..7.8,
        floor_m in -11_000.0_f64..0.0,
        height_m in -11_000.0_f64..9000.0,
        radius_log in 0.0_f64..6.0,
    ) {
        let (Some(over), Some(under)) = (DVec3::new(x, y, z).try_normalize(), DVec3::new(p, q, r).try_normalize()) else {
            return Ok(());
        };
        let viewer = ellipsoid.point(over, 10.0_f64.powf(altitude_log));
        let horizon = Horizon::new(&ellipsoid, floor_m, viewer);
        prop_assert_eq!(horizon.viewer(), viewer);
        let ball = Ball { centre: ellipsoid.point(under, height_m.max(floor_m)), radius_m: 10.0_f64.powf(radius_log) };
        if !horizon.hides(&ball) {
            return Ok(());
        }
        let away = (ball.centre - viewer).normalize();
        let (side, above) = away.any_orthonormal_pair();
        for direction in [DVec3::ZERO, side, -side, above, -above, under, side + above, above - side] {
            let target = ball.centre + direction.normalize_or_zero() * ball.radius_m;
            let lowest_m = lowest_height_m(&ellipsoid, viewer, target);
            prop_assert!(lowest_m <= floor_m + 1e-3, "the ray passes {} m above the floor", lowest_m - floor_m);
        }
    }

    #[test]
    fn the_highest_hidden_point_is_below_the_horizon_but_close_to_it(
        ellipsoid in any_ellipsoid(),
        latitude_deg in -90.0_f64..90.0,
        azimuth_deg in 0.0_f64..360.0,
        altitude_log in 2.0_f64..7.0,
        floor_m in -11_000.0_f64..0.0,
        share in 1.05_f64..1.5,
    ) {
        let over = Ellipsoid::normal(latitude_deg, 0.0);
        let viewer = ellipsoid.point(over, 10.0_f64.powf(altitude_log));
        let horizon = Horizon::new(&ellipsoid, floor_m, viewer);
        // A place a little beyond the horizon of a sphere.
        let dip = (ellipsoid.smallest_radius_m() / viewer.length()).acos().max(0.02) * share;
        let [east, north, up] = Ellipsoid::east_north_up(over);
        let heading = east * azimuth_deg.to_radians().sin() + north * azimuth_deg.to_radians().cos();
        let place = up * dip.cos() + heading * dip.sin();
        let hidden = |height_m: f64| {
            horizon.hides(&Ball { centre: ellipsoid.point(place, height_m), radius_m: 0.01 })
        };
        let (mut low, mut high) = (floor_m, floor_m + 1e7);
        if !hidden(low) || hidden(high) {
            return Ok(());
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if hidden(middle) { low = middle } else { high = middle }
        }
        let lowest_m = lowest_height_m(&ellipsoid, viewer, ellipsoid.point(place, low));
        prop_assert!(lowest_m <= floor_m + 1e-4, "the ray passes {} m above the floor", lowest_m - floor_m);
        let flattening = 1.0 - ellipsoid.smallest_radius_m() / ellipsoid.largest_radius_m();
        let given_away = 2.0 + floor_m.abs() * 4.0 * flattening * flattening;
        prop_assert!(lowest_m >= floor_m - given_away, "{} m were given away", floor_m - lowest_m);
    }
}

/// The lowest geodetic height on a segment: sampled, then narrowed, without the horizon's scaled space.
fn lowest_height_m(ellipsoid: &Ellipsoid, from: DVec3, to: DVec3) -> f64 {
    let height = |t: f64| ellipsoid.to_geodetic(from.lerp(to, t)).height_m;
    let mut best = (0.0, f64::INFINITY);
    for step in 0..=64 {
        let t = f64::from(step) / 64.0;
        if height(t) < best.1 {
            best = (t, height(t));
        }
    }
    let (mut low, mut high) = (
        (best.0 - 1.0 / 64.0).max(0.0),
        (best.0 + 1.0 / 64.0).min(1.0),
    );
    for _ in 0..60 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if height(a) < height(b) {
            high = b;
        } else {
            low = a;
        }
    }
    height(0.5 * (low + high)).min(best.1)
}

#[test]
fn the_horizon_hides_what_is_well_beyond_it() {
    for ellipsoid in [Ellipsoid::EARTH, Ellipsoid::MOON, Ellipsoid::MARS] {
        for (height_m, floor_m) in [(500.0, -400.0), (500_000.0, -11_000.0), (4e7, 0.0)] {
            let viewer = ellipsoid.point(Ellipsoid::normal(20.0, 30.0), height_m);
            let horizon = Horizon::new(&ellipsoid, floor_m, viewer);
            let ball_at = |latitude, longitude| Ball {
                centre: ellipsoid.point(Ellipsoid::normal(latitude, longitude), 0.0),
                radius_m: 1000.0,
            };
            assert!(!horizon.hides(&ball_at(20.0, 30.0)), "below the viewer");
            assert!(horizon.hides(&ball_at(-20.0, -150.0)), "on the far side");
            // A third of the way around is beyond any horizon.
            assert!(horizon.hides(&ball_at(20.0, 30.0 + 125.0)));
        }
        // Inside the body nothing is known to be hidden.
        let inside = Horizon::new(&ellipsoid, 0.0, ellipsoid.point(DVec3::X, -100.0));
        assert!(!inside.hides(&Ball {
            centre: -DVec3::X * 1e7,
            radius_m: 1.0
        }));
    }
}
