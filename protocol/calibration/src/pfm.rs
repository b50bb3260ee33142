//! Portable float maps.
//! Layout: "PFM Portable FloatMap Image Format", Paul Debevec (pauldebevec.com/Research/HDR/PFM): `PF` (3 channels) or
//! `Pf` (1), width, height and scale as text, each followed by white space, exactly one line end after the scale; then
//! 32-bit floats, bottom row first, little-endian if the scale is negative. In: a reader. Out: rows from the top. It
//! keeps no more than has been read and reads no further than one byte beyond the end.

use std::io::{self, Read};

use crate::grid::{Grid, Placement, Sample};
use crate::options::RowOrder;
use crate::{MAX_SIZE_PX, ReadError};

/// Longest word of a header; numbers are shorter.
const LONGEST_WORD: usize = 32;
/// Bytes of three floats.
const PIXEL_BYTES: usize = 12;

/// Reads three channels; samples with numbers that are not finite become holes.
pub(crate) fn read(
    reader: &mut dyn Read,
    file: &str,
    rows: RowOrder,
    limit_bytes: u64,
) -> Result<Grid<[f32; 3]>, ReadError> {
    let mut words = Words { reader, file };
    if words.next()?.0 != "PF" {
        return Err(ReadError::Unsupported {
            file: file.to_owned(),
            what: "a float map of other than three channels".to_owned(),
            remedy: "Write geometry as PFM with the mark \"PF\".",
        });
    }
    let width = words.size("the width")?;
    let height = words.size("the height")?;
    let (is_little_endian, first) = words.scale()?;
    let columns = width as usize;
    let due = u64::from(width) * u64::from(height) * PIXEL_BYTES as u64;
    if due > limit_bytes {
        return Err(ReadError::TooLarge {
            file: file.to_owned(),
            limit_bytes,
        });
    }
    let mut data = first.as_slice().chain(reader);
    let mut row_bytes = vec![0_u8; columns * PIXEL_BYTES];
    // It grows with what has really been read, not with what the header promises.
    let mut values: Vec<[f32; 3]> = Vec::new();
    for row in 0..height {
        let count = fill(&mut data, &mut row_bytes, file)?;
        if count < row_bytes.len() {
            return Err(ReadError::Truncated {
                file: file.to_owned(),
                expected: due,
                found: u64::from(row) * row_bytes.len() as u64 + count as u64,
            });
        }
        let pixels = row_bytes.as_chunks::<PIXEL_BYTES>().0;
        values.extend(pixels.iter().map(|pixel| decode(pixel, is_little_endian)));
    }
    if fill(&mut data, &mut [0], file)? != 0 {
        return Err(ReadError::Overlong {
            file: file.to_owned(),
            expected: due,
        });
    }
    if rows == RowOrder::BottomFirst {
        flip_rows(&mut values, columns);
    }
    Grid::new(width, height, Placement::Centres, values)
        .ok_or_else(|| bad_size(file, u64::from(width), u64::from(height)))
}

/// Writes three channels: little-endian, bottom row first. Holes are NaN.
pub(crate) fn write(width: u32, height: u32, values: &[[f32; 3]]) -> Vec<u8> {
    let mut bytes = format!("PF\n{width} {height}\n-1.0\n").into_bytes();
    bytes.reserve(values.len() * PIXEL_BYTES);
    for row in values.chunks(width.max(1) as usize).rev() {
        for value in row.as_flattened() {
            bytes.extend(value.to_le_bytes());
        }
    }
    bytes
}

fn decode(pixel: &[u8; PIXEL_BYTES], is_little_endian: bool) -> [f32; 3] {
    let mut sample = [0.0; 3];
    for (value, bytes) in sample.iter_mut().zip(pixel.as_chunks::<4>().0) {
        *value = if is_little_endian {
            f32::from_le_bytes(*bytes)
        } else {
            f32::from_be_bytes(*bytes)
        };
    }
    sample
}

