//! What an eye sees of a scene: leaves of the planet, selected by what they cover on the screen, then culled.
//! In: an eye, blocks, limits. Out: leaves. Which data they show, and whether it is there, is decided elsewhere.

use std::collections::HashSet;

use geodesy::{Horizon, Tile};
use glam::DVec3;
use terrain::{Frustum, LodLimits, LodView, Selection};

use crate::loaded::LoadedScene;
use crate::ranges::Ranges;
use crate::renderer::{PlannedBlock, ViewPoint};
use crate::room::{Bound, Most};

/// Leaves over the whole planet that one selection may have.
const MOST_LEAVES: usize = 32_768;

/// What an eye sees: leaves of the planet, those visible in each block, and in any.
pub(crate) struct Sight {
    pub(crate) selection: Selection,
    pub(crate) visible_in: Vec<Vec<Tile>>,
    pub(crate) visible: Vec<Tile>,
}

/// What all eyes of a view see.
pub(crate) struct Sights {
    /// Of each eye that has any block: the eye, its blocks, its leaves.
    pub(crate) of_eyes: Vec<(DVec3, Vec<usize>, Sight)>,
    /// The visible leaves of all eyes: each once.
    pub(crate) visible: Vec<Tile>,
    /// What keeps tiles from being as fine as the scene asks for, if anything does.
    pub(crate) bound: Option<Bound>,
}

impl Sights {
    /// The side in pixels beyond which tiles were split; 0 where nothing is seen.
    pub(crate) fn achieved_tile_px(&self) -> f64 {
        let selections = self.of_eyes.iter().map(|(_, _, sight)| &sight.selection);
        selections
            .map(Selection::achieved_tile_px)
            .fold(0.0, f64::max)
    }
}

impl LoadedScene {
    /// What each eye sees that has any block. Where all together see more than the budgets hold, all split tiles later,
    /// by whole factors of √2, until it fits: eyes of one room see almost the same tiles, and in the same detail.
    pub(crate) fn sights(&self, view: &ViewPoint, blocks: &[PlannedBlock], most: Most) -> Sights {
        let mut tile_px = self.data.tile_px;
        let mut bound = None;
        loop {
            let of_eyes = self.sights_at(view, blocks, tile_px);
            let (leaves, visible) = together(&of_eyes);
            let most = most.for_eyes(of_eyes.len());
            let beyond = if leaves.len() > most.leaves {
                Some(Bound::Leaves)
            } else if self.distinct_tiles(&visible) > most.tiles {
                Some(Bound::Tiles)
            } else {
                None
            };
            let are_roots = |selection: &Selection| selection.leaves().len() <= Tile::ROOTS.len();
            // Six roots are the least there can be.
            let is_least = of_eyes.iter().all(|(_, _, eye)| are_roots(&eye.selection));
            bound = beyond.or(bound);
            let mut sights = Sights {
                of_eyes,
                visible,
                bound,
            };
            let achieved_px = sights.achieved_tile_px();
            if beyond.is_none() || is_least {
                if achieved_px > self.data.tile_px {
                    sights.bound = bound.or(Some(Bound::Selection));
                }
                return sights;
            }
            tile_px = achieved_px.max(tile_px) * std::f64::consts::SQRT_2;
        }
    }

    fn sights_at(
        &self,
        view: &ViewPoint,
        blocks: &[PlannedBlock],
        tile_px: f64,
    ) -> Vec<(DVec3, Vec<usize>, Sight)> {
        let limits = LodLimits {
            deepest_level: self.data.deepest_level,
            tile_px,
            most_tiles: MOST_LEAVES,
        };
        let eyes = view.eyes.iter().enumerate();
        let sights = eyes.filter_map(|(index, eye)| {
            let of_eye: Vec<usize> = (0..blocks.len())
                .filter(|block| blocks[*block].eye == index)
                .collect();
            (!of_eye.is_empty()).then(|| {
                let sight = self.see(*eye, view.pixels_per_radian, &of_eye, blocks, &limits);
                (*eye, of_eye, sight)
            })
        });
        sights.collect()
    }

    /// What an eye sees while nothing but the roots is to be drawn.
    pub(crate) fn roots_seen(
        &self,
        eye: DVec3,
        pixels_per_radian: f64,
        of_eye: &[usize],
        blocks: &[PlannedBlock],
    ) -> Sight {
        let limits = LodLimits {
            deepest_level: 0,
            tile_px: self.data.tile_px,
            most_tiles: MOST_LEAVES,
        };
        self.see(eye, pixels_per_radian, of_eye, blocks, &limits)
    }

    /// Selects for an eye and culls for each block.
    fn see(
        &self,
        eye: DVec3,
        pixels_per_radian: f64,
        of_eye: &[usize],
        blocks: &[PlannedBlock],
        limits: &LodLimits,
    ) -> Sight {
        let ellipsoid = &self.data.ellipsoid;
        let ranges = Ranges(self);
        let horizon = Horizon::new(ellipsoid, ranges.floor_m(), eye);
        let lod = LodView {
            eye,
            pixels_per_radian,
        };
        let selection = terrain::select(ellipsoid, &lod, limits, &ranges);
        let visible_in: Vec<Vec<Tile>> = of_eye
            .iter()
            .map(|index| {
                let frustum = Frustum::from_corners(eye, blocks[*index].block.corner_directions);
                terrain::cull(ellipsoid, &selection, &[frustum], &horizon, &ranges)
            })
            .collect();
        let mut visible: Vec<Tile> = visible_in.iter().flatten().copied().collect();
        visible.sort_unstable();
        visible.dedup();
        Sight {
            selection,
            visible_in,
            visible,
        }
    }

    /// Tiles whose fused heights or fused colours these leaves show, whichever are more.
    pub(crate) fn distinct_tiles(&self, leaves: &[Tile]) -> usize {
        let count = |tile_of: &dyn Fn(Tile) -> Option<Tile>| {
            let tiles: HashSet<Tile> = leaves.iter().filter_map(|leaf| tile_of(*leaf)).collect();
            tiles.len()
        };
        let heights = count(&|leaf| self.heights_tile(leaf));
        heights.max(count(&|leaf| self.colours_tile(leaf)))
    }
}

/// The leaves of all sights with those around them, and the visible ones among them: each once.
fn together(sights: &[(DVec3, Vec<usize>, Sight)]) -> (Vec<Tile>, Vec<Tile>) {
    let once = |mut tiles: Vec<Tile>| {
        tiles.sort_unstable();
        tiles.dedup();
        tiles
    };
    let around = sights
        .iter()
        .flat_map(|(_, _, sight)| terrain::ring(&sight.selection, &sight.visible));
    let visible = sights.iter().flat_map(|(_, _, sight)| &sight.visible);
    (once(around.collect()), once(visible.copied().collect()))
}
