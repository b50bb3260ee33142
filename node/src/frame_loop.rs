//! The frame loop of a node: newest view → draw → ready → swap → present → report.
//! In: the mailbox, a maker of pictures. Out: pictures, and what is said about them. It is a machine that is
//! driven step by step, by a plain loop or by a window system, and does one thing at a time. The order of
//! things is decided by [`protocol::follower`]; here they are done.

use std::collections::VecDeque;
use std::sync::Arc;

use protocol::follower::{Follower, Step};
use protocol::message::{MAX_NEW_TILES, Presented, Steer, Swap};
use protocol::{Scene, ToMaster, View, Wall};
use winit::window::Window;

use crate::mail::{Arrived, End, Inbox, Mail, Outgoing};
use crate::picture::{Drawn, Picture, PictureError, PictureMaker, PictureRequest};
use crate::priority::Priority;
use crate::{NodeError, NodeOutcome};

/// Up to here before its moment a presentation is waited for in the driver, which also takes mail; then
/// the thread sleeps for the presentation alone.
const LAST_SLEEP_US: i64 = 6_000;
/// After a presentation the next drawing waits this long, so that every other node of this host, waiting
/// for a processor, can present as well. Without it the first to present keeps the others from it.
const PRESENT_PAUSE_US: i64 = 400;
/// How often the caches' counters are told.
const COUNTERS_INTERVAL_US: i64 = 500_000;
/// Arrivals of swaps that are remembered.
const REMEMBERED_SWAPS: usize = 4;

/// What the driver has to do before it calls [`FrameLoop::step`] again.
pub(crate) enum Next {
    /// Nothing.
    Again,
    /// Wait for mail, at most until this moment of this host's clock.
    Wait {
        /// The moment.
        until_us: Option<i64>,
    },
    /// Open the windows of a host and pass them to [`FrameLoop::use_windows`].
    OpenWindows {
        /// The wall.
        wall: Arc<Wall>,
        /// Index of the host.
        host: usize,
    },
    /// The node has left.
    Finished(Result<NodeOutcome, NodeError>),
}

/// A frame that is drawn and has not been presented.
struct Waiting {
    view_sent_us: i64,
    view_latency_us: i64,
    draw_us: i64,
    drawn: Drawn,
}

/// The frame loop's state.
pub(crate) struct FrameLoop {
    mail: Arc<Mail>,
    maker: Box<dyn PictureMaker>,
    wall: Option<(Arc<Wall>, usize)>,
    picture: Option<Box<dyn Picture>>,
    /// The scene that the picture has, or the one that it could not take.
    scene_revision: Option<u64>,
    scene_works: bool,
    /// A scene that waits for the picture to be made.
    next_scene: Option<(u64, Box<Scene>)>,
    /// A view that waits for its scene.
    early_view: Option<Arrived<View>>,
    follower: Follower,
    steps: VecDeque<Step>,
    /// Latency of the view that is being drawn, by frame.
    view_latency_us: (u64, i64),
    /// When swaps arrived, on the master's clock, by frame.
    swaps_us: VecDeque<(u64, i64)>,
    waiting: Option<Waiting>,
    presenting: Option<Swap>,
    priority: Priority,
    rest_until_us: i64,
    counters_due_us: i64,
    outcome: NodeOutcome,
    failure: Option<NodeError>,
    leaving: bool,
}

impl FrameLoop {
    pub(crate) fn new(mail: Arc<Mail>, maker: Box<dyn PictureMaker>) -> Self {
        Self {
            mail,
            maker,
            wall: None,
            picture: None,
            scene_revision: None,
            scene_works: false,
            next_scene: None,
            early_view: None,
            follower: Follower::new(60.0),
            steps: VecDeque::new(),
            view_latency_us: (0, 0),
            swaps_us: VecDeque::new(),
            waiting: None,
            presenting: None,
            priority: Priority::of_this_thread(),
            rest_until_us: i64::MIN,
            counters_due_us: i64::MAX,
            outcome: NodeOutcome::default(),
            failure: None,
            leaving: false,
        }
    }

