//! Pictures: bytes, 16-bit and floating-point samples, channel by channel.
//!
//! In: interleaved samples. Out: bytes, and the same samples. Of three channels or more, the first and third
//! become differences from the second. Integers are predicted by the median of the left neighbour, the lower
//! neighbour and the plane through both (Martucci 1990, as in JPEG-LS) and the differences stored in byte
//! planes; floats become integers in the same order, less their left neighbour. zstd packs the planes. All
//! differences are modulo the sample's range, so nothing is lost. Invalid nodes repeat their neighbour.

use std::io;

use geodesy::STORED_NODES;

use super::{CodecError, clear_invalid, compress, expand};
use crate::format::{NODE_COUNT, Validity};

const LEVEL: i32 = 1;

pub(super) fn pack_u8(values: &[u8], channels: u8, validity: &Validity) -> io::Result<Vec<u8>> {
    let mut residuals = Vec::with_capacity(values.len());
    for plane in planes(values, channels, validity, u8::wrapping_sub) {
        median_differences(&plane, |value, due| {
            residuals.push(value.wrapping_sub(due as u8));
        });
    }
    compress(&residuals, LEVEL)
}

pub(super) fn unpack_u8(
    bytes: &[u8],
    channels: u8,
    validity: &Validity,
) -> Result<Vec<u8>, CodecError> {
    let residuals = expand(bytes, NODE_COUNT * usize::from(channels), "samples")?;
    let planes = residuals
        .chunks_exact(NODE_COUNT)
        .map(|plane| {
            median_sums(plane.iter().copied(), |due, residual| {
                residual.wrapping_add(due as u8)
            })
        })
        .collect();
    Ok(interleave(planes, validity, u8::wrapping_add))
}

pub(super) fn pack_u16(values: &[u16], channels: u8, validity: &Validity) -> io::Result<Vec<u8>> {
    let count = values.len();
    // All low bytes, then all high bytes.
    let mut residuals = vec![0; count * 2];
    let (low, high) = residuals.split_at_mut(count);
    let mut places = low.iter_mut().zip(high);
    for plane in planes(values, channels, validity, u16::wrapping_sub) {
        median_differences(&plane, |value, due| {
            if let Some((low, high)) = places.next() {
                [*low, *high] = fold(value.wrapping_sub(due as u16)).to_le_bytes();
            }
        });
    }
    compress(&residuals, LEVEL)
}

pub(super) fn unpack_u16(
    bytes: &[u8],
    channels: u8,
    validity: &Validity,
) -> Result<Vec<u16>, CodecError> {
    let count = NODE_COUNT * usize::from(channels);
    let residuals = expand(bytes, count * 2, "samples")?;
    let (low, high) = residuals.split_at(count);
    let planes = low
        .chunks_exact(NODE_COUNT)
        .zip(high.chunks_exact(NODE_COUNT))
        .map(|(low, high)| {
            let pairs = low
                .iter()
                .zip(high)
                .map(|(low, high)| u16::from_le_bytes([*low, *high]));
            median_sums(pairs, |due, residual| {
                unfold(residual).wrapping_add(due as u16)
            })
        })
        .collect();
    Ok(interleave(planes, validity, u16::wrapping_add))
}

pub(super) fn pack_f32(values: &[f32], channels: u8, validity: &Validity) -> io::Result<Vec<u8>> {
    let count = values.len();
    let mut residuals = vec![0; count * 4];
    let mut at = 0;
    for plane in planes(values, channels, validity, |value, _| value) {
        let mut left = 0;
        for value in plane {
            let number = ordered(value);
            for (byte, part) in number
                .wrapping_sub(left)
                .to_le_bytes()
                .into_iter()
                .enumerate()
            {
                residuals[byte * count + at] = part;
            }
            left = number;
            at += 1;
        }
    }
    compress(&residuals, LEVEL)
}

pub(super) fn unpack_f32(
    bytes: &[u8],
    channels: u8,
    validity: &Validity,
) -> Result<Vec<f32>, CodecError> {
    let count = NODE_COUNT * usize::from(channels);
    let residuals = expand(bytes, count * 4, "samples")?;
    let planes: Vec<Vec<f32>> = (0..usize::from(channels))
        .map(|channel| {
            let mut left = 0_u32;
            let nodes = channel * NODE_COUNT..(channel + 1) * NODE_COUNT;
            let sum = |at: usize| {
                let parts = std::array::from_fn(|byte| residuals[byte * count + at]);
                left = left.wrapping_add(u32::from_le_bytes(parts));
                unordered(left)
            };
            nodes.map(sum).collect()
        })
        .collect();
    let values = interleave(planes, validity, |value, _| value);
    if values.iter().all(|value| value.is_finite()) {
        Ok(values)
    } else {
        Err(CodecError::Range { part: "samples" })
    }
}

/// The bits of a float as an integer in the order of the floats.
fn ordered(value: f32) -> u32 {
    let bits = value.to_bits();
    if bits >> 31 == 1 {
        !bits
    } else {
        bits | 1 << 31
    }
}

