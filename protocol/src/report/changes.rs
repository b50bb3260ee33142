//! Counts what became of changes of the scene, and how long they took, in bounded memory.
//! In: decisions about revisions, and frames that every node presented, in rising order. Out: a
//! [`ChangeReport`]. It does not decide what is shown.

use std::collections::{BTreeMap, VecDeque};

use super::ChangeReport;
use super::tally::Tally;

/// Submitted changes that may be undecided at a time; a master never has more than two.
const MOST_UNDECIDED: usize = 1_024;
/// Shown changes whose frame may be waited for at a time. The wait of the oldest is given up beyond it.
const MOST_AWAITED: usize = 65_536;

#[derive(Debug)]
pub(super) struct ChangeTally {
    submitted: u64,
    superseded: u64,
    refused: u64,
    shown: u64,
    unprepared: u64,
    converged: u64,
    to_shown_us: Tally,
    to_converged_us: Tally,
    /// When each undecided revision was submitted.
    undecided: BTreeMap<u64, i64>,
    /// Shown revisions whose first frame on every node is waited for, in the order of their frames.
    unseen: VecDeque<Shown>,
    /// Those whose first frame is waited for in which nothing is missing on any node.
    unconverged: VecDeque<Shown>,
}

#[derive(Clone, Copy, Debug)]
struct Shown {
    submitted_us: i64,
    /// When it was decided to show it: no picture of it was presented before, whatever a node's clock says.
    decided_us: i64,
    frame: u64,
}

impl Shown {
    fn took_us(&self, presented_us: i64) -> i64 {
        presented_us
            .max(self.decided_us)
            .saturating_sub(self.submitted_us)
    }
}

impl ChangeTally {
    pub(super) fn new() -> Self {
        Self {
            submitted: 0,
            superseded: 0,
            refused: 0,
            shown: 0,
            unprepared: 0,
            converged: 0,
            to_shown_us: Tally::new(),
            to_converged_us: Tally::new(),
            undecided: BTreeMap::new(),
            unseen: VecDeque::new(),
            unconverged: VecDeque::new(),
        }
    }

    pub(super) fn submitted(&mut self, revision: u64, now_us: i64) {
        self.submitted += 1;
        self.undecided.insert(revision, now_us);
        if self.undecided.len() > MOST_UNDECIDED {
            self.undecided.pop_first();
        }
    }

    pub(super) fn superseded(&mut self, revision: u64) {
        if self.undecided.remove(&revision).is_some() {
            self.superseded += 1;
        }
    }

    pub(super) fn refused(&mut self, revision: u64) {
        if self.undecided.remove(&revision).is_some() {
            self.refused += 1;
        }
    }

    pub(super) fn shown(&mut self, revision: u64, frame: u64, unprepared: usize, decided_us: i64) {
        let Some(submitted_us) = self.undecided.remove(&revision) else {
            return;
        };
        self.shown += 1;
        self.unprepared += u64::from(unprepared > 0);
        let shown = Shown {
            submitted_us,
            decided_us,
            frame,
        };
        await_frame(&mut self.unseen, shown);
        await_frame(&mut self.unconverged, shown);
    }

    /// Every node had presented this frame at this moment, on the master's clock.
    pub(super) fn presented(&mut self, frame: u64, moment_us: i64, converged: bool) {
        for shown in taken(&mut self.unseen, frame) {
            self.to_shown_us.add(shown.took_us(moment_us));
        }
        if !converged {
            return;
        }
        for shown in taken(&mut self.unconverged, frame) {
            self.converged += 1;
            self.to_converged_us.add(shown.took_us(moment_us));
        }
    }

    pub(super) fn report(&self) -> ChangeReport {
        ChangeReport {
            submitted: self.submitted,
            shown: self.shown,
            superseded: self.superseded,
            refused: self.refused,
            unprepared: self.unprepared,
            unconverged: self.shown.saturating_sub(self.converged),
            to_shown_us: self.to_shown_us.quantiles_and_max(),
            to_converged_us: self.to_converged_us.quantiles_and_max(),
        }
    }
}

/// Frames rise from change to change, so the front is always due first.
fn await_frame(queue: &mut VecDeque<Shown>, shown: Shown) {
    let newest = queue.back().map_or(0, |last| last.frame);
    queue.push_back(Shown {
        frame: shown.frame.max(newest),
        ..shown
    });
    if queue.len() > MOST_AWAITED {
        queue.pop_front();
    }
}

/// Takes out those that waited for this frame or an earlier one.
fn taken(queue: &mut VecDeque<Shown>, frame: u64) -> VecDeque<Shown> {
    let due = queue.partition_point(|shown| shown.frame <= frame);
    let rest = queue.split_off(due);
    std::mem::replace(queue, rest)
}
