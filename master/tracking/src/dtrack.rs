//! DTrack's packets: text over UDP. In: one packet. Out: its bodies and flysticks, or the reason why it is
//! refused, as a whole. No sockets, no clock.
//!
//! The format is that of "DTrack2 User's Manual", ART, appendix B.2 (lines `fr`, `ts`, `6d`, `6di`, `6df`, `6df2`)
//! and B.1.5 (flysticks); `6dcal` as DTrack's settings list it. Positions are millimetres. The nine numbers of
//! a rotation are its matrix column by column, so the first three are the body's x axis in the room. The
//! manual advises against the angles; they are read over. Lines with other identifiers are left alone.

mod scan;

use glam::{DMat3, DQuat, DVec3};
use thiserror::Error;

use crate::head::RawPose;
use scan::Line;

/// Largest packet: what UDP over IPv4 can carry.
pub const LARGEST_PACKET_BYTES: usize = 65_507;
/// Most bodies, or flysticks, in a line.
pub const MOST_BODIES: usize = 256;
/// Most buttons of a flystick.
pub const MOST_BUTTONS: usize = 64;
/// Most controllers (axes of joysticks) of a flystick.
pub const MOST_CONTROLLERS: usize = 16;
/// Buttons that the old format `6df` has room for.
const OLD_BUTTONS: usize = 8;
/// Buttons in one number.
const BUTTONS_IN_A_NUMBER: usize = 32;
/// How far a rotation's numbers, of six digits, may be from a rotation.
const ROTATION_TOLERANCE: f64 = 0.01;

/// What a packet tells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Packet {
    /// Number of the frame.
    pub frame: u32,
    /// Seconds since midnight UTC on the controller's clock; `None` where its output is off.
    pub stamp_s: Option<f64>,
    /// How many bodies are calibrated; `None` where its output is off.
    pub calibrated: Option<u32>,
    /// Standard bodies, of lines `6d` and `6di`. In `6d` those that are not tracked are missing.
    pub bodies: Vec<Body>,
    /// Flysticks, of lines `6df` and `6df2`.
    pub flysticks: Vec<Flystick>,
}

/// A standard body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// From 0.
    pub id: u32,
    /// Whether it is tracked: quality ≥ 0 (`6d`), status > 0 (`6di`).
    pub tracked: bool,
    /// In millimetres.
    pub position_mm: [f64; 3],
    /// Column by column.
    pub rotation: [f64; 9],
}

/// A flystick.
#[derive(Clone, Debug, PartialEq)]
pub struct Flystick {
    /// Where it is. Not tracked where its target is hidden; its buttons are right even then.
    pub body: Body,
    /// Whether each is pressed, at most [`MOST_BUTTONS`].
    pub buttons: Vec<bool>,
    /// −1…1, at most [`MOST_CONTROLLERS`]; none in the old format `6df`.
    pub controllers: Vec<f64>,
}

/// Why a packet is refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PacketError {
    /// Longer than UDP can carry.
    #[error("a packet of {0} bytes, more than {LARGEST_PACKET_BYTES}")]
    TooLong(usize),
    /// Bytes that are no text.
    #[error("byte {0} is no ASCII text: this is no DTrack packet")]
    NotText(usize),
    /// The first line is not `fr`.
    #[error("the first line is no frame counter `fr`: this is no DTrack packet")]
    NoFrame,
    /// A number is missing or is none.
    #[error("line {line} (`{identifier}`): {text:?} is no number that could stand there")]
    BadNumber {
        /// From 1.
        line: usize,
        /// The line's identifier.
        identifier: String,
        /// What stands there.
        text: String,
    },
    /// More bodies, buttons or controllers than there can be.
    #[error("line {line} (`{identifier}`): {count} of them, more than {most}")]
    TooMany {
        /// From 1.
        line: usize,
        /// The line's identifier.
        identifier: String,
        /// How many it announces.
        count: u32,
        /// How many there can be.
        most: usize,
    },
    /// A block `[…]` is missing or has another number of numbers.
    #[error("line {line} (`{identifier}`): a block `[…]` of {wanted} numbers is missing")]
    BadBlock {
        /// From 1.
        line: usize,
        /// The line's identifier.
        identifier: String,
        /// How many numbers it should have.
        wanted: usize,
    },
    /// Text after the last block.
    #[error("line {line} (`{identifier}`): more than it announces")]
    Surplus {
        /// From 1.
        line: usize,
        /// The line's identifier.
        identifier: String,
    },
    /// Nine numbers that are no rotation.
    #[error("body {id}: its nine numbers are no rotation (determinant {determinant:.3})")]
    NotRotation {
        /// Its number.
        id: u32,
        /// Of the matrix.
        determinant: f64,
    },
}

impl Body {
    /// Position in millimetres and orientation. An error where the nine numbers are no rotation.
    pub fn pose(&self) -> Result<RawPose, PacketError> {
        let matrix = DMat3::from_cols_array(&self.rotation);
        let off = matrix.transpose() * matrix - DMat3::IDENTITY;
        let determinant = matrix.determinant();
        let columns = [off.x_axis, off.y_axis, off.z_axis];
        let is_rotation = columns
            .iter()
            .all(|column| column.abs().cmple(DVec3::splat(ROTATION_TOLERANCE)).all())
            && determinant > 0.0;
        if !is_rotation {
            return Err(PacketError::NotRotation {
                id: self.id,
                determinant,
            });
        }
        Ok(RawPose {
            position: self.position_mm,
            orientation: DQuat::from_mat3(&matrix).normalize().to_array(),
        })
    }
}

