//! A wall of nodes in virtual time: the real barrier, membership, followers and clocks, joined by a
//! network that delays and loses, on machines that stall and die. One seed, one schedule.

mod events;
mod master;
mod node;
mod tests;

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use crate::barrier::{Barrier, BarrierOptions, NodeId};
use crate::clock::ClockEstimate;
use crate::follower::Follower;
use crate::membership::{Membership, Seat};
use crate::message::{Hello, PROTOCOL_VERSION, View};
use crate::wall::Wall;
use events::{Conditions, History, Random, Target, What};

/// The master's clock when the simulation starts.
const START_US: i64 = 1_000_000_000_000;
/// After how long the master sees that a link is dead.
const IDLE_TIMEOUT_US: i64 = 1_000_000;

struct SimNode {
    process: u32,
    alive: bool,
    offset_us: i64,
    drift: f64,
    stalled_until_us: i64,
    follower: Follower,
    clock: ClockEstimate,
}

/// The whole installation.
pub(crate) struct VirtualWall {
    pub(crate) now_us: i64,
    pub(crate) barrier: Barrier,
    pub(crate) membership: Membership,
    pub(crate) history: History,
    conditions: Conditions,
    random: Random,
    nodes: Vec<SimNode>,
    seats: HashMap<(NodeId, u32), Seat>,
    queue: BinaryHeap<Reverse<(i64, u64)>>,
    events: HashMap<u64, (Target, What)>,
    sequence: u64,
    master_stalled_until_us: i64,
    tick_at_us: i64,
    view: Option<View>,
    first_ready_us: Option<i64>,
    master_stalled: bool,
}

impl VirtualWall {
    pub(crate) fn new(wall: &Wall, conditions: Conditions, seed: u64) -> Self {
        let mut random = Random(seed);
        let nodes = (0..conditions.nodes)
            .map(|_| SimNode {
                process: 0,
                alive: false,
                offset_us: random.within(-1_000_000_000, 1_000_000_000),
                drift: (random.share() - 0.5) * 100e-6,
                stalled_until_us: 0,
                follower: Follower::new(conditions.fps),
                clock: ClockEstimate::new(),
            })
            .collect();
        let mut world = Self {
            now_us: START_US,
            barrier: Barrier::new(BarrierOptions::new(conditions.fps), START_US),
            membership: Membership::new(wall, 7, "test"),
            history: History::default(),
            conditions,
            random,
            nodes,
            seats: HashMap::new(),
            queue: BinaryHeap::new(),
            events: HashMap::new(),
            sequence: 0,
            master_stalled_until_us: 0,
            tick_at_us: i64::MAX,
            view: None,
            first_ready_us: None,
            master_stalled: false,
        };
        for node in 0..conditions.nodes {
            let at_us = world.random.within(0, 30_000);
            world.start(node, at_us);
        }
        world.schedule_tick();
        world
    }

    /// Starts (or restarts) a node's process at a time after the start of the simulation.
    pub(crate) fn start(&mut self, node: NodeId, at_us: i64) {
        self.push(
            START_US + at_us,
            Target::World { node: Some(node) },
            What::Start,
        );
    }

    /// Kills a node's process.
    pub(crate) fn kill(&mut self, node: NodeId, at_us: i64) {
        self.push(
            START_US + at_us,
            Target::World { node: Some(node) },
            What::Kill,
        );
    }

    /// Holds up a node, or the master (`None`), for a while.
    pub(crate) fn stall(&mut self, node: Option<NodeId>, at_us: i64, for_us: i64) {
        let until_us = START_US + at_us + for_us;
        self.push(
            START_US + at_us,
            Target::World { node },
            What::Stall { until_us },
        );
    }

    pub(crate) fn alive(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.nodes
            .iter()
            .enumerate()
            .filter(|(_, node)| node.alive)
            .map(|(index, _)| index)
    }

    /// Runs until a time after the start of the simulation.
    pub(crate) fn run_until(&mut self, until_us: i64) {
        while let Some(Reverse((at_us, sequence))) = self.queue.peek().copied() {
            if at_us > START_US + until_us {
                break;
            }
            self.queue.pop();
            let (target, what) = self.events.remove(&sequence).unwrap();
            self.now_us = at_us;
            let stalled_until_us = match target {
                Target::World { .. } => 0,
                Target::Master { .. } => self.master_stalled_until_us,
                Target::Node { node, .. } => self.nodes[node].stalled_until_us,
            };
            if stalled_until_us > at_us {
                // Same sequence number: what waited is handled in its old order.
                self.events.insert(sequence, (target, what));
                self.queue.push(Reverse((stalled_until_us, sequence)));
                continue;
            }
            match target {
                Target::World { node } => self.world(node, what),
                Target::Master { node, process } => self.master(node, process, what),
                Target::Node { node, process } if self.nodes[node].process == process => {
                    self.node(node, process, what);
                }
                Target::Node { .. } => {}
            }
        }
        self.now_us = START_US + until_us;
    }

    fn push(&mut self, at_us: i64, target: Target, what: What) {
        self.sequence += 1;
        self.events.insert(self.sequence, (target, what));
        self.queue.push(Reverse((at_us, self.sequence)));
    }

    /// Sends something over the network. Only frames' messages can be lost.
    fn send(&mut self, target: Target, what: What) {
        let reliable = matches!(what, What::Hello(_) | What::Welcome | What::Refused { .. });
        if !reliable && self.random.share() < self.conditions.loss {
            return;
        }
        let jitter_us = self.random.exponential(self.conditions.jitter_us);
        self.push(
            self.now_us + self.conditions.delay_us + jitter_us,
            target,
            what,
        );
    }

    fn world(&mut self, node: Option<NodeId>, what: What) {
        match (what, node) {
            (What::Stall { until_us }, Some(node)) => {
                let stalled_until_us = &mut self.nodes[node].stalled_until_us;
                *stalled_until_us = until_us.max(*stalled_until_us);
            }
            (What::Stall { until_us }, None) => {
                self.master_stalled_until_us = until_us.max(self.master_stalled_until_us);
                self.master_stalled = true;
            }
            (What::Kill, Some(node)) if self.nodes[node].alive => {
                let process = self.nodes[node].process;
                self.nodes[node].alive = false;
                self.nodes[node].process += 1;
                let lost_us = self.now_us + IDLE_TIMEOUT_US;
                self.push(lost_us, Target::Master { node, process }, What::LinkLost);
            }
            (What::Start, Some(node)) if !self.nodes[node].alive => {
                let state = &mut self.nodes[node];
                state.process += 1;
                state.alive = true;
                state.stalled_until_us = 0;
                state.follower = Follower::new(self.conditions.fps);
                state.clock = ClockEstimate::new();
                self.say_hello(node);
            }
            _ => {}
        }
    }

    fn say_hello(&mut self, node: NodeId) {
        let process = self.nodes[node].process;
        let hello = Hello {
            protocol_version: PROTOCOL_VERSION,
            program_version: "test".to_owned(),
            session: 7,
            node: format!("node{node}"),
            adapter: "none".to_owned(),
            process_id: process,
        };
        self.send(
            Target::Master { node, process },
            What::Hello(Box::new(hello)),
        );
    }
}
