//! The nodes of one tile while it is being made, and the arithmetic of their samples.
//! In: samples by node. Out: a tile. All averages are exact in integers with halves rounded up, and do not depend on
//! the order of their terms, so that every tile that shares a node computes the same bits.

use std::sync::LazyLock;

use geodesy::{BORDER, CELLS, STORED_NODES, Tile};
use tiles::{EncodeError, Kind, NODE_COUNT, Samples, TileData, Validity};

/// A number type that tiles may have.
pub(crate) trait Sample: Copy + Default + PartialEq + Send + Sync + 'static {
    /// The nearest sample to a number, clamped to the type's range.
    fn nearest(number: f64) -> Self;
    /// The mean of 3×3 samples, row by row, with the weights 1 2 1, 2 4 2, 1 2 1: what [`Sample::mean`] makes of them.
    fn smooth(samples: [Self; 9], colour: bool) -> Self {
        let mut terms = [(0, Self::default()); 9];
        for ((term, weight), value) in terms
            .iter_mut()
            .zip([1, 2, 1, 2, 4, 2, 1, 2, 1])
            .zip(samples)
        {
            *term = (weight, value);
        }
        Self::mean(&mut terms, colour)
    }
    /// Σ weight·value / Σ weight; `weights` are small. Bytes of colour in linear light; wider samples count the light
    /// already, as a sensor does.
    fn mean(terms: &mut [(i64, Self)], colour: bool) -> Self;
    /// (Σ weight·value) / 2^shift, the weights adding up to 2^shift ≤ 2^44.
    fn blend(terms: &mut [(i64, Self)], shift: u32) -> Self;
    /// As the samples of a tile.
    fn wrapped(values: Vec<Self>) -> Samples;
    /// The samples of a tile of this type.
    fn of(samples: &Samples) -> Option<&[Self]>;
}

fn integer_mean<T: Copy + Into<i64>>(terms: &[(i64, T)]) -> i64 {
    let (mut sum, mut weights) = (0, 0);
    for (weight, value) in terms {
        sum += weight * (*value).into();
        weights += weight;
    }
    (2 * sum + weights).div_euclid((2 * weights).max(1))
}

fn integer_blend<T: Copy + Into<i64>>(terms: &[(i64, T)], shift: u32) -> i64 {
    let sum: i128 = terms
        .iter()
        .map(|(weight, value)| i128::from(*weight) * i128::from((*value).into()))
        .sum();
    ((2 * sum + (1 << shift)) >> (shift + 1)) as i64
}

/// (Σ weight·value) / 16 with halves rounded up, the weights 1 2 1, 2 4 2, 1 2 1.
#[inline]
fn sixteenth([a, b, c, d, e, f, g, h, i]: [i64; 9]) -> i64 {
    (a + c + g + i + 2 * (b + d + f + h) + 4 * e + 8) >> 4
}

impl Sample for i32 {
    fn nearest(number: f64) -> Self {
        // Adding 1.5·2^52 leaves the nearest integer, halves to even, in the low bits of the mantissa, on
        // processors without a rounding instruction too.
        let limited = number.clamp(f64::from(Self::MIN), f64::from(Self::MAX));
        (limited + 6_755_399_441_055_744.0).to_bits() as u32 as Self
    }
    fn smooth(samples: [Self; 9], _colour: bool) -> Self {
        sixteenth(samples.map(i64::from)) as Self
    }
    fn mean(terms: &mut [(i64, Self)], _colour: bool) -> Self {
        integer_mean(terms) as Self
    }
    fn blend(terms: &mut [(i64, Self)], shift: u32) -> Self {
        integer_blend(terms, shift) as Self
    }
    fn wrapped(values: Vec<Self>) -> Samples {
        Samples::I32(values)
    }
    fn of(samples: &Samples) -> Option<&[Self]> {
        if let Samples::I32(values) = samples {
            Some(values)
        } else {
            None
        }
    }
}

impl Sample for u16 {
    fn nearest(number: f64) -> Self {
        (number + 0.5) as Self
    }
    fn smooth(samples: [Self; 9], _colour: bool) -> Self {
        sixteenth(samples.map(i64::from)) as Self
    }
    fn mean(terms: &mut [(i64, Self)], _colour: bool) -> Self {
        integer_mean(terms) as Self
    }
    fn blend(terms: &mut [(i64, Self)], shift: u32) -> Self {
        integer_blend(terms, shift) as Self
    }
    fn wrapped(values: Vec<Self>) -> Samples {
        Samples::U16(values)
    }
    fn of(samples: &Samples) -> Option<&[Self]> {
        if let Samples::U16(values) = samples {
            Some(values)
        } else {
            None
        }
    }
}

