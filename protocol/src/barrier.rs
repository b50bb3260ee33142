//! The swap barrier, as the master runs it: whom to wait for, how long, and when all present.
//! In: what nodes say, and the time. Out: [`Action`]s. It sends nothing and reads no clock.
//!
//! Rules:
//! - Members of the epoch are waited for; other connected nodes get every view and swap too, and present
//!   whenever they are ready in time. The set of members changes only between frames, and the epoch's
//!   number with it.
//! - The deadline counts from the moment the first node is ready, so a frame that is heavy for everybody
//!   is late for nobody. It adapts to how far apart the nodes are wont to be, and is never above
//!   [`BarrierOptions::deadline_us`]. A node that has missed its last deadline is granted half of it, then
//!   a quarter, so one dead node costs the others less than two deadlines in all, and never more than
//!   one a frame.
//! - A node that misses [`BarrierOptions::strikes`] deadlines in a row, or whose link is lost, leaves. When
//!   more than half of the members are late, the host or the network is at fault: that costs no strike,
//!   as often in a row as there are strikes.
//! - A connected node enters when it has drawn a frame within one deadline of the first that did. As long
//!   as there are no members, frames wait for whoever is connected, however slow.
//! - A frame number is begun once, swapped once, and swaps are at least one period apart.

mod action;
mod patience;
mod state;

use std::collections::BTreeMap;

use crate::message::Swap;
use crate::pacing::{Grid, Lead};

pub use action::{Action, BarrierOptions, LeaveReason};

use patience::Patience;
use state::{Node, Phase};

/// A node: the index of its host in the wall.
pub type NodeId = usize;

/// A tick later than this after a deadline means that the master itself was held up.
const OVERSLEPT_US: i64 = 5_000;
/// What the master grants then, to read what has arrived meanwhile.
const GRACE_US: i64 = 3_000;
/// Longest interval between repetitions of a view.
const LONGEST_RESEND_US: i64 = 160_000;
/// The barrier's state.
#[derive(Clone, Debug)]
pub struct Barrier {
    options: BarrierOptions,
    grid: Grid,
    lead: Lead,
    epoch: u32,
    frame: u64,
    last_tick: i64,
    last_swap: Option<Swap>,
    nodes: BTreeMap<NodeId, Node>,
    members_changed: bool,
    phase: Phase,
    patience: Patience,
    excuses: u32,
}

impl Barrier {
    /// A barrier whose first frame begins now.
    #[must_use]
    pub fn new(options: BarrierOptions, now_us: i64) -> Self {
        let grid = Grid::new(now_us, options.fps);
        Self {
            options,
            grid,
            lead: Lead::new(&grid),
            epoch: 0,
            frame: 0,
            last_tick: 0,
            last_swap: None,
            nodes: BTreeMap::new(),
            members_changed: false,
            phase: Phase::Resting {
                begin_at_us: now_us,
            },
            patience: Patience::new(options.deadline_us, grid.period_us()),
            excuses: 0,
        }
    }

    /// A welcomed node is connected. If a frame is in flight, it is to be sent to the node.
    pub fn connected(&mut self, node: NodeId) -> Vec<Action> {
        self.nodes.insert(node, Node::default());
        match self.phase {
            Phase::InFlight { .. } => {
                vec![Action::Resend {
                    frame: self.frame,
                    nodes: vec![node],
                }]
            }
            Phase::Resting { .. } => Vec::new(),
        }
    }

    /// A node's link is lost or it said good-bye.
    pub fn disconnected(&mut self, node: NodeId, now_us: i64) -> Vec<Action> {
        let mut actions = Vec::new();
        let expired_us = self.expires_us();
        if self.nodes.remove(&node).is_some_and(|node| node.member) {
            self.members_changed = true;
            actions.push(Action::Left {
                node,
                reason: LeaveReason::LinkLost,
            });
        }
        self.swap_if_due(expired_us, now_us, &mut actions);
        actions
    }

