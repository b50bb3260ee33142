//! What the barrier remembers of a node and of the frame in flight. Plain data.

/// A connected node.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Node {
    /// It is waited for.
    pub(super) member: bool,
    /// It is waited for from the next frame on.
    pub(super) entering: bool,
    /// It has drawn the frame in flight.
    pub(super) ready: bool,
    /// Deadlines missed in a row.
    pub(super) strikes: u32,
}

/// Where the barrier is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Phase {
    /// Between frames.
    Resting { begin_at_us: i64 },
    /// A view is out.
    InFlight {
        begun_us: i64,
        first_ready_us: Option<i64>,
        resend_at_us: i64,
        resend_interval_us: i64,
        /// Set once the master has overslept a deadline.
        grace_until_us: Option<i64>,
    },
}
