//! CPU twin of fuse/surface.wgsl: fused colour over bare ground.
//! In: a slot of fused colours. Out: 259² words of opaque colour, nodes −1…257.

use crate::cpu::support::{colour, slot};
use crate::layout::{LAYER_SIDE, SurfaceUniform};

/// Runs the stage.
#[must_use]
pub fn run(parameters: &SurfaceUniform, inputs: &[&[u32]]) -> Vec<u32> {
    let side = LAYER_SIDE as i32;
    let mut words = Vec::with_capacity((LAYER_SIDE * LAYER_SIDE) as usize);
    for y in 0..side {
        for x in 0..side {
            let fused = colour::unpack(slot::word(inputs, 0, [x + 8, y + 8], 0));
            words.push(colour::pack(
                colour::mix_colours(parameters.ground, fused, fused[3]),
                1.0,
            ));
        }
    }
    words
}