    /// Does the next thing.
    pub(crate) fn step(&mut self) -> Next {
        if let Some(inbox) = self.mail.take_inbox()
            && let Some(next) = self.receive(inbox)
        {
            return next;
        }
        if let Some(swap) = self.presenting {
            return self.present(swap);
        }
        match self.steps.pop_front() {
            Some(Step::Draw(view)) => self.draw(&view),
            Some(Step::SayReady { epoch, frame }) => self.say_ready(epoch, frame),
            Some(Step::Present(swap)) => self.presenting = Some(swap),
            None => {
                if self.waiting.is_some() {
                    // Drawn and ready: nothing but the swap and the presentation can come next.
                    self.priority.raise();
                }
                if link::now_us() >= self.counters_due_us {
                    self.tell_counters();
                }
                let until_us = (self.counters_due_us != i64::MAX).then_some(self.counters_due_us);
                return Next::Wait { until_us };
            }
        }
        Next::Again
    }

    /// Makes the picture in the windows that [`Next::OpenWindows`] asked for.
    pub(crate) fn use_windows(&mut self, windows: Vec<Option<Arc<Window>>>) {
        let Some((wall, host)) = self.wall.clone() else {
            return;
        };
        match self.maker.make(PictureRequest {
            wall: &wall,
            host,
            windows,
        }) {
            Ok(picture) => {
                self.picture = Some(picture);
                self.take_scene();
            }
            Err(error) => self.fail(error.into()),
        }
    }

    /// Passes the operator's movements on to the master.
    pub(crate) fn steer(&self, steer: Steer) {
        self.mail
            .send(Outgoing::Message(ToMaster::Steer(steer)), true);
    }

    /// Shows the last picture once more: the window system has lost it.
    pub(crate) fn show_again(&mut self) {
        if let (Some(picture), None, true) =
            (&mut self.picture, self.presenting, self.outcome.frames > 0)
            && let Err(error) = picture.present()
        {
            tracing::warn!(%error, "the picture cannot be shown again");
        }
    }

    /// Says good-bye to the master and ends the node.
    pub(crate) fn leave(&mut self, reason: &str) {
        if std::mem::replace(&mut self.leaving, true) {
            return;
        }
        self.tell_counters();
        let bye = ToMaster::Bye {
            reason: reason.to_owned(),
        };
        self.mail.send(Outgoing::Message(bye), true);
        self.mail.request_stop();
    }

    /// Ends the node with an error that the master hears of too.
    pub(crate) fn fail(&mut self, error: NodeError) {
        let message = error.to_string();
        self.mail.send(
            Outgoing::Message(ToMaster::Fault {
                message: message.clone(),
            }),
            true,
        );
        self.failure.get_or_insert(error);
        self.leave(&message);
    }

    fn receive(&mut self, inbox: Inbox) -> Option<Next> {
        if let Some(end) = inbox.ended {
            let result = match (self.failure.take(), end) {
                (Some(failure), _) => Err(failure),
                (None, End::Failed(error)) => Err(error.into()),
                (None, End::Left) => Ok(self.outcome),
            };
            return Some(Next::Finished(result));
        }
        if inbox.disconnected {
            self.forget_master();
        }
        if inbox.leave {
            self.leave("the run is over");
        }
        if inbox.welcome.is_some() || inbox.scene.is_some() || inbox.capture.is_some() {
            // These take their time.
            self.priority.lower();
        }
        let mut next = None;
        if let Some((wall, host)) = inbox.welcome {
            next = self.welcome(wall, host);
        }
        if let Some(scene) = inbox.scene {
            self.next_scene = Some(scene);
            self.take_scene();
        }
        for Arrived { content, at_us } in inbox.swaps {
            self.remember_swap(content.frame, at_us);
            let now_us = self.master_now_us();
            self.steps.extend(self.follower.swap(content, now_us));
        }
        if let Some(view) = inbox.view {
            self.view(view);
        }
        if let Some(id) = inbox.capture {
            self.capture(id);
        }
        next
    }

    /// What was agreed with the last master counts no longer; the picture stays.
    fn forget_master(&mut self) {
        let fps = self.wall.as_ref().map_or(60.0, |(wall, _)| wall.fps);
        self.follower = Follower::new(fps);
        self.steps.clear();
        self.swaps_us.clear();
        self.waiting = None;
        self.presenting = None;
        self.early_view = None;
        self.next_scene = None;
        self.counters_due_us = i64::MAX;
        self.priority.lower();
    }

