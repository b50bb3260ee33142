//! A wall whose nodes prepare changes, in virtual time: the real `Changes`, joined by a network that delays,
//! to nodes that come, go, answer late, refuse or never answer. One seed, one schedule.
//! In: a seed. Out: a history, every step of which was checked (`model.rs`). It judges nothing itself.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use protocol::change::Changes;

/// Repeatable random numbers (S. Vigna, SplitMix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Evenly within 0…1.
    pub(crate) fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Evenly within a range.
    pub(crate) fn within(&mut self, low: i64, high: i64) -> i64 {
        low + (self.share() * (high - low) as f64) as i64
    }
}

/// How bad the world is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Conditions {
    pub(crate) nodes: usize,
    /// Time that a message takes, in microseconds.
    pub(crate) delay_us: (i64, i64),
    /// Time that a node takes to prepare a revision.
    pub(crate) prepare_us: (i64, i64),
    /// Share of preparations that a node never ends.
    pub(crate) silent: f64,
    /// Share of preparations that fail.
    pub(crate) refusals: f64,
}

#[derive(Clone, Debug)]
enum Event {
    Submit,
    /// A node connects; its link has a number of its own.
    Connect(usize),
    Disconnect(usize),
    Enter(usize),
    Leave(usize),
    /// A scene arrives at a node.
    Scene {
        node: usize,
        link: u32,
        revision: u64,
    },
    /// A node's answer arrives at the master.
    Answer {
        node: usize,
        link: u32,
        revision: u64,
        prepared: bool,
    },
    Tick,
}

/// What became of a revision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fate {
    Waiting,
    InPreparation { sent_us: i64 },
    Shown { at_us: i64 },
    Superseded,
    Refused,
}

/// How often what happened, so that no proof is empty.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tallies {
    pub(crate) shown: u64,
    pub(crate) superseded: u64,
    pub(crate) refused: u64,
    pub(crate) unprepared: u64,
    pub(crate) without_members: u64,
    pub(crate) by_leaving: u64,
    pub(crate) answers_lost: u64,
    pub(crate) went_back: u64,
}

pub(crate) struct World {
    pub(crate) changes: Changes,
    pub(crate) fates: BTreeMap<u64, Fate>,
    pub(crate) tallies: Tallies,
    pub(super) conditions: Conditions,
    random: Random,
    pub(super) seed: u64,
    pub(super) now_us: i64,
    queue: BinaryHeap<Reverse<(i64, u64)>>,
    events: BTreeMap<u64, Event>,
    sequence: u64,
    links: BTreeMap<usize, u32>,
    links_made: u32,
    pub(super) members: BTreeSet<usize>,
    /// What connected nodes have said of the revision in preparation, as it arrived.
    pub(super) answers: BTreeMap<usize, bool>,
    tick_at_us: Option<i64>,
}

impl World {
    pub(crate) fn new(conditions: Conditions, seed: u64) -> Self {
        Self {
            changes: Changes::new(1),
            fates: BTreeMap::from([(1, Fate::Shown { at_us: 0 })]),
            tallies: Tallies::default(),
            conditions,
            random: Random(seed),
            seed,
            now_us: 0,
            queue: BinaryHeap::new(),
            events: BTreeMap::new(),
            sequence: 0,
            links: BTreeMap::new(),
            links_made: 0,
            members: BTreeSet::new(),
            answers: BTreeMap::new(),
            tick_at_us: None,
        }
    }

    pub(crate) fn submit(&mut self, at_us: i64) {
        self.push(at_us, Event::Submit);
    }

    /// A node connects, and becomes a member some time later.
    pub(crate) fn start(&mut self, node: usize, at_us: i64, enters_after_us: i64) {
        self.push(at_us, Event::Connect(node));
        self.push(at_us + enters_after_us, Event::Enter(node));
    }

    pub(crate) fn kill(&mut self, node: usize, at_us: i64) {
        self.push(at_us, Event::Disconnect(node));
    }

    /// A node misses its deadlines and comes back; its link lives.
    pub(crate) fn drop_out(&mut self, node: usize, at_us: i64, for_us: i64) {
        self.push(at_us, Event::Leave(node));
        self.push(at_us + for_us, Event::Enter(node));
    }

