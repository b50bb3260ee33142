//! One frame of a node, from its view's arrival to its presentation, and the scenes between frames.
//! In: views, swaps, the frame loop's state. Out: pictures, words for the master. When each of these is done
//! is decided by the frame loop's `step`; nothing here waits for mail.

use std::time::Duration;

use protocol::follower::Step;
use protocol::message::Swap;
use protocol::pacing::Grid;
use protocol::{ToMaster, View};

use super::{FrameLoop, Next};
use crate::NodeError;
use crate::digests::ShownFrame;
use crate::mail::{Arrived, Outgoing};
use crate::picture::{Drawn, PictureError};
use crate::presentation::Waiting;
use crate::scenes::Verdict;

/// Up to here before its moment a presentation is waited for in the driver, which also takes mail; then
/// the thread sleeps for the presentation alone.
const LAST_SLEEP_US: i64 = 6_000;
/// After a presentation the next drawing waits this long, so that every other node of this host, waiting
/// for a processor, can present as well. Without it the first to present keeps the others from it.
const PRESENT_PAUSE_US: i64 = 400;

impl FrameLoop {
    /// Gives the picture the next scene, if there are both. Returns whether there were.
    pub(super) fn prepare_scene(&mut self) -> bool {
        let Some(picture) = &mut self.picture else {
            return false;
        };
        let Some((revision, scene)) = self.opening.take().or_else(|| self.scenes.next_scene())
        else {
            return false;
        };
        if !picture.open_ahead(&scene) {
            // Files are read meanwhile; frames go on.
            self.scenes.opens(revision);
            self.opening = Some((revision, scene));
            return false;
        }
        self.priority.lower();
        link::sleep_until_us(self.rest_until_us);
        match picture.prepare_scene(revision, &scene) {
            Ok(()) => self.scenes.taken(revision),
            Err(error @ PictureError::Unavailable(_)) => {
                self.fail(error.into());
                return true;
            }
            Err(error) => {
                tracing::error!(%error, revision, "this node cannot show a scene");
                let word = self.scenes.refused(revision, &error.to_string());
                self.mail.send(Outgoing::Message(word), true);
            }
        }
        if let Some(view) = self.early_view.take() {
            self.view(view);
        }
        true
    }

    pub(super) fn swap(&mut self, swap: Swap, at_us: i64) {
        self.remember_swap(swap.frame, at_us);
        let now_us = self.master_now_us();
        self.steps.extend(self.follower.swap(swap, now_us));
    }

    pub(super) fn view(&mut self, view: Arrived<View>) {
        let Arrived { content, at_us } = &view;
        // The earliest moment at which it can have been sent, on this host's clock.
        let sent_us = self.mail.clock(|clock| {
            let sent_us = clock.node_us(content.sent_us);
            sent_us.saturating_sub(clock.error_us(*at_us))
        });
        let measured = self.measure(content.wall_revision);
        let verdict = match self.scenes.view(content.scene_revision, sent_us) {
            // The view overtook the measures of its wall.
            Verdict::Draw if !measured => Verdict::Wait,
            verdict => verdict,
        };
        if verdict == Verdict::Draw {
            return self.follow(view);
        }
        // The view is not followed, but the frame before it may wait for its swap.
        if let Some(swap) = content.previous_swap {
            self.swap(swap, *at_us);
        }
        match verdict {
            // The view overtook its scene, or the scene takes its time.
            Verdict::Wait => {
                let known = self.early_view.as_ref();
                if known.is_none_or(|known| known.content.frame <= view.content.frame) {
                    self.early_view = Some(view);
                }
            }
            // The last picture stays.
            Verdict::Never(Some(word)) => self.mail.send(Outgoing::Message(word), true),
            Verdict::Never(None) | Verdict::Draw => {}
        }
    }

    /// Gives the picture the measures of this revision, if they are there. Returns whether it has them.
    fn measure(&mut self, revision: u32) -> bool {
        if revision == self.wall_revision {
            return true;
        }
        let Some((_, wall)) = self.measures.take_if(|(known, _)| *known == revision) else {
            return false;
        };
        if let Some(picture) = &mut self.picture
            && let Err(error) = picture.set_wall(&wall)
        {
            // It goes on with the measures it had.
            self.fault(&error);
        }
        self.wall_revision = revision;
        true
    }

    /// Passes a view on that can be drawn.
    fn follow(&mut self, view: Arrived<View>) {
        let Arrived { content, at_us } = view;
        if content.frame > self.follower.newest_frame() {
            let arrived_us = self.mail.clock(|clock| clock.master_us(at_us));
            let latency_us = arrived_us.saturating_sub(content.sent_us);
            self.arrivals.view(content.frame, latency_us);
        }
        if let Some(swap) = content.previous_swap {
            self.remember_swap(swap.frame, at_us);
        }
        let now_us = self.master_now_us();
        self.steps.extend(self.follower.view(content, now_us));
    }

