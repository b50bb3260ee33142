//! The master's side of the simulation: what a real master does with the state machines.

use super::VirtualWall;
use super::events::{SwapRecord, Target, What};
use crate::barrier::{Action, NodeId};
use crate::camera::Pose;
use crate::clock::ClockSample;
use crate::membership::Seat;
use crate::message::View;
use crate::wall::{Head, Viewers};

impl VirtualWall {
    pub(super) fn master(&mut self, node: NodeId, process: u32, what: What) {
        let seat = self.seats.get(&(node, process)).copied();
        let current = seat.is_some_and(|seat| self.membership.heard(seat, self.now_us));
        let target = Target::Node { node, process };
        let now_us = self.now_us;
        let actions = match what {
            What::Hello(hello) => match self.membership.hello(&hello, now_us) {
                Ok(admission) => {
                    let mut actions = Vec::new();
                    if admission.replaced.is_some() {
                        actions = self.barrier.disconnected(node, now_us);
                    }
                    self.seats.insert((node, process), admission.seat);
                    self.send(target, What::Welcome);
                    actions.extend(self.barrier.connected(node));
                    actions
                }
                Err(refusal) => {
                    let retry_after_ms = refusal.retry_after_ms();
                    self.send(target, What::Refused { retry_after_ms });
                    Vec::new()
                }
            },
            What::LinkLost if seat.is_some_and(|seat| self.membership.lost(seat)) => {
                self.barrier.disconnected(node, now_us)
            }
            What::Ping { sent_us } if current => {
                let sample = ClockSample {
                    node_sent_us: sent_us,
                    master_received_us: now_us,
                    master_sent_us: now_us,
                    node_received_us: 0,
                };
                self.send(target, What::Pong(sample));
                Vec::new()
            }
            What::Ready { epoch, frame } if current => {
                if frame == self.barrier.frame() {
                    self.first_ready_us.get_or_insert(now_us);
                }
                self.barrier.ready(node, epoch, frame, now_us)
            }
            What::Presented {
                presented_us,
                slack_us,
            } if current => {
                self.membership.presented(node, presented_us);
                self.barrier.slack_reported(slack_us);
                Vec::new()
            }
            What::Tick if now_us >= self.tick_at_us => {
                self.tick_at_us = i64::MAX;
                self.barrier.tick(now_us)
            }
            _ => Vec::new(),
        };
        for action in actions {
            self.act(action);
        }
        self.schedule_tick();
    }

    pub(super) fn schedule_tick(&mut self) {
        let wake_us = self.barrier.next_wake_us().max(self.now_us);
        if wake_us < self.tick_at_us {
            self.tick_at_us = wake_us;
            self.push(
                wake_us,
                Target::Master {
                    node: usize::MAX,
                    process: 0,
                },
                What::Tick,
            );
        }
    }

    pub(super) fn act(&mut self, action: Action) {
        match action {
            Action::Entered { node } => {
                self.membership.entered(node);
                self.history.entered.push((node, self.now_us));
            }
            Action::Left { node, reason } => {
                self.membership.left(node);
                self.history.left.push((node, self.now_us, reason));
            }
            Action::Missed { node, frame } => {
                self.membership.missed(node);
                self.history.missed.push((node, frame));
            }
            Action::BeginFrame {
                epoch,
                frame,
                previous_swap,
                ..
            } => {
                self.first_ready_us = None;
                self.master_stalled = false;
                self.view = Some(View {
                    epoch,
                    frame,
                    scene_revision: 1,
                    sent_us: self.now_us,
                    pose: Pose {
                        position_m: [7e6, 0.0, 0.0],
                        right: [0.0, 1.0, 0.0],
                        up: [0.0, 0.0, 1.0],
                        back: [1.0, 0.0, 0.0],
                    },
                    wall_revision: 0,
                    viewers: Viewers {
                        heads: vec![Head::upright([0.0, 1.7, 3.0])],
                        pixels_per_radian: 1000.0,
                    },
                    settle: false,
                    previous_swap,
                });
                self.send_view(None);
            }
            Action::Resend { nodes, .. } => self.send_view(Some(&nodes)),
            Action::Swap(swap) => {
                self.history.swaps.push(SwapRecord {
                    swap,
                    decided_us: self.now_us,
                    first_ready_us: self.first_ready_us,
                    master_stalled: self.master_stalled,
                });
                for target in self.links() {
                    self.send(target, What::Swap(swap));
                }
            }
        }
    }

    fn send_view(&mut self, only: Option<&[NodeId]>) {
        let Some(view) = self.view.clone() else {
            return;
        };
        for target in self.links() {
            let Target::Node { node, .. } = target else {
                continue;
            };
            if only.is_none_or(|nodes| nodes.contains(&node)) {
                self.send(target, What::View(Box::new(view.clone())));
            }
        }
    }

    fn links(&self) -> Vec<Target> {
        let current = |(_, seat): &(_, &Seat)| self.membership.is_current(**seat);
        let links = self.seats.iter().filter(current);
        let mut links: Vec<_> = links
            .map(|((node, process), _)| (*node, *process))
            .collect();
        links.sort_unstable();
        links
            .into_iter()
            .map(|(node, process)| Target::Node { node, process })
            .collect()
    }
}
