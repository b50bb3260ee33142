//! CPU twin of process/relief.wgsl: fused heights to surface normals in tangent frames.
//! In: heights of one tile with border. Out: 259×259 texels of two signed bytes: −127…127 for −1…1.

use crate::cpu::support::tangent;
use crate::layout::{LAYER_SIDE, ReliefUniform};

/// Runs the stage: nodes −1…257, row by row.
#[must_use]
pub fn run(parameters: &ReliefUniform, inputs: &[&[u32]]) -> Vec<[i8; 2]> {
    let side = LAYER_SIDE as i32;
    let mut texels = Vec::with_capacity((LAYER_SIDE * LAYER_SIDE) as usize);
    for y in 0..side {
        for x in 0..side {
            let (_, [e1, e2, _]) = tangent::surface(&parameters.tile, inputs, [x + 8, y + 8]);
            texels.push([encode(e1), encode(e2)]);
        }
    }
    texels
}

fn encode(value: f32) -> i8 {
    (value.signum() * value.abs().sqrt() * 127.0).round_ties_even() as i8
}

/// The component of the unit normal that a byte stands for.
#[must_use]
pub fn decode(byte: i8) -> f32 {
    let root = f32::from(byte) / 127.0;
    root * root.abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{INVALID_WORD, TileGeometry};

    const SIDE: usize = LAYER_SIDE as usize;

    /// The tile whose node (0, 0) is the middle of face 0, 65536 nodes a face.
    fn middle_of_a_face() -> ReliefUniform {
        ReliefUniform {
            tile: TileGeometry::new(0, 8, 128, 128, 6_371_000.0),
            layer: 0,
            padding: [0; 3],
        }
    }

    fn slot(height: impl Fn(usize, usize) -> f32) -> Vec<u32> {
        (0..275 * 275)
            .map(|n| height(n % 275, n / 275).to_bits())
            .collect()
    }

    #[test]
    fn a_plane_has_its_slope_everywhere() {
        let parameters = middle_of_a_face();
        // At the face's centre a node step is 4/3 · step · radius metres; rise 1 in 10 along u.
        let node_m = 4.0 / 3.0 * parameters.tile.step * parameters.tile.radius_m;
        let heights = slot(|x, _| x as f32 * node_m / 10.0);
        let texels = run(&parameters, &[&heights]);
        let expected = -0.1_f32.atan().sin();
        let [x, y] = texels[130 * SIDE + 2].map(decode);
        assert!((x - expected).abs() < 3e-3, "{x} {expected}");
        assert!(y.abs() < 1e-3);
    }

    #[test]
    fn holes_are_flat_and_their_rims_one_sided() {
        let mut heights = slot(|x, _| x as f32 * 6.25);
        heights[100 * 275 + 100] = INVALID_WORD;
        let texels = run(&middle_of_a_face(), &[&heights]);
        let at = |x: usize, y: usize| texels[(y - 8) * SIDE + (x - 8)];
        assert_eq!(at(100, 100), [0, 0]);
        assert_ne!(at(101, 100), [0, 0]);
        assert_eq!(at(101, 100)[0], at(110, 100)[0]);
        assert_eq!(at(99, 100)[0], at(90, 100)[0]);
    }

    #[test]
    fn bytes_keep_gentle_slopes_best() {
        for n in -1000..=1000 {
            let value = n as f32 / 1000.0;
            // Half a step of the root, at the root.
            let step = (value.abs().sqrt() + 0.5 / 127.0) / 127.0;
            let error = (decode(encode(value)) - value).abs();
            assert!(error <= 1.01 * step, "{value}: {error}");
        }
        assert!(
            decode(encode(0.001)) > 0.0005,
            "a slope of a thousandth is not flat"
        );
    }
}
