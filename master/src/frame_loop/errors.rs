//! The error of the last picture: when no frame follows, every node measures its own, for the report.
//! In: answers of nodes. Out: the question to each node, once, and what they answer in the report; who does not answer
//! in time is named there. It measures nothing and never waits longer than its limit.

use std::sync::Arc;

use protocol::barrier::NodeId;
use protocol::message::ErrorMeasured;

use super::{FrameLoop, Phase, SETTLING_US};
use crate::notice::Notice;

/// Whom the measuring waits for.
#[derive(Clone, Debug)]
pub(super) struct Measuring {
    /// When it is given up.
    pub(super) until_us: i64,
    /// Per node, whether its answer is to come.
    awaited: Vec<bool>,
}

impl FrameLoop {
    /// Asks every node for the error of the picture that stands, if the report is to tell it; else the run is over.
    pub(super) fn measure_error(&mut self, now_us: i64) {
        if !self.plan.measure_error || self.measured.is_none() {
            return self.send_home(now_us);
        }
        self.recorder.tau(self.director.scene().mesh.tau);
        let message = Arc::clone(&self.ask_for_error);
        let mut awaited = vec![false; self.links.len()];
        for (node, awaited) in awaited.iter_mut().enumerate() {
            self.tell(node, &message);
            *awaited = self.links.get(node).is_some_and(Option::is_some);
            if !*awaited {
                self.recorder.error_unmeasured(node, "it was not connected");
            }
        }
        let limit_us = self.plan.measure_timeout.as_micros();
        let limit_us = i64::try_from(limit_us).unwrap_or(i64::MAX);
        self.phase = Phase::Measuring(Measuring {
            until_us: now_us.saturating_add(limit_us),
            awaited,
        });
        self.notice_due_us = now_us + SETTLING_US;
    }

    /// A node has measured its picture.
    pub(super) fn error_measured(&mut self, node: NodeId, measured: &ErrorMeasured) {
        if self.awaits(node) {
            self.recorder.error_measured(measured);
        }
    }

    /// A node has not measured its picture and will not.
    pub(super) fn error_unmeasured(&mut self, node: NodeId, reason: &str) {
        if self.awaits(node) {
            self.recorder.error_unmeasured(node, reason);
        }
    }

    /// Ends the run once all have answered or time is over.
    pub(super) fn await_errors(&mut self, now_us: i64) {
        let Phase::Measuring(measuring) = &self.phase else {
            return;
        };
        if !measuring.awaited.contains(&true) {
            self.send_home(now_us);
        } else if now_us >= measuring.until_us {
            let limit = self.plan.measure_timeout;
            self.give_up_errors(&format!("it did not answer within {limit:?}"));
            self.send_home(now_us);
        } else if now_us >= self.notice_due_us {
            let awaited = measuring.awaited.iter().enumerate();
            let waits_for = awaited.filter(|(_, awaited)| **awaited);
            let waits_for = waits_for.map(|(node, _)| self.name(node)).collect();
            self.notice_due_us = now_us + SETTLING_US;
            self.notices.send(Notice::Measuring { waits_for });
        }
    }

    /// Nobody is waited for any longer.
    pub(super) fn give_up_errors(&mut self, reason: &str) {
        for node in 0..self.links.len() {
            self.error_unmeasured(node, reason);
        }
    }

    /// Whether a node's answer is to come; from now on it is not.
    fn awaits(&mut self, node: NodeId) -> bool {
        let Phase::Measuring(measuring) = &mut self.phase else {
            return false;
        };
        measuring.awaited.get_mut(node).is_some_and(std::mem::take)
    }
}
