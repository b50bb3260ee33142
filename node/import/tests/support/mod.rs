//! What the tests of the import share: options, sources made on the spot, values read back from a repository.

#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "each test uses a part; a test that panics has failed"
)]

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use geodesy::{Ellipsoid, LatticePoint, TilePosition};
use import::{ImportError, ImportOptions, ImportReport, Silent, import};
use tiff::encoder::colortype::{self, ColorType};
use tiff::encoder::{TiffEncoder, TiffValue};
use tiff::tags::{ExtraSamples, Tag};
use tiles::{Kind, Repository, TileData};

/// Options with nothing asked for.
pub fn options(kind: Kind, sources: &[PathBuf], into: &Path) -> ImportOptions {
    ImportOptions {
        sources: sources.to_vec(),
        into: into.to_owned(),
        kind,
        extent: None,
        crs: None,
        node_registered: None,
        raw: None,
        nodata: None,
        level: None,
        planet: Ellipsoid::EARTH,
        quantum_m: None,
        name: None,
        bands: None,
        range: None,
        threads: None,
        memory_bytes: 256 << 20,
    }
}

/// Imports without anybody watching.
pub fn run(options: &ImportOptions) -> Result<ImportReport, ImportError> {
    import(options, &Silent, &AtomicBool::new(false))
}

/// The real data beside the repository, where it is present.
pub fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data")
        .join(name);
    path.exists().then_some(path)
}

/// Data that lies with the tests.
pub fn embedded(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

/// Where a GeoTIFF made on the spot lies.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// EPSG number, geographic below 5000 or projected.
    pub epsg: u16,
    pub geographic: bool,
    /// Model coordinates of the first sample's tie point, and the size of a pixel.
    pub x: f64,
    pub y: f64,
    pub dx: f64,
    pub dy: f64,
    /// PixelIsPoint.
    pub point: bool,
}

impl Placement {
    /// Model coordinates of sample (column, row).
    pub fn model(&self, column: f64, row: f64) -> (f64, f64) {
        let half = if self.point { 0.0 } else { 0.5 };
        (
            self.x + (column + half) * self.dx,
            self.y - (row + half) * self.dy,
        )
    }

    /// The sample position of model coordinates.
    pub fn sample(&self, x: f64, y: f64) -> (f64, f64) {
        let half = if self.point { 0.0 } else { 0.5 };
        ((x - self.x) / self.dx - half, (self.y - y) / self.dy - half)
    }
}

/// Writes a GeoTIFF of one band of 32-bit floating-point samples.
pub fn write_geotiff(
    path: &Path,
    width: u32,
    height: u32,
    placement: Placement,
    nodata: Option<f64>,
    value: impl Fn(u32, u32) -> f32,
) {
    let size = (width, height);
    write_bands::<colortype::Gray32Float>(path, size, placement, nodata, &[], |c, r, _| {
        value(c, r)
    });
}

/// Writes a GeoTIFF of the bands that the colour type names and `extra` ones, interleaved by pixel.
pub fn write_bands<C: ColorType>(
    path: &Path,
    size: (u32, u32),
    placement: Placement,
    nodata: Option<f64>,
    extra: &[ExtraSamples],
    value: impl Fn(u32, u32, usize) -> C::Inner,
) where
    [C::Inner]: TiffValue,
{
    let file = std::fs::File::create(path).unwrap();
    let mut encoder = TiffEncoder::new(std::io::BufWriter::new(file)).unwrap();
    write_image::<C, _>(&mut encoder, size, placement, nodata, extra, value);
}

/// One image of [`write_bands`]; others may follow it.
pub fn write_image<C: ColorType, W: std::io::Write + std::io::Seek>(
    encoder: &mut TiffEncoder<W>,
    (width, height): (u32, u32),
    placement: Placement,
    nodata: Option<f64>,
    extra: &[ExtraSamples],
    value: impl Fn(u32, u32, usize) -> C::Inner,
) where
    [C::Inner]: TiffValue,
{
    let mut image = encoder.new_image::<C>(width, height).unwrap();
    if !extra.is_empty() {
        image.extra_samples(extra).unwrap();
    }
    let Placement {
        epsg,
        geographic,
        x,
        y,
        dx,
        dy,
        point,
    } = placement;
    let (model, key) = if geographic { (2, 2048) } else { (1, 3072) };
    let registration = if point { 2 } else { 1 };
    let keys: [u16; 16] = [
        1,
        1,
        0,
        3,
        1024,
        0,
        1,
        model,
        1025,
        0,
        1,
        registration,
        key,
        0,
        1,
        epsg,
    ];
    let tags = image.encoder();
    tags.write_tag(Tag::from_u16_exhaustive(33550), &[dx, dy, 0.0][..])
        .unwrap();
    tags.write_tag(
        Tag::from_u16_exhaustive(33922),
        &[0.0, 0.0, 0.0, x, y, 0.0][..],
    )
    .unwrap();
    tags.write_tag(Tag::from_u16_exhaustive(34735), &keys[..])
        .unwrap();
    if let Some(nodata) = nodata {
        tags.write_tag(Tag::from_u16_exhaustive(42113), nodata.to_string().as_str())
            .unwrap();
    }
    let bands = C::BITS_PER_SAMPLE.len() + extra.len();
    let samples: Vec<C::Inner> = (0..height)
        .flat_map(|row| (0..width).map(move |column| (column, row)))
        .flat_map(|(column, row)| (0..bands).map(move |band| (column, row, band)))
        .map(|(column, row, band)| value(column, row, band))
        .collect();
    let mut rest = &samples[..];
    while image.next_strip_sample_count() > 0 {
        let (strip, after) = rest.split_at(image.next_strip_sample_count() as usize);
        image.write_strip(strip).unwrap();
        rest = after;
    }
    image.finish().unwrap();
}

