//! The clock: error within its bound under jitter, asymmetry, loss and drift; time that never jumps; and
//! the grid of presentation times.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use proptest::prelude::*;
use protocol::clock::{ClockEstimate, ClockSample};
use protocol::pacing::{Grid, Lead, SHORTEST_LEAD_US};

/// A node and a master whose clocks drift, joined by a network.
struct Pair {
    estimate: ClockEstimate,
    offset_us: f64,
    drift: f64,
    random: u64,
}

impl Pair {
    fn new(offset_us: f64, drift: f64, seed: u64) -> Self {
        Self {
            estimate: ClockEstimate::new(),
            offset_us,
            drift,
            random: seed | 1,
        }
    }

    fn share(&mut self) -> f64 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        (self.random >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// The node's clock at a moment of the master's.
    fn node_us(&self, master_us: f64) -> i64 {
        (master_us * (1.0 + self.drift) - self.offset_us).round() as i64
    }

    /// A ping that leaves at a moment of the master's clock.
    fn ping(&mut self, at_us: f64, there_us: f64, back_us: f64, jitter_us: f64) -> f64 {
        let there_us = there_us - jitter_us * (1.0 - self.share()).ln();
        let back_us = back_us - jitter_us * (1.0 - self.share()).ln();
        let sample = ClockSample {
            node_sent_us: self.node_us(at_us),
            master_received_us: (at_us + there_us).round() as i64,
            master_sent_us: (at_us + there_us + 10.0).round() as i64,
            node_received_us: self.node_us(at_us + there_us + 10.0 + back_us),
        };
        self.estimate.add(sample);
        at_us + there_us + 10.0 + back_us
    }

    /// Error and its bound at a moment of the master's clock.
    fn error(&self, at_us: f64) -> (f64, f64) {
        let node_us = self.node_us(at_us);
        let error_us = (self.estimate.master_us(node_us) as f64 - at_us).abs();
        (error_us, self.estimate.error_us(node_us) as f64)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_error_stays_within_its_bound(
        offset_us in -1e12..1e12_f64, drift in -100e-6..100e-6_f64, seed: u64,
        there_us in 20.0..3000.0_f64, back_us in 20.0..3000.0_f64, jitter_us in 0.0..5000.0_f64, loss in 0.0..0.9_f64,
    ) {
        let mut pair = Pair::new(offset_us, drift, seed);
        let mut at_us = 1e9;
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..400 {
            if pair.share() >= loss {
                at_us = pair.ping(at_us, there_us, back_us, jitter_us);
            }
            if pair.estimate.is_ready() {
                let (error_us, bound_us) = pair.error(at_us);
                prop_assert!(error_us <= bound_us + 2.0, "{error_us} {bound_us}");
                // Estimated time runs on, and at the right speed within 0.1 %.
                let now = (at_us, pair.estimate.master_us(pair.node_us(at_us)) as f64);
                if let Some((then, estimated)) = before {
                    let passed = now.0 - then;
                    let error: f64 = (now.1 - estimated) - passed;
                    prop_assert!(error.abs() <= passed * 1.2e-3 + 3.0, "{error} in {passed}");
                }
                before = Some(now);
            }
            at_us += pair.estimate.ping_interval_us() as f64;
        }
        // Long after the last ping the bound still holds.
        for later_us in [1e6, 1e7, 1e8] {
            let (error_us, bound_us) = pair.error(at_us + later_us);
            prop_assert!(error_us <= bound_us + 2.0, "{error_us} {bound_us} after {later_us}");
        }
        // The way back is the inverse.
        let master_us = at_us as i64 + 16_667;
        let there_and_back = pair.estimate.master_us(pair.estimate.node_us(master_us));
        prop_assert!((there_and_back - master_us).abs() <= 1, "{}", there_and_back - master_us);
    }
}

#[test]
fn on_an_ordinary_network_clocks_agree_within_a_tenth_of_a_millisecond() {
    for seed in 1..50 {
        let mut pair = Pair::new(123_456_789.0, 37e-6, seed);
        let mut at_us = 1e9;
        let mut worst_us: f64 = 0.0;
        for ping in 0..300 {
            at_us = pair.ping(at_us, 100.0, 100.0, 300.0) + pair.estimate.ping_interval_us() as f64;
            if ping > 100 {
                worst_us = worst_us.max(pair.error(at_us).0);
            }
        }
        assert!(worst_us < 100.0, "seed {seed}: {worst_us}");
        assert!(pair.error(at_us).1 < 400.0, "bound {}", pair.error(at_us).1);
    }
}

#[test]
fn a_master_with_another_clock_is_followed_at_once() {
    let mut pair = Pair::new(0.0, 0.0, 5);
    let mut at_us = 1e9;
    for _ in 0..50 {
        at_us = pair.ping(at_us, 100.0, 100.0, 10.0) + 100_000.0;
    }
    for offset_us in [7_000_000.0, -7_000_000.0] {
        pair.offset_us = offset_us;
        for _ in 0..3 {
            at_us = pair.ping(at_us, 100.0, 100.0, 10.0) + 100_000.0;
        }
        assert!(pair.error(at_us).0 < 100.0, "{:?}", pair.error(at_us));
    }
}

#[test]
fn pings_that_contradict_themselves_are_ignored() {
    let mut estimate = ClockEstimate::new();
    assert_eq!(estimate.error_us(0), i64::MAX);
    for [a, b, c, d] in [
        [10, 0, 0, 5],
        [0, 9, 5, 20],
        [0, 0, 30, 20],
        [i64::MAX, 0, 0, i64::MIN],
    ] {
        let [
            node_sent_us,
            master_received_us,
            master_sent_us,
            node_received_us,
        ] = [a, b, c, d];
        estimate.add(ClockSample {
            node_sent_us,
            master_received_us,
            master_sent_us,
            node_received_us,
        });
    }
    assert!(estimate.round_trip_us().is_none());
    assert!(!estimate.is_ready());
}

proptest! {
    #[test]
    fn ticks_are_a_grid(start_us in -1e15..1e15_f64, fps in 1.0..240.0_f64, after_us in 0..1e13 as i64) {
        let grid = Grid::new(start_us as i64, fps);
        let moment_us = start_us as i64 + after_us;
        let number = grid.number_at(moment_us);
        prop_assert!(grid.tick_us(number) >= moment_us);
        prop_assert!(grid.tick_us(number - 1) < moment_us);
        let step_us = grid.tick_us(number + 1) - grid.tick_us(number);
        prop_assert!((step_us - grid.period_us()).abs() <= 1);
        prop_assert!(number >= 0);
    }
}

#[test]
fn the_grid_does_not_drift() {
    let grid = Grid::new(0, 60.0);
    assert_eq!(grid.tick_us(60 * 3600), 3_600_000_000);
    assert_eq!(Grid::new(0, f64::NAN).period_us(), 1_000_000);
    assert_eq!(Grid::new(0, 1e9).period_us(), 4_167);
}

#[test]
fn the_lead_follows_the_network() {
    let grid = Grid::new(0, 60.0);
    let mut lead = Lead::new(&grid);
    // A network that needs 200 µs: slack is the lead less that.
    for _ in 0..20_000 {
        lead.reported(lead.lead_us() - 200);
    }
    assert!(
        (SHORTEST_LEAD_US..=950).contains(&lead.lead_us()),
        "{}",
        lead.lead_us()
    );
    // One that suddenly needs 5 ms is followed within a second of eight nodes' reports.
    for _ in 0..8 * 60 {
        lead.reported(lead.lead_us() - 5_000);
    }
    assert!(
        (5_000..=6_000).contains(&lead.lead_us()),
        "{}",
        lead.lead_us()
    );
    // It never exceeds half a period.
    for _ in 0..10_000 {
        lead.reported(-1_000_000);
    }
    assert!(lead.lead_us() <= grid.period_us() / 2);
}
