//! The index of a repository: which tiles exist, and the lowest and highest sample of each.
//!
//! In: tiles with their ranges, or the bytes of `index.bin`. Out: answers without any I/O, the same on every
//! node. Loaded whole, because the choice of tiles must not depend on what has been loaded.
//!
//! `index.bin`, little-endian: magic `TWINDX`, version (u16), tiles (u64), then chunks of up to 65536 tiles,
//! each its length in bytes (u32) and a zstd frame of the tile numbers' differences (u64), the lowest and the
//! highest samples (f64), each in byte planes; last the CRC-32 of everything before it.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use geodesy::Tile;
use thiserror::Error;

use crate::codec::{CodecError, compress, expand};
use crate::format::TileData;

/// The version of `index.bin` that this program writes and reads.
pub const INDEX_VERSION: u16 = 1;
/// The file's name under the repository's root.
pub const INDEX_FILE: &str = "index.bin";

const MAGIC: &[u8; 6] = b"TWINDX";
const HEADER_BYTES: usize = 16;
const CHUNK: usize = 65_536;
const COLUMNS: usize = 3;

/// Which tiles a repository holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Index {
    ranges: HashMap<u64, [f64; 2], BuildHasherDefault<TileHasher>>,
    deepest_level: u8,
}

/// Why an index was refused.
#[derive(Debug, Error)]
pub enum IndexError {
    /// The first bytes are not those of an index.
    #[error("not an index file: it does not begin with TWINDX")]
    NotAnIndex,
    /// Another version made it.
    #[error(
        "index version {found}, but this program reads version {INDEX_VERSION}: run `terrawall import` again, or use the program that made it"
    )]
    Version {
        /// The version in the file.
        found: u16,
    },
    /// Bytes were changed or lost.
    #[error("the index is damaged: {0}; run `terrawall import` again on its sources")]
    Damaged(String),
    /// The compressor gave up.
    #[error("compression failed: {0}")]
    Compression(std::io::Error),
}

impl From<CodecError> for IndexError {
    fn from(error: CodecError) -> Self {
        Self::Damaged(error.to_string())
    }
}

impl Index {
    /// An index without tiles.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a tile or changes its range, in sample units.
    pub fn insert(&mut self, tile: Tile, lowest: f64, highest: f64) {
        self.deepest_level = self.deepest_level.max(tile.level());
        self.ranges.insert(tile.id(), [lowest, highest]);
    }

    /// Adds a tile with the range of its statistics.
    pub fn insert_tile(&mut self, data: &TileData) {
        self.insert(data.tile, data.statistics.lowest, data.statistics.highest);
    }

    /// Takes over all tiles of `other`; its ranges win.
    pub fn merge(&mut self, other: &Self) {
        self.deepest_level = self.deepest_level.max(other.deepest_level);
        self.ranges
            .extend(other.ranges.iter().map(|(id, range)| (*id, *range)));
    }

