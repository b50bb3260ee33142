//! One connection to a VRPN server. In: the bytes that it sends, and time. Out: messages, and bytes for it. A
//! connection that makes no sense, or is silent, ends with an error; whoever has the socket connects again.

use std::collections::HashMap;
use std::sync::Arc;

use thiserror::Error;

use super::message::{self, Kind, Malformed, Message};
use super::wire::{
    self, COOKIE_BYTES, HEADER_BYTES, Header, LARGEST_BODY_BYTES, SENDER_DESCRIPTION,
    TYPE_DESCRIPTION,
};
use super::{ANALOG_CHANNEL, BUTTON_CHANGE, BUTTON_STATES, PING, PONG, TRACKER_POSE};

/// A server that was silent for this long is asked whether it is there, in microseconds.
pub const PING_AFTER_US: i64 = 1_000_000;
/// A server that was silent for this long is gone, in microseconds.
pub const SILENT_AFTER_US: i64 = 10_000_000;
/// A server must send its cookie within this time.
const COOKIE_WITHIN_US: i64 = 3_000_000;
/// Most names of each kind (`vrpn_CONNECTION_MAX_XLATION_TABLE_SIZE`).
const MOST_NAMES: i32 = 2_000;
/// What this client calls the types; their place is their number.
const OWN_TYPES: [&str; 6] = [
    PING,
    PONG,
    TRACKER_POSE,
    BUTTON_CHANGE,
    BUTTON_STATES,
    ANALOG_CHANNEL,
];
/// Number of [`PING`] in [`OWN_TYPES`].
const OWN_PING: i32 = 0;
/// Number of [`PONG`] in [`OWN_TYPES`].
const OWN_PONG: i32 = 1;

/// Why a connection ends.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ClientError {
    /// No VRPN server, or one of another major version.
    #[error("the peer is no VRPN server of version 07: it begins with {0:?}")]
    Cookie(String),
    /// A peer that accepts and says nothing.
    #[error("the peer sent no VRPN cookie within {} s", COOKIE_WITHIN_US / 1_000_000)]
    NoCookie,
    /// A length that no message has: whatever follows cannot be read.
    #[error(
        "a message of {0} bytes: VRPN's have a header of {HEADER_BYTES} and a body of at most {LARGEST_BODY_BYTES}"
    )]
    Length(u32),
    /// A server that answers no ping.
    #[error("the server was silent for {} s", SILENT_AFTER_US / 1_000_000)]
    Silent,
}

/// One connection to a VRPN server.
#[derive(Debug)]
pub struct Client {
    devices: Vec<Arc<str>>,
    received: Vec<u8>,
    outgoing: Vec<u8>,
    greeted: bool,
    senders: HashMap<i32, Arc<str>>,
    types: HashMap<i32, Kind>,
    sequence: u32,
    connected_us: i64,
    heard_us: i64,
    asked_us: i64,
}

impl Client {
    /// A client of `devices` whose connection was made at `now_us`. Its cookie waits to be sent.
    #[must_use]
    pub fn new(devices: &[Arc<str>], now_us: i64) -> Self {
        Self {
            devices: devices.to_vec(),
            received: Vec::new(),
            outgoing: wire::cookie().to_vec(),
            greeted: false,
            senders: HashMap::new(),
            types: HashMap::new(),
            sequence: 0,
            connected_us: now_us,
            heard_us: now_us,
            asked_us: now_us,
        }
    }

