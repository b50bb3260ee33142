//! The vertices and triangles of a refined leaf: the twin of the compute stage `emit`.
//! In: marks, heights, anchors, border words. Out: vertices in the order of the set marks, and indices. Integers are those
//! of the device to the bit; f32 sums are made in the order that [`emit`] tells, so that devices differ by FMA alone.

use geodesy::frame::scalar_f32;

use super::anchors::ANCHOR_WORDS;
use super::border::{BORDER_WORDS, border_index, vertex_of};
use super::count::prefix_sums;
use super::marks::{Marks, node};
use super::triangles::triangles;
use crate::mesh::Vertex;

/// Heights in units of 2^10 m times N0 in 2^-30 are steps.
const UNIT_EXPONENT: i32 = 10;

/// The mesh of a leaf: a vertex for each set mark, in the order of words and bits, and triples of indices.
///
/// `heights` are the heights of all nodes (number y · 257 + x) in units of `unit_m` metres, a power of two; `anchors` and
/// `border` are what [`anchors`](super::anchors()) and [`border_words`](super::border_words) made with the same
/// unit. Numbers that the slices do not reach count as 0.
///
/// The vertex of an inner node (x, y), with X = min(x ≫ 4, 15), Y likewise, a = x − (16X + 8), b = y − (16Y + 8), the
/// words of the [anchor](super::ANCHOR_WORDS) of block 16Y + X, its height h in units and d = h − word 13, for each
/// component c:
/// 1. line: t = a·A + b·B in i32, in steps t ≪ shift in i64; where shift < 0: (t + (1 ≪ (−shift − 1))) ≫ −shift.
/// 2. raise: the i64 product p = d · N0, in steps p ≪ (e − 10) where unit_m = 2^e;
///    where e < 10: (p + (1 ≪ (9 − e))) ≫ (10 − e).
/// 3. curve, in f32: q = ((((aa·c0 + bb·c1) + ab·c2) + aab·c3) + abb·c4) + aabb·c5, where aa = a·a, aab = aa·b … are
///    exact; s = (word(32 + c) + a·dn/da) + b·dn/db; m = q + (f32(d)·unit)·s; w = floor(m);
///    in steps (i64(w) ≪ 20) + i32(round_ties_even((m − w)·2^20)).
/// 4. position = words 0–5 + line + raise + curve, in 64 bits that wrap.
///
/// Its normal is n = (f32(N0)·2^-30 + a·dn/da) + b·dn/db; each component floor(0.5 + 32767·clamp(n, −1, 1)), as
/// pack2x16snorm rounds, and a fourth of 0. A border node's vertex is the first nine of its border words.
#[must_use]
pub fn emit(
    marks: &Marks,
    heights: &[i32],
    anchors: &[u32],
    border: &[u32],
    unit_m: f64,
) -> (Vec<Vertex>, Vec<u32>) {
    let vertex = |[x, y]: [u16; 2]| match border_index(x, y) {
        Some(node) => vertex_of(&words(border, node * BORDER_WORDS)),
        None => {
            let height = heights.get(node([x, y])).copied().unwrap_or_default();
            inner_vertex(anchors, x, y, height, unit_m)
        }
    };
    let vertices = marks.positions().map(vertex).collect();
    let sums = prefix_sums(marks);
    let indices = triangles(marks)
        .as_flattened()
        .iter()
        // Corners of triangles are set marks.
        .filter_map(|[x, y]| sums.vertex(marks, *x, *y))
        .collect();
    (vertices, indices)
}

/// The vertex of an inner node (x, y) at `height` units.
fn inner_vertex(anchors: &[u32], x: u16, y: u16, height: i32, unit_m: f64) -> Vertex {
    let (column, row) = ((x >> 4).min(15), (y >> 4).min(15));
    let block = usize::from(row) * 16 + usize::from(column);
    let anchor = Anchor(words(anchors, block * ANCHOR_WORDS));
    let a = i32::from(x) - (16 * i32::from(column) + 8);
    let b = i32::from(y) - (16 * i32::from(row) + 8);
    let place = Place { a, b };
    let difference = height.wrapping_sub(anchor.integer(13));
    // A power of two, so f32 holds it and its exponent is the logarithm.
    let unit = scalar_f32(unit_m);
    let exponent = (unit.to_bits() >> 23).cast_signed() - 127;
    let position = [0, 1, 2].map(|c| {
        let line = place.line(&anchor, c);
        let product = i64::from(difference) * i64::from(anchor.integer(41 + c));
        let raise = shifted(product, exponent - UNIT_EXPONENT);
        let metres = place.curve(&anchor, c) + (difference as f32 * unit) * place.turn(&anchor, c);
        anchor
            .origin(c)
            .wrapping_add(line)
            .wrapping_add(raise)
            .wrapping_add(steps(metres))
            .cast_unsigned()
    });
    let [px, py, pz] = position;
    let halves = |c: u64| [c as u32, (c >> 32) as u32];
    let ([x0, x1], [y0, y1], [z0, z1]) = (halves(px), halves(py), halves(pz));
    let [nx, ny, nz] = [0, 1, 2].map(|c| snorm(place.normal(&anchor, c)));
    Vertex {
        position: [x0, x1, y0, y1, z0, z1],
        normal: [nx, ny, nz, 0],
        lattice: [x, y],
    }
}

