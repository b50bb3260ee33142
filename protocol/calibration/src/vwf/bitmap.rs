//! Windows bitmaps inside VIOSO files.
//! Layout: BITMAPFILEHEADER (14 bytes) and BITMAPINFOHEADER (40 bytes) of the Windows SDK, rows padded to four bytes,
//! bottom row first unless the height is negative; besides 24 and 32 bits a pixel (blue, green, red of 8 bits) VIOSO
//! writes 48 (the same of 16 bits), 64 (red, green, blue, alpha of 16 bits) and 96 (blue, green, red as floats):
//! `SaveBMP` and `convertFromBitmapData` in VIOSO's `VWF.cpp`. In: bytes. Out: a map. It reads no palettes.

use super::{cut, damaged, word};
use crate::read::check_size;
use crate::{Map, ReadError, Texels};

/// Bytes of both headers.
const HEADERS_BYTES: usize = 54;

/// A bitmap whose pixels are all there.
pub(super) struct Bitmap<'a> {
    width: u64,
    height: u64,
    is_top_down: bool,
    bits: u32,
    row_bytes: usize,
    rows: &'a [u8],
}

impl<'a> Bitmap<'a> {
    /// The bitmap at the start of some bytes, and what follows it.
    pub(super) fn split(bytes: &'a [u8], file: &str) -> Result<(Self, &'a [u8]), ReadError> {
        let headers = bytes
            .get(..HEADERS_BYTES)
            .ok_or_else(|| cut(file, HEADERS_BYTES, bytes))?;
        let at = |place: usize| word(headers, place).unwrap_or(0);
        let (file_bytes, offset) = (at(2) as usize, at(10) as usize);
        let height = at(22).cast_signed();
        let (width, bits, compression) = (u64::from(at(18)), at(28) & 0xFFFF, at(30));
        if compression != 0 {
            return Err(refused(
                file,
                &format!("a compressed bitmap (kind {compression})"),
            ));
        }
        let rows_count = u64::from(height.unsigned_abs());
        if width == 0 || rows_count == 0 {
            // A picture of no size says that there is none.
            let after = bytes.get(offset.max(HEADERS_BYTES)..).unwrap_or_default();
            let empty = Self {
                width: 0,
                height: 0,
                is_top_down: true,
                bits: 24,
                row_bytes: 0,
                rows: &[],
            };
            return Ok((empty, after));
        }
        if ![24, 32, 48, 64, 96].contains(&bits) {
            return Err(refused(file, &format!("a bitmap of {bits} bits a pixel")));
        }
        check_size(file, width, rows_count)?;
        let row_bytes = (width as usize * bits as usize).div_ceil(32) * 4;
        let due = row_bytes * rows_count as usize;
        let offset = offset.max(HEADERS_BYTES);
        let rows = bytes
            .get(offset..)
            .ok_or_else(|| cut(file, offset, bytes))?;
        let rows = rows.get(..due).ok_or_else(|| cut(file, due, rows))?;
        // The size in the file's header may include padding after the rows.
        let end = file_bytes.max(offset + due);
        let after = bytes.get(end..).ok_or_else(|| cut(file, end, bytes))?;
        let bitmap = Self {
            width,
            height: rows_count,
            is_top_down: height < 0,
            bits,
            row_bytes,
            rows,
        };
        Ok((bitmap, after))
    }

    /// The pixels as a map of the output's size; `None` for a picture of no size.
    pub(super) fn map(&self, file: &str, size_px: [u32; 2]) -> Result<Option<Map>, ReadError> {
        if self.width == 0 {
            return Ok(None);
        }
        let found_px = [self.width as u32, self.height as u32];
        if found_px != size_px {
            return Err(ReadError::WrongSize {
                file: file.to_owned(),
                found_px,
                expected_px: size_px,
            });
        }
        let mut colours = Vec::with_capacity(found_px[0] as usize * found_px[1] as usize);
        let rows = self.rows.chunks_exact(self.row_bytes);
        if self.is_top_down {
            rows.for_each(|row| self.read_row(row, &mut colours));
        } else {
            rows.rev().for_each(|row| self.read_row(row, &mut colours));
        }
        let is_grey = colours
            .iter()
            .all(|[red, green, blue]| red == green && green == blue);
        let texels = if is_grey {
            Texels::Grey(colours.into_iter().map(|[red, _, _]| red).collect())
        } else {
            Texels::Colour(colours)
        };
        let [width, height] = size_px;
        let map = Map::new(width, height, texels);
        map.map(Some)
            .ok_or_else(|| damaged(file, "a bitmap does not fill its size"))
    }

    fn read_row(&self, row: &[u8], colours: &mut Vec<[f32; 3]>) {
        let pixels = row
            .chunks_exact(self.bits as usize / 8)
            .take(self.width as usize);
        colours.extend(pixels.map(|pixel| {
            let byte = |place: usize| f32::from(pixel.get(place).copied().unwrap_or(0)) / 255.0;
            let short = |place: usize| {
                let bytes = [0, 1].map(|next| pixel.get(2 * place + next).copied().unwrap_or(0));
                f32::from(u16::from_le_bytes(bytes)) / 65535.0
            };
            let float = |place: usize| f32::from_bits(word(pixel, 4 * place).unwrap_or(0));
            match self.bits {
                24 | 32 => [byte(2), byte(1), byte(0)],
                48 => [short(2), short(1), short(0)],
                64 => [short(0), short(1), short(2)],
                _ => [float(2), float(1), float(0)].map(|value| {
                    // Blending never makes light; what is no number is told by the caller.
                    if value.is_nan() {
                        value
                    } else {
                        value.clamp(0.0, 1.0)
                    }
                }),
            }
        }));
    }
}

fn refused(file: &str, what: &str) -> ReadError {
    ReadError::Unsupported {
        file: file.to_owned(),
        what: what.to_owned(),
        remedy: "Export the blend as a bitmap of 24, 32, 48, 64 or 96 bits without compression.",
    }
}
