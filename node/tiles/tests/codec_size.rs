//! What real elevation costs. In: ETOPO5 (NOAA, public domain), the whole of it where the shared data is
//! present and a window of it otherwise, resampled bilinearly to the next finer lattice in 1/16 m.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::path::PathBuf;
use std::time::Instant;

use geodesy::{BORDER, CELLS, Ellipsoid, LatticePoint, Tile};
use tiles::{Kind, Origin, Samples, TileData, Validity};

/// A geographic raster of whole metres, node-registered, 12 samples a degree.
struct Raster {
    width: usize,
    height: usize,
    /// Longitude and latitude of the first sample.
    west_deg: f64,
    north_deg: f64,
    metres: Vec<i16>,
}

const QUANTA_PER_M: f64 = 16.0;

impl Raster {
    /// Latitudes 28…49°, longitudes −3…17°.
    fn embedded() -> Self {
        let packed = include_bytes!("data/etopo5-window.i16.zst");
        let bytes = zstd::decode_all(&packed[..]).unwrap();
        let metres = bytes
            .as_chunks::<2>()
            .0
            .iter()
            .map(|pair| i16::from_le_bytes(*pair))
            .collect();
        Self {
            width: 241,
            height: 253,
            west_deg: -3.0,
            north_deg: 49.0,
            metres,
        }
    }

    fn whole() -> Option<Self> {
        let path =
            PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/etopo5.tif");
        let file = std::fs::File::open(path).ok()?;
        let mut decoder = tiff::decoder::Decoder::new(std::io::BufReader::new(file)).unwrap();
        let (width, height) = decoder.dimensions().unwrap();
        let tiff::decoder::DecodingResult::I16(metres) = decoder.read_image().unwrap() else {
            panic!("ETOPO5 is 16-bit");
        };
        let (width, height) = (width as usize, height as usize);
        Some(Self {
            width,
            height,
            west_deg: -180.0,
            north_deg: 90.0,
            metres,
        })
    }

    fn goes_round(&self) -> bool {
        self.width == 4320
    }

    fn place(&self, tile: Tile, i: i64, j: i64) -> [f64; 2] {
        let (latitude, longitude) =
            Ellipsoid::angles_deg(LatticePoint::of_tile(tile, i, j).normal());
        [
            (longitude - self.west_deg) * 12.0,
            (self.north_deg - latitude) * 12.0,
        ]
    }

    fn metres(&self, column: i64, row: i64) -> i32 {
        let last = self.width as i64 - 1;
        let column = if self.goes_round() {
            column.rem_euclid(last + 1)
        } else {
            column.clamp(0, last)
        };
        let row = row.clamp(0, self.height as i64 - 1);
        i32::from(self.metres[row as usize * self.width + column as usize])
    }

    fn tile(&self, tile: Tile) -> TileData {
        let mut heights = Vec::new();
        for j in -BORDER..=CELLS + BORDER {
            for i in -BORDER..=CELLS + BORDER {
                let [column, row] = self.place(tile, i, j);
                let row = row.min(self.height as f64 - 1.0);
                let (c, r) = (column.floor() as i64, row.floor() as i64);
                let (s, t) = (column - column.floor(), row - row.floor());
                let at = |dc, dr| f64::from(self.metres(c + dc, r + dr));
                let near = at(0, 0) * (1.0 - s) + at(1, 0) * s;
                let far = at(0, 1) * (1.0 - s) + at(1, 1) * s;
                heights.push(((near * (1.0 - t) + far * t) * QUANTA_PER_M).round() as i32);
            }
        }
        TileData::new(
            tile,
            Kind::Elevation,
            1,
            Samples::I32(heights),
            Validity::All,
        )
        .unwrap()
    }

    fn origin(&self, tile: Tile) -> Option<Origin> {
        Origin::gather(
            |i, j| Some(self.place(tile, i, j)),
            self.goes_round().then_some(self.width as f64),
            |column, row| self.metres(column, row) * QUANTA_PER_M as i32,
        )
    }
}

#[test]
fn a_resampled_tile_costs_little_more_than_its_source() {
    let raster = Raster::embedded();
    // Latitudes 34…45°, longitudes 0…11°: the Alps, the Mediterranean, the Atlas.
    let tile = raster.tile(Tile::new(0, 3, 4, 7).unwrap());
    let origin = raster.origin(tile.tile).unwrap();
    let resampled = tile.encode_resampled(&origin).unwrap();
    let plain = tile.encode().unwrap();
    assert_eq!(TileData::decode(&resampled).unwrap(), tile);
    assert_eq!(TileData::decode(&plain).unwrap(), tile);
    let cost = |file: &[u8]| file.len() as f64 / tile.samples.len() as f64;
    assert!(cost(&resampled) < 0.5, "{}", cost(&resampled));
    assert!(cost(&plain) < 1.4, "{}", cost(&plain));
}

