//! When is a lease dead? When its content stayed the same for as long as it lasts, on the observer's own clock.
//!
//! In: what was read and when. Out: alive or dead. Nobody compares clocks of two hosts, nor any wall clock, so that
//! clocks may jump. It must not read clocks or files itself: tests run it in virtual time.

use std::collections::HashMap;
use std::hash::Hash;
use std::time::Duration;

/// Above this many entries, those that nobody asked for lately are forgotten.
const CROWDED: usize = 4096;

/// A verdict on something whose holder changes it from time to time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// It may be alive for this much longer.
    Alive {
        /// Until then nothing can be said, unless it changes.
        remaining: Duration,
    },
    /// It did not change for the whole lease.
    Dead {
        /// How many whole leases beyond the first it has been dead: the breakers before may have died, too.
        attempt: u32,
    },
}

#[derive(Debug)]
struct Seen {
    content: Vec<u8>,
    /// When the first reading of this content had ended.
    since: Duration,
    /// When it was asked for last.
    asked: Duration,
}

/// What one process has seen of leases, and since when. Times are on a monotonic clock of its own.
#[derive(Debug)]
pub(crate) struct Watch<K> {
    seen: HashMap<K, Seen>,
}

impl<K> Default for Watch<K> {
    fn default() -> Self {
        Self {
            seen: HashMap::new(),
        }
    }
}

impl<K: Eq + Hash> Watch<K> {
    /// Judges the content that was read between the times `began` and `ended`.
    ///
    /// The content was there at some moment of the first reading and at some moment of this one; what lies surely
    /// between is from the end of the first to the beginning of this one. An observer that was stopped amid a
    /// reading therefore never declares a lease dead that changed meanwhile.
    pub(crate) fn observe(
        &mut self,
        key: K,
        content: &[u8],
        (began, ended): (Duration, Duration),
        lease: Duration,
    ) -> Verdict {
        if self.seen.len() > CROWDED {
            let keep = 4 * lease;
            self.seen
                .retain(|_, seen| ended.saturating_sub(seen.asked) < keep);
            if self.seen.len() > CROWDED {
                // Whoever is forgotten is only found dead later.
                self.seen.clear();
            }
        }
        let seen = self.seen.entry(key).or_insert_with(|| Seen {
            content: content.to_vec(),
            since: ended,
            asked: ended,
        });
        seen.asked = ended;
        if seen.content != content {
            seen.content = content.to_vec();
            seen.since = ended;
        }
        let unchanged = began.saturating_sub(seen.since);
        match lease.checked_sub(unchanged) {
            Some(remaining) if !remaining.is_zero() => Verdict::Alive { remaining },
            _ => {
                let leases = unchanged.as_nanos() / lease.as_nanos().max(1);
                Verdict::Dead {
                    attempt: u32::try_from(leases.saturating_sub(1)).unwrap_or(u32::MAX),
                }
            }
        }
    }

    /// Forgets what is gone.
    pub(crate) fn forget<Q>(&mut self, key: &Q)
    where
        K: std::borrow::Borrow<Q>,
        Q: Eq + Hash + ?Sized,
    {
        self.seen.remove(key);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LEASE: Duration = Duration::from_millis(1000);

    fn at(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn is_dead(verdict: Verdict) -> bool {
        matches!(verdict, Verdict::Dead { .. })
    }

    #[test]
    fn the_first_sight_never_kills() {
        let mut watch = Watch::default();
        let verdict = watch.observe(1, b"x", (at(0), at(90_000)), LEASE);
        assert_eq!(verdict, Verdict::Alive { remaining: LEASE });
    }

    #[test]
    fn an_observer_stopped_amid_its_reading_waits_on() {
        let mut watch = Watch::default();
        watch.observe(1, b"x", (at(0), at(1)), LEASE);
        // It read "x" at once and was then stopped for a minute: nothing is known about that minute.
        let verdict = watch.observe(1, b"x", (at(500), at(60_000)), LEASE);
        assert_eq!(verdict, Verdict::Alive { remaining: at(501) });
        assert_eq!(
            watch.observe(1, b"x", (at(60_001), at(60_001)), LEASE),
            Verdict::Dead { attempt: 59 }
        );
    }

    #[test]
    fn memory_is_bounded() {
        let mut watch = Watch::default();
        for key in 0..20_000_u64 {
            watch.observe(key, b"x", (at(key), at(key)), LEASE);
        }
        assert!(watch.seen.len() <= CROWDED + 1);
    }

    proptest! {
        /// A holder beats every `lease / 4`, late by up to a quarter more, until it dies; observers look at random
        /// moments and take time to read. The observer's clock has its own origin.
        #[test]
        fn the_living_live_and_the_dead_are_found(
            beats in proptest::collection::vec(200..500_u64, 1..40),
            looks in proptest::collection::vec((1..400_u64, 0..60_u64, 0..60_u64), 1..120),
            origin in 0..1_000_000_000_u64,
        ) {
            let mut times = vec![0_u64];
            for beat in beats {
                times.push(times[times.len() - 1] + beat);
            }
            let died = times[times.len() - 1];
            let content = |now: u64| times.iter().filter(|time| **time <= now).count().to_le_bytes();
            let mut watch = Watch::default();
            let mut now = 0;
            let mut last_seen_fresh = None;
            for (pause, before, after) in looks {
                now += pause;
                let (began, read) = (now, now + before);
                now = read + after;
                let verdict = watch.observe(7, &content(read), (at(origin + began), at(origin + now)), LEASE);
                if is_dead(verdict) {
                    prop_assert!(began >= died + 1000, "dead at {began}, and it lived until {died}");
                }
                if read >= died {
                    let first = *last_seen_fresh.get_or_insert(now);
                    prop_assert_eq!(is_dead(verdict), began >= first + 1000);
                }
            }
        }

        /// Two observers agree on nothing but contents; neither kills what beats.
        #[test]
        fn no_schedule_of_observers_kills_a_beating_lease(looks in proptest::collection::vec(1..3000_u64, 1..50)) {
            let mut watch = Watch::default();
            let mut now = 0;
            for pause in looks {
                now += pause;
                let content = (now / 250).to_le_bytes();
                prop_assert!(!is_dead(watch.observe((), &content, (at(now), at(now)), LEASE)));
            }
        }
    }
}
