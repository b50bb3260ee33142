//! Cylindrical screens, seen from inside.
//! In: measures, shares, rays. Out: room points, shares. An arc takes trigonometry; a picture that is aligned on a chord
//! plane takes the four basic operations and square roots alone.

use glam::DVec3;

use crate::ShapeError;
use crate::planar::{Frame, Planar};
use crate::rays::{
    NEAREST_M, azimuth_share, check_azimuths, check_place, check_radius, on_canvas, roots,
};

/// How far off the surface the corners of a chord may be, in radii.
const CORNER_TOLERANCE: f64 = 0.01;
/// The least share of −z that is left at right angles to the axis: sin 3°.
const LEAST_AHEAD: f64 = 0.052;
/// How far in front of the plane of the corners the place of alignment must be, in metres.
const NEAREST_ALIGNED_M: f64 = 0.01;

/// A part of a cylinder, seen from inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// A point of the axis in room metres. Heights count from it.
    pub foot_m: DVec3,
    /// Direction of the axis, upwards; its length does not count.
    pub axis: DVec3,
    /// In metres, 0.01…10000.
    pub radius_m: f64,
    /// Which part, and where on it the canvas lies.
    pub mapping: CylinderMapping,
}

/// Where a canvas lies on a cylinder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CylinderMapping {
    /// Columns are equal angles, rows equal heights.
    Arc {
        /// From the left edge to the right one, in degrees: 0 is straight ahead (−z, at right angles to the axis),
        /// positive is to the right (ahead × up). Ascending, at most a whole turn.
        azimuth_deg: [f64; 2],
        /// From the lower edge to the upper one, in metres along the axis. Ascending.
        height_m: [f64; 2],
    },
    /// The canvas lies where it does on the plane of its corners for one place: from there along rays onto the cylinder
    /// (the warp of marlam/ecmview, src/eq/warping.cpp, for a head that has not moved).
    Chord {
        /// On the cylinder within 1 % of its radius.
        corners: Planar,
        /// Where the rays come from, in room metres: inside the cylinder and in front of the plane.
        aligned_from_m: DVec3,
    },
}

/// Unit vectors of a cylinder: to azimuth 0, to azimuth 90°, along the axis.
struct Axes {
    ahead: DVec3,
    right: DVec3,
    up: DVec3,
}

impl Cylinder {
    fn axes(&self) -> Axes {
        let up = self.axis.normalize();
        let ahead = (DVec3::NEG_Z - up * DVec3::NEG_Z.dot(up)).normalize();
        Axes {
            ahead,
            right: ahead.cross(up),
            up,
        }
    }

    /// The part of a vector at right angles to the axis.
    fn across(&self, vector: DVec3) -> DVec3 {
        vector - self.axis * (vector.dot(self.axis) / self.axis.length_squared())
    }

    /// Where the line of a ray meets the whole cylinder, in lengths of the direction, ascending.
    fn distances(&self, from_m: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        let (from, along) = (self.across(from_m - self.foot_m), self.across(direction));
        let beyond = from.length_squared() - self.radius_m * self.radius_m;
        roots(along.length_squared(), from.dot(along), beyond)
    }

    /// The point at shares, which may lie beyond the edges of the canvas.
    pub(crate) fn point_m(&self, x_share: f64, y_share: f64) -> Option<DVec3> {
        match &self.mapping {
            CylinderMapping::Arc {
                azimuth_deg: [left, right],
                height_m: [low, high],
            } => {
                let axes = self.axes();
                let (sine, cosine) = (left + (right - left) * x_share).to_radians().sin_cos();
                let height_m = high + (low - high) * y_share;
                Some(
                    self.foot_m
                        + axes.right * (self.radius_m * sine)
                        + axes.ahead * (self.radius_m * cosine)
                        + axes.up * height_m,
                )
            }
            CylinderMapping::Chord {
                corners,
                aligned_from_m,
            } => {
                let along = corners.frame().point_m(x_share, y_share) - *aligned_from_m;
                let [_, leaves] = self.distances(*aligned_from_m, along)?;
                (leaves > 0.0).then(|| *aligned_from_m + along * leaves)
            }
        }
    }

