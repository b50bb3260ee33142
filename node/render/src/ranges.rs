//! What the level of detail asks of a scene, answered by indices and parameters alone, and so the same on every node.
//! In: tiles. Out: bounds of heights, derived from the bounds of the data by the parameters (Lambers, §1.4.2) and
//! never by scanning; whether a tile is worth dividing. It reads no samples.

use geodesy::{Ellipsoid, Tile};
use terrain::{HeightRanges, Relief};

use crate::layer::{Blend, Elevation, Process};
use crate::loaded::{Active, LoadedScene, ParameterSet};
use crate::scene::Refine;
use crate::source::Source;

/// From this level on the places of vertices are exact to a few micrometres.
pub(crate) const FLAT_LEVEL: u8 = 8;
/// How far an inner vertex of a root may be off its place, as a share of the planet's radius: the remainder of the
/// quadratics that places are computed by (measured: 4.4·10⁻⁵). With each level it is an eighth.
const ROOT_OFF: f64 = 4.7e-5;
/// The share of τ that this may come to.
pub(crate) const CURVED_SHARE: f64 = 0.02;

/// How far an inner vertex of a leaf of a level above [`FLAT_LEVEL`] may be off its place, in metres.
pub(crate) fn curved_m(ellipsoid: &Ellipsoid, level: u8) -> f64 {
    ROOT_OFF * ellipsoid.semi_major_m / f64::from(1_u32 << (3 * level.min(FLAT_LEVEL)))
}

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

    fn nearest_m(&self, tile: Tile, pixels_per_radian: f64) -> f64 {
        if tile.level() >= FLAT_LEVEL {
            return 0.0;
        }
        let data = &self.0.data;
        pixels_per_radian * curved_m(&data.ellipsoid, tile.level()) / (CURVED_SHARE * data.tau_px)
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
                Some((processed(active, source, source.bounds)?, true))
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
            // Where it has holes is not known without its samples.
            Some((processed(active, source, source.bounds_in(tile)?)?, true))
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

/// Bounds of a layer's processed heights somewhere, and whether it may have holes there.
pub(crate) type LayerRange = ((f64, f64), bool);

/// Bounds of what fusion can make of the layers' bounds. Ground without data lies on the ellipsoid.
pub(crate) fn fused_range(
    set: &ParameterSet,
    range_of: &dyn Fn(&Active) -> Option<LayerRange>,
) -> (f64, f64) {
    let mut below: Option<(f64, f64)> = None;
    let order = |active: &Active| (active.fusion.priority, active.fusion.blend);
    // Nothing covers the ground as yet, and so nothing is seen through what does.
    let (mut holes, mut solid) = (true, true);
    for group in set.heights.chunk_by(|a, b| order(a) == order(b)) {
        let mut own: Option<(f64, f64)> = None;
        let (mut group_holes, mut opaque) = (true, true);
        for active in group {
            let Some((range, layer_holes)) = range_of(active) else {
                continue;
            };
            // A weighted mean lies within the bounds of its parts.
            own = Some(own.map_or(range, |own| around(own, range)));
            group_holes &= layer_holes;
            opaque &= active.fusion.opacity >= 1.0;
        }
        let Some(own) = own else {
            continue;
        };
        below = Some(match below {
            None => own,
            Some(under) => {
                let mut all = match group.first().map(|active| active.fusion.blend) {
                    Some(Blend::Add) => (under.0 + own.0, under.1 + own.1),
                    Some(Blend::Multiply) => products(under, own),
                    _ => own,
                };
                // Over holes, and over what is not opaque, the layer stands for itself.
                if holes || !solid {
                    all = around(all, own);
                }
                // Through its holes, and where it is not opaque, shows what is below.
                if group_holes || !opaque {
                    all = around(all, under);
                }
                all
            }
        });
        // Where the group is, one of both must be opaque; where it is not, what is below.
        solid = (opaque || (solid && !holes)) && (solid || !group_holes);
        holes &= group_holes;
    }
    match below {
        None => (0.0, 0.0),
        Some(range) if holes => around(range, (0.0, 0.0)),
        Some(range) => range,
    }
}

fn products(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    let all = [a.0 * b.0, a.0 * b.1, a.1 * b.0, a.1 * b.1];
    (
        all.into_iter().fold(f64::INFINITY, f64::min),
        all.into_iter().fold(f64::NEG_INFINITY, f64::max),
    )
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use shaders::cpu;

    use super::*;
    use crate::layer::Fusion;
    use crate::process::fuse;
    use crate::test_planet::HEIGHTS;

    /// Numbers below `most` without any order.
    struct Random(u64);

    impl Random {
        fn below(&mut self, most: u64) -> u64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (self.0 >> 33) % most
        }
    }

    #[test]
    fn whatever_is_fused_lies_within_the_bounds() {
        let mut random = Random(5);
        let mut narrow = 0;
        for _ in 0..4000 {
            let count = 1 + random.below(4) as usize;
            let mut heights: Vec<Active> = (0..count)
                .map(|layer| Active {
                    layer,
                    fusion: Fusion {
                        priority: random.below(3) as i32,
                        weight: 1.0 + random.below(3) as f64,
                        opacity: [0.3, 0.7, 1.0, 1.0][random.below(4) as usize],
                        blend: [Blend::Normal, Blend::Normal, Blend::Add, Blend::Multiply]
                            [random.below(4) as usize],
                    },
                    process: Process::Elevation(HEIGHTS),
                })
                .collect();
            heights.sort_by_key(|active| (active.fusion.priority, active.fusion.blend));
            let ranges: Vec<LayerRange> = (0..count)
                .map(|_| {
                    let low = random.below(200) as f64 - 100.0;
                    ((low, low + random.below(50) as f64), random.below(3) == 0)
                })
                .collect();
            let fusions: Vec<Fusion> = heights.iter().map(|active| active.fusion).collect();
            let set = ParameterSet {
                heights,
                ..ParameterSet::default()
            };
            let (low, high) = fused_range(&set, &|active| ranges.get(active.layer).copied());
            let uniform = fuse(&fusions);
            for _ in 0..20 {
                let samples: Vec<Option<f32>> = set
                    .heights
                    .iter()
                    .map(|active| {
                        let ((from, to), holes) = ranges[active.layer];
                        let share = random.below(5) as f64 / 4.0;
                        let hole = holes && random.below(2) == 0;
                        (!hole).then_some((from + (to - from) * share) as f32)
                    })
                    .collect();
                let fused = cpu::fuse_elevation::fuse(&uniform, &samples).map_or(0.0, f64::from);
                let slack = 1e-3 + 1e-5 * low.abs().max(high.abs());
                assert!(
                    (low - slack..=high + slack).contains(&fused),
                    "{fused} is not in {low}…{high}: {set:?} {ranges:?} {samples:?}"
                );
            }
            narrow += usize::from(!(low..=high).contains(&0.0));
        }
        assert!(narrow > 400, "only {narrow} bounds leave 0 out");
    }
}
