//! A node's side of the simulation: what a real node does with the state machines.

use super::events::{PresentedRecord, Target, What};
use super::{START_US, VirtualWall};
use crate::barrier::NodeId;
use crate::clock::ClockSample;
use crate::follower::Step;
use crate::message::Swap;

impl VirtualWall {
    /// A node's own clock.
    fn local_us(&self, node: NodeId) -> i64 {
        let state = &self.nodes[node];
        let passed_us = (self.now_us - START_US) as f64;
        self.now_us + state.offset_us + (passed_us * state.drift) as i64
    }

    pub(super) fn node(&mut self, node: NodeId, process: u32, what: What) {
        let local_us = self.local_us(node);
        let here = Target::Node { node, process };
        let master = Target::Master { node, process };
        let master_us = self.nodes[node].clock.master_us(local_us);
        let state = &mut self.nodes[node];
        let steps = match what {
            What::Welcome => {
                self.push(self.now_us, here, What::PingDue);
                Vec::new()
            }
            What::Refused { retry_after_ms } => {
                if retry_after_ms.is_some() {
                    state.alive = false;
                    let again_us = self.now_us + 50_000;
                    self.push(again_us, Target::World { node: Some(node) }, What::Start);
                }
                Vec::new()
            }
            What::PingDue => {
                let interval_us = state.clock.ping_interval_us();
                self.send(master, What::Ping { sent_us: local_us });
                self.push(self.now_us + interval_us, here, What::PingDue);
                Vec::new()
            }
            What::Pong(sample) => {
                state.clock.add(ClockSample {
                    node_received_us: local_us,
                    ..sample
                });
                Vec::new()
            }
            What::View(view) if state.clock.is_ready() => state.follower.view(*view, master_us),
            What::Swap(swap) if state.clock.is_ready() => state.follower.swap(swap, master_us),
            What::Drawn { epoch, frame } => state.follower.drawn(epoch, frame, master_us),
            What::PresentDue(swap) => {
                if state.follower.is_due(master_us) {
                    self.present(node, process, swap, local_us, master_us)
                } else {
                    state.follower.dropped(master_us)
                }
            }
            _ => Vec::new(),
        };
        for step in steps {
            self.step(node, process, step);
        }
    }

    fn present(
        &mut self,
        node: NodeId,
        process: u32,
        swap: Swap,
        local_us: i64,
        master_us: i64,
    ) -> Vec<Step> {
        self.history.presented.push(PresentedRecord {
            node,
            process,
            frame: swap.frame,
            at_us: self.now_us,
            clock_error_us: (master_us - self.now_us).abs(),
            clock_bound_us: self.nodes[node].clock.error_us(local_us),
        });
        let slack_us = swap.present_at_us - master_us;
        let presented = What::Presented {
            presented_us: master_us,
            slack_us,
        };
        self.send(Target::Master { node, process }, presented);
        self.nodes[node].follower.presented(master_us)
    }

    pub(super) fn step(&mut self, node: NodeId, process: u32, step: Step) {
        let here = Target::Node { node, process };
        match step {
            Step::Draw(view) => {
                let (low, high) = self.conditions.draw_us;
                let mut draw_us = self.random.within(low, high);
                if self.random.share() < self.conditions.hiccups {
                    draw_us *= 20;
                }
                let drawn = What::Drawn {
                    epoch: view.epoch,
                    frame: view.frame,
                };
                self.push(self.now_us + draw_us, here, drawn);
            }
            Step::SayReady { epoch, frame } => {
                self.send(
                    Target::Master { node, process },
                    What::Ready { epoch, frame },
                );
            }
            Step::Present(swap) => {
                let state = &self.nodes[node];
                let wait_us = state.clock.node_us(swap.present_at_us) - self.local_us(node);
                let due_us = self.now_us + wait_us.max(0);
                self.push(due_us, here, What::PresentDue(swap));
            }
        }
    }
}
