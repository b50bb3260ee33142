//! What the trackers of a wall are. In: what the wall file says of them. Out: checked configurations. It
//! connects to nothing.

use std::fmt;
use std::net::SocketAddr;

use thiserror::Error;

use crate::head::Head;
use crate::one_euro::Smoothing;
use crate::room::{Axes, Body, RoomError, ToRoom};

/// Longest latency that is believed, in milliseconds.
const LONGEST_LATENCY_MS: f64 = 1_000.0;
/// Highest cutoff frequency and speed coefficient.
const HIGHEST_CUTOFF_HZ: f64 = 1_000.0;
/// Most trackers of a wall.
const MOST_TRACKERS: usize = 64;

/// Where measurements come from.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Source {
    /// A device on a VRPN server.
    Vrpn {
        /// The device: VRPN's sender name, for example `DTrack`.
        device: String,
        /// The server's name or address.
        host: String,
        /// Its port, usually [`crate::vrpn::DEFAULT_PORT`].
        port: u16,
    },
    /// DTrack packets.
    Dtrack {
        /// The address to listen on, for example `0.0.0.0:5000`.
        listen: String,
    },
}

impl fmt::Display for Source {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Vrpn { device, host, port } => write!(formatter, "{device}@{host}:{port}"),
            Self::Dtrack { listen } => write!(formatter, "{listen}"),
        }
    }
}

/// A tracker: one body, and how it becomes a head.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackerConfig {
    /// Unique among the trackers.
    pub name: String,
    /// Where measurements come from. Trackers may share it.
    pub source: Source,
    /// Sensor (VRPN) or standard body (DTrack).
    pub body: u32,
    /// The tracker's origin and axes in the room.
    pub to_room: Axes,
    /// Metres in a unit of the tracker, > 0: 1 for VRPN, 0.001 for DTrack.
    pub unit_m: f64,
    /// From the body to the middle between the eyes.
    pub to_head: Body,
    /// The one-euro filter.
    pub smoothing: Smoothing,
    /// How old a measurement is when it arrives, in milliseconds, 0…1000.
    pub latency_ms: f64,
}

/// Why the trackers of a wall are refused.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// More than anybody has.
    #[error("{0} trackers: at most {MOST_TRACKERS} are followed")]
    TooMany(usize),
    /// Two of a name.
    #[error("two trackers are called `{0}`: give each its own name")]
    Duplicate(String),
    /// Axes, unit or offset.
    #[error("tracker `{tracker}`: {error}")]
    Room {
        /// Its name.
        tracker: String,
        /// What is wrong.
        error: RoomError,
    },
    /// A filter that cannot be.
    #[error("tracker `{tracker}`: `smoothing.{key}` is {value}: give a number {range}")]
    Smoothing {
        /// Its name.
        tracker: String,
        /// The key.
        key: &'static str,
        /// What it says.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// A latency that cannot be.
    #[error("tracker `{tracker}`: `latency_ms` is {value}: give 0 to {LONGEST_LATENCY_MS}")]
    Latency {
        /// Its name.
        tracker: String,
        /// What it says.
        value: f64,
    },
    /// Not an address to listen on.
    #[error(
        "tracker `{tracker}`: `{listen}` is no address to listen on: write for example `0.0.0.0:5000`"
    )]
    Listen {
        /// Its name.
        tracker: String,
        /// What it says.
        listen: String,
    },
    /// A VRPN device without a name or a host.
    #[error(
        "tracker `{tracker}`: `{source_text}` is no VRPN device: write `DEVICE@HOST` or `DEVICE@HOST:PORT`"
    )]
    Device {
        /// Its name.
        tracker: String,
        /// What it says.
        source_text: String,
    },
}

impl TrackerConfig {
    /// The head that this tracker moves, checked.
    pub fn head(&self) -> Result<Head, ConfigError> {
        let tracker = || self.name.clone();
        let to_room = ToRoom::new(&self.to_room, self.unit_m, &self.to_head).map_err(|error| {
            ConfigError::Room {
                tracker: tracker(),
                error,
            }
        })?;
        let Smoothing {
            minimum_cutoff_hz,
            speed_coefficient,
        } = self.smoothing;
        if !(minimum_cutoff_hz > 0.0 && minimum_cutoff_hz <= HIGHEST_CUTOFF_HZ) {
            return Err(ConfigError::Smoothing {
                tracker: tracker(),
                key: "minimum_cutoff_hz",
                value: minimum_cutoff_hz,
                range: "above 0, at most 1000",
            });
        }
        if !(0.0..=HIGHEST_CUTOFF_HZ).contains(&speed_coefficient) {
            return Err(ConfigError::Smoothing {
                tracker: tracker(),
                key: "speed_coefficient",
                value: speed_coefficient,
                range: "from 0 to 1000",
            });
        }
        if !(0.0..=LONGEST_LATENCY_MS).contains(&self.latency_ms) {
            return Err(ConfigError::Latency {
                tracker: tracker(),
                value: self.latency_ms,
            });
        }
        Ok(Head::new(to_room, self.smoothing))
    }

    /// In microseconds.
    pub(crate) fn latency_us(&self) -> i64 {
        (self.latency_ms.clamp(0.0, LONGEST_LATENCY_MS) * 1e3) as i64
    }

    pub(crate) fn check_source(&self) -> Result<(), ConfigError> {
        match &self.source {
            Source::Vrpn { device, host, .. } => {
                if device.is_empty()
                    || host.is_empty()
                    || device.len() > crate::vrpn::LONGEST_NAME_BYTES
                {
                    return Err(ConfigError::Device {
                        tracker: self.name.clone(),
                        source_text: self.source.to_string(),
                    });
                }
            }
            Source::Dtrack { listen } => {
                if listen.parse::<SocketAddr>().is_err() {
                    return Err(ConfigError::Listen {
                        tracker: self.name.clone(),
                        listen: listen.clone(),
                    });
                }
            }
        }
        Ok(())
    }
}

/// Checks what is wrong only among several.
pub(crate) fn check_all(trackers: &[TrackerConfig]) -> Result<(), ConfigError> {
    if trackers.len() > MOST_TRACKERS {
        return Err(ConfigError::TooMany(trackers.len()));
    }
    for (index, tracker) in trackers.iter().enumerate() {
        tracker.check_source()?;
        if trackers
            .iter()
            .skip(index + 1)
            .any(|other| other.name == tracker.name)
        {
            return Err(ConfigError::Duplicate(tracker.name.clone()));
        }
    }
    Ok(())
}
