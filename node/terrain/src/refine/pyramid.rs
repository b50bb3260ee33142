//! The error pyramid: for every triangle of a leaf's hierarchy, how far any sample in it is off its plane.
//! In: a leaf's heights in units. Out: two 16-bit codes a mark, one for each side. Bounds, never below the
//! truth, and nested: never below that of a triangle inside. Whole numbers only, the same on every processor.

use geodesy::LATTICE_BITS;

use super::code::{code_up, decode};
use super::marks::{DEEPEST_MARK, LATTICE_NODES, marks_of_level, node, pair};

/// The errors of all triangles of a leaf, by node: the code of side 0 in the low half, of side 1 in the high. 0 for
/// sides that do not exist, the corners and the centre.
///
/// `heights` are those of the 257 × 257 nodes, row by row, in units and within ±2^27. Were there more or fewer, every
/// triangle would be given the largest code, so that all are split.
///
/// From the smallest triangles to the largest: E(t) is the largest of g(t) and the bounds of t's two children. For levels
/// 14…11 g is the largest deviation of any sample of t from its plane, whole units up. A larger t is divided four
/// levels down into 16 triangles c, and g is the largest over these of
///
/// (largest deviation of c's three corners from the plane of t) + E(c),
///
/// which bounds every sample: within c, both planes' difference is largest at a corner.
#[must_use]
pub fn pyramid(heights: &[i32]) -> Vec<u32> {
    let Ok(heights) = <&[i32; LATTICE_NODES]>::try_from(heights) else {
        return vec![u32::MAX; LATTICE_NODES];
    };
    let mut errors = vec![0; LATTICE_NODES];
    for level in (0..=DEEPEST_MARK).rev() {
        for mark in marks_of_level(level) {
            let Some(own) = pair(LATTICE_BITS, mark[0], mark[1]) else {
                continue;
            };
            let mut word = 0;
            for (side, apex) in own.apexes.iter().enumerate() {
                if let Some(apex) = apex {
                    let triangle = Triangle::new(heights, own.ends, *apex);
                    let code = code_up(triangle.error(heights, &errors, level));
                    word |= u32::from(code) << (16 * side);
                }
            }
            if let Some(slot) = errors.get_mut(node(mark)) {
                *slot = word;
            }
        }
    }
    errors
}

/// The bound of the triangle between two nodes: its right angle and the midpoint of its hypotenuse.
fn bound(errors: &[u32], apex: i64, mark: i64) -> u32 {
    let word = errors.get(mark as usize).copied().unwrap_or(u32::MAX);
    // Side 0 is the one whose apex has the smaller number.
    decode((word >> (16 * u32::from(apex > mark))) as u16)
}

/// The 16 triangles four levels below one.
const PARTS: [Part; 16] = parts();

/// A triangle within one whose right angle is at (0, 0), and whose legs lead to (4, 0) and (0, 4).
#[derive(Clone, Copy)]
struct Part {
    /// Ends of the hypotenuse and apex: points (i, j) of the grid, as 5 j + i.
    corners: [usize; 3],
    apex: [i64; 2],
    /// Twice the midpoint of the hypotenuse.
    mark_twice: [i64; 2],
}

const fn parts() -> [Part; 16] {
    let mut triangles = [[[0; 2]; 3]; 16];
    triangles[0] = [[4, 0], [0, 4], [0, 0]];
    let mut count = 1;
    while count < 16 {
        // From the back, so that each is read before children take its place.
        let mut number = count;
        while number > 0 {
            number -= 1;
            let [from, to, apex] = triangles[number];
            let middle = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2];
            triangles[2 * number] = [apex, from, middle];
            triangles[2 * number + 1] = [apex, to, middle];
        }
        count *= 2;
    }
    let mut parts = [Part {
        corners: [0; 3],
        apex: [0; 2],
        mark_twice: [0; 2],
    }; 16];
    let mut number = 0;
    while number < 16 {
        let [from, to, apex] = triangles[number];
        parts[number] = Part {
            corners: [grid(from), grid(to), grid(apex)],
            apex,
            mark_twice: [from[0] + to[0], from[1] + to[1]],
        };
        number += 1;
    }
    parts
}

const fn grid([i, j]: [i64; 2]) -> usize {
    (5 * j + i) as usize
}

