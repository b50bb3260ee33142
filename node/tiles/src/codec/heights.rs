//! Heights: predicted from their neighbours, the differences sorted by how rough the ground is around them.
//!
//! In: an array of i32. Out: bytes, and the same array. The prediction is the plane through the left, lower
//! and left lower neighbours. A difference becomes a token (its magnitude up to 15, beyond that its
//! logarithm in quarter octaves) and plain bits (sign and the rest). Tokens go to one of eight streams, chosen
//! by the differences already coded around the node, because each roughness has its own distribution; zstd's
//! entropy stage packs each stream. (The idea of sorting residuals by local activity is that of
//! Weinberger, Seroussi and Sapiro, "The LOCO-I lossless image compression algorithm", 2000, §III.)
//! Invalid nodes cost nothing: both sides skip them.
//!
//! | bytes | content |
//! |---|---|
//! | 0 | roughness of the first stream |
//! | 1–64 | eight times: tokens in the stream (u32), bytes of the stream (u32); equal: stored plain |
//! | 65–68 | bytes of the plain bits (u32) |
//! | 69– | the streams, then the plain bits |

use std::io;

use geodesy::STORED_NODES;

use super::bits::{BitReader, BitWriter};
use super::{CodecError, clear_invalid, compress, expand};
use crate::format::{NODE_COUNT, Validity};

const STREAMS: usize = 8;
const HEAD_BYTES: usize = 1 + STREAMS * 8 + 4;
const LEVEL: i32 = 1;
/// Magnitudes count no more than this towards roughness, so that sums stay within 32 bits.
const LOUDEST: u32 = 1 << 24;

/// What a value is expected to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Prediction {
    /// The plane through three neighbours.
    Plane,
    /// Zero: the values are differences already.
    Zero,
}

/// A tile's heights.
pub(super) fn pack_tile(values: &[i32], validity: &Validity) -> io::Result<Vec<u8>> {
    pack(values, STORED_NODES, Prediction::Plane, validity)
}

/// A tile's heights back; 0 at invalid nodes.
pub(super) fn unpack_tile(bytes: &[u8], validity: &Validity) -> Result<Vec<i32>, CodecError> {
    let mut values = unpack(bytes, STORED_NODES, NODE_COUNT, Prediction::Plane, validity)?;
    clear_invalid(&mut values, 1, validity);
    Ok(values)
}

/// Packs an array of rows of `width` values. Values that `validity` denies are left out; arrays that are
/// no tile are [`Validity::All`].
pub(super) fn pack(
    values: &[i32],
    width: usize,
    prediction: Prediction,
    validity: &Validity,
) -> io::Result<Vec<u8>> {
    let differences = differences(values, width, prediction, validity);
    let first_roughness = first_roughness(&differences);
    let mut streams: [Vec<u8>; STREAMS] = Default::default();
    for stream in &mut streams {
        stream.reserve(differences.len() / 4);
    }
    let mut bits = BitWriter::default();
    let mut around = Around::new(width);
    let masked = matches!(validity, Validity::Mask(_));
    for (row, line) in differences.chunks_exact(width).enumerate() {
        around.start_row();
        for (column, difference) in line.iter().enumerate() {
            if masked && !validity.is_valid(row * width + column) {
                around.put(column, 0);
                continue;
            }
            let magnitude = difference.unsigned_abs();
            let stream = stream_of(around.roughness(column), first_roughness);
            let (token, rest) = token_of(magnitude);
            streams[stream].push(token);
            // Sign lowest, then the bits below the token's; 30 of them at most.
            let sign = u32::from(*difference < 0);
            bits.push(
                (magnitude & ((1 << rest) - 1)) << 1 | sign,
                if token == 0 { 0 } else { rest + 1 },
            );
            around.put(column, magnitude);
        }
    }
    assemble(first_roughness, &streams, &bits.finish())
}

fn assemble(first_roughness: u8, streams: &[Vec<u8>; STREAMS], bits: &[u8]) -> io::Result<Vec<u8>> {
    let mut head = Vec::with_capacity(HEAD_BYTES);
    let mut body = Vec::with_capacity(bits.len() * 3);
    head.push(first_roughness);
    for stream in streams {
        let packed = if stream.is_empty() {
            Vec::new()
        } else {
            compress(stream, LEVEL)?
        };
        let stored = if packed.len() < stream.len() {
            &packed
        } else {
            stream
        };
        head.extend_from_slice(&(stream.len() as u32).to_le_bytes());
        head.extend_from_slice(&(stored.len() as u32).to_le_bytes());
        body.extend_from_slice(stored);
    }
    head.extend_from_slice(&(bits.len() as u32).to_le_bytes());
    head.extend_from_slice(&body);
    head.extend_from_slice(bits);
    Ok(head)
}

