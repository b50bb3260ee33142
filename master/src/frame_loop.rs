//! The master's frame loop: one thread that owns barrier, membership, changes and report, and waits for nobody.
//! In: events of the network and of the control API, time. Out: views and swaps into the nodes' slots, notices, the
//! outcome. Whom to wait for is decided by `protocol::barrier`, who belongs to the wall by `protocol::membership`,
//! what is shown by `protocol::change`; here it is done.

mod captures;
mod changes;
mod errors;
mod frames;
mod installation;
mod nodes;

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use protocol::barrier::{Barrier, BarrierOptions};
use protocol::change::Changes;
use protocol::codec::{EncodeError, encode_to_node};
use protocol::membership::{Membership, Seat};
use protocol::pattern::Pattern;
use protocol::report::Recorder;
use protocol::{ToNode, Wall};

use crate::capture::Capture;
use crate::change::RefusedChange;
use crate::director::{Director, FIRST_REVISION};
use crate::events::{ConnectionId, Event};
use crate::heads::Heads;
use crate::master::{MasterError, MasterOutcome, Plan};
use crate::notice::NoticeSender;
use crate::session::{Bytes, NodeLink};
use errors::Measuring;

/// Events handled before time is looked at again.
const MOST_EVENTS_AT_ONCE: usize = 1_024;
/// Between two notices of progress, and between two of settling.
const PROGRESS_US: i64 = 250_000;
const SETTLING_US: i64 = 1_000_000;
/// After the last presentation nodes have this long to report it before they are sent home.
const LAST_REPORTS_US: i64 = 100_000;
/// How long nodes have to say good-bye.
const FAREWELL_US: i64 = 1_500_000;

/// How far the run is.
enum Phase {
    /// Nodes arrive; nothing is shown.
    Gathering,
    /// Frames go out until every node keeps step; they count for nothing.
    WarmingUp,
    /// Frames count.
    Running { first_frame: u64, start_us: i64 },
    /// The camera holds still for the capture.
    Settling { capture: Capture, since_us: i64 },
    /// The last frame is out; its reports come in.
    LastReports { until_us: i64 },
    /// No frame follows; nodes measure the error of the picture that stands.
    Measuring(Measuring),
    /// Nodes have been sent home.
    Leaving { until_us: i64 },
}

/// The state of a run.
pub(crate) struct FrameLoop {
    wall: Arc<Wall>,
    plan: Plan,
    director: Director,
    heads: Heads,
    wall_revision: u32,
    /// What each output of each host shows instead of the scene.
    patterns: Vec<Vec<Option<Pattern>>>,
    changes: Changes,
    /// The number given to a revision last.
    latest_revision: u64,
    /// The revision that the next frame is the first to show, and how many members have not prepared it.
    unseen: Option<(u64, usize)>,
    refused: Option<RefusedChange>,
    /// The lens that each node's pointer holds.
    dragged: Vec<Option<String>>,
    membership: Membership,
    barrier: Option<Barrier>,
    recorder: Recorder,
    notices: NoticeSender,
    phase: Phase,
    started_us: i64,
    seats: HashMap<ConnectionId, Seat>,
    links: Vec<Option<(ConnectionId, NodeLink)>>,
    faults: Vec<Option<String>>,
    view: Option<Bytes>,
    shutdown: Bytes,
    ask_for_pictures: Bytes,
    ask_for_error: Bytes,
    /// Frames whose presentations are measured: from the first, up to the last once it is known.
    measured: Option<(u64, u64)>,
    notice_due_us: i64,
    captures: Option<Capture>,
    failure: Option<MasterError>,
    stopped: bool,
    over: bool,
}

impl FrameLoop {
    pub(crate) fn new(
        wall: Arc<Wall>,
        director: Director,
        heads: Heads,
        session: u64,
        plan: Plan,
        notices: NoticeSender,
    ) -> Result<Self, EncodeError> {
        let mut recorder = Recorder::new(&wall);
        recorder.scene(director.encoded_scene().len());
        // A wall that cannot be sent is told now, not to the first node.
        encode_to_node(&ToNode::Welcome {
            host: 0,
            wall: Box::new((*wall).clone()),
        })?;
        Ok(Self {
            membership: Membership::new(&wall, session, env!("CARGO_PKG_VERSION")),
            plan,
            director,
            heads,
            wall_revision: 0,
            patterns: wall
                .hosts
                .iter()
                .map(|host| vec![None; host.outputs.len()])
                .collect(),
            changes: Changes::new(FIRST_REVISION),
            latest_revision: FIRST_REVISION,
            unseen: None,
            refused: None,
            dragged: vec![None; wall.hosts.len()],
            barrier: None,
            recorder,
            notices,
            phase: Phase::Gathering,
            started_us: link::now_us(),
            seats: HashMap::new(),
            links: wall.hosts.iter().map(|_| None).collect(),
            faults: vec![None; wall.hosts.len()],
            view: None,
            shutdown: Arc::from(encode_to_node(&ToNode::Shutdown)?),
            ask_for_pictures: Arc::from(encode_to_node(&ToNode::Capture { id: Capture::ID })?),
            ask_for_error: Arc::from(encode_to_node(&ToNode::MeasureError)?),
            measured: None,
            notice_due_us: 0,
            captures: None,
            failure: None,
            stopped: false,
            over: false,
            wall,
        })
    }

