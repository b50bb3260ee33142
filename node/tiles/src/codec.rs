//! The payloads of a tile file: samples and validity mask to bytes and back, without loss.
//!
//! In: samples, channels, validity. Out: bytes, and the same samples with 0 at invalid nodes. Every reader is
//! told how large its result must be and allocates no more, whatever the bytes say.

mod bits;
mod heights;
mod pictures;
mod resampled;

use std::cell::RefCell;
use std::io;

use thiserror::Error;

pub use resampled::Origin;

use crate::format::{MASK_WORDS, NODE_COUNT, SampleType, Samples, Validity};

/// How samples become bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Codec {
    /// Little-endian numbers as they are: the disk cache.
    Plain,
    /// Heights predicted from their neighbours.
    Gradient,
    /// Heights predicted from the window of the source that they were resampled from.
    Resampled,
    /// Integer pictures: colour differences, median predictor, byte planes.
    Picture,
    /// Floating point: differences of ordered bit patterns, byte planes.
    Float,
}

/// Why a payload does not expand to the samples of a tile.
#[derive(Debug, Error)]
pub enum CodecError {
    /// The compressor's frame is broken.
    #[error("decompression failed: {0}")]
    Decompression(io::Error),
    /// A part is shorter or longer than it must be.
    #[error("the {part} has the wrong length")]
    Length {
        /// Which part.
        part: &'static str,
    },
    /// A number is out of its range.
    #[error("the {part} is out of range")]
    Range {
        /// Which part.
        part: &'static str,
    },
}

impl Codec {
    /// The codec for samples of which nothing more is known.
    pub(crate) const fn for_samples(sample_type: SampleType) -> Self {
        match sample_type {
            SampleType::I32 => Self::Gradient,
            SampleType::U8 | SampleType::U16 => Self::Picture,
            SampleType::F32 => Self::Float,
        }
    }

    pub(crate) const fn code(self) -> u8 {
        match self {
            Self::Plain => 0,
            Self::Gradient => 1,
            Self::Resampled => 2,
            Self::Picture => 3,
            Self::Float => 4,
        }
    }

    pub(crate) const fn of_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Plain),
            1 => Some(Self::Gradient),
            2 => Some(Self::Resampled),
            3 => Some(Self::Picture),
            4 => Some(Self::Float),
            _ => None,
        }
    }

    /// Whether this codec writes samples of a type.
    pub(crate) const fn takes(self, sample_type: SampleType) -> bool {
        match self {
            Self::Plain => true,
            Self::Gradient | Self::Resampled => matches!(sample_type, SampleType::I32),
            Self::Picture => matches!(sample_type, SampleType::U8 | SampleType::U16),
            Self::Float => matches!(sample_type, SampleType::F32),
        }
    }
}

/// Samples without compression.
pub(crate) fn pack_plain(samples: &Samples) -> Vec<u8> {
    match samples {
        Samples::I32(values) => bytes_of(values, i32::to_le_bytes),
        Samples::U8(values) => values.clone(),
        Samples::U16(values) => bytes_of(values, u16::to_le_bytes),
        Samples::F32(values) => bytes_of(values, f32::to_le_bytes),
    }
}

/// Samples, compressed by the codec that [`Codec::for_samples`] names.
pub(crate) fn pack(samples: &Samples, channels: u8, validity: &Validity) -> io::Result<Vec<u8>> {
    match samples {
        Samples::I32(values) => heights::pack_tile(values, validity),
        Samples::U8(values) => pictures::pack_u8(values, channels, validity),
        Samples::U16(values) => pictures::pack_u16(values, channels, validity),
        Samples::F32(values) => pictures::pack_f32(values, channels, validity),
    }
}

/// Heights as differences from what their origin makes of them.
pub(crate) fn pack_resampled(
    values: &[i32],
    validity: &Validity,
    origin: &Origin,
) -> io::Result<Vec<u8>> {
    resampled::pack(values, validity, origin)
}

/// The samples of one tile from a payload.
pub(crate) fn unpack(
    codec: Codec,
    sample_type: SampleType,
    channels: u8,
    validity: &Validity,
    bytes: &[u8],
) -> Result<Samples, CodecError> {
    let samples = match (codec, sample_type) {
        (Codec::Plain, _) => return unpack_plain(sample_type, channels, bytes),
        (Codec::Gradient, _) => Samples::I32(heights::unpack_tile(bytes, validity)?),
        (Codec::Resampled, _) => Samples::I32(resampled::unpack(bytes, validity)?),
        (Codec::Picture, SampleType::U8) => {
            Samples::U8(pictures::unpack_u8(bytes, channels, validity)?)
        }
        (Codec::Picture, _) => Samples::U16(pictures::unpack_u16(bytes, channels, validity)?),
        (Codec::Float, _) => Samples::F32(pictures::unpack_f32(bytes, channels, validity)?),
    };
    Ok(samples)
}

