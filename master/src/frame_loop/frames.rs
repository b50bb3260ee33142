//! Frames as the barrier asks for them: views out, swaps out, members in and out.
//! In: the barrier's actions. Out: views and swaps into the nodes' slots, the phase that follows the last frame.
//! What a view shows, the director decides.

use std::sync::Arc;

use protocol::ToNode;
use protocol::barrier::{Action, LeaveReason};
use protocol::codec::encode_to_node;
use protocol::message::Swap;

use super::{FrameLoop, LAST_REPORTS_US, PROGRESS_US, Phase};
use crate::capture::Capture;
use crate::director::{CameraTime, FrameRequest};
use crate::master::MasterError;
use crate::notice::Notice;
use crate::session::Bytes;

impl FrameLoop {
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

    /// Does what the barrier asks for.
    pub(super) fn perform(&mut self, actions: Vec<Action>) {
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

    /// Sends the view of the next frame.
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
            (
                Phase::Settling { .. }
                | Phase::LastReports { .. }
                | Phase::Measuring(_)
                | Phase::Leaving { .. },
                _,
            ) => CameraTime::Held,
        };
        for event in self.heads.take_events() {
            self.notices.send(Notice::Tracker { event });
        }
        if let Some(heads) = self.heads.at(request.presented_from_us) {
            self.director.follow(heads, time);
        }
        let view = match self.director.view(request, time, link::now_us()) {
            Ok(view) => view,
            Err(error) => return self.fail(MasterError::Encode(error.to_string())),
        };
        if let Some((revision, unprepared)) = self.unseen.take() {
            let now_us = link::now_us();
            self.recorder
                .change_shown(revision, request.frame, unprepared, now_us);
            if let Phase::Settling { capture, .. } = &mut self.phase {
                capture.begin_again(request.frame);
            }
        }
        self.recorder.view(view.len());
        for (_, link) in self.links.iter().flatten() {
            link.show(&view);
        }
        self.view = Some(view);
    }

    /// Sends the moment at which a frame is presented; the last one ends the run.
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
}