    /// Takes the bytes that are to be sent.
    #[must_use]
    pub fn take_outgoing(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.outgoing)
    }

    /// Takes bytes of the server, cut anywhere, and adds what they tell to `messages`. After an error nothing
    /// more can be read.
    pub fn receive(
        &mut self,
        bytes: &[u8],
        now_us: i64,
        messages: &mut Vec<Message>,
    ) -> Result<(), ClientError> {
        if bytes.is_empty() {
            return Ok(());
        }
        self.heard_us = now_us;
        let mut received = std::mem::take(&mut self.received);
        received.extend_from_slice(bytes);
        let mut rest = received.as_slice();
        if !self.greeted {
            let Some((cookie, after)) = rest.split_first_chunk::<COOKIE_BYTES>() else {
                // A peer that is no VRPN server is told by its first bytes, it may send no more.
                if !wire::cookie().starts_with(rest.get(..14).unwrap_or(rest)) {
                    return Err(ClientError::Cookie(readable(rest)));
                }
                self.received = received;
                return Ok(());
            };
            if !wire::is_compatible(cookie) {
                return Err(ClientError::Cookie(readable(cookie)));
            }
            self.greet(now_us);
            messages.push(Message::Greeted {
                version: readable(cookie.get(..16).unwrap_or(cookie)),
            });
            rest = after;
        }
        while let Some((header, after)) = rest.split_first_chunk::<HEADER_BYTES>() {
            let header = Header::decode(header).map_err(ClientError::Length)?;
            let Some((body, after)) = after.split_at_checked(wire::padded(header.body_bytes))
            else {
                break;
            };
            let body = body.get(..header.body_bytes).unwrap_or(body);
            messages.extend(self.take(&header, body, now_us));
            rest = after;
        }
        self.received = rest.to_vec();
        Ok(())
    }

    /// Lets time go on: asks a silent server whether it is there, and gives up on one that does not answer.
    pub fn advance(&mut self, now_us: i64) -> Result<(), ClientError> {
        if !self.greeted {
            let waited_us = now_us.saturating_sub(self.connected_us);
            return if waited_us < COOKIE_WITHIN_US {
                Ok(())
            } else {
                Err(ClientError::NoCookie)
            };
        }
        let silent_us = now_us.saturating_sub(self.heard_us);
        if silent_us >= SILENT_AFTER_US {
            return Err(ClientError::Silent);
        }
        if silent_us >= PING_AFTER_US && now_us.saturating_sub(self.asked_us) >= PING_AFTER_US {
            self.ping(now_us);
        }
        Ok(())
    }

    /// Names this side's senders and types, and asks whether the devices are there.
    fn greet(&mut self, now_us: i64) {
        self.greeted = true;
        let devices = self.devices.clone();
        for (number, device) in (0..).zip(&devices) {
            self.send(
                now_us,
                number,
                SENDER_DESCRIPTION,
                &wire::description(device),
            );
        }
        for (number, name) in (0..).zip(OWN_TYPES) {
            self.send(now_us, number, TYPE_DESCRIPTION, &wire::description(name));
        }
        self.ping(now_us);
    }

    fn ping(&mut self, now_us: i64) {
        self.asked_us = now_us;
        for (number, _) in (0..).zip(0..self.devices.len()) {
            self.send(now_us, number, OWN_PING, &[]);
        }
    }

    fn send(&mut self, now_us: i64, sender: i32, kind: i32, body: &[u8]) {
        wire::encode(
            &mut self.outgoing,
            now_us,
            sender,
            kind,
            self.sequence,
            body,
        );
        self.sequence = self.sequence.wrapping_add(1);
    }

    fn take(&mut self, header: &Header, body: &[u8], now_us: i64) -> Option<Message> {
        if header.kind < 0 {
            return self.take_description(header, body);
        }
        let kind = *self.types.get(&header.kind)?;
        let sender = Arc::clone(self.senders.get(&header.sender)?);
        match kind {
            Kind::Pose => Some(message::pose(sender, header.stamp_us, body)),
            Kind::Button => Some(message::button(sender, body)),
            Kind::Buttons => Some(message::buttons(sender, body)),
            Kind::Analog => Some(message::analog(sender, body)),
            Kind::Ping => {
                // At most one answer waits: a peer that asks and never reads must not fill the memory.
                if self.outgoing.is_empty() {
                    let own = (0..)
                        .zip(&self.devices)
                        .find(|(_, device)| **device == sender);
                    if let Some((number, _)) = own {
                        self.send(now_us, number, OWN_PONG, &[]);
                    }
                }
                None
            }
            Kind::Pong => None,
        }
    }

    /// Names; of the other messages of the system (a UDP port, logs, a farewell) a client needs none.
    fn take_description(&mut self, header: &Header, body: &[u8]) -> Option<Message> {
        if header.kind != SENDER_DESCRIPTION && header.kind != TYPE_DESCRIPTION {
            return None;
        }
        let named = wire::described(body).filter(|_| (0..MOST_NAMES).contains(&header.sender));
        let Some(name) = named else {
            return Some(Message::Malformed(Malformed::Name(header.sender)));
        };
        if header.kind == SENDER_DESCRIPTION {
            self.senders.insert(header.sender, name.into());
        } else if let Some(kind) = Kind::of(&name) {
            self.types.insert(header.sender, kind);
        } else {
            self.types.remove(&header.sender);
        }
        None
    }
}

/// The beginning of bytes, as text.
fn readable(bytes: &[u8]) -> String {
    let bytes = bytes.get(..COOKIE_BYTES).unwrap_or(bytes);
    let text = String::from_utf8_lossy(bytes);
    text.trim_end_matches('\0').escape_default().to_string()
}
