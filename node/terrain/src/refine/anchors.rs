//! Anchors: where the inner nodes of a leaf are, so that a device without 64-bit floats finds them.
//! In: a tile, a reference height for each block of 16 × 16 cells. Out: 44 words a block: a fixed point, linear steps as
//! integers, the planet's curve as a small polynomial. `emit` tells how vertices follow. It reads no heights.

use geodesy::frame::{FixedPoint, STEPS_PER_M, vector_f32};
use geodesy::{CELLS, Ellipsoid, Tile, st_to_uv};
use glam::DVec3;

use super::BLOCKS;

/// Words of a block's anchor.
///
/// | words | what |
/// |---|---|
/// | 0–5 | [`FixedPoint::words`] of P(0, 0), the block's middle at the reference height |
/// | 6–8, 9–11 | A and B: i32 vectors in steps · 2^shift for each cell along a and along b, at most 2^26 |
/// | 12 | shift: i32, −16…31 |
/// | 13 | the reference height in units: i32 |
/// | 14–31 | f32 vectors in metres: coefficients of a², b², ab, a²b, ab², a²b² |
/// | 32–34 | n0 − N0 · 2^-30: f32 vector, what integers leave of n0 |
/// | 35–37, 38–40 | dn/da, dn/db: f32 vectors, how the normal changes for each cell |
/// | 41–43 | N0: i32 vector, n0 in 2^-30 |
///
/// (a, b) count cells from the block's middle, each −8…8. The polynomial goes through the nine nodes at −7, 0, 7: these
/// are the nodes closest to Chebyshev's for −8…8, ±8 √¾, so that it is off by 0.67 of what it would be through −8, 0, 8.
/// n0 is near the normal in the middle, moved so that n0 + a·dn/da + b·dn/db is off alike there and at the corners.
pub const ANCHOR_WORDS: usize = 44;

/// Blocks along a side of a leaf.
const BLOCKS_A_SIDE: usize = 16;
/// Nodes along a side of the grid: three of each block.
const GRID: usize = 3 * BLOCKS_A_SIDE;
/// Cells from a block's middle to the grid's nodes beside it, and to its edge.
const REACH: f64 = 7.0;
const HALF: f64 = 8.0;
/// A and B are no larger, so that a·A + b·B is within 32 bits.
const MOST_STEPS: f64 = 67_108_864.0;
/// The least and the greatest shift.
const SHIFTS: (i32, i32) = (-16, 31);
/// N0 counts the normal in 2^-30.
const NORMAL_STEPS: f64 = 1_073_741_824.0;

/// The anchors of a leaf: [`ANCHOR_WORDS`] for each of its [`BLOCKS`] (number Y · 16 + X).
///
/// `reference_units` are the blocks' reference heights in units of `unit_m` metres, best amid the block's own heights;
/// of blocks beyond the slice they are 0.
#[must_use]
pub fn anchors(
    ellipsoid: &Ellipsoid,
    tile: Tile,
    reference_units: &[i32],
    unit_m: f64,
) -> Vec<u32> {
    let grid = grid(ellipsoid, tile);
    let mut words = Vec::with_capacity(BLOCKS * ANCHOR_WORDS);
    for block in 0..BLOCKS {
        let (column, row) = (block % BLOCKS_A_SIDE, block / BLOCKS_A_SIDE);
        let reference = reference_units.get(block).copied().unwrap_or_default();
        let height_m = f64::from(reference) * unit_m;
        let node = |i: usize, j: usize| {
            grid.get((3 * row + j) * GRID + 3 * column + i)
                .copied()
                .unwrap_or_default()
        };
        let nodes: [[Node; 3]; 3] = std::array::from_fn(|j| std::array::from_fn(|i| node(i, j)));
        anchor(&nodes, reference, height_m, &mut words);
    }
    words
}

/// A node of the grid: its place on the ellipsoid and its normal.
#[derive(Clone, Copy, Debug, Default)]
struct Node {
    surface: DVec3,
    normal: DVec3,
}

/// The nodes of all blocks' polynomials, by rows.
fn grid(ellipsoid: &Ellipsoid, tile: Tile) -> Vec<Node> {
    let per_step = 1.0 / (CELLS << tile.level()) as f64;
    let along = |first: u32, n: usize| {
        let middle = f64::from(first) * CELLS as f64 + (n / 3) as f64 * (2.0 * HALF) + HALF;
        st_to_uv((middle + ((n % 3) as f64 - 1.0) * REACH) * per_step)
    };
    let u: [f64; GRID] = std::array::from_fn(|n| along(tile.x(), n));
    let [right, up, outward] = tile.face().frame();
    let mut nodes = Vec::with_capacity(GRID * GRID);
    for row in 0..GRID {
        let start = outward + up * along(tile.y(), row);
        nodes.extend(u.iter().map(|u| {
            let cube = start + right * *u;
            let normal = cube / cube.length();
            Node {
                surface: ellipsoid.point(normal, 0.0),
                normal,
            }
        }));
    }
    nodes
}

