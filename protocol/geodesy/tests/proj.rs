//! Geodetic to geocentric coordinates and back, held against PROJ's numbers.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use geodesy::{Ellipsoid, Geodetic};
use glam::DVec3;
use proptest::prelude::*;

fn rows() -> Vec<(Ellipsoid, Geodetic, DVec3)> {
    let rows = include_str!("proj_cart.csv")
        .lines()
        .filter(|line| !line.starts_with('#'));
    rows.map(|line| {
        let (body, numbers) = line.split_once(',').unwrap();
        let numbers: Vec<f64> = numbers.split(',').map(|n| n.parse().unwrap()).collect();
        let [latitude_deg, longitude_deg, height_m, x, y, z] = numbers[..] else {
            panic!("{line}")
        };
        let geodetic = Geodetic {
            latitude_deg,
            longitude_deg,
            height_m,
        };
        (
            Ellipsoid::by_name(body).unwrap(),
            geodetic,
            DVec3::new(x, y, z),
        )
    })
    .collect()
}

/// 1e-8 m near the planet, and the rounding of f64 far from it.
fn tolerance_m(position: DVec3) -> f64 {
    1e-8_f64.max(position.length() * 1e-15)
}

fn angle_between_deg(a: f64, b: f64) -> f64 {
    ((a - b + 540.0).rem_euclid(360.0) - 180.0).abs()
}

#[test]
fn to_ecef_agrees_with_proj() {
    assert_eq!(rows().len(), 210);
    for (ellipsoid, geodetic, expected) in rows() {
        let found = ellipsoid.to_ecef(geodetic);
        assert!(
            found.distance(expected) <= tolerance_m(expected),
            "{geodetic:?}: {found}, not {expected}"
        );
    }
}

#[test]
fn to_geodetic_undoes_proj() {
    for (ellipsoid, expected, position) in rows() {
        let found = ellipsoid.to_geodetic(position);
        assert!(
            (found.latitude_deg - expected.latitude_deg).abs() <= 1e-12,
            "{found:?}, not {expected:?}"
        );
        assert!(
            (found.height_m - expected.height_m).abs() <= tolerance_m(position),
            "{found:?}, not {expected:?}"
        );
        // The distance that an error in longitude means; at a pole any longitude is right.
        let off_deg = angle_between_deg(found.longitude_deg, expected.longitude_deg);
        assert!(
            off_deg * expected.latitude_deg.to_radians().cos() <= 1e-12,
            "{found:?}, not {expected:?}"
        );
    }
}

#[test]
fn poles_equator_axis_and_centre_have_answers() {
    for ellipsoid in [Ellipsoid::EARTH, Ellipsoid::MOON, Ellipsoid::MARS] {
        let (a, b) = (ellipsoid.semi_major_m, ellipsoid.semi_minor_m);
        for height_m in [-100_000.0, -1.0, 0.0, 1.0, 1e7] {
            let pole = ellipsoid.to_geodetic(DVec3::new(0.0, 0.0, -b - height_m));
            assert_eq!((pole.latitude_deg, pole.longitude_deg), (-90.0, 0.0));
            assert!((pole.height_m - height_m).abs() < 1e-8);
            let equator = ellipsoid.to_geodetic(DVec3::new(0.0, a + height_m, 0.0));
            assert_eq!((equator.latitude_deg, equator.longitude_deg), (0.0, 90.0));
            assert!((equator.height_m - height_m).abs() < 1e-8);
        }
        let centre = ellipsoid.to_geodetic(DVec3::ZERO);
        assert!((centre.height_m + b).abs() < 1e-8 && centre.latitude_deg == 90.0);
        for tiny in [
            DVec3::X,
            DVec3::Z,
            DVec3::new(1e-300, 0.0, 1e-300),
            DVec3::new(1e3, 1e3, 0.0),
        ] {
            let near_centre = ellipsoid.to_geodetic(tiny);
            assert!(
                near_centre.height_m.is_finite() && near_centre.height_m < -b * 0.99,
                "{near_centre:?}"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(4000) })]

    #[test]
    fn round_trip_on_any_ellipsoid(
        a in 1e5_f64..1e8,
        flattening in -0.3_f64..0.3,
        latitude_deg in -90.0_f64..=90.0,
        longitude_deg in -180.0_f64..180.0,
        // Down to a little above the evolute, where normals begin to cross.
        share in -0.3_f64..10.0,
    ) {
        let ellipsoid = Ellipsoid::new(a, a * (1.0 - flattening)).unwrap();
        let height_m = share * a * if share < 0.0 { 1.0 - 2.0 * flattening.abs() } else { 1.0 };
        let position = ellipsoid.to_ecef(Geodetic { latitude_deg, longitude_deg, height_m });
        let found = ellipsoid.to_geodetic(position);
        let back = ellipsoid.to_ecef(found);
        prop_assert!(back.distance(position) <= 4e-15 * (a + position.length()), "{found:?}");
        prop_assert!((found.height_m - height_m).abs() <= 4e-15 * (a + position.length()), "{found:?}");
        prop_assert!((found.latitude_deg - latitude_deg).abs() <= 1e-11, "{found:?}");
    }

    #[test]
    fn frames_are_right_handed_and_point_the_way_they_say(
        latitude_deg in -90.0_f64..=90.0,
        longitude_deg in -180.0_f64..180.0,
    ) {
        let [east, north, up] = Ellipsoid::east_north_up(Ellipsoid::normal(latitude_deg, longitude_deg));
        prop_assert!(east.cross(north).distance(up) < 1e-12);
        prop_assert!((east.length() - 1.0).abs() < 1e-12 && (north.length() - 1.0).abs() < 1e-12);
        let step = 1e-6;
        let further = Ellipsoid::normal((latitude_deg + step).min(90.0), longitude_deg);
        if latitude_deg < 89.999 {
            prop_assert!((further - up).dot(north) > 0.0);
            let eastwards = Ellipsoid::normal(latitude_deg, longitude_deg + step);
            prop_assert!(latitude_deg < -89.999 || (eastwards - up).dot(east) > 0.0);
        }
        let (latitude, longitude) = Ellipsoid::angles_deg(up);
        prop_assert!((latitude - latitude_deg).abs() < 1e-12);
        prop_assert!(angle_between_deg(longitude, longitude_deg) * latitude_deg.to_radians().cos() < 1e-12);
    }
}
