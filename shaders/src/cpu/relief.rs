//! CPU twin of process/relief.wgsl: elevation to surface normals in tangent frames.
//! In: heights of one tile with border. Out: 259×259 texels of two signed bytes: −127…127 for −1…1.

use crate::layout::{INVALID_HEIGHT, ReliefRecord};

/// Nodes along a side of the result: a tile's 257 and one border node at each end.
pub const OUT_NODES: usize = 259;
const STORED: usize = 275;
const BORDER: i64 = 9;

/// Runs the stage. `heights` holds 275×275 quanta from `tile.first` on; a shorter buffer reads as holes.
#[must_use]
pub fn run(tile: &ReliefRecord, heights: &[i32]) -> Vec<[i8; 2]> {
    let height = |i: i64, j: i64| {
        let offset = (j + BORDER) as usize * STORED + (i + BORDER) as usize;
        heights
            .get(tile.first as usize + offset)
            .copied()
            .unwrap_or(INVALID_HEIGHT)
    };
    let mut texels = Vec::with_capacity(OUT_NODES * OUT_NODES);
    for j in -1..OUT_NODES as i64 - 1 {
        for i in -1..OUT_NODES as i64 - 1 {
            let here = height(i, j);
            let rise_u = tile.quantum_m * slope(height(i - 1, j), here, height(i + 1, j));
            let rise_v = tile.quantum_m * slope(height(i, j - 1), here, height(i, j + 1));
            let s = tile.origin[0] + i as f32 * tile.step;
            let t = tile.origin[1] + j as f32 * tile.step;
            let [x, y] = normal(tile, s, t, rise_u, rise_v);
            texels.push([encode(x), encode(y)]);
        }
    }
    texels
}

fn normal(tile: &ReliefRecord, s: f32, t: f32, rise_u: f32, rise_v: f32) -> [f32; 2] {
    let (u, v) = (st_to_uv(s), st_to_uv(t));
    let inverse = 1.0 / (1.0 + u * u + v * v).sqrt();
    let (along_u, along_v) = (u * inverse, v * inverse);
    let per_u = st_to_uv_slope(s) * tile.step * inverse * tile.radius_m;
    let per_v = st_to_uv_slope(t) * tile.step * inverse * tile.radius_m;
    let length_u = (1.0 - along_u * along_u).sqrt();
    let a = per_u * length_u;
    let b = per_v * (-along_u * along_v) / length_u;
    let rest =
        1.0 - along_v * along_v - along_u * along_u * along_v * along_v / (length_u * length_u);
    let c = per_v * rest.max(0.0).sqrt();
    let (x, y, z) = (-rise_u * c, rise_u * b - rise_v * a, a * c);
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length]
}

fn slope(before: i32, here: i32, after: i32) -> f32 {
    let hole = |h: i32| h == INVALID_HEIGHT;
    if hole(here) || (hole(before) && hole(after)) {
        0.0
    } else if hole(before) {
        after.wrapping_sub(here) as f32
    } else if hole(after) {
        here.wrapping_sub(before) as f32
    } else {
        0.5 * after.wrapping_sub(before) as f32
    }
}

fn st_to_uv(s: f32) -> f32 {
    if s >= 0.5 {
        (4.0 * s * s - 1.0) / 3.0
    } else {
        let r = 1.0 - s;
        (1.0 - 4.0 * r * r) / 3.0
    }
}

fn st_to_uv_slope(s: f32) -> f32 {
    8.0 / 3.0 * s.max(1.0 - s)
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

    fn middle_of_a_face() -> ReliefRecord {
        ReliefRecord {
            origin: [0.5, 0.5],
            step: 1.0 / 65536.0,
            quantum_m: 1.0 / 16.0,
            radius_m: 6_371_000.0,
            face: 0,
            layer: 0,
            first: 0,
        }
    }

    #[test]
    fn a_plane_has_its_slope_everywhere() {
        let tile = middle_of_a_face();
        // At the face's centre a node step is 4/3 · step · radius metres; rise 1 in 10 along u.
        let node_m = 4.0 / 3.0 * tile.step * tile.radius_m;
        let rise = (node_m / 10.0 / tile.quantum_m).round() as i32;
        let heights: Vec<i32> = (0..275 * 275).map(|n| (n % 275) * rise).collect();
        let texels = run(&tile, &heights);
        let expected = -(rise as f32 * tile.quantum_m / node_m).atan().sin();
        let [x, y] = texels[130 * OUT_NODES + 2].map(decode);
        assert!((x - expected).abs() < 3e-3, "{x} {expected}");
        assert!(y.abs() < 1e-3);
    }

    #[test]
    fn holes_are_flat_and_their_rims_one_sided() {
        let tile = middle_of_a_face();
        let mut heights: Vec<i32> = (0..275 * 275).map(|n| (n % 275) * 100).collect();
        heights[100 * 275 + 100] = INVALID_HEIGHT;
        let texels = run(&tile, &heights);
        let at = |i: usize, j: usize| texels[(j - 8) * OUT_NODES + (i - 8)];
        assert_eq!(at(100, 100), [0, 0]);
        assert_eq!(at(101, 100)[0], at(110, 100)[0]);
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