/// Unpacks `count` values in rows of `width`. Skipped values hold what their prediction left there.
pub(super) fn unpack(
    bytes: &[u8],
    width: usize,
    count: usize,
    prediction: Prediction,
    validity: &Validity,
) -> Result<Vec<i32>, CodecError> {
    let masked = matches!(validity, Validity::Mask(_));
    let due = if masked { validity.count() } else { count };
    let (first_roughness, streams, bits) = take_apart(bytes, due)?;
    let mut tokens = streams.each_ref().map(|stream| stream.iter());
    let mut bits = BitReader::new(bits);
    let mut values = vec![0_i32; count];
    let zeros = vec![0_i32; width];
    let mut around = Around::new(width);
    let mut short = false;
    for row in 0..count / width {
        around.start_row();
        let (done, open) = values.split_at_mut(row * width);
        let below = if row == 0 {
            &zeros[..]
        } else {
            &done[(row - 1) * width..]
        };
        let line = &mut open[..width];
        // `left` and `below_left` start as 0 and the value below, so that the plane is what lies below.
        let (mut left, mut below_left) = (0_i32, 0_i32);
        for (column, (place, below)) in line.iter_mut().zip(below).enumerate() {
            let difference = if masked && !validity.is_valid(row * width + column) {
                around.put(column, 0);
                None
            } else {
                let stream = stream_of(around.roughness(column), first_roughness);
                let token = tokens[stream].next().copied().unwrap_or_else(|| {
                    short = true;
                    0
                });
                let (magnitude, sign) = untoken(token, &mut bits);
                around.put(column, magnitude);
                Some(if sign {
                    (magnitude as i32).wrapping_neg()
                } else {
                    magnitude as i32
                })
            };
            *place = match (prediction, difference) {
                (Prediction::Zero, difference) => difference.unwrap_or(0),
                (Prediction::Plane, Some(difference)) => left
                    .wrapping_add(*below)
                    .wrapping_sub(below_left)
                    .wrapping_add(difference),
                (Prediction::Plane, None) if column == 0 => *below,
                (Prediction::Plane, None) => left,
            };
            (left, below_left) = (*place, *below);
        }
    }
    if short || tokens.iter().any(|stream| stream.len() > 0) || !bits.is_exhausted() {
        return Err(CodecError::Length {
            part: "height streams",
        });
    }
    Ok(values)
}

type Parts<'a> = (u8, [Vec<u8>; STREAMS], &'a [u8]);

fn take_apart(bytes: &[u8], due: usize) -> Result<Parts<'_>, CodecError> {
    let wrong = || CodecError::Length {
        part: "height streams",
    };
    let (head, mut body) = bytes.split_first_chunk::<HEAD_BYTES>().ok_or_else(wrong)?;
    let [first_roughness, lengths @ ..] = head;
    let lengths = super::numbers_of(lengths, u32::from_le_bytes);
    let mut streams: [Vec<u8>; STREAMS] = Default::default();
    let mut total = 0_usize;
    for (stream, pair) in streams.iter_mut().zip(lengths.chunks_exact(2)) {
        let [tokens, stored] = [pair[0] as usize, pair[1] as usize];
        total = total.saturating_add(tokens);
        if total > due {
            return Err(wrong());
        }
        let (packed, rest) = body.split_at_checked(stored).ok_or_else(wrong)?;
        *stream = if stored == tokens {
            packed.to_vec()
        } else {
            expand(packed, tokens, "height stream")?
        };
        body = rest;
    }
    let bits = lengths.last().map_or(0, |length| *length as usize);
    if total != due || body.len() != bits {
        return Err(wrong());
    }
    Ok((*first_roughness, streams, body))
}

/// Every value less its prediction, modulo 2^32. At skipped nodes the value carried on for later
/// predictions is the one to the left (in the first column, below), as the reader has it.
fn differences(
    values: &[i32],
    width: usize,
    prediction: Prediction,
    validity: &Validity,
) -> Vec<i32> {
    if prediction == Prediction::Zero {
        return values.to_vec();
    }
    let filled;
    let values = if matches!(validity, Validity::Mask(_)) {
        filled = fill(values, width, validity);
        &filled[..]
    } else {
        values
    };
    let mut differences = vec![0; values.len()];
    let zeros = vec![0; width];
    let mut below = &zeros[..];
    for (line, out) in values
        .chunks_exact(width)
        .zip(differences.chunks_exact_mut(width))
    {
        if let (Some(place), Some(value), Some(under)) =
            (out.first_mut(), line.first(), below.first())
        {
            *place = value.wrapping_sub(*under);
        }
        for ((place, pair), under) in out
            .iter_mut()
            .skip(1)
            .zip(line.windows(2))
            .zip(below.windows(2))
        {
            *place = pair[1]
                .wrapping_sub(pair[0])
                .wrapping_sub(under[1].wrapping_sub(under[0]));
        }
        below = line;
    }
    differences
}

fn fill(values: &[i32], width: usize, validity: &Validity) -> Vec<i32> {
    let mut filled = values.to_vec();
    for node in 0..filled.len() {
        if !validity.is_valid(node) {
            let from = if node % width > 0 {
                node.checked_sub(1)
            } else {
                node.checked_sub(width)
            };
            filled[node] = from.map_or(0, |from| filled[from]);
        }
    }
    filled
}