    /// How many tiles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ranges.len()
    }

    /// True without any tile.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ranges.is_empty()
    }

    /// The deepest level that was inserted; 0 for an empty index.
    #[must_use]
    pub const fn deepest_level(&self) -> u8 {
        self.deepest_level
    }

    /// Whether a tile exists.
    #[must_use]
    pub fn contains(&self, tile: Tile) -> bool {
        self.ranges.contains_key(&tile.id())
    }

    /// The tile itself where it exists, else its deepest existing ancestor.
    #[must_use]
    pub fn best(&self, tile: Tile) -> Option<Tile> {
        tile.ancestor(self.deepest_level)
            .lineage()
            .find(|candidate| self.contains(*candidate))
    }

    /// Lowest and highest sample of [`Index::best`], in sample units.
    #[must_use]
    pub fn range(&self, tile: Tile) -> Option<(f64, f64)> {
        tile.ancestor(self.deepest_level)
            .lineage()
            .find_map(|candidate| {
                let [lowest, highest] = self.ranges.get(&candidate.id())?;
                Some((*lowest, *highest))
            })
    }

    /// All tiles, by level, then along the quadtree's curve.
    #[must_use]
    pub fn tiles(&self) -> Vec<Tile> {
        let mut ids: Vec<u64> = self.ranges.keys().copied().collect();
        ids.sort_unstable();
        ids.into_iter().filter_map(Tile::from_id).collect()
    }

    /// The bytes of `index.bin`; the same for equal indices.
    pub fn encode(&self) -> Result<Vec<u8>, IndexError> {
        let mut entries: Vec<(u64, [f64; 2])> = self
            .ranges
            .iter()
            .map(|(id, range)| (*id, *range))
            .collect();
        entries.sort_unstable_by_key(|(id, _)| *id);
        let mut file = Vec::with_capacity(HEADER_BYTES + entries.len() * 8);
        file.extend_from_slice(MAGIC);
        file.extend_from_slice(&INDEX_VERSION.to_le_bytes());
        file.extend_from_slice(&(entries.len() as u64).to_le_bytes());
        let mut last = 0;
        for chunk in entries.chunks(CHUNK) {
            let rows: Vec<[[u8; 8]; COLUMNS]> = chunk
                .iter()
                .map(|(id, [lowest, highest])| {
                    let step = id - last;
                    last = *id;
                    [
                        step.to_le_bytes(),
                        lowest.to_le_bytes(),
                        highest.to_le_bytes(),
                    ]
                })
                .collect();
            let mut planes = Vec::with_capacity(rows.len() * COLUMNS * 8);
            for column in 0..COLUMNS {
                for byte in 0..8 {
                    planes.extend(rows.iter().map(|row| row[column][byte]));
                }
            }
            let frame = compress(&planes, 3).map_err(IndexError::Compression)?;
            file.extend_from_slice(&(frame.len() as u32).to_le_bytes());
            file.extend_from_slice(&frame);
        }
        file.extend_from_slice(&crc32fast::hash(&file).to_le_bytes());
        Ok(file)
    }

    /// Reads the bytes of `index.bin`. The checksum is verified first; memory grows with the tiles that are
    /// really there.
    pub fn decode(bytes: &[u8]) -> Result<Self, IndexError> {
        let damaged = |what: &str| IndexError::Damaged(what.to_owned());
        if !bytes.starts_with(MAGIC) {
            return Err(IndexError::NotAnIndex);
        }
        let cut = || damaged("it was cut off");
        let (content, checksum) = bytes.split_last_chunk::<4>().ok_or_else(cut)?;
        let (header, mut rest) = content
            .split_first_chunk::<HEADER_BYTES>()
            .ok_or_else(cut)?;
        let [_, _, _, _, _, _, v0, v1, count @ ..] = *header;
        let version = u16::from_le_bytes([v0, v1]);
        if version != INDEX_VERSION {
            return Err(IndexError::Version { found: version });
        }
        if crc32fast::hash(content) != u32::from_le_bytes(*checksum) {
            return Err(damaged("its checksum is wrong"));
        }
        let mut left = u64::from_le_bytes(count);
        let mut index = Self::new();
        let mut last = 0_u64;
        while left > 0 {
            let rows = left.min(CHUNK as u64) as usize;
            let (length, after) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
            let length = u32::from_le_bytes(*length) as usize;
            let (frame, after) = after.split_at_checked(length).ok_or_else(cut)?;
            let planes = expand(frame, rows * COLUMNS * 8, "index chunk")?;
            let number = |row: usize, column: usize| -> [u8; 8] {
                std::array::from_fn(|byte| planes[(column * 8 + byte) * rows + row])
            };
            index.ranges.reserve(rows);
            for row in 0..rows {
                let step = u64::from_le_bytes(number(row, 0));
                last = last
                    .checked_add(step)
                    .filter(|_| step > 0)
                    .ok_or_else(|| damaged("order"))?;
                let tile = Tile::from_id(last).ok_or_else(|| damaged("a tile number"))?;
                let (lowest, highest) = (
                    f64::from_le_bytes(number(row, 1)),
                    f64::from_le_bytes(number(row, 2)),
                );
                if !(lowest.is_finite() && highest.is_finite() && lowest <= highest) {
                    return Err(damaged("a range"));
                }
                index.insert(tile, lowest, highest);
            }
            (left, rest) = (left - rows as u64, after);
        }
        if rest.is_empty() {
            Ok(index)
        } else {
            Err(damaged("bytes are left over"))
        }
    }
}

