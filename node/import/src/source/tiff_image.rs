//! One image of a TIFF, decoded chunk by chunk from many threads.
//! In: an opened file and the number of an image. Out: its layout and the numbers of its chunks as they are stored, sub-byte
//! samples one a byte. It interprets no colours.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use tiff::decoder::{ChunkType, Decoder, DecodingResult, Limits};

use super::geotiff::{NO_COMPRESSION, check_compression, check_length};
use super::pixels::{Number, RawSamples};
use super::tiff_directory::{Directories, Plain, tag};
use super::tiff_tags::{Tags, explain};
use crate::error::SourceError;
use crate::options::Endianness;

/// The shape of one image of the file and of its chunks.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) chunk_width: u32,
    pub(super) chunk_height: u32,
    pub(super) across: u32,
    pub(super) down: u32,
    pub(super) tiled: bool,
    pub(super) planar: bool,
    pub(super) samples: usize,
    pub(super) bits: u32,
    pub(super) number: Number,
    /// Samples lie in the file as `number` says, without half floats or wide integers.
    pub(super) whole_bytes: bool,
    pub(super) endianness: Endianness,
}

impl Layout {
    pub(super) fn of(
        tags: &mut Tags<'_, '_>,
        size: Option<(u32, u32)>,
        file: &str,
    ) -> Result<Self, SourceError> {
        let Some((width, height)) = size else {
            return Err(SourceError::damaged(
                file,
                "the TIFF does not say how large it is",
            ));
        };
        let samples = tags.number(277)?.unwrap_or(1) as usize;
        let bits = tags.numbers(258)?.first().copied().unwrap_or(1);
        let format = tags.numbers(339)?.first().copied().unwrap_or(1);
        let (number, whole_bytes) = match (format, bits) {
            (1, 1 | 2 | 4 | 8) => (Number::Bits(bits as u8), bits == 8),
            (1, 16) => (Number::U16, true),
            (1, 32) => (Number::U32, true),
            (2, 8) => (Number::I8, true),
            (2, 16) => (Number::I16, true),
            (2, 32) => (Number::I32, true),
            (3, 16) => (Number::F32, false),
            (3, 32) => (Number::F32, true),
            (3, 64) => (Number::F64, true),
            (1 | 2, 64) => (Number::F64, false),
            _ => {
                let kind = match format {
                    1 => "unsigned",
                    2 => "signed",
                    3 => "floating-point",
                    5 | 6 => "complex",
                    _ => "untyped",
                };
                return Err(SourceError::refused(
                    file,
                    format!(
                        "its samples are {kind} of {bits} bits, which this program does not read"
                    ),
                    "Convert it: gdal_translate -ot Float32 IN OUT (-ot UInt16 where that holds them).",
                ));
            }
        };
        let tiled = tags.decoder.get_chunk_type() == ChunkType::Tile;
        let (chunk_width, chunk_height) = tags.decoder.chunk_dimensions();
        let chunk_height = if tiled {
            chunk_height
        } else {
            chunk_height.min(height)
        };
        if samples == 0 || width == 0 || height == 0 || chunk_width == 0 || chunk_height == 0 {
            return Err(SourceError::damaged(file, "the TIFF has empty chunks"));
        }
        let endianness = if tags.decoder.byte_order() == tiff::tags::ByteOrder::BigEndian {
            Endianness::Big
        } else {
            Endianness::Little
        };
        Ok(Self {
            width,
            height,
            chunk_width,
            chunk_height,
            across: width.div_ceil(chunk_width),
            down: height.div_ceil(chunk_height),
            tiled,
            planar: tags.number(284)? == Some(2) && samples > 1,
            samples,
            bits,
            number,
            whole_bytes,
            endianness,
        })
    }

    /// Bytes of a chunk as decoded.
    pub(super) fn chunk_bytes(&self) -> u64 {
        let samples = if self.planar { 1 } else { self.samples as u64 };
        let bits = u64::from(self.bits.max(8));
        u64::from(self.chunk_width) * u64::from(self.chunk_height) * samples * bits / 8
    }
}

/// Opens decoders of one file.
pub(super) struct Opener {
    pub(super) path: PathBuf,
    pub(super) file: String,
    pub(super) directories: Directories,
}

impl Opener {
    pub(super) fn decoder(&self, image: usize) -> Result<Decoder<Plain>, SourceError> {
        let explain = |error| explain(&self.file, error);
        let reader = self.directories.open_plain(&self.path);
        let reader = reader.map_err(|error| SourceError::unreadable(&self.file, error))?;
        let mut limits = Limits::default();
        limits.decoding_buffer_size = 1 << 30;
        limits.intermediate_buffer_size = 1 << 29;
        limits.ifd_value_size = 1 << 28;
        let mut decoder = Decoder::new(reader).map_err(explain)?.with_limits(limits);
        if image > 0 {
            decoder.seek_to_image(image).map_err(explain)?;
        }
        Ok(decoder)
    }
}

