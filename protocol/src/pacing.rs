//! The moments at which a wall presents: a grid of `fps` ticks a second on the master's clock, and how
//! far ahead of a tick the swap message must leave. In: times, reported slack. Out: ticks, a lead.

/// Shortest lead of a swap message in microseconds.
pub const SHORTEST_LEAD_US: i64 = 800;
/// Lead before anything is known about the network.
const FIRST_LEAD_US: i64 = 3_000;
/// Longest lead; half a period if that is shorter.
const LONGEST_LEAD_US: i64 = 8_000;
/// Slack that a swap message should have left when it arrives.
const WANTED_SLACK_US: i64 = 700;
/// Reports after which the lead may become shorter.
const REPORTS_PER_WINDOW: u32 = 240;

/// The grid of presentation times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    start_us: i64,
    fps: f64,
}

impl Grid {
    /// A grid with a tick at `start_us` and `fps` ticks a second. `fps` is held within 1…240.
    #[must_use]
    pub fn new(start_us: i64, fps: f64) -> Self {
        Self {
            start_us,
            fps: if fps.is_nan() {
                1.0
            } else {
                fps.clamp(1.0, 240.0)
            },
        }
    }

    /// Time between ticks in microseconds, rounded.
    #[must_use]
    pub fn period_us(&self) -> i64 {
        (1e6 / self.fps).round() as i64
    }

    /// The moment of a tick. Computed from the tick's number, so that rounding never adds up.
    #[must_use]
    pub fn tick_us(&self, number: i64) -> i64 {
        self.start_us
            .saturating_add((number as f64 * 1e6 / self.fps).round() as i64)
    }

    /// Number of the first tick at or after a moment.
    #[must_use]
    pub fn number_at(&self, moment_us: i64) -> i64 {
        let passed_us = moment_us.saturating_sub(self.start_us) as f64;
        // Start a little early: the division may round up past the right tick.
        let mut number = (passed_us * self.fps / 1e6).ceil() as i64 - 1;
        while self.tick_us(number) < moment_us {
            number += 1;
        }
        number
    }
}

/// How far ahead of its tick a swap message leaves. It grows at once when messages come too late, and
/// shrinks slowly while all of them come early.
#[derive(Clone, Debug)]
pub struct Lead {
    lead_us: i64,
    longest_us: i64,
    reports: u32,
    least_slack_us: i64,
}

impl Lead {
    /// A lead for a grid.
    #[must_use]
    pub fn new(grid: &Grid) -> Self {
        let longest_us = LONGEST_LEAD_US
            .min(grid.period_us() / 2)
            .max(SHORTEST_LEAD_US);
        let lead_us = FIRST_LEAD_US.min(longest_us);
        Self {
            lead_us,
            longest_us,
            reports: 0,
            least_slack_us: i64::MAX,
        }
    }

    /// The lead in microseconds.
    #[must_use]
    pub fn lead_us(&self) -> i64 {
        self.lead_us
    }

    /// A node's report: how long before the tick the swap message arrived, below 0 if after it.
    pub fn reported(&mut self, slack_us: i64) {
        self.reports += 1;
        self.least_slack_us = self.least_slack_us.min(slack_us);
        if slack_us < 0 {
            // One step a report: a single message that was late by much must not cost every frame.
            let step_us = (WANTED_SLACK_US - slack_us).min(250);
            self.lead_us = (self.lead_us + step_us).min(self.longest_us);
            self.restart();
        } else if self.reports >= REPORTS_PER_WINDOW {
            let spare_us = self.least_slack_us - WANTED_SLACK_US;
            if spare_us > 0 {
                self.lead_us = (self.lead_us - spare_us / 4 - 1).max(SHORTEST_LEAD_US);
            }
            self.restart();
        }
    }

    fn restart(&mut self) {
        self.reports = 0;
        self.least_slack_us = i64::MAX;
    }
}
