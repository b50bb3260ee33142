//! Ellipsoids of revolution and the two ways to name a point near one: geodetic and Cartesian (ECEF).
//! In: semi-axes, angles, heights. Out: positions in metres. The only file that knows planet constants.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// An ellipsoid of revolution about the z axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ellipsoid {
    /// Equatorial radius in metres, > 0.
    pub semi_major_m: f64,
    /// Polar radius in metres, > 0.
    pub semi_minor_m: f64,
}

/// Geodetic coordinates: the angles of the ellipsoid's normal, and the height along it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Geodetic {
    /// Latitude of the normal in degrees, −90…90.
    pub latitude_deg: f64,
    /// Longitude in degrees, −180…180.
    pub longitude_deg: f64,
    /// Height above the ellipsoid in metres.
    pub height_m: f64,
}

/// Why an ellipsoid was refused.
#[derive(Debug, Error, PartialEq)]
pub enum EllipsoidError {
    /// The name is none of those built in.
    #[error(
        "unknown planet \"{0}\": write \"earth\", \"moon\", \"mars\" or a table with semi_major_m and semi_minor_m"
    )]
    UnknownName(String),
    /// A semi-axis is not a positive, finite number, or the body is far from a sphere.
    #[error(
        "semi-axes {semi_major_m} m and {semi_minor_m} m: both must be positive and finite, and differ by less than half"
    )]
    BadAxes {
        /// The equatorial radius that was given.
        semi_major_m: f64,
        /// The polar radius that was given.
        semi_minor_m: f64,
    },
}

impl Ellipsoid {
    /// WGS84 (NIMA TR8350.2): a = 6378137 m, f = 1/298.257223563.
    pub const EARTH: Self = Self {
        semi_major_m: 6_378_137.0,
        semi_minor_m: 6_356_752.314_245_179,
    };
    /// The Moon's mean sphere (IAU 2015 working group).
    pub const MOON: Self = Self {
        semi_major_m: 1_737_400.0,
        semi_minor_m: 1_737_400.0,
    };
    /// Mars (IAU 2015 working group).
    pub const MARS: Self = Self {
        semi_major_m: 3_396_190.0,
        semi_minor_m: 3_376_200.0,
    };

    /// A built-in ellipsoid by its lower-case name.
    pub fn by_name(name: &str) -> Result<Self, EllipsoidError> {
        match name {
            "earth" => Ok(Self::EARTH),
            "moon" => Ok(Self::MOON),
            "mars" => Ok(Self::MARS),
            _ => Err(EllipsoidError::UnknownName(name.to_owned())),
        }
    }

    /// An ellipsoid from its semi-axes in metres.
    pub fn new(semi_major_m: f64, semi_minor_m: f64) -> Result<Self, EllipsoidError> {
        let fine = |x: f64| x.is_finite() && x > 0.0;
        let ratio = semi_minor_m / semi_major_m;
        if fine(semi_major_m) && fine(semi_minor_m) && ratio > 0.5 && ratio < 2.0 {
            Ok(Self {
                semi_major_m,
                semi_minor_m,
            })
        } else {
            Err(EllipsoidError::BadAxes {
                semi_major_m,
                semi_minor_m,
            })
        }
    }

