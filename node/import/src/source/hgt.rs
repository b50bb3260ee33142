//! SRTM height cells: 1201² or 3601² big-endian 16-bit metres, placed by their name, −32768 where nothing is known.
//! In: a file, or the bytes of one. Out: a source of one degree by one degree, outer samples on the whole degrees.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tiles::Kind;

use super::pixels::{Bands, Colour, Number, RawSamples};
use super::reading::Reading;
use super::{Description, Pixels, Raster, Source, badly_placed};
use crate::crs::Crs;
use crate::error::SourceError;
use crate::grid::{Affine, Grid};
use crate::options::ImportOptions;

/// What no height is known with.
const VOID: f64 = -32768.0;
/// Rows of a chunk.
const BAND_ROWS: u32 = 256;

/// Samples a side of a cell of so many bytes.
pub(super) const fn side_of(bytes: u64) -> Option<u32> {
    match bytes {
        2_884_802 => Some(1201),
        25_934_402 => Some(3601),
        _ => None,
    }
}

/// Latitude and longitude of the lower left corner from a name such as `N45E006.hgt` or `S01W072.SRTMGL1.hgt`.
pub(super) fn corner_of(name: &str) -> Option<(f64, f64)> {
    let name = name.rsplit(['/', '\\']).next()?.to_ascii_uppercase();
    let bytes = name.as_bytes();
    let sign = |letter: u8, plus: u8, minus: u8| match letter {
        l if l == plus => Some(1.0),
        l if l == minus => Some(-1.0),
        _ => None,
    };
    let latitude: f64 = name.get(1..3)?.parse().ok()?;
    let longitude: f64 = name.get(4..7)?.parse().ok()?;
    let latitude = latitude * sign(*bytes.first()?, b'N', b'S')?;
    let longitude = longitude * sign(*bytes.get(3)?, b'E', b'W')?;
    let inside = (-90.0..90.0).contains(&latitude) && (-180.0..=180.0).contains(&longitude);
    (inside && matches!(bytes.get(7), None | Some(b'.' | b'_'))).then_some((latitude, longitude))
}

/// The description of a cell of `bytes` bytes called `name`.
pub(super) fn describe(
    file: &str,
    name: &str,
    bytes: u64,
    options: &ImportOptions,
) -> Result<(Description, Reading), SourceError> {
    if options.kind != Kind::Elevation {
        return Err(SourceError::refused(
            file,
            format!("an .hgt cell holds heights, not {}", options.kind),
            "Import it with --kind elevation.",
        ));
    }
    let Some(side) = side_of(bytes) else {
        return Err(SourceError::damaged(
            file,
            format!("an .hgt cell has 2884802 bytes (1201²) or 25934402 (3601²), this one {bytes}"),
        ));
    };
    let Some((latitude, longitude)) = corner_of(name) else {
        return Err(SourceError::refused(
            file,
            "an .hgt cell is placed by its name, and this one is not of the form N45E006.hgt",
            "Give it the name of its lower left corner.",
        ));
    };
    let step = 1.0 / f64::from(side - 1);
    let to_crs = Affine {
        x0: longitude,
        dx_column: step,
        dx_row: 0.0,
        y0: latitude + 1.0,
        dy_column: 0.0,
        dy_row: -step,
    };
    let registered = options.node_registered.unwrap_or(true);
    let grid = Grid::new(side, side, Arc::new(Crs::degrees()), to_crs, registered)
        .map_err(|clause| badly_placed(file, clause))?;
    let bands = Bands {
        count: 1,
        number: Number::I16,
        colour: Colour::Plain,
        alpha: None,
        nodata: Some(VOID),
    };
    let reading = Reading::choose(file, bands, options)?;
    let chunk = (side, BAND_ROWS);
    let description = Description {
        file: file.to_owned(),
        grid,
        channels: 1,
        integer: true,
        sample_type: reading.sample_type(),
        scale: 1.0,
        offset: 0.0,
        chunk,
        chunk_bytes: u64::from(chunk.0) * u64::from(chunk.1) * reading.bytes_a_pixel() as u64,
    };
    Ok((description, reading))
}

/// Opens a cell that lies in the file system.
pub(super) fn open(
    path: &Path,
    file: &str,
    options: &ImportOptions,
) -> Result<Source, SourceError> {
    let unreadable = |error| SourceError::unreadable(file, error);
    let bytes = std::fs::metadata(path).map_err(unreadable)?.len();
    let name = path
        .file_name()
        .map(|name| name.to_string_lossy())
        .unwrap_or_default();
    let (description, reading) = describe(file, &name, bytes, options)?;
    let side = description.grid.width;
    let raster = Cell {
        path: path.to_owned(),
        file: file.to_owned(),
        side,
        reading,
    };
    Ok(Source::new(description, Box::new(raster)))
}

/// Big-endian bytes to numbers.
pub(super) fn numbers(bytes: &[u8]) -> RawSamples {
    let numbers = bytes.chunks_exact(2).map(|pair| match *pair {
        [high, low] => i16::from_be_bytes([high, low]),
        _ => 0,
    });
    RawSamples::I16(numbers.collect())
}

struct Cell {
    path: PathBuf,
    file: String,
    side: u32,
    reading: Reading,
}

impl Raster for Cell {
    fn read(&self, _column: u32, row: u32) -> Result<Pixels, SourceError> {
        let unreadable = |error| SourceError::unreadable(&self.file, error);
        let first = row * BAND_ROWS;
        let rows = BAND_ROWS.min(self.side.saturating_sub(first));
        let row_bytes = 2 * u64::from(self.side);
        let mut bytes = vec![0; rows as usize * row_bytes as usize];
        let mut file = File::open(&self.path).map_err(unreadable)?;
        file.seek(SeekFrom::Start(u64::from(first) * row_bytes))
            .map_err(unreadable)?;
        file.read_exact(&mut bytes).map_err(unreadable)?;
        Ok(self.reading.pixels(self.side, rows, numbers(&bytes), None))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_place_cells() {
        assert_eq!(corner_of("N45E006.hgt"), Some((45.0, 6.0)));
        assert_eq!(corner_of("a/b/s01w072.SRTMGL1.hgt"), Some((-1.0, -72.0)));
        for name in [
            "N45.hgt",
            "X45E006.hgt",
            "N95E006.hgt",
            "N45E0061.hgt",
            "é45E006.hgt",
        ] {
            assert_eq!(corner_of(name), None, "{name}");
        }
    }
}