/// Tile numbers are well spread by one multiplication; the default hasher guards against chosen keys, which
/// cost nothing here but time.
#[derive(Clone, Debug, Default)]
pub(crate) struct TileHasher(u64);

impl Hasher for TileHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.write_u64(u64::from(*byte));
        }
    }

    fn write_u64(&mut self, number: u64) {
        let product = u128::from(self.0 ^ number) * 0x9e37_79b9_7f4a_7c15_f39c_c060_5ced_c835;
        self.0 = (product >> 64) as u64 ^ product as u64;
    }

    fn write_u128(&mut self, number: u128) {
        self.write_u64(number as u64);
        self.write_u64((number >> 64) as u64);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use proptest::prelude::*;

    fn tile() -> impl Strategy<Value = Tile> {
        (0_u8..6, 0_u8..=22, any::<u32>(), any::<u32>()).prop_map(|(face, level, x, y)| {
            let mask = (1_u32 << level) - 1;
            Tile::new(face, level, x & mask, y & mask).unwrap()
        })
    }

    proptest! {
        #[test]
        fn comes_back_and_answers_like_a_list(tiles in prop::collection::vec((tile(), -1e4..0.0, 0.0..1e4), 0..60),
                                              asked in tile()) {
            let mut index = Index::new();
            for (tile, lowest, highest) in &tiles {
                index.insert(*tile, *lowest, *highest);
            }
            let bytes = index.encode().unwrap();
            prop_assert_eq!(&Index::decode(&bytes).unwrap(), &index);
            prop_assert_eq!(index.deepest_level(), tiles.iter().map(|t| t.0.level()).max().unwrap_or(0));
            let due = tiles.iter().map(|t| t.0).filter(|t| t.contains(asked)).max_by_key(|t| t.level());
            prop_assert_eq!(index.best(asked), due);
            let range = due.and_then(|d| tiles.iter().rev().find(|t| t.0 == d)).map(|t| (t.1, t.2));
            prop_assert_eq!(index.range(asked), range);
            let sorted = index.tiles();
            prop_assert!(sorted.windows(2).all(|pair| pair[0].id() < pair[1].id()));
            prop_assert_eq!(sorted.len(), index.len());
        }

        #[test]
        fn a_changed_byte_is_an_error(at in any::<prop::sample::Index>(), flip in 1_u8..) {
            let mut index = Index::new();
            Tile::ROOTS.iter().for_each(|root| index.insert(*root, -1.0, 2.0));
            let mut bytes = index.encode().unwrap();
            let at = at.index(bytes.len());
            bytes[at] ^= flip;
            prop_assert!(Index::decode(&bytes).is_err());
        }
    }

    #[test]
    fn many_tiles_take_several_chunks() {
        let mut index = Index::new();
        for k in 0..70_000_u32 {
            index.insert(
                Tile::new((k % 6) as u8, 9, k % 512, k / 512).unwrap(),
                f64::from(k),
                1e6,
            );
        }
        let bytes = index.encode().unwrap();
        assert_eq!(Index::decode(&bytes).unwrap(), index);
        assert!(bytes.len() < 8 * index.len(), "{} bytes", bytes.len());
    }

    #[test]
    fn golden_bytes() {
        let mut index = Index::new();
        index.insert(Tile::ROOTS[2], -3.0, 4.5);
        let bytes = index.encode().unwrap();
        assert_eq!(bytes[..16], *b"TWINDX\x01\x00\x01\0\0\0\0\0\0\0");
        let frame = u32::from_le_bytes(*bytes[16..].first_chunk().unwrap()) as usize;
        assert_eq!(bytes.len(), 20 + frame + 4);
        let plain = expand(&bytes[20..20 + frame], 24, "chunk").unwrap();
        assert_eq!(plain[..8], 10_u64.to_le_bytes());
        assert_eq!(plain[8..16], (-3.0_f64).to_le_bytes());
        assert_eq!(plain[16..], 4.5_f64.to_le_bytes());
    }

    #[test]
    fn another_version_is_named() {
        let mut bytes = Index::new().encode().unwrap();
        bytes[6] = 9;
        assert!(
            Index::decode(&bytes)
                .unwrap_err()
                .to_string()
                .contains("version 9")
        );
    }
}
