//! CPU twin of process/isolines.wgsl: lines of equal height, as wide everywhere in samples.
//! In: a slot of fused heights. Out: a slot of one colour, its coverage the line's; flat ground has none.

use crate::cpu::support::{colour, slot};
use crate::layout::{INVALID_WORD, IsolinesUniform};

/// Runs the stage.
#[must_use]
pub fn run(parameters: &IsolinesUniform, inputs: &[&[u32]]) -> Vec<u32> {
    let [red, green, blue, _] = parameters.colour;
    slot::every_texel(|texel| {
        let word = slot::word(inputs, 0, texel, INVALID_WORD);
        if word == INVALID_WORD {
            return 0;
        }
        let [dx, dy] = slot::differences(inputs, texel);
        let gradient = (dx * dx + dy * dy).sqrt();
        let here = f32::from_bits(word);
        let spacing = parameters.spacing_m;
        let line = (here / spacing).round_ties_even();
        let distance = (here - line * spacing).abs() / gradient.max(1e-6 * spacing);
        let every = parameters.bold_every as f32;
        let bold = every > 0.0 && (line / every.max(1.0)).round_ties_even() * every == line;
        let half_width = if bold {
            parameters.bold_half_width
        } else {
            parameters.half_width
        };
        if gradient < 1e-6 * spacing {
            return 0;
        }
        // How much of a sample's width lies in the line: no more than the line is wide.
        let most = (2.0 * half_width).min(1.0);
        let coverage = (half_width + 0.5 - distance).max(0.0).min(most);
        colour::pack([red, green, blue], coverage)
    })
}
