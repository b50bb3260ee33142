//! The bytes of messages: a version byte, then bincode 2 (variable-length integers, little endian).
//! In: messages. Out: bytes, and back. The only file that knows the encoding. Whatever a peer sends,
//! decoding takes no more memory than the cap of its kind, does not panic, and yields only walls,
//! scenes and views that passed the same checks as those read from files.

use bincode::config::{Configuration, Limit, LittleEndian, Varint};
use serde::Serialize;
use serde::de::DeserializeOwned;
use thiserror::Error;

use crate::config::ConfigError;
use crate::message::{MAX_NEW_TILES, MAX_REASON_BYTES, PROTOCOL_VERSION, ToMaster, ToNode, View};
use crate::wall::{MAX_OBSERVERS, MAX_OUTPUTS};

/// Most bytes of a [`View`]: it fits the smallest QUIC datagram.
pub const MAX_VIEW_BYTES: usize = 1100;
/// Most bytes of a message that is none of those below.
pub const MAX_CONTROL_BYTES: usize = 64 * 1024;
/// Most bytes of a [`ToNode::Scene`], a [`ToNode::Welcome`] (with its wall) or a
/// [`ToMaster::CaptureRows`].
pub const MAX_LARGE_BYTES: usize = 1024 * 1024;

/// First byte of every message: another version must be refused and not misread.
const VERSION_BYTE: u8 = PROTOCOL_VERSION as u8;

const CONFIGURATION: Configuration<LittleEndian, Varint, Limit<MAX_LARGE_BYTES>> =
    bincode::config::standard().with_limit::<MAX_LARGE_BYTES>();