    /// A node has drawn a frame.
    pub fn ready(&mut self, node: NodeId, epoch: u32, frame: u64, now_us: i64) -> Vec<Action> {
        let mut actions = Vec::new();
        let current = frame == self.frame;
        let expired_us = self.expires_us();
        let Some(state) = self.nodes.get_mut(&node) else {
            return actions;
        };
        if current && epoch != self.epoch {
            return actions;
        }
        let mut in_time = false;
        if let Phase::InFlight { first_ready_us, .. } = &mut self.phase
            && current
        {
            in_time = true;
            state.ready = true;
            if first_ready_us.is_none() {
                *first_ready_us = Some(now_us);
                self.patience.first_ready(frame, now_us);
            }
        }
        if let Some(late_us) = self.patience.lateness_us(frame, now_us) {
            state.entering |= !state.member;
            if !in_time {
                // By how much it was late tells how long deadlines ought to be.
                self.patience.learn(late_us);
            }
        }
        self.swap_if_due(expired_us, now_us, &mut actions);
        actions
    }

    /// A node has reported how long before its moment a swap message arrived (below 0: too late).
    pub fn slack_reported(&mut self, slack_us: i64) {
        self.lead.reported(slack_us);
    }

    /// Time has passed. To be called at [`Barrier::next_wake_us`], after all arrived messages.
    pub fn tick(&mut self, now_us: i64) -> Vec<Action> {
        let mut actions = Vec::new();
        match self.phase {
            Phase::Resting { begin_at_us } => {
                if now_us >= begin_at_us {
                    self.begin(now_us, &mut actions);
                }
            }
            Phase::InFlight { .. } => self.watch(now_us, &mut actions),
        }
        actions
    }

    /// When [`Barrier::tick`] is due next.
    #[must_use]
    pub fn next_wake_us(&self) -> i64 {
        match self.phase {
            Phase::Resting { begin_at_us } => begin_at_us,
            Phase::InFlight { resend_at_us, .. } => self
                .expires_us()
                .map_or(resend_at_us, |expires_us| expires_us.min(resend_at_us)),
        }
    }

    /// The nodes that are waited for.
    pub fn members(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.nodes
            .iter()
            .filter(|(_, state)| state.member)
            .map(|(node, _)| *node)
    }

    /// The frame begun last; 0 before the first.
    #[must_use]
    pub fn frame(&self) -> u64 {
        self.frame
    }

    /// The epoch of that frame.
    #[must_use]
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// The deadline for a node without strikes, in microseconds.
    #[must_use]
    pub fn deadline_us(&self) -> i64 {
        self.patience.deadline_us()
    }

    /// How far ahead of their moment swaps are sent, in microseconds.
    #[must_use]
    pub fn lead_us(&self) -> i64 {
        self.lead.lead_us()
    }

    fn begin(&mut self, now_us: i64, actions: &mut Vec<Action>) {
        for (node, state) in &mut self.nodes {
            if state.entering && !state.member {
                state.member = true;
                state.strikes = 0;
                self.members_changed = true;
                actions.push(Action::Entered { node: *node });
            }
            state.entering = false;
            state.ready = false;
        }
        if std::mem::take(&mut self.members_changed) {
            self.epoch = self.epoch.wrapping_add(1);
        }
        self.frame += 1;
        let resend_us = self.options.resend_us.max(1);
        self.phase = Phase::InFlight {
            begun_us: now_us,
            first_ready_us: None,
            resend_at_us: now_us + resend_us,
            resend_interval_us: resend_us,
            grace_until_us: None,
        };
        actions.push(Action::BeginFrame {
            epoch: self.epoch,
            frame: self.frame,
            previous_swap: self.last_swap,
            presented_from_us: self.grid.tick_us(self.next_tick(now_us)),
        });
    }

    /// Looks after the frame in flight: its deadline, and views that may be lost.
    fn watch(&mut self, now_us: i64, actions: &mut Vec<Action>) {
        if let Some(expires_us) = self.expires_us()
            && now_us >= expires_us
        {
            let overslept = now_us - expires_us > OVERSLEPT_US && self.members().next().is_some();
            if let Phase::InFlight {
                grace_until_us: grace @ None,
                ..
            } = &mut self.phase
                && overslept
            {
                *grace = Some(now_us + GRACE_US);
                return;
            }
            self.swap(now_us, actions);
            return;
        }
        let Phase::InFlight {
            resend_at_us,
            resend_interval_us,
            ..
        } = &mut self.phase
        else {
            return;
        };
        if now_us < *resend_at_us {
            return;
        }
        *resend_interval_us = (*resend_interval_us * 2).min(LONGEST_RESEND_US);
        *resend_at_us = now_us + *resend_interval_us;
        let unready = self.nodes.iter().filter(|(_, state)| !state.ready);
        let nodes: Vec<NodeId> = unready.map(|(node, _)| *node).collect();
        if !nodes.is_empty() {
            actions.push(Action::Resend {
                frame: self.frame,
                nodes,
            });
        }
    }

