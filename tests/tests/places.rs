//! Places are where geodesy says: the whole way from a source picture to the wall, against an independent reckoning.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use geodesy::{Ellipsoid, Geodetic};
use glam::DVec3;
use tests::{command, data, pictures};

/// Pixels of each of the two nodes' outputs.
const SIZE: (u32, u32) = (240, 360);
/// The camera of [`data::scene`]: straight down, north up.
const EYE: Geodetic = Geodetic {
    latitude_deg: 10.0,
    longitude_deg: 15.0,
    height_m: 12e6,
};

/// Where a geodetic position appears on the wall of [`data::wall`], in pixels from the upper left.
fn project(position: Geodetic) -> (f64, f64) {
    let earth = Ellipsoid::EARTH;
    let up = Ellipsoid::normal(EYE.latitude_deg, EYE.longitude_deg);
    let east = DVec3::Z.cross(up).normalize();
    let north = up.cross(east);
    let ray = earth.to_ecef(position) - earth.to_ecef(EYE);
    // The screen is 1.1 of its height away from the head, which is before its middle.
    let depth = -ray.dot(up);
    let height = f64::from(SIZE.1);
    let scale = 1.1 * height / depth;
    (
        f64::from(SIZE.0) + ray.dot(east) * scale,
        height / 2.0 - ray.dot(north) * scale,
    )
}

/// How much bluer than red a colour is.
fn blueness(colour: [f64; 3]) -> f64 {
    colour[2] - colour[0]
}

#[test]
fn land_and_sea_are_where_the_source_has_them() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let folder = data::folder(&[
        ("wall.toml", &data::wall(2, SIZE.0, SIZE.1, 30.0)),
        ("scene.toml", &data::scene()),
    ]);
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    command::succeed(&format!(
        "up {} --scene {} --headless --frames 1 --capture {}",
        at("wall.toml"),
        at("scene.toml"),
        at("shot")
    ));
    let wall = pictures::load(&folder.path().join("shot/wall.png"));
    let source = pictures::load(&data::embedded("bmng.jpg"));
    let (mut decisive, mut agreeing, mut sea) = (0, 0, 0);
    for latitude_deg in (-34..=54).step_by(4).map(f64::from) {
        for longitude_deg in (-29..=59).step_by(4).map(f64::from) {
            // The source around the place: two degrees are a few pixels of the wall.
            let x = (longitude_deg + 180.0) / 360.0 * f64::from(source.width());
            let y = (90.0 - latitude_deg) / 180.0 * f64::from(source.height());
            let around = [-10, 0, 10].map(|d| {
                let mean = pictures::mean(
                    &source,
                    (x as u32).saturating_add_signed(d),
                    y as u32 - 5,
                    1,
                    11,
                );
                blueness(mean)
            });
            // On coasts the answer hangs on the filter.
            if around
                .iter()
                .any(|b| b.abs() < 10.0 || b.signum() != around[1].signum())
            {
                continue;
            }
            let (x, y) = project(Geodetic {
                latitude_deg,
                longitude_deg,
                height_m: 0.0,
            });
            let shown = blueness(pictures::mean(&wall, x as u32, y as u32, 1, 1));
            decisive += 1;
            sea += u32::from(around[1] > 0.0);
            agreeing += u32::from(shown.signum() == around[1].signum());
        }
    }
    assert!(
        decisive > 250 && sea > 80 && decisive - sea > 80,
        "{decisive} places, {sea} at sea"
    );
    assert!(
        agreeing * 100 >= decisive * 97,
        "{agreeing} of {decisive} places agree"
    );
}
