//! What is to be loaded next: callers' wish lists, priorities, single flight, setbacks and their patience.
//! In: wishes, outcomes, the time. Out: the next tile to load, or how long to wait. Tiles that may be wanted soon
//! come after all that are wanted now. No I/O, no clock, no threads.

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
/// The same where the repository cannot be reached: asking it costs nothing, and it may be back at any moment.
const UNREACHABLE_PAUSE: Duration = Duration::from_secs(1);

/// The queue.
#[derive(Default)]
pub(super) struct Queue {
    lists: HashMap<u64, Lists>,
    wished: HashSet<Key>,
    heap: BinaryHeap<Candidate>,
    /// Tiles that are being loaded, and whether only because they may be wanted soon.
    in_flight: HashMap<Key, bool>,
    rests: HashMap<Key, Rest>,
    arrived: HashSet<Key>,
}

/// What a caller wishes for.
#[derive(Default)]
struct Lists {
    now: Vec<(Key, f32)>,
    soon: Vec<(Key, f32)>,
}

/// Why a tile could not be loaded.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Setback {
    /// Another process loads it; it may be there after this time.
    Elsewhere(Duration),
    /// Its repository cannot be reached: nothing is known against the tile, which is waited for however long it takes.
    Unreachable(Arc<str>),
    /// Anything else.
    Failed(Arc<str>),
}

/// A tile that is not to be tried before a moment.
struct Rest {
    attempts: u32,
    /// Its repository could not be reached when it was asked last.
    away: bool,
    again_at: Instant,
    reason: Arc<str>,
}

struct Candidate {
    key: Key,
    /// It may be wanted soon, and is not wanted now.
    soon: bool,
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
    /// Replaces what a caller wants now, or what it may want soon. `held` says which tiles need no loading.
    pub(super) fn replace(
        &mut self,
        (caller, soon): (u64, bool),
        wants: impl Iterator<Item = (Key, f32)>,
        held: impl Fn(&Key) -> bool,
    ) {
        let lists = self.lists.entry(caller).or_default();
        let list = if soon {
            &mut lists.soon
        } else {
            &mut lists.now
        };
        list.clear();
        list.extend(wants);
        if lists.now.is_empty() && lists.soon.is_empty() {
            self.lists.remove(&caller);
        }
        let now = best_of(self.lists.values().flat_map(|lists| &lists.now));
        let mut soon = best_of(self.lists.values().flat_map(|lists| &lists.soon));
        soon.retain(|key, _| !now.contains_key(key));
        self.wished.clear();
        self.wished.extend(now.keys());
        // A short patience is for tiles that are still wanted; others start anew when they are.
        self.rests.retain(|key, rest| {
            rest.attempts >= ATTEMPTS || now.contains_key(key) || soon.contains_key(key)
        });
        let candidates = |wants: HashMap<Key, f32>, soon| {
            wants.into_iter().map(move |(key, priority)| Candidate {
                key,
                soon,
                priority,
            })
        };
        self.heap = candidates(now, false)
            .chain(candidates(soon, true))
            .filter(|wanted| !held(&wanted.key) && !self.in_flight.contains_key(&wanted.key))
            .collect();
    }

    /// Whether any list holds the tile.
    pub(super) fn is_wished(&self, key: &Key) -> bool {
        self.wished.contains(key)
    }

    /// How many tiles are being loaded.
    pub(super) fn in_flight(&self) -> usize {
        self.in_flight.len()
    }

    /// How many of them only because they may be wanted soon.
    pub(super) fn in_flight_soon(&self) -> usize {
        self.in_flight.values().filter(|soon| **soon).count()
    }

    /// The tile to load next, which is then in flight. `may_look_ahead`: whether it may be one that nobody wants yet.
    pub(super) fn next(&mut self, may_look_ahead: bool, now: Instant) -> Next {
        let mut kept = Vec::new();
        let mut next = None;
        while let Some(candidate) = self.heap.pop() {
            let rests = |key| self.rests.get(key).is_some_and(|rest| rest.again_at > now);
            if candidate.soon && !may_look_ahead {
                kept.push(candidate);
                // All that follow are of this sort.
                break;
            }
            if rests(&candidate.key) {
                kept.push(candidate);
            } else {
                self.in_flight.insert(candidate.key, candidate.soon);
                next = Some(candidate.key);
                break;
            }
        }
        let times = kept
            .iter()
            .filter(|candidate| !candidate.soon || may_look_ahead)
            .filter_map(|candidate| Some(self.rests.get(&candidate.key)?.again_at));
        let earliest = times.min();
        self.heap.extend(kept);
        next.map_or(Next::Wait(earliest), Next::Load)
    }

    /// A tile arrived: whether for the first time ever, and whether it was only loaded because it may be wanted soon.
    pub(super) fn done(&mut self, key: Key) -> (bool, bool) {
        let soon = self.in_flight.remove(&key);
        self.rests.remove(&key);
        (self.arrived.insert(key), soon == Some(true))
    }

