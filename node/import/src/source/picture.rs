//! PNG and JPEG pictures with a stated extent.
//! In: a file and the rectangle it shows. Out: a source. A picture is unpacked at once where memory allows;
//! a larger PNG is unpacked row by row into a temporary file beside the repository.

use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use image::{ColorType, ImageDecoder, ImageReader};

use super::pixels::{Bands, Colour, Number, RawSamples};
use super::raw::Rows;
use super::reading::Reading;
use super::{Description, Pixels, Raster, Source, badly_placed, without_georeference};
use crate::error::SourceError;
use crate::grid::Grid;
use crate::options::{Endianness, ImportOptions};

/// Bytes at the end of a JPEG among which its end marker must be.
const JPEG_TAIL: u64 = 1 << 16;

/// Opens a picture.
pub(super) fn open(
    path: &Path,
    file: &str,
    options: &ImportOptions,
) -> Result<Source, SourceError> {
    let extent = options.extent.ok_or_else(|| without_georeference(file))?;
    if options.crs.is_some() {
        return Err(SourceError::refused(
            file,
            "a picture is placed in degrees, and --crs names another coordinate system",
            "Write it as a GeoTIFF in that system: gdal_translate -a_srs CRS -a_ullr ULX ULY LRX LRY IN OUT.",
        ));
    }
    let jpeg = is_jpeg(path).map_err(|error| SourceError::unreadable(file, error))?;
    if jpeg && !jpeg_ends(path).map_err(|error| SourceError::unreadable(file, error))? {
        return Err(SourceError::damaged(
            file,
            "the JPEG is cut off: it has no end marker",
        ));
    }
    let decoder = decoder(path, file)?;
    let (width, height) = decoder.dimensions();
    let bytes = decoder.total_bytes();
    let (count, number, alpha) = match decoder.color_type() {
        ColorType::L8 => (1, Number::Bits(8), false),
        ColorType::La8 => (2, Number::Bits(8), true),
        ColorType::Rgb8 => (3, Number::Bits(8), false),
        ColorType::Rgba8 => (4, Number::Bits(8), true),
        ColorType::L16 => (1, Number::U16, false),
        ColorType::La16 => (2, Number::U16, true),
        ColorType::Rgb16 => (3, Number::U16, false),
        ColorType::Rgba16 => (4, Number::U16, true),
        other => {
            return Err(SourceError::refused(
                file,
                format!("its samples are {other:?}, which this program does not read"),
                "Convert it to greys or RGB of 8 or 16 bits.",
            ));
        }
    };
    drop(decoder);
    let colour = if count >= 3 {
        Colour::Rgb
    } else {
        Colour::Plain
    };
    let alpha = alpha.then_some(count - 1);
    let reading = Reading::choose(
        file,
        Bands {
            count,
            number,
            colour,
            alpha,
            nodata: None,
        },
        options,
    )?;
    let registered = options.node_registered.unwrap_or(false);
    let grid = Grid::of_extent(width, height, extent, registered)
        .map_err(|clause| badly_placed(file, clause))?;
    let unpacked = u64::from(width) * u64::from(height) * reading.bytes_a_pixel() as u64;
    if bytes.max(unpacked) > options.memory_bytes / 2 {
        if jpeg {
            return Err(SourceError::refused(
                file,
                format!(
                    "a JPEG unpacks only as a whole, here to {} MiB, more than the memory given allows",
                    bytes >> 20
                ),
                "Cut it into tiles first: gdal_translate -co TILED=YES -co COMPRESS=DEFLATE -a_srs EPSG:4326 -a_ullr WEST NORTH EAST SOUTH IN OUT.",
            ));
        }
        let unpacked = unpack_png(path, file, options)?;
        let endianness = Endianness::Big;
        return Ok(
            Rows::new(unpacked, file, &grid, 0, endianness, reading).into_source(grid, 1.0, 0.0)
        );
    }
    let description = Description {
        file: file.to_owned(),
        grid,
        channels: reading.channels(),
        integer: true,
        sample_type: reading.sample_type(),
        scale: 1.0,
        offset: 0.0,
        chunk: (width, height),
        chunk_bytes: unpacked,
    };
    let raster = Picture {
        path: path.to_owned(),
        file: file.to_owned(),
        reading,
    };
    Ok(Source::new(description, Box::new(raster)))
}

fn decoder(path: &Path, file: &str) -> Result<impl ImageDecoder, SourceError> {
    let unreadable = |error| SourceError::unreadable(file, error);
    let mut reader = ImageReader::open(path)
        .and_then(ImageReader::with_guessed_format)
        .map_err(unreadable)?;
    // The size is checked against the memory that was given, before anything is unpacked.
    reader.no_limits();
    reader.into_decoder().map_err(|error| broken(file, &error))
}

fn broken(file: &str, error: &dyn std::error::Error) -> SourceError {
    SourceError::damaged(file, format!("the picture cannot be unpacked ({error})"))
}

fn is_jpeg(path: &Path) -> std::io::Result<bool> {
    let mut start = [0; 2];
    File::open(path)?.read_exact(&mut start)?;
    Ok(start == [0xff, 0xd8])
}

/// Decoders fill up a JPEG that was cut off with grey, so its end is looked for first.
fn jpeg_ends(path: &Path) -> std::io::Result<bool> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(JPEG_TAIL)))?;
    let mut tail = Vec::new();
    file.read_to_end(&mut tail)?;
    Ok(tail.windows(2).any(|pair| pair == [0xff, 0xd9]))
}

/// The rows of a PNG in a temporary file, which the system removes whatever happens.
fn unpack_png(path: &Path, file: &str, options: &ImportOptions) -> Result<File, SourceError> {
    let unreadable = |error| SourceError::unreadable(file, error);
    let opened = BufReader::new(File::open(path).map_err(unreadable)?);
    let mut decoder = png::Decoder::new(opened);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(|error| broken(file, &error))?;
    if reader.info().interlaced {
        return Err(SourceError::refused(
            file,
            "an interlaced PNG unpacks only as a whole, and this one needs more than the memory given allows",
            "Write it without interlacing.",
        ));
    }
    let unwritable = |error: std::io::Error| {
        SourceError::refused(
            file,
            format!(
                "it must be unpacked into {}, and that failed: {error}",
                options.into.display()
            ),
            "Make room there.",
        )
    };
    std::fs::create_dir_all(&options.into).map_err(unwritable)?;
    let mut rows = BufWriter::new(tempfile::tempfile_in(&options.into).map_err(unwritable)?);
    while let Some(row) = reader.next_row().map_err(|error| broken(file, &error))? {
        rows.write_all(row.data()).map_err(unwritable)?;
    }
    rows.into_inner()
        .map_err(|error| unwritable(error.into_error()))
}

struct Picture {
    path: PathBuf,
    file: String,
    reading: Reading,
}

impl Raster for Picture {
    fn read(&self, _column: u32, _row: u32) -> Result<Pixels, SourceError> {
        let decoder = decoder(&self.path, &self.file)?;
        let (width, height) = decoder.dimensions();
        let mut bytes = vec![0; decoder.total_bytes() as usize];
        decoder
            .read_image(&mut bytes)
            .map_err(|error| broken(&self.file, &error))?;
        let raw = if self.reading.number() == Number::U16 {
            let pairs = bytes.as_chunks::<2>().0.iter();
            RawSamples::U16(pairs.map(|pair| u16::from_ne_bytes(*pair)).collect())
        } else {
            RawSamples::U8(bytes)
        };
        Ok(self.reading.pixels(width, height, raw, None))
    }
}
