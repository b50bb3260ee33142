//! Nodes in the frame loop: they come, speak, and go.
//! In: events of their connections. Out: messages to them, notices, and what concerns frames, pictures and changes
//! handed on. Who may come, `protocol::membership` decides.

use std::sync::Arc;

use link::CloseCode;
use protocol::barrier::NodeId;
use protocol::codec::encode_to_node;
use protocol::membership::{Refusal, Seat};
use protocol::message::Hello;
use protocol::{ToMaster, ToNode};

use super::{FrameLoop, Phase};
use crate::events::{ConnectionId, Event};
use crate::master::MasterError;
use crate::notice::Notice;
use crate::session::{Bytes, NodeLink};

impl FrameLoop {
    /// Handles one event.
    pub(super) fn event(&mut self, event: Event) {
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
                    self.captured(seat.node, result);
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
            Event::LookAtScene { reply } => {
                // Whoever has asked may be gone.
                let _unheard = reply.send(self.snapshot());
            }
            Event::Propose { proposal, reply } => {
                let _unheard = reply.send(self.propose(proposal));
            }
            Event::LookAtWall { reply } => {
                let _unheard = reply.send(self.installation());
            }
            Event::AdjustWall { adjusted, reply } => {
                let _unheard = reply.send(self.adjust(*adjusted));
            }
            Event::ShowPatterns { wishes, reply } => {
                for (place, pattern) in wishes {
                    self.show_pattern(place, pattern);
                }
                let _unheard = reply.send(self.installation());
            }
            Event::SetScene(scene) => self.set_scene(*scene),
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
        self.tell_installation(seat.node);
        let scene = Arc::clone(self.director.encoded_scene());
        self.tell(seat.node, &scene);
        if let Some(revision) = self.changes.preparing() {
            let coming = Arc::clone(&self.director.revision(revision).encoded);
            self.tell(seat.node, &coming);
        }
        if matches!(self.phase, Phase::Leaving { .. }) {
            let shutdown = Arc::clone(&self.shutdown);
            self.tell(seat.node, &shutdown);
        }
        if let Some(barrier) = &mut self.barrier {
            let actions = barrier.connected(seat.node);
            self.perform(actions);
        }
    }

    fn refuse(&self, hello: &Hello, link: &NodeLink, refusal: &Refusal) {
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
                self.settled(node, frame, converged, pending_tiles);
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
            ToMaster::Counters { tiles, news } => {
                self.recorder.counters(node, tiles, &news);
            }
            ToMaster::Fault { message } => self.fault(node, message),
            ToMaster::Trouble { message } => self.trouble(node, message),
            ToMaster::CaptureFailed { reason, .. } => {
                let node = self.name(node);
                self.fail(MasterError::Capture { node, reason });
            }
            ToMaster::Steer(steer) => self.director.steer(&steer, at_us),
            ToMaster::Prepared { revision } => self.prepared(node, revision),
            ToMaster::CannotPrepare { revision, reason } => {
                self.cannot_prepare(node, revision, reason);
            }
            ToMaster::MoveLens(place) => self.move_lens(node, &place),
            ToMaster::ErrorMeasured(measured) => self.error_measured(node, &measured),
            ToMaster::CannotMeasure { reason } => self.error_unmeasured(node, &reason),
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

    /// Something went wrong on a node, which goes on.
    pub(super) fn fault(&mut self, node: NodeId, message: String) {
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

    /// Something lowers the quality of what a node draws, or does so no longer.
    fn trouble(&mut self, node: NodeId, message: String) {
        let name = self.name(node);
        self.recorder.error(format!("node \"{name}\": {message}"));
        self.notices.send(Notice::Trouble {
            node: name,
            message,
        });
    }

    /// Queues a message for a node. One that has let its queue overflow is given up.
    pub(super) fn tell(&mut self, node: NodeId, message: &Bytes) {
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
        if let Some(dragged) = self.dragged.get_mut(node) {
            *dragged = None;
        }
        self.changes.disconnected(node);
        if let Phase::Settling { capture, .. } = &mut self.phase {
            capture.lost(node);
        }
        self.error_unmeasured(node, "its connection ended before it answered");
        if let Some(barrier) = &mut self.barrier {
            let actions = barrier.disconnected(node, now_us);
            self.perform(actions);
        }
    }

    /// Whom the start waits for and why, one sentence a node.
    pub(super) fn start_waits_for(&self) -> Vec<String> {
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

    /// What a node is called in the wall.
    pub(super) fn name(&self, node: NodeId) -> String {
        self.wall
            .hosts
            .get(node)
            .map(|host| host.name.clone())
            .unwrap_or_default()
    }
}