/// The words of one block.
struct Anchor([u32; ANCHOR_WORDS]);

impl Anchor {
    fn word(&self, at: usize) -> u32 {
        self.0.get(at).copied().unwrap_or_default()
    }

    fn integer(&self, at: usize) -> i32 {
        self.word(at).cast_signed()
    }

    fn float(&self, at: usize) -> f32 {
        f32::from_bits(self.word(at))
    }

    /// Component c of P(0, 0) in steps.
    fn origin(&self, c: usize) -> i64 {
        let (low, high) = (self.word(2 * c), self.word(2 * c + 1));
        (u64::from(high) << 32 | u64::from(low)).cast_signed()
    }
}

/// A place in a block: cells from its middle.
struct Place {
    a: i32,
    b: i32,
}

impl Place {
    fn floats(&self) -> (f32, f32) {
        (self.a as f32, self.b as f32)
    }

    /// The linear part in steps.
    fn line(&self, anchor: &Anchor, c: usize) -> i64 {
        let along_a = self.a.wrapping_mul(anchor.integer(6 + c));
        let along_b = self.b.wrapping_mul(anchor.integer(9 + c));
        let sum = along_a.wrapping_add(along_b);
        shifted(i64::from(sum), anchor.integer(12))
    }

    /// What curves away from the linear part at the reference height, in metres.
    fn curve(&self, anchor: &Anchor, c: usize) -> f32 {
        let (a, b) = self.floats();
        let (aa, bb, ab) = (a * a, b * b, a * b);
        let powers = [aa, bb, ab, aa * b, a * bb, aa * bb];
        let [first, rest @ ..] = powers;
        let mut sum = first * anchor.float(14 + c);
        for (n, power) in rest.into_iter().enumerate() {
            sum += power * anchor.float(17 + 3 * n + c);
        }
        sum
    }

    /// How the normal differs from N0.
    fn turn(&self, anchor: &Anchor, c: usize) -> f32 {
        let (a, b) = self.floats();
        (anchor.float(32 + c) + a * anchor.float(35 + c)) + b * anchor.float(38 + c)
    }

    /// The normal, whose length is 1 but for the curve within a block.
    fn normal(&self, anchor: &Anchor, c: usize) -> f32 {
        let (a, b) = self.floats();
        let middle = anchor.integer(41 + c) as f32 * (1.0 / 1_073_741_824.0);
        (middle + a * anchor.float(35 + c)) + b * anchor.float(38 + c)
    }
}

/// value · 2^shift, rounded to the nearest, halves up.
fn shifted(value: i64, shift: i32) -> i64 {
    match shift {
        0.. => value.wrapping_shl(shift.cast_unsigned().min(63)),
        _ => {
            let right = shift.unsigned_abs().min(62);
            value.wrapping_add(1 << (right - 1)) >> right
        }
    }
}

/// Metres in steps: whole metres and the rest apart, because the device has no wider float.
fn steps(metres: f32) -> i64 {
    let whole = metres.floor();
    let rest = ((metres - whole) * 1_048_576.0).round_ties_even();
    (i64::from(whole as i32) << 20) + i64::from(rest as i32)
}

/// A component of a normal as a signed normalised 16-bit number.
fn snorm(component: f32) -> i16 {
    (0.5 + 32_767.0 * component.clamp(-1.0, 1.0)).floor() as i16
}

/// The words from `first` on.
fn words<const N: usize>(all: &[u32], first: usize) -> [u32; N] {
    std::array::from_fn(|n| all.get(first + n).copied().unwrap_or_default())
}
