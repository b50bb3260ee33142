//! What the level of detail asks of a scene, answered by indices and parameters alone, and so the same on every node.
//! In: tiles. Out: bounds of heights, derived from the bounds of the data by the parameters (Lambers, §1.4.2) and
//! never by scanning; whether a tile is worth dividing. It reads no samples.

use geodesy::Tile;
use terrain::{HeightRanges, Relief};

use crate::layer::{Blend, Elevation, Process};
use crate::loaded::{Active, LoadedScene, ParameterSet};

/// How deep a planet without elevation is divided for its curvature alone: at this level, with the base
/// patches on top, a chord is less than a metre off the ellipsoid.
const BARE_LEVEL: u8 = 6;

/// The ranges of a scene.
pub(crate) struct Ranges<'a>(pub(crate) &'a LoadedScene);

impl HeightRanges for Ranges<'_> {
    fn range_m(&self, tile: Tile) -> (f64, f64) {
        let known = self.0.memory.borrow().ranges_m.get(&tile).copied();
        known.unwrap_or_else(|| {
            let found = self.find_range_m(tile);
            self.0.memory.borrow_mut().keep_range(tile, found);
            found
        })
    }

    fn relief(&self, tile: Tile) -> Relief {
        let flat = Relief {
            lowest_m: 0.0,
            highest_m: 0.0,
            level: tile.level(),
        };
        let mut finest: Option<(Tile, (f64, f64))> = None;
        for set in self.0.sets_in(tile, true) {
            for active in &self.0.sets[set].heights {
                let Some((best, range)) = self.processed_range(active, tile, false) else {
                    continue;
                };
                // The finest data decides; of equals the one that lies above.
                if finest.is_none_or(|(known, _)| best.level() >= known.level()) {
                    finest = Some((best, range));
                }
            }
        }
        finest.map_or(flat, |(best, (lowest_m, highest_m))| Relief {
            lowest_m,
            highest_m,
            level: best.level(),
        })
    }

    fn is_worth_dividing(&self, tile: Tile) -> bool {
        let scene = self.0;
        // A patch has vertices on every node of data this many levels up.
        let reach = (geodesy::LATTICE_BITS - 1).saturating_sub(scene.data.refinement);
        let meshed = scene
            .elevation_layers
            .iter()
            .filter_map(|layer| scene.source(*layer)?.best(tile))
            .map(Tile::level)
            .max()
            .unwrap_or(BARE_LEVEL);
        let visible = scene.elevation_layers.iter().chain(&scene.colour_layers);
        tile.level() < meshed + reach
            || visible
                .filter_map(|layer| scene.source(*layer))
                .any(|source| source.is_finer_below(tile))
    }
}

impl Ranges<'_> {
    /// The lowest height drawn anywhere.
    pub(crate) fn floor_m(&self) -> f64 {
        Tile::ROOTS
            .iter()
            .map(|root| self.range_m(*root).0)
            .fold(0.0, f64::min)
    }

    fn find_range_m(&self, tile: Tile) -> (f64, f64) {
        // Ground without data lies on the ellipsoid.
        let mut range = (0.0, 0.0);
        for set in self.0.sets_in(tile, true) {
            range = around(range, self.fused_range(&self.0.sets[set], tile));
        }
        range
    }

    /// Bounds of what fusion can make of the layers' bounds, wherever some of them may have holes.
    fn fused_range(&self, set: &ParameterSet, tile: Tile) -> (f64, f64) {
        let mut below = (0.0, 0.0);
        for group in set.heights.chunk_by(|a, b| {
            (a.fusion.priority, a.fusion.blend) == (b.fusion.priority, b.fusion.blend)
        }) {
            // A weighted mean lies within the bounds of its parts.
            let parts = group
                .iter()
                .filter_map(|active| Some(self.processed_range(active, tile, true)?.1));
            let Some(own) = parts.reduce(around) else {
                continue;
            };
            let (low, high) = own;
            let blended = match group.first().map(|active| active.fusion.blend) {
                Some(Blend::Add) => (below.0 + low, below.1 + high),
                Some(Blend::Multiply) => {
                    let products = [below.0 * low, below.0 * high, below.1 * low, below.1 * high];
                    products.into_iter().fold((0.0, 0.0), |range, product| {
                        around(range, (product, product))
                    })
                }
                _ => own,
            };
            // What is below may show through, and over holes of it the layer stands alone.
            below = around(around(below, own), blended);
        }
        below
    }

    /// The tile whose data a layer shows in `tile`, and the bounds of what becomes of it. `wide` takes in what a
    /// coarser, smoothed level mixes in from the surroundings.
    fn processed_range(
        &self,
        active: &Active,
        tile: Tile,
        wide: bool,
    ) -> Option<(Tile, (f64, f64))> {
        let Process::Elevation(elevation) = &active.process else {
            return None;
        };
        let source = self.0.source(active.layer)?;
        let best = source.best(tile)?;
        let measured = if wide {
            best.parent().unwrap_or(best)
        } else {
            best
        };
        let (lowest, highest) = source.data.index.range(measured)?;
        let unit = source.data.dataset.unit();
        let processed = (
            height_m(elevation, lowest * unit),
            height_m(elevation, highest * unit),
        );
        Some((best, processed))
    }
}

/// A height after processing. Rises with the raw height, so bounds stay bounds.
fn height_m(elevation: &Elevation, raw_m: f64) -> f64 {
    let [lowest_m, highest_m] = elevation.clamp_m;
    let height_m = (raw_m + elevation.datum_shift_m) * elevation.scale + elevation.offset_m;
    // Not `clamp`: it would panic on bounds in the wrong order.
    height_m.max(lowest_m).min(highest_m)
}

fn around(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0.min(b.0), a.1.max(b.1))
}
