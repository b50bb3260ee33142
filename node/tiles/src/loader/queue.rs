//! What is to be loaded next: callers' wish lists, priorities, single flight, failures and their patience.
//! In: wishes, outcomes, the time. Out: the next tile to load, or how long to wait. No I/O, no clock, no
//! threads.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap, HashSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::dataset::DatasetId;
use crate::ram::Key;

/// Attempts before a tile is reported as failed.
pub(super) const ATTEMPTS: u32 = 4;
/// The wait after the first failed attempt; four times as long after each further one.
const FIRST_PAUSE: Duration = Duration::from_millis(50);
/// The wait between attempts once a tile is reported as failed.
const LONG_PAUSE: Duration = Duration::from_secs(10);

/// The queue.
#[derive(Default)]
pub(super) struct Queue {
    lists: HashMap<u64, Vec<(Key, f32)>>,
    wished: HashSet<Key>,
    heap: BinaryHeap<Candidate>,
    in_flight: HashSet<Key>,
    failures: HashMap<Key, Failure>,
    arrived: HashSet<Key>,
}

struct Failure {
    attempts: u32,
    again_at: Instant,
    reason: Arc<str>,
}

struct Candidate {
    key: Key,
    priority: f32,
}

/// What a worker is to do.
#[derive(Debug, PartialEq)]
pub(super) enum Next {
    /// Load this tile.
    Load(Key),
    /// Wait for wishes, at most until then.
    Wait(Option<Instant>),
}

impl Queue {
    /// Replaces a caller's list. `held` says which tiles need no loading.
    pub(super) fn replace(
        &mut self,
        caller: u64,
        wants: impl Iterator<Item = (Key, f32)>,
        held: impl Fn(&Key) -> bool,
    ) {
        let list = self.lists.entry(caller).or_default();
        list.clear();
        list.extend(wants);
        if list.is_empty() {
            self.lists.remove(&caller);
        }
        let mut best: HashMap<Key, f32> = HashMap::new();
        for (key, priority) in self.lists.values().flatten() {
            let priority = if priority.is_nan() {
                f32::NEG_INFINITY
            } else {
                *priority
            };
            let known = best.entry(*key).or_insert(priority);
            *known = known.max(priority);
        }
        self.wished.clear();
        self.wished.extend(best.keys());
        let open = best
            .into_iter()
            .filter(|(key, _)| !held(key) && !self.in_flight.contains(key));
        self.heap = open
            .map(|(key, priority)| Candidate { key, priority })
            .collect();
        // A short patience is for tiles that are still wanted; others start anew when they are.
        self.failures
            .retain(|key, failure| failure.attempts >= ATTEMPTS || self.wished.contains(key));
    }

    /// Whether any list holds the tile.
    pub(super) fn is_wished(&self, key: &Key) -> bool {
        self.wished.contains(key)
    }

    /// How many tiles are being loaded.
    pub(super) fn in_flight(&self) -> usize {
        self.in_flight.len()
    }

    /// The tile to load next, which is then in flight.
    pub(super) fn next(&mut self, now: Instant) -> Next {
        let mut resting = Vec::new();
        let mut next = None;
        while let Some(candidate) = self.heap.pop() {
            match self.failures.get(&candidate.key) {
                Some(failure) if failure.again_at > now => resting.push(candidate),
                _ => {
                    self.in_flight.insert(candidate.key);
                    next = Some(candidate.key);
                    break;
                }
            }
        }
        let times = resting
            .iter()
            .filter_map(|c| Some(self.failures.get(&c.key)?.again_at));
        let earliest = times.min();
        self.heap.extend(resting);
        next.map_or(Next::Wait(earliest), Next::Load)
    }

    /// A tile arrived; true for the first time ever.
    pub(super) fn done(&mut self, key: Key) -> bool {
        self.in_flight.remove(&key);
        self.failures.remove(&key);
        self.arrived.insert(key)
    }

    /// A tile could not be loaded. Tells how often that was so, in a row.
    pub(super) fn failed(&mut self, key: Key, reason: Arc<str>, now: Instant) -> u32 {
        self.in_flight.remove(&key);
        let attempts = self
            .failures
            .get(&key)
            .map_or(0, |failure| failure.attempts)
            + 1;
        let pause = if attempts < ATTEMPTS {
            FIRST_PAUSE * 4_u32.pow(attempts - 1)
        } else {
            LONG_PAUSE
        };
        self.failures.insert(
            key,
            Failure {
                attempts,
                again_at: now + pause,
                reason,
            },
        );
        if self.wished.contains(&key) {
            let lists = self.lists.values().flatten();
            let priorities = lists
                .filter(|(other, _)| *other == key)
                .map(|(_, priority)| *priority);
            let priority = priorities.fold(f32::NEG_INFINITY, f32::max);
            self.heap.push(Candidate { key, priority });
        }
        attempts
    }

    /// A tile came back, but of data that are no longer current: it is to be loaded again.
    pub(super) fn outdated(&mut self, key: Key) {
        self.in_flight.remove(&key);
        if self.wished.contains(&key) {
            self.heap.push(Candidate {
                key,
                priority: f32::INFINITY,
            });
        }
    }

    /// Why a tile is given up for the time being.
    pub(super) fn failure(&self, key: &Key) -> Option<Arc<str>> {
        let failure = self.failures.get(key)?;
        (failure.attempts >= ATTEMPTS).then(|| Arc::clone(&failure.reason))
    }

