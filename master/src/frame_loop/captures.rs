//! The end of a run with pictures: the camera holds still, nodes converge, pictures are taken.
//! In: what nodes say of held frames, their pictures. Out: when to ask, whom the wall waits for. What counts
//! as converged, `capture` knows.

use std::sync::Arc;

use protocol::barrier::NodeId;
use protocol::capture::CapturedPicture;

use super::{FrameLoop, Phase, SETTLING_US};
use crate::capture::Capture;
use crate::master::MasterError;
use crate::notice::Notice;

impl FrameLoop {
    /// A node has drawn a held frame.
    pub(super) fn settled(&mut self, node: NodeId, frame: u64, converged: bool, pending: u32) {
        // Pictures show the newest scene: no change may be on its way, to the nodes or into a frame.
        let changing = self.changes.preparing().is_some() || self.unseen.is_some();
        let Phase::Settling { capture, .. } = &mut self.phase else {
            return;
        };
        capture.ready(node, frame, converged, pending);
        if !changing && capture.ask_now() {
            let message = Arc::clone(&self.ask_for_pictures);
            for node in 0..self.links.len() {
                self.tell(node, &message);
            }
        }
    }

    /// A node's pictures have arrived, or will not.
    pub(super) fn captured(&mut self, node: NodeId, result: Result<Vec<CapturedPicture>, String>) {
        match result {
            Ok(pictures) => {
                if let Phase::Settling { capture, .. } = &mut self.phase {
                    capture.pictures(node, pictures);
                }
            }
            // If the node is gone, its successor sends them.
            Err(reason) => tracing::warn!(reason, "a capture did not arrive"),
        }
    }

    /// Goes on once all pictures are there, or gives up.
    pub(super) fn settle(&mut self, now_us: i64) {
        let Phase::Settling { capture, since_us } = &self.phase else {
            return;
        };
        let settled_us = now_us.saturating_sub(*since_us).max(0).unsigned_abs();
        if capture.is_complete() {
            self.take_captures();
        } else if settled_us >= self.plan.capture_timeout.as_micros() as u64 {
            self.fail(MasterError::NotConverged {
                waited_s: settled_us / 1_000_000,
                waits_for: self.settling_waits_for(capture),
            });
        } else if now_us >= self.notice_due_us {
            let waits_for = self.settling_waits_for(capture);
            self.notice_due_us = now_us + SETTLING_US;
            self.notices.send(Notice::Settling { waits_for });
        }
    }

    /// Whom and what the pictures wait for, one sentence each.
    fn settling_waits_for(&self, capture: &Capture) -> Vec<String> {
        let mut waits_for = capture.waits_for(self.membership.nodes());
        if let Some(revision) = self.changes.preparing() {
            waits_for.push(format!(
                "revision {revision} of the scene is being prepared"
            ));
        }
        waits_for
    }

    fn take_captures(&mut self) {
        let until_us = link::now_us();
        let phase = std::mem::replace(&mut self.phase, Phase::LastReports { until_us });
        if let Phase::Settling { capture, .. } = phase {
            self.captures = Some(capture);
        }
    }
}
