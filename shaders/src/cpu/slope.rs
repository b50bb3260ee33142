//! CPU twin of process/slope.wgsl: heights to colours of steepness.
//! In: a slot of fused heights. Out: a slot of colours, linear in the angle from the horizontal.

use crate::cpu::support::{colour, slot, tangent};
use crate::layout::{INVALID_WORD, SlopeUniform};

/// Runs the stage.
#[must_use]
pub fn run(parameters: &SlopeUniform, inputs: &[&[u32]]) -> Vec<u32> {
    let [low, high] = parameters.range_deg;
    slot::every_texel(|texel| {
        if slot::word(inputs, 0, texel, INVALID_WORD) == INVALID_WORD {
            return 0;
        }
        let (_, [x, y, z]) = tangent::surface(&parameters.tile, inputs, texel);
        let angle_deg = (x * x + y * y).sqrt().atan2(z).to_degrees();
        let share = ((angle_deg - low) / (high - low).max(1e-6)).clamp(0.0, 1.0);
        colour::pack(
            colour::mix_colours(parameters.gentle, parameters.steep, share),
            1.0,
        )
    })
}