fn unpack_plain(
    sample_type: SampleType,
    channels: u8,
    bytes: &[u8],
) -> Result<Samples, CodecError> {
    if bytes.len() != NODE_COUNT * usize::from(channels) * sample_type.bytes() {
        return Err(CodecError::Length { part: "samples" });
    }
    Ok(match sample_type {
        SampleType::I32 => Samples::I32(numbers_of(bytes, i32::from_le_bytes)),
        SampleType::U8 => Samples::U8(bytes.to_vec()),
        SampleType::U16 => Samples::U16(numbers_of(bytes, u16::from_le_bytes)),
        SampleType::F32 => {
            let values = numbers_of(bytes, f32::from_le_bytes);
            if values.iter().any(|value| !value.is_finite()) {
                return Err(CodecError::Range { part: "samples" });
            }
            Samples::F32(values)
        }
    })
}

/// A validity mask, compressed.
pub(crate) fn pack_mask(words: &[u64]) -> io::Result<Vec<u8>> {
    compress(&bytes_of(words, u64::to_le_bytes), 3)
}

/// A validity mask from its bytes.
pub(crate) fn unpack_mask(bytes: &[u8]) -> Result<Box<[u64]>, CodecError> {
    let plain = expand(bytes, MASK_WORDS * 8, "mask")?;
    Ok(numbers_of(&plain, u64::from_le_bytes).into_boxed_slice())
}

fn bytes_of<T: Copy, const N: usize>(values: &[T], convert: impl Fn(T) -> [u8; N]) -> Vec<u8> {
    let mut bytes = vec![0; values.len() * N];
    for (place, value) in bytes.as_chunks_mut::<N>().0.iter_mut().zip(values) {
        *place = convert(*value);
    }
    bytes
}

fn numbers_of<T, const N: usize>(bytes: &[u8], convert: impl Fn([u8; N]) -> T) -> Vec<T> {
    bytes
        .as_chunks::<N>()
        .0
        .iter()
        .map(|chunk| convert(*chunk))
        .collect()
}

thread_local! {
    // Contexts are large; making one for each of a tile's streams would cost more than the work itself.
    static COMPRESSOR: RefCell<zstd::zstd_safe::CCtx<'static>> = RefCell::new(zstd::zstd_safe::CCtx::create());
    static EXPANDER: RefCell<zstd::zstd_safe::DCtx<'static>> = RefCell::new(zstd::zstd_safe::DCtx::create());
}

fn zstd_error(code: usize) -> io::Error {
    io::Error::other(zstd::zstd_safe::get_error_name(code))
}

/// One zstd frame.
pub(crate) fn compress(bytes: &[u8], level: i32) -> io::Result<Vec<u8>> {
    let mut frame = Vec::with_capacity(zstd::zstd_safe::compress_bound(bytes.len()));
    COMPRESSOR
        .with_borrow_mut(|context| context.compress(&mut frame, bytes, level))
        .map_err(zstd_error)?;
    Ok(frame)
}

/// A zstd frame that must expand to exactly `length` bytes.
pub(crate) fn expand(
    frame: &[u8],
    length: usize,
    part: &'static str,
) -> Result<Vec<u8>, CodecError> {
    let mut bytes = Vec::with_capacity(length);
    EXPANDER
        .with_borrow_mut(|context| context.decompress(&mut bytes, frame))
        .map_err(|code| CodecError::Decompression(zstd_error(code)))?;
    if bytes.len() == length {
        Ok(bytes)
    } else {
        Err(CodecError::Length { part })
    }
}

/// Sets the samples of invalid nodes to the type's zero.
pub(crate) fn clear_invalid<T: Copy + Default>(
    values: &mut [T],
    channels: u8,
    validity: &Validity,
) {
    if matches!(validity, Validity::Mask(_)) {
        for (node, value) in values.chunks_exact_mut(usize::from(channels)).enumerate() {
            if !validity.is_valid(node) {
                value.fill(T::default());
            }
        }
    }
}
