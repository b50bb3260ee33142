//! Trackers: what follows heads, and how its measurements become places in the room.
//! Plain data of a wall. It connects to nothing.

use serde::{Deserialize, Serialize};

/// A body that is tracked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tracker {
    /// Unique among the trackers.
    pub name: String,
    /// Where measurements come from.
    pub source: TrackerSource,
    /// Number of the sensor or body.
    pub body: u32,
    /// The tracker's origin and axes in the room.
    pub to_room: Axes,
    /// Metres in a unit of the tracker, > 0.
    pub unit_m: f64,
    /// From the body to the head.
    pub to_head: Body,
    /// How noise is kept from the picture.
    pub smoothing: Smoothing,
    /// How old a measurement is when it arrives, in milliseconds, 0…1000.
    pub latency_ms: f64,
}

/// Where measurements come from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum TrackerSource {
    /// A VRPN server.
    Vrpn {
        /// The device on it.
        device: String,
        /// Its host.
        host: String,
        /// Its port.
        port: u16,
    },
    /// DTrack packets that come to this address and port.
    Dtrack {
        /// For example `0.0.0.0:5000`.
        listen: String,
    },
}

/// Origin and axes of one frame in another: a rotation, right-handed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axes {
    /// Where its origin is, in metres.
    pub origin_m: [f64; 3],
    /// Its x axis, a unit vector.
    pub x: [f64; 3],
    /// Its y axis.
    pub y: [f64; 3],
    /// Its z axis.
    pub z: [f64; 3],
}

impl Default for Axes {
    fn default() -> Self {
        Self {
            origin_m: [0.0; 3],
            x: [1.0, 0.0, 0.0],
            y: [0.0, 1.0, 0.0],
            z: [0.0, 0.0, 1.0],
        }
    }
}

/// Where the head is on a tracked body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Body {
    /// From the body's origin to the middle between the eyes, along the body's axes, in metres.
    pub offset_m: [f64; 3],
    /// How the head is turned on the body, in degrees, as [`super::Observer::looks_deg`].
    pub looks_deg: [f64; 3],
}

/// The one-euro filter (Casiez, Roussel, Vogel 2012).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Smoothing {
    /// Cutoff frequency of a head at rest in hertz, > 0: lower is calmer.
    pub minimum_cutoff_hz: f64,
    /// How fast the cutoff rises with speed, ≥ 0, in hertz a metre a second: higher follows faster.
    pub speed_coefficient: f64,
}

impl Default for Smoothing {
    fn default() -> Self {
        Self {
            minimum_cutoff_hz: 1.0,
            speed_coefficient: 10.0,
        }
    }
}
