//! GeoTIFF and cloud-optimised GeoTIFF.
//! In: a file in strips or tiles, with the compressions and sample types that the `tiff` crate decodes exactly.
//! Out: a source whose chunks are the file's own, of its first image; overviews are ignored. What cannot be read
//! right is refused when the file is opened.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use tiff::TiffError;
use tiff::decoder::{ChunkType, Decoder, DecodingResult, Limits, ifd};
use tiff::tags::Tag;
use tiles::Kind;

use super::pixels::{Alpha, Bands, Colour, Number, RawSamples, Reading};
use super::raw::Rows;
use super::tiff_directory::{Directories, Plain, tag};
use super::{Description, Pixels, Raster, SampleWidth, Source, badly_placed, without_georeference};
use crate::crs::Crs;
use crate::error::SourceError;
use crate::geokeys::GeoTags;
use crate::grid::Grid;
use crate::options::{Endianness, ImportOptions};

const JPEG: u32 = 7;
const NO_COMPRESSION: u32 = 1;

/// Opens a GeoTIFF.
pub(super) fn open(path: &Path, file: &str, options: &ImportOptions) -> Result<Source, SourceError> {
    let directories = Directories::scan(path).map_err(|error| cut_off(file, &error))?;
    let Some(first) = directories.list.first() else {
        return Err(SourceError::damaged(file, "the TIFF holds no image"));
    };
    check_compression(file, first.single(tag::COMPRESSION).unwrap_or(NO_COMPRESSION))?;
    check_photometric(file, first.single(tag::PHOTOMETRIC), first.single(tag::COMPRESSION))?;
    let subfile = |index: usize| directories.list.get(index)?.single(tag::SUBFILE_TYPE);
    let size_of = |index: usize| {
        let directory = directories.list.get(index)?;
        Some((directory.single(tag::WIDTH)?, directory.single(tag::HEIGHT)?))
    };
    // Bit 2 marks a mask, bit 0 a reduced image.
    let mask = (1..directories.list.len())
        .find(|index| subfile(*index).is_some_and(|t| t & 5 == 4) && size_of(*index) == size_of(0));
    let opener = Opener { path: path.to_owned(), file: file.to_owned(), directories };
    let mut decoder = opener.decoder(0)?;
    let mut tags = Tags { file, decoder: &mut decoder };
    let layout = Layout::of(&mut tags, file)?;
    let bands = bands_of(&mut tags, &layout, &opener.directories)?;
    let reading = Reading::choose(file, bands, options)?;
    let geo = tags.geo_tags()?;
    let grid = place(file, &geo, &layout, options)?;
    let (scale, offset) = height_scale(&mut tags, &geo, options)?;
    let (offsets, counts) = tags.chunk_places(layout.tiled)?;
    check_length(path, file, &offsets, &counts)?;
    let chunk_bytes = layout.chunk_bytes();
    let limit = (options.memory_bytes / 4).min(256 << 20);
    if chunk_bytes > limit {
        let contiguous = offsets.iter().zip(&counts).map(|(o, c)| o + c).zip(offsets.iter().skip(1));
        let plain = first_compression(&opener) == NO_COMPRESSION
            && !layout.tiled
            && !layout.planar
            && layout.whole_bytes
            && mask.is_none()
            && contiguous.into_iter().all(|(end, next)| end == *next);
        if let (true, Some(first_byte)) = (plain, offsets.first()) {
            let endianness = layout.endianness;
            let opened = File::open(path).map_err(|e| SourceError::unreadable(file, e))?;
            let rows = Rows::new(opened, file, &grid, *first_byte, endianness, reading);
            return Ok(rows.into_source(grid, scale, offset));
        }
        return Err(SourceError::refused(
            file,
            format!("its strips or tiles unpack to {} MiB each, more than the memory given allows", chunk_bytes >> 20),
            "Cut it into tiles first: gdal_translate -co TILED=YES -co COMPRESS=DEFLATE IN OUT.",
        ));
    }
    let description = Description {
        file: file.to_owned(),
        grid,
        channels: reading.channels(),
        integer: layout.number.is_integer(),
        wide: SampleWidth::of(layout.number),
        scale,
        offset,
        chunk: (layout.chunk_width, layout.chunk_height),
        chunk_bytes: u64::from(layout.chunk_width)
            * u64::from(layout.chunk_height)
            * reading.bytes_a_pixel() as u64,
    };
    let absent = counts.contains(&0).then(|| counts.iter().map(|count| *count == 0).collect());
    let empty_is_void = options.nodata.is_some() || tags.nodata()?.is_some();
    let mask = match mask {
        Some(index) => Some(Image::of_mask(&opener, index)?),
        None => None,
    };
    let image = Image { index: 0, layout, idle: Mutex::new(vec![decoder]) };
    let raster = GeoTiff { opener, image, mask, reading, absent, empty_is_void };
    Ok(Source::new(description, Box::new(raster)))
}

