//! How long to wait for a late node: learned from how far apart the nodes become ready.
//! In: when nodes were ready. Out: a deadline, and by how much a node was late.

use std::collections::VecDeque;

/// Least deadline in microseconds: nobody leaves for what a scheduler does.
const SHORTEST_DEADLINE_US: i64 = 30_000;
/// Frames before the deadline adapts; until then it is the longest.
const FRAMES_TO_LEARN: u32 = 16;
/// Share of the spread that is remembered from frame to frame.
const MEMORY: f64 = 0.98;
/// Frames of which it is remembered when the first node was ready.
const REMEMBERED_FRAMES: usize = 64;

/// What is known of how far apart the nodes become ready.
#[derive(Clone, Debug)]
pub(super) struct Patience {
    longest_us: i64,
    period_us: i64,
    /// When the first node was ready for each of the last frames.
    first_ready: VecDeque<(u64, i64)>,
    /// Decaying maximum of the time between the first and the last node.
    spread_us: f64,
    learned: u32,
}

impl Patience {
    pub(super) fn new(longest_us: i64, period_us: i64) -> Self {
        let longest_us = longest_us.max(1);
        let first_ready = VecDeque::with_capacity(REMEMBERED_FRAMES + 1);
        Self {
            longest_us,
            period_us,
            first_ready,
            spread_us: 0.0,
            learned: 0,
        }
    }

    /// The deadline for a node without strikes: twice the usual spread and two periods.
    pub(super) fn deadline_us(&self) -> i64 {
        if self.learned < FRAMES_TO_LEARN {
            return self.longest_us;
        }
        let wanted_us = 2 * self.spread_us as i64 + 2 * self.period_us;
        wanted_us.clamp(SHORTEST_DEADLINE_US.min(self.longest_us), self.longest_us)
    }

    /// A frame's first node is ready.
    pub(super) fn first_ready(&mut self, frame: u64, now_us: i64) {
        self.first_ready.push_back((frame, now_us));
        if self.first_ready.len() > REMEMBERED_FRAMES {
            self.first_ready.pop_front();
        }
    }

    /// How long after the first node another one is ready for a frame; `None` if that was too long ago
    /// to be in time by any deadline.
    pub(super) fn lateness_us(&self, frame: u64, now_us: i64) -> Option<i64> {
        let mut newest_first = self.first_ready.iter().rev();
        let (_, first_us) = newest_first.find(|(number, _)| *number == frame)?;
        Some(now_us.saturating_sub(*first_us)).filter(|late_us| *late_us <= self.longest_us)
    }

    /// The last node was ready this long after the first.
    pub(super) fn learn(&mut self, spread_us: i64) {
        self.spread_us = (self.spread_us * MEMORY).max(spread_us as f64);
        self.learned = self.learned.saturating_add(1);
    }
}
