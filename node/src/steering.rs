//! Mouse and keys of a node's windows, gathered into steering messages.
//! In: pointer movements in pixels, buttons, wheel, keys. Out: [`Steer`], in radians as the eye sees them, and
//! [`MoveLens`]. It moves nothing itself: the master holds the one camera and the lenses.
//!
//! Left button: drag the ground. Middle button: drag a lens. Right button: turn the gaze. Wheel: nearer and
//! farther. W A S D: over the ground; R F or page up and down: up and down; arrows: turn the gaze; Q E: tilt;
//! shift: faster.

use protocol::message::{HeldKeys, MoveLens, Steer};
use winit::event::MouseButton;
use winit::keyboard::KeyCode;

/// Held keys are repeated this often, so that a lost window or node cannot leave a key pressed.
const REPEAT_US: i64 = 50_000;
/// Least time between two places of a lens: 60 a second.
const LENS_INTERVAL_US: i64 = 16_667;

/// Gathers input between two messages.
#[derive(Debug)]
pub(crate) struct Steering {
    radians_per_px: f64,
    cursor_px: Option<[f64; 2]>,
    dragging: bool,
    looking: bool,
    gathered: Steer,
    sent: HeldKeys,
    sent_us: i64,
    lens: LensDrag,
}

/// A lens that is dragged.
#[derive(Debug)]
struct LensDrag {
    dragging: bool,
    /// Where the pointer has gone since the last message.
    cursor_px: Option<[f64; 2]>,
    /// Nothing has been said of this drag.
    grab: bool,
    sent_us: i64,
}

impl Steering {
    /// `radians_per_px`: how large a pixel of the wall is to the eye.
    pub(crate) fn new(radians_per_px: f64) -> Self {
        Self {
            radians_per_px,
            cursor_px: None,
            dragging: false,
            looking: false,
            gathered: Steer::default(),
            sent: HeldKeys::default(),
            sent_us: i64::MIN,
            lens: LensDrag {
                dragging: false,
                cursor_px: None,
                grab: false,
                sent_us: i64::MIN,
            },
        }
    }

    /// The pointer is at this pixel of a window, y down.
    pub(crate) fn pointer(&mut self, cursor_px: [f64; 2]) {
        let [x, y] = cursor_px;
        if self.lens.dragging {
            self.lens.cursor_px = Some(cursor_px);
        }
        if let Some([last_x, last_y]) = self.cursor_px.replace(cursor_px) {
            let right = (x - last_x) * self.radians_per_px;
            let up = (last_y - y) * self.radians_per_px;
            let moved = match (self.dragging, self.looking) {
                (true, _) => &mut self.gathered.drag,
                (false, true) => &mut self.gathered.look,
                (false, false) => return,
            };
            moved[0] += right;
            moved[1] += up;
        }
    }

    /// A button of the mouse went down or up.
    pub(crate) fn button(&mut self, button: MouseButton, pressed: bool) {
        match button {
            MouseButton::Left => self.dragging = pressed,
            MouseButton::Right => self.looking = pressed,
            MouseButton::Middle => {
                self.lens.dragging = pressed;
                if pressed {
                    self.lens.grab = true;
                    self.lens.cursor_px = self.cursor_px;
                }
            }
            _ => {}
        }
    }

    /// The wheel was turned; positive is away from the hand.
    pub(crate) fn wheel(&mut self, steps: f64) {
        self.gathered.zoom += steps;
    }

    /// A key went down or up.
    pub(crate) fn key(&mut self, key: KeyCode, pressed: bool) {
        let held = match key {
            KeyCode::KeyW => HeldKeys::FORWARD,
            KeyCode::KeyS => HeldKeys::BACKWARD,
            KeyCode::KeyA => HeldKeys::LEFT,
            KeyCode::KeyD => HeldKeys::RIGHT,
            KeyCode::KeyR | KeyCode::PageUp => HeldKeys::RISE,
            KeyCode::KeyF | KeyCode::PageDown => HeldKeys::SINK,
            KeyCode::ArrowLeft => HeldKeys::LOOK_LEFT,
            KeyCode::ArrowRight => HeldKeys::LOOK_RIGHT,
            KeyCode::ArrowUp => HeldKeys::LOOK_UP,
            KeyCode::ArrowDown => HeldKeys::LOOK_DOWN,
            KeyCode::KeyQ => HeldKeys::ROLL_LEFT,
            KeyCode::KeyE => HeldKeys::ROLL_RIGHT,
            KeyCode::ShiftLeft | KeyCode::ShiftRight => HeldKeys::FAST,
            _ => return,
        };
        self.gathered.held = self.gathered.held.with(held, pressed);
    }