    /// From now on nodes are as bad as this.
    pub(crate) fn set_conditions(&mut self, conditions: Conditions) {
        self.conditions = conditions;
    }

    pub(crate) fn run_until(&mut self, until_us: i64) {
        while let Some(Reverse((at_us, sequence))) = self.queue.peek().copied() {
            if at_us > until_us {
                break;
            }
            self.queue.pop();
            let event = self.events.remove(&sequence).unwrap();
            self.now_us = at_us;
            self.happen(event);
        }
        self.now_us = until_us;
    }

    fn push(&mut self, at_us: i64, event: Event) {
        self.sequence += 1;
        self.events.insert(self.sequence, event);
        self.queue.push(Reverse((at_us, self.sequence)));
    }

    fn happen(&mut self, event: Event) {
        let now_us = self.now_us;
        let newest = self.changes.newest();
        let actions = match event {
            Event::Submit => {
                let (revision, actions) = self.changes.submit(&self.members, now_us);
                let last = self.fates.last_key_value().map(|(last, _)| *last);
                assert!(
                    last < Some(revision),
                    "seed {}: number {revision} used twice",
                    self.seed
                );
                self.fates.insert(revision, Fate::Waiting);
                actions
            }
            Event::Connect(node) => {
                if self.links.contains_key(&node) {
                    return;
                }
                self.links_made += 1;
                self.links.insert(node, self.links_made);
                self.send(node, self.changes.shown());
                if let Some(revision) = self.changes.preparing() {
                    self.send(node, revision);
                }
                return;
            }
            Event::Disconnect(node) => {
                self.links.remove(&node);
                self.tallies.answers_lost += u64::from(self.answers.remove(&node).is_some());
                self.changes.disconnected(node);
                self.members.remove(&node);
                self.changes.members(&self.members, now_us)
            }
            Event::Enter(node) => {
                if self.links.contains_key(&node) {
                    self.members.insert(node);
                }
                self.changes.members(&self.members, now_us)
            }
            Event::Leave(node) => {
                self.members.remove(&node);
                self.changes.members(&self.members, now_us)
            }
            Event::Scene {
                node,
                link,
                revision,
            } => return self.prepare(node, link, revision),
            Event::Answer {
                node,
                link,
                revision,
                prepared,
            } => {
                if self.links.get(&node) != Some(&link) {
                    return;
                }
                if self.changes.preparing() == Some(revision) {
                    self.answers.insert(node, prepared);
                }
                if prepared {
                    self.changes.prepared(node, revision, now_us)
                } else {
                    self.changes
                        .cannot_prepare(node, revision, format!("{node}"), now_us)
                }
            }
            Event::Tick => {
                if self.tick_at_us != Some(now_us) {
                    return;
                }
                self.tick_at_us = None;
                self.changes.tick(now_us)
            }
        };
        let leaving = matches!(event, Event::Leave(_) | Event::Disconnect(_));
        for action in actions {
            self.act(action, leaving);
        }
        self.tallies.went_back += u64::from(self.changes.newest() < newest);
        self.check_state();
        if let Some(wake_us) = self.changes.next_wake_us()
            && self.tick_at_us != Some(wake_us)
        {
            self.tick_at_us = Some(wake_us);
            self.push(wake_us.max(now_us), Event::Tick);
        }
    }

    /// What a node does with a scene: after a while it says that it is prepared, that it cannot, or nothing.
    fn prepare(&mut self, node: usize, link: u32, revision: u64) {
        if self.links.get(&node) != Some(&link) || self.random.share() < self.conditions.silent {
            return;
        }
        let prepared = self.random.share() >= self.conditions.refusals;
        let (low, high) = self.conditions.prepare_us;
        let taken_us = self.random.within(low, high) + self.delay_us();
        self.push(
            self.now_us + taken_us,
            Event::Answer {
                node,
                link,
                revision,
                prepared,
            },
        );
    }

    pub(super) fn send(&mut self, node: usize, revision: u64) {
        if let Some(link) = self.links.get(&node).copied() {
            let arrives_us = self.now_us + self.delay_us();
            self.push(
                arrives_us,
                Event::Scene {
                    node,
                    link,
                    revision,
                },
            );
        }
    }

    fn delay_us(&mut self) -> i64 {
        let (low, high) = self.conditions.delay_us;
        self.random.within(low, high)
    }
}