/// The magnitudes around the node being coded: of the row below, and of the two nodes to the left.
struct Around {
    // One cell of padding on the left, one on the right.
    below: Vec<u32>,
    here: Vec<u32>,
}

impl Around {
    fn new(width: usize) -> Self {
        Self {
            below: vec![0; width + 3],
            here: vec![0; width + 3],
        }
    }

    fn start_row(&mut self) {
        std::mem::swap(&mut self.below, &mut self.here);
    }

    #[inline]
    fn roughness(&self, column: usize) -> u32 {
        // Padding: index 0 and 1 lie left of column 0, the last one right of the last column.
        let (Some([_, below_left, below, below_right]), Some([second, left])) = (
            self.below
                .get(column..column + 4)
                .and_then(|cells| cells.first_chunk::<4>()),
            self.here
                .get(column..column + 2)
                .and_then(|cells| cells.first_chunk::<2>()),
        ) else {
            return 0;
        };
        2 * (left + below) + second + below_left + below_right
    }

    #[inline]
    fn put(&mut self, column: usize, magnitude: u32) {
        if let Some(cell) = self.here.get_mut(column + 2) {
            *cell = magnitude.min(LOUDEST);
        }
    }
}

/// Streams are octaves of roughness, the first and last open-ended.
#[inline]
fn stream_of(roughness: u32, first_roughness: u8) -> usize {
    let octave = 32 - roughness.leading_zeros();
    (octave.saturating_sub(u32::from(first_roughness)) as usize).min(STREAMS - 1)
}

/// Puts the typical roughness, seven times the mean magnitude, on the fifth stream.
fn first_roughness(differences: &[i32]) -> u8 {
    let total: u64 = differences
        .iter()
        .map(|d| u64::from(d.unsigned_abs().min(LOUDEST)))
        .sum();
    let mean = 7 * total / (differences.len() as u64).max(1);
    (64 - mean.leading_zeros()).saturating_sub(4) as u8
}

/// The token of a magnitude, and how many bits the token leaves open.
#[inline]
fn token_of(magnitude: u32) -> (u8, u32) {
    if magnitude < 16 {
        return (magnitude as u8, 0);
    }
    let octave = 31 - magnitude.leading_zeros();
    let quarter = magnitude >> (octave - 2) & 3;
    ((16 + (octave - 4) * 4 + quarter) as u8, octave - 2)
}

/// Magnitude and sign of a token; tokens that no writer makes count as the largest one.
#[inline]
fn untoken(token: u8, bits: &mut BitReader<'_>) -> (u32, bool) {
    let token = u32::from(token.min(127));
    if token == 0 {
        return (0, false);
    }
    if token < 16 {
        return (token, bits.pull(1) == 1);
    }
    let octave = (token - 16) / 4 + 4;
    let rest = octave - 2;
    let low = bits.pull(rest + 1);
    ((4 | (token & 3)) << rest | low >> 1, low & 1 == 1)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use proptest::prelude::*;

    fn value() -> impl Strategy<Value = i32> {
        prop_oneof![
            Just(0),
            -3..3,
            -3000..3000,
            any::<i32>(),
            Just(i32::MIN),
            Just(i32::MAX)
        ]
    }

    proptest! {
        #[test]
        fn arrays_come_back(width in 1_usize..40, rows in 1_usize..12, plane: bool,
                            seed in prop::collection::vec(value(), 480)) {
            let values = &seed[..width * rows];
            let prediction = if plane { Prediction::Plane } else { Prediction::Zero };
            let bytes = pack(values, width, prediction, &Validity::All).unwrap();
            let back = unpack(&bytes, width, values.len(), prediction, &Validity::All).unwrap();
            prop_assert_eq!(back, values);
        }

        #[test]
        fn broken_bytes_never_panic(at in any::<prop::sample::Index>(), to: u8, cut in any::<prop::sample::Index>()) {
            let values: Vec<i32> = (0..400).map(|k| (k * k * 37) % 9000 - 4000).collect();
            let mut bytes = pack(&values, 20, Prediction::Plane, &Validity::All).unwrap();
            let at = at.index(bytes.len());
            bytes[at] = to;
            let _ = unpack(&bytes, 20, 400, Prediction::Plane, &Validity::All);
            let _ = unpack(&bytes[..cut.index(bytes.len())], 20, 400, Prediction::Plane, &Validity::All);
        }
    }

    #[test]
    fn tokens_cover_every_magnitude() {
        for magnitude in (0..70_000).chain([1 << 24, (1 << 31) - 1, 1 << 31]) {
            let (token, rest) = token_of(magnitude);
            let mut writer = BitWriter::default();
            if token > 0 {
                writer.push((magnitude & ((1 << rest) - 1)) << 1, rest + 1);
            }
            let bytes = writer.finish();
            let mut reader = BitReader::new(&bytes);
            assert_eq!(untoken(token, &mut reader), (magnitude, false));
        }
    }
}