    /// The window lost the keyboard: releases will not be told.
    pub(crate) fn focus_lost(&mut self) {
        self.gathered.held = HeldKeys::default();
        self.dragging = false;
        self.looking = false;
        self.lens.dragging = false;
        self.cursor_px = None;
    }

    /// What to tell the master now, if anything.
    pub(crate) fn take(&mut self, now_us: i64) -> Option<Steer> {
        let held = self.gathered.held;
        let due = !held.is_empty() && now_us.saturating_sub(self.sent_us) >= REPEAT_US;
        let moved = self.gathered
            != Steer {
                held,
                ..Steer::default()
            };
        if !moved && !due && held == self.sent {
            return None;
        }
        self.sent = held;
        self.sent_us = now_us;
        Some(std::mem::replace(
            &mut self.gathered,
            Steer {
                held,
                ..Steer::default()
            },
        ))
    }

    /// Where the master is to put the dragged lens now, if anywhere. `ground_under` gives latitude and
    /// longitude in degrees under a pixel of the window, `None` beside the planet: the lens stays there.
    pub(crate) fn take_lens(
        &mut self,
        now_us: i64,
        ground_under: impl FnOnce([f64; 2]) -> Option<[f64; 2]>,
    ) -> Option<MoveLens> {
        if now_us < self.lens.sent_us.saturating_add(LENS_INTERVAL_US) {
            return None;
        }
        let [latitude_deg, longitude_deg] = ground_under(self.lens.cursor_px.take()?)?;
        self.lens.sent_us = now_us;
        Some(MoveLens {
            latitude_deg,
            longitude_deg,
            grab: std::mem::take(&mut self.lens.grab),
        })
    }