    /// When the wait for the frame in flight ends; `None` as long as no node is ready. Without nodes
    /// there is nothing to wait for but the next tick.
    fn expires_us(&self) -> Option<i64> {
        let Phase::InFlight {
            begun_us,
            first_ready_us,
            grace_until_us,
            ..
        } = self.phase
        else {
            return None;
        };
        if grace_until_us.is_some() {
            return grace_until_us;
        }
        let no_members = self.nodes.values().all(|state| !state.member);
        let unready = self
            .nodes
            .values()
            .filter(|s| (s.member || no_members) && !s.ready);
        let deadline_us = self.deadline_us();
        let patience_us = unready
            .map(|state| deadline_us >> state.strikes.min(30))
            .max();
        match patience_us {
            Some(patience_us) => first_ready_us.map(|first| first + patience_us),
            None => Some(begun_us + (self.grid.period_us() - self.lead_us()).max(0)),
        }
    }

    /// Swaps if everybody is ready now, or if only nodes are missing whose own wait is over. But if the
    /// deadline had passed before (`expired_us`), the master itself is late, and other messages may wait
    /// to be read: that is left to [`Barrier::tick`].
    fn swap_if_due(&mut self, expired_us: Option<i64>, now_us: i64, actions: &mut Vec<Action>) {
        let Phase::InFlight { first_ready_us, .. } = self.phase else {
            return;
        };
        let no_members = self.nodes.values().all(|state| !state.member);
        let awaited = |state: &&Node| state.member || no_members;
        let complete =
            !self.nodes.is_empty() && self.nodes.values().filter(awaited).all(|state| state.ready);
        if complete {
            self.patience
                .learn(first_ready_us.map_or(0, |first| now_us.saturating_sub(first)));
            self.swap(now_us, actions);
            return;
        }
        let was_open = expired_us.is_none_or(|expired_us| now_us < expired_us);
        if was_open
            && self
                .expires_us()
                .is_some_and(|expires_us| now_us >= expires_us)
        {
            self.swap(now_us, actions);
        }
    }

    fn swap(&mut self, now_us: i64, actions: &mut Vec<Action>) {
        self.strike(actions);
        self.last_tick = self.next_tick(now_us);
        let swap = Swap {
            epoch: self.epoch,
            frame: self.frame,
            present_at_us: self.grid.tick_us(self.last_tick),
        };
        self.last_swap = Some(swap);
        actions.push(Action::Swap(swap));
        // The next view leaves early enough to be there when nodes have presented, and no earlier, so
        // that what steers it is fresh.
        let begin_at_us = now_us.max(swap.present_at_us - self.lead_us());
        self.phase = Phase::Resting { begin_at_us };
    }

    /// Counts strikes at the end of a frame, and lets nodes leave that have too many.
    fn strike(&mut self, actions: &mut Vec<Action>) {
        let members = self.nodes.values().filter(|state| state.member).count();
        let ready = self
            .nodes
            .values()
            .filter(|state| state.member && state.ready)
            .count();
        let most_are_late = ready * 2 < members;
        let excused = most_are_late && self.excuses < self.options.strikes;
        self.excuses = if most_are_late {
            self.excuses.saturating_add(1)
        } else {
            0
        };
        for (node, state) in self.nodes.iter_mut().filter(|(_, state)| state.member) {
            if state.ready {
                state.strikes = 0;
                continue;
            }
            actions.push(Action::Missed {
                node: *node,
                frame: self.frame,
            });
            if excused {
                continue;
            }
            state.strikes += 1;
            if state.strikes >= self.options.strikes.max(1) {
                state.member = false;
                self.members_changed = true;
                actions.push(Action::Left {
                    node: *node,
                    reason: LeaveReason::Deadlines,
                });
            }
        }
    }

    /// The first tick that a swap message sent now can reach in time.
    fn next_tick(&self, now_us: i64) -> i64 {
        self.grid
            .number_at(now_us + self.lead_us())
            .max(self.last_tick + 1)
    }
}
