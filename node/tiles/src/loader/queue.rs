//! What is to be loaded next: callers' wish lists, priorities, single flight, setbacks and their patience.
//! In: wishes, outcomes, the time. Out: the next tile to load, or how long to wait. Tiles that may be wanted soon
//! come after all that are wanted now. No I/O, no clock, no threads.

use std::cmp::{Ordering, Reverse};
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
    /// Those that came up and are not to be tried yet, by the moment from which on they are.
    resting: BinaryHeap<Reverse<Resting>>,
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

#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Resting {
    again_at: Instant,
    candidate: Candidate,
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
        self.resting.clear();
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
        while let Some(Reverse(first)) = self.resting.pop() {
            if first.again_at > now {
                self.resting.push(Reverse(first));
                break;
            }
            self.heap.push(first.candidate);
        }
        while let Some(candidate) = self.heap.pop() {
            if candidate.soon && !may_look_ahead {
                // All that follow are of this sort.
                self.heap.push(candidate);
                break;
            }
            match self.rests.get(&candidate.key) {
                Some(rest) if rest.again_at > now => self.resting.push(Reverse(Resting {
                    again_at: rest.again_at,
                    candidate,
                })),
                _ => {
                    self.in_flight.insert(candidate.key, candidate.soon);
                    return Next::Load(candidate.key);
                }
            }
        }
        Next::Wait(self.resting.peek().map(|Reverse(first)| first.again_at))
    }

    /// A tile arrived: whether for the first time ever, and whether it was only loaded because it may be wanted soon.
    pub(super) fn done(&mut self, key: Key) -> (bool, bool) {
        let soon = self.in_flight.remove(&key);
        self.rests.remove(&key);
        (self.arrived.insert(key), soon == Some(true))
    }

    /// A tile could not be loaded. Tells how often it failed, in a row.
    pub(super) fn set_back(&mut self, key: Key, setback: Setback, now: Instant) -> u32 {
        self.in_flight.remove(&key);
        let rest = self.rests.get(&key);
        let before = rest.map_or(0, |rest| rest.attempts);
        let was_away = rest
            .filter(|rest| rest.away)
            .map(|rest| Arc::clone(&rest.reason));
        let next = before.saturating_add(1);
        let short = FIRST_PAUSE * 4_u32.pow(before.min(ATTEMPTS));
        let (attempts, away, pause, reason) = match setback {
            Setback::Elsewhere(pause) => {
                let reason = || "another process loads it".into();
                (
                    before,
                    was_away.is_some(),
                    pause,
                    was_away.unwrap_or_else(reason),
                )
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
        self.wait_again(key);
        attempts
    }

    /// Puts a tile that was in flight back among those that wait, if anybody still wants it, now or soon.
    fn wait_again(&mut self, key: Key) {
        let soon = !self.wished.contains(&key);
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
    }

    /// A tile came back, but of data that are no longer current: it is to be loaded again.
    pub(super) fn outdated(&mut self, key: Key) {
        self.in_flight.remove(&key);
        self.wait_again(key);
    }

    /// Forgets all wishes.
    pub(super) fn withdraw(&mut self) {
        self.lists.clear();
        self.wished.clear();
        self.heap.clear();
        self.resting.clear();
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
        let resting = self.resting.drain();
        self.heap.extend(resting.map(|Reverse(all)| all.candidate));
    }

    /// True where nothing is in flight and all that is wanted now and waits has been given up.
    pub(super) fn is_idle(&self) -> bool {
        let given_up = |candidate: &Candidate| self.failure(&candidate.key).is_some();
        let resting = self.resting.iter().map(|Reverse(all)| &all.candidate);
        let mut waiting = self.heap.iter().chain(resting);
        self.in_flight.is_empty() && waiting.all(|other| other.soon || given_up(other))
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
mod tests;