/// A sample with a hole in any of the channels that count as a hole in all of them.
pub(crate) fn channels<const N: usize>(
    grid: Grid<[f32; 3]>,
    choose: fn([f32; 3]) -> [f32; N],
) -> Grid<[f32; N]> {
    grid.map(|sample| {
        let chosen = choose(sample);
        if chosen.is_hole() {
            <[f32; N]>::HOLE
        } else {
            chosen
        }
    })
}

fn flip_rows(values: &mut [[f32; 3]], columns: usize) {
    values.reverse();
    for row in values.chunks_mut(columns.max(1)) {
        row.reverse();
    }
}

fn bad_size(file: &str, width: u64, height: u64) -> ReadError {
    ReadError::BadSize {
        file: file.to_owned(),
        width,
        height,
    }
}

/// Reads as much as there is, up to the buffer's length.
fn fill(reader: &mut dyn Read, buffer: &mut [u8], file: &str) -> Result<usize, ReadError> {
    let mut count = 0;
    while let Some(rest) = buffer.get_mut(count..).filter(|rest| !rest.is_empty()) {
        match reader.read(rest) {
            Ok(0) => break,
            Ok(more) => count += more,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(damaged(file, &error.to_string())),
        }
    }
    Ok(count)
}

fn damaged(file: &str, reason: &str) -> ReadError {
    ReadError::Damaged {
        file: file.to_owned(),
        reason: reason.to_owned(),
    }
}

/// The words of a header.
struct Words<'a> {
    reader: &'a mut dyn Read,
    file: &'a str,
}

impl Words<'_> {
    /// A word and the byte after it.
    fn next(&mut self) -> Result<(String, u8), ReadError> {
        let mut word = String::new();
        loop {
            let mut byte = [0];
            if fill(self.reader, &mut byte, self.file)? == 0 {
                return Err(damaged(self.file, "its header ends too early"));
            }
            let [byte] = byte;
            match byte {
                b' ' | b'\t' | b'\r' | b'\n' if word.is_empty() => {}
                b' ' | b'\t' | b'\r' | b'\n' => return Ok((word, byte)),
                0x21..=0x7E if word.len() < LONGEST_WORD => word.push(char::from(byte)),
                _ => return Err(damaged(self.file, "its header is no text")),
            }
        }
    }

    fn size(&mut self, key: &str) -> Result<u32, ReadError> {
        let (word, _) = self.next()?;
        let wanted = format!("a whole number of 1…{MAX_SIZE_PX}");
        let value: u64 = word.parse().map_err(|_| self.refuse(key, &word, &wanted))?;
        if !(1..=u64::from(MAX_SIZE_PX)).contains(&value) {
            return Err(self.refuse(key, &word, &wanted));
        }
        Ok(value as u32)
    }

    /// Whether the numbers are little-endian, and a first byte of data that had to be read ahead: a line end
    /// may be "\r\n", and a "\r" alone is one too.
    fn scale(&mut self) -> Result<(bool, Vec<u8>), ReadError> {
        let (word, end) = self.next()?;
        let scale: f32 = word
            .parse()
            .ok()
            .filter(|scale: &f32| scale.is_finite() && *scale != 0.0)
            .ok_or_else(|| {
                self.refuse(
                    "the scale",
                    &word,
                    "−1.0 for little-endian or 1.0 for big-endian",
                )
            })?;
        let mut ahead = Vec::new();
        if end == b'\r' {
            let mut byte = [0];
            let count = fill(self.reader, &mut byte, self.file)?;
            if count == 1 && byte != *b"\n" {
                ahead.extend(byte);
            }
        }
        Ok((scale < 0.0, ahead))
    }

    fn refuse(&self, key: &str, value: &str, wanted: &str) -> ReadError {
        crate::text::Line {
            file: self.file,
            number: 1,
        }
        .refuse(key, value, wanted)
    }
}
