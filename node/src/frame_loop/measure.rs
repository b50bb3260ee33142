//! The error of the picture that stands, once no frame follows.
//! In: the picture. Out: one word to the master. It takes as long as many frames: when it is asked for, the master decides.

use protocol::ToMaster;
use protocol::message::ErrorMeasured;
use render::ErrorMeasure;

use super::FrameLoop;
use crate::mail::Outgoing;

impl FrameLoop {
    /// Measures, and says what was found.
    pub(super) fn tell_error(&mut self) {
        self.priority.lower();
        let word = match self.picture.as_mut().map(|picture| picture.measure_error()) {
            Some(Ok(measure)) => word(&measure),
            Some(Err(error)) => ToMaster::cannot_measure(&error.to_string()),
            None => ToMaster::cannot_measure("nothing has been drawn"),
        };
        self.mail.send(Outgoing::Message(word), true);
    }
}

/// What is said of a measure.
fn word(measure: &ErrorMeasure) -> ToMaster {
    let ErrorMeasure {
        max_px,
        worst: _,
        samples,
        uncovered,
        triangles: _,
        tau_px,
    } = *measure;
    ToMaster::ErrorMeasured(ErrorMeasured {
        max_px,
        samples,
        uncovered,
        tau_px,
    })
}
