//! The frame loop of a node: newest view → draw → ready → swap → present → report.
//! In: the mailbox, a maker of pictures. Out: pictures, and what is said about them. It is a machine that is
//! driven step by step, by a plain loop or by a window system, and does one thing at a time. The order of
//! frames is decided by [`protocol::follower`] and that of scenes by [`crate::scenes`]; here things are done.

mod frames;
mod measure;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use protocol::follower::{Follower, Step};
use protocol::message::{MAX_NEW_TILES, MoveLens, Steer, Swap};
use protocol::pattern::Pattern;
use protocol::{Scene, ToMaster, View, Wall};
use winit::window::Window;

use crate::digests::DigestFile;
use crate::mail::{Arrived, End, Inbox, Mail, Outgoing};
use crate::picture::{Picture, PictureError, PictureMaker, PictureRequest};
use crate::presentation::{Arrivals, Waiting};
use crate::priority::Priority;
use crate::scenes::Scenes;
use crate::{NodeError, NodeOutcome};

/// How long a node that leaves waits for tiles on their way, so that its last counters hold.
const LAST_LOADS: Duration = Duration::from_secs(1);
/// How often the caches' counters are told.
const COUNTERS_INTERVAL_US: i64 = 500_000;

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

/// The frame loop's state.
pub(crate) struct FrameLoop {
    mail: Arc<Mail>,
    maker: Box<dyn PictureMaker>,
    wall: Option<(Arc<Wall>, usize)>,
    picture: Option<Box<dyn Picture>>,
    scenes: Scenes<Box<Scene>>,
    /// A scene whose data is being opened.
    opening: Option<(u64, Box<Scene>)>,
    /// The revision of the measures that the picture has.
    wall_revision: u32,
    /// Newer measures, until a view asks for them.
    measures: Option<(u32, Arc<Wall>)>,
    /// What outputs are to show instead of the scene, until there is a picture to show it.
    patterns: Option<Vec<Option<Pattern>>>,
    /// A view that waits for its scene, or for the wall's measures.
    early_view: Option<Arrived<View>>,
    follower: Follower,
    steps: VecDeque<Step>,
    arrivals: Arrivals,
    waiting: Option<Waiting>,
    /// The revision of the picture drawn last, if the scene in preparation has not gone on since.
    ahead_due: Option<u64>,
    /// When a picture was presented last.
    presented_us: i64,
    presenting: Option<Swap>,
    /// Where what was shown is written down, if it is.
    digests: Option<DigestFile>,
    priority: Priority,
    rest_until_us: i64,
    counters_due_us: i64,
    /// The master wants to know the error of the picture that stands.
    measure_error: bool,
    outcome: NodeOutcome,
    failure: Option<NodeError>,
    leaving: bool,
}