/// Reads a packet.
pub fn parse(packet: &[u8]) -> Result<Packet, PacketError> {
    if packet.len() > LARGEST_PACKET_BYTES {
        return Err(PacketError::TooLong(packet.len()));
    }
    // Some senders count C's final zero in.
    let packet = packet.strip_suffix(b"\0").unwrap_or(packet);
    let is_text = |byte: &u8| matches!(byte, b'\t' | b'\r' | b'\n' | b' '..=b'~');
    if let Some(place) = packet.iter().position(|byte| !is_text(byte)) {
        return Err(PacketError::NotText(place));
    }
    let text =
        std::str::from_utf8(packet).map_err(|error| PacketError::NotText(error.valid_up_to()))?;
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(index, text)| Line::new(index + 1, text));
    let mut first = lines
        .next()
        .filter(|line| line.identifier == "fr")
        .ok_or(PacketError::NoFrame)?;
    let mut read = Packet {
        frame: first.whole()?,
        ..Packet::default()
    };
    first.end()?;
    for mut line in lines {
        match line.identifier {
            "ts" => read.stamp_s = Some(line.number()?),
            "6dcal" => read.calibrated = Some(line.whole()?),
            "6d" => bodies(&mut line, &mut read.bodies)?,
            "6di" => inertial_bodies(&mut line, &mut read.bodies)?,
            "6df" => old_flysticks(&mut line, &mut read.flysticks)?,
            "6df2" => flysticks(&mut line, &mut read.flysticks)?,
            _ => continue,
        }
        line.end()?;
    }
    Ok(read)
}

/// `6d n`, then n times `[id qu][sx sy sz η θ φ][b0 … b8]`.
fn bodies(line: &mut Line<'_>, bodies: &mut Vec<Body>) -> Result<(), PacketError> {
    for _ in 0..line.count(MOST_BODIES)? {
        let [id, quality] = line.block()?;
        bodies.push(body(line, id, quality >= 0.0, true)?);
    }
    Ok(())
}

/// `6di n`, then n times `[id st er][sx sy sz][b0 … b8]`; a status of 0 is not tracked.
fn inertial_bodies(line: &mut Line<'_>, bodies: &mut Vec<Body>) -> Result<(), PacketError> {
    for _ in 0..line.count(MOST_BODIES)? {
        let [id, status, _drift_deg] = line.block()?;
        bodies.push(body(line, id, status > 0.0, false)?);
    }
    Ok(())
}

/// `6df n`, then n times `[id qu bt][sx sy sz η θ φ][b0 … b8]`. The upper four bits stand for the directions of
/// the joystick of some flysticks and for buttons of others, so they are handed on as bits.
fn old_flysticks(line: &mut Line<'_>, flysticks: &mut Vec<Flystick>) -> Result<(), PacketError> {
    for _ in 0..line.count(MOST_BODIES)? {
        let [id, quality, bits] = line.block()?;
        let body = body(line, id, quality >= 0.0, true)?;
        let bits = line.as_bits(bits)?;
        flysticks.push(Flystick {
            body,
            buttons: (0..OLD_BUTTONS)
                .map(|button| bits >> button & 1 == 1)
                .collect(),
            controllers: Vec::new(),
        });
    }
    Ok(())
}

/// `6df2 defined n`, then n times `[id qu nbt nct][sx sy sz][b0 … b8][bt0 … ct0 ct1 …]`, with one bt for every 32
/// buttons.
fn flysticks(line: &mut Line<'_>, flysticks: &mut Vec<Flystick>) -> Result<(), PacketError> {
    line.count(MOST_BODIES)?;
    for _ in 0..line.count(MOST_BODIES)? {
        let [id, quality, buttons, controllers] = line.block()?;
        let buttons = line.as_count(buttons, MOST_BUTTONS)?;
        let controllers = line.as_count(controllers, MOST_CONTROLLERS)?;
        let body = body(line, id, quality >= 0.0, false)?;
        let words = buttons.div_ceil(BUTTONS_IN_A_NUMBER);
        let mut values = line.block_of(words + controllers)?.into_iter();
        let mut pressed = Vec::with_capacity(buttons);
        for word in values.by_ref().take(words) {
            let bits = line.as_bits(word)?;
            pressed.extend((0..BUTTONS_IN_A_NUMBER).map(|button| bits >> button & 1 == 1));
        }
        pressed.truncate(buttons);
        flysticks.push(Flystick {
            body,
            buttons: pressed,
            controllers: values.collect(),
        });
    }
    Ok(())
}

/// The blocks of position, with or without angles, and rotation.
fn body(line: &mut Line<'_>, id: f64, tracked: bool, angles: bool) -> Result<Body, PacketError> {
    let id = line.as_whole(id)?;
    let position_mm = if angles {
        let [x, y, z, _, _, _] = line.block()?;
        [x, y, z]
    } else {
        line.block()?
    };
    Ok(Body {
        id,
        tracked,
        position_mm,
        rotation: line.block()?,
    })
}