fn first_compression(opener: &Opener) -> u32 {
    let first = opener.directories.list.first();
    first.and_then(|directory| directory.single(tag::COMPRESSION)).unwrap_or(NO_COMPRESSION)
}

fn check_compression(file: &str, number: u32) -> Result<(), SourceError> {
    let name = match number {
        NO_COMPRESSION | 5 | JPEG | 8 | 32946 | 32773 | 50000 => return Ok(()),
        2..=4 => "fax (CCITT)",
        6 => "old-style JPEG",
        34676 | 34677 => "SGI log",
        34887 => "LERC",
        34925 => "LZMA",
        34712 => "JPEG 2000",
        50001 => "WebP",
        50002 | 52546 => "JPEG XL",
        _ => "unknown",
    };
    Err(SourceError::refused(
        file,
        format!("its compression ({name}, number {number}) is not read by this program"),
        "Convert it: gdal_translate -co COMPRESS=DEFLATE -co TILED=YES IN OUT.",
    ))
}

fn check_photometric(
    file: &str,
    number: Option<u32>,
    compression: Option<u32>,
) -> Result<(), SourceError> {
    let name = match number {
        Some(0..=3) => return Ok(()),
        Some(6) if compression == Some(JPEG) => return Ok(()),
        Some(6) => "YCbCr without JPEG",
        Some(4) => "a transparency mask alone",
        Some(5) => "CMYK",
        Some(8..=10) => "L*a*b*",
        Some(32803 | 34892) => "raw sensor data",
        Some(32844 | 32845) => "LogL or LogLuv",
        Some(_) => "of an unknown kind",
        None => "not stated",
    };
    Err(SourceError::refused(
        file,
        format!("its colours are {name}, which this program does not turn into red, green and blue"),
        "Convert it, for example with an image editor or gdal_translate, to greys or RGB.",
    ))
}

fn cut_off(file: &str, error: &std::io::Error) -> SourceError {
    SourceError::damaged(file, format!("its TIFF directories cannot be read ({error})"))
}

fn explain(file: &str, error: TiffError) -> SourceError {
    match error {
        TiffError::IoError(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
            SourceError::damaged(file, "the TIFF is cut off")
        }
        TiffError::IoError(error) => {
            SourceError::damaged(file, format!("it cannot be unpacked ({error})"))
        }
        TiffError::FormatError(error) => SourceError::damaged(file, format!("bad TIFF: {error}")),
        other => SourceError::refused(
            file,
            format!("this kind of TIFF is not read by this program ({other})"),
            "Convert it: gdal_translate -co COMPRESS=DEFLATE -co TILED=YES IN OUT.",
        ),
    }
}

/// The shape of one image of the file and of its chunks.
#[derive(Clone, Debug)]
struct Layout {
    width: u32,
    height: u32,
    chunk_width: u32,
    chunk_height: u32,
    across: u32,
    down: u32,
    tiled: bool,
    planar: bool,
    samples: usize,
    bits: u32,
    number: Number,
    /// Samples lie in the file as `number` says, without half floats or wide integers.
    whole_bytes: bool,
    endianness: Endianness,
}