#[test]
fn a_wrong_origin_loses_nothing() {
    let raster = Raster::embedded();
    let tile = raster.tile(Tile::new(0, 3, 4, 7).unwrap());
    let elsewhere = raster.origin(Tile::new(0, 3, 4, 6).unwrap()).unwrap();
    let file = tile.encode_resampled(&elsewhere).unwrap();
    assert_eq!(TileData::decode(&file).unwrap(), tile);
    assert!(file.len() <= tile.encode().unwrap().len());
}

/// The bar of the whole repository is 3 bytes a source sample: 0.7 bytes a stored sample.
#[test]
fn the_whole_earth_costs_under_three_bytes_a_source_sample() {
    let Some(raster) = Raster::whole() else {
        return;
    };
    // Every 13th tile of the level that is imported, and the pyramid's as if filtered by a tent.
    let (mut finest, mut coarser) = ((0, 0), (0, 0));
    for k in (0..384).step_by(13) {
        let tile = Tile::new((k / 64) as u8, 3, k % 8, k / 8 % 8).unwrap();
        let data = raster.tile(tile);
        let file = match raster.origin(tile) {
            Some(origin) => data.encode_resampled(&origin).unwrap(),
            None => data.encode().unwrap(),
        };
        assert_eq!(TileData::decode(&file).unwrap(), data);
        finest = (finest.0 + file.len(), finest.1 + data.samples.len());
    }
    for k in (0..96).step_by(13) {
        let tile = Tile::new((k / 16) as u8, 2, k % 4, k / 4 % 4).unwrap();
        let data = raster.tile(tile);
        coarser = (
            coarser.0 + data.encode().unwrap().len(),
            coarser.1 + data.samples.len(),
        );
    }
    let cost = |(bytes, samples): (usize, usize)| bytes as f64 / samples as f64;
    // 384 tiles at level 3, 126 coarser ones.
    let stored = (raster.width * raster.height) as f64;
    let total = 75_625.0 * (384.0 * cost(finest) + 126.0 * cost(coarser));
    eprintln!(
        "finest level {:.3}, coarser {:.3} bytes a stored sample; {:.2} bytes a source sample",
        cost(finest),
        cost(coarser),
        total / stored
    );
    assert!(
        total / stored < 3.0,
        "{:.2} bytes a source sample",
        total / stored
    );
}

/// Run with `--ignored --nocapture` to see the speed.
#[test]
#[ignore = "measures, asserts nothing"]
fn speed() {
    let raster = Raster::embedded();
    let tile = raster.tile(Tile::new(0, 3, 4, 7).unwrap());
    let origin = raster.origin(tile.tile).unwrap();
    let bytes: Vec<u8> = tile
        .heights()
        .unwrap()
        .iter()
        .map(|h| (h >> 6) as u8)
        .collect();
    let grey = Samples::U8(
        bytes
            .iter()
            .flat_map(|b| [*b, b.wrapping_add(9), b / 2])
            .collect(),
    );
    let picture = TileData::new(tile.tile, Kind::Imagery, 3, grey, Validity::All).unwrap();
    let measure = |name: &str, samples: usize, work: &dyn Fn() -> usize| {
        let size = work();
        let rounds = 40;
        let mut best = f64::INFINITY;
        for _ in 0..rounds {
            let start = Instant::now();
            std::hint::black_box(work());
            best = best.min(start.elapsed().as_secs_f64());
        }
        eprintln!(
            "{name}: {:.1} ns a sample, {:.3} bytes a sample",
            best * 1e9 / samples as f64,
            size as f64 / samples as f64
        );
    };
    let count = tile.samples.len();
    let gradient = tile.encode().unwrap();
    let resampled = tile.encode_resampled(&origin).unwrap();
    let plain = tile.encode_plain().unwrap();
    let packed_picture = picture.encode().unwrap();
    measure("gradient, encode", count, &|| tile.encode().unwrap().len());
    measure("gradient, decode", count, &|| {
        TileData::decode(&gradient).unwrap();
        gradient.len()
    });
    measure("resampled, encode", count, &|| {
        tile.encode_resampled(&origin).unwrap().len()
    });
    measure("resampled, decode", count, &|| {
        TileData::decode(&resampled).unwrap();
        resampled.len()
    });
    measure("plain, encode", count, &|| {
        tile.encode_plain().unwrap().len()
    });
    measure("plain, decode", count, &|| {
        TileData::decode(&plain).unwrap().byte_size()
    });
    measure("picture, encode", 3 * count, &|| {
        picture.encode().unwrap().len()
    });
    measure("picture, decode", 3 * count, &|| {
        TileData::decode(&packed_picture).unwrap();
        packed_picture.len()
    });
}
