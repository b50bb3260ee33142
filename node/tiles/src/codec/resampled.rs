//! Heights that were resampled from a raster: the raster's own samples, the place of the tile in it, and what
//! is left over.
//!
//! A lattice finer than its source holds several nodes for each source sample, and rounding hides from any
//! predictor that they lie on straight pieces. So the file keeps the window of the source instead, places
//! the nodes in it by a net of cubic polynomials, interpolates bilinearly, and stores the differences, which
//! are zero nearly everywhere. Nothing rests on the net being right: differences make it lossless.
//! All arithmetic is IEEE additions and multiplications in a fixed order, so every machine reads the same.
//!
//! | bytes | content |
//! |---|---|
//! | 0–3 | width and height of the window (u16), 2…4095 |
//! | 4–11 | base (i32) and step (u32): a sample is base + step × number |
//! | 12–19 | bytes of the net and of the window (u32) |
//! | 20– | net: columns, then rows of its knots in 1/65536 sample; window; differences |

use std::io;

use geodesy::{BORDER, CELLS, STORED_NODES};

use super::heights::{self, Prediction};
use super::{CodecError, clear_invalid};
use crate::format::{NODE_COUNT, Validity};

const HEAD_BYTES: usize = 20;
/// Lattice nodes between the net's knots inside the tile; in the border it is 3.
const SPACING: i64 = 32;
/// Knots a side: −9, −6, −3, 0, 32 … 256, 259, 262, 265. The bends of a face's edge fall on knots.
const KNOTS: usize = 15;
const PLACE_STEPS: f64 = 65_536.0;
const LONGEST_SIDE: usize = 4095;
/// A window with more samples than this costs more than it saves.
const LARGEST_WINDOW: usize = 2 * NODE_COUNT;

/// The window of a source raster that a tile's heights were resampled from bilinearly, and where in it the
/// tile's nodes lie.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    width: usize,
    height: usize,
    /// Quanta, `height` rows of `width`.
    window: Vec<i32>,
    /// Column and row of each knot in 1/65536 sample, rows along v.
    places: Vec<[i32; 2]>,
}

impl Origin {
    /// Gathers the window of one tile. `place(i, j)` is where node (i, j), −9…265 both ways, lies in the
    /// raster: column and row counted in samples, whole numbers at sample centres; `None` where it lies
    /// nowhere. `period` is the number of columns after which the raster repeats, for one that goes round the
    /// planet. `value(column, row)` is a sample in quanta; it is asked up to two samples beyond the places,
    /// also with negative numbers, and answers there as the resampling saw it (edge repeated, columns
    /// wrapped). Samples without data may have any value, their neighbour's best.
    ///
    /// `None` where a knot lies nowhere, or the window would be larger than the tile itself is worth.
    pub fn gather(
        mut place: impl FnMut(i64, i64) -> Option<[f64; 2]>,
        period: Option<f64>,
        mut value: impl FnMut(i64, i64) -> i32,
    ) -> Option<Self> {
        let [middle, _] = place(CELLS / 2, CELLS / 2)?;
        let mut places = Vec::with_capacity(KNOTS * KNOTS);
        let (mut lowest, mut highest) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for j in 0..KNOTS {
            for i in 0..KNOTS {
                let [mut column, row] = place(knot(i), knot(j))?;
                if let Some(period) = period {
                    column += period * ((middle - column) / period).round();
                }
                for (axis, coordinate) in [column, row].into_iter().enumerate() {
                    lowest[axis] = lowest[axis].min(coordinate);
                    highest[axis] = highest[axis].max(coordinate);
                }
                places.push([column, row]);
            }
        }
        let small = |coordinate: &f64| coordinate.abs() < 1e15;
        if !places.iter().flatten().all(small) {
            return None;
        }
        // Cubics may overshoot their knots a little.
        let first = lowest.map(|coordinate| coordinate.floor() as i64 - 1);
        let last = highest.map(|coordinate| coordinate.ceil() as i64 + 1);
        let [width, height] = [0, 1].map(|axis| (last[axis] - first[axis] + 1) as usize);
        if width > LONGEST_SIDE || height > LONGEST_SIDE || width * height > LARGEST_WINDOW {
            return None;
        }
        let mut window = Vec::with_capacity(width * height);
        for row in first[1]..=last[1] {
            window.extend((first[0]..=last[0]).map(|column| value(column, row)));
        }
        let relative = |place: &[f64; 2]| {
            let steps =
                |axis: usize| ((place[axis] - first[axis] as f64) * PLACE_STEPS).round() as i32;
            [steps(0), steps(1)]
        };
        Some(Self {
            width,
            height,
            window,
            places: places.iter().map(relative).collect(),
        })
    }

