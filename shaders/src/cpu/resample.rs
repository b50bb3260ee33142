//! CPU twin of process/resample.wgsl: an ancestor's samples on a finer tile's lattice.
//! In: the ancestor's slot. Out: the tile's slot: the ancestor's nodes as they are, means in between.

use crate::cpu::support::slot;
use crate::layout::{INVALID_WORD, ResampleUniform, SampleForm};

/// Runs the stage.
#[must_use]
pub fn run(parameters: &ResampleUniform, inputs: &[&[u32]]) -> Vec<u32> {
    let raw_colours = parameters.form == SampleForm::RawColour as u32;
    let hole = if raw_colours { 0 } else { INVALID_WORD };
    let shift = parameters.shift.min(22);
    let scale = 1.0 / (1_u32 << shift) as f32;
    slot::every_texel(|[x, y]| {
        let fine_x = parameters.origin[0] + x - 9;
        let fine_y = parameters.origin[1] + y - 9;
        let corner = [(fine_x >> shift) + 9, (fine_y >> shift) + 9];
        let mask = (1 << shift) - 1;
        let fx = (fine_x & mask) as f32 * scale;
        let fy = (fine_y & mask) as f32 * scale;
        let steps = [[0, 0], [1, 0], [0, 1], [1, 1]];
        let words =
            steps.map(|[dx, dy]| slot::word(inputs, 0, [corner[0] + dx, corner[1] + dy], hole));
        let mut weights = [
            (1.0 - fx) * (1.0 - fy),
            fx * (1.0 - fy),
            (1.0 - fx) * fy,
            fx * fy,
        ];
        for (weight, word) in weights.iter_mut().zip(words) {
            let is_hole = if raw_colours {
                word >> 30 == 0
            } else {
                word == hole
            };
            if is_hole {
                *weight = 0.0;
            }
        }
        let sum = weights[0] + weights[1] + weights[2] + weights[3];
        if sum <= 0.0 {
            return hole;
        }
        let mean = |values: [f32; 4]| {
            (values[0] * weights[0]
                + values[1] * weights[1]
                + values[2] * weights[2]
                + values[3] * weights[3])
                / sum
        };
        if raw_colours {
            let channel = |bits: u32| {
                let codes = words.map(|word| (word >> bits & 1023) as f32);
                (mean(codes) + 0.5) as u32
            };
            channel(0) | channel(10) << 10 | channel(20) << 20 | 3 << 30
        } else {
            let numbers = words.map(|word| f32::from_bits(if word == hole { 0 } else { word }));
            mean(numbers).to_bits()
        }
    })
}
