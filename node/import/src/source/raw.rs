//! Headerless grids of numbers with a stated layout.
//! In: a file, its layout, its extent. Out: a source. Also reads the samples of other formats that lie in a file
//! uncompressed and row by row.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use super::pixels::{Bands, Colour, Number, RawSamples};
use super::reading::Reading;
use super::{Description, Pixels, Raster, Source, badly_placed, without_georeference};
use crate::error::SourceError;
use crate::grid::Grid;
use crate::options::{Endianness, ImportOptions, RawLayout, RawSample};

/// Bytes of a chunk, about: some rows of the grid.
const CHUNK_BYTES: u64 = 1 << 20;

/// Opens a grid of the given layout.
pub(super) fn open(
    path: &Path,
    file: &str,
    layout: RawLayout,
    options: &ImportOptions,
) -> Result<Source, SourceError> {
    let RawLayout {
        width,
        height,
        sample,
        endianness,
        header_bytes,
        bands: count,
    } = layout;
    if width == 0 || height == 0 || count == 0 || count > 1024 {
        return Err(SourceError::refused(
            file,
            format!("the layout {width}×{height} with {count} bands is empty"),
            "Give width, height and bands of at least 1.",
        ));
    }
    let length = std::fs::metadata(path)
        .map_err(|e| SourceError::unreadable(file, e))?
        .len();
    let samples = u64::from(width) * u64::from(height) * count as u64;
    let due = samples
        .saturating_mul(sample.bytes() as u64)
        .saturating_add(header_bytes);
    if due != length {
        return Err(SourceError::refused(
            file,
            format!("the layout calls for {due} bytes, but the file has {length}"),
            "Correct width, height, type, bands or header bytes.",
        ));
    }
    let number = match sample {
        RawSample::U8 => Number::Bits(8),
        RawSample::I8 => Number::I8,
        RawSample::U16 => Number::U16,
        RawSample::I16 => Number::I16,
        RawSample::U32 => Number::U32,
        RawSample::I32 => Number::I32,
        RawSample::F32 => Number::F32,
        RawSample::F64 => Number::F64,
    };
    let colour = if count == 3 || count == 4 {
        Colour::Rgb
    } else {
        Colour::Plain
    };
    let bands = Bands {
        count,
        number,
        colour,
        alpha: None,
        nodata: None,
    };
    let reading = Reading::choose(file, bands, options)?;
    let extent = options.extent.ok_or_else(|| without_georeference(file))?;
    let registered = options.node_registered.unwrap_or(false);
    let grid = Grid::of_extent(width, height, extent, registered)
        .map_err(|clause| badly_placed(file, clause))?;
    let opened = File::open(path).map_err(|error| SourceError::unreadable(file, error))?;
    let rows = Rows::new(opened, file, &grid, header_bytes, endianness, reading);
    Ok(rows.into_source(grid, 1.0, 0.0))
}

/// Uncompressed rows from some byte of a file on.
pub(super) struct Rows {
    name: String,
    file: Mutex<File>,
    width: u32,
    height: u32,
    first_byte: u64,
    endianness: Endianness,
    band_rows: u32,
    reading: Reading,
}

impl Rows {
    pub(super) fn new(
        file: File,
        name: &str,
        grid: &Grid,
        first_byte: u64,
        endianness: Endianness,
        reading: Reading,
    ) -> Self {
        let (width, height) = (grid.width, grid.height);
        let row_bytes = u64::from(width) * (reading.band_count() * reading.number().bytes()) as u64;
        let band_rows = (CHUNK_BYTES / row_bytes.max(1)).clamp(1, 1024) as u32;
        let (name, file) = (name.to_owned(), Mutex::new(file));
        Self {
            name,
            file,
            width,
            height,
            first_byte,
            endianness,
            band_rows,
            reading,
        }
    }

    pub(super) fn into_source(self, grid: Grid, scale: f64, offset: f64) -> Source {
        let chunk = (self.width, self.band_rows);
        let description = Description {
            file: self.name.clone(),
            grid,
            channels: self.reading.channels(),
            integer: self.reading.number().is_integer(),
            sample_type: self.reading.sample_type(),
            scale,
            offset,
            chunk,
            chunk_bytes: u64::from(chunk.0)
                * u64::from(chunk.1)
                * self.reading.bytes_a_pixel() as u64,
        };
        Source::new(description, Box::new(self))
    }
}

impl Raster for Rows {
    fn read(&self, _column: u32, row: u32) -> Result<Pixels, SourceError> {
        let unreadable = |error| SourceError::unreadable(&self.name, error);
        let first = row * self.band_rows;
        let rows = self.band_rows.min(self.height.saturating_sub(first));
        let number = self.reading.number();
        let row_bytes = self.width as usize * self.reading.band_count() * number.bytes();
        let mut bytes = vec![0; rows as usize * row_bytes];
        let start = self.first_byte + u64::from(first) * row_bytes as u64;
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(start)).map_err(unreadable)?;
        file.read_exact(&mut bytes).map_err(unreadable)?;
        drop(file);
        let big = self.endianness == Endianness::Big;
        let raw = numbers_of(bytes, number, big);
        Ok(self.reading.pixels(self.width, rows, raw, None))
    }
}

/// Bytes in file order to numbers.
fn numbers_of(bytes: Vec<u8>, number: Number, big: bool) -> RawSamples {
    fn each<const N: usize, T>(bytes: &[u8], make: impl Fn([u8; N]) -> T) -> Vec<T> {
        bytes
            .as_chunks::<N>()
            .0
            .iter()
            .map(|chunk| make(*chunk))
            .collect()
    }
    match (number, big) {
        (Number::Bits(_), _) => RawSamples::U8(bytes),
        (Number::I8, _) => RawSamples::I8(each(&bytes, i8::from_le_bytes)),
        (Number::U16, false) => RawSamples::U16(each(&bytes, u16::from_le_bytes)),
        (Number::U16, true) => RawSamples::U16(each(&bytes, u16::from_be_bytes)),
        (Number::I16, false) => RawSamples::I16(each(&bytes, i16::from_le_bytes)),
        (Number::I16, true) => RawSamples::I16(each(&bytes, i16::from_be_bytes)),
        (Number::U32, false) => RawSamples::U32(each(&bytes, u32::from_le_bytes)),
        (Number::U32, true) => RawSamples::U32(each(&bytes, u32::from_be_bytes)),
        (Number::I32, false) => RawSamples::I32(each(&bytes, i32::from_le_bytes)),
        (Number::I32, true) => RawSamples::I32(each(&bytes, i32::from_be_bytes)),
        (Number::F32, false) => RawSamples::F32(each(&bytes, f32::from_le_bytes)),
        (Number::F32, true) => RawSamples::F32(each(&bytes, f32::from_be_bytes)),
        (Number::F64, false) => RawSamples::F64(each(&bytes, f64::from_le_bytes)),
        (Number::F64, true) => RawSamples::F64(each(&bytes, f64::from_be_bytes)),
    }
}
