//! Source rasters: opened by what they are, read in chunks from many threads.
//! In: paths and options. Out: where the samples lie and the samples themselves, decoded chunk by chunk and kept
//! within a byte budget. Sources know nothing of tiles.

mod archive;
mod convert;
#[cfg(test)]
mod fixtures;
mod geotiff;
mod hgt;
mod netcdf;
mod picture;
mod pixels;
mod raw;
mod reading;
mod tiff_directory;
mod tiff_image;
mod tiff_tags;

use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

pub(crate) use pixels::{Pixels, Samples};
use tiles::SampleType;

use crate::error::SourceError;
use crate::grid::Grid;
use crate::lru::Lru;
use crate::options::ImportOptions;

/// A chunk as it lies in the cache: decoded once, whoever asks first.
type Slot = Arc<OnceLock<Result<Arc<Pixels>, Arc<SourceError>>>>;

/// Decoded chunks of all sources by source, column and row.
pub(crate) type ChunkCache = Lru<(usize, u32, u32), Slot>;

/// Chunks larger than this are decoded one at a time, so that many threads do not multiply them.
const LARGE_CHUNK_BYTES: u64 = 16 << 20;

/// How the chunks of one source are decoded. Called from many threads at once.
pub(crate) trait Raster: Send + Sync {
    /// The samples of one chunk; chunks at the right and lower ends may be cut to the grid.
    fn read(&self, column: u32, row: u32) -> Result<Pixels, SourceError>;
}

/// What opening a source found out.
pub(crate) struct Description {
    pub(crate) file: String,
    pub(crate) grid: Grid,
    pub(crate) channels: usize,
    /// Whole numbers, before scale and offset.
    pub(crate) integer: bool,
    /// Sample type of a layer that is made from it alone.
    pub(crate) sample_type: SampleType,
    /// Metres = scale × sample + offset, for elevation.
    pub(crate) scale: f64,
    pub(crate) offset: f64,
    /// Columns and rows of a chunk.
    pub(crate) chunk: (u32, u32),
    /// Bytes of a decoded chunk.
    pub(crate) chunk_bytes: u64,
}

/// One raster, ready to be read.
pub(crate) struct Source {
    pub(crate) description: Description,
    raster: Box<dyn Raster>,
    decoding: Mutex<()>,
}

impl Source {
    pub(crate) fn new(description: Description, raster: Box<dyn Raster>) -> Self {
        Self {
            description,
            raster,
            decoding: Mutex::new(()),
        }
    }

    /// The grid of the samples.
    pub(crate) const fn grid(&self) -> &Grid {
        &self.description.grid
    }

    /// Samples of the whole source.
    pub(crate) fn sample_count(&self) -> u64 {
        u64::from(self.grid().width) * u64::from(self.grid().height)
    }

    /// A chunk from the cache, decoded if need be. `number` tells this source from others in the cache.
    pub(crate) fn chunk(
        &self,
        cache: &ChunkCache,
        number: usize,
        column: u32,
        row: u32,
    ) -> Result<Arc<Pixels>, Arc<SourceError>> {
        let bytes = self.description.chunk_bytes;
        let slot = cache.get_or((number, column, row), bytes, || Arc::new(OnceLock::new()));
        let result = slot.get_or_init(|| {
            let _one_at_a_time = (bytes > LARGE_CHUNK_BYTES)
                .then(|| self.decoding.lock().unwrap_or_else(PoisonError::into_inner));
            self.raster
                .read(column, row)
                .map(Arc::new)
                .map_err(Arc::new)
        });
        result.clone()
    }
}

/// Opens one path: one source, or several from an archive.
pub(crate) fn open(path: &Path, options: &ImportOptions) -> Result<Vec<Source>, SourceError> {
    let file = path.display().to_string();
    if path.is_dir() {
        return Err(SourceError::refused(
            &file,
            "it is a directory",
            "Name the files in it, for example with a wildcard.",
        ));
    }
    if let Some(layout) = options.raw {
        return Ok(vec![raw::open(path, &file, layout, options)?]);
    }
    let mut start = [0_u8; 8];
    let length = read_start(path, &mut start).map_err(|e| SourceError::unreadable(&file, e))?;
    let start = &start[..length];
    let extension = path
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or("")
        .to_ascii_lowercase();
    if extension == "hgt" {
        return Ok(vec![hgt::open(path, &file, options)?]);
    }
    match start {
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => {
            Ok(vec![geotiff::open(path, &file, options)?])
        }
        [0x89, b'P', b'N', b'G', ..] | [0xff, 0xd8, 0xff, ..] => {
            Ok(vec![picture::open(path, &file, options)?])
        }
        [b'P', b'K', 3 | 5, 4 | 6, ..] => archive::open(path, &file, options),
        [b'C', b'D', b'F', 1 | 2 | 5, ..] | [0x89, b'H', b'D', b'F', ..] => {
            Ok(vec![netcdf::open(path, &file, options)?])
        }
        [] => Err(SourceError::damaged(&file, "it is empty")),
        _ => Err(SourceError::refused(
            &file,
            "it is none of the formats that this program reads (GeoTIFF, .hgt, .hgt in a zip archive, PNG, JPEG, NetCDF)",
            "Convert it, for example with gdal_translate -of COG, or describe it with --raw if it is a plain grid of numbers.",
        )),
    }
}

fn read_start(path: &Path, start: &mut [u8]) -> std::io::Result<usize> {
    use std::io::Read;
    let mut file = std::fs::File::open(path)?;
    let mut length = 0;
    while length < start.len() {
        match file.read(&mut start[length..])? {
            0 => break,
            read => length += read,
        }
    }
    Ok(length)
}

/// The refusal of a source that says nothing about where it lies.
pub(crate) fn without_georeference(file: &str) -> SourceError {
    SourceError::refused(
        file,
        "it does not say where on the planet it lies",
        "Give its extent in degrees: --extent WEST,SOUTH,EAST,NORTH (a map of the whole globe has -180,-90,180,90).",
    )
}

/// The refusal of a source that cannot lie where it is said to lie.
pub(crate) fn badly_placed(file: &str, clause: String) -> SourceError {
    SourceError::refused(
        file,
        clause,
        "Correct its georeference (with gdal_edit, for example), or the extent or system that was given.",
    )
}
