//! Which elevation each leaf shows: per layer the finest data of its lineage that is in memory.
//! In: leaves, what the tile cache holds. Out: data by leaf, wishes for better. It waits for nothing.

use std::collections::{HashMap, HashSet};

use geodesy::Tile;
use glam::DVec3;
use terrain::Lattice;
use tiles::{Lookup, TileCache};

use crate::gather::Gather;
use crate::source::{Heights, Source};

/// The elevation of one layer that this frame uses.
#[derive(Default)]
pub(crate) struct GatheredHeights {
    /// Leaf → the tile whose data it shows; leaves that the layer has nothing for are asked, but not here.
    pub(crate) shown: HashMap<Tile, Tile>,
    asked: HashSet<Tile>,
    /// Every tile that is shown.
    resident: HashMap<Tile, Heights>,
    /// Tiles that some leaf should show and does not, and where they were at that moment: whoever looked again might find
    /// that one has come meanwhile, and take the picture without it for complete.
    missing: HashMap<Tile, Lookup>,
}

impl GatheredHeights {
    /// The data of a tile that some leaf shows.
    pub(crate) fn data(&self, tile: Tile) -> Option<&dyn Lattice> {
        self.resident
            .get(&tile)
            .map(|heights| heights as &dyn Lattice)
    }

    /// The level of the data that a leaf shows, for the seams of another leaf beside it. A leaf that was not asked lies
    /// beyond all that can be seen; there the other's own data counts.
    pub(crate) fn level_beside(&self, leaf: Tile, beside: Tile) -> Option<u8> {
        let shown = if self.asked.contains(&beside) {
            beside
        } else {
            leaf
        };
        self.shown.get(&shown).map(|tile| tile.level())
    }

    fn add(&mut self, cache: &TileCache, source: &Source, leaf: Tile) {
        if !self.asked.insert(leaf) {
            return;
        }
        let Some(best) = source.best(leaf) else {
            return;
        };
        let data = match cache.get(source.id, best) {
            Lookup::Ready(data) => data,
            elsewhere => {
                self.missing.entry(best).or_insert(elsewhere);
                let Some(data) = source.stand_in(cache, best) else {
                    return;
                };
                data
            }
        };
        self.shown.insert(leaf, data.tile);
        self.resident
            .entry(data.tile)
            .or_insert_with(|| Heights(data));
    }
}

impl Gather<'_> {
    /// What each of some leaves shows of every elevation layer, in the layers' order; asks for the rest.
    pub(crate) fn elevation(&mut self, eye: DVec3, leaves: &[Tile]) -> Vec<GatheredHeights> {
        let scene = self.scene;
        let sources = scene
            .elevation_layers
            .iter()
            .filter_map(|layer| scene.source(*layer));
        sources
            .map(|source| self.gather_heights(source, eye, leaves))
            .collect()
    }

    fn gather_heights(&mut self, source: &Source, eye: DVec3, leaves: &[Tile]) -> GatheredHeights {
        let mut gathered = GatheredHeights::default();
        for leaf in leaves {
            gathered.add(self.cache, source, *leaf);
        }
        let mut missing: Vec<(Tile, Lookup)> = gathered.missing.drain().collect();
        missing.sort_unstable_by_key(|(tile, _)| *tile);
        for tile in gathered.resident.keys() {
            self.note_drawable(source, *tile);
        }
        for (tile, found) in missing {
            let urgency = self.urgency(eye, tile);
            self.want(source, tile, &found, urgency);
        }
        gathered
    }

    /// The coarsest level of everything is always there, to stand in for the rest.
    pub(crate) fn want_roots(&mut self) {
        let scene = self.scene;
        let layers = scene.elevation_layers.iter().chain(&scene.colour_layers);
        for source in layers.filter_map(|layer| scene.source(*layer)) {
            for root in Tile::ROOTS {
                self.want(source, root, &self.cache.get(source.id, root), f32::MAX);
            }
        }
    }
}