    /// A tile could not be loaded. Tells how often it failed, in a row.
    pub(super) fn set_back(&mut self, key: Key, setback: Setback, now: Instant) -> u32 {
        let soon = self.in_flight.remove(&key) == Some(true);
        let rest = self.rests.get(&key);
        let (before, was_away) = rest.map_or((0, false), |rest| (rest.attempts, rest.away));
        let next = before.saturating_add(1);
        let short = FIRST_PAUSE * 4_u32.pow(before.min(ATTEMPTS));
        let (attempts, away, pause, reason) = match setback {
            Setback::Elsewhere(pause) => {
                let reason = "another process loads it".into();
                (before, was_away, pause, reason)
            }
            Setback::Unreachable(reason) => (before, true, UNREACHABLE_PAUSE, reason),
            Setback::Failed(reason) if next < ATTEMPTS => (next, false, short, reason),
            Setback::Failed(reason) => (next, false, LONG_PAUSE, reason),
        };
        self.rests.insert(
            key,
            Rest {
                attempts,
                away,
                again_at: now + pause,
                reason,
            },
        );
        let soon = soon && !self.wished.contains(&key);
        let wants = self.lists.values().flat_map(|lists| match soon {
            true => &lists.soon,
            false => &lists.now,
        });
        let priority = best_of(wants.filter(|(other, _)| *other == key));
        self.heap
            .extend(priority.into_iter().map(|(key, priority)| Candidate {
                key,
                soon,
                priority,
            }));
        attempts
    }

    /// A tile came back, but of data that are no longer current: it is to be loaded again.
    pub(super) fn outdated(&mut self, key: Key) {
        self.in_flight.remove(&key);
        if self.wished.contains(&key) {
            self.heap.push(Candidate {
                key,
                soon: false,
                priority: f32::INFINITY,
            });
        }
    }

    /// Why a tile is given up for the time being.
    pub(super) fn failure(&self, key: &Key) -> Option<Arc<str>> {
        let rest = self.rests.get(key)?;
        rest.is_given_up().then(|| Arc::clone(&rest.reason))
    }

    /// Why the repository of a tile could not be reached when it was asked for it last.
    pub(super) fn away(&self, key: &Key) -> Option<Arc<str>> {
        let rest = self.rests.get(key)?;
        rest.away.then(|| Arc::clone(&rest.reason))
    }

    /// How many tiles are given up for the time being.
    pub(super) fn failures(&self) -> usize {
        let rests = self.rests.values();
        rests.filter(|rest| rest.is_given_up()).count()
    }

    /// Forgets the failures of a data set that was changed.
    pub(super) fn forget(&mut self, dataset: DatasetId) {
        self.rests.retain(|key, _| key.0 != dataset);
    }

    /// True where nothing is in flight and all that is wanted now and waits has been given up.
    pub(super) fn is_idle(&self) -> bool {
        let given_up = |candidate: &Candidate| self.failure(&candidate.key).is_some();
        self.in_flight.is_empty() && self.heap.iter().all(|other| other.soon || given_up(other))
    }
}

impl Rest {
    /// A repository that is away is waited for, whatever it answered before.
    fn is_given_up(&self) -> bool {
        self.attempts >= ATTEMPTS && !self.away
    }
}