    /// How many tiles are given up for the time being.
    pub(super) fn failures(&self) -> usize {
        self.failures
            .values()
            .filter(|failure| failure.attempts >= ATTEMPTS)
            .count()
    }

    /// Forgets the failures of a data set that was changed.
    pub(super) fn forget(&mut self, dataset: DatasetId) {
        self.failures.retain(|key, _| key.0 != dataset);
    }

    /// True where nothing is in flight and all that waits has been given up.
    pub(super) fn is_idle(&self) -> bool {
        self.in_flight.is_empty() && self.heap.iter().all(|c| self.failure(&c.key).is_some())
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Candidate {
    /// Ties go to the coarser tile, then to the lower key, so that the order never depends on chance.
    fn cmp(&self, other: &Self) -> Ordering {
        let urgency = self.priority.total_cmp(&other.priority);
        let (ours, theirs) = ((self.key.1, self.key.0), (other.key.1, other.key.0));
        urgency.then_with(|| theirs.cmp(&ours))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use geodesy::Tile;
    use proptest::prelude::*;

    fn key(n: u32) -> Key {
        static ID: std::sync::OnceLock<DatasetId> = std::sync::OnceLock::new();
        (
            *ID.get_or_init(DatasetId::random),
            Tile::new(1, 9, n, 0).unwrap(),
        )
    }

    fn wish(queue: &mut Queue, caller: u64, wants: &[(u32, f32)]) {
        queue.replace(
            caller,
            wants.iter().map(|(n, priority)| (key(*n), *priority)),
            |_| false,
        );
    }

    #[test]
    fn by_priority_each_once_and_cancelled_when_no_longer_wished() {
        let (mut queue, now) = (Queue::default(), Instant::now());
        wish(
            &mut queue,
            0,
            &[(1, 1.0), (2, 3.0), (3, 2.0), (4, f32::NAN), (2, 0.5)],
        );
        assert_eq!(queue.next(now), Next::Load(key(2)));
        assert_eq!(queue.next(now), Next::Load(key(3)));
        wish(&mut queue, 0, &[(2, 9.0), (4, f32::NAN), (5, 0.0)]);
        wish(&mut queue, 1, &[(4, 7.0)]);
        // 2 is in flight, 1 is cancelled, and 4 counts as the second caller wants it.
        assert_eq!(queue.next(now), Next::Load(key(4)));
        assert_eq!(queue.next(now), Next::Load(key(5)));
        assert_eq!(queue.next(now), Next::Wait(None));
        assert!(!queue.is_idle());
        for n in 2..=5 {
            queue.done(key(n));
        }
        assert!(queue.is_idle());
    }

    #[test]
    fn patience_grows_then_gives_up_then_tries_rarely() {
        let (mut queue, mut now) = (Queue::default(), Instant::now());
        wish(&mut queue, 0, &[(1, 1.0)]);
        for attempt in 1..=ATTEMPTS {
            assert_eq!(queue.next(now), Next::Load(key(1)));
            assert!(queue.failure(&key(1)).is_none());
            assert_eq!(queue.failed(key(1), "why".into(), now), attempt);
            let Next::Wait(Some(again)) = queue.next(now) else {
                panic!("it must rest")
            };
            let pause = if attempt < ATTEMPTS {
                FIRST_PAUSE * 4_u32.pow(attempt - 1)
            } else {
                LONG_PAUSE
            };
            assert_eq!(again, now + pause);
            now = again;
        }
        assert_eq!(&*queue.failure(&key(1)).unwrap(), "why");
        assert!(queue.is_idle() && queue.failures() == 1);
        assert_eq!(queue.next(now), Next::Load(key(1)));
        assert!(queue.done(key(1)) && !queue.done(key(1)));
        assert_eq!(queue.failures(), 0);
    }

    #[test]
    fn a_resting_tile_does_not_hold_others_up() {
        let (mut queue, now) = (Queue::default(), Instant::now());
        wish(&mut queue, 0, &[(1, 9.0)]);
        assert_eq!(queue.next(now), Next::Load(key(1)));
        queue.failed(key(1), "why".into(), now);
        wish(&mut queue, 0, &[(1, 9.0), (2, 1.0)]);
        assert_eq!(queue.next(now), Next::Load(key(2)));
        assert!(matches!(queue.next(now), Next::Wait(Some(_))));
    }

    proptest! {
        #[test]
        fn nothing_is_lost_or_loaded_twice(lists in prop::collection::vec(prop::collection::vec((0_u32..20, 0.0_f32..9.0), 0..10), 1..20)) {
            let (mut queue, now) = (Queue::default(), Instant::now());
            let mut flying: Vec<Key> = Vec::new();
            for (round, list) in lists.iter().enumerate() {
                wish(&mut queue, (round % 3) as u64, list);
                if let Next::Load(next) = queue.next(now) {
                    prop_assert!(queue.is_wished(&next) && !flying.contains(&next));
                    flying.push(next);
                }
                if round % 4 == 3 && let Some(key) = flying.pop() {
                    queue.done(key);
                }
            }
            while let Next::Load(next) = queue.next(now) {
                prop_assert!(!flying.contains(&next));
                flying.push(next);
            }
            for key in flying {
                queue.done(key);
            }
            prop_assert!(queue.is_idle());
        }
    }
}
