//! What several tests need: small repositories whose tiles are told apart by their content, and servers of bad manners.
#![allow(
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "a test that panics has failed; not all tests use all of it"
)]

pub mod front;
pub mod servers;

use std::path::Path;
use std::time::Duration;

use geodesy::Tile;
use repositories::{Address, Options};
use tiles::{
    Dataset, Index, Kind, NODE_COUNT, Repository, SampleType, Samples, TileData, Validity,
};

/// A tile filled with a number of its own.
pub fn tile_data(tile: Tile) -> TileData {
    let number = tile.id() as u32;
    // Hardly compressible: a body takes several packets.
    let samples = (0..NODE_COUNT as u32)
        .map(|k| (k.wrapping_mul(2_654_435_761).wrapping_add(number) >> 24) as u8)
        .collect();
    TileData::new(tile, Kind::Sar, 1, Samples::U8(samples), Validity::All).unwrap()
}

/// All tiles down to a level.
pub fn pyramid(deepest: u8) -> Vec<Tile> {
    let mut tiles = Tile::ROOTS.to_vec();
    let mut start = 0;
    for _ in 0..deepest {
        let end = tiles.len();
        for k in start..end {
            tiles.extend(tiles[k].children().unwrap());
        }
        start = end;
    }
    tiles
}

/// A repository of the whole pyramid.
pub fn write_repository(root: &Path, deepest: u8) -> Repository {
    let dataset = Dataset::new("test", Kind::Sar, SampleType::U8, 1);
    let mut repository = Repository::create(root, dataset).unwrap();
    let mut index = Index::new();
    for tile in pyramid(deepest) {
        let data = tile_data(tile);
        repository
            .write_atomic(tile, &data.encode().unwrap())
            .unwrap();
        index.insert_tile(&data);
    }
    repository.store_index(&index).unwrap();
    repository
        .update(|dataset| dataset.deepest_level = deepest)
        .unwrap();
    repository
}

/// Options by which tests are quick.
pub fn quick() -> Options {
    Options {
        attempt_timeout: Duration::from_secs(2),
        first_pause: Duration::from_millis(20),
        longest_pause: Duration::from_secs(2),
        first_probe: Duration::from_millis(100),
        longest_probe: Duration::from_millis(800),
        ..Options::default()
    }
}

/// The address of a repository behind a front.
pub fn place(front: &front::Front, path: &str) -> Address {
    front.url(path).parse().unwrap()
}
