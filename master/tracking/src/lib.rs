//! Tracked heads: where viewers are and where they look, from VRPN servers and DTrack packets.
//!
//! In: what trackers send. Out: a [`Snapshot`] that is always there, and heads at a presentation time. It
//! never makes its reader wait, and it knows nothing of walls, screens and frames.
//!
//! The way of a measurement through this crate:
//! 1. [`vrpn::Client`] or [`dtrack::parse`]: bytes in, poses, buttons and analog values out.
//! 2. [`Stamps`]: the tracker's time stamps → moments on this host's clock, without the network's jitter.
//! 3. [`Head`]: the tracker's frame → the room, body → head; jumps and rubbish are refused; the one-euro filter.
//! 4. [`Motion::at`]: where the head is at the presentation time.
//! 5. [`Tracking`]: one task that connects, reads and publishes.
//!
//! Only `run` and `sim` do I/O. Everything else is pure: time enters as microseconds.

pub mod dtrack;
pub mod vrpn;

mod config;
mod event;
mod head;
mod motion;
mod one_euro;
mod room;
mod run;
#[cfg(feature = "sim")]
pub mod sim;
mod stamps;
mod tracking;

pub use config::{ConfigError, Source, TrackerConfig};
pub use event::{Event, MOST_EVENTS, What};
pub use head::{
    BadPose, Head, HeadEvent, HeadState, JUMP_PERSISTS_US, LOST_AFTER_US, RawPose, SPEED_LIMIT_M_S,
};
pub use motion::{HeadPose, LONGEST_PREDICTION_US, Motion};
pub use one_euro::{OneEuro, OneEuroRotation, Smoothing};
pub use room::{Axes, Body, RoomError, ToRoom};
pub use stamps::Stamps;
pub use tracking::{Clock, Device, HeadReport, Snapshot, TrackedHead, Tracking};
