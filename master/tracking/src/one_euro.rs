//! The one-euro filter. In: noisy values at any moments. Out: values that are calm at rest and follow fast
//! motion, and their speed. It refuses nothing: values must be finite.
//!
//! Géry Casiez, Nicolas Roussel, Daniel Vogel: 1€ Filter: A Simple Speed-based Low-pass Filter for Noisy Input
//! in Interactive Systems, CHI 2012, Algorithms 1 and 2. Two changes: a place is filtered as one vector, by
//! its speed in any direction, so that the way along an axis is not smoother than the way across; and
//! turns are filtered by slerp, by their angular speed.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

/// Cutoff of the speed that moves the filter's cutoff, in hertz (the paper's d_cutoff).
const SPEED_CUTOFF_HZ: f64 = 1.0;
/// Cutoff of the velocity that predicts, in hertz. It is the filtered value's derivative, so it is calm
/// already; the 1 Hz above would lag behind every step that a viewer takes.
const VELOCITY_CUTOFF_HZ: f64 = 6.0;
/// Shortest step that counts: two moments nearer than this are a clock's noise.
const SHORTEST_STEP_S: f64 = 0.000_5;

/// How strongly noise is removed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothing {
    /// Cutoff frequency at rest in hertz, > 0: lower is calmer.
    pub minimum_cutoff_hz: f64,
    /// How fast the cutoff rises with speed, ≥ 0: hertz a metre a second for places, hertz a radian a second
    /// for turns. Higher follows faster.
    pub speed_coefficient: f64,
}

impl Default for Smoothing {
    fn default() -> Self {
        Self {
            minimum_cutoff_hz: 1.0,
            speed_coefficient: 0.5,
        }
    }
}

impl Smoothing {
    fn cutoff_hz(&self, speed: f64) -> f64 {
        self.minimum_cutoff_hz + self.speed_coefficient * speed
    }
}

/// The share of a new value in a low-pass of first order after `step_s` (the paper's α).
fn share(cutoff_hz: f64, step_s: f64) -> f64 {
    let turns = TAU * cutoff_hz * step_s;
    turns / (turns + 1.0)
}

/// Seconds between two moments, or `None` where time does not go on.
fn step_s(before_us: i64, at_us: i64) -> Option<f64> {
    let step_us = at_us.saturating_sub(before_us);
    (step_us > 0).then(|| (step_us as f64 * 1e-6).max(SHORTEST_STEP_S))
}

/// The filter for places, in metres.
#[derive(Clone, Debug)]
pub struct OneEuro {
    smoothing: Smoothing,
    last: Option<Place>,
}

#[derive(Clone, Copy, Debug)]
struct Place {
    at_us: i64,
    value: DVec3,
    /// For the cutoff.
    slope: DVec3,
    velocity: DVec3,
}

impl OneEuro {
    /// A filter that has seen nothing.
    #[must_use]
    pub fn new(smoothing: Smoothing) -> Self {
        Self {
            smoothing,
            last: None,
        }
    }

    /// The filtered place after the finite `value` of `at_us`. Values that are not later than the last are
    /// left out.
    pub fn filter(&mut self, at_us: i64, value: DVec3) -> DVec3 {
        let Some(last) = self.last else {
            self.last = Some(Place {
                at_us,
                value,
                slope: DVec3::ZERO,
                velocity: DVec3::ZERO,
            });
            return value;
        };
        let Some(step_s) = step_s(last.at_us, at_us) else {
            return last.value;
        };
        let slope = (value - last.value) / step_s;
        let slope = last.slope.lerp(slope, share(SPEED_CUTOFF_HZ, step_s));
        let cutoff_hz = self.smoothing.cutoff_hz(slope.length());
        let filtered = last.value.lerp(value, share(cutoff_hz, step_s));
        let velocity = (filtered - last.value) / step_s;
        self.last = Some(Place {
            at_us,
            value: filtered,
            slope,
            velocity: last
                .velocity
                .lerp(velocity, share(VELOCITY_CUTOFF_HZ, step_s)),
        });
        filtered
    }

    /// Metres a second.
    #[must_use]
    pub fn velocity(&self) -> DVec3 {
        self.last.map_or(DVec3::ZERO, |last| last.velocity)
    }

    /// Forgets everything: the next value is taken as it is.
    pub fn reset(&mut self) {
        self.last = None;
    }
}

/// The filter for orientations.
#[derive(Clone, Debug)]
pub struct OneEuroRotation {
    smoothing: Smoothing,
    last: Option<Turn>,
}

#[derive(Clone, Copy, Debug)]
struct Turn {
    at_us: i64,
    value: DQuat,
    slope: DVec3,
    velocity: DVec3,
}

impl OneEuroRotation {
    /// A filter that has seen nothing.
    #[must_use]
    pub fn new(smoothing: Smoothing) -> Self {
        Self {
            smoothing,
            last: None,
        }
    }

    /// The filtered orientation after the unit quaternion `value` of `at_us`. Values that are not later than
    /// the last are left out. `q` and `−q` are the same orientation.
    pub fn filter(&mut self, at_us: i64, value: DQuat) -> DQuat {
        let Some(last) = self.last else {
            self.last = Some(Turn {
                at_us,
                value,
                slope: DVec3::ZERO,
                velocity: DVec3::ZERO,
            });
            return value;
        };
        let Some(step_s) = step_s(last.at_us, at_us) else {
            return last.value;
        };
        let slope = turn_between(last.value, value) / step_s;
        let slope = last.slope.lerp(slope, share(SPEED_CUTOFF_HZ, step_s));
        let cutoff_hz = self.smoothing.cutoff_hz(slope.length());
        // glam's slerp takes the short way round.
        let filtered = last
            .value
            .slerp(value, share(cutoff_hz, step_s))
            .normalize();
        let velocity = turn_between(last.value, filtered) / step_s;
        self.last = Some(Turn {
            at_us,
            value: filtered,
            slope,
            velocity: last
                .velocity
                .lerp(velocity, share(VELOCITY_CUTOFF_HZ, step_s)),
        });
        filtered
    }

    /// Radians a second about an axis of the room.
    #[must_use]
    pub fn velocity(&self) -> DVec3 {
        self.last.map_or(DVec3::ZERO, |last| last.velocity)
    }

    /// Forgets everything: the next value is taken as it is.
    pub fn reset(&mut self) {
        self.last = None;
    }
}

/// The turn from one orientation to another, the short way: its axis, as long as its angle in radians.
fn turn_between(from: DQuat, to: DQuat) -> DVec3 {
    let turn = to * from.conjugate();
    let turn = if turn.w < 0.0 { -turn } else { turn };
    turn.normalize().to_scaled_axis()
}
