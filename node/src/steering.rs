//! Mouse and keys of a node's windows, gathered into steering messages.
//! In: pointer movements in pixels, buttons, wheel, keys. Out: [`Steer`], in radians as the eye sees them. It
//! moves nothing itself: the master holds the one camera.
//!
//! Left button: drag the ground. Right button: turn the gaze. Wheel: nearer and farther. W A S D: over the
//! ground; R F or page up and down: up and down; arrows: turn the gaze; Q E: tilt; shift: faster.

use protocol::message::{HeldKeys, Steer};
use winit::event::MouseButton;
use winit::keyboard::KeyCode;

/// Held keys are repeated this often, so that a lost window or node cannot leave a key pressed.
const REPEAT_US: i64 = 50_000;

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
        }
    }

    /// The pointer is at this pixel of a window, y down.
    pub(crate) fn pointer(&mut self, cursor_px: [f64; 2]) {
        let [x, y] = cursor_px;
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

    /// When [`Self::take`] will have something to say without further input.
    pub(crate) fn next_repeat_us(&self) -> Option<i64> {
        (!self.gathered.held.is_empty()).then(|| self.sent_us.saturating_add(REPEAT_US))
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::expect_used,
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
}