impl Sample for u8 {
    fn nearest(number: f64) -> Self {
        (number + 0.5) as Self
    }
    fn smooth(samples: [Self; 9], colour: bool) -> Self {
        if !colour {
            return sixteenth(samples.map(i64::from)) as Self;
        }
        let light = &*LIGHT;
        let linear = samples.map(|value| i64::from(light.of_byte[usize::from(value)]));
        light.byte_of(sixteenth(linear) as u16)
    }
    fn mean(terms: &mut [(i64, Self)], colour: bool) -> Self {
        if !colour {
            return integer_mean(terms) as Self;
        }
        let light = &*LIGHT;
        let linear = |value: Self| i64::from(light.of_byte[usize::from(value)]);
        let in_light: Vec<(i64, i64)> = terms
            .iter()
            .map(|(weight, value)| (*weight, linear(*value)))
            .collect();
        let mean = integer_mean(&in_light);
        light.byte_of(mean as u16)
    }
    fn blend(terms: &mut [(i64, Self)], shift: u32) -> Self {
        integer_blend(terms, shift) as Self
    }
    fn wrapped(values: Vec<Self>) -> Samples {
        Samples::U8(values)
    }
    fn of(samples: &Samples) -> Option<&[Self]> {
        if let Samples::U8(values) = samples {
            Some(values)
        } else {
            None
        }
    }
}

impl Sample for f32 {
    fn nearest(number: f64) -> Self {
        number as Self
    }
    fn mean(terms: &mut [(i64, Self)], _colour: bool) -> Self {
        // Another face lists the terms in another order: sorting makes the rounding the same.
        terms.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let (mut sum, mut weights) = (0.0, 0.0);
        for (weight, value) in terms {
            sum += *weight as f64 * f64::from(*value);
            weights += *weight as f64;
        }
        (sum / f64::max(weights, 1.0)) as Self
    }
    fn blend(terms: &mut [(i64, Self)], _shift: u32) -> Self {
        Self::mean(terms, false)
    }
    fn wrapped(values: Vec<Self>) -> Samples {
        Samples::F32(values)
    }
    fn of(samples: &Samples) -> Option<&[Self]> {
        if let Samples::F32(values) = samples {
            Some(values)
        } else {
            None
        }
    }
}

/// sRGB bytes (IEC 61966-2-1) to linear light in 1/65535, and back by thresholds.
struct Light {
    of_byte: [u16; 256],
    /// For each upper 12 bits of light, the byte at its start.
    start: Vec<u8>,
}

static LIGHT: LazyLock<Light> = LazyLock::new(|| {
    let of_byte: [u16; 256] = std::array::from_fn(|byte| {
        let v = byte as f64 / 255.0;
        let linear = if v <= 0.040_45 {
            v / 12.92
        } else {
            ((v + 0.055) / 1.055).powf(2.4)
        };
        (linear * 65_535.0).round() as u16
    });
    let mut light = Light {
        of_byte,
        start: Vec::new(),
    };
    light.start = (0..4096_u32)
        .map(|slot| {
            let value = (slot << 4) as u16;
            light
                .of_byte
                .partition_point(|entry| *entry <= value)
                .saturating_sub(1) as u8
        })
        .collect();
    light
});

impl Light {
    /// The byte whose light is nearest; the darker of two equally near.
    fn byte_of(&self, value: u16) -> u8 {
        let mut byte = self
            .start
            .get(usize::from(value >> 4))
            .copied()
            .unwrap_or(0);
        while byte < 255 {
            let (low, high) = (
                self.of_byte[usize::from(byte)],
                self.of_byte[usize::from(byte) + 1],
            );
            // Nearer to the upper neighbour: 2·value > low + high.
            if 2 * u32::from(value) <= u32::from(low) + u32::from(high) {
                break;
            }
            byte += 1;
        }
        byte
    }
}

/// Samples and validity of the 275² nodes of a tile.
pub(crate) struct Nodes<T> {
    pub(crate) channels: usize,
    pub(crate) values: Vec<T>,
    pub(crate) valid: Vec<bool>,
}

impl<T: Sample> Nodes<T> {
    pub(crate) fn empty(channels: usize) -> Self {
        Self {
            channels,
            values: vec![T::default(); NODE_COUNT * channels],
            valid: vec![false; NODE_COUNT],
        }
    }

    /// The nodes of a finished tile; `None` where it is of another type.
    pub(crate) fn of_tile(data: &TileData) -> Option<Self> {
        let values = T::of(&data.samples)?.to_vec();
        let valid = match &data.validity {
            Validity::All => vec![true; NODE_COUNT],
            validity => (0..NODE_COUNT)
                .map(|node| validity.is_valid(node))
                .collect(),
        };
        Some(Self {
            channels: usize::from(data.channels),
            values,
            valid,
        })
    }

    /// Sets node (i, j), both −9…265.
    pub(crate) fn set(&mut self, i: i64, j: i64, value: &[T]) {
        let node = TileData::index(i, j);
        let start = node * self.channels;
        if let (Some(target), Some(valid)) = (
            self.values.get_mut(start..start + self.channels),
            self.valid.get_mut(node),
        ) {
            target.copy_from_slice(value);
            *valid = true;
        }
    }

