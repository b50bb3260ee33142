//! What the barrier is told once and what it answers: options and actions. Plain data.

use super::NodeId;
use crate::message::Swap;

/// How a wall keeps step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BarrierOptions {
    /// Frames a second, 1…240.
    pub fps: f64,
    /// Longest that a late node makes others wait in one frame.
    pub deadline_us: i64,
    /// Deadlines missed in a row after which a node leaves, ≥ 1.
    pub strikes: u32,
    /// After how long a view is repeated to nodes that have not answered, ≥ 1.
    pub resend_us: i64,
}

impl BarrierOptions {
    /// The usual options for a rate: 100 ms, 3 strikes, 25 ms.
    #[must_use]
    pub fn new(fps: f64) -> Self {
        Self {
            fps,
            deadline_us: 100_000,
            strikes: 3,
            resend_us: 25_000,
        }
    }
}

/// What the master has to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// A node is waited for from the next frame on.
    Entered {
        /// The node.
        node: NodeId,
    },
    /// A node is not waited for any longer.
    Left {
        /// The node.
        node: NodeId,
        /// Why.
        reason: LeaveReason,
    },
    /// A member was not ready when its deadline passed.
    Missed {
        /// The node.
        node: NodeId,
        /// The frame.
        frame: u64,
    },
    /// Make the view of a new frame and send it to every connected node.
    BeginFrame {
        /// The epoch of the frame.
        epoch: u32,
        /// Its number; the first is 1.
        frame: u64,
        /// The swap before, to be put into the view.
        previous_swap: Option<Swap>,
        /// The earliest moment at which the frame can be presented: the time to compute its camera for.
        presented_from_us: i64,
    },
    /// Send the view of the current frame again.
    Resend {
        /// The frame.
        frame: u64,
        /// To whom.
        nodes: Vec<NodeId>,
    },
    /// Send the swap to every connected node.
    Swap(Swap),
}

/// Why a node is not waited for any longer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeaveReason {
    /// It missed too many deadlines. It stays connected and may enter again.
    Deadlines,
    /// Its link is gone.
    LinkLost,
}
