//! What the tests share: reproducible random numbers, a planet of made-up terrain, views.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "each test binary uses its own part"
)]

use std::collections::HashMap;

use geodesy::{Ellipsoid, Geodetic, LatticePoint, Tile};
use glam::DVec3;
use terrain::{
    DataLevels, ElevationLayer, Heights, Lattice, LodView, MeshError, Patch, Vertex, build,
};

/// SplitMix64 (G. Steele et al., 2014): small, seeded, the same everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        mix(self.0)
    }

    /// 0…1
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::new(
                self.between(-1.0, 1.0),
                self.between(-1.0, 1.0),
                self.between(-1.0, 1.0),
            );
            if v.length_squared() > 0.01 && v.length_squared() < 1.0 {
                return v.normalize();
            }
        }
    }
}

pub fn mix(mut z: u64) -> u64 {
    z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ z >> 31
}

/// A view from a place and altitude above the ellipsoid.
pub fn view(
    ellipsoid: &Ellipsoid,
    latitude_deg: f64,
    longitude_deg: f64,
    altitude_m: f64,
) -> LodView {
    let eye = ellipsoid.to_ecef(Geodetic {
        latitude_deg,
        longitude_deg,
        height_m: altitude_m,
    });
    LodView {
        eye,
        pixels_per_radian: 1200.0,
    }
}

/// Places that try the cube: face centres, edges, corners, poles, and elsewhere.
pub const PLACES: [(f64, f64); 12] = [
    (0.0, 0.0),
    (0.0, 45.0),
    (0.0, -135.0),
    (90.0, 0.0),
    (-90.0, 0.0),
    (35.264_389_682_754_65, 45.0),
    (-35.264_389_682_754_65, 135.0),
    (45.0, 0.0),
    (45.0, 90.0),
    (46.5, 8.0),
    (-13.2, -72.5),
    (89.9, 170.0),
];

/// Heights like the Earth's for every tile: wide above, narrower where tiles are small.
pub fn earth_like(tile: Tile) -> (f64, f64) {
    let size = 1.0 / f64::from(1_u32 << tile.level());
    (
        (-9000.0 * size).max(-500.0) - 100.0,
        (40_000.0 * size).min(8848.0) + 100.0,
    )
}

/// Elevation of one tile: noise that depends on level and point only, so that tiles of a level agree on
/// shared nodes and differ between levels as much as they can. A share of the nodes is not valid.
#[derive(Clone, Copy, Debug)]
pub struct Noise {
    pub tile: Tile,
    pub seed: u64,
    /// Heights are within ± this many quanta.
    pub amplitude: i64,
    /// One node in this many is a hole; 0 for none.
    pub holes: u64,
}

impl Lattice for Noise {
    fn tile(&self) -> Tile {
        self.tile
    }

    fn height(&self, i: i64, j: i64) -> Option<i32> {
        assert!(
            (0..=256).contains(&i) && (0..=256).contains(&j),
            "node {i}, {j} is not in the tile"
        );
        let point = LatticePoint::of_tile(self.tile, i, j);
        let start = self.seed ^ u64::from(point.level()) << 32;
        let hash = point
            .cube()
            .iter()
            .fold(start, |hash, c| mix(hash ^ *c as u64));
        if self.holes > 0 && (hash >> 40) % self.holes == 0 {
            return None;
        }
        Some(((hash & 0xffff_ffff) as i64 % (2 * self.amplitude + 1) - self.amplitude) as i32)
    }
}

/// Resident elevation by tile.
pub type Resident = HashMap<Tile, Noise>;

pub fn lookup<'a>(resident: &'a Resident) -> impl Fn(Tile) -> Option<&'a dyn Lattice> {
    |tile| resident.get(&tile).map(|noise| noise as &dyn Lattice)
}

/// Builds a leaf of one layer as it is, with a height of 0 in its holes.
pub fn build_one<'a>(
    ellipsoid: &Ellipsoid,
    tile: Tile,
    levels: &DataLevels,
    patch: &Patch,
    quantum_m: f64,
    data: &dyn Fn(Tile) -> Option<&'a dyn Lattice>,
    out: &mut Vec<Vertex>,
) -> Result<Heights, MeshError> {
    let layer = ElevationLayer {
        levels: *levels,
        data: &|tile| data(tile).map(|lattice| lattice as &dyn Lattice),
    };
    let fuse = |_: DVec3, samples: &[Option<i32>]| f64::from(samples[0].unwrap_or(0)) * quantum_m;
    build(ellipsoid, tile, &[layer], &patch.positions, &fuse, out)
}
