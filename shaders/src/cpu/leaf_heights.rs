//! CPU twin of refine/leaf_heights.wgsl: heights of a leaf's nodes in units.
//! In: a slot of fused heights, border heights. Out: i32 units of 257² nodes, row by row; holes are 0.

use crate::cpu::support::slot;
use crate::layout::{INVALID_WORD, LeafHeightsUniform};

/// Nodes along a side.
const NODES: i32 = 257;
/// The largest height in units.
const LARGEST: f32 = 134_217_728.0;

/// Runs the stage. `border` holds the ten words of each of the 1024 border nodes; the last is its height in units.
/// Without an input all inner heights are 0.
#[must_use]
pub fn run(parameters: &LeafHeightsUniform, input: Option<&[u32]>, border: &[u32]) -> Vec<i32> {
    let shift = parameters.shift.min(22);
    let scale = 1.0 / (1_u32 << shift) as f32;
    let inputs = [input.unwrap_or_default()];
    let height_m = |x: i32, y: i32| {
        let fine = [parameters.origin[0] + x, parameters.origin[1] + y];
        let [corner_x, corner_y] = fine.map(|c| (c >> shift) + 9);
        let [fx, fy] = fine.map(|c| (c & ((1 << shift) - 1)) as f32 * scale);
        let weights = [
            (1.0 - fx) * (1.0 - fy),
            fx * (1.0 - fy),
            (1.0 - fx) * fy,
            fx * fy,
        ];
        let (mut sum, mut weighted) = (0.0, 0.0);
        for ([dx, dy], weight) in [[0, 0], [1, 0], [0, 1], [1, 1]].into_iter().zip(weights) {
            let word = slot::word(&inputs, 0, [corner_x + dx, corner_y + dy], INVALID_WORD);
            if word != INVALID_WORD {
                sum += weight;
                weighted += f32::from_bits(word) * weight;
            }
        }
        if sum > 0.0 { weighted / sum } else { 0.0 }
    };
    let unit = |x: i32, y: i32| {
        if let Some(node) = border_index(x, y) {
            let word = border.get(node * 10 + 9).copied().unwrap_or_default();
            return word.cast_signed();
        }
        let units = (height_m(x, y) * parameters.units_per_m).round_ties_even();
        units.clamp(-LARGEST, LARGEST) as i32
    };
    (0..NODES)
        .flat_map(|y| (0..NODES).map(move |x| (x, y)))
        .map(|(x, y)| unit(x, y))
        .collect()
}

/// Place of a border node among them: rows 0 and 256, then the rest of columns 0 and 256.
const fn border_index(x: i32, y: i32) -> Option<usize> {
    match (x, y) {
        (_, 0) => Some(x as usize),
        (_, 256) => Some(257 + x as usize),
        (0, _) => Some(513 + y as usize),
        (256, _) => Some(768 + y as usize),
        _ => None,
    }
}
