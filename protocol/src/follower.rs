//! The swap barrier, as a node runs it: what to draw next, and which picture to present when.
//! In: views, swaps, "drawn", "presented", and the time on the master's clock. Out: [`Step`]s. It draws
//! nothing, sends nothing and reads no clock.
//!
//! Views are latest-wins: a node that is behind skips frames, and never shows an old one once the wall
//! has gone on. Of every frame it presents what the swap names, or nothing.

use crate::message::{Swap, View};

/// Time before the following swap at which a late picture is no longer presented.
const GUARD_US: i64 = 1_000;

/// What the node has to do.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Draw this view, then call [`Follower::drawn`].
    Draw(View),
    /// Tell the master that a frame is drawn.
    SayReady {
        /// The epoch of the frame's view.
        epoch: u32,
        /// The frame.
        frame: u64,
    },
    /// Wait for this moment, ask [`Follower::is_due`], then present the picture drawn last and call
    /// [`Follower::presented`], or leave it and call [`Follower::dropped`].
    Present(Swap),
}

/// A node's side of the barrier.
#[derive(Clone, Debug)]
pub struct Follower {
    period_us: i64,
    newest_frame: u64,
    waiting: Option<View>,
    drawing: Option<u64>,
    drawn: Option<(u32, u64)>,
    swap: Option<Swap>,
    presenting: bool,
}

impl Follower {
    /// A follower of a wall that presents `fps` times a second.
    #[must_use]
    pub fn new(fps: f64) -> Self {
        Self {
            period_us: crate::pacing::Grid::new(0, fps).period_us(),
            newest_frame: 0,
            waiting: None,
            drawing: None,
            drawn: None,
            swap: None,
            presenting: false,
        }
    }

    /// A view has arrived. An older one is ignored; one that was answered is answered again, since the
    /// answer may be lost.
    pub fn view(&mut self, view: View, now_us: i64) -> Vec<Step> {
        if view.frame <= self.newest_frame {
            return match self.drawn {
                Some((epoch, frame)) if frame == view.frame && !self.presenting => {
                    vec![Step::SayReady { epoch, frame }]
                }
                _ => Vec::new(),
            };
        }
        self.newest_frame = view.frame;
        if let Some(swap) = view.previous_swap {
            self.remember(swap);
        }
        self.waiting = Some(view);
        self.go_on(now_us)
    }

    /// A swap has arrived.
    pub fn swap(&mut self, swap: Swap, now_us: i64) -> Vec<Step> {
        self.remember(swap);
        self.go_on(now_us)
    }

    /// The view that was to be drawn is drawn.
    pub fn drawn(&mut self, epoch: u32, frame: u64, now_us: i64) -> Vec<Step> {
        if self.drawing != Some(frame) {
            return Vec::new();
        }
        self.drawing = None;
        self.drawn = Some((epoch, frame));
        let mut steps = vec![Step::SayReady { epoch, frame }];
        steps.extend(self.go_on(now_us));
        steps
    }

    /// Whether the picture may still be presented. A node that was held up while it waited for the
    /// moment must not show a picture that the wall has left behind.
    #[must_use]
    pub fn is_due(&self, now_us: i64) -> bool {
        self.presenting
            && self
                .swap
                .is_some_and(|swap| now_us <= self.last_moment_us(swap))
    }

    /// The picture that was to be presented was left.
    pub fn dropped(&mut self, now_us: i64) -> Vec<Step> {
        self.presented(now_us)
    }

    /// The picture that was to be presented is presented.
    pub fn presented(&mut self, now_us: i64) -> Vec<Step> {
        self.presenting = false;
        self.drawn = None;
        self.go_on(now_us)
    }

    /// The frame of the newest view; 0 before the first.
    #[must_use]
    pub fn newest_frame(&self) -> u64 {
        self.newest_frame
    }

    fn remember(&mut self, swap: Swap) {
        if self.swap.is_none_or(|known| swap.frame > known.frame) {
            self.swap = Some(swap);
        }
    }

    /// The last moment at which a swap's picture may be presented: the following swap is at least one
    /// period after it.
    fn last_moment_us(&self, swap: Swap) -> i64 {
        swap.present_at_us
            .saturating_add((self.period_us - GUARD_US).max(0))
    }

    /// Whatever can be done now: present what is drawn, or draw what waits.
    fn go_on(&mut self, now_us: i64) -> Vec<Step> {
        if self.presenting || self.drawing.is_some() {
            return Vec::new();
        }
        if let (Some((epoch, frame)), Some(swap)) = (self.drawn, self.swap) {
            if swap.frame == frame && swap.epoch == epoch {
                if now_us <= self.last_moment_us(swap) {
                    self.presenting = true;
                    return vec![Step::Present(swap)];
                }
                self.drawn = None;
            } else if swap.frame >= frame {
                // The wall has gone on without this picture.
                self.drawn = None;
            }
        }
        if self.drawn.is_some() {
            return Vec::new();
        }
        match self.waiting.take() {
            Some(view) => {
                self.drawing = Some(view.frame);
                vec![Step::Draw(view)]
            }
            None => Vec::new(),
        }
    }
}