    pub(super) fn draw(&mut self, view: &View) {
        // One step at least between two drawings, whether the last one was presented or not.
        self.prepare_ahead(0);
        let Some(picture) = &mut self.picture else {
            return;
        };
        self.priority.lower();
        link::sleep_until_us(self.rest_until_us);
        if let Some(patterns) = self.patterns.take() {
            picture.show_patterns(&patterns);
        }
        let start_us = link::now_us();
        // Where a newer view has come, the picture may have gone on to a later scene already.
        let holds = self.scenes.holds(view.scene_revision);
        let drawn = match holds.then(|| picture.draw(view)).transpose() {
            Ok(drawn) => drawn,
            Err(error @ PictureError::Unavailable(_)) => return self.fail(error.into()),
            Err(error) => {
                self.fault(&error);
                None
            }
        };
        self.waiting = drawn.map(|drawn| Waiting {
            view_sent_us: view.sent_us,
            view_latency_us: self.arrivals.view_latency_us(view.frame),
            scene_revision: view.scene_revision,
            draw_us: link::now_us() - start_us,
            drawn,
        });
        self.ahead_due = drawn.map(|_| view.scene_revision);
        if drawn.is_some() {
            let nothing_yet = self.scenes.drawn(view.scene_revision, None);
            debug_assert_eq!(nothing_yet, None, "a drawing prepares nothing");
        }
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

    /// Goes on with the next scene while the wall waits for its moment. The wall does not wait for this: the node
    /// has said that it is ready, and stops well before the earliest moment at which it may have to present.
    pub(super) fn prepare_ahead_before_presentation(&mut self) {
        let fps = self.wall.as_ref().map_or(60.0, |(wall, _)| wall.fps);
        let next_us = self
            .presented_us
            .saturating_add(Grid::new(0, fps).period_us());
        let spare_us = next_us
            .saturating_sub(LAST_SLEEP_US)
            .saturating_sub(link::now_us());
        if spare_us > 0 {
            self.prepare_ahead(spare_us);
        }
    }

    /// Goes on with the next scene for at most this long, if that has not been done since the last drawing.
    fn prepare_ahead(&mut self, at_most_us: i64) {
        let (Some(revision), Some(picture)) = (self.ahead_due.take(), &mut self.picture) else {
            return;
        };
        self.priority.lower();
        let at_most = Duration::from_micros(at_most_us.try_into().unwrap_or_default());
        let prepared = match picture.prepare_ahead(at_most) {
            Ok(prepared) => prepared,
            Err(error @ PictureError::Unavailable(_)) => return self.fail(error.into()),
            Err(error) => return self.fault(&error),
        };
        if let Some(word) = self.scenes.drawn(revision, prepared) {
            self.mail.send(Outgoing::Message(word), true);
        }
    }

    pub(super) fn say_ready(&self, epoch: u32, frame: u64) {
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

    pub(super) fn present(&mut self, swap: Swap) -> Next {
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
        self.presented_us = presented_us;
        self.rest_until_us = presented_us + PRESENT_PAUSE_US;
        let draw_us = self.waiting.as_ref().map_or(0, |waiting| waiting.draw_us);
        if let Some(Err(error)) = presented {
            self.fault(&error);
        } else if let Some(waiting) = self.waiting.take() {
            self.outcome.frames += 1;
            self.tell_presented(swap, &waiting, presented_us);
            self.note_digests(swap.frame, &waiting);
        }
        if self.ahead_due.is_some() {
            // There was no time before: a frame that takes long has some to give, and another one step.
            link::sleep_until_us(self.rest_until_us);
            self.prepare_ahead(draw_us / 4);
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
        let presented = self
            .arrivals
            .presented(swap, waiting, presented_us, error_us);
        self.mail
            .send(Outgoing::Message(ToMaster::Presented(presented)), false);
    }

    /// Writes down what stands on the outputs, if that is asked for.
    fn note_digests(&mut self, frame: u64, waiting: &Waiting) {
        let (Some(file), Some(picture)) = (&mut self.digests, &mut self.picture) else {
            return;
        };
        // As before drawing: the other nodes of this host present in this moment.
        link::sleep_until_us(self.rest_until_us);
        let shown = ShownFrame {
            frame,
            scene_revision: waiting.scene_revision,
            redrawn: waiting.drawn.redrawn,
            converged: waiting.drawn.converged,
        };
        let noted = picture
            .capture()
            .map_err(NodeError::from)
            .and_then(|outputs| Ok(file.append(shown, &outputs)?));
        if let Err(error) = noted {
            // A proof with a gap would be none.
            self.fail(error);
        }
    }

    fn remember_swap(&mut self, frame: u64, at_us: i64) {
        let at_us = self.mail.clock(|clock| clock.master_us(at_us));
        self.arrivals.swap(frame, at_us);
    }
}
