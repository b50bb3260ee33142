//! VRPN, the Virtual-Reality Peripheral Network, as a client: cookies, names, poses, buttons, analog values,
//! pings. In: bytes of a server. Out: messages, and bytes to send. No sockets, no clock.
//!
//! Facts about the bytes are from VRPN's public sources (`vrpn_Connection.C`, `vrpn_BaseClass.C`,
//! `vrpn_Tracker.C`, `vrpn_Button.C`, `vrpn_Analog.C`, version 07.35) and from Ryan Pavlik, "VRPN Protocol
//! Details" (`Protocol.md` of vrpn-rs, CC BY 4.0):
//! - Both sides send a cookie of 24 bytes at once: `vrpn: ver. 07.35`, two spaces, a digit for the wanted
//!   logging (`0`: none), zeroes. Up to the last dot it must be the other's.
//! - Then messages: six big-endian words (length, seconds, microseconds, sender, type, sequence number), the
//!   body, zeroes up to a multiple of 8 bytes. The length counts the 24 bytes of the words and the body without
//!   the zeroes.
//! - Types −1 and −2 name a sender and a type: the word of the sender is the number that is named, the body is
//!   the length of the name with its final zero, then the name with its final zero. Numbers are each side's own.
//! - Quaternions are x, y, z, w (quatlib's Q_X = 0 … Q_W = 3). `Protocol.md` lists w first in its general
//!   notes; the library that servers are built with sends x first, and so do the servers.
//!
//! A client that never announces a UDP port (type −3) gets everything over TCP. The connection is made straight to
//! the server's TCP port or, where a server does not listen there, by its call back (see `run`).

mod client;
mod message;
mod wire;

pub use client::{Client, ClientError, PING_AFTER_US, SILENT_AFTER_US};
pub use message::{MOST_BUTTONS, MOST_CHANNELS, Malformed, Message};
pub use wire::{
    COOKIE_BYTES, DEFAULT_PORT, HEADER_BYTES, LARGEST_BODY_BYTES, LONGEST_NAME_BYTES, cookie,
};
#[cfg(feature = "sim")]
pub(crate) use wire::{SENDER_DESCRIPTION, TYPE_DESCRIPTION, description, encode};

/// The name of the type of poses.
pub const TRACKER_POSE: &str = "vrpn_Tracker Pos_Quat";
/// The name of the type of one button's change.
pub const BUTTON_CHANGE: &str = "vrpn_Button Change";
/// The name of the type of all buttons' states.
pub const BUTTON_STATES: &str = "vrpn_Button States";
/// The name of the type of analog values.
pub const ANALOG_CHANNEL: &str = "vrpn_Analog Channel";
/// The name of the type of questions whether one is there.
pub const PING: &str = "vrpn_Base ping_message";
/// The name of the type of their answers.
pub const PONG: &str = "vrpn_Base pong_message";
