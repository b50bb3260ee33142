//! A virtual camera at an eye, and the planar wall that shows what it should see.
//!
//! In: an eye, directions. Out: rays, corners of its image plane in room metres. It renders nothing.

use glam::DVec3;
use screens::HeadPose;

/// A camera without distortion. Its pixels are square.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// In room metres.
    pub eye_m: DVec3,
    /// Width and height.
    pub size_px: [u32; 2],
    /// Unit vectors in room axes; `back` is away from what it looks at.
    right: DVec3,
    up: DVec3,
    back: DVec3,
    /// Half the width of the image plane 1 m ahead.
    half_width_m: f64,
}

impl Camera {
    /// A camera that looks to the left by a yaw and up by a pitch, in degrees; zero looks along −z. `field_deg` is the angle
    /// across its width.
    #[must_use]
    pub fn new(
        eye_m: DVec3,
        yaw_deg: f64,
        pitch_deg: f64,
        field_deg: f64,
        size_px: [u32; 2],
    ) -> Self {
        let pose = HeadPose::new(eye_m, [yaw_deg, pitch_deg, 0.0]);
        Self {
            eye_m,
            size_px,
            right: pose.right,
            up: pose.up,
            back: pose.back,
            half_width_m: (0.5 * field_deg).to_radians().tan(),
        }
    }

    /// The same camera at another place.
    #[must_use]
    pub const fn moved_to(&self, eye_m: DVec3) -> Self {
        Self { eye_m, ..*self }
    }

    /// From the eye to the place of its image plane 1 m ahead that a place in the picture shows; the middle of the first
    /// pixel is at (0.5, 0.5).
    #[must_use]
    pub fn direction(&self, place_px: [f64; 2]) -> DVec3 {
        let [width, height] = self.size_px.map(f64::from);
        let pixel_m = 2.0 * self.half_width_m / width;
        self.right * ((place_px[0] - 0.5 * width) * pixel_m)
            - self.up * ((place_px[1] - 0.5 * height) * pixel_m)
            - self.back
    }

    /// The lower left, lower right and upper left corner of its image plane in room metres.
    #[must_use]
    pub fn corners_m(&self) -> [DVec3; 3] {
        let [width, height] = self.size_px.map(f64::from);
        [[0.0, height], [width, height], [0.0, 0.0]].map(|place| self.eye_m + self.direction(place))
    }
}