impl Layout {
    fn of(tags: &mut Tags<'_, '_>, file: &str) -> Result<Self, SourceError> {
        let (width, height) = tags.decoder.dimensions().map_err(|e| explain(file, e))?;
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
                    format!("its samples are {kind} of {bits} bits, which this program does not read"),
                    "Convert it: gdal_translate -ot Float32 IN OUT (for imagery -ot Byte -scale).",
                ));
            }
        };
        let tiled = tags.decoder.get_chunk_type() == ChunkType::Tile;
        let (chunk_width, chunk_height) = tags.decoder.chunk_dimensions();
        let chunk_height = if tiled { chunk_height } else { chunk_height.min(height) };
        if samples == 0 || chunk_width == 0 || chunk_height == 0 {
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
    fn chunk_bytes(&self) -> u64 {
        let samples = if self.planar { 1 } else { self.samples as u64 };
        let bits = u64::from(self.bits.max(8));
        u64::from(self.chunk_width) * u64::from(self.chunk_height) * samples * bits / 8
    }
}

fn bands_of(
    tags: &mut Tags<'_, '_>,
    layout: &Layout,
    directories: &Directories,
) -> Result<Bands, SourceError> {
    let photometric = directories.list.first().and_then(|d| d.single(tag::PHOTOMETRIC));
    let colour = match photometric {
        Some(0) => Colour::WhiteIsZero,
        Some(2) => Colour::Rgb,
        Some(3) => Colour::Palette(palette(&tags.numbers(320)?)),
        Some(6) => Colour::YCbCr,
        _ => Colour::Plain,
    };
    let extra = tags.numbers(338)?;
    let first_extra = layout.samples.saturating_sub(extra.len());
    let alpha = extra.iter().position(|kind| matches!(kind, 1 | 2)).map(|position| Alpha {
        band: first_extra + position,
        premultiplied: extra.get(position) == Some(&1),
    });
    let wide = matches!(colour, Colour::Rgb | Colour::YCbCr);
    if wide && first_extra < 3 {
        return Err(SourceError::damaged(tags.file, "an RGB TIFF has fewer than three bands"));
    }
    let nodata = tags.nodata()?;
    Ok(Bands { count: layout.samples, number: layout.number, colour, alpha, nodata })
}

/// A colour table: all reds, all greens, all blues, 16 bits each. Some writers fill only the lower 8.
fn palette(numbers: &[u32]) -> Vec<[u8; 3]> {
    let entries = numbers.len() / 3;
    let shift = if numbers.iter().all(|n| *n < 256) { 0 } else { 8 };
    let part = |index: usize| numbers.get(index).map_or(0, |n| (n >> shift) as u8);
    (0..entries).map(|i| [part(i), part(entries + i), part(2 * entries + i)]).collect()
}

fn place(
    file: &str,
    geo: &GeoTags,
    layout: &Layout,
    options: &ImportOptions,
) -> Result<Grid, SourceError> {
    let (width, height) = (layout.width, layout.height);
    if !geo.are_present() {
        let extent = options.extent.ok_or_else(|| without_georeference(file))?;
        let registered = options.node_registered.unwrap_or(false);
        return Grid::of_extent(width, height, extent, registered)
            .map_err(|clause| badly_placed(file, clause));
    }
    let unplaced = |clause| badly_placed(file, clause);
    let affine = geo.affine().map_err(unplaced)?;
    let crs = match &options.crs {
        Some(text) => Crs::parse(text, &options.planet),
        None => geo.crs(&options.planet),
    };
    let crs = crs.map_err(|problem| {
        SourceError::refused(
            file,
            problem.0,
            "State it with --crs EPSG:number or a PROJ string, or reproject: gdalwarp -t_srs EPSG:4326 IN OUT.",
        )
    })?;
    let registered = options.node_registered.unwrap_or_else(|| geo.pixel_is_point());
    let to_crs = if registered { affine } else { affine.moved(0.5, 0.5) };
    Grid::new(width, height, Arc::new(crs), to_crs, registered).map_err(unplaced)
}

