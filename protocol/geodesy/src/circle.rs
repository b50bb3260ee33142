//! A lens: a circle on the ellipsoid, as an exact test on geodetic normals, as a relation to tiles, and as a
//! polynomial over a tile's samples. In: centre, radius, normals, tiles. Out: inside or outside. No platform
//! mathematics, only + − × ÷ √, so that every node decides alike. It knows no layers and no parameters.

mod fit;
mod polynomial;
mod relation;

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::DVec3;
use thiserror::Error;

use crate::ellipsoid::Ellipsoid;

pub use polynomial::CirclePolynomial;
pub use relation::Relation;

/// The largest radius of a circle in metres.
pub const MAX_CIRCLE_RADIUS_M: f64 = 5_000_000.0;

/// A circle on the surface of an ellipsoid: all surface points within a straight-line distance of its centre.
///
/// That distance is the chord of the radius' arc on the sphere of the Gaussian mean radius of curvature at
/// the centre, √(MN) = a²b / (a² cos²φ + b² sin²φ). The rim departs from the true geodesic circle because
/// curvature changes with direction and place: on Earth and Mars by less than (radius / planet's radius)² · f,
/// as a share of the radius, f being the flattening. On Earth that is at most 0.1 µm for a radius of 1 km,
/// 0.1 m for 100 km, 83 m for 1,000 km and 10.4 km for 5,000 km; on a sphere it is nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle {
    ellipsoid: Ellipsoid,
    /// The geodetic unit normal and the surface point at the centre.
    normal: DVec3,
    centre: DVec3,
    /// The arc from the centre to the rim on the mean sphere, in radians.
    arc: f64,
    mean_radius_m: f64,
    chord_m: f64,
    chord_squared_m2: f64,
}

/// Why a circle was refused.
#[derive(Debug, Error, PartialEq)]
pub enum CircleError {
    /// The centre is no place.
    #[error(
        "a centre at latitude {latitude_deg}°, longitude {longitude_deg}°: write a latitude of −90 to 90 and a longitude of −180 to 180"
    )]
    BadCentre {
        /// The latitude that was given.
        latitude_deg: f64,
        /// The longitude that was given.
        longitude_deg: f64,
    },
    /// The radius is not positive, too large or no number.
    #[error("a radius of {0} m: it must be above 0 and at most 5,000,000 m")]
    BadRadius(f64),
}

impl Circle {
    /// The circle of `radius_m` metres along the ground, above 0 and at most [`MAX_CIRCLE_RADIUS_M`], about a
    /// place in degrees, −90…90 and −180…180. Where a planet is so small that half its girth is no longer
    /// than the radius, the circle holds all of it.
    pub fn new(
        ellipsoid: &Ellipsoid,
        latitude_deg: f64,
        longitude_deg: f64,
        radius_m: f64,
    ) -> Result<Self, CircleError> {
        if !((-90.0..=90.0).contains(&latitude_deg) && (-180.0..=180.0).contains(&longitude_deg)) {
            return Err(CircleError::BadCentre {
                latitude_deg,
                longitude_deg,
            });
        }
        if !(radius_m > 0.0 && radius_m <= MAX_CIRCLE_RADIUS_M) {
            return Err(CircleError::BadRadius(radius_m));
        }
        let (sin_latitude, cos_latitude) = sine_cosine_deg(latitude_deg);
        let (sin_longitude, cos_longitude) = sine_cosine_deg(longitude_deg);
        let normal = DVec3::new(
            cos_latitude * cos_longitude,
            cos_latitude * sin_longitude,
            sin_latitude,
        );
        let (a, b) = (ellipsoid.semi_major_m, ellipsoid.semi_minor_m);
        let mean_radius_m =
            a * a * b / (a * a * cos_latitude * cos_latitude + b * b * sin_latitude * sin_latitude);
        let arc = radius_m / mean_radius_m;
        let chord_m = if arc < 2.0 * FRAC_PI_2 {
            2.0 * mean_radius_m * sine(0.5 * arc)
        } else {
            4.0 * ellipsoid.largest_radius_m()
        };
        Ok(Self {
            ellipsoid: *ellipsoid,
            normal,
            centre: ellipsoid.point(normal, 0.0),
            arc,
            mean_radius_m,
            chord_m,
            chord_squared_m2: chord_m * chord_m,
        })
    }

    /// True where the surface point with this geodetic unit normal is inside the circle or on its rim. A
    /// function of the normal's bits alone.
    #[must_use]
    pub fn contains(&self, normal: DVec3) -> bool {
        let point = self.ellipsoid.point(normal, 0.0);
        point.distance_squared(self.centre) <= self.chord_squared_m2
    }
}

/// Sine and cosine of an angle of at most ±π/4, by their Taylor series: what is left out is below 1e-19.
fn sine_cosine(angle: f64) -> (f64, f64) {
    let square = angle * angle;
    let (mut sine, mut cosine) = (1.0, 1.0);
    for n in (1..=9).rev() {
        let even = f64::from(2 * n);
        cosine = 1.0 - square / (even * (even - 1.0)) * cosine;
        sine = 1.0 - square / (even * (even + 1.0)) * sine;
    }
    (angle * sine, cosine)
}

/// Sine and cosine of an angle in degrees, the same bits on every processor.
fn sine_cosine_deg(angle_deg: f64) -> (f64, f64) {
    let quarter = (angle_deg / 90.0).round();
    let (sine, cosine) = sine_cosine((angle_deg - 90.0 * quarter).to_radians());
    match (quarter as i64).rem_euclid(4) {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

/// The sine of an angle in 0…π/2.
fn sine(angle: f64) -> f64 {
    if angle <= FRAC_PI_4 {
        sine_cosine(angle).0
    } else {
        sine_cosine(FRAC_PI_2 - angle).1
    }
}
