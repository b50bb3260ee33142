//! What the level of detail asks of a scene, answered by indices and parameters alone, and so the same on every node.
//! In: tiles. Out: bounds of heights, derived from the bounds of the data by the parameters (Lambers, §1.4.2) and
//! never by scanning; whether a tile is worth dividing. It reads no samples.

use geodesy::Tile;
use terrain::{HeightRanges, Relief};

use crate::layer::{Blend, Elevation, Process};
use crate::loaded::{Active, LoadedScene, ParameterSet};
use crate::scene::Refine;
use crate::source::Source;

/// How deep the planet is divided for its curvature alone, whatever data there is: from this level on the places of
/// vertices are exact to a few micrometres.
pub(crate) const FLAT_LEVEL: u8 = 8;

/// How much finer than the data rims and lines are drawn: at most to the hundredth of a sample. Beyond that, 32-bit
/// heights have no slope left from node to node.
const SHARP_LEVELS: u8 = 7;

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
                let Some((best, range)) = self.best_range(active, tile) else {
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
        // A base patch has vertices on every node of data this many levels up; a refined mesh on its own.
        let reach = match scene.data.refine {
            Refine::Off => (geodesy::LATTICE_BITS - 1).saturating_sub(scene.data.refinement),
            Refine::Fine | Refine::BottomUp | Refine::TopDown => 0,
        };
        let meshed = scene
            .elevation_layers
            .iter()
            .filter_map(|layer| scene.source(*layer)?.best(tile))
            .map(Tile::level)
            .max()
            .unwrap_or_default();
        let visible = scene.elevation_layers.iter().chain(&scene.colour_layers);
        let finest = scene
            .elevation_layers
            .iter()
            .chain(&scene.colour_layers)
            .filter_map(|layer| scene.source(*layer)?.best(tile))
            .map(Tile::level)
            .max();
        // The rim of a lens and lines of equal height are sharp beyond the data.
        let sharp = finest.is_some_and(|finest| {
            let lines = scene.sharp && !scene.elevation_layers.is_empty();
            let rim = |heights| scene.sets_in(tile, heights).len() > 1;
            tile.level() < finest + SHARP_LEVELS && (lines || rim(true) || rim(false))
        });
        sharp
            || tile.level() < FLAT_LEVEL
            || tile.level() < meshed + reach
            || visible
                .filter_map(|layer| scene.source(*layer))
                .any(|source| source.is_finer_below(tile))
    }
}

impl Ranges<'_> {
    /// The lowest height drawn anywhere.
    pub(crate) fn floor_m(&self) -> f64 {
        let of_set = |set: &ParameterSet| {
            let whole = |active: &Active| {
                let source = self.0.source(active.layer)?;
                processed(active, source, source.bounds)
            };
            fused_range(set, &whole).0
        };
        self.0.sets.iter().map(of_set).fold(0.0, f64::min)
    }

    fn find_range_m(&self, tile: Tile) -> (f64, f64) {
        // Ground without data lies on the ellipsoid.
        let mut range = (0.0, 0.0);
        let shown = |active: &Active| {
            let source = self.0.source(active.layer)?;
            processed(active, source, source.bounds_in(tile)?)
        };
        for set in self.0.sets_in(tile, true) {
            range = around(range, fused_range(&self.0.sets[set], &shown));
        }
        range
    }

    /// The tile whose data a layer shows in `tile` at best, and the bounds of what becomes of it.
    fn best_range(&self, active: &Active, tile: Tile) -> Option<(Tile, (f64, f64))> {
        let source = self.0.source(active.layer)?;
        let best = source.best(tile)?;
        let range = source.data.index.range(best)?;
        Some((best, processed(active, source, range)?))
    }
}

/// Bounds of what fusion can make of the layers' bounds, wherever some of them may have holes.
fn fused_range(set: &ParameterSet, range_of: &dyn Fn(&Active) -> Option<(f64, f64)>) -> (f64, f64) {
    let mut below = (0.0, 0.0);
    let order = |active: &Active| (active.fusion.priority, active.fusion.blend);
    for group in set.heights.chunk_by(|a, b| order(a) == order(b)) {
        // A weighted mean lies within the bounds of its parts.
        let Some(own) = group.iter().filter_map(range_of).reduce(around) else {
            continue;
        };
        let (low, high) = own;
        let blended = match group.first().map(|active| active.fusion.blend) {
            Some(Blend::Add) => (below.0 + low, below.1 + high),
            Some(Blend::Multiply) => {
                let products = [below.0 * low, below.0 * high, below.1 * low, below.1 * high];
                let point = |product| (product, product);
                products
                    .into_iter()
                    .fold((0.0, 0.0), |range, product| around(range, point(product)))
            }
            _ => own,
        };
        // What is below may show through, and over holes of it the layer stands alone.
        below = around(around(below, own), blended);
    }
    below
}

/// Bounds in quanta to bounds of processed heights in metres.
pub(crate) fn processed(
    active: &Active,
    source: &Source,
    quanta: (f64, f64),
) -> Option<(f64, f64)> {
    let Process::Elevation(elevation) = &active.process else {
        return None;
    };
    let unit = source.data.dataset.unit();
    Some((
        height_m(elevation, quanta.0 * unit),
        height_m(elevation, quanta.1 * unit),
    ))
}

/// A height after processing. Rises with the raw height, so bounds stay bounds.
fn height_m(elevation: &Elevation, raw_m: f64) -> f64 {
    let [lowest_m, highest_m] = elevation.clamp_m;
    let height_m = (raw_m + elevation.datum_shift_m) * elevation.scale + elevation.offset_m;
    // Not `clamp`: it would panic on bounds in the wrong order.
    height_m.max(lowest_m).min(highest_m)
}

pub(crate) fn around(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0.min(b.0), a.1.max(b.1))
}