/// Why a message was not encoded.
#[derive(Debug, Error)]
pub enum EncodeError {
    /// It is larger than its kind may be.
    #[error("a {kind} of {bytes} bytes is over the limit of {limit}; make it smaller")]
    TooLarge {
        /// What it is.
        kind: &'static str,
        /// Its size.
        bytes: usize,
        /// The cap.
        limit: usize,
    },
    /// The encoder refused it.
    #[error("a message cannot be encoded: {0}")]
    Encoder(#[from] bincode::error::EncodeError),
}

/// Why bytes are no message.
#[derive(Debug, Error)]
pub enum DecodeError {
    /// There are no bytes.
    #[error("an empty message")]
    Empty,
    /// The peer speaks another version.
    #[error(
        "the peer speaks protocol version {found}, this program speaks {expected}; install the same version of terrawall on both hosts"
    )]
    Version {
        /// Its version byte.
        found: u8,
        /// This program's.
        expected: u8,
    },
    /// More bytes than the kind may have.
    #[error("a {kind} of {bytes} bytes is over the limit of {limit}")]
    TooLarge {
        /// What it is.
        kind: &'static str,
        /// Its size.
        bytes: usize,
        /// The cap.
        limit: usize,
    },
    /// The bytes are no message of this version.
    #[error("the message cannot be read: {0}")]
    Malformed(#[from] bincode::error::DecodeError),
    /// There are bytes after the message.
    #[error("{0} bytes follow the message")]
    Trailing(usize),
    /// The message can be read, but what it says cannot be.
    #[error("the message makes no sense: {0}")]
    Senseless(&'static str),
    /// The wall or scene in it is not valid.
    #[error("the message holds an invalid configuration: {0}")]
    Invalid(#[from] ConfigError),
}

/// Encodes a view, at most [`MAX_VIEW_BYTES`] bytes.
///
/// # Errors
/// More than 16 heads.
pub fn encode_view(view: &View) -> Result<Vec<u8>, EncodeError> {
    encode(view, "view", MAX_VIEW_BYTES)
}

/// Decodes a view. Its pose is sound and its heads are finite.
///
/// # Errors
/// Anything that no [`encode_view`] of this version wrote.
pub fn decode_view(bytes: &[u8]) -> Result<View, DecodeError> {
    let view: View = decode(bytes, "view", MAX_VIEW_BYTES)?;
    if view.viewers.heads.len() > MAX_OBSERVERS {
        return Err(DecodeError::Senseless("a view of more than 16 heads"));
    }
    if !view.pose.is_sound() {
        return Err(DecodeError::Senseless(
            "a pose whose axes are not orthonormal",
        ));
    }
    if !view.viewers.is_sound() {
        return Err(DecodeError::Senseless(
            "a head that is nowhere, or a wall without pixels",
        ));
    }
    Ok(view)
}

/// Encodes a message to a node, at most [`MAX_LARGE_BYTES`] or [`MAX_CONTROL_BYTES`] bytes.
///
/// # Errors
/// A message over the cap of its kind.
pub fn encode_to_node(message: &ToNode) -> Result<Vec<u8>, EncodeError> {
    let (kind, limit) = to_node_limit(message);
    encode(message, kind, limit)
}

/// Decodes a message to a node. A wall or scene in it is valid.
///
/// # Errors
/// Anything that no [`encode_to_node`] of this version wrote.
pub fn decode_to_node(bytes: &[u8]) -> Result<ToNode, DecodeError> {
    let message: ToNode = decode(bytes, "message to a node", MAX_LARGE_BYTES)?;
    let (kind, limit) = to_node_limit(&message);
    check_size(bytes, kind, limit)?;
    match &message {
        ToNode::Welcome { host, wall } => {
            wall.validate()?;
            if *host as usize >= wall.hosts.len() {
                return Err(DecodeError::Senseless(
                    "a welcome to a host that the wall does not have",
                ));
            }
        }
        ToNode::Wall { wall, .. } => wall.validate()?,
        ToNode::Patterns(patterns) if patterns.len() > MAX_OUTPUTS => {
            return Err(DecodeError::Senseless(
                "patterns for more outputs than a host may have",
            ));
        }
        ToNode::Scene { scene, .. } => scene.validate()?,
        _ => {}
    }
    Ok(message)
}

/// Encodes a message to the master, at most [`MAX_LARGE_BYTES`] or [`MAX_CONTROL_BYTES`] bytes.
///
/// # Errors
/// A message over the cap of its kind.
pub fn encode_to_master(message: &ToMaster) -> Result<Vec<u8>, EncodeError> {
    let (kind, limit) = to_master_limit(message);
    encode(message, kind, limit)
}

/// Decodes a message to the master.
///
/// # Errors
/// Anything that no [`encode_to_master`] of this version wrote.
pub fn decode_to_master(bytes: &[u8]) -> Result<ToMaster, DecodeError> {
    let message: ToMaster = decode(bytes, "message to the master", MAX_LARGE_BYTES)?;
    let (kind, limit) = to_master_limit(&message);
    check_size(bytes, kind, limit)?;
    match &message {
        ToMaster::Counters { news, .. } if news.longest() > MAX_NEW_TILES => Err(
            DecodeError::Senseless("more news of tiles than fit a message"),
        ),
        ToMaster::Steer(steer) => {
            let numbers = [steer.drag, steer.look, [steer.roll, steer.zoom]];
            if numbers.iter().flatten().all(|number| number.is_finite()) {
                Ok(message)
            } else {
                Err(DecodeError::Senseless(
                    "a steering movement that is not finite",
                ))
            }
        }
        ToMaster::CannotPrepare { reason, .. } | ToMaster::CannotMeasure { reason }
            if reason.len() > MAX_REASON_BYTES =>
        {
            Err(DecodeError::Senseless("a reason of more than 2048 bytes"))
        }
        ToMaster::Presented(presented)
            if !(is_length(presented.achieved_tau_px) && is_length(presented.achieved_tile_px)) =>
        {
            Err(DecodeError::Senseless(
                "a frame whose τ or side of tiles is below 0 or not finite",
            ))
        }
        ToMaster::ErrorMeasured(measured)
            if !(is_length(measured.max_px) && is_length(measured.tau_px)) =>
        {
            Err(DecodeError::Senseless(
                "an error or τ that is below 0 or not finite",
            ))
        }
        ToMaster::MoveLens(place)
            if !((-90.0..=90.0).contains(&place.latitude_deg)
                && (-180.0..=180.0).contains(&place.longitude_deg)) =>
        {
            Err(DecodeError::Senseless(
                "a lens that is moved off the planet",
            ))
        }
        _ => Ok(message),
    }
}

/// Whether a number can be a distance in pixels.
fn is_length(pixels: f64) -> bool {
    pixels.is_finite() && pixels >= 0.0
}

fn to_node_limit(message: &ToNode) -> (&'static str, usize) {
    match message {
        ToNode::Scene { .. } => ("scene", MAX_LARGE_BYTES),
        ToNode::Welcome { .. } | ToNode::Wall { .. } => ("wall", MAX_LARGE_BYTES),
        _ => ("message to a node", MAX_CONTROL_BYTES),
    }
}

fn to_master_limit(message: &ToMaster) -> (&'static str, usize) {
    match message {
        ToMaster::CaptureRows(_) => ("piece of a picture", MAX_LARGE_BYTES),
        _ => ("message to the master", MAX_CONTROL_BYTES),
    }
}

fn encode<T: Serialize>(
    value: &T,
    kind: &'static str,
    limit: usize,
) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = vec![VERSION_BYTE];
    bincode::serde::encode_into_std_write(value, &mut bytes, CONFIGURATION)?;
    if bytes.len() > limit {
        return Err(EncodeError::TooLarge {
            kind,
            bytes: bytes.len(),
            limit,
        });
    }
    Ok(bytes)
}

fn decode<T: DeserializeOwned>(
    bytes: &[u8],
    kind: &'static str,
    limit: usize,
) -> Result<T, DecodeError> {
    check_size(bytes, kind, limit)?;
    let (version, payload) = bytes.split_first().ok_or(DecodeError::Empty)?;
    if *version != VERSION_BYTE {
        return Err(DecodeError::Version {
            found: *version,
            expected: VERSION_BYTE,
        });
    }
    let (value, read) = bincode::serde::decode_from_slice(payload, CONFIGURATION)?;
    match payload.len() - read {
        0 => Ok(value),
        rest => Err(DecodeError::Trailing(rest)),
    }
}

fn check_size(bytes: &[u8], kind: &'static str, limit: usize) -> Result<(), DecodeError> {
    if bytes.len() > limit {
        return Err(DecodeError::TooLarge {
            kind,
            bytes: bytes.len(),
            limit,
        });
    }
    Ok(())
}