    pub(crate) fn normal(&self, point_m: DVec3) -> DVec3 {
        -self.across(point_m - self.foot_m).normalize()
    }

    pub(crate) fn locate(&self, from_m: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        self.distances(from_m, direction)?
            .into_iter()
            .filter(|distance| *distance > NEAREST_M && distance.is_finite())
            .find_map(|distance| self.shares(from_m + direction * distance))
    }

    /// The shares of a point on the surface; `None` off the canvas.
    fn shares(&self, point_m: DVec3) -> Option<[f64; 2]> {
        match &self.mapping {
            CylinderMapping::Arc {
                azimuth_deg,
                height_m: [low, high],
            } => {
                let axes = self.axes();
                let from_foot = point_m - self.foot_m;
                let y = on_canvas((high - from_foot.dot(axes.up)) / (high - low))?;
                let azimuth = from_foot.dot(axes.right).atan2(from_foot.dot(axes.ahead));
                Some([azimuth_share(azimuth.to_degrees(), *azimuth_deg)?, y])
            }
            CylinderMapping::Chord {
                corners,
                aligned_from_m,
            } => {
                let frame = corners.frame();
                let along = point_m - *aligned_from_m;
                // Only what is ahead of the place of alignment: the plane is between it and the surface.
                let to_plane = frame.distance(*aligned_from_m, along);
                if !(to_plane > 0.0 && to_plane.is_finite()) {
                    return None;
                }
                let [x, y] = frame.shares(*aligned_from_m + along * to_plane);
                Some([on_canvas(x)?, on_canvas(y)?])
            }
        }
    }

    pub(crate) fn check(&self) -> Result<(), ShapeError> {
        check_place("foot_m", self.foot_m)?;
        check_place("axis", self.axis)?;
        check_radius(self.radius_m)?;
        if self.axis.length() < 1e-6 {
            return Err(ShapeError::NoAxis);
        }
        match &self.mapping {
            CylinderMapping::Arc {
                azimuth_deg,
                height_m: [from_m, to_m],
            } => {
                let up = self.axis.normalize();
                if (DVec3::NEG_Z - up * DVec3::NEG_Z.dot(up)).length() < LEAST_AHEAD {
                    return Err(ShapeError::AxisAhead);
                }
                check_azimuths(*azimuth_deg)?;
                check_place("height_m", DVec3::new(*from_m, *to_m, 0.0))?;
                if to_m - from_m < 0.001 {
                    return Err(ShapeError::HeightOrder {
                        from_m: *from_m,
                        to_m: *to_m,
                    });
                }
                Ok(())
            }
            CylinderMapping::Chord {
                corners,
                aligned_from_m,
            } => self.check_chord(corners, *aligned_from_m),
        }
    }

    fn check_chord(&self, corners: &Planar, aligned_from_m: DVec3) -> Result<(), ShapeError> {
        corners.check()?;
        check_place("aligned_from_m", aligned_from_m)?;
        let outside_m = |point: DVec3| self.across(point - self.foot_m).length() - self.radius_m;
        let tolerance_m = CORNER_TOLERANCE * self.radius_m;
        for (corner, place) in [
            ("bottom_left", corners.bottom_left_m),
            ("bottom_right", corners.bottom_right_m),
            ("top_left", corners.top_left_m),
        ] {
            let off_m = outside_m(place).abs();
            if off_m > tolerance_m {
                let off_mm = off_m * 1000.0;
                return Err(ShapeError::CornerOffSurface { corner, off_mm });
            }
        }
        let frame: Frame = corners.frame();
        let off_m = outside_m(frame.point_m(1.0, 0.0));
        if off_m > tolerance_m {
            let off_mm = off_m * 1000.0;
            return Err(ShapeError::ChordOutside { off_mm });
        }
        let beyond_m = outside_m(aligned_from_m);
        // A ray that starts on the surface would meet it at once.
        if beyond_m > -1e-3 * self.radius_m {
            return Err(ShapeError::AlignedOutside {
                distance_m: beyond_m + self.radius_m,
                radius_m: self.radius_m,
            });
        }
        let distance_m = frame.in_front_m(aligned_from_m);
        if distance_m < NEAREST_ALIGNED_M {
            return Err(ShapeError::LeftHanded { distance_m });
        }
        Ok(())
    }
}
