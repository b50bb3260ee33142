//! Steering by mouse and keys. In: a start pose, [`Steer`] messages, time, the ground's height. Out: a
//! pose. Speeds depend on time and on the height above the ground, never on frames. It reads no clock.

use geodesy::Ellipsoid;
use glam::{DQuat, DVec3};

use super::Pose;
use crate::message::{HeldKeys, Steer};

/// Nearest that the viewer comes to the ground, in metres.
pub(super) const NEAREST_M: f64 = 2.0;
/// Farthest that the viewer goes, in planet radii.
const FARTHEST_RADII: f64 = 20.0;
/// What one step of the wheel leaves of the height above the ground.
const ZOOM_STEP: f64 = 0.85;
/// Speed over the ground by keys, in heights above the ground per second.
const TRAVEL_PER_SECOND: f64 = 0.8;
/// Speed up and down by keys: powers of e per second.
const RISE_PER_SECOND: f64 = 1.0;
/// Speed of looking around and tilting by keys, in radians per second.
const TURN_PER_SECOND: f64 = 0.8;
/// Factor of [`HeldKeys::FAST`].
const FAST: f64 = 4.0;
/// Keys count as released when a window has said nothing for this long.
const KEYS_LAST_US: i64 = 300_000;
/// Longest time that one step of motion covers: after a pause, the viewer must not leap.
const LONGEST_STEP_S: f64 = 0.1;

/// A viewer who is steered.
#[derive(Clone, Debug)]
pub struct Navigator {
    planet: Ellipsoid,
    position: DVec3,
    orientation: DQuat,
    ground_m: f64,
    held: HeldKeys,
    held_until_us: i64,
    now_us: Option<i64>,
}

impl Navigator {
    /// A viewer who starts at `pose` above ground of height 0.
    #[must_use]
    pub fn new(planet: Ellipsoid, pose: &Pose) -> Self {
        Self {
            planet,
            position: pose.position_m.into(),
            orientation: pose.orientation(),
            ground_m: 0.0,
            held: HeldKeys::default(),
            held_until_us: i64::MIN,
            now_us: None,
        }
    }

    /// Where the viewer is.
    #[must_use]
    pub fn pose(&self) -> Pose {
        Pose::new(self.position, self.orientation)
    }

    /// Whether a key still moves the viewer.
    #[must_use]
    pub fn is_moving(&self, now_us: i64) -> bool {
        !self.held.is_empty() && now_us < self.held_until_us
    }

    /// Takes movements and held keys from a window.
    pub fn steer(&mut self, steer: &Steer, now_us: i64) {
        let angle = |radians: f64| {
            if radians.is_finite() {
                radians.clamp(-3.0, 3.0)
            } else {
                0.0
            }
        };
        let [right, up] = steer.drag.map(angle);
        let height_m = self.height_m();
        // The ground follows the pointer, so the viewer goes the other way.
        self.travel(-right * height_m, -up * height_m);
        self.look(
            angle(steer.look[0]),
            angle(steer.look[1]),
            angle(steer.roll),
        );
        if steer.zoom.is_finite() {
            self.approach(1.0 - ZOOM_STEP.powf(steer.zoom.clamp(-20.0, 20.0)));
        }
        self.held = steer.held;
        self.held_until_us = now_us.saturating_add(KEYS_LAST_US);
        self.stay_above_ground();
    }

    /// Moves by the held keys up to now. `ground_m` is the ground's height above the ellipsoid below
    /// the viewer, as far as it is known.
    pub fn advance(&mut self, now_us: i64, ground_m: f64) {
        if ground_m.is_finite() {
            self.ground_m = ground_m;
        }
        let before_us = self.now_us.replace(now_us).unwrap_or(now_us);
        let seconds = (now_us.saturating_sub(before_us) as f64 * 1e-6).clamp(0.0, LONGEST_STEP_S);
        if self.is_moving(now_us) {
            self.move_by_keys(seconds);
        }
        self.stay_above_ground();
    }