/// Writes the words of one block out of its nine nodes (`nodes[row][column]`).
fn anchor(nodes: &[[Node; 3]; 3], reference: i32, height_m: f64, words: &mut Vec<u32>) {
    let [low, middle, high] =
        nodes.map(|row| row.map(|node| node.surface + node.normal * height_m));
    let centre = middle[1];
    // First and second differences along a of each row, and what they are along b.
    let bend = |row: [DVec3; 3]| row[0] + row[2] - 2.0 * row[1];
    let slope = |row: [DVec3; 3]| row[2] - row[0];
    let [bend_low, bend_middle, bend_high] = [low, middle, high].map(bend);
    let [slope_low, slope_high] = [low, high].map(slope);
    let column = [low[1], middle[1], high[1]];
    let along_a = slope(middle) / (2.0 * REACH);
    let along_b = slope(column) / (2.0 * REACH);
    let square = REACH * REACH;
    let (cube, fourth) = (square * REACH, square * square);
    let coefficients = [
        bend_middle / (2.0 * square),
        bend(column) / (2.0 * square),
        (slope_high - slope_low) / (4.0 * square),
        (bend_high - bend_low) / (4.0 * cube),
        (slope_high + slope_low - 2.0 * slope(middle)) / (4.0 * cube),
        (bend_low + bend_high - 2.0 * bend_middle) / (4.0 * fourth),
    ];
    let largest = along_a.abs().max_element().max(along_b.abs().max_element());
    let (shift, steps_per_m) = scale_of(largest);
    words.extend(FixedPoint::from_ecef(centre).words());
    for vector in [along_a, along_b] {
        words.extend(integers(vector * steps_per_m));
    }
    words.push(shift.cast_unsigned());
    words.push(reference.cast_unsigned());
    words.extend(coefficients.into_iter().flat_map(floats));
    let [low, middle, high] = nodes.map(|row| row.map(|node| node.normal));
    let turn_a = (middle[2] - middle[0]) / (2.0 * REACH);
    let turn_b = (high[1] - low[1]) / (2.0 * REACH);
    // How far places are off grows with the square of the distance, and so is largest at some corner.
    let corner = |normal: DVec3, a: f64, b: f64| {
        (normal - middle[1] - (a * turn_a + b * turn_b) * REACH) * (HALF * HALF / square)
    };
    let off = [
        DVec3::ZERO,
        corner(low[0], -1.0, -1.0),
        corner(low[2], 1.0, -1.0),
        corner(high[0], -1.0, 1.0),
        corner(high[2], 1.0, 1.0),
    ];
    let steps = (middle[1] + middle_of(&off)) * NORMAL_STEPS;
    let whole = steps.to_array().map(f64::round_ties_even);
    words.extend(floats((steps - DVec3::from(whole)) / NORMAL_STEPS));
    words.extend(floats(turn_a));
    words.extend(floats(turn_b));
    words.extend(whole.map(|c| (c as i32).cast_unsigned()));
}

/// The middle of a ball that is little larger than it must be to hold all points (J. Ritter, 1990): that of the two
/// farthest apart, grown towards each that is outside.
fn middle_of(points: &[DVec3]) -> DVec3 {
    let (mut diameter_squared, mut middle) = (0.0, DVec3::ZERO);
    for (number, from) in points.iter().enumerate() {
        for to in points.iter().skip(number + 1) {
            let squared = from.distance_squared(*to);
            if squared > diameter_squared {
                (diameter_squared, middle) = (squared, (*from + *to) * 0.5);
            }
        }
    }
    let mut radius = 0.5 * diameter_squared.sqrt();
    for point in points {
        let distance = point.distance(middle);
        if distance > radius {
            let beyond = 0.5 * (distance - radius);
            middle += (*point - middle) * (beyond / distance);
            radius += beyond;
        }
    }
    middle
}

/// The least shift at which this many metres are at most [`MOST_STEPS`] of steps · 2^shift, and how many of these are
/// in a metre. Powers of two made by doubling, so that they are exact everywhere.
fn scale_of(largest_m: f64) -> (i32, f64) {
    let mut shift = SHIFTS.0;
    let mut steps_per_m = STEPS_PER_M * 65_536.0;
    while largest_m * steps_per_m > MOST_STEPS && shift < SHIFTS.1 {
        steps_per_m *= 0.5;
        shift += 1;
    }
    (shift, steps_per_m)
}

/// A vector as rounded integers.
fn integers(vector: DVec3) -> [u32; 3] {
    vector
        .to_array()
        .map(|c| (c.round_ties_even() as i32).cast_unsigned())
}

/// A vector as 32-bit floats. They are small: relative to the block, or without dimension.
fn floats(vector: DVec3) -> [u32; 3] {
    vector_f32(vector).to_array().map(f32::to_bits)
}
