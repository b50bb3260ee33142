//! GeoTIFF and cloud-optimised GeoTIFF.
//! In: a file in strips or tiles, with the compressions and sample types that the `tiff` crate decodes exactly.
//! Out: a source whose chunks are the file's own, of its first image; overviews are ignored. What cannot be read
//! right is refused when the file is opened.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;

use tiles::Kind;

use super::pixels::{Bands, Colour, Number, RawSamples};
use super::raw::Rows;
use super::reading::Reading;
use super::tiff_directory::{Directories, tag};
use super::tiff_image::{Image, Layout, Opener};
use super::tiff_tags::{Tags, cut_off, gdal_item, palette};
use super::{Description, Pixels, Raster, Source, badly_placed, without_georeference};
use crate::crs::Crs;
use crate::error::SourceError;
use crate::geokeys::GeoTags;
use crate::grid::Grid;
use crate::options::ImportOptions;

const JPEG: u32 = 7;
pub(super) const NO_COMPRESSION: u32 = 1;
const LZW: u32 = 5;

/// Opens a GeoTIFF.
pub(super) fn open(
    path: &Path,
    file: &str,
    options: &ImportOptions,
) -> Result<Source, SourceError> {
    let directories = Directories::scan(path).map_err(|error| cut_off(file, &error))?;
    let Some(first) = directories.list.first() else {
        return Err(SourceError::damaged(file, "the TIFF holds no image"));
    };
    check_compression(
        file,
        first.single(tag::COMPRESSION).unwrap_or(NO_COMPRESSION),
    )?;
    check_photometric(
        file,
        first.single(tag::PHOTOMETRIC),
        first.single(tag::COMPRESSION),
    )?;
    let subfile = |index: usize| directories.list.get(index)?.single(tag::SUBFILE_TYPE);
    // Bit 2 marks a mask, bit 0 a reduced image.
    let mask = (1..directories.list.len()).find(|index| {
        subfile(*index).is_some_and(|t| t & 5 == 4)
            && directories.size(*index) == directories.size(0)
    });
    let compression = first.single(tag::COMPRESSION).unwrap_or(NO_COMPRESSION);
    let opener = Opener {
        path: path.to_owned(),
        file: file.to_owned(),
        directories,
    };
    let mut decoder = opener.decoder(0)?;
    let mut tags = Tags {
        file,
        decoder: &mut decoder,
    };
    let layout = Layout::of(&mut tags, opener.directories.size(0), file)?;
    let bands = bands_of(&mut tags, &layout, &opener.directories)?;
    let reading = Reading::choose(file, bands, options)?;
    let geo = tags.geo_tags()?;
    let grid = place(file, &geo, &layout, options)?;
    let (scale, offset) = height_scale(&mut tags, &geo, options)?;
    let (offsets, counts) = tags.chunk_places(layout.tiled)?;
    check_length(path, file, &offsets, &counts)?;
    if compression == LZW {
        check_lzw(path, file, &offsets, &counts)?;
    }
    let chunk_bytes = layout.chunk_bytes();
    let limit = (options.memory_bytes / 4).min(256 << 20);
    if chunk_bytes > limit {
        let contiguous = offsets
            .iter()
            .zip(&counts)
            .map(|(o, c)| o + c)
            .zip(offsets.iter().skip(1));
        let plain = compression == NO_COMPRESSION
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
            format!(
                "its strips or tiles unpack to {} MiB each, more than the memory given allows",
                chunk_bytes >> 20
            ),
            "Cut it into tiles first: gdal_translate -co TILED=YES -co COMPRESS=DEFLATE IN OUT.",
        ));
    }
    let description = Description {
        file: file.to_owned(),
        grid,
        channels: reading.channels(),
        integer: layout.number.is_integer(),
        sample_type: reading.sample_type(),
        scale,
        offset,
        chunk: (layout.chunk_width, layout.chunk_height),
        chunk_bytes: u64::from(layout.chunk_width)
            * u64::from(layout.chunk_height)
            * reading.bytes_a_pixel() as u64,
    };
    let absent = counts
        .contains(&0)
        .then(|| counts.iter().map(|count| *count == 0).collect());
    let empty_is_void = options.nodata.is_some() || tags.nodata()?.is_some();
    let mask = match mask {
        Some(index) => Some(Image::of_mask(&opener, index)?),
        None => None,
    };
    let image = Image::new(0, layout, decoder);
    let raster = GeoTiff {
        opener,
        image,
        mask,
        reading,
        absent,
        empty_is_void,
    };
    Ok(Source::new(description, Box::new(raster)))
}

