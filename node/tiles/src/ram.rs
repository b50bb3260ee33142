//! The RAM cache: decoded tiles under a byte budget, least recently used first out.
//!
//! In: tiles that arrived, questions. Out: tiles. Roots stay for ever, so that there is always something to
//! draw. Tiles that arrived and were not asked for since are *fresh*; they go after all others, so that a
//! budget smaller than what is wished for delivers tile after tile and does not run in circles. No I/O here.

use std::collections::HashMap;
use std::sync::Arc;

use geodesy::Tile;

use crate::dataset::DatasetId;
use crate::format::TileData;

/// A tile of a data set.
pub(crate) type Key = (DatasetId, Tile);

const NONE: usize = usize::MAX;

/// Where a tile was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// In its repository.
    Repository,
    /// In the disk cache.
    Disk,
    /// In main memory already.
    Ram,
}

/// Where a tile stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Queue {
    /// Never evicted.
    Pinned,
    /// Arrived and not asked for since.
    Fresh,
    /// Handed out at least once, or no longer wished for.
    Used,
}

struct Slot {
    key: Key,
    data: Arc<TileData>,
    bytes: u64,
    queue: Queue,
    level: Level,
    /// Handed out at least once.
    served: bool,
    newer: usize,
    older: usize,
}

/// The two ends of a queue threaded through the slots.
#[derive(Clone, Copy)]
struct Ends {
    newest: usize,
    oldest: usize,
    bytes: u64,
}

const EMPTY: Ends = Ends {
    newest: NONE,
    oldest: NONE,
    bytes: 0,
};

/// The cache. Slots are reused, so that it stops allocating once it is full.
pub(crate) struct RamCache {
    budget: u64,
    /// The largest tile so far.
    tile_bytes: u64,
    places: HashMap<Key, usize>,
    slots: Vec<Option<Slot>>,
    free: Vec<usize>,
    fresh: Ends,
    used: Ends,
    pinned_bytes: u64,
}

/// A tile from the cache.
pub(crate) struct Found {
    pub(crate) data: Arc<TileData>,
    /// False for the first time that a tile is handed out after it arrived.
    pub(crate) again: bool,
}

impl RamCache {
    /// An empty cache that holds at most `budget` bytes beside the roots.
    pub(crate) fn new(budget: u64) -> Self {
        let (places, slots, free) = (HashMap::new(), Vec::new(), Vec::new());
        Self {
            budget,
            tile_bytes: 0,
            places,
            slots,
            free,
            fresh: EMPTY,
            used: EMPTY,
            pinned_bytes: 0,
        }
    }

    /// All bytes held.
    pub(crate) const fn bytes(&self) -> u64 {
        self.fresh.bytes + self.used.bytes + self.pinned_bytes
    }

    /// How many tiles are held.
    #[cfg(test)]
    fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether one more tile may be loaded while `coming` others are: false where tiles that nobody has taken
    /// yet would be evicted for it.
    pub(crate) const fn has_room(&self, coming: usize) -> bool {
        let awaited = self.fresh.bytes + coming as u64 * self.tile_bytes;
        awaited == 0 || awaited + self.tile_bytes <= self.budget
    }

    /// Tells how large tiles are going to be.
    pub(crate) fn expect(&mut self, tile_bytes: u64) {
        self.tile_bytes = self.tile_bytes.max(tile_bytes);
    }

    /// Whether a tile is held; does not count as use.
    pub(crate) fn contains(&self, key: &Key) -> bool {
        self.places.contains_key(key)
    }

    /// Where a tile that is held was found; does not count as use.
    pub(crate) fn level(&self, key: &Key) -> Option<Level> {
        Some(self.slot(*self.places.get(key)?)?.level)
    }

    /// How large tiles are.
    pub(crate) const fn tile_bytes(&self) -> u64 {
        self.tile_bytes
    }

    /// A tile, which becomes the most recently used one.
    pub(crate) fn get(&mut self, key: &Key) -> Option<Found> {
        let place = *self.places.get(key)?;
        if self.slots.get(place)?.as_ref()?.queue != Queue::Pinned {
            self.unlink(place);
            self.link(place, Queue::Used);
        }
        let slot = self.slots.get_mut(place)?.as_mut()?;
        let again = std::mem::replace(&mut slot.served, true);
        Some(Found {
            data: Arc::clone(&slot.data),
            again,
        })
    }

