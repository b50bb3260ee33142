//! A head that moves. In: its filtered pose and velocities, a presentation time. Out: its pose then. It
//! reads no clock.

use glam::{DQuat, DVec3};

/// Longest time that a prediction covers, in microseconds: farther, a head does what it wants.
pub const LONGEST_PREDICTION_US: i64 = 50_000;
/// From this age on the prediction is taken back, so that a head whose tracker stops rests where it was
/// measured and not where it might have gone.
const FADE_FROM_US: i64 = 250_000;
/// At this age it is taken back altogether.
const FADE_TO_US: i64 = 500_000;

/// Where a head is and how it is turned, in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadPose {
    /// The middle between the eyes, in metres.
    pub position_m: [f64; 3],
    /// To its right, a unit vector.
    pub right: [f64; 3],
    /// To its top, a unit vector.
    pub up: [f64; 3],
    /// Away from where it looks, a unit vector.
    pub back: [f64; 3],
}

impl HeadPose {
    /// The pose of a head at `position_m` that the unit quaternion `orientation` turns from rest (which is: −z
    /// ahead, +x to the right, +y up).
    #[must_use]
    pub fn new(position_m: DVec3, orientation: DQuat) -> Self {
        Self {
            position_m: position_m.into(),
            right: (orientation * DVec3::X).into(),
            up: (orientation * DVec3::Y).into(),
            back: (orientation * DVec3::Z).into(),
        }
    }
}

/// A head that moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// When the pose was measured.
    pub measured_us: i64,
    /// Where the head was then, in metres.
    pub position_m: DVec3,
    /// How it was turned, a unit quaternion.
    pub orientation: DQuat,
    /// In metres a second.
    pub velocity_m_s: DVec3,
    /// Axis in the room, as long as the radians a second.
    pub turning_rad_s: DVec3,
}

impl Motion {
    /// The pose at `presentation_us`, by constant velocity and constant turning over at most
    /// [`LONGEST_PREDICTION_US`]. Moments before the measurement give the measured pose.
    #[must_use]
    pub fn at(&self, presentation_us: i64) -> HeadPose {
        let horizon_s = horizon_s(presentation_us.saturating_sub(self.measured_us));
        let turn = DQuat::from_scaled_axis(self.turning_rad_s * horizon_s);
        HeadPose::new(
            self.position_m + self.velocity_m_s * horizon_s,
            (turn * self.orientation).normalize(),
        )
    }
}

/// How far a prediction reaches for a measurement of that age.
fn horizon_s(age_us: i64) -> f64 {
    let reach_s = age_us.clamp(0, LONGEST_PREDICTION_US) as f64 * 1e-6;
    let left_us = FADE_TO_US.saturating_sub(age_us);
    let span_us = (FADE_TO_US - FADE_FROM_US) as f64;
    reach_s * (left_us as f64 / span_us).clamp(0.0, 1.0)
}
