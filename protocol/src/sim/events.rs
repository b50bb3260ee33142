//! What the simulated world is made of: randomness, conditions, events, and the record of what happened.

use crate::barrier::{LeaveReason, NodeId};
use crate::clock::ClockSample;
use crate::message::{Hello, Swap, View};

/// Repeatable random numbers (S. Vigna, SplitMix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Evenly within 0…1.
    pub(crate) fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Evenly within a range.
    pub(crate) fn within(&mut self, low: i64, high: i64) -> i64 {
        low + (self.share() * (high - low) as f64) as i64
    }

    pub(super) fn exponential(&mut self, mean: f64) -> i64 {
        (-(1.0 - self.share()).ln() * mean) as i64
    }
}

/// How bad the world is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Conditions {
    pub(crate) nodes: usize,
    pub(crate) fps: f64,
    pub(crate) loss: f64,
    pub(crate) delay_us: i64,
    pub(crate) jitter_us: f64,
    pub(crate) draw_us: (i64, i64),
    /// Share of drawings that take twenty times as long.
    pub(crate) hiccups: f64,
}

#[derive(Clone, Debug)]
pub(super) enum What {
    // To a node.
    Welcome,
    Refused { retry_after_ms: Option<u32> },
    View(Box<View>),
    Swap(Swap),
    Pong(ClockSample),
    Drawn { epoch: u32, frame: u64 },
    PresentDue(Swap),
    PingDue,
    // To the master.
    Hello(Box<Hello>),
    Ping { sent_us: i64 },
    Ready { epoch: u32, frame: u64 },
    Presented { presented_us: i64, slack_us: i64 },
    LinkLost,
    Tick,
    // To the world.
    Kill,
    Start,
    Stall { until_us: i64 },
}

/// Whom an event is for. A node's process number changes when it is restarted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    World { node: Option<NodeId> },
    Master { node: NodeId, process: u32 },
    Node { node: NodeId, process: u32 },
}

/// What happened, for the proofs.
#[derive(Default)]
pub(crate) struct History {
    /// (frame, epoch, decided at, presented at, first ready at, master was held up).
    pub(crate) swaps: Vec<SwapRecord>,
    /// (node, process, frame, true time, error of the node's clock then, its bound).
    pub(crate) presented: Vec<PresentedRecord>,
    pub(crate) entered: Vec<(NodeId, i64)>,
    pub(crate) left: Vec<(NodeId, i64, LeaveReason)>,
    pub(crate) missed: Vec<(NodeId, u64)>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct SwapRecord {
    pub(crate) swap: Swap,
    pub(crate) decided_us: i64,
    pub(crate) first_ready_us: Option<i64>,
    pub(crate) master_stalled: bool,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct PresentedRecord {
    pub(crate) node: NodeId,
    pub(crate) process: u32,
    pub(crate) frame: u64,
    pub(crate) at_us: i64,
    pub(crate) clock_error_us: i64,
    pub(crate) clock_bound_us: i64,
}
