//! CPU twin of process/elevation.wgsl: raw heights to heights.
//! In: a slot of heights in metres. Out: clamp((h + datum shift) · scale + offset); holes stay holes.

use crate::cpu::support::slot;
use crate::layout::{ElevationUniform, INVALID_WORD};

/// Runs the stage.
#[must_use]
pub fn run(parameters: &ElevationUniform, inputs: &[&[u32]]) -> Vec<u32> {
    slot::every_word(inputs, INVALID_WORD, |word| {
        if word == INVALID_WORD {
            word
        } else {
            height(parameters, f32::from_bits(word)).to_bits()
        }
    })
}

/// One height in metres, as the stage computes it.
#[must_use]
pub fn height(parameters: &ElevationUniform, raw_m: f32) -> f32 {
    let moved = (raw_m + parameters.datum_shift_m) * parameters.scale + parameters.offset_m;
    moved.max(parameters.lowest_m).min(parameters.highest_m)
}