/// Metres a sample: GDAL's scale and offset, and feet where the file says so.
fn height_scale(
    tags: &mut Tags<'_, '_>,
    geo: &GeoTags,
    options: &ImportOptions,
) -> Result<(f64, f64), SourceError> {
    if options.kind != Kind::Elevation {
        return Ok((1.0, 0.0));
    }
    let band = options.bands.as_ref().and_then(|bands| bands.first()).map_or(0, |band| band - 1);
    let metadata = tags.text(42112)?.unwrap_or_default();
    let number = |role| gdal_item(&metadata, role, band).and_then(|text| text.trim().parse().ok());
    let scale: f64 = number("scale").unwrap_or(1.0);
    let offset: f64 = number("offset").unwrap_or(0.0);
    let unit = match gdal_item(&metadata, "unittype", band) {
        Some("ft" | "foot" | "feet") => 0.3048,
        Some("US survey foot" | "us-ft" | "ftUS") => 1200.0 / 3937.0,
        _ => geo.vertical_unit_m(),
    };
    Ok((scale * unit, offset * unit))
}

/// The text of an item of GDAL's metadata with this role and band (counted from 0).
fn gdal_item<'text>(metadata: &'text str, role: &str, band: usize) -> Option<&'text str> {
    let role = format!("role=\"{role}\"");
    let sample = format!("sample=\"{band}\"");
    for item in metadata.split("<Item").skip(1) {
        let (attributes, rest) = item.split_once('>')?;
        if attributes.contains(&role) && attributes.contains(&sample) {
            return rest.split_once("</Item>").map(|(text, _)| text);
        }
    }
    None
}

fn check_length(path: &Path, file: &str, offsets: &[u64], counts: &[u64]) -> Result<(), SourceError> {
    let length = std::fs::metadata(path).map_err(|e| SourceError::unreadable(file, e))?.len();
    let end = offsets.iter().zip(counts).map(|(o, c)| o.saturating_add(*c)).max().unwrap_or(0);
    if end > length {
        return Err(SourceError::damaged(
            file,
            format!("the TIFF is cut off: its samples end at byte {end}, the file at {length}"),
        ));
    }
    Ok(())
}

/// Tags of the image that a decoder stands at.
struct Tags<'name, 'decoder> {
    file: &'name str,
    decoder: &'decoder mut Decoder<Plain>,
}

impl Tags<'_, '_> {
    fn value(&mut self, number: u16) -> Result<Option<ifd::Value>, SourceError> {
        self.decoder
            .find_tag(Tag::from_u16_exhaustive(number))
            .map_err(|error| explain(self.file, error))
    }

    fn numbers(&mut self, number: u16) -> Result<Vec<u32>, SourceError> {
        let Some(value) = self.value(number)? else { return Ok(Vec::new()) };
        value.into_u32_vec().map_err(|error| explain(self.file, error))
    }

    fn number(&mut self, number: u16) -> Result<Option<u32>, SourceError> {
        Ok(self.numbers(number)?.first().copied())
    }

    fn doubles(&mut self, number: u16) -> Result<Vec<f64>, SourceError> {
        let Some(value) = self.value(number)? else { return Ok(Vec::new()) };
        value.into_f64_vec().map_err(|error| explain(self.file, error))
    }

    fn text(&mut self, number: u16) -> Result<Option<String>, SourceError> {
        let Some(value) = self.value(number)? else { return Ok(None) };
        let text = match value {
            ifd::Value::Ascii(text) => text,
            other => match other.into_u8_vec() {
                Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
                Err(_) => return Ok(None),
            },
        };
        Ok(Some(text.trim_end_matches('\0').to_owned()))
    }

    fn nodata(&mut self) -> Result<Option<f64>, SourceError> {
        Ok(self.text(42113)?.and_then(|text| text.trim().parse().ok()))
    }

    fn geo_tags(&mut self) -> Result<GeoTags, SourceError> {
        let directory = self.numbers(34735)?.into_iter().map(|n| n as u16).collect();
        Ok(GeoTags {
            pixel_scale: self.doubles(33550)?,
            tie_points: self.doubles(33922)?,
            transformation: self.doubles(34264)?,
            directory,
            doubles: self.doubles(34736)?,
            ascii: self.text(34737)?.unwrap_or_default(),
        })
    }

    fn chunk_places(&mut self, tiled: bool) -> Result<(Vec<u64>, Vec<u64>), SourceError> {
        let (offsets, counts) = if tiled { (324, 325) } else { (273, 279) };
        let mut list = |number| {
            let Some(value) = self.value(number)? else { return Ok(Vec::new()) };
            value.into_u64_vec().map_err(|error| explain(self.file, error))
        };
        Ok((list(offsets)?, list(counts)?))
    }
}