/// One image of the file with the decoders that stand at it.
pub(super) struct Image {
    index: usize,
    pub(super) layout: Layout,
    idle: Mutex<Vec<Decoder<Plain>>>,
}

impl Image {
    /// The image at which `decoder` stands.
    pub(super) fn new(index: usize, layout: Layout, decoder: Decoder<Plain>) -> Self {
        Self {
            index,
            layout,
            idle: Mutex::new(vec![decoder]),
        }
    }

    pub(super) fn of_mask(opener: &Opener, index: usize) -> Result<Self, SourceError> {
        let mut decoder = opener.decoder(index)?;
        let mut tags = Tags {
            file: &opener.file,
            decoder: &mut decoder,
        };
        let compression = tags.number(tag::COMPRESSION)?.unwrap_or(NO_COMPRESSION);
        check_compression(&opener.file, compression)?;
        let layout = Layout::of(&mut tags, opener.directories.size(index), &opener.file)?;
        if layout.samples != 1 || !matches!(layout.number, Number::Bits(1 | 8)) {
            return Err(SourceError::refused(
                &opener.file,
                "its mask is neither of 1 nor of 8 bits",
                "Convert it: gdal_translate IN OUT.",
            ));
        }
        let (offsets, counts) = tags.chunk_places(layout.tiled)?;
        check_length(&opener.path, &opener.file, &offsets, &counts)?;
        Ok(Self::new(index, layout, decoder))
    }

    /// The numbers of one chunk of one plane, and the columns and rows it really has.
    pub(super) fn decode(
        &self,
        opener: &Opener,
        chunk: u32,
    ) -> Result<(u32, u32, RawSamples), SourceError> {
        let idle = self
            .idle
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .pop();
        let mut decoder = match idle {
            Some(decoder) => decoder,
            None => opener.decoder(self.index)?,
        };
        let (width, height) = decoder.chunk_data_dimensions(chunk);
        let result = decoder
            .read_chunk(chunk)
            .map_err(|error| explain(&opener.file, error))?;
        self.idle
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(decoder);
        Ok((width, height, self.unpacked(width, height, result)))
    }

    fn unpacked(&self, width: u32, height: u32, result: DecodingResult) -> RawSamples {
        match result {
            DecodingResult::U8(v) if self.layout.bits < 8 => {
                let samples = if self.layout.planar {
                    1
                } else {
                    self.layout.samples
                };
                RawSamples::U8(bits_apart(
                    &v,
                    width as usize * samples,
                    height,
                    self.layout.bits,
                ))
            }
            DecodingResult::U8(v) => RawSamples::U8(v),
            DecodingResult::I8(v) => RawSamples::I8(v),
            DecodingResult::U16(v) => RawSamples::U16(v),
            DecodingResult::I16(v) => RawSamples::I16(v),
            DecodingResult::U32(v) => RawSamples::U32(v),
            DecodingResult::I32(v) => RawSamples::I32(v),
            DecodingResult::U64(v) => RawSamples::F64(v.iter().map(|n| *n as f64).collect()),
            DecodingResult::I64(v) => RawSamples::F64(v.iter().map(|n| *n as f64).collect()),
            DecodingResult::F16(v) => RawSamples::F32(v.iter().map(|n| n.to_f32()).collect()),
            DecodingResult::F32(v) => RawSamples::F32(v),
            DecodingResult::F64(v) => RawSamples::F64(v),
        }
    }
}

/// Samples of 1, 2 or 4 bits, packed row by row from the highest bit, one a byte.
fn bits_apart(packed: &[u8], row_samples: usize, rows: u32, bits: u32) -> Vec<u8> {
    let row_bytes = (row_samples * bits as usize).div_ceil(8);
    let mut apart = Vec::with_capacity(row_samples * rows as usize);
    for row in packed.chunks(row_bytes).take(rows as usize) {
        let samples = (0..row_samples).map(|sample| {
            let bit = sample * bits as usize;
            let byte = row.get(bit / 8).copied().unwrap_or(0);
            byte >> (8 - bits as usize - bit % 8) & ((1_u16 << bits) - 1) as u8
        });
        apart.extend(samples);
    }
    apart
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_come_from_the_highest() {
        assert_eq!(
            bits_apart(&[0b1010_0000, 0b1100_0000], 3, 2, 1),
            [1, 0, 1, 1, 1, 0]
        );
        assert_eq!(bits_apart(&[0x12, 0x30], 3, 1, 4), [1, 2, 3]);
    }
}