    /// Runs to the end.
    pub(crate) fn run(mut self, queue: &Receiver<Event>) -> Result<MasterOutcome, MasterError> {
        link::use_precise_timers();
        link::go_before_others();
        while !self.over {
            let wait_us = self.next_wake_us().saturating_sub(link::now_us()).max(0);
            match queue.recv_timeout(Duration::from_micros(wait_us.unsigned_abs())) {
                Ok(event) => {
                    self.event(event);
                    for event in queue.try_iter().take(MOST_EVENTS_AT_ONCE) {
                        self.event(event);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => self.stop(),
            }
            self.advance(link::now_us());
        }
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        let mut report = self.recorder.report(&self.membership);
        let captures = self
            .captures
            .map(|capture| capture.into_outputs(&self.wall));
        report.converged |= captures.is_some();
        report.trackers = self.heads.report();
        Ok(MasterOutcome {
            report,
            captures: captures.unwrap_or_default(),
            stopped: self.stopped,
        })
    }

    fn next_wake_us(&self) -> i64 {
        let us = |duration: Duration| i64::try_from(duration.as_micros()).unwrap_or(i64::MAX);
        let start = [self.plan.start_after, self.plan.start_timeout]
            .into_iter()
            .flatten();
        let start_us = start.map(|wait| self.started_us.saturating_add(us(wait)));
        let now_us = link::now_us();
        let phase_us = match &self.phase {
            Phase::Gathering | Phase::WarmingUp => start_us
                .filter(|moment_us| *moment_us > now_us)
                .min()
                .unwrap_or(i64::MAX),
            Phase::Running { .. } => i64::MAX,
            Phase::Settling { since_us, .. } => self
                .notice_due_us
                .min(since_us.saturating_add(us(self.plan.capture_timeout))),
            Phase::LastReports { until_us } | Phase::Leaving { until_us } => *until_us,
            Phase::Measuring(measuring) => self.notice_due_us.min(measuring.until_us),
        };
        let barrier = self.barrier.as_ref().filter(|_| self.frames_go_on());
        let moments_us = [
            Some(phase_us),
            barrier.map(Barrier::next_wake_us),
            self.changes.next_wake_us(),
        ];
        moments_us.into_iter().flatten().min().unwrap_or(i64::MAX)
    }

    /// Whether the barrier's time runs. While pictures are read back nobody could keep its deadlines.
    fn frames_go_on(&self) -> bool {
        match &self.phase {
            Phase::WarmingUp | Phase::Running { .. } => true,
            Phase::Settling { capture, .. } => !capture.is_asked(),
            Phase::Gathering
            | Phase::LastReports { .. }
            | Phase::Measuring(_)
            | Phase::Leaving { .. } => false,
        }
    }

    fn advance(&mut self, now_us: i64) {
        let waited_us = now_us.saturating_sub(self.started_us).max(0).unsigned_abs();
        let passed = |limit: Option<Duration>| {
            limit.is_some_and(|limit| waited_us >= limit.as_micros() as u64)
        };
        match &self.phase {
            Phase::Gathering | Phase::WarmingUp if passed(self.plan.start_timeout) => {
                self.fail(MasterError::NotComplete {
                    waited_s: waited_us / 1_000_000,
                    waits_for: self.start_waits_for(),
                });
            }
            Phase::Gathering => self.open(passed(self.plan.start_after), now_us),
            Phase::Settling { .. } => self.settle(now_us),
            Phase::LastReports { until_us } if now_us >= *until_us => self.measure_error(now_us),
            Phase::Measuring(_) => self.await_errors(now_us),
            Phase::Leaving { until_us } => {
                self.over = now_us >= *until_us || self.links.iter().all(Option::is_none);
            }
            _ => {}
        }
        self.look_after_changes(now_us);
        if self.frames_go_on()
            && let Some(barrier) = &mut self.barrier
            && now_us >= barrier.next_wake_us()
        {
            let actions = barrier.tick(now_us);
            self.perform(actions);
        }
    }

    /// Begins to send frames, once the whole wall is there or it was waited for long enough.
    fn open(&mut self, waited_enough: bool, now_us: i64) {
        let connected = self.links.iter().flatten().count();
        if connected == self.links.len() || (waited_enough && connected > 0) {
            let mut barrier = Barrier::new(BarrierOptions::new(self.wall.fps), now_us);
            for (node, _) in self
                .links
                .iter()
                .enumerate()
                .filter(|(_, link)| link.is_some())
            {
                // Nothing is in flight that would have to be sent.
                let _none = barrier.connected(node);
            }
            self.barrier = Some(barrier);
            self.phase = Phase::WarmingUp;
        }
    }

    fn stop(&mut self) {
        match self.phase {
            Phase::LastReports { .. } | Phase::Leaving { .. } => {}
            // All frames were shown, and nobody is waited for any longer.
            Phase::Measuring(_) => self.give_up_errors("the run was stopped"),
            _ => {
                self.stopped = true;
                let until_us = link::now_us() + LAST_REPORTS_US;
                self.phase = Phase::LastReports { until_us };
            }
        }
    }

    fn fail(&mut self, error: MasterError) {
        self.failure.get_or_insert(error);
        if !matches!(self.phase, Phase::Leaving { .. }) {
            self.send_home(link::now_us());
        }
    }

    fn send_home(&mut self, now_us: i64) {
        self.phase = Phase::Leaving {
            until_us: now_us + FAREWELL_US,
        };
        let shutdown = Arc::clone(&self.shutdown);
        for node in 0..self.links.len() {
            self.tell(node, &shutdown);
        }
        // Without nodes there is nobody to wait for.
        self.over = self.links.iter().all(Option::is_none);
    }
}
