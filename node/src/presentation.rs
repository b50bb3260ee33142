//! When a frame's messages came, and what is said of its presentation.
//! In: arrivals of views and swaps, a presented frame. Out: [`Presented`]. It presents nothing and reads no
//! clock; all moments are on the master's clock.

use std::collections::VecDeque;

use protocol::message::{Presented, Swap};

use crate::picture::Drawn;

/// Arrivals of swaps that are remembered.
const REMEMBERED_SWAPS: usize = 4;

/// A frame that is drawn and has not been presented.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Waiting {
    /// When the master sent its view.
    pub(crate) view_sent_us: i64,
    /// How long the view was on its way.
    pub(crate) view_latency_us: i64,
    /// The revision of the scene that its view bore.
    pub(crate) scene_revision: u64,
    /// How long it took to draw.
    pub(crate) draw_us: i64,
    /// What became of it.
    pub(crate) drawn: Drawn,
}

/// Arrivals of the newest frames' messages.
#[derive(Debug, Default)]
pub(crate) struct Arrivals {
    /// The newest view's frame, and how long it was on its way.
    view_latency_us: (u64, i64),
    /// Frames, and when their swaps arrived first.
    swaps_us: VecDeque<(u64, i64)>,
}

impl Arrivals {
    /// The first view of a frame has arrived after this time on its way.
    pub(crate) fn view(&mut self, frame: u64, latency_us: i64) {
        self.view_latency_us = (frame, latency_us);
    }

    /// The swap of a frame has arrived at this moment, perhaps once more.
    pub(crate) fn swap(&mut self, frame: u64, at_us: i64) {
        if self.swaps_us.iter().any(|(known, _)| *known == frame) {
            return;
        }
        if self.swaps_us.len() == REMEMBERED_SWAPS {
            self.swaps_us.pop_front();
        }
        self.swaps_us.push_back((frame, at_us));
    }

    /// How long the view of a frame was on its way; 0 if that is not known any longer.
    pub(crate) fn view_latency_us(&self, frame: u64) -> i64 {
        match self.view_latency_us {
            (known, latency_us) if known == frame => latency_us,
            _ => 0,
        }
    }

    /// What is to be said of a frame that was presented at this moment, give or take `error_us`.
    pub(crate) fn presented(
        &self,
        swap: Swap,
        waiting: &Waiting,
        presented_us: i64,
        error_us: i64,
    ) -> Presented {
        let arrived_us = self.swaps_us.iter().find(|(frame, _)| *frame == swap.frame);
        let slack_us = arrived_us.map_or(0, |(_, at_us)| swap.present_at_us.saturating_sub(*at_us));
        Presented {
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
            refined_leaves: waiting.drawn.refined_leaves,
            achieved_tau_px: waiting.drawn.achieved_tau_px,
            achieved_tile_px: waiting.drawn.achieved_tile_px,
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_presentation_is_told_with_the_first_arrival_of_its_own_messages() {
        let mut arrivals = Arrivals::default();
        for frame in 1..=9 {
            arrivals.view(frame, 10 * frame as i64);
            arrivals.swap(frame, 1_000 * frame as i64);
            arrivals.swap(frame, 1_000 * frame as i64 + 500);
        }
        assert_eq!(
            (arrivals.view_latency_us(9), arrivals.view_latency_us(8)),
            (90, 0)
        );
        let waiting = Waiting {
            view_sent_us: 7_500,
            view_latency_us: 90,
            scene_revision: 1,
            draw_us: -1,
            drawn: Drawn {
                triangles: 12,
                refined_leaves: 5,
                achieved_tau_px: 1.5,
                achieved_tile_px: 257.0,
                redrawn: true,
                ..Drawn::default()
            },
        };
        let present = |frame, present_at_us| Swap {
            epoch: 3,
            frame,
            present_at_us,
        };
        let told = arrivals.presented(present(9, 9_700), &waiting, 9_800, i64::MAX);
        assert_eq!((told.epoch, told.frame, told.presented_us), (3, 9, 9_800));
        assert_eq!((told.swap_slack_us, told.view_to_present_us), (700, 2_300));
        assert_eq!((told.view_latency_us, told.draw_us), (90, 0));
        assert_eq!((told.clock_error_us, told.triangles), (u32::MAX, 12));
        assert_eq!((told.refined_leaves, told.achieved_tau_px), (5, 1.5));
        assert_eq!(told.achieved_tile_px, 257.0);
        assert!(told.redrawn && !told.converged);
        let late = arrivals.presented(present(6, 5_000), &waiting, 9_800, 0);
        assert_eq!(late.swap_slack_us, -1_000);
        let forgotten = arrivals.presented(present(5, 4_000), &waiting, 9_800, 0);
        assert_eq!(forgotten.swap_slack_us, 0);
    }
}
