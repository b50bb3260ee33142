//! Whether a repository can be reached, learnt from what happened to requests.
//!
//! In: outcomes, moments. Out: whether to ask at all, and when to probe. It must not wait, look at a clock or
//! send anything. While it is open nobody waits for a server that does not answer: requests fail at once, and
//! one probe at a time, with growing pauses, finds out when the server is back.

use std::time::{Duration, Instant};

use crate::backoff::bound;

/// However long a server asks to be left alone, it is looked at again after this.
const LONGEST_HOLD: Duration = Duration::from_secs(300);

/// When a breaker opens and how often it probes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rules {
    /// Failures in a row that open it, at least 1.
    pub(crate) give_up_after: u32,
    /// The first pause before a probe; later ones double.
    pub(crate) first_probe: Duration,
    /// The longest such pause.
    pub(crate) longest_probe: Duration,
}

/// What is known of a repository.
#[derive(Debug)]
pub(crate) struct Breaker {
    rules: Rules,
    since: Instant,
    openings: u64,
    state: State,
}

#[derive(Debug, PartialEq, Eq)]
enum State {
    /// Requests may be sent; so many failed in a row.
    Closed { failures: u32 },
    /// No requests but a probe, from this moment on; so many probes failed.
    Open { probe_at: Instant, probes: u32 },
}

impl Breaker {
    /// Closed.
    pub(crate) fn new(rules: Rules, now: Instant) -> Self {
        Self {
            rules,
            since: now,
            openings: 0,
            state: State::Closed { failures: 0 },
        }
    }

    /// Whether requests may be sent.
    pub(crate) fn is_closed(&self) -> bool {
        matches!(self.state, State::Closed { .. })
    }

    /// Since when it is as it is.
    pub(crate) fn since(&self) -> Instant {
        self.since
    }

    /// Notes an answer of the server, whatever it says; true if that closes the breaker.
    pub(crate) fn succeeded(&mut self, now: Instant) -> bool {
        let closes = !self.is_closed();
        self.state = State::Closed { failures: 0 };
        if closes {
            self.since = now;
        }
        closes
    }

    /// Notes a failure of a request that was not a probe. `hold` is for how long the server asked to be left alone,
    /// if that is too long to wait for. `random` (0…1) spreads the probes of many clients. Returns the number of
    /// the opening if this opens the breaker; its probing is the caller's duty then.
    pub(crate) fn failed(
        &mut self,
        now: Instant,
        hold: Option<Duration>,
        random: f64,
    ) -> Option<u64> {
        let State::Closed { failures } = &mut self.state else {
            // It was sent before the breaker opened.
            return None;
        };
        *failures = failures.saturating_add(1);
        if hold.is_none() && *failures < self.rules.give_up_after {
            return None;
        }
        self.since = now;
        self.openings += 1;
        self.state = State::Open {
            probe_at: now + self.rules.pause(0, hold, random),
            probes: 0,
        };
        Some(self.openings)
    }

    /// How long until the next probe of an opening; `None` once that opening is over.
    pub(crate) fn until_probe(&self, now: Instant, opening: u64) -> Option<Duration> {
        match self.state {
            State::Open { probe_at, .. } if self.openings == opening => {
                Some(probe_at.saturating_duration_since(now))
            }
            _ => None,
        }
    }

    /// Notes that a probe failed too.
    pub(crate) fn probe_failed(&mut self, now: Instant, hold: Option<Duration>, random: f64) {
        if let State::Open { probe_at, probes } = &mut self.state {
            *probes = probes.saturating_add(1);
            *probe_at = now + self.rules.pause(*probes, hold, random);
        }
    }
}

