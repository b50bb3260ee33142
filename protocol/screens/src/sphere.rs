//! Spherical screens (domes), seen from inside.
//! In: measures, shares, rays. Out: room points, shares. Equal angles are equal pixels, so it takes trigonometry.

use glam::DVec3;

use crate::ShapeError;
use crate::rays::{
    EDGE_SHARE, NEAREST_M, azimuth_share, check_angle, check_azimuths, check_place, check_radius,
    on_canvas, roots,
};

/// A part of a sphere, seen from inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// In room metres.
    pub centre_m: DVec3,
    /// In metres, 0.01…10000.
    pub radius_m: f64,
    /// How far the front is lowered, in degrees about x, −180…180.
    pub tilt_deg: f64,
    /// Which part, and where on it the canvas lies.
    pub mapping: SphereMapping,
}

/// Where a canvas lies on a sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SphereMapping {
    /// The angle from the tilted zenith grows with the distance from the middle of the canvas, which should be square; the
    /// front is at its bottom, +x at its right. Beyond the circle that touches its edges there is nothing.
    Fisheye {
        /// The angle across the whole circle, 1…360 degrees.
        field_deg: f64,
    },
    /// Columns and rows are equal angles.
    Grid {
        /// From left to right in degrees: 0 is the tilted front, positive is to the right (+x). Ascending, at most a turn.
        azimuth_deg: [f64; 2],
        /// From the lower edge to the upper one, in degrees above the tilted horizon. Ascending, −90…90.
        elevation_deg: [f64; 2],
    },
}

/// Unit vectors of a tilted dome; its right is the room's +x.
struct Axes {
    front: DVec3,
    zenith: DVec3,
}

impl Sphere {
    fn axes(&self) -> Axes {
        let (sine, cosine) = self.tilt_deg.to_radians().sin_cos();
        Axes {
            front: DVec3::new(0.0, -sine, -cosine),
            zenith: DVec3::new(0.0, cosine, -sine),
        }
    }

    /// The point at shares, which may lie beyond the edges of the canvas.
    pub(crate) fn point_m(&self, x_share: f64, y_share: f64) -> DVec3 {
        let axes = self.axes();
        let direction = match &self.mapping {
            SphereMapping::Fisheye { field_deg } => {
                let half = (0.5 * field_deg).to_radians();
                let (right, down) = (2.0 * x_share - 1.0, 2.0 * y_share - 1.0);
                let distance = (right * right + down * down).sqrt();
                let (sine, cosine) = (half * distance).sin_cos();
                // sin(half·r)/r, which is `half` at the middle.
                let outwards = if distance > 0.0 {
                    sine / distance
                } else {
                    half
                };
                axes.zenith * cosine + (DVec3::X * right + axes.front * down) * outwards
            }
            SphereMapping::Grid {
                azimuth_deg: [left, right],
                elevation_deg: [low, high],
            } => {
                let (across, ahead) = (left + (right - left) * x_share).to_radians().sin_cos();
                let (above, level) = (high + (low - high) * y_share).to_radians().sin_cos();
                (DVec3::X * across + axes.front * ahead) * level + axes.zenith * above
            }
        };
        self.centre_m + direction * self.radius_m
    }

    /// Whether the canvas shows anything at shares.
    pub(crate) fn shows(&self, x_share: f64, y_share: f64) -> bool {
        match self.mapping {
            SphereMapping::Fisheye { .. } => {
                let (right, down) = (2.0 * x_share - 1.0, 2.0 * y_share - 1.0);
                right * right + down * down <= 1.0 + 2.0 * EDGE_SHARE
            }
            SphereMapping::Grid { .. } => true,
        }
    }

    pub(crate) fn normal(&self, point_m: DVec3) -> DVec3 {
        (self.centre_m - point_m) / self.radius_m
    }

    pub(crate) fn locate(&self, from_m: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        let from = from_m - self.centre_m;
        let beyond = from.length_squared() - self.radius_m * self.radius_m;
        roots(direction.length_squared(), from.dot(direction), beyond)?
            .into_iter()
            .filter(|distance| *distance > NEAREST_M && distance.is_finite())
            .find_map(|distance| self.shares(from + direction * distance))
    }

    /// The shares of a point on the surface, from the centre; `None` off the canvas.
    fn shares(&self, from_centre: DVec3) -> Option<[f64; 2]> {
        let axes = self.axes();
        let (right, front) = (from_centre.x, from_centre.dot(axes.front));
        let above = from_centre.dot(axes.zenith);
        let level = (right * right + front * front).sqrt();
        match &self.mapping {
            SphereMapping::Fisheye { field_deg } => {
                let distance = level.atan2(above) / (0.5 * field_deg).to_radians();
                if distance > 1.0 + EDGE_SHARE {
                    return None;
                }
                if level == 0.0 {
                    // The zenith; the nadir of a whole sphere lies at the bottom as well as anywhere on the circle.
                    return Some([0.5, 0.5 + 0.5 * distance]);
                }
                let share = |part: f64| 0.5 + 0.5 * distance * part / level;
                Some([on_canvas(share(right))?, on_canvas(share(front))?])
            }
            SphereMapping::Grid {
                azimuth_deg,
                elevation_deg: [low, high],
            } => {
                let elevation_deg = above.atan2(level).to_degrees();
                let y = on_canvas((high - elevation_deg) / (high - low))?;
                let azimuth_deg_here = right.atan2(front).to_degrees();
                Some([azimuth_share(azimuth_deg_here, *azimuth_deg)?, y])
            }
        }
    }

    pub(crate) fn check(&self) -> Result<(), ShapeError> {
        check_place("centre_m", self.centre_m)?;
        check_radius(self.radius_m)?;
        check_angle("tilt_deg", self.tilt_deg, [-180.0, 180.0], "")?;
        match self.mapping {
            SphereMapping::Fisheye { field_deg } => {
                check_angle("fisheye_deg", field_deg, [1.0, 360.0], " across the circle")
            }
            SphereMapping::Grid {
                azimuth_deg,
                elevation_deg: [from_deg, to_deg],
            } => {
                check_azimuths(azimuth_deg)?;
                let key = "elevation_deg";
                for degrees in [from_deg, to_deg] {
                    check_angle(key, degrees, [-90.0, 90.0], " from the horizon")?;
                }
                if to_deg - from_deg < 0.01 {
                    return Err(ShapeError::AngleOrder {
                        key,
                        from_deg,
                        to_deg,
                        effect: "upside down or have no height",
                        remedy: "the lower edge",
                    });
                }
                Ok(())
            }
        }
    }
}
