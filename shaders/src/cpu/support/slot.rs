//! Twin of shared/slot.wgsl: reading slots, and differences between neighbouring heights.
//! In: words of slots. Out: words, and differences that step around holes.

use crate::layout::{INVALID_WORD, SLOT_SIDE};

/// Texels along a side, as index.
pub(crate) const SIDE: usize = SLOT_SIDE as usize;

/// The word at texel (x, y); coordinates beyond the slot are cut to its edge. `hole` where there is none.
pub(crate) fn word(inputs: &[&[u32]], input: usize, [x, y]: [i32; 2], hole: u32) -> u32 {
    let last = SLOT_SIDE as i32 - 1;
    let index = y.clamp(0, last) as usize * SIDE + x.clamp(0, last) as usize;
    let words = inputs.get(input).and_then(|words| words.get(index));
    words.copied().unwrap_or(hole)
}

/// Runs `stage` for every texel (x, y) of a slot.
pub(crate) fn every_texel(mut stage: impl FnMut([i32; 2]) -> u32) -> Vec<u32> {
    let mut words = Vec::with_capacity(SIDE * SIDE);
    for y in 0..SLOT_SIDE as i32 {
        for x in 0..SLOT_SIDE as i32 {
            words.push(stage([x, y]));
        }
    }
    words
}

/// Runs `stage` on every word of the first input.
pub(crate) fn every_word(
    inputs: &[&[u32]],
    hole: u32,
    mut stage: impl FnMut(u32) -> u32,
) -> Vec<u32> {
    every_texel(|texel| stage(word(inputs, 0, texel, hole)))
}

/// Change of height per sample along one axis, from the words on both sides: the central difference;
/// one-sided beside a hole and at the slot's edge, where cut coordinates make a neighbour the sample
/// itself; 0 in a hole.
pub(crate) fn difference(before: u32, here: u32, after: u32, steps: i32) -> f32 {
    let before_is_hole = before == INVALID_WORD;
    let after_is_hole = after == INVALID_WORD;
    let low = f32::from_bits(if before_is_hole { here } else { before });
    let high = f32::from_bits(if after_is_hole { here } else { after });
    let halved = !before_is_hole && !after_is_hole && steps == 2;
    let change = (high - low) * if halved { 0.5 } else { 1.0 };
    if here == INVALID_WORD { 0.0 } else { change }
}

/// Changes of height per sample along x and y at a texel of the first input.
pub(crate) fn differences(inputs: &[&[u32]], [x, y]: [i32; 2]) -> [f32; 2] {
    let last = SLOT_SIDE as i32 - 1;
    let at = |x, y| word(inputs, 0, [x, y], INVALID_WORD);
    let here = at(x, y);
    let steps = |c: i32| if c == 0 || c == last { 1 } else { 2 };
    [
        difference(at(x - 1, y), here, at(x + 1, y), steps(x)),
        difference(at(x, y - 1), here, at(x, y + 1), steps(y)),
    ]
}
