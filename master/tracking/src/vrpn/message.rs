//! What VRPN servers tell: poses, buttons, analog values. In: the body of a message and its type's name. Out:
//! the message, or why it is none. It keeps nothing.

use std::sync::Arc;

use thiserror::Error;

use super::wire::Numbers;
use super::{ANALOG_CHANNEL, BUTTON_CHANGE, BUTTON_STATES, PING, PONG, TRACKER_POSE};
use crate::head::RawPose;

/// Most buttons of a device (`vrpn_BUTTON_MAX_BUTTONS`).
pub const MOST_BUTTONS: usize = 256;
/// Most analog values of a device (`vrpn_CHANNEL_MAX`).
pub const MOST_CHANNELS: usize = 128;
/// Length of a pose: sensor, padding, position, quaternion.
const POSE_BYTES: usize = 64;

/// What a server tells.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// It answered with its cookie.
    Greeted {
        /// For example `vrpn: ver. 07.35`.
        version: String,
    },
    /// A sensor was measured.
    Pose {
        /// The device.
        sender: Arc<str>,
        /// Number of the sensor.
        sensor: i32,
        /// On the server's clock; `None` where it stamps nothing.
        stamp_us: Option<i64>,
        /// Where it is and how it is turned.
        pose: RawPose,
    },
    /// One button changed.
    Button {
        /// The device.
        sender: Arc<str>,
        /// Number of the button, less than [`MOST_BUTTONS`].
        button: usize,
        /// Whether it is pressed.
        pressed: bool,
    },
    /// All buttons.
    Buttons {
        /// The device.
        sender: Arc<str>,
        /// Whether each is pressed, at most [`MOST_BUTTONS`].
        pressed: Vec<bool>,
    },
    /// All analog values.
    Analog {
        /// The device.
        sender: Arc<str>,
        /// At most [`MOST_CHANNELS`].
        values: Vec<f64>,
    },
    /// A message that says nothing; the next is read.
    Malformed(Malformed),
}

/// Why a message says nothing.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum Malformed {
    /// A name that is empty, too long, cut off, or not text; or a number that cannot be named.
    #[error("a name of a sender or type that cannot be read (number {0})")]
    Name(i32),
    /// A pose of another length.
    #[error("a pose of {0} bytes instead of {POSE_BYTES}")]
    Pose(usize),
    /// A button that cannot be.
    #[error("a button's change that cannot be read ({0} bytes)")]
    Button(usize),
    /// More buttons than there can be, or fewer than announced.
    #[error("buttons' states that cannot be read ({0} bytes)")]
    Buttons(usize),
    /// More values than there can be, fewer than announced, or values that are not finite.
    #[error("analog values that cannot be read ({0} bytes)")]
    Analog(usize),
}

/// The types that this client knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Pose,
    Button,
    Buttons,
    Analog,
    Ping,
    Pong,
}

impl Kind {
    pub(super) fn of(name: &str) -> Option<Self> {
        match name {
            TRACKER_POSE => Some(Self::Pose),
            BUTTON_CHANGE => Some(Self::Button),
            BUTTON_STATES => Some(Self::Buttons),
            ANALOG_CHANNEL => Some(Self::Analog),
            PING => Some(Self::Ping),
            PONG => Some(Self::Pong),
            _ => None,
        }
    }
}

pub(super) fn pose(sender: Arc<str>, stamp_us: Option<i64>, body: &[u8]) -> Message {
    let read = || {
        let mut numbers = Numbers(body);
        let sensor = numbers.i32()?;
        numbers.i32()?;
        let position = [numbers.f64()?, numbers.f64()?, numbers.f64()?];
        let orientation = [
            numbers.f64()?,
            numbers.f64()?,
            numbers.f64()?,
            numbers.f64()?,
        ];
        let pose = RawPose {
            position,
            orientation,
        };
        numbers.0.is_empty().then_some((sensor, pose))
    };
    match read() {
        Some((sensor, pose)) => Message::Pose {
            sender,
            sensor,
            stamp_us,
            pose,
        },
        None => Message::Malformed(Malformed::Pose(body.len())),
    }
}

pub(super) fn button(sender: Arc<str>, body: &[u8]) -> Message {
    let read = || {
        let mut numbers = Numbers(body);
        let button = usize::try_from(numbers.i32()?).ok()?;
        let pressed = numbers.i32()? != 0;
        (button < MOST_BUTTONS && numbers.0.is_empty()).then_some((button, pressed))
    };
    match read() {
        Some((button, pressed)) => Message::Button {
            sender,
            button,
            pressed,
        },
        None => Message::Malformed(Malformed::Button(body.len())),
    }
}

pub(super) fn buttons(sender: Arc<str>, body: &[u8]) -> Message {
    let read = || {
        let mut numbers = Numbers(body);
        let count = usize::try_from(numbers.i32()?).ok()?;
        if count > MOST_BUTTONS {
            return None;
        }
        (0..count)
            .map(|_| numbers.i32().map(|state| state != 0))
            .collect()
    };
    match read() {
        Some(pressed) => Message::Buttons { sender, pressed },
        None => Message::Malformed(Malformed::Buttons(body.len())),
    }
}

pub(super) fn analog(sender: Arc<str>, body: &[u8]) -> Message {
    let read = || {
        let mut numbers = Numbers(body);
        let count = numbers.f64()?;
        if !(0.0..=MOST_CHANNELS as f64).contains(&count) {
            return None;
        }
        (0..count as usize)
            .map(|_| numbers.f64().filter(|value| value.is_finite()))
            .collect()
    };
    match read() {
        Some(values) => Message::Analog { sender, values },
        None => Message::Malformed(Malformed::Analog(body.len())),
    }
}