    fn move_by_keys(&mut self, seconds: f64) {
        let pace = if self.held.holds(HeldKeys::FAST) {
            FAST * seconds
        } else {
            seconds
        };
        let axis = |more: HeldKeys, less: HeldKeys| {
            f64::from(u8::from(self.held.holds(more))) - f64::from(u8::from(self.held.holds(less)))
        };
        let right = axis(HeldKeys::RIGHT, HeldKeys::LEFT);
        let ahead = axis(HeldKeys::FORWARD, HeldKeys::BACKWARD);
        let rise = axis(HeldKeys::RISE, HeldKeys::SINK);
        let look_right = axis(HeldKeys::LOOK_RIGHT, HeldKeys::LOOK_LEFT);
        let look_up = axis(HeldKeys::LOOK_UP, HeldKeys::LOOK_DOWN);
        let roll = axis(HeldKeys::ROLL_RIGHT, HeldKeys::ROLL_LEFT);
        let reach_m = self.height_m() * TRAVEL_PER_SECOND * pace;
        self.travel(right * reach_m, ahead * reach_m);
        let normal = self.planet.normal_below(self.position);
        let risen = self.height_m() * ((rise * RISE_PER_SECOND * pace).exp() - 1.0);
        self.position += normal * risen;
        let turn = TURN_PER_SECOND * pace;
        self.look(look_right * turn, look_up * turn, roll * turn);
    }

    /// Moves over the ground, metres to the right and ahead, at constant height above the ellipsoid.
    fn travel(&mut self, right_m: f64, ahead_m: f64) {
        let normal = self.planet.normal_below(self.position);
        let gaze_right = self.orientation * DVec3::X;
        let level = gaze_right - normal * gaze_right.dot(normal);
        // With the head tilted by 90° the screen's right is up or down: take what is ahead instead.
        let right = level
            .try_normalize()
            .unwrap_or_else(|| normal.any_orthonormal_vector());
        let direction = right * right_m + normal.cross(right) * ahead_m;
        let radius_m = self.planet.largest_radius_m();
        let angle = (direction.length() / radius_m).min(1.0);
        let Some(axis) = normal.cross(direction).try_normalize() else {
            return;
        };
        let turn = DQuat::from_axis_angle(axis, angle);
        let height_m = (self.position - self.planet.point(normal, 0.0)).dot(normal);
        self.position = self.planet.point((turn * normal).normalize(), height_m);
        self.orientation = (turn * self.orientation).normalize();
    }

    /// Turns the gaze: right about the vertical, up about the screen's right, and tilts the head.
    fn look(&mut self, right: f64, up: f64, roll: f64) {
        let normal = self.planet.normal_below(self.position);
        let heading = DQuat::from_axis_angle(normal, -right);
        let pitch = DQuat::from_axis_angle(DVec3::X, up);
        let tilt = DQuat::from_axis_angle(DVec3::Z, -roll);
        self.orientation = (heading * self.orientation * pitch * tilt).normalize();
    }

    /// Moves along the gaze by a share of the height above the ground.
    fn approach(&mut self, share: f64) {
        let forward = -(self.orientation * DVec3::Z);
        self.position += forward * (self.height_m() * share);
    }

    /// Height above the ground in metres, at least [`NEAREST_M`].
    fn height_m(&self) -> f64 {
        (self.planet.to_geodetic(self.position).height_m - self.ground_m).max(NEAREST_M)
    }

    fn stay_above_ground(&mut self) {
        let normal = self.planet.normal_below(self.position);
        let height_m = (self.position - self.planet.point(normal, 0.0)).dot(normal);
        let highest_m = FARTHEST_RADII * self.planet.largest_radius_m();
        let lowest_m = (self.ground_m + NEAREST_M).min(highest_m);
        if !(lowest_m..=highest_m).contains(&height_m) {
            self.position = self
                .planet
                .point(normal, height_m.clamp(lowest_m, highest_m));
        }
    }
}
