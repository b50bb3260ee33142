//! What several tests need: small repositories whose tiles are told apart by their content.
#![allow(
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "a test that panics has failed; not all tests use all of it"
)]

use std::path::Path;

use geodesy::Tile;
use tiles::{
    Dataset, Index, Kind, NODE_COUNT, Repository, SampleType, Samples, TileData, Validity,
};

/// A tile filled with a number of its own.
pub fn tile_data(tile: Tile) -> TileData {
    let samples = Samples::U8(vec![(tile.id() % 251) as u8; NODE_COUNT]);
    TileData::new(tile, Kind::Sar, 1, samples, Validity::All).unwrap()
}

/// Bytes that one of these tiles takes in RAM.
pub fn tile_bytes() -> u64 {
    tile_data(Tile::ROOTS[0]).byte_size() as u64
}

pub fn dataset() -> Dataset {
    Dataset::new("test", Kind::Sar, SampleType::U8, 1)
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

pub fn index_of(tiles: &[Tile]) -> Index {
    let mut index = Index::new();
    for tile in tiles {
        index.insert_tile(&tile_data(*tile));
    }
    index
}

/// A repository of the whole pyramid.
pub fn write_repository(root: &Path, deepest: u8) -> Repository {
    let mut repository = Repository::create(root, dataset()).unwrap();
    let tiles = pyramid(deepest);
    for tile in &tiles {
        repository
            .write_atomic(*tile, &tile_data(*tile).encode().unwrap())
            .unwrap();
    }
    repository.store_index(&index_of(&tiles)).unwrap();
    repository
        .update(|dataset| dataset.deepest_level = deepest)
        .unwrap();
    repository
}