/// The points of the grid i + j ≤ 4 but the triangle's corners, which are on its plane.
const GRID: [[i64; 2]; 12] = [
    [1, 0],
    [2, 0],
    [3, 0],
    [0, 1],
    [1, 1],
    [2, 1],
    [3, 1],
    [0, 2],
    [1, 2],
    [2, 2],
    [0, 3],
    [1, 3],
];

/// A triangle with the plane of its corners' heights.
struct Triangle {
    /// The node number of the apex, and steps from there to the ends of the hypotenuse.
    start: i64,
    legs: [i64; 2],
    /// The apex's height, and what is added to it towards the ends.
    height: i64,
    rise: [i64; 2],
}

impl Triangle {
    fn new(heights: &[i32; LATTICE_NODES], ends: [[u16; 2]; 2], apex: [u16; 2]) -> Self {
        let start = node(apex) as i64;
        let height = sample(heights, start);
        let nodes = ends.map(|end| node(end) as i64);
        Self {
            start,
            legs: nodes.map(|end| end - start),
            height,
            rise: nodes.map(|end| sample(heights, end) - height),
        }
    }

    /// The node at i and j Nth parts of the legs. The sum is divisible by N wherever there is a node.
    fn at<const N: i64>(&self, [i, j]: [i64; 2]) -> i64 {
        self.start + (self.legs[0] * i + self.legs[1] * j) / N
    }

    /// E(t), before it is rounded up to a code.
    fn error(&self, heights: &[i32; LATTICE_NODES], errors: &[u32], level: u8) -> u32 {
        let own = match level {
            14 => return self.largest::<2>(heights, &[[1, 1]]),
            13 => self.largest::<2>(heights, &[[1, 0], [0, 1], [1, 1]]),
            // Along the hypotenuse, then halfway to the apex.
            12 => self.largest::<4>(heights, &[[3, 1], [2, 2], [1, 3], [2, 0], [1, 1], [0, 2]]),
            11 => self.largest::<4>(heights, &GRID),
            _ => self.over_parts(heights, errors),
        };
        // The children have their right angles at the middle of the hypotenuse, and a leg for their own.
        let middle = self.at::<2>([1, 1]);
        let first = bound(errors, middle, self.at::<2>([1, 0]));
        own.max(first)
            .max(bound(errors, middle, self.at::<2>([0, 1])))
    }

    /// The deviation of the sample at i and j Nth parts of the legs, times N.
    fn deviation<const N: i64>(&self, heights: &[i32; LATTICE_NODES], point: [i64; 2]) -> i64 {
        let plane = N * self.height + point[0] * self.rise[0] + point[1] * self.rise[1];
        (N * sample(heights, self.at::<N>(point)) - plane).abs()
    }

    /// The largest deviation at these Nth parts of the legs, rounded up.
    fn largest<const N: i64>(&self, heights: &[i32; LATTICE_NODES], points: &[[i64; 2]]) -> u32 {
        let deviations = points
            .iter()
            .map(|point| self.deviation::<N>(heights, *point));
        whole::<N>(deviations.max().unwrap_or(0))
    }

    /// The bound over the 16 parts.
    fn over_parts(&self, heights: &[i32; LATTICE_NODES], errors: &[u32]) -> u32 {
        let mut deviations = [0; 25];
        for point in GRID {
            deviations[grid(point)] = self.deviation::<4>(heights, point);
        }
        PARTS.iter().fold(0, |most, part| {
            let [from, to, apex] = part.corners.map(|corner| deviations[corner]);
            let inside = bound(
                errors,
                self.at::<4>(part.apex),
                self.at::<8>(part.mark_twice),
            );
            most.max(whole::<4>(from.max(to).max(apex)).saturating_add(inside))
        })
    }
}

/// The height of a node that is in the lattice, as every node of a triangle is.
fn sample(heights: &[i32; LATTICE_NODES], node: i64) -> i64 {
    heights
        .get(node as usize)
        .map_or(0, |height| i64::from(*height))
}

/// A number of Nths ≥ 0, rounded up to whole units; what is beyond the largest is the largest.
fn whole<const N: i64>(numerator: i64) -> u32 {
    u32::try_from((numerator + N - 1) / N).unwrap_or(u32::MAX)
}
