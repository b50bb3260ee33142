//! A hash set of tiles for the inner loops of selection.
//! In: tiles. Out: membership in constant time. The order of a hash set never reaches a result.

use std::collections::HashSet;
use std::hash::{BuildHasherDefault, Hasher};

use geodesy::Tile;

/// A number that is unique over all tiles and sorts as tiles do: by level, face, row, column.
pub(crate) fn key(tile: Tile) -> u64 {
    u64::from(tile.level()) << 56
        | u64::from(tile.face().number()) << 48
        | u64::from(tile.y()) << 24
        | u64::from(tile.x())
}

/// Mixes one 64-bit key by a widening multiplication, whose high and low halves are folded together.
#[derive(Default)]
pub(crate) struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.write_u64(u64::from(*byte));
        }
    }

    fn write_u64(&mut self, key: u64) {
        // The fractional part of the golden ratio: its multiples are spread most evenly (Knuth, TAOCP 3, §6.4).
        let product = u128::from(self.0 ^ key) * 0x9E37_79B9_7F4A_7C15_u128;
        self.0 = (product >> 64) as u64 ^ product as u64;
    }
}

/// Tiles, by [`key`].
#[derive(Clone, Debug, Default)]
pub(crate) struct TileSet(HashSet<u64, BuildHasherDefault<KeyHasher>>);

impl TileSet {
    pub(crate) fn with_capacity(tiles: usize) -> Self {
        Self(HashSet::with_capacity_and_hasher(
            tiles,
            BuildHasherDefault::default(),
        ))
    }

    /// True if the tile was not there before.
    pub(crate) fn insert(&mut self, tile: Tile) -> bool {
        self.0.insert(key(tile))
    }

    pub(crate) fn contains(&self, tile: Tile) -> bool {
        self.0.contains(&key(tile))
    }
}