    fn welcome(&mut self, wall: Arc<Wall>, host: usize) -> Option<Next> {
        let known = self
            .wall
            .as_ref()
            .is_some_and(|(known, at)| **known == *wall && *at == host);
        self.wall = Some((Arc::clone(&wall), host));
        self.forget_master();
        // Revisions are numbers of one run of one master.
        self.scene_revision = None;
        self.scene_works = false;
        self.counters_due_us = link::now_us() + COUNTERS_INTERVAL_US;
        if known && self.picture.is_some() {
            return None;
        }
        self.picture = None;
        Some(Next::OpenWindows { wall, host })
    }

    /// Gives the picture the newest scene, as soon as there are both.
    fn take_scene(&mut self) {
        let Some(picture) = &mut self.picture else {
            return;
        };
        let Some((revision, scene)) = self.next_scene.take() else {
            return;
        };
        self.scene_revision = Some(revision);
        let taken = picture.set_scene(revision, &scene);
        self.scene_works = taken.is_ok();
        match taken {
            Ok(()) => {}
            Err(error @ PictureError::Unavailable(_)) => return self.fail(error.into()),
            Err(error) => self.fault(&error),
        }
        if let Some(view) = self.early_view.take() {
            self.view(view);
        }
    }

    fn view(&mut self, view: Arrived<View>) {
        match self.scene_revision {
            // The view overtook its scene: the datagram was faster than the stream.
            None => self.early_view = Some(view),
            Some(revision) if revision < view.content.scene_revision => {
                self.early_view = Some(view);
            }
            // A scene that cannot be shown is not drawn: the last picture stays, the master knows.
            Some(_) if !self.scene_works => {}
            Some(_) => {
                let Arrived { content, at_us } = view;
                let arrived_us = self.mail.clock(|clock| clock.master_us(at_us));
                if content.frame > self.follower.newest_frame() {
                    self.view_latency_us =
                        (content.frame, arrived_us.saturating_sub(content.sent_us));
                }
                if let Some(swap) = content.previous_swap {
                    self.remember_swap(swap.frame, at_us);
                }
                let now_us = self.master_now_us();
                self.steps.extend(self.follower.view(content, now_us));
            }
        }
    }

    fn draw(&mut self, view: &View) {
        let Some(picture) = &mut self.picture else {
            return;
        };
        self.priority.lower();
        link::sleep_until_us(self.rest_until_us);
        let start_us = link::now_us();
        let drawn = match picture.draw(view) {
            Ok(drawn) => Some(drawn),
            Err(error @ PictureError::Unavailable(_)) => return self.fail(error.into()),
            Err(error) => {
                self.fault(&error);
                None
            }
        };
        let view_latency_us = match self.view_latency_us {
            (frame, latency_us) if frame == view.frame => latency_us,
            _ => 0,
        };
        self.waiting = drawn.map(|drawn| Waiting {
            view_sent_us: view.sent_us,
            view_latency_us,
            draw_us: link::now_us() - start_us,
            drawn,
        });
        let now_us = self.master_now_us();
        let steps = self.follower.drawn(view.epoch, view.frame, now_us);
        // A frame that failed is not ready: the wall goes on without this node after a deadline.
        let failed = self.waiting.is_none();
        self.steps.extend(
            steps
                .into_iter()
                .filter(|step| !(failed && matches!(step, Step::SayReady { .. }))),
        );
    }

    fn say_ready(&self, epoch: u32, frame: u64) {
        let drawn = self
            .waiting
            .as_ref()
            .map_or_else(Drawn::default, |waiting| waiting.drawn);
        let ready = ToMaster::Ready {
            epoch,
            frame,
            converged: drawn.converged,
            pending_tiles: drawn.pending_tiles,
        };
        self.mail.send(Outgoing::Datagram(ready), true);
    }

