//! Maps of light as PNG.
//! In: a PNG of 8 or 16 bits with 1 or 3 channels, at the region's size. Out: a map, and the reverse. The size is
//! compared before anything is unpacked; a picture cannot grow beyond it.

use std::io::Cursor;

use png::{
    BitDepth, ColorType, Decoder, DecodingError, Encoder, EncodingError, Limits, Transformations,
};

use crate::{Map, ReadError, Texels};

/// A byte of deflate makes 1032 bytes at most (RFC 1951: 258 bytes from two bits), and some for small pictures.
const MOST_GROWTH: usize = 1032;

/// Reads a map; also gives the bits of a channel.
pub(super) fn read(bytes: &[u8], file: &str, size_px: [u32; 2]) -> Result<(Map, u8), ReadError> {
    let broken = |error: &DecodingError| damaged(file, &error.to_string());
    let pixels = size_px[0] as usize * size_px[1] as usize;
    let limits = Limits {
        bytes: pixels * 6 + (1 << 20),
    };
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(Transformations::IDENTITY);
    let info = decoder.read_header_info().map_err(|error| broken(&error))?;
    let found_px = [info.width, info.height];
    if found_px != size_px {
        return Err(ReadError::WrongSize {
            file: file.to_owned(),
            found_px,
            expected_px: size_px,
        });
    }
    let (channels, depth) = match (info.color_type, info.bit_depth) {
        (ColorType::Grayscale, BitDepth::Eight) => (1, 8),
        (ColorType::Grayscale, BitDepth::Sixteen) => (1, 16),
        (ColorType::Rgb, BitDepth::Eight) => (3, 8),
        (ColorType::Rgb, BitDepth::Sixteen) => (3, 16),
        (colour, depth) => {
            return Err(ReadError::Unsupported {
                file: file.to_owned(),
                what: format!("a picture of {colour:?} with {} bits", depth as u8),
                remedy: "Save it as grey or RGB with 8 or 16 bits, without transparency and palette.",
            });
        }
    };
    let due = pixels * channels * usize::from(depth) / 8;
    if due > bytes.len().saturating_mul(MOST_GROWTH) {
        return Err(ReadError::Truncated {
            file: file.to_owned(),
            expected: (due / MOST_GROWTH) as u64,
            found: bytes.len() as u64,
        });
    }
    let mut reader = decoder.read_info().map_err(|error| broken(&error))?;
    let mut unpacked = vec![0_u8; due];
    let frame = reader
        .next_frame(&mut unpacked)
        .map_err(|error| broken(&error))?;
    if frame.buffer_size() != due {
        return Err(damaged(file, "its rows do not fill its size"));
    }
    let values: Vec<f32> = if depth == 8 {
        unpacked
            .iter()
            .map(|value| f32::from(*value) / 255.0)
            .collect()
    } else {
        let pairs = unpacked.as_chunks::<2>().0;
        pairs
            .iter()
            .map(|pair| f32::from(u16::from_be_bytes(*pair)) / 65535.0)
            .collect()
    };
    let texels = if channels == 1 {
        Texels::Grey(values)
    } else {
        Texels::Colour(values.as_chunks::<3>().0.to_vec())
    };
    let map = Map::new(size_px[0], size_px[1], texels);
    let map = map.ok_or_else(|| damaged(file, "its rows do not fill its size"))?;
    Ok((map, depth))
}

/// Writes a map with 16 bits a channel. Values that came from 8 or 16 bits come back as they were.
pub(super) fn write(map: &Map) -> Result<Vec<u8>, EncodingError> {
    let (colour, values) = match &map.texels {
        Texels::Grey(values) => (ColorType::Grayscale, values.as_slice()),
        Texels::Colour(values) => (ColorType::Rgb, values.as_flattened()),
    };
    let mut data = Vec::with_capacity(values.len() * 2);
    for value in values {
        let level = (f64::from(*value).clamp(0.0, 1.0) * 65535.0).round() as u16;
        data.extend(level.to_be_bytes());
    }
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, map.width, map.height);
    encoder.set_color(colour);
    encoder.set_depth(BitDepth::Sixteen);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&data)?;
    writer.finish()?;
    Ok(bytes)
}

fn damaged(file: &str, reason: &str) -> ReadError {
    ReadError::Damaged {
        file: file.to_owned(),
        reason: reason.to_owned(),
    }
}
