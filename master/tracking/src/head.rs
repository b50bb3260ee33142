//! One tracked head. In: measured poses and their moments. Out: its state, its motion in the room, and events:
//! found, lost, a jump refused, a jump accepted. It does no I/O and reads no clock.

use glam::{DQuat, DVec3};
use thiserror::Error;

use crate::motion::Motion;
use crate::one_euro::{OneEuro, OneEuroRotation, Smoothing};
use crate::room::ToRoom;

/// Faster than this no head moves, in metres a second.
pub const SPEED_LIMIT_M_S: f64 = 10.0;
/// A jump that lasts this long is a new place, in microseconds.
pub const JUMP_PERSISTS_US: i64 = 250_000;
/// A head that was not measured for this long is lost, in microseconds.
pub const LOST_AFTER_US: i64 = 500_000;
/// After a gap this long the filter starts again: what it knows of the motion is past.
const FILTER_FORGETS_US: i64 = 250_000;
/// Shortest step by which a speed is judged: between messages of one burst noise would be fast.
const SHORTEST_STEP_S: f64 = 0.005;
/// What counts at most of the time of doubt, when a head is measured near its old place again: time makes every
/// distance slow, and a place that dances must not pass for a walk.
const RETURN_US: i64 = 50_000;
/// Farthest that a head may be from the room's origin, in metres.
const FARTHEST_M: f64 = 1_000.0;
/// How far a quaternion's length may be from 1: what is farther off is no orientation.
const LENGTH_TOLERANCE: f64 = 0.1;

/// What a tracker measured, in its own frame and unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawPose {
    /// In the tracker's unit.
    pub position: [f64; 3],
    /// A unit quaternion x, y, z, w: turns the body's axes into the tracker's.
    pub orientation: [f64; 4],
}

/// How a head is followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HeadState {
    /// Nothing was measured yet.
    #[default]
    Waiting,
    /// It is where the tracker says.
    Tracked,
    /// Nothing was measured since. It stays where it was.
    Lost {
        /// The last measurement.
        since_us: i64,
    },
}

/// Why a measurement is no pose.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum BadPose {
    /// NaN or infinity.
    #[error("a pose with numbers that are not finite: {0:?}")]
    NotFinite(RawPose),
    /// Not an orientation.
    #[error("a pose whose quaternion is {0} long, not 1")]
    NotUnit(f64),
    /// Not in any room.
    #[error("a head {0:.0} m from the room's origin: is `unit_m` right?")]
    TooFar(f64),
}

/// What happened to a head.
#[derive(Clone, Debug, PartialEq)]
pub enum HeadEvent {
    /// It is tracked now: for the first time, or again.
    Found,
    /// It was not measured for [`LOST_AFTER_US`].
    Lost,
    /// It was measured where it cannot be; it stays where it was.
    JumpRefused {
        /// How far from where it was, in metres.
        distance_m: f64,
        /// How fast it would have been, in metres a second.
        speed_m_s: f64,
    },
    /// It was measured there for [`JUMP_PERSISTS_US`]: so it is there.
    JumpAccepted {
        /// How far from where it was, in metres.
        distance_m: f64,
    },
    /// No pose: it stays where it was.
    Bad(BadPose),
}

/// A place that is too far away to be believed at once.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    /// Since when no measurement was believed.
    doubted_us: i64,
    since_us: i64,
    at_us: i64,
    position_m: DVec3,
}

/// The last measurement that was believed.
#[derive(Clone, Copy, Debug)]
struct Good {
    at_us: i64,
    position_m: DVec3,
}

/// One tracked head.
#[derive(Clone, Debug)]
pub struct Head {
    to_room: ToRoom,
    state: HeadState,
    position: OneEuro,
    orientation: OneEuroRotation,
    good: Option<Good>,
    candidate: Option<Candidate>,
    motion: Option<Motion>,
}

impl Head {
    /// A head that nothing has measured.
    #[must_use]
    pub fn new(to_room: ToRoom, smoothing: Smoothing) -> Self {
        Self {
            to_room,
            state: HeadState::Waiting,
            position: OneEuro::new(smoothing),
            orientation: OneEuroRotation::new(smoothing),
            good: None,
            candidate: None,
            motion: None,
        }
    }

    /// How it is followed.
    #[must_use]
    pub fn state(&self) -> HeadState {
        self.state
    }

    /// Its motion as last believed; `None` only while waiting.
    #[must_use]
    pub fn motion(&self) -> Option<Motion> {
        self.motion
    }