/// Opens decoders of one file.
struct Opener {
    path: PathBuf,
    file: String,
    directories: Directories,
}

impl Opener {
    fn decoder(&self, image: usize) -> Result<Decoder<Plain>, SourceError> {
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
struct Image {
    index: usize,
    layout: Layout,
    idle: Mutex<Vec<Decoder<Plain>>>,
}

impl Image {
    fn of_mask(opener: &Opener, index: usize) -> Result<Self, SourceError> {
        let mut decoder = opener.decoder(index)?;
        let mut tags = Tags { file: &opener.file, decoder: &mut decoder };
        let compression = tags.number(tag::COMPRESSION)?.unwrap_or(NO_COMPRESSION);
        check_compression(&opener.file, compression)?;
        let layout = Layout::of(&mut tags, &opener.file)?;
        if layout.samples != 1 || !matches!(layout.number, Number::Bits(1 | 8)) {
            return Err(SourceError::refused(
                &opener.file,
                "its mask is neither of 1 nor of 8 bits",
                "Convert it: gdal_translate IN OUT.",
            ));
        }
        let (offsets, counts) = tags.chunk_places(layout.tiled)?;
        check_length(&opener.path, &opener.file, &offsets, &counts)?;
        Ok(Self { index, layout, idle: Mutex::new(vec![decoder]) })
    }

    /// The numbers of one chunk of one plane, and the columns and rows it really has.
    fn decode(&self, opener: &Opener, chunk: u32) -> Result<(u32, u32, RawSamples), SourceError> {
        let idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut decoder = match idle {
            Some(decoder) => decoder,
            None => opener.decoder(self.index)?,
        };
        let (width, height) = decoder.chunk_data_dimensions(chunk);
        let result = decoder.read_chunk(chunk).map_err(|error| explain(&opener.file, error))?;
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(decoder);
        Ok((width, height, self.unpacked(width, height, result)))
    }

    fn unpacked(&self, width: u32, height: u32, result: DecodingResult) -> RawSamples {
        match result {
            DecodingResult::U8(v) if self.layout.bits < 8 => {
                let samples = if self.layout.planar { 1 } else { self.layout.samples };
                RawSamples::U8(bits_apart(&v, width as usize * samples, height, self.layout.bits))
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

struct GeoTiff {
    opener: Opener,
    image: Image,
    mask: Option<Image>,
    reading: Reading,
    /// Chunks that were left out of a sparse file.
    absent: Option<Vec<bool>>,
    empty_is_void: bool,
}

impl GeoTiff {
    fn is_absent(&self, chunk: u32) -> bool {
        self.absent.as_ref().is_some_and(|a| a.get(chunk as usize).copied().unwrap_or(true))
    }

    /// Which pixels of a rectangle the file's mask lets through.
    fn mask_of(&self, mask: &Image, x: u32, y: u32, w: u32, h: u32) -> Result<Vec<bool>, SourceError> {
        let layout = &mask.layout;
        let mut valid = vec![false; w as usize * h as usize];
        for chunk_row in y / layout.chunk_height..=(y + h - 1) / layout.chunk_height {
            for chunk_column in x / layout.chunk_width..=(x + w - 1) / layout.chunk_width {
                let chunk = chunk_row * layout.across + chunk_column;
                let (cw, ch, raw) = mask.decode(&self.opener, chunk)?;
                let RawSamples::U8(numbers) = raw else { continue };
                let (left, top) = (chunk_column * layout.chunk_width, chunk_row * layout.chunk_height);
                for row in y.max(top)..(y + h).min(top + ch) {
                    for column in x.max(left)..(x + w).min(left + cw) {
                        let from = (row - top) as usize * cw as usize + (column - left) as usize;
                        let to = (row - y) as usize * w as usize + (column - x) as usize;
                        let number = numbers.get(from).copied().unwrap_or(0);
                        if let Some(target) = valid.get_mut(to) {
                            *target = number != 0;
                        }
                    }
                }
            }
        }
        Ok(valid)
    }

    /// The chunks of all planes that are needed, interleaved by pixel.
    fn interleaved(&self, chunk: u32, width: u32, height: u32) -> Result<RawSamples, SourceError> {
        let layout = &self.image.layout;
        let mut planes = Vec::with_capacity(layout.samples);
        for band in 0..layout.samples {
            let plane_chunk = chunk + band as u32 * layout.across * layout.down;
            let needed = self.reading.needs(band) && !self.is_absent(plane_chunk);
            planes.push(if needed {
                Some(self.image.decode(&self.opener, plane_chunk)?)
            } else {
                None
            });
        }
        macro_rules! weave {
            ($($variant:ident),*) => {
                match planes.iter().flatten().next() {
                    $(Some((_, _, RawSamples::$variant(_))) => {
                        let mut woven = vec![Default::default(); width as usize * height as usize * layout.samples];
                        for (band, plane) in planes.iter().enumerate() {
                            // A plane's chunk may come with padding rows below; rows are as wide as the first plane's.
                            if let Some((w, _, RawSamples::$variant(values))) = plane {
                                for (row, line) in values.chunks(*w as usize).take(height as usize).enumerate() {
                                    for (column, value) in line.iter().take(width as usize).enumerate() {
                                        let pixel = row * width as usize + column;
                                        if let Some(target) = woven.get_mut(pixel * layout.samples + band) {
                                            *target = *value;
                                        }
                                    }
                                }
                            }
                        }
                        RawSamples::$variant(woven)
                    })*
                    None => zeros(layout.number, width as usize * height as usize * layout.samples),
                }
            };
        }
        Ok(weave!(U8, I8, U16, I16, U32, I32, F32, F64))
    }
}

fn zeros(number: Number, count: usize) -> RawSamples {
    match number {
        Number::Bits(_) => RawSamples::U8(vec![0; count]),
        Number::I8 => RawSamples::I8(vec![0; count]),
        Number::U16 => RawSamples::U16(vec![0; count]),
        Number::I16 => RawSamples::I16(vec![0; count]),
        Number::U32 => RawSamples::U32(vec![0; count]),
        Number::I32 => RawSamples::I32(vec![0; count]),
        Number::F32 => RawSamples::F32(vec![0.0; count]),
        Number::F64 => RawSamples::F64(vec![0.0; count]),
    }
}

impl Raster for GeoTiff {
    fn read(&self, column: u32, row: u32) -> Result<Pixels, SourceError> {
        let layout = &self.image.layout;
        let chunk = row * layout.across + column;
        let (x, y) = (column * layout.chunk_width, row * layout.chunk_height);
        let width = layout.chunk_width.min(layout.width.saturating_sub(x));
        let height = layout.chunk_height.min(layout.height.saturating_sub(y));
        let mut mask = match &self.mask {
            Some(image) => Some(self.mask_of(image, x, y, width, height)?),
            None => None,
        };
        let raw = if layout.planar {
            self.interleaved(chunk, width, height)?
        } else if self.is_absent(chunk) {
            let pixels = width as usize * height as usize;
            if self.empty_is_void {
                mask = Some(vec![false; pixels]);
            }
            zeros(layout.number, pixels * layout.samples)
        } else {
            self.image.decode(&self.opener, chunk)?.2
        };
        Ok(self.reading.pixels(width, height, raw, mask))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_come_from_the_highest() {
        assert_eq!(bits_apart(&[0b1010_0000, 0b1100_0000], 3, 2, 1), [1, 0, 1, 1, 1, 0]);
        assert_eq!(bits_apart(&[0x12, 0x30], 3, 1, 4), [1, 2, 3]);
    }

    #[test]
    fn gdal_items_are_found_by_role_and_band() {
        let text = "<GDALMetadata>\n <Item name=\"OFFSET\" sample=\"0\" role=\"offset\">100</Item>\n\
                    <Item name=\"SCALE\" sample=\"1\" role=\"scale\">0.01</Item></GDALMetadata>";
        assert_eq!(gdal_item(text, "offset", 0), Some("100"));
        assert_eq!(gdal_item(text, "scale", 1), Some("0.01"));
        assert_eq!(gdal_item(text, "scale", 0), None);
    }
}