    /// Whether any node 0…256 both ways holds data.
    pub(crate) fn any_core(&self) -> bool {
        let (border, side) = (BORDER as usize, CELLS as usize + 1);
        self.valid
            .chunks_exact(STORED_NODES)
            .skip(border)
            .take(side)
            .any(|row| row.iter().skip(border).take(side).any(|valid| *valid))
    }

    /// Whether every node holds data.
    pub(crate) fn is_full(&self) -> bool {
        self.valid.iter().all(|valid| *valid)
    }

    /// The finished tile.
    pub(crate) fn into_tile(self, tile: Tile, kind: Kind) -> Result<TileData, EncodeError> {
        let valid = self.valid;
        let validity = if valid.iter().all(|v| *v) {
            Validity::All
        } else {
            Validity::from_nodes(|node| valid.get(node).copied().unwrap_or(false))
        };
        TileData::new(
            tile,
            kind,
            self.channels as u8,
            T::wrapped(self.values),
            validity,
        )
    }
}

/// The sample and validity arrays of a finished tile, for reading.
pub(crate) struct View<'tile, T> {
    pub(crate) tile: Tile,
    pub(crate) channels: usize,
    pub(crate) values: &'tile [T],
    validity: &'tile Validity,
    pub(crate) full: bool,
}

impl<'tile, T: Sample> View<'tile, T> {
    pub(crate) fn of(data: &'tile TileData) -> Option<Self> {
        Some(Self {
            tile: data.tile,
            channels: usize::from(data.channels),
            values: T::of(&data.samples)?,
            validity: &data.validity,
            full: data.validity == Validity::All,
        })
    }

    /// The samples of a node by its place in the array; `None` where it holds no data.
    pub(crate) fn get(&self, node: usize) -> Option<&'tile [T]> {
        if !self.full && !self.validity.is_valid(node) {
            return None;
        }
        self.values
            .get(node * self.channels..(node + 1) * self.channels)
    }

    /// The samples of node (i, j), both −9…265.
    pub(crate) fn at(&self, i: i64, j: i64) -> Option<&'tile [T]> {
        self.get(TileData::index(i, j))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_round_halves_up_and_ignore_order() {
        assert_eq!(i32::mean(&mut [(1, 0), (1, 1)], false), 1);
        assert_eq!(i32::mean(&mut [(1, 0), (1, -1)], false), 0);
        assert_eq!(i32::mean(&mut [(4, -7), (2, -7), (1, -7)], false), -7);
        assert_eq!(
            i32::blend(&mut [(3, i32::MAX), (1, i32::MIN)], 2),
            1_073_741_823
        );
        let mut terms = [(1, 1.0e30_f32), (1, 1.0), (1, -1.0e30)];
        let forward = f32::mean(&mut terms, false);
        terms.reverse();
        assert_eq!(f32::mean(&mut terms, false), forward);
    }

    #[test]
    fn the_whole_kernel_is_the_mean_of_its_terms() {
        let weights = [1, 2, 1, 2, 4, 2, 1, 2, 1];
        for start in -40..40_i32 {
            let heights: [i32; 9] = std::array::from_fn(|k| start * 7919 % 1000 - 31 * k as i32);
            let mut terms: [(i64, i32); 9] = std::array::from_fn(|k| (weights[k], heights[k]));
            assert_eq!(i32::smooth(heights, false), i32::mean(&mut terms, false));
            let bytes = heights.map(|height| height as u8);
            let mut terms: [(i64, u8); 9] = std::array::from_fn(|k| (weights[k], bytes[k]));
            assert_eq!(u8::smooth(bytes, true), u8::mean(&mut terms, true));
            assert_eq!(u8::smooth(bytes, false), u8::mean(&mut terms, false));
            let words = heights.map(|height| (height * 131) as u16);
            let mut terms: [(i64, u16); 9] = std::array::from_fn(|k| (weights[k], words[k]));
            assert_eq!(u16::smooth(words, true), u16::mean(&mut terms, true));
        }
        for (number, due) in [
            (0.5, 0),
            (1.5, 2),
            (-0.5, 0),
            (-1.6, -2),
            (1e300, i32::MAX),
            (f64::NEG_INFINITY, i32::MIN),
        ] {
            assert_eq!(i32::nearest(number), due);
        }
    }

    #[test]
    fn light_comes_back_and_averages_brighter_than_bytes() {
        for byte in 0..=255_u8 {
            assert_eq!(u8::mean(&mut [(3, byte)], true), byte);
        }
        // Half black, half white is sRGB 188.
        assert_eq!(u8::mean(&mut [(1, 0), (1, 255)], true), 188);
        assert_eq!(u8::mean(&mut [(1, 0), (1, 255)], false), 128);
    }
}
