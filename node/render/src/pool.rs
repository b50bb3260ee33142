//! Layers of a texture array, lent to tiles' results: least recently used ones are lent again.
//! In: results that are wanted, frame numbers. Out: layer numbers. Bookkeeping only; it owns no texture.

use std::collections::HashMap;

use geodesy::Tile;

/// What a layer holds: a tile, and a number that stands for everything that went into its result.
pub(crate) type LayerKey = (Tile, u64);

/// Which tile holds which layer. Layer 0 is never lent: it is the neutral picture.
#[derive(Debug)]
pub(crate) struct LayerPool {
    layers: HashMap<LayerKey, Slot>,
    free: Vec<u32>,
    capacity: u32,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    layer: u32,
    used: u64,
}

impl LayerPool {
    /// A pool over layers 1…`layers` − 1.
    pub(crate) fn new(layers: u32) -> Self {
        Self {
            layers: HashMap::new(),
            free: (1..layers).rev().collect(),
            capacity: layers,
        }
    }

    /// Adds layers up to `layers` in all. What is lent stays lent.
    pub(crate) fn grow(&mut self, layers: u32) {
        let added = (self.capacity..layers).rev();
        // Old free layers are lent first.
        self.free.splice(0..0, added);
        self.capacity = self.capacity.max(layers);
    }

    /// The layer of a tile, which counts as used in this frame.
    pub(crate) fn get(&mut self, tile: LayerKey, frame: u64) -> Option<u32> {
        let slot = self.layers.get_mut(&tile)?;
        slot.used = frame;
        Some(slot.layer)
    }

    /// True where the result holds a layer. Does not count as use.
    #[cfg(test)]
    fn contains(&self, tile: LayerKey) -> bool {
        self.layers.contains_key(&tile)
    }

    /// Lends a layer to a tile: a free one, else that of the tile unused for longest. `None` while every
    /// layer is in use in this frame: the budget is too small for the view.
    pub(crate) fn lend(&mut self, tile: LayerKey, frame: u64) -> Option<u32> {
        if let Some(layer) = self.get(tile, frame) {
            return Some(layer);
        }
        let layer = self.free.pop().or_else(|| self.evict(frame))?;
        self.layers.insert(tile, Slot { layer, used: frame });
        Some(layer)
    }

    /// Takes a layer back that was lent for a result that could not be made.
    pub(crate) fn take_back(&mut self, tile: LayerKey) {
        if let Some(slot) = self.layers.remove(&tile) {
            self.free.push(slot.layer);
        }
    }

    fn evict(&mut self, frame: u64) -> Option<u32> {
        let oldest = self
            .layers
            .iter()
            .filter(|(_, slot)| slot.used < frame)
            .min_by_key(|(tile, slot)| (slot.used, **tile))
            .map(|(tile, _)| *tile)?;
        self.layers.remove(&oldest).map(|slot| slot.layer)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;

    fn tile(x: u32) -> LayerKey {
        (Tile::new(0, 5, x, 0).unwrap(), 7)
    }

    #[test]
    fn the_oldest_layer_is_lent_again_and_layer_zero_never() {
        let mut pool = LayerPool::new(3);
        let first = pool.lend(tile(1), 1).unwrap();
        let second = pool.lend(tile(2), 2).unwrap();
        assert!(first != 0 && second != 0 && first != second);
        assert_eq!(pool.lend(tile(3), 3), Some(first));
        assert!(!pool.contains(tile(1)) && pool.contains(tile(2)));
    }

    #[test]
    fn a_pool_grows_without_moving_what_is_lent() {
        let mut pool = LayerPool::new(2);
        let first = pool.lend(tile(1), 1).unwrap();
        assert_eq!(pool.lend(tile(2), 1), None);
        pool.grow(4);
        let more = [
            pool.lend(tile(2), 1).unwrap(),
            pool.lend(tile(3), 1).unwrap(),
        ];
        assert!(!more.contains(&first) && more[0] != more[1] && !more.contains(&0));
        assert_eq!(pool.get(tile(1), 2), Some(first));
    }

    #[test]
    fn layers_in_use_in_this_frame_stay() {
        let mut pool = LayerPool::new(3);
        pool.lend(tile(1), 7).unwrap();
        pool.lend(tile(2), 7).unwrap();
        assert_eq!(pool.lend(tile(3), 7), None);
    }
}