    fn present(&mut self, swap: Swap) -> Next {
        let moment_us = self.mail.clock(|clock| clock.node_us(swap.present_at_us));
        if moment_us - link::now_us() > LAST_SLEEP_US {
            return Next::Wait {
                until_us: Some(moment_us - LAST_SLEEP_US),
            };
        }
        self.priority.raise();
        link::sleep_until_us(moment_us);
        let now_us = self.master_now_us();
        if !self.follower.is_due(now_us) {
            // This process was held up for so long that the wall has gone on.
            self.presenting = None;
            self.waiting = None;
            self.priority.lower();
            let steps = self.follower.dropped(now_us);
            self.steps.extend(steps);
            return Next::Again;
        }
        let presented = self.picture.as_mut().map(|picture| picture.present());
        let presented_us = link::now_us();
        self.priority.lower();
        self.presenting = None;
        self.rest_until_us = presented_us + PRESENT_PAUSE_US;
        if let Some(Err(error)) = presented {
            self.fault(&error);
        } else if let Some(waiting) = self.waiting.take() {
            self.outcome.frames += 1;
            self.tell_presented(swap, &waiting, presented_us);
        }
        let now_us = self.master_now_us();
        let steps = self.follower.presented(now_us);
        self.steps.extend(steps);
        Next::Again
    }

    fn tell_presented(&self, swap: Swap, waiting: &Waiting, presented_us: i64) {
        let (presented_us, error_us) = self
            .mail
            .clock(|clock| (clock.master_us(presented_us), clock.error_us(presented_us)));
        let arrived_us = self.swaps_us.iter().find(|(frame, _)| *frame == swap.frame);
        let slack_us = arrived_us.map_or(0, |(_, at_us)| swap.present_at_us.saturating_sub(*at_us));
        let presented = Presented {
            epoch: swap.epoch,
            frame: swap.frame,
            presented_us,
            clock_error_us: unsigned(error_us),
            view_latency_us: signed(waiting.view_latency_us),
            view_to_present_us: unsigned(presented_us.saturating_sub(waiting.view_sent_us)),
            swap_slack_us: signed(slack_us),
            draw_us: unsigned(waiting.draw_us),
            redrawn: waiting.drawn.redrawn,
            triangles: waiting.drawn.triangles,
            converged: waiting.drawn.converged,
        };
        self.mail
            .send(Outgoing::Message(ToMaster::Presented(presented)), false);
    }

    fn capture(&mut self, id: u32) {
        self.tell_counters();
        let outgoing = match self.picture.as_mut().map(|picture| picture.capture()) {
            Some(Ok(pictures)) => Outgoing::Pictures(id, pictures),
            Some(Err(error)) => Outgoing::Message(ToMaster::CaptureFailed {
                id,
                reason: error.to_string(),
            }),
            None => {
                let reason = "nothing has been drawn".to_owned();
                Outgoing::Message(ToMaster::CaptureFailed { id, reason })
            }
        };
        self.mail.send(outgoing, true);
    }

    fn tell_counters(&mut self) {
        let Some(picture) = &mut self.picture else {
            return;
        };
        loop {
            let new_tiles = picture.take_new_tiles(MAX_NEW_TILES);
            let more = new_tiles.len() >= MAX_NEW_TILES;
            let counters = ToMaster::Counters {
                tiles: picture.counters(),
                new_tiles,
            };
            self.mail.send(Outgoing::Message(counters), false);
            if !more {
                break;
            }
        }
        self.counters_due_us = link::now_us() + COUNTERS_INTERVAL_US;
    }

    fn fault(&self, error: &PictureError) {
        tracing::error!(%error, "this node cannot draw");
        let message = error.to_string();
        self.mail
            .send(Outgoing::Message(ToMaster::Fault { message }), true);
    }

    fn remember_swap(&mut self, frame: u64, at_us: i64) {
        if self.swaps_us.iter().any(|(known, _)| *known == frame) {
            return;
        }
        if self.swaps_us.len() == REMEMBERED_SWAPS {
            self.swaps_us.pop_front();
        }
        let at_us = self.mail.clock(|clock| clock.master_us(at_us));
        self.swaps_us.push_back((frame, at_us));
    }

    fn master_now_us(&self) -> i64 {
        self.mail.clock(|clock| clock.master_us(link::now_us()))
    }
}

/// A time that cannot be below 0.
fn unsigned(time_us: i64) -> u32 {
    u32::try_from(time_us.max(0)).unwrap_or(u32::MAX)
}

/// A time of either sign.
fn signed(time_us: i64) -> i32 {
    i32::try_from(time_us).unwrap_or(if time_us < 0 { i32::MIN } else { i32::MAX })
}
