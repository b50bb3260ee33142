//! The horizon test: what the planet's own body hides from a viewer.
//! In: an ellipsoid, a floor below which nothing is drawn, a viewer. Out: hidden or perhaps visible.

use glam::DVec3;

use crate::bounds::Ball;
use crate::ellipsoid::Ellipsoid;

/// What a viewer cannot see because the planet stands in the way. Conservative: the body is shrunk to
/// its lowest terrain, and a ball counts as hidden only if every ray to it meets that body first.
#[derive(Clone, Copy, Debug)]
pub struct Horizon {
    viewer: DVec3,
    /// The viewer, and 1 / semi-axes, in the space where the shrunk body is the unit sphere.
    scale: DVec3,
    scaled_viewer: DVec3,
    /// Squared length of the tangent from viewer to unit sphere; ≤ 0 for a viewer inside.
    tangent_squared: f64,
}

impl Horizon {
    /// A horizon for a viewer in ECEF metres. `floor_m` is the lowest height drawn anywhere (≤ 0 on
    /// Earth's sea floor).
    #[must_use]
    pub fn new(ellipsoid: &Ellipsoid, floor_m: f64, viewer: DVec3) -> Self {
        // The surface at a depth lies inside the ellipsoid whose semi-axes are shorter by that depth, by
        // at most the depth times the squared relative difference of the axes (on Earth 12 cm at 11 km).
        let (large, small) = (ellipsoid.largest_radius_m(), ellipsoid.smallest_radius_m());
        let depth_m = -floor_m.min(0.0) * (1.0 + ((large - small) / small).powi(2));
        let a = (ellipsoid.semi_major_m - depth_m).max(0.0);
        let b = (ellipsoid.semi_minor_m - depth_m).max(0.0);
        let scale = DVec3::new(1.0 / a, 1.0 / a, 1.0 / b);
        let scaled_viewer = viewer * scale;
        Self {
            viewer,
            scale,
            scaled_viewer,
            tangent_squared: scaled_viewer.length_squared() - 1.0,
        }
    }

    /// True if the planet hides the whole ball.
    #[must_use]
    pub fn hides(&self, ball: &Ball) -> bool {
        if self.tangent_squared <= 0.0 {
            return false;
        }
        // In scaled space the ball's image fits in a ball of this radius.
        let radius = ball.radius_m * self.scale.max_element();
        let centre = ball.centre * self.scale;
        let distance = self.scaled_viewer.length();
        let axis = self.scaled_viewer / distance;
        // Behind the horizon plane by more than the radius …
        let towards = self.scaled_viewer - centre;
        let depth = towards.dot(axis) - self.tangent_squared / distance;
        if depth <= radius {
            return false;
        }
        // … and inside the shadow cone, whose slope is 1 / tangent length, by more than the radius.
        let along = towards.dot(axis);
        let aside = (towards - axis * along).length();
        let sine = 1.0 / distance;
        let cosine = (1.0 - sine * sine).sqrt();
        along * sine - aside * cosine > radius
    }

    /// The viewer in ECEF metres.
    #[must_use]
    pub fn viewer(&self) -> DVec3 {
        self.viewer
    }
}
