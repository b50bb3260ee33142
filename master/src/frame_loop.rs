//! The master's frame loop: one thread that owns barrier, membership and report, and waits for nobody.
//! In: events of the network, time. Out: views and swaps into the nodes' slots, notices, the outcome. Whom to
//! wait for is decided by `protocol::barrier`, who belongs to the wall by `protocol::membership`; here it
//! is done.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use link::CloseCode;
use protocol::barrier::{Action, Barrier, BarrierOptions, LeaveReason, NodeId};
use protocol::codec::{EncodeError, encode_to_node};
use protocol::membership::{Membership, Seat};
use protocol::message::{Hello, Swap};
use protocol::report::Recorder;
use protocol::{ToMaster, ToNode, Wall};

use crate::capture::Capture;
use crate::director::{CameraTime, Director, FrameRequest};
use crate::events::{ConnectionId, Event};
use crate::master::{MasterError, MasterOutcome, Notice, NoticeSender, Plan};
use crate::session::{Bytes, NodeLink};

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
    /// Nodes have been sent home.
    Leaving { until_us: i64 },
}

/// The state of a run.
pub(crate) struct FrameLoop {
    wall: Arc<Wall>,
    plan: Plan,
    director: Director,
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
        };
        let barrier_us = self.barrier.as_ref().filter(|_| self.frames_go_on());
        barrier_us.map_or(phase_us, |barrier| phase_us.min(barrier.next_wake_us()))
    }

    /// Whether the barrier's time runs. While pictures are read back nobody could keep its deadlines.
    fn frames_go_on(&self) -> bool {
        match &self.phase {
            Phase::WarmingUp | Phase::Running { .. } => true,
            Phase::Settling { capture, .. } => !capture.is_asked(),
            Phase::Gathering | Phase::LastReports { .. } | Phase::Leaving { .. } => false,
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
            Phase::Settling { capture, since_us } => {
                let settled_us = now_us.saturating_sub(*since_us).max(0).unsigned_abs();
                if capture.is_complete() {
                    self.take_captures();
                } else if settled_us >= self.plan.capture_timeout.as_micros() as u64 {
                    self.fail(MasterError::NotConverged {
                        waited_s: settled_us / 1_000_000,
                        waits_for: capture.waits_for(self.membership.nodes()),
                    });
                } else if now_us >= self.notice_due_us {
                    self.notice_due_us = now_us + SETTLING_US;
                    let waits_for = capture.waits_for(self.membership.nodes());
                    self.notices.send(Notice::Settling { waits_for });
                }
            }
            Phase::LastReports { until_us } if now_us >= *until_us => self.send_home(now_us),
            Phase::Leaving { until_us } => {
                self.over = now_us >= *until_us || self.links.iter().all(Option::is_none);
            }
            _ => {}
        }
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

    /// Begins to count frames, once every node keeps step.
    fn begin_to_count(&mut self, request: &FrameRequest) {
        let waited_us = link::now_us().saturating_sub(self.started_us);
        let waited_enough = self
            .plan
            .start_after
            .is_some_and(|wait| waited_us as u128 >= wait.as_micros());
        let records = self.membership.nodes();
        let nodes = records.iter().filter(|record| record.member).count();
        let all_there = records
            .iter()
            .all(|record| record.member || !record.connected);
        if self.membership.is_complete() || (waited_enough && all_there && nodes > 0) {
            self.recorder.restart();
            self.measured = Some((request.frame, u64::MAX));
            self.phase = Phase::Running {
                first_frame: request.frame,
                start_us: request.presented_from_us,
            };
            self.notices.send(Notice::Started {
                nodes,
                hosts: self.links.len(),
            });
        }
    }

    fn event(&mut self, event: Event) {
        let now_us = link::now_us();
        match event {
            Event::Hello {
                id,
                address,
                hello,
                link,
            } => match self.membership.hello(&hello, now_us) {
                Ok(admission) => {
                    if let Some(replaced) = admission.replaced {
                        self.forget(replaced.node, now_us);
                    }
                    self.notices.send(Notice::Joined {
                        node: hello.node,
                        adapter: hello.adapter,
                        address,
                    });
                    self.welcome(id, admission.seat, link);
                }
                Err(refusal) => {
                    self.refuse(&hello, &link, &refusal);
                    let (node, reason) = (hello.node, refusal.to_string());
                    self.notices.send(Notice::Refused {
                        node,
                        address,
                        reason,
                    });
                }
            },
            Event::Said { id, at_us, message } => {
                if let Some(seat) = self.seats.get(&id).copied()
                    && self.membership.heard(seat, at_us)
                {
                    self.said(seat.node, at_us, message);
                }
            }
            Event::Captured { id, result } => {
                if let Some(seat) = self.seats.get(&id).copied()
                    && self.membership.heard(seat, now_us)
                {
                    match result {
                        Ok(pictures) => {
                            if let Phase::Settling { capture, .. } = &mut self.phase {
                                capture.pictures(seat.node, pictures);
                            }
                        }
                        // If the node is gone, its successor sends them.
                        Err(reason) => tracing::warn!(reason, "a capture did not arrive"),
                    }
                }
            }
            Event::Gone { id, reason } => {
                if let Some(seat) = self.seats.remove(&id)
                    && self.membership.lost(seat)
                {
                    let node = self.name(seat.node);
                    self.notices.send(Notice::Disconnected { node, reason });
                    self.forget(seat.node, now_us);
                }
            }
            Event::Stranger { address, reason } => {
                self.notices.send(Notice::Stranger { address, reason });
            }
            Event::SetScene(scene) => match self.director.set_scene(*scene) {
                Ok(()) => {
                    let message = Arc::clone(self.director.encoded_scene());
                    self.recorder.scene(message.len());
                    for node in 0..self.links.len() {
                        self.tell(node, &message);
                    }
                }
                Err(error) => self.recorder.error(error.to_string()),
            },
            Event::Stop => self.stop(),
        }
    }

    fn welcome(&mut self, id: ConnectionId, seat: Seat, link: NodeLink) {
        let wall = Box::new((*self.wall).clone());
        let welcome = ToNode::Welcome {
            host: seat.node as u32,
            wall,
        };
        let Ok(welcome) = encode_to_node(&welcome) else {
            // The same wall was encoded at the start.
            return;
        };
        self.seats.insert(id, seat);
        if let Some(slot) = self.links.get_mut(seat.node) {
            *slot = Some((id, link));
        }
        self.tell(seat.node, &Arc::from(welcome));
        let scene = Arc::clone(self.director.encoded_scene());
        self.tell(seat.node, &scene);
        if matches!(self.phase, Phase::Leaving { .. }) {
            let shutdown = Arc::clone(&self.shutdown);
            self.tell(seat.node, &shutdown);
        }
        if let Some(barrier) = &mut self.barrier {
            let actions = barrier.connected(seat.node);
            self.perform(actions);
        }
    }

    fn refuse(&self, hello: &Hello, link: &NodeLink, refusal: &protocol::membership::Refusal) {
        let reason = refusal.to_string();
        let message = ToNode::Refused {
            reason: reason.clone(),
            retry_after_ms: refusal.retry_after_ms(),
        };
        if let Ok(bytes) = encode_to_node(&message)
            && !link.dismiss(&Arc::from(bytes), CloseCode::Refused, &reason)
        {
            tracing::debug!(
                node = hello.node,
                "a refused node was gone before it was told"
            );
        }
    }

    fn said(&mut self, node: NodeId, at_us: i64, message: ToMaster) {
        match message {
            ToMaster::Ready {
                epoch,
                frame,
                converged,
                pending_tiles,
            } => {
                if let Phase::Settling { capture, .. } = &mut self.phase {
                    capture.ready(node, frame, converged, pending_tiles);
                    if capture.ask_now() {
                        let message = Arc::clone(&self.ask_for_pictures);
                        for node in 0..self.links.len() {
                            self.tell(node, &message);
                        }
                    }
                }
                if let Some(barrier) = &mut self.barrier {
                    let actions = barrier.ready(node, epoch, frame, at_us);
                    self.perform(actions);
                }
            }
            ToMaster::Presented(presented) => {
                self.membership.presented(node, presented.presented_us);
                if let Some(barrier) = &mut self.barrier {
                    barrier.slack_reported(i64::from(presented.swap_slack_us));
                }
                if self
                    .measured
                    .is_some_and(|(first, last)| (first..=last).contains(&presented.frame))
                {
                    self.recorder.presented(node, &presented);
                }
            }
            ToMaster::Counters { tiles, new_tiles } => {
                self.recorder.counters(node, tiles, &new_tiles);
            }
            ToMaster::Fault { message } => {
                let name = self.name(node);
                self.recorder.error(format!("node \"{name}\": {message}"));
                if let Some(fault) = self.faults.get_mut(node) {
                    *fault = Some(message.clone());
                }
                self.notices.send(Notice::Fault {
                    node: name,
                    message,
                });
            }
            ToMaster::CaptureFailed { reason, .. } => {
                let node = self.name(node);
                self.fail(MasterError::Capture { node, reason });
            }
            ToMaster::Steer(steer) => self.director.steer(&steer, at_us),
            ToMaster::Bye { reason } => {
                let node = self.name(node);
                self.notices.send(Notice::Left { node, reason });
            }
            // Being heard was all that mattered; pictures have a way of their own.
            ToMaster::ClockPing { .. }
            | ToMaster::Hello(_)
            | ToMaster::CaptureRows(_)
            | ToMaster::CaptureDone { .. } => {}
        }
    }

    fn perform(&mut self, actions: Vec<Action>) {
        for action in actions {
            match action {
                Action::Entered { node } => {
                    self.membership.entered(node);
                    let node = self.name(node);
                    self.notices.send(Notice::Entered { node });
                }
                Action::Left { node, reason } => {
                    self.membership.left(node);
                    if reason == LeaveReason::Deadlines {
                        let reason = "it missed its deadlines".to_owned();
                        let node = self.name(node);
                        self.notices.send(Notice::Left { node, reason });
                    }
                }
                Action::Missed { node, .. } => self.membership.missed(node),
                Action::BeginFrame { .. } => {
                    if let Some(request) = FrameRequest::from_action(&action) {
                        self.begin_frame(request);
                    }
                }
                Action::Resend { nodes, .. } => {
                    for node in nodes {
                        if let (Some(view), Some(Some((_, link)))) =
                            (&self.view, self.links.get(node))
                        {
                            link.show(view);
                        }
                    }
                }
                Action::Swap(swap) => self.swap(swap),
            }
        }
    }

    fn begin_frame(&mut self, request: FrameRequest) {
        if matches!(self.phase, Phase::WarmingUp) {
            self.begin_to_count(&request);
        }
        let time = match (&self.phase, self.plan.frames) {
            (Phase::Running { first_frame, .. }, Some(_)) => CameraTime::Steps {
                frame: request.frame.saturating_sub(*first_frame),
                fps: self.wall.fps,
            },
            (Phase::Running { start_us, .. }, None) => CameraTime::Clock {
                start_us: *start_us,
            },
            (Phase::Gathering | Phase::WarmingUp, _) => CameraTime::Waiting,
            (Phase::Settling { .. } | Phase::LastReports { .. } | Phase::Leaving { .. }, _) => {
                CameraTime::Held
            }
        };
        let view = match self.director.view(request, time, link::now_us()) {
            Ok(view) => view,
            Err(error) => return self.fail(MasterError::Encode(error.to_string())),
        };
        self.recorder.view(view.len());
        for (_, link) in self.links.iter().flatten() {
            link.show(&view);
        }
        self.view = Some(view);
    }

    fn swap(&mut self, swap: Swap) {
        let Ok(bytes) = encode_to_node(&ToNode::Swap(swap)) else {
            return;
        };
        let bytes: Bytes = Arc::from(bytes);
        for (_, link) in self.links.iter().flatten() {
            link.swap(&bytes);
        }
        let Phase::Running { first_frame, .. } = self.phase else {
            return;
        };
        let frame = swap.frame.saturating_sub(first_frame) + 1;
        let last = self.plan.frames.is_some_and(|frames| frame >= frames);
        let now_us = link::now_us();
        if last || now_us >= self.notice_due_us {
            self.notice_due_us = now_us + PROGRESS_US;
            self.notices.send(Notice::Progress {
                frame,
                frames: self.plan.frames,
            });
        }
        if !last {
            return;
        }
        self.measured = Some((first_frame, swap.frame));
        self.notice_due_us = now_us;
        self.phase = if self.plan.capture {
            let capture = Capture::new(&self.wall, swap.frame + 1);
            Phase::Settling {
                capture,
                since_us: now_us,
            }
        } else {
            Phase::LastReports {
                until_us: swap.present_at_us + LAST_REPORTS_US,
            }
        };
    }

    fn take_captures(&mut self) {
        let until_us = link::now_us();
        let phase = std::mem::replace(&mut self.phase, Phase::LastReports { until_us });
        if let Phase::Settling { capture, .. } = phase {
            self.captures = Some(capture);
        }
    }

    fn stop(&mut self) {
        if !matches!(
            self.phase,
            Phase::LastReports { .. } | Phase::Leaving { .. }
        ) {
            self.stopped = true;
            let until_us = link::now_us() + LAST_REPORTS_US;
            self.phase = Phase::LastReports { until_us };
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
    }

    /// Queues a message for a node. One that has let its queue overflow is given up.
    fn tell(&mut self, node: NodeId, message: &Bytes) {
        let taken = match self.links.get(node) {
            Some(Some((_, link))) => link.tell(message),
            _ => return,
        };
        if !taken {
            tracing::warn!(
                node = self.name(node),
                "the node takes no messages and is given up"
            );
            // Letting go of the link ends the connection, and the barrier hears of it as of any other end.
            if let Some(link) = self.links.get_mut(node) {
                *link = None;
            }
        }
    }

    /// A node's link is of no use any longer.
    fn forget(&mut self, node: NodeId, now_us: i64) {
        if let Some(link) = self.links.get_mut(node) {
            *link = None;
        }
        if let Phase::Settling { capture, .. } = &mut self.phase {
            capture.lost(node);
        }
        if let Some(barrier) = &mut self.barrier {
            let actions = barrier.disconnected(node, now_us);
            self.perform(actions);
        }
    }

    /// Whom the start waits for and why, one sentence a node.
    fn start_waits_for(&self) -> Vec<String> {
        let records = self.membership.nodes().iter().zip(&self.faults);
        let waiting = records.filter(|(record, _)| !record.member);
        waiting
            .map(|(record, fault)| {
                let name = &record.name;
                match (fault, record.connected) {
                    (Some(fault), _) => format!("node \"{name}\" says: {fault}"),
                    (None, false) => format!("node \"{name}\" is not connected"),
                    (None, true) => format!("node \"{name}\" has not drawn its first picture"),
                }
            })
            .collect()
    }

    fn name(&self, node: NodeId) -> String {
        self.wall
            .hosts
            .get(node)
            .map(|host| host.name.clone())
            .unwrap_or_default()
    }
}
