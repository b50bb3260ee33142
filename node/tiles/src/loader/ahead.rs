//! What was loaded before anybody wanted it, and how much of that may be in vain.
//!
//! In: tiles that came early, tiles that were taken after all, tiles loaded on demand. Out: whether one more may be
//! loaded early. No I/O.

use std::collections::HashMap;

use crate::dataset::DatasetId;
use crate::ram::Key;

/// So many bytes may be in vain before anything was loaded on demand: a few dozen tiles.
const FLOOR_BYTES: u64 = 16 << 20;
/// Beyond that, one byte may be in vain for so many that were loaded on demand.
const DEMANDED_FOR_ONE: u64 = 4;
/// Early tiles that are remembered: more than any main memory holds of those that were not taken.
const MOST_REMEMBERED: usize = 65_536;

/// The account.
#[derive(Debug, Default)]
pub(super) struct Ahead {
    /// Tiles that came early and were not taken yet, with their bytes.
    waiting: HashMap<Key, u64>,
    early_bytes: u64,
    taken_bytes: u64,
    demanded_bytes: u64,
}

impl Ahead {
    /// Whether another tile of this size may be loaded early while so many others are.
    pub(super) const fn allows(&self, tile_bytes: u64, coming: usize) -> bool {
        let at_stake = self.early_bytes - self.taken_bytes + (coming as u64 + 1) * tile_bytes;
        at_stake <= FLOOR_BYTES + self.demanded_bytes / DEMANDED_FOR_ONE
    }

    /// A tile arrived: early, or because somebody wanted it.
    pub(super) fn arrived(&mut self, key: Key, bytes: u64, early: bool) {
        if !early {
            self.demanded_bytes += bytes;
            // Had it come early, it was lost before anybody took it: that was in vain.
            self.waiting.remove(&key);
            return;
        }
        self.early_bytes += bytes;
        if self.waiting.len() >= MOST_REMEMBERED {
            // Those that are forgotten count as in vain.
            self.waiting.clear();
        }
        self.waiting.insert(key, bytes);
    }

    /// A data set has changed: what came early of it was in vain.
    pub(super) fn forget(&mut self, dataset: DatasetId) {
        self.waiting.retain(|key, _| key.0 != dataset);
    }

    /// A tile was taken.
    pub(super) fn taken(&mut self, key: &Key) {
        if let Some(bytes) = self.waiting.remove(key) {
            self.taken_bytes += bytes;
        }
    }

    /// Bytes that came early, and those of them that nobody has taken.
    pub(super) const fn bytes(&self) -> (u64, u64) {
        (self.early_bytes, self.early_bytes - self.taken_bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geodesy::Tile;
    use proptest::prelude::*;

    #[test]
    fn what_is_lost_before_it_is_taken_was_in_vain() {
        let ids: Vec<_> = (0..3).map(|_| DatasetId::random()).collect();
        let key = |n: usize| (ids[n], Tile::ROOTS[0]);
        let mut ahead = Ahead::default();
        for n in 0..3 {
            ahead.arrived(key(n), 10, true);
        }
        // Evicted, and loaded again because somebody wants it.
        ahead.arrived(key(0), 10, false);
        ahead.taken(&key(0));
        ahead.forget(key(1).0);
        ahead.taken(&key(1));
        ahead.taken(&key(2));
        assert_eq!(ahead.bytes(), (30, 20));
    }

    proptest! {
        #[test]
        fn what_is_in_vain_is_bounded(steps in prop::collection::vec((0_u32..64, 0_u8..4), 0..400)) {
            let (id, size) = (DatasetId::random(), 1_u64 << 20);
            let mut ahead = Ahead::default();
            let mut demanded = 0;
            for (n, step) in steps {
                let key = (id, Tile::new(0, 7, n, 0).unwrap_or(Tile::ROOTS[0]));
                match step {
                    0 => ahead.taken(&key),
                    1 => {
                        ahead.arrived(key, size, false);
                        demanded += size;
                    }
                    _ if ahead.allows(size, 0) => ahead.arrived(key, size, true),
                    _ => {}
                }
                let (early, vain) = ahead.bytes();
                prop_assert!(vain <= early && vain <= FLOOR_BYTES + demanded / 4);
            }
        }
    }
}