    /// The heights that the window gives the nodes of the tile, 275².
    fn heights(&self) -> Vec<i32> {
        let blends: Vec<Blend> = (-BORDER..=CELLS + BORDER).map(Blend::at).collect();
        let mut heights = Vec::with_capacity(NODE_COUNT);
        let samples: Vec<f64> = self
            .window
            .iter()
            .map(|sample| f64::from(*sample))
            .collect();
        let knots: Vec<[f64; 2]> = self
            .places
            .iter()
            .map(|place| place.map(|steps| f64::from(steps) / PLACE_STEPS))
            .collect();
        let (last_column, last_row) = ((self.width - 1) as f64, (self.height - 1) as f64);
        let mut line = [[0.0; 2]; KNOTS];
        for across in &blends {
            for (k, knot) in line.iter_mut().enumerate() {
                *knot = across.of(std::array::from_fn(|n| {
                    knots[(across.first + n) * KNOTS + k]
                }));
            }
            for along in &blends {
                let [column, row] = along.of(std::array::from_fn(|n| line[along.first + n]));
                let (column, row) = (column.clamp(0.0, last_column), row.clamp(0.0, last_row));
                let (c, r) = (
                    (column as usize).min(self.width - 2),
                    (row as usize).min(self.height - 2),
                );
                let (s, t) = (column - c as f64, row - r as f64);
                let at = r * self.width + c;
                let [a, b] = [samples[at], samples[at + 1]];
                let [d, e] = [samples[at + self.width], samples[at + self.width + 1]];
                let near = a + (b - a) * s;
                let far = d + (e - d) * s;
                heights.push(nearest(near + (far - near) * t));
            }
        }
        heights
    }
}

/// The nearest integer of a number within ±2^31, halves to even. Adding 1.5·2^52 leaves the integer in the
/// low bits of the mantissa; processors without a rounding instruction do no better.
#[inline]
fn nearest(number: f64) -> i32 {
    (number + 6_755_399_441_055_744.0).to_bits() as u32 as i32
}

/// The lattice node of a knot.
fn knot(k: usize) -> i64 {
    let k = k as i64;
    let inner = CELLS / SPACING;
    if k < 3 {
        3 * k - BORDER
    } else if k <= 3 + inner {
        (k - 3) * SPACING
    } else {
        CELLS + 3 * (k - 3 - inner)
    }
}

/// Four knots in a row and their weights for one lattice node: the cubic through them (Lagrange).
struct Blend {
    first: usize,
    weights: [f64; 4],
}

impl Blend {
    fn at(node: i64) -> Self {
        let inner = CELLS / SPACING;
        let (first, t) = if node < 0 {
            (0, (node + BORDER) as f64 / 3.0)
        } else if node > CELLS {
            (3 + inner, (node - CELLS) as f64 / 3.0)
        } else {
            let start = (node / SPACING - 1).clamp(0, inner - 3);
            (3 + start, (node - start * SPACING) as f64 / SPACING as f64)
        };
        let weights = [
            (t - 1.0) * (t - 2.0) * (t - 3.0) / -6.0,
            t * (t - 2.0) * (t - 3.0) / 2.0,
            t * (t - 1.0) * (t - 3.0) / -2.0,
            t * (t - 1.0) * (t - 2.0) / 6.0,
        ];
        Self {
            first: first as usize,
            weights,
        }
    }

    #[inline]
    fn of(&self, knots: [[f64; 2]; 4]) -> [f64; 2] {
        let [a, b, c, d] = self.weights;
        let sum = |axis: usize| {
            a * knots[0][axis] + b * knots[1][axis] + (c * knots[2][axis] + d * knots[3][axis])
        };
        [sum(0), sum(1)]
    }
}