/// Real data that lies with the tests of the whole.
pub fn real(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/data")
        .join(name)
}

/// Values of a repository, its tiles kept once read.
pub struct Values {
    pub repository: Repository,
    tiles: HashMap<geodesy::Tile, Option<TileData>>,
}

impl Values {
    pub fn open(root: &Path) -> Self {
        Self {
            repository: Repository::open(root).unwrap(),
            tiles: HashMap::new(),
        }
    }

    pub fn tile(&mut self, tile: geodesy::Tile) -> Option<&TileData> {
        let repository = &self.repository;
        let read = || {
            let bytes = repository.read(tile).unwrap()?;
            Some(TileData::decode_tile(&bytes, tile).unwrap())
        };
        self.tiles.entry(tile).or_insert_with(read).as_ref()
    }

    /// The bilinear value of a channel at a position and level; `None` where a node that counts is void.
    pub fn at(&mut self, latitude: f64, longitude: f64, level: u8, channel: u8) -> Option<f64> {
        let unit = self.repository.dataset().unit();
        let position = TilePosition::of_normal(Ellipsoid::normal(latitude, longitude), level);
        let data = self.tile(position.tile)?;
        let (i, j) = (position.i.floor().min(255.0), position.j.floor().min(255.0));
        let (s, t) = (position.i - i, position.j - j);
        let (i, j) = (i as i64, j as i64);
        let mut sum = 0.0;
        for (di, dj, weight) in [
            (0, 0, (1.0 - s) * (1.0 - t)),
            (1, 0, s * (1.0 - t)),
            (0, 1, (1.0 - s) * t),
            (1, 1, s * t),
        ] {
            if weight > 1e-9 {
                sum += weight * data.value(i + di, j + dj, channel)?;
            }
        }
        Some(sum * unit)
    }

    /// Every node that two stored arrays share, border included, is the same in both; returns how many pairs
    /// were compared.
    pub fn check_shared_nodes(&mut self) -> usize {
        let tiles: Vec<_> = self
            .repository
            .tiles()
            .unwrap()
            .into_iter()
            .map(|(tile, _)| tile)
            .collect();
        let mut first: HashMap<LatticePoint, (geodesy::Tile, Option<Vec<u64>>)> = HashMap::new();
        let mut compared = 0;
        for level in 0..=geodesy::MAX_LEVEL {
            first.clear();
            for tile in tiles.iter().filter(|tile| tile.level() == level) {
                let data = self.tile(*tile).unwrap().clone();
                for j in -9..=265_i64 {
                    for i in -9..=265_i64 {
                        // Inner nodes belong to nobody else's border.
                        if (10..=246).contains(&i) && (10..=246).contains(&j) {
                            continue;
                        }
                        let point = LatticePoint::of_tile(*tile, i, j);
                        let inside = (0..=256).contains(&i) && (0..=256).contains(&j);
                        let value: Option<Vec<u64>> = (0..data.channels)
                            .map(|channel| data.value(i, j, channel).map(f64::to_bits))
                            .collect();
                        match first.get(&point) {
                            Some((other, due)) => {
                                assert_eq!(
                                    due, &value,
                                    "node {point:?} in {other} and, at {i},{j} (inside: {inside}), in {tile}"
                                );
                                compared += 1;
                            }
                            None => {
                                first.insert(point, (*tile, value));
                            }
                        }
                    }
                }
                self.tiles.clear();
            }
        }
        compared
    }
}

/// Numbers from a seed, evenly over 0…1 (SplitMix64, Steele, Lea and Flood 2014).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}
