//! CPU twin of process/ramp.wgsl: heights to colours, linear between stops.
//! In: a slot of fused heights. Out: a slot of colours; below the first and above the last stop its colour.

use crate::cpu::support::{colour, slot};
use crate::layout::{INVALID_WORD, RampUniform};

/// Runs the stage.
#[must_use]
pub fn run(parameters: &RampUniform, inputs: &[&[u32]]) -> Vec<u32> {
    let height = |stop: u32| parameters.heights[(stop / 4) as usize][(stop % 4) as usize];
    let stop_colour =
        |stop: u32| colour::unpack(parameters.colours[(stop / 4) as usize][(stop % 4) as usize]);
    let last = parameters.count.clamp(1, 32) - 1;
    slot::every_word(inputs, INVALID_WORD, |word| {
        if word == INVALID_WORD {
            return 0;
        }
        let here = f32::from_bits(word);
        // The highest stop that is not above, found by halving; the first where all are above.
        let mut lower = 0;
        for step in [16, 8, 4, 2, 1] {
            let candidate = lower + step;
            if candidate <= last && height(candidate.min(31)) <= here {
                lower = candidate;
            }
        }
        let upper = (lower + 1).min(last);
        let rise = (height(upper) - height(lower)).max(1e-20);
        let share = ((here - height(lower)) / rise).clamp(0.0, 1.0);
        let (from, to) = (stop_colour(lower), stop_colour(upper));
        colour::pack(
            colour::mix_colours(from, to, share),
            colour::mix(from[3], to[3], share),
        )
    })
}
