//! Planar screens: a rectangle in the room, by three of its corners.
//! In: corners, shares, rays. Out: room points, shares. Only the four basic operations and square roots.

use glam::DVec3;

use crate::ShapeError;
use crate::rays::{NEAREST_M, check_place, on_canvas};

/// How far corners may be off a rectangle, in metres.
const RECTANGLE_TOLERANCE_M: f64 = 0.001;

/// A rectangle by three corners in room metres, as its viewers see them; the fourth follows. Corners may be off a
/// rectangle by a millimetre: the lower edge and the length of the left edge count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planar {
    /// Lower left corner.
    pub bottom_left_m: DVec3,
    /// Lower right corner.
    pub bottom_right_m: DVec3,
    /// Upper left corner.
    pub top_left_m: DVec3,
}

/// The axes and sizes of a rectangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    /// Lower left corner.
    pub(crate) corner_m: DVec3,
    /// Unit vector along the lower edge.
    pub(crate) right: DVec3,
    /// Unit vector at right angles to it, along the left edge.
    pub(crate) up: DVec3,
    /// Unit normal towards the viewers.
    pub(crate) back: DVec3,
    /// Length of the lower edge.
    pub(crate) width_m: f64,
    /// Length of the left edge.
    pub(crate) height_m: f64,
}

impl Frame {
    /// The point at shares from the upper left corner, which may lie beyond the edges.
    pub(crate) fn point_m(&self, x_share: f64, y_share: f64) -> DVec3 {
        self.corner_m
            + self.right * (x_share * self.width_m)
            + self.up * ((1.0 - y_share) * self.height_m)
    }

    /// The shares of the point of the plane that is nearest to a point.
    pub(crate) fn shares(&self, point_m: DVec3) -> [f64; 2] {
        let from_corner = point_m - self.corner_m;
        [
            from_corner.dot(self.right) / self.width_m,
            1.0 - from_corner.dot(self.up) / self.height_m,
        ]
    }

    /// How far along a ray the plane is, in lengths of the direction. May be negative; infinite or not a number for a ray
    /// along the plane.
    pub(crate) fn distance(&self, from_m: DVec3, direction: DVec3) -> f64 {
        (self.corner_m - from_m).dot(self.back) / direction.dot(self.back)
    }

    /// How far in front of the plane a point is, in metres.
    pub(crate) fn in_front_m(&self, point_m: DVec3) -> f64 {
        (point_m - self.corner_m).dot(self.back)
    }
}

impl Planar {
    /// The axes; not numbers for corners that [`Planar::check`] refuses.
    pub(crate) fn frame(&self) -> Frame {
        let along_width = self.bottom_right_m - self.bottom_left_m;
        let along_height = self.top_left_m - self.bottom_left_m;
        let (width_m, height_m) = (along_width.length(), along_height.length());
        let right = along_width / width_m;
        // The corners may be off a rectangle by a millimetre; the frustum must not be.
        let back = right.cross(along_height / height_m).normalize();
        Frame {
            corner_m: self.bottom_left_m,
            right,
            up: back.cross(right),
            back,
            width_m,
            height_m,
        }
    }

    pub(crate) fn check(&self) -> Result<(), ShapeError> {
        check_place("corners_m.bottom_left", self.bottom_left_m)?;
        check_place("corners_m.bottom_right", self.bottom_right_m)?;
        check_place("corners_m.top_left", self.top_left_m)?;
        let right = self.bottom_right_m - self.bottom_left_m;
        let up = self.top_left_m - self.bottom_left_m;
        let (width_m, height_m) = (right.length(), up.length());
        let no_area = ShapeError::NoArea { width_m, height_m };
        if width_m.min(height_m) < RECTANGLE_TOLERANCE_M {
            return Err(no_area);
        }
        let aside_m = right.dot(up).abs() / width_m.max(height_m);
        if aside_m > RECTANGLE_TOLERANCE_M {
            return Err(ShapeError::NotARectangle {
                aside_mm: aside_m * 1000.0,
            });
        }
        if !self.frame().back.is_finite() {
            return Err(no_area);
        }
        Ok(())
    }

    pub(crate) fn locate(&self, from_m: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        let frame = self.frame();
        let distance_m = frame.distance(from_m, direction);
        if !(distance_m > NEAREST_M && distance_m.is_finite()) {
            return None;
        }
        let [x, y] = frame.shares(from_m + direction * distance_m);
        Some([on_canvas(x)?, on_canvas(y)?])
    }
}
