//! One clock for all nodes: a node's estimate of the master's clock from pings.
//! In: the four times of each ping (D. Mills, RFC 5905 §8). Out: the master's time for a moment of the
//! node's clock and back, with a bound of the error. It reads no clock.
//!
//! A ping tells two truths: it left before the master received it, and the answer arrived after the
//! master sent it. So the offset (master − node) lies within
//! [master sent − node received, master received − node sent]. All pings of the last seconds together
//! leave a narrow corridor (K. Marzullo, 1984): its lower side comes from the fastest answer and its upper side
//! from the fastest ping, whichever pings they were. Older pings count with a margin for drift, which
//! is itself estimated from the pings with the least round trip. The estimate moves towards the
//! corridor's middle at a bounded rate, so that time never jumps or runs backwards.

use std::collections::VecDeque;

/// Pings that are remembered.
const WINDOW: usize = 128;
/// Age at which a ping is forgotten.
const WINDOW_US: i64 = 20_000_000;
/// How far two quartz clocks may drift apart, as a share: ±100 ppm each.
const DRIFT_BOUND: f64 = 200e-6;
/// What remains uncertain of an estimated drift: temperature changes.
const DRIFT_RESIDUE: f64 = 1e-6;
/// Shortest span from which drift is estimated.
const DRIFT_SPAN_US: i64 = 2_000_000;
/// Fastest correction, as a share of time.
const SLEW: f64 = 500e-6;
/// Span over which a difference is corrected.
const SLEW_SPAN_US: f64 = 250_000.0;
/// Difference above which the estimate jumps: the master's clock is another one.
const STEP_US: f64 = 20_000.0;
/// Pings until the estimate is good enough to present by.
const PINGS_TO_TRUST: usize = 4;

/// The four times of a ping in microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockSample {
    /// The node's clock when the ping left.
    pub node_sent_us: i64,
    /// The master's clock when it arrived.
    pub master_received_us: i64,
    /// The master's clock when the answer left.
    pub master_sent_us: i64,
    /// The node's clock when the answer arrived.
    pub node_received_us: i64,
}

impl ClockSample {
    /// Time on the way, both ways together, in microseconds.
    #[must_use]
    pub fn round_trip_us(&self) -> i64 {
        (self.node_received_us.saturating_sub(self.node_sent_us))
            .saturating_sub(self.master_sent_us.saturating_sub(self.master_received_us))
    }

    fn lowest_us(&self) -> i64 {
        self.master_sent_us.saturating_sub(self.node_received_us)
    }

    fn highest_us(&self) -> i64 {
        self.master_received_us.saturating_sub(self.node_sent_us)
    }

    fn is_sane(&self) -> bool {
        self.node_received_us >= self.node_sent_us
            && self.master_sent_us >= self.master_received_us
            && self.round_trip_us() >= 0
    }
}

/// The line that turns the node's clock into the master's.
#[derive(Clone, Copy, Debug)]
struct Line {
    /// A moment of the node's clock.
    anchor_us: i64,
    /// Offset (master − node) at the anchor, as applied.
    offset_us: f64,
    /// Drift of the offset, as a share of time.
    rate: f64,
    /// What is still to be corrected after the anchor.
    remaining_us: f64,
    /// Half width of the corridor at the anchor.
    half_width_us: f64,
    /// How fast that grows, as a share of time.
    rate_error: f64,
}

/// A node's estimate of the master's clock.
#[derive(Clone, Debug, Default)]
pub struct ClockEstimate {
    samples: VecDeque<ClockSample>,
    line: Option<Line>,
    added: usize,
}

impl ClockEstimate {
    /// Nothing is known yet: the master's clock counts as the node's.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a ping. One whose times contradict each other is ignored.
    pub fn add(&mut self, sample: ClockSample) {
        if !sample.is_sane() {
            return;
        }
        let now_us = sample.node_received_us;
        if self
            .samples
            .back()
            .is_some_and(|last| now_us < last.node_received_us)
        {
            // The node's clock was set back: what is remembered is about another clock.
            self.samples.clear();
        }
        self.samples.push_back(sample);
        self.added = self.added.saturating_add(1);
        while self.samples.len() > WINDOW
            || self
                .samples
                .front()
                .is_some_and(|old| now_us - old.node_received_us > WINDOW_US)
        {
            self.samples.pop_front();
        }
        let (rate, rate_error) = self.drift();
        let (middle_us, half_width_us) = self.corridor(now_us, rate, rate_error);
        let before_us = self.line.map(|line| line.offset_at(now_us));
        let difference = before_us.map(|before_us| middle_us - before_us);
        let (offset_us, remaining_us) = match (before_us, difference) {
            (Some(before_us), Some(difference)) if difference.abs() <= STEP_US => {
                (before_us, difference)
            }
            _ => (middle_us, 0.0),
        };
        self.line = Some(Line {
            anchor_us: now_us,
            offset_us,
            rate,
            remaining_us,
            half_width_us,
            rate_error,
        });
    }