    /// The unit normal at a latitude and longitude in degrees.
    #[must_use]
    pub fn normal(latitude_deg: f64, longitude_deg: f64) -> DVec3 {
        let (sin_lat, cos_lat) = latitude_deg.to_radians().sin_cos();
        let (sin_lon, cos_lon) = longitude_deg.to_radians().sin_cos();
        DVec3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat)
    }

    /// Latitude and longitude in degrees of a unit normal. Longitude is 0 at the poles.
    #[must_use]
    pub fn angles_deg(normal: DVec3) -> (f64, f64) {
        let latitude = normal.z.atan2(normal.x.hypot(normal.y)).to_degrees();
        (latitude, normal.y.atan2(normal.x).to_degrees())
    }

    /// The point at `height_m` along the unit normal `n`:
    /// p = (a²nx, a²ny, b²nz) / sqrt(a²nx² + a²ny² + b²nz²) + h·n, exact and without trigonometry.
    #[must_use]
    #[inline]
    pub fn point(&self, n: DVec3, height_m: f64) -> DVec3 {
        let a2 = self.semi_major_m * self.semi_major_m;
        let b2 = self.semi_minor_m * self.semi_minor_m;
        let scaled = DVec3::new(a2 * n.x, a2 * n.y, b2 * n.z);
        let length = (a2 * n.x * n.x + a2 * n.y * n.y + b2 * n.z * n.z).sqrt();
        scaled / length + n * height_m
    }

    /// Geodetic to Cartesian metres.
    #[must_use]
    pub fn to_ecef(&self, position: Geodetic) -> DVec3 {
        self.point(
            Self::normal(position.latitude_deg, position.longitude_deg),
            position.height_m,
        )
    }

    /// Cartesian metres to geodetic. Newton's method on the scale of the foot point (D. Eberly,
    /// "Distance from a Point to an Ellipse", §2), which converges everywhere outside the evolute.
    /// Deeper, where normals cross, one of the normals through the point answers; the centre of the
    /// planet answers with the north pole.
    #[must_use]
    pub fn to_geodetic(&self, point: DVec3) -> Geodetic {
        let normal = self.normal_below(point);
        let height_m = (point - self.point(normal, 0.0)).dot(normal);
        let (latitude_deg, longitude_deg) = Self::angles_deg(normal);
        Geodetic {
            latitude_deg,
            longitude_deg,
            height_m,
        }
    }

    /// The unit normal of the surface point nearest to `point`.
    #[must_use]
    pub fn normal_below(&self, point: DVec3) -> DVec3 {
        let (a, b) = (self.semi_major_m, self.semi_minor_m);
        let (rho, z) = (point.x.hypot(point.y), point.z);
        let smallest = a.min(b);
        if rho.hypot(z) <= 1e-9 * smallest {
            return DVec3::Z;
        }
        // Foot point (x, y) = (a²rho/(t+a²), b²z/(t+b²)); F(t) = (x/a)² + (y/b)² − 1 is convex and falls
        // for t > −min(a,b)². Each of its two squares alone reaches 1 at one of the two bounds below, so F
        // is not negative at the larger one, and from there every Newton step rises towards the root.
        let mut t = (a * (rho - a))
            .max(b * (z.abs() - b))
            .max(-smallest * smallest * 0.999_999);
        for _ in 0..64 {
            let (p, q) = (t + a * a, t + b * b);
            let (x, y) = (a * rho / p, b * z / q);
            let f = x * x + y * y - 1.0;
            let slope = -2.0 * (x * x / p + y * y / q);
            let step = f / slope;
            let next = (t - step).max(-smallest * smallest * 0.999_999);
            let done = (next - t).abs() <= 1e-15 * (a * a + t.abs());
            t = next;
            if done {
                break;
            }
        }
        let foot_rho = rho / (t + a * a);
        let foot_z = z / (t + b * b);
        let direction = if rho > 0.0 {
            DVec3::new(foot_rho * point.x / rho, foot_rho * point.y / rho, foot_z)
        } else {
            DVec3::new(0.0, 0.0, foot_z)
        };
        direction.normalize()
    }

    /// East, north and up unit vectors at a unit normal. At the poles east is +y, as for longitude 0.
    #[must_use]
    pub fn east_north_up(normal: DVec3) -> [DVec3; 3] {
        let rho = normal.x.hypot(normal.y);
        let east = if rho > 1e-12 {
            DVec3::new(-normal.y / rho, normal.x / rho, 0.0)
        } else {
            DVec3::Y
        };
        [east, normal.cross(east), normal]
    }

    /// The larger semi-axis in metres.
    #[must_use]
    pub fn largest_radius_m(&self) -> f64 {
        self.semi_major_m.max(self.semi_minor_m)
    }

    /// The smaller semi-axis in metres.
    #[must_use]
    pub fn smallest_radius_m(&self) -> f64 {
        self.semi_major_m.min(self.semi_minor_m)
    }
}