/// Packs heights as differences from what `origin` makes of them.
pub(super) fn pack(heights: &[i32], validity: &Validity, origin: &Origin) -> io::Result<Vec<u8>> {
    let differences: Vec<i32> = heights
        .iter()
        .zip(origin.heights())
        .map(|(height, due)| height.wrapping_sub(due))
        .collect();
    let columns = origin.places.iter().map(|place| place[0]);
    let rows = origin.places.iter().map(|place| place[1]);
    let places: Vec<i32> = columns.chain(rows).collect();
    let (base, step) = steps_of(&origin.window);
    let numbers: Vec<i32> = origin
        .window
        .iter()
        .map(|sample| ((i64::from(*sample) - i64::from(base)) / i64::from(step)) as u32 as i32)
        .collect();
    let net = heights::pack(&places, KNOTS, Prediction::Plane, &Validity::All)?;
    let window = heights::pack(&numbers, origin.width, Prediction::Plane, &Validity::All)?;
    let differences = heights::pack(&differences, STORED_NODES, Prediction::Zero, validity)?;
    let mut bytes = Vec::with_capacity(HEAD_BYTES + net.len() + window.len() + differences.len());
    bytes.extend_from_slice(&(origin.width as u16).to_le_bytes());
    bytes.extend_from_slice(&(origin.height as u16).to_le_bytes());
    bytes.extend_from_slice(&base.to_le_bytes());
    bytes.extend_from_slice(&step.to_le_bytes());
    bytes.extend_from_slice(&(net.len() as u32).to_le_bytes());
    bytes.extend_from_slice(&(window.len() as u32).to_le_bytes());
    for part in [net, window, differences] {
        bytes.extend_from_slice(&part);
    }
    Ok(bytes)
}

/// The smallest sample, and the greatest step that leads from it to all others.
fn steps_of(window: &[i32]) -> (i32, u32) {
    let base = window.iter().copied().min().unwrap_or(0);
    let mut step = 0_u32;
    for sample in window {
        let mut rest = sample.wrapping_sub(base) as u32;
        if step != 0 && rest.is_multiple_of(step) {
            continue;
        }
        while rest != 0 {
            (step, rest) = (rest, step % rest);
        }
    }
    (base, step.max(1))
}

/// The heights of a tile; 0 at invalid nodes.
pub(super) fn unpack(bytes: &[u8], validity: &Validity) -> Result<Vec<i32>, CodecError> {
    let wrong = || CodecError::Length {
        part: "resampled heights",
    };
    let (head, body) = bytes.split_first_chunk::<HEAD_BYTES>().ok_or_else(wrong)?;
    let [
        w0,
        w1,
        h0,
        h1,
        base @ ..,
        _,
        _,
        _,
        _,
        _,
        _,
        _,
        _,
        _,
        _,
        _,
        _,
    ] = *head;
    let (width, height) = (
        u16::from_le_bytes([w0, w1]).into(),
        u16::from_le_bytes([h0, h1]).into(),
    );
    let sides: [usize; 2] = [width, height];
    if sides.iter().any(|side| !(2..=LONGEST_SIDE).contains(side))
        || width * height > LARGEST_WINDOW
    {
        return Err(CodecError::Range {
            part: "window of the source",
        });
    }
    let base = i32::from_le_bytes(base);
    let lengths = super::numbers_of(&head[8..], u32::from_le_bytes);
    let [step, net_bytes, window_bytes] = lengths[..] else {
        return Err(wrong());
    };
    let (net, rest) = body
        .split_at_checked(net_bytes as usize)
        .ok_or_else(wrong)?;
    let (window, differences) = rest
        .split_at_checked(window_bytes as usize)
        .ok_or_else(wrong)?;
    let all = &Validity::All;
    let places = heights::unpack(net, KNOTS, 2 * KNOTS * KNOTS, Prediction::Plane, all)?;
    let (columns, rows) = places.split_at(KNOTS * KNOTS);
    let mut window = heights::unpack(window, width, width * height, Prediction::Plane, all)?;
    for sample in &mut window {
        *sample = base.wrapping_add((*sample as u32).wrapping_mul(step) as i32);
    }
    let places = columns
        .iter()
        .zip(rows)
        .map(|(column, row)| [*column, *row])
        .collect();
    let origin = Origin {
        width,
        height,
        window,
        places,
    };
    let mut heights = heights::unpack(
        differences,
        STORED_NODES,
        NODE_COUNT,
        Prediction::Zero,
        validity,
    )?;
    for (height, due) in heights.iter_mut().zip(origin.heights()) {
        *height = height.wrapping_add(due);
    }
    clear_invalid(&mut heights, 1, validity);
    Ok(heights)
}
