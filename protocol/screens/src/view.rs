//! Planar views from an eye: off-axis frusta of which each pixel's direction is known.
//! In: directions in room axes, pixels. Out: the other one. It decides nothing; `cover.rs` lays views out.

use glam::DVec3;

/// A rectangle 1 m in front of an eye, and the picture that is rendered for it. Its pixels are square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarView {
    /// From the eye to the rectangle's lower left corner, in metres in room axes.
    pub lower_left_m: DVec3,
    /// Unit vector along the lower edge.
    pub right: DVec3,
    /// Unit vector along the left edge, at right angles to `right`.
    pub up: DVec3,
    /// Width and height of the rectangle in metres.
    pub size_m: [f64; 2],
    /// Width and height of the picture, multiples of 16.
    pub size_px: [u32; 2],
    /// Pixels of the view to a pixel of the output where they are fewest, in the direction in which they are. Below 1 the
    /// output is undersampled there, because the view would have been larger than allowed.
    pub sampling: f64,
}

impl PlanarView {
    /// Unit vector into the view, at right angles to `right` and `up`.
    #[must_use]
    pub fn forward(&self) -> DVec3 {
        self.up.cross(self.right)
    }

    /// From the eye to the rectangle's plane, in metres.
    #[must_use]
    pub fn distance_m(&self) -> f64 {
        self.lower_left_m.dot(self.forward())
    }

    /// The place of a direction (room axes, any length but 0) in the picture in pixels from its upper left corner, the
    /// middle of the first pixel at (0.5, 0.5). Beyond the picture for directions that are not in it; NaN for those that
    /// never meet its plane.
    #[must_use]
    pub fn project(&self, direction: DVec3) -> [f64; 2] {
        let forward = self.forward();
        let depth = direction.dot(forward);
        if depth.is_nan() || depth <= 0.0 {
            return [f64::NAN; 2];
        }
        let in_plane = direction * (self.lower_left_m.dot(forward) / depth) - self.lower_left_m;
        let [width, height] = self.size_px.map(f64::from);
        [
            in_plane.dot(self.right) / self.size_m[0] * width,
            (1.0 - in_plane.dot(self.up) / self.size_m[1]) * height,
        ]
    }

    /// The direction of a place in the picture: from the eye to the rectangle, in metres in room axes.
    #[must_use]
    pub fn direction(&self, place_px: [f64; 2]) -> DVec3 {
        let [width, height] = self.size_px.map(f64::from);
        self.lower_left_m
            + self.right * (place_px[0] / width * self.size_m[0])
            + self.up * ((1.0 - place_px[1] / height) * self.size_m[1])
    }

    /// Whether a place lies in the picture.
    #[must_use]
    pub fn contains(&self, place_px: [f64; 2]) -> bool {
        let [x, y] = place_px;
        let [width, height] = self.size_px.map(f64::from);
        (0.0..=width).contains(&x) && (0.0..=height).contains(&y)
    }

    /// Whether the output has finer pixels than the view somewhere.
    #[must_use]
    pub fn is_undersampled(&self) -> bool {
        self.sampling < 1.0
    }
}
