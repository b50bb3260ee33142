//! Twin of shared/amplitude.wgsl: what the radar mappings share.
//! In: an amplitude slot and a mapping of 0…1 to 0…1. Out: a slot of tinted greys.

use crate::cpu::support::{colour, slot};
use crate::layout::{INVALID_WORD, SarUniform};

/// Maps every amplitude: a' = clamp((a − lowest) / (highest − lowest)), then `grey(a')`.
pub(crate) fn run(
    parameters: &SarUniform,
    inputs: &[&[u32]],
    grey: impl Fn(f32) -> f32,
) -> Vec<u32> {
    slot::every_word(inputs, INVALID_WORD, |word| {
        if word == INVALID_WORD {
            return 0;
        }
        let range = (parameters.highest - parameters.lowest).max(1e-20);
        let normalised = ((f32::from_bits(word) - parameters.lowest) / range).clamp(0.0, 1.0);
        let [red, green, blue, _] = parameters.tint;
        let value = grey(normalised);
        colour::pack([value * red, value * green, value * blue], 1.0)
    })
}
