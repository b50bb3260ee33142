//! Which data drawing a view would show, whether it is there or not.
//!
//! In: a view of a scene. Out: every tile that drawing would ask the tile cache for: what visible leaves show, the
//! elevation around them, the roots that stand in for the rest. It asks for nothing and draws nothing; it selects as
//! drawing does, for the same budget: on this device, and on one that binds as much as the budget asks for.

use std::collections::HashSet;

use geodesy::Tile;
use tiles::{DatasetId, Wish};

use crate::error::RenderError;
use crate::gather::priority;
use crate::loaded::LoadedScene;
use crate::process::Work;
use crate::renderer::blocks::plan_blocks;
use crate::renderer::{Renderer, ViewPoint};
use crate::room::{Bound, Most};
use crate::sight::Sight;
use crate::source::Source;

/// What a view needs.
#[derive(Clone, Debug)]
pub struct Needs {
    /// Tiles, each once, with the priority that drawing would give them.
    pub wishes: Vec<Wish>,
    /// The side in pixels beyond which tiles are split at least, whatever the device binds: the scene's, or more where the
    /// budget forbids it.
    pub achieved_tile_px: f64,
    /// More memory would allow no finer tiles.
    pub is_device_bound: bool,
}

impl Renderer {
    /// The tiles that the view of a scene shows once nothing is missing, on this device or on a larger one. The scene
    /// becomes the shown one.
    ///
    /// # Errors
    /// [`RenderError::UnknownScene`] where the scene was not prepared.
    pub fn needs(&mut self, view: &ViewPoint, revision: u64) -> Result<Needs, RenderError> {
        self.show(revision)?;
        let Some(scene) = &self.scene else {
            return Err(RenderError::UnknownScene { revision });
        };
        let blocks = plan_blocks(&self.outputs, view);
        let here = Most::here(&self.geometries, &self.textures);
        let of_budget = Most::of_budget(self.budget.gpu_bytes);
        // Tiles of a coarser selection are other tiles: their data is not among that of a finer one.
        let anywhere = scene.sights(view, &blocks, of_budget);
        let coarser = (here != of_budget).then(|| scene.sights(view, &blocks, here));
        let gaze = -view.room.z_axis;
        let mut needs = Needs {
            wishes: Vec::new(),
            achieved_tile_px: anywhere.achieved_tile_px(),
            is_device_bound: anywhere.bound == Some(Bound::Selection),
        };
        let mut known = HashSet::new();
        let all = [Some(anywhere), coarser].into_iter().flatten();
        for (eye, _, sight) in all.flat_map(|sights| sights.of_eyes) {
            for (id, tile) in needs_of(scene, &sight) {
                if known.insert((id, tile)) {
                    let urgency = priority(&scene.data.ellipsoid, (eye, gaze), tile);
                    needs.wishes.push((id, tile, urgency));
                }
            }
        }
        Ok(needs)
    }
}

/// What one eye's leaves show: as [`Gather`](crate::gather::Gather) wants it, without looking at what is in memory.
fn needs_of(scene: &LoadedScene, sight: &Sight) -> HashSet<(DatasetId, Tile)> {
    let sources = |layers: &'_ [usize]| -> Vec<Source> {
        let sources = layers.iter().filter_map(|layer| scene.source(*layer));
        sources.cloned().collect()
    };
    let (elevation, colours) = (
        sources(&scene.elevation_layers),
        sources(&scene.colour_layers),
    );
    let mut needs = HashSet::new();
    for source in elevation.iter().chain(&colours) {
        let index = &source.data.index;
        let roots = Tile::ROOTS.into_iter().filter(|root| index.contains(*root));
        needs.extend(roots.map(|root| (source.id, root)));
    }
    for leaf in terrain::ring(&sight.selection, &sight.visible) {
        let best = |source: &Source| Some((source.id, source.best(leaf)?));
        needs.extend(elevation.iter().filter_map(best));
    }
    let results = |heights: bool| -> HashSet<Tile> {
        let leaves = sight.visible.iter();
        leaves
            .filter_map(|leaf| match heights {
                true => scene.heights_tile(*leaf),
                false => scene.colours_tile(*leaf),
            })
            .collect()
    };
    for heights in [true, false] {
        for tile in results(heights) {
            for node in &scene.plan(tile, heights).nodes {
                if let Work::Upload { layer, source, .. } = &node.work
                    && let Some(data) = scene.source(*layer)
                {
                    needs.insert((data.id, *source));
                }
            }
        }
    }
    needs
}