    /// Adds or replaces a tile and evicts others until the budget holds; returns how many. A single tile
    /// larger than the budget is kept until the next one comes.
    pub(crate) fn insert(&mut self, key: Key, data: Arc<TileData>, level: Level) -> usize {
        self.remove(&key);
        let bytes = data.byte_size() as u64;
        self.expect(bytes);
        let queue = if key.1.level() == 0 {
            Queue::Pinned
        } else {
            Queue::Fresh
        };
        let slot = Slot {
            key,
            data,
            bytes,
            queue,
            level,
            served: false,
            newer: NONE,
            older: NONE,
        };
        let place = if let Some(place) = self.free.pop() {
            place
        } else {
            self.slots.push(None);
            self.slots.len() - 1
        };
        if let Some(cell) = self.slots.get_mut(place) {
            *cell = Some(slot);
        }
        self.places.insert(key, place);
        if queue == Queue::Pinned {
            self.pinned_bytes += bytes;
            return 0;
        }
        self.link(place, queue);
        self.shrink(place)
    }

    /// Fresh tiles that `wished` denies lose their protection.
    pub(crate) fn demote(&mut self, wished: impl Fn(&Key) -> bool) {
        let mut place = self.fresh.oldest;
        while let Some(slot) = self.slot(place) {
            let (key, newer) = (slot.key, slot.newer);
            if !wished(&key) {
                self.unlink(place);
                self.link(place, Queue::Used);
            }
            place = newer;
        }
    }

    /// Drops all tiles of a data set, roots too.
    pub(crate) fn purge(&mut self, dataset: DatasetId) {
        let keys: Vec<Key> = self
            .places
            .keys()
            .filter(|key| key.0 == dataset)
            .copied()
            .collect();
        for key in keys {
            self.remove(&key);
        }
    }

    fn shrink(&mut self, keep: usize) -> usize {
        let mut evicted = 0;
        while self.fresh.bytes + self.used.bytes > self.budget {
            let place = if self.used.oldest == NONE {
                self.fresh.oldest
            } else {
                self.used.oldest
            };
            let Some(slot) = self.slot(place).filter(|_| place != keep) else {
                break;
            };
            let key = slot.key;
            self.remove(&key);
            evicted += 1;
        }
        evicted
    }

    fn remove(&mut self, key: &Key) {
        let Some(place) = self.places.remove(key) else {
            return;
        };
        self.unlink(place);
        if let Some(slot) = self.slots.get_mut(place).and_then(Option::take) {
            if slot.queue == Queue::Pinned {
                self.pinned_bytes -= slot.bytes;
            }
            self.free.push(place);
        }
    }

    fn slot(&self, place: usize) -> Option<&Slot> {
        self.slots.get(place)?.as_ref()
    }

    fn slot_mut(&mut self, place: usize) -> Option<&mut Slot> {
        self.slots.get_mut(place)?.as_mut()
    }

    const fn ends(&mut self, queue: Queue) -> Option<&mut Ends> {
        match queue {
            Queue::Pinned => None,
            Queue::Fresh => Some(&mut self.fresh),
            Queue::Used => Some(&mut self.used),
        }
    }

    fn unlink(&mut self, place: usize) {
        let Some(slot) = self.slot(place) else { return };
        let (queue, newer, older, bytes) = (slot.queue, slot.newer, slot.older, slot.bytes);
        let Some(ends) = self.ends(queue) else { return };
        ends.bytes -= bytes;
        if ends.newest == place {
            ends.newest = older;
        }
        if ends.oldest == place {
            ends.oldest = newer;
        }
        if let Some(slot) = self.slot_mut(newer) {
            slot.older = older;
        }
        if let Some(slot) = self.slot_mut(older) {
            slot.newer = newer;
        }
    }