fn unordered(number: u32) -> f32 {
    f32::from_bits(if number >> 31 == 1 {
        number & !(1 << 31)
    } else {
        !number
    })
}

/// Small differences of either sign to small numbers.
fn fold(difference: u16) -> u16 {
    difference << 1 ^ ((difference as i16) >> 15) as u16
}

fn unfold(number: u16) -> u16 {
    number >> 1 ^ (number & 1).wrapping_neg()
}

/// One array for each channel, decorrelated, invalid nodes filled with their left neighbour.
fn planes<T: Copy + Default>(
    values: &[T],
    channels: u8,
    validity: &Validity,
    subtract: impl Fn(T, T) -> T,
) -> Vec<Vec<T>> {
    let channels = usize::from(channels);
    let masked = matches!(validity, Validity::Mask(_));
    let plane = |channel: usize| {
        let reference = (channels >= 3 && (channel == 0 || channel == 2)).then_some(1);
        let mut last = T::default();
        let mut plane = Vec::with_capacity(NODE_COUNT);
        for (index, node) in values.chunks_exact(channels).enumerate() {
            if !masked || validity.is_valid(index) {
                last =
                    reference.map_or(node[channel], |other| subtract(node[channel], node[other]));
            }
            plane.push(last);
        }
        plane
    };
    (0..channels).map(plane).collect()
}

/// Undoes [`planes`].
fn interleave<T: Copy + Default>(
    planes: Vec<Vec<T>>,
    validity: &Validity,
    add: impl Fn(T, T) -> T,
) -> Vec<T> {
    let channels = planes.len();
    let mut values = vec![T::default(); NODE_COUNT * channels];
    for (channel, plane) in planes.iter().enumerate() {
        let places = values.iter_mut().skip(channel).step_by(channels);
        match planes.get(1) {
            Some(reference) if channels >= 3 && (channel == 0 || channel == 2) => {
                for ((place, value), other) in places.zip(plane).zip(reference) {
                    *place = add(*value, *other);
                }
            }
            _ => {
                for (place, value) in places.zip(plane) {
                    *place = *value;
                }
            }
        }
    }
    clear_invalid(&mut values, channels as u8, validity);
    values
}

/// Hands out each value with its prediction.
fn median_differences<T: Copy + Into<i32> + Default>(plane: &[T], mut each: impl FnMut(T, i32)) {
    let zeros = [T::default(); STORED_NODES];
    let mut below = &zeros[..];
    for line in plane.chunks_exact(STORED_NODES) {
        let (mut left, mut below_left) = (T::default().into(), T::default().into());
        for (value, under) in line.iter().zip(below) {
            let under: i32 = (*under).into();
            each(*value, median(left, under, below_left));
            (left, below_left) = ((*value).into(), under);
        }
        below = line;
    }
}

/// Rebuilds a plane from residuals and `value(prediction, residual)`.
fn median_sums<T: Copy + Into<i32> + Default>(
    residuals: impl Iterator<Item = T>,
    value: impl Fn(i32, T) -> T,
) -> Vec<T> {
    let mut plane = vec![T::default(); NODE_COUNT];
    let mut below = [0_i32; STORED_NODES];
    let mut residuals = residuals;
    for line in plane.chunks_exact_mut(STORED_NODES) {
        let (mut left, mut below_left) = (0, 0);
        for ((place, under), residual) in line.iter_mut().zip(&mut below).zip(&mut residuals) {
            *place = value(median(left, *under, below_left), residual);
            left = (*place).into();
            below_left = std::mem::replace(under, left);
        }
    }
    plane
}

/// The median of `left`, `below` and `left + below − below_left`.
#[inline]
fn median(left: i32, below: i32, below_left: i32) -> i32 {
    let (low, high) = (left.min(below), left.max(below));
    (left + below - below_left).clamp(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_keep_their_order_and_bits() {
        let rising = [
            f32::MIN,
            -1.5,
            -f32::MIN_POSITIVE,
            -0.0,
            0.0,
            1e-40,
            1.0,
            1.5,
            f32::MAX,
        ];
        for pair in rising.windows(2) {
            assert!(ordered(pair[0]) < ordered(pair[1]));
        }
        for value in rising {
            assert_eq!(unordered(ordered(value)).to_bits(), value.to_bits());
        }
    }

    #[test]
    fn folding_is_its_own_inverse() {
        for difference in 0..=u16::MAX {
            assert_eq!(unfold(fold(difference)), difference);
        }
        assert_eq!([fold(0), fold(u16::MAX), fold(1)], [0, 1, 2]);
    }

    #[test]
    fn the_median_of_three() {
        for (left, below, corner) in [(3, 9, 5), (9, 3, 1), (200, 255, 0), (0, 0, 255), (7, 7, 7)] {
            let mut three = [left, below, left + below - corner];
            three.sort_unstable();
            assert_eq!(median(left, below, corner), three[1]);
        }
    }
}