    /// Whether there were enough pings to present by this clock.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.added >= PINGS_TO_TRUST
    }

    /// How long to wait until the next ping, in microseconds: a quick burst first, then ten a second.
    #[must_use]
    pub fn ping_interval_us(&self) -> i64 {
        if self.added < 2 * PINGS_TO_TRUST {
            5_000
        } else {
            100_000
        }
    }

    /// The master's clock at a moment of the node's clock.
    #[must_use]
    pub fn master_us(&self, node_us: i64) -> i64 {
        let offset = self.line.map_or(0.0, |line| line.offset_at(node_us));
        node_us.saturating_add(offset.round() as i64)
    }

    /// The node's clock at a moment of the master's clock. The inverse of
    /// [`ClockEstimate::master_us`] within a microsecond.
    #[must_use]
    pub fn node_us(&self, master_us: i64) -> i64 {
        let Some(line) = self.line else {
            return master_us;
        };
        // The offset changes by less than 0.1 % of time: three rounds are exact.
        let mut node_us = master_us.saturating_sub(line.offset_us.round() as i64);
        for _ in 0..3 {
            node_us = master_us.saturating_sub(line.offset_at(node_us).round() as i64);
        }
        node_us
    }

    /// Bound of the error of [`ClockEstimate::master_us`] at a moment of the node's clock, provided that
    /// the two clocks drift by less than 200 ppm; `i64::MAX` before the first ping.
    #[must_use]
    pub fn error_us(&self, node_us: i64) -> i64 {
        let Some(line) = self.line else {
            return i64::MAX;
        };
        let age_us = node_us.abs_diff(line.anchor_us) as f64;
        let uncorrected = (line.remaining_us - line.corrected(node_us)).abs();
        (line.half_width_us + uncorrected + line.rate_error * age_us).ceil() as i64
    }

    /// Least round trip of the remembered pings in microseconds.
    #[must_use]
    pub fn round_trip_us(&self) -> Option<i64> {
        self.samples.iter().map(ClockSample::round_trip_us).min()
    }

    /// Drift of the offset and its uncertainty, from the fastest ping of each half of the window.
    fn drift(&self) -> (f64, f64) {
        let unknown = (0.0, DRIFT_BOUND);
        let half = self.samples.len() / 2;
        let fastest = |samples: &mut dyn Iterator<Item = &ClockSample>| {
            samples.min_by_key(|sample| sample.round_trip_us()).copied()
        };
        let older = fastest(&mut self.samples.iter().take(half));
        let newer = fastest(&mut self.samples.iter().skip(half));
        let (Some(older), Some(newer)) = (older, newer) else {
            return unknown;
        };
        let span_us = newer.node_received_us - older.node_received_us;
        if span_us < DRIFT_SPAN_US {
            return unknown;
        }
        let middle = |sample: &ClockSample| {
            0.5 * (sample.lowest_us().saturating_add(sample.highest_us())) as f64
        };
        let width_us = 0.5 * (older.round_trip_us().saturating_add(newer.round_trip_us())) as f64;
        let rate = (middle(&newer) - middle(&older)) / span_us as f64;
        let error = width_us / span_us as f64 + DRIFT_RESIDUE;
        if error >= DRIFT_BOUND || rate.abs() > 2.0 * DRIFT_BOUND {
            unknown
        } else {
            (rate, error)
        }
    }

    /// Middle and half width of what all pings allow for the offset at `now_us`. If they contradict each
    /// other, the clock was set: older ones are dropped until they agree.
    fn corridor(&mut self, now_us: i64, rate: f64, rate_error: f64) -> (f64, f64) {
        loop {
            let (mut lowest, mut highest) = (f64::NEG_INFINITY, f64::INFINITY);
            for sample in &self.samples {
                let age_us = (now_us - sample.node_received_us) as f64;
                let margin = rate_error * age_us;
                lowest = lowest.max(sample.lowest_us() as f64 + rate * age_us - margin);
                // The upper side was true a round trip earlier than the lower one.
                let age_us = (now_us - sample.node_sent_us) as f64;
                let margin = rate_error * age_us;
                highest = highest.min(sample.highest_us() as f64 + rate * age_us + margin);
            }
            if lowest <= highest + 1.0 || self.samples.len() <= 1 {
                return (
                    0.5 * (lowest + highest),
                    (0.5 * (highest - lowest)).max(0.5),
                );
            }
            self.samples.drain(..self.samples.len().div_ceil(2));
        }
    }
}

impl Line {
    /// Offset (master − node) at a moment of the node's clock.
    fn offset_at(&self, node_us: i64) -> f64 {
        let age_us = node_us.saturating_sub(self.anchor_us) as f64;
        self.offset_us + self.rate * age_us + self.corrected(node_us)
    }

    /// What of the difference has been corrected by then.
    fn corrected(&self, node_us: i64) -> f64 {
        let age_us = node_us.saturating_sub(self.anchor_us).max(0) as f64;
        let speed = (self.remaining_us / SLEW_SPAN_US).clamp(-SLEW, SLEW);
        let done = speed * age_us;
        if done.abs() >= self.remaining_us.abs() {
            self.remaining_us
        } else {
            done
        }
    }
}