    /// Takes what was measured at `at_us`. Measurements that are not later than the last are left out. What is
    /// not a pose is never believed, however long it lasts.
    pub fn measure(&mut self, at_us: i64, raw: &RawPose) -> Option<HeadEvent> {
        let (position_m, orientation) = match self.checked(raw) {
            Ok(pose) => pose,
            Err(bad) => return Some(HeadEvent::Bad(bad)),
        };
        let Some(good) = self.good else {
            return self.believe(at_us, position_m, orientation);
        };
        let latest_us = self
            .candidate
            .map_or(good.at_us, |there| there.at_us.max(good.at_us));
        if at_us <= latest_us {
            return None;
        }
        let from_good_m = position_m.distance(good.position_m);
        let speed_m_s = from_good_m / seconds(good.at_us, at_us);
        let Some(candidate) = self.candidate else {
            if speed_m_s <= SPEED_LIMIT_M_S {
                return self.believe(at_us, position_m, orientation);
            }
            return Some(self.doubt(at_us, position_m, from_good_m, speed_m_s));
        };
        let from_candidate_m = position_m.distance(candidate.position_m);
        let stays = from_candidate_m / seconds(candidate.at_us, at_us) <= SPEED_LIMIT_M_S;
        let counts_us = at_us.saturating_sub(candidate.doubted_us).min(RETURN_US);
        let judged_us = candidate.doubted_us.saturating_add(counts_us);
        let is_near = from_good_m / seconds(good.at_us, judged_us) <= SPEED_LIMIT_M_S;
        // Where both are near, the nearer place wins.
        let returns = is_near && !(stays && from_candidate_m < from_good_m);
        if returns {
            self.believe(at_us, position_m, orientation)
        } else if !stays {
            Some(self.doubt(at_us, position_m, from_good_m, speed_m_s))
        } else if at_us.saturating_sub(candidate.since_us) >= JUMP_PERSISTS_US {
            self.forget_motion();
            self.believe(at_us, position_m, orientation);
            Some(HeadEvent::JumpAccepted {
                distance_m: from_good_m,
            })
        } else {
            self.candidate = Some(Candidate {
                at_us,
                position_m,
                ..candidate
            });
            None
        }
    }

    /// Lets time go on: a head that is not measured is lost.
    pub fn advance(&mut self, now_us: i64) -> Option<HeadEvent> {
        let good = self.good?;
        let silent_us = now_us.saturating_sub(good.at_us);
        if self.state != HeadState::Tracked || silent_us < LOST_AFTER_US {
            return None;
        }
        self.state = HeadState::Lost {
            since_us: good.at_us,
        };
        Some(HeadEvent::Lost)
    }

    fn checked(&self, raw: &RawPose) -> Result<(DVec3, DQuat), BadPose> {
        let numbers = raw.position.iter().chain(&raw.orientation);
        if !numbers.into_iter().all(|number| number.is_finite()) {
            return Err(BadPose::NotFinite(*raw));
        }
        let length = DQuat::from_array(raw.orientation).length();
        if !(1.0 - LENGTH_TOLERANCE..=1.0 + LENGTH_TOLERANCE).contains(&length) {
            return Err(BadPose::NotUnit(length));
        }
        let (position_m, orientation) = self.to_room.head(raw);
        let distance_m = position_m.length();
        if !(0.0..=FARTHEST_M).contains(&distance_m) {
            return Err(BadPose::TooFar(distance_m));
        }
        Ok((position_m, orientation))
    }

    fn doubt(
        &mut self,
        at_us: i64,
        position_m: DVec3,
        distance_m: f64,
        speed_m_s: f64,
    ) -> HeadEvent {
        self.candidate = Some(Candidate {
            doubted_us: self.candidate.map_or(at_us, |before| before.doubted_us),
            since_us: at_us,
            at_us,
            position_m,
        });
        HeadEvent::JumpRefused {
            distance_m,
            speed_m_s,
        }
    }

    fn believe(&mut self, at_us: i64, position_m: DVec3, orientation: DQuat) -> Option<HeadEvent> {
        let gap_us = self.good.map_or(0, |good| at_us.saturating_sub(good.at_us));
        if gap_us > FILTER_FORGETS_US {
            self.forget_motion();
        }
        self.candidate = None;
        self.good = Some(Good { at_us, position_m });
        self.motion = Some(Motion {
            measured_us: at_us,
            position_m: self.position.filter(at_us, position_m),
            orientation: self.orientation.filter(at_us, orientation),
            velocity_m_s: self.position.velocity(),
            turning_rad_s: self.orientation.velocity(),
        });
        let before = std::mem::replace(&mut self.state, HeadState::Tracked);
        (before != HeadState::Tracked).then_some(HeadEvent::Found)
    }

    fn forget_motion(&mut self) {
        self.position.reset();
        self.orientation.reset();
    }
}

fn seconds(from_us: i64, to_us: i64) -> f64 {
    (to_us.saturating_sub(from_us) as f64 * 1e-6).max(SHORTEST_STEP_S)
}