impl Rules {
    /// Between half of the pause and all of it, so that probes neither follow at once nor come in step.
    fn pause(&self, probes: u32, hold: Option<Duration>, random: f64) -> Duration {
        let pause = bound(
            probes.saturating_add(1),
            self.first_probe,
            self.longest_probe,
        );
        let pause = pause.mul_f64(0.5 + 0.5 * random.clamp(0.0, 1.0));
        pause.max(hold.unwrap_or_default().min(LONGEST_HOLD))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use proptest::prelude::*;

    const RULES: Rules = Rules {
        give_up_after: 3,
        first_probe: Duration::from_millis(500),
        longest_probe: Duration::from_secs(4),
    };

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    #[test]
    fn single_failures_leave_it_closed() {
        let start = Instant::now();
        let mut breaker = Breaker::new(RULES, start);
        for k in 0..100 {
            assert_eq!(breaker.failed(start + ms(k), None, 0.5), None);
            assert_eq!(breaker.failed(start + ms(k), None, 0.5), None);
            assert!(!breaker.succeeded(start + ms(k)));
            assert!(breaker.is_closed());
        }
        assert_eq!(breaker.since(), start);
    }

    #[test]
    fn failures_in_a_row_open_it_and_probes_come_ever_more_rarely() {
        let start = Instant::now();
        let mut breaker = Breaker::new(RULES, start);
        let mut now = start + ms(70);
        assert_eq!(breaker.failed(now, None, 1.0), None);
        assert_eq!(breaker.failed(now, None, 1.0), None);
        let opening = breaker.failed(now, None, 1.0).unwrap();
        assert!(!breaker.is_closed());
        assert_eq!(breaker.since(), now);
        // What was under way when it opened opens it no second time.
        assert_eq!(breaker.failed(now, None, 1.0), None);
        let mut pauses = Vec::new();
        for _ in 0..6 {
            let pause = breaker.until_probe(now, opening).unwrap();
            assert_eq!(
                breaker.until_probe(now + pause, opening),
                Some(Duration::ZERO)
            );
            pauses.push(pause.as_millis());
            now += pause + ms(10);
            breaker.probe_failed(now, None, 1.0);
        }
        assert_eq!(pauses, [500, 1_000, 2_000, 4_000, 4_000, 4_000]);
        assert!(breaker.succeeded(now));
        assert!(breaker.is_closed());
        assert_eq!(breaker.since(), now);
        assert_eq!(breaker.until_probe(now, opening), None);
    }

    #[test]
    fn a_late_answer_closes_it_and_the_old_prober_ends() {
        let now = Instant::now();
        let mut breaker = Breaker::new(RULES, now);
        let open =
            |breaker: &mut Breaker| (0..3).find_map(|_| breaker.failed(now, None, 0.0)).unwrap();
        let first = open(&mut breaker);
        assert_eq!(breaker.until_probe(now, first), Some(ms(250)));
        assert!(breaker.succeeded(now));
        let second = open(&mut breaker);
        assert_eq!(breaker.until_probe(now, first), None);
        assert!(breaker.until_probe(now, second).is_some());
    }

    #[test]
    fn a_server_that_asks_for_a_long_rest_gets_it_within_reason() {
        let now = Instant::now();
        let mut breaker = Breaker::new(RULES, now);
        let opening = breaker
            .failed(now, Some(Duration::from_secs(60)), 0.5)
            .unwrap();
        assert_eq!(
            breaker.until_probe(now, opening),
            Some(Duration::from_secs(60))
        );
        breaker.probe_failed(now, Some(Duration::MAX), 0.5);
        assert_eq!(breaker.until_probe(now, opening), Some(LONGEST_HOLD));
    }

    proptest! {
        /// Whatever happens, it is open only after enough failures, and a probe is never further than allowed.
        #[test]
        fn holds_its_rules(events in prop::collection::vec((0_u8..3, 0_u64..3_000, 0.0..1.0), 0..200)) {
            let mut now = Instant::now();
            let mut breaker = Breaker::new(RULES, now);
            let (mut in_a_row, mut opening) = (0, None);
            for (event, wait, random) in events {
                now += ms(wait);
                match event {
                    0 => {
                        prop_assert_eq!(breaker.succeeded(now), opening.is_some());
                        (in_a_row, opening) = (0, None);
                    }
                    1 if opening.is_none() => {
                        in_a_row += 1;
                        opening = breaker.failed(now, None, random);
                        prop_assert_eq!(opening.is_some(), in_a_row >= RULES.give_up_after);
                    }
                    _ => breaker.probe_failed(now, None, random),
                }
                prop_assert_eq!(breaker.is_closed(), opening.is_none());
                if let Some(opening) = opening {
                    prop_assert!(breaker.until_probe(now, opening).unwrap() <= RULES.longest_probe);
                }
            }
        }
    }
}
