//! CPU twin of fuse/lens.wgsl: one result outside a circle, another inside.
//! In: two slots of any one kind, outside and inside. Out: for each node the word of its side.

use crate::cpu::support::slot;
use crate::layout::{INVALID_WORD, LensUniform};

/// Runs the stage.
#[must_use]
pub fn run(parameters: &LensUniform, inputs: &[&[u32]]) -> Vec<u32> {
    slot::every_texel(|[x, y]| {
        let side = usize::from(polynomial(parameters, [x - 9, y - 9]) <= 0.0);
        slot::word(inputs, side, [x, y], INVALID_WORD)
    })
}

/// The polynomial at node (i, j): up to 0 inside. Horner's scheme in x within Horner's scheme in y.
#[must_use]
pub fn polynomial(parameters: &LensUniform, [i, j]: [i32; 2]) -> f32 {
    let x = (i - 128) as f32 / 137.0;
    let y = (j - 128) as f32 / 137.0;
    let degree = parameters.degree.min(8) as usize;
    let mut value = 0.0;
    for m in (0..=degree).rev() {
        let mut row = 0.0;
        for n in (0..=degree).rev() {
            let index = m * (degree + 1) + n;
            row = row * x + parameters.coefficients[index / 4][index % 4];
        }
        value = value * y + row;
    }
    value
}