pub(super) fn check_compression(file: &str, number: u32) -> Result<(), SourceError> {
    let name = match number {
        NO_COMPRESSION | LZW | JPEG | 8 | 32946 | 32773 | 50000 => return Ok(()),
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
        format!(
            "its colours are {name}, which this program does not turn into red, green and blue"
        ),
        "Convert it, for example with an image editor or gdal_translate, to greys or RGB.",
    ))
}

fn bands_of(
    tags: &mut Tags<'_, '_>,
    layout: &Layout,
    directories: &Directories,
) -> Result<Bands, SourceError> {
    let photometric = directories
        .list
        .first()
        .and_then(|d| d.single(tag::PHOTOMETRIC));
    let colour = match photometric {
        Some(0) => Colour::WhiteIsZero,
        Some(2) => Colour::Rgb,
        Some(3) => Colour::Palette(palette(&tags.numbers(320)?)),
        Some(6) => Colour::YCbCr,
        _ => Colour::Plain,
    };
    let extra = tags.numbers(338)?;
    let first_extra = layout.samples.saturating_sub(extra.len());
    let alpha = extra
        .iter()
        .position(|kind| matches!(kind, 1 | 2))
        .map(|at| first_extra + at);
    let wide = matches!(colour, Colour::Rgb | Colour::YCbCr);
    if wide && first_extra < 3 {
        return Err(SourceError::damaged(
            tags.file,
            "an RGB TIFF has fewer than three bands",
        ));
    }
    let nodata = tags.nodata()?;
    Ok(Bands {
        count: layout.samples,
        number: layout.number,
        colour,
        alpha,
        nodata,
    })
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
    let registered = options
        .node_registered
        .unwrap_or_else(|| geo.pixel_is_point());
    let to_crs = if registered {
        affine
    } else {
        affine.moved(0.5, 0.5)
    };
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
    let band = options
        .bands
        .as_ref()
        .and_then(|bands| bands.first())
        .map_or(0, |band| band - 1);
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

pub(super) fn check_length(
    path: &Path,
    file: &str,
    offsets: &[u64],
    counts: &[u64],
) -> Result<(), SourceError> {
    let length = std::fs::metadata(path)
        .map_err(|e| SourceError::unreadable(file, e))?
        .len();
    let end = offsets
        .iter()
        .zip(counts)
        .map(|(o, c)| o.saturating_add(*c))
        .max()
        .unwrap_or(0);
    if end > length {
        return Err(SourceError::damaged(
            file,
            format!("the TIFF is cut off: its samples end at byte {end}, the file at {length}"),
        ));
    }
    Ok(())
}

/// Writers before 1992 packed LZW from the low bits; such a stream begins with 0 and an odd byte.
fn check_lzw(path: &Path, file: &str, offsets: &[u64], counts: &[u64]) -> Result<(), SourceError> {
    let unreadable = |error| SourceError::unreadable(file, error);
    let Some((offset, _)) = offsets.iter().zip(counts).find(|(_, count)| **count > 1) else {
        return Ok(());
    };
    let mut start = [0; 2];
    let mut opened = File::open(path).map_err(unreadable)?;
    opened.seek(SeekFrom::Start(*offset)).map_err(unreadable)?;
    opened.read_exact(&mut start).map_err(unreadable)?;
    if start[0] == 0 && start[1] & 1 == 1 {
        return Err(SourceError::refused(
            file,
            "its LZW compression is of the old kind, which this program does not read",
            "Convert it: gdal_translate -co COMPRESS=DEFLATE -co TILED=YES IN OUT.",
        ));
    }
    Ok(())
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
        self.absent
            .as_ref()
            .is_some_and(|a| a.get(chunk as usize).copied().unwrap_or(true))
    }

    /// Which pixels of a rectangle the file's mask lets through.
    fn mask_of(
        &self,
        mask: &Image,
        x: u32,
        y: u32,
        w: u32,
        h: u32,
    ) -> Result<Vec<bool>, SourceError> {
        let layout = &mask.layout;
        let mut valid = vec![false; w as usize * h as usize];
        for chunk_row in y / layout.chunk_height..=(y + h - 1) / layout.chunk_height {
            for chunk_column in x / layout.chunk_width..=(x + w - 1) / layout.chunk_width {
                let chunk = chunk_row * layout.across + chunk_column;
                let (cw, ch, raw) = mask.decode(&self.opener, chunk)?;
                let RawSamples::U8(numbers) = raw else {
                    continue;
                };
                let (left, top) = (
                    chunk_column * layout.chunk_width,
                    chunk_row * layout.chunk_height,
                );
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
            let (row_pixels, _, raw) = self.image.decode(&self.opener, chunk)?;
            let samples = |pixels: u32| pixels as usize * layout.samples;
            raw.cut(samples(row_pixels), samples(width), height as usize)
        };
        Ok(self.reading.pixels(width, height, raw, mask))
    }
}