/// Each tile once, with its highest priority; NaN comes last.
fn best_of<'a>(wants: impl Iterator<Item = &'a (Key, f32)>) -> HashMap<Key, f32> {
    let mut best: HashMap<Key, f32> = HashMap::new();
    for (key, priority) in wants {
        let priority = if priority.is_nan() {
            f32::NEG_INFINITY
        } else {
            *priority
        };
        let known = best.entry(*key).or_insert(priority);
        *known = known.max(priority);
    }
    best
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
    /// What is wanted now comes before what may be wanted soon. Ties go to the coarser tile, then to the lower key, so
    /// that the order never depends on chance.
    fn cmp(&self, other: &Self) -> Ordering {
        let urgency = other.soon.cmp(&self.soon);
        let urgency = urgency.then_with(|| self.priority.total_cmp(&other.priority));
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
            (caller, false),
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
        assert_eq!(queue.next(true, now), Next::Load(key(2)));
        assert_eq!(queue.next(true, now), Next::Load(key(3)));
        wish(&mut queue, 0, &[(2, 9.0), (4, f32::NAN), (5, 0.0)]);
        wish(&mut queue, 1, &[(4, 7.0)]);
        // 2 is in flight, 1 is cancelled, and 4 counts as the second caller wants it.
        assert_eq!(queue.next(true, now), Next::Load(key(4)));
        assert_eq!(queue.next(true, now), Next::Load(key(5)));
        assert_eq!(queue.next(true, now), Next::Wait(None));
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
            assert_eq!(queue.next(true, now), Next::Load(key(1)));
            assert!(queue.failure(&key(1)).is_none());
            let setback = Setback::Failed("why".into());
            assert_eq!(queue.set_back(key(1), setback, now), attempt);
            let Next::Wait(Some(again)) = queue.next(true, now) else {
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
        assert_eq!(queue.next(true, now), Next::Load(key(1)));
        assert!(queue.done(key(1)).0 && !queue.done(key(1)).0);
        assert_eq!(queue.failures(), 0);
    }

    #[test]
    fn a_resting_tile_does_not_hold_others_up() {
        let (mut queue, now) = (Queue::default(), Instant::now());
        wish(&mut queue, 0, &[(1, 9.0)]);
        assert_eq!(queue.next(true, now), Next::Load(key(1)));
        queue.set_back(key(1), Setback::Failed("why".into()), now);
        wish(&mut queue, 0, &[(1, 9.0), (2, 1.0)]);
        assert_eq!(queue.next(true, now), Next::Load(key(2)));
        assert!(matches!(queue.next(true, now), Next::Wait(Some(_))));
    }

    #[test]
    fn what_may_be_wanted_soon_comes_last_and_only_if_there_is_room() {
        let (mut queue, now) = (Queue::default(), Instant::now());
        wish(&mut queue, 0, &[(1, 0.0), (2, 1.0)]);
        let soon = [(key(2), 9.0), (key(3), 8.0), (key(4), 9.0)];
        queue.replace((0, true), soon.into_iter(), |_| false);
        for due in [2, 1] {
            assert_eq!(queue.next(false, now), Next::Load(key(due)));
        }
        assert_eq!(queue.next(false, now), Next::Wait(None));
        assert_eq!(queue.next(true, now), Next::Load(key(4)));
        assert_eq!((queue.in_flight(), queue.in_flight_soon()), (3, 1));
        assert!(!queue.is_wished(&key(4)));
        assert_eq!(
            (queue.done(key(4)), queue.done(key(2))),
            ((true, true), (true, false))
        );
        queue.done(key(1));
        // Tile 3 is wished for by nobody yet: nothing is missing.
        assert!(queue.is_idle());
        wish(&mut queue, 0, &[(3, 0.0)]);
        assert!(!queue.is_idle());
        assert_eq!(queue.next(false, now), Next::Load(key(3)));
    }

    #[test]
    fn others_work_is_waited_for_without_being_held_against_a_tile() {
        let (mut queue, mut now) = (Queue::default(), Instant::now());
        wish(&mut queue, 0, &[(1, 1.0)]);
        for _ in 0..3 * ATTEMPTS {
            assert_eq!(queue.next(false, now), Next::Load(key(1)));
            let pause = Duration::from_millis(20);
            assert_eq!(queue.set_back(key(1), Setback::Elsewhere(pause), now), 0);
            assert_eq!(queue.next(false, now), Next::Wait(Some(now + pause)));
            assert!(queue.failure(&key(1)).is_none() && !queue.is_idle());
            now += pause;
        }
        // A repository that is away is asked again soon, however often it was not there, and its tiles stay due.
        assert!(queue.away(&key(1)).is_none());
        for _ in 0..3 * ATTEMPTS {
            assert_eq!(queue.next(false, now), Next::Load(key(1)));
            let setback = Setback::Unreachable("gone".into());
            assert_eq!(queue.set_back(key(1), setback, now), 0);
            let Next::Wait(Some(again)) = queue.next(false, now) else {
                panic!("it must rest")
            };
            assert!(again <= now + UNREACHABLE_PAUSE);
            assert!(queue.failure(&key(1)).is_none() && !queue.is_idle());
            assert_eq!(&*queue.away(&key(1)).unwrap(), "gone");
            now = again;
        }
        // Once it answers, its tiles are like any other.
        assert_eq!(queue.next(false, now), Next::Load(key(1)));
        assert_eq!(
            queue.set_back(key(1), Setback::Failed("why".into()), now),
            1
        );
        assert!(queue.away(&key(1)).is_none());
    }

    proptest! {
        #[test]
        fn nothing_is_lost_or_loaded_twice(lists in prop::collection::vec(prop::collection::vec((0_u32..20, 0.0_f32..9.0), 0..10), 1..20)) {
            let (mut queue, now) = (Queue::default(), Instant::now());
            let mut flying: Vec<Key> = Vec::new();
            for (round, list) in lists.iter().enumerate() {
                wish(&mut queue, (round % 3) as u64, list);
                if let Next::Load(next) = queue.next(true, now) {
                    prop_assert!(queue.is_wished(&next) && !flying.contains(&next));
                    flying.push(next);
                }
                if round % 4 == 3 && let Some(key) = flying.pop() {
                    queue.done(key);
                }
            }
            while let Next::Load(next) = queue.next(true, now) {
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
