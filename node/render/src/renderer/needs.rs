//! Which data drawing a view would show, whether it is there or not.
//!
//! In: a view of a scene. Out: every tile that drawing would ask the tile cache for: what visible leaves show, the
//! elevation around them, the roots that stand in for the rest. It asks for nothing and draws nothing; it selects as
//! drawing does, for the same budgets.

use std::collections::HashSet;

use geodesy::Tile;
use tiles::{DatasetId, Wish};

use crate::error::RenderError;
use crate::gather::priority;
use crate::loaded::LoadedScene;
use crate::process::Work;
use crate::renderer::blocks::plan_blocks;
use crate::renderer::{Renderer, ViewPoint};
use crate::sight::{Most, Sight};
use crate::source::Source;

impl Renderer {
    /// The tiles that the view of a scene shows once nothing is missing, each once, with the priority that drawing
    /// would give it. The scene becomes the shown one.
    ///
    /// # Errors
    /// [`RenderError::UnknownScene`] where the scene was not prepared.
    pub fn needs(&mut self, view: &ViewPoint, revision: u64) -> Result<Vec<Wish>, RenderError> {
        self.show(revision)?;
        let Some(scene) = &self.scene else {
            return Err(RenderError::UnknownScene { revision });
        };
        let blocks = plan_blocks(&self.outputs, view);
        let most = Most {
            leaves: self.geometries.capacity() / 2,
            tiles: self.textures.most_tiles(),
        };
        let gaze = -view.room.z_axis;
        let (mut wishes, mut known) = (Vec::new(), HashSet::new());
        for (eye, _, sight) in scene.sights(view, &blocks, most).of_eyes {
            for (id, tile) in needs_of(scene, &sight) {
                if known.insert((id, tile)) {
                    let urgency = priority(&scene.data.ellipsoid, (eye, gaze), tile);
                    wishes.push((id, tile, urgency));
                }
            }
        }
        Ok(wishes)
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