    /// When [`Self::take`] or [`Self::take_lens`] will have something to say without further input.
    pub(crate) fn next_repeat_us(&self) -> Option<i64> {
        let keys = (!self.gathered.held.is_empty()).then(|| self.sent_us.saturating_add(REPEAT_US));
        let lens = self
            .lens
            .cursor_px
            .map(|_| self.lens.sent_us.saturating_add(LENS_INTERVAL_US));
        keys.into_iter().chain(lens).min()
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::indexing_slicing,
        reason = "a test that panics has failed"
    )]

    use super::*;

    #[test]
    fn movements_add_up_until_they_are_taken() {
        let mut steering = Steering::new(0.01);
        steering.pointer([10.0, 10.0]);
        steering.pointer([20.0, 10.0]);
        assert_eq!(steering.take(0), None, "no button is down");
        steering.button(MouseButton::Left, true);
        steering.pointer([25.0, 7.0]);
        steering.pointer([30.0, 5.0]);
        steering.wheel(2.0);
        let steer = steering.take(0).unwrap();
        assert!((steer.drag[0] - 0.1).abs() < 1e-12 && (steer.drag[1] - 0.05).abs() < 1e-12);
        assert_eq!((steer.look, steer.zoom), ([0.0, 0.0], 2.0));
        assert_eq!(steering.take(1), None);
    }

    #[test]
    fn a_held_key_is_repeated_and_its_release_told_once() {
        let mut steering = Steering::new(0.01);
        steering.key(KeyCode::KeyW, true);
        assert!(steering.take(0).unwrap().held.holds(HeldKeys::FORWARD));
        assert_eq!(steering.take(REPEAT_US - 1), None);
        assert_eq!(steering.next_repeat_us(), Some(REPEAT_US));
        assert!(steering.take(REPEAT_US).is_some());
        steering.focus_lost();
        assert!(steering.take(REPEAT_US + 1).unwrap().held.is_empty());
        assert_eq!(steering.take(10 * REPEAT_US), None);
        assert_eq!(steering.next_repeat_us(), None);
    }

    /// Stands for a picture in which the ground's degrees are a hundredth of pixels; nothing is right of 1000.
    fn ground([x, y]: [f64; 2]) -> Option<[f64; 2]> {
        (x < 1000.0).then_some([y / 100.0, x / 100.0])
    }

    fn lens(latitude_deg: f64, longitude_deg: f64, grab: bool) -> Option<MoveLens> {
        Some(MoveLens {
            latitude_deg,
            longitude_deg,
            grab,
        })
    }

    #[test]
    fn the_middle_button_drags_a_lens_and_nothing_else() {
        let mut steering = Steering::new(0.01);
        steering.pointer([100.0, 50.0]);
        assert_eq!(steering.take_lens(0, ground), None, "no button is down");
        steering.button(MouseButton::Middle, true);
        assert_eq!(steering.take_lens(0, ground), lens(0.5, 1.0, true));
        assert_eq!(
            steering.take_lens(LENS_INTERVAL_US, ground),
            None,
            "it has not moved"
        );
        steering.pointer([200.0, 50.0]);
        assert_eq!(
            steering.take_lens(2 * LENS_INTERVAL_US, ground),
            lens(0.5, 2.0, false)
        );
        assert_eq!(steering.take(0), None, "the camera stays");
        steering.button(MouseButton::Middle, false);
        steering.pointer([300.0, 50.0]);
        assert_eq!(steering.take_lens(9 * LENS_INTERVAL_US, ground), None);
        steering.button(MouseButton::Middle, true);
        assert_eq!(
            steering.take_lens(10 * LENS_INTERVAL_US, ground),
            lens(0.5, 3.0, true),
            "another drag"
        );
        steering.focus_lost();
        steering.pointer([400.0, 50.0]);
        assert_eq!(steering.take_lens(20 * LENS_INTERVAL_US, ground), None);
    }

    #[test]
    fn a_lens_is_told_60_times_a_second_at_most_and_ends_where_it_was_let_go() {
        let mut steering = Steering::new(0.01);
        steering.pointer([0.0, 0.0]);
        steering.button(MouseButton::Middle, true);
        let mut told = Vec::new();
        // A mouse that reports a thousand times a second, for one second and a bit.
        for millisecond in 0..1_005 {
            steering.pointer([f64::from(millisecond) / 2.0, 100.0]);
            told.extend(steering.take_lens(i64::from(millisecond) * 1_000, ground));
        }
        assert!((58..=61).contains(&told.len()), "{} messages", told.len());
        assert!(told[0].grab && !told[1..].iter().any(|moved| moved.grab));
        let rising = told
            .windows(2)
            .all(|pair| pair[0].longitude_deg < pair[1].longitude_deg);
        assert!(rising, "{told:?}");
        steering.button(MouseButton::Middle, false);
        let due_us = steering.next_repeat_us().unwrap();
        assert_eq!(steering.take_lens(due_us - 1, ground), None);
        assert_eq!(steering.take_lens(due_us, ground), lens(1.0, 5.02, false));
        assert_eq!(steering.next_repeat_us(), None);
    }

    #[test]
    fn a_drag_that_begins_beside_the_planet_grabs_where_it_reaches_it() {
        let mut steering = Steering::new(0.01);
        steering.button(MouseButton::Middle, true);
        assert_eq!(
            steering.take_lens(0, ground),
            None,
            "the pointer has not been seen"
        );
        steering.pointer([1_500.0, 0.0]);
        assert_eq!(steering.take_lens(0, ground), None);
        assert_eq!(steering.next_repeat_us(), None, "nothing to wait for");
        steering.pointer([900.0, 0.0]);
        assert_eq!(steering.take_lens(1, ground), lens(0.0, 9.0, true));
        steering.pointer([1_100.0, 0.0]);
        assert_eq!(steering.take_lens(LENS_INTERVAL_US + 1, ground), None);
        steering.pointer([800.0, 0.0]);
        assert_eq!(
            steering.take_lens(LENS_INTERVAL_US + 1, ground),
            lens(0.0, 8.0, false)
        );
    }
}