    fn link(&mut self, place: usize, queue: Queue) {
        let Some(newest) = self.ends(queue).map(|ends| ends.newest) else {
            return;
        };
        let Some(slot) = self.slot_mut(place) else {
            return;
        };
        (slot.queue, slot.newer, slot.older) = (queue, NONE, newest);
        let bytes = slot.bytes;
        if let Some(slot) = self.slot_mut(newest) {
            slot.newer = place;
        }
        if let Some(ends) = self.ends(queue) {
            ends.newest = place;
            ends.bytes += bytes;
            if ends.oldest == NONE {
                ends.oldest = place;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use crate::format::{Kind, NODE_COUNT, Samples, Validity};
    use proptest::prelude::*;

    fn data(tile: Tile) -> Arc<TileData> {
        let samples = Samples::U8(vec![0; NODE_COUNT]);
        Arc::new(TileData::new(tile, Kind::Sar, 1, samples, Validity::All).unwrap())
    }

    fn tile(n: u32) -> Tile {
        Tile::new(0, 5, n, 0).unwrap()
    }

    fn size() -> u64 {
        data(tile(0)).byte_size() as u64
    }

    #[test]
    fn the_least_recently_used_goes_first_and_roots_never() {
        let id = DatasetId::random();
        let mut cache = RamCache::new(3 * size());
        for root in Tile::ROOTS {
            assert_eq!(cache.insert((id, root), data(root), Level::Disk), 0);
        }
        for n in 0..3 {
            cache.insert((id, tile(n)), data(tile(n)), Level::Disk);
            cache.get(&(id, tile(n))).unwrap();
        }
        cache.get(&(id, tile(0))).unwrap();
        assert_eq!(cache.insert((id, tile(3)), data(tile(3)), Level::Disk), 1);
        let held = |cache: &RamCache| {
            (0..4)
                .filter(|n| cache.contains(&(id, tile(*n))))
                .collect::<Vec<_>>()
        };
        assert_eq!(held(&cache), [0, 2, 3]);
        assert!(Tile::ROOTS.iter().all(|root| cache.contains(&(id, *root))));
        cache.purge(id);
        assert_eq!((cache.len(), cache.bytes()), (0, 0));
    }

    #[test]
    fn fresh_tiles_outlive_used_ones_and_fill_the_room() {
        let id = DatasetId::random();
        let mut cache = RamCache::new(2 * size());
        cache.insert((id, tile(0)), data(tile(0)), Level::Disk);
        cache.insert((id, tile(1)), data(tile(1)), Level::Disk);
        assert!(!cache.has_room(0));
        assert!(!cache.get(&(id, tile(1))).unwrap().again);
        assert!(cache.get(&(id, tile(1))).unwrap().again);
        assert!(cache.has_room(0) && !cache.has_room(1));
        // Tile 1 is the more recent one, but it was taken; tile 0 was not.
        cache.insert((id, tile(2)), data(tile(2)), Level::Disk);
        assert!(cache.contains(&(id, tile(0))) && !cache.contains(&(id, tile(1))));
        cache.demote(|key| key.1 != tile(0));
        assert!(cache.has_room(0));
        cache.insert((id, tile(3)), data(tile(3)), Level::Disk);
        assert!(!cache.contains(&(id, tile(0))));
    }

    proptest! {
        #[test]
        fn agrees_with_a_simple_list(steps in prop::collection::vec((0_u32..12, 0_u8..4), 0..200)) {
            // The model: (tile, fresh), oldest first within each of the two classes.
            let id = DatasetId::random();
            let (budget, mut cache) = (5, RamCache::new(5 * size()));
            let (mut fresh, mut used): (Vec<u32>, Vec<u32>) = (Vec::new(), Vec::new());
            let datas: Vec<_> = (0..12).map(|n| data(tile(n))).collect();
            for (n, step) in steps {
                match step {
                    0 => {
                        fresh.retain(|other| *other != n);
                        used.retain(|other| *other != n);
                        fresh.push(n);
                        while fresh.len() + used.len() > budget {
                            if used.is_empty() { fresh.remove(0); } else { used.remove(0); }
                        }
                        cache.insert((id, tile(n)), Arc::clone(&datas[n as usize]), Level::Disk);
                    }
                    1 | 2 => {
                        let held = fresh.contains(&n) || used.contains(&n);
                        prop_assert_eq!(cache.get(&(id, tile(n))).is_some(), held);
                        if held {
                            fresh.retain(|other| *other != n);
                            used.retain(|other| *other != n);
                            used.push(n);
                        }
                    }
                    _ => {
                        cache.demote(|key| key.1.x() != n);
                        if fresh.contains(&n) {
                            fresh.retain(|other| *other != n);
                            used.push(n);
                        }
                    }
                }
                prop_assert_eq!(cache.len(), fresh.len() + used.len());
                prop_assert_eq!(cache.bytes(), cache.len() as u64 * size());
                prop_assert_eq!(cache.has_room(0), fresh.len() < budget);
                prop_assert!(fresh.iter().chain(&used).all(|n| cache.contains(&(id, tile(*n)))));
            }
        }
    }
}