impl FrameLoop {
    pub(crate) fn new(
        mail: Arc<Mail>,
        maker: Box<dyn PictureMaker>,
        digests: Option<DigestFile>,
    ) -> Self {
        Self {
            mail,
            maker,
            wall: None,
            picture: None,
            scenes: Scenes::new(),
            opening: None,
            wall_revision: 0,
            measures: None,
            patterns: None,
            early_view: None,
            follower: Follower::new(60.0),
            steps: VecDeque::new(),
            arrivals: Arrivals::default(),
            waiting: None,
            ahead_due: None,
            presented_us: i64::MIN,
            presenting: None,
            digests,
            priority: Priority::of_this_thread(),
            rest_until_us: i64::MIN,
            counters_due_us: i64::MAX,
            measure_error: false,
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
        // A scene takes its time: a picture that waits for its moment goes first, unless a view needs the scene.
        let may_prepare = self.waiting.is_none() || self.early_view.is_some();
        if self.steps.is_empty() && may_prepare && self.prepare_scene() {
            return Next::Again;
        }
        match self.steps.pop_front() {
            Some(Step::Draw(view)) => {
                self.prepare_scene();
                self.draw(&view);
            }
            Some(Step::SayReady { epoch, frame }) => {
                self.say_ready(epoch, frame);
                self.prepare_ahead_before_presentation();
            }
            Some(Step::Present(swap)) => self.presenting = Some(swap),
            None => {
                if self.waiting.is_some() {
                    // Drawn and ready: nothing but the swap and the presentation can come next.
                    self.priority.raise();
                }
                if link::now_us() >= self.counters_due_us {
                    self.tell_counters();
                }
                if std::mem::take(&mut self.measure_error) {
                    self.tell_error();
                    return Next::Again;
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
            Ok(picture) => self.picture = Some(picture),
            Err(error) => self.fail(error.into()),
        }
    }

    /// Passes the operator's movements on to the master.
    pub(crate) fn steer(&self, steer: Steer) {
        self.mail
            .send(Outgoing::Message(ToMaster::Steer(steer)), true);
    }

    /// The ground under a pixel of one of this host's outputs: latitude and longitude in degrees.
    pub(crate) fn ground_under(&self, output: usize, pixel: [f64; 2]) -> Option<[f64; 2]> {
        self.picture.as_ref()?.ground_under(output, pixel)
    }

    /// Passes the place of a dragged lens on to the master.
    pub(crate) fn move_lens(&self, moved: MoveLens) {
        self.mail
            .send(Outgoing::Message(ToMaster::MoveLens(moved)), true);
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
        if let Some(picture) = &mut self.picture {
            picture.finish_loading(LAST_LOADS);
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
        if inbox.welcome.is_some() || inbox.capture.is_some() {
            // These take their time.
            self.priority.lower();
        }
        let mut next = None;
        if let Some((wall, host)) = inbox.welcome {
            next = self.welcome(wall, host);
        }
        self.scenes.arrived(inbox.scenes);
        self.patterns = inbox.patterns.or(self.patterns.take());
        if inbox.wall.is_some() {
            self.measures = inbox.wall;
            if let Some(view) = self.early_view.take() {
                self.view(view);
            }
        }
        for Arrived { content, at_us } in inbox.swaps {
            self.swap(content, at_us);
        }
        if let Some(view) = inbox.view {
            self.view(view);
        }
        if let Some(id) = inbox.capture {
            self.capture(id);
        }
        // Not before what has been drawn is presented.
        self.measure_error |= inbox.measure_error;
        next
    }

    /// What was agreed with the last master counts no longer; the picture stays.
    fn forget_master(&mut self) {
        let fps = self.wall.as_ref().map_or(60.0, |(wall, _)| wall.fps);
        self.follower = Follower::new(fps);
        self.steps.clear();
        self.arrivals = Arrivals::default();
        self.waiting = None;
        self.ahead_due = None;
        self.presenting = None;
        self.early_view = None;
        // What is agreed with one master is nothing to the next.
        self.measures = None;
        self.patterns = None;
        // Revisions are numbers of one run of one master.
        self.scenes = Scenes::new();
        self.opening = None;
        self.counters_due_us = i64::MAX;
        self.measure_error = false;
        self.priority.lower();
    }

    fn welcome(&mut self, wall: Arc<Wall>, host: usize) -> Option<Next> {
        let known = self.wall_revision == 0
            && self
                .wall
                .as_ref()
                .is_some_and(|(known, at)| **known == *wall && *at == host);
        self.wall_revision = 0;
        self.wall = Some((Arc::clone(&wall), host));
        self.forget_master();
        self.counters_due_us = link::now_us() + COUNTERS_INTERVAL_US;
        if known && let Some(picture) = &mut self.picture {
            // Another master may have been told; this one was not.
            picture.forget_troubles();
            return None;
        }
        self.picture = None;
        Some(Next::OpenWindows { wall, host })
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
            let news = picture.take_tile_news(MAX_NEW_TILES);
            let more = news.is_full();
            let counters = ToMaster::Counters {
                tiles: picture.counters(),
                news,
            };
            self.mail.send(Outgoing::Message(counters), false);
            if !more {
                break;
            }
        }
        for message in picture.take_troubles() {
            tracing::warn!("{message}");
            self.mail
                .send(Outgoing::Message(ToMaster::Trouble { message }), false);
        }
        self.counters_due_us = link::now_us() + COUNTERS_INTERVAL_US;
    }

    fn fault(&self, error: &PictureError) {
        tracing::error!(%error, "this node cannot draw");
        let message = error.to_string();
        self.mail
            .send(Outgoing::Message(ToMaster::Fault { message }), true);
    }

    fn master_now_us(&self) -> i64 {
        self.mail.clock(|clock| clock.master_us(link::now_us()))
    }
}
