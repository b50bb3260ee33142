//! Heights of vertices: the CPU twins of the elevation stages, at the few places where a mesh needs them.
//! In: a scene, a tile, the layers' samples at a vertex. Out: its height in metres, by geodetic normal and samples
//! alone, so that all leaves that share a vertex get the same bits. It processes no whole tiles.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};

use geodesy::frame::scalar_f32;
use geodesy::{Relation, Tile};
use glam::DVec3;
use shaders::{ElevationUniform, FuseUniform, cpu};

use crate::layer::Process;
use crate::loaded::LoadedScene;
use crate::process::{MOST_INPUTS, elevation_uniform, fuse};
use crate::source::Source;

/// One parameter set, ready to be applied.
struct Recipe {
    /// Per input: place in the samples, metres in a quantum, parameters.
    inputs: Vec<(usize, f64, ElevationUniform)>,
    fusion: FuseUniform,
}

/// The heights of all vertices of one scene.
pub(crate) struct VertexHeights {
    /// Of the scene and of each lens.
    recipes: Vec<Recipe>,
}

impl VertexHeights {
    pub(crate) fn new(scene: &LoadedScene) -> Self {
        let recipes = scene.sets.iter().map(|set| {
            let mut inputs = Vec::with_capacity(set.heights.len());
            let mut fusions = Vec::with_capacity(set.heights.len());
            for active in &set.heights {
                let slot = scene
                    .elevation_layers
                    .iter()
                    .position(|layer| *layer == active.layer);
                if let (Some(slot), Some(source), Process::Elevation(elevation)) =
                    (slot, scene.source(active.layer), &active.process)
                {
                    inputs.push((
                        slot,
                        source.data.dataset.unit(),
                        elevation_uniform(elevation),
                    ));
                    fusions.push(active.fusion);
                }
            }
            Recipe {
                inputs,
                fusion: fuse(&fusions),
            }
        });
        Self {
            recipes: recipes.collect(),
        }
    }

    /// The height in metres at a geodetic normal of a tile where the scene's elevation layers, in their order, have
    /// these samples. Ground without data lies on the ellipsoid.
    pub(crate) fn at(
        &self,
        scene: &LoadedScene,
        relations: &[Relation],
        normal: DVec3,
        samples: &[Option<i32>],
    ) -> f64 {
        let within =
            scene
                .lenses
                .iter()
                .zip(relations)
                .rposition(|(lens, relation)| match relation {
                    Relation::Inside => true,
                    Relation::Border => lens.circle.contains(normal),
                    Relation::Outside => false,
                });
        let set = within.map_or(0, |lens| lens + 1);
        let Some(recipe) = self.recipes.get(set) else {
            return 0.0;
        };
        let mut heights = [None; MOST_INPUTS];
        for (height, (slot, unit_m, uniform)) in heights.iter_mut().zip(&recipe.inputs) {
            let quanta = samples.get(*slot).copied().flatten();
            *height = quanta.map(|quanta| {
                cpu::elevation::height(uniform, scalar_f32(f64::from(quanta) * unit_m))
            });
        }
        cpu::fuse_elevation::fuse(&recipe.fusion, &heights).map_or(0.0, f64::from)
    }
}

/// A number that stands for all parameters that decide heights in a tile.
pub(crate) fn heights_content(scene: &LoadedScene, tile: Tile) -> u64 {
    let mut hasher = DefaultHasher::new();
    let ellipsoid = &scene.data.ellipsoid;
    [ellipsoid.semi_major_m, ellipsoid.semi_minor_m]
        .map(f64::to_bits)
        .hash(&mut hasher);
    let sets = scene.sets_in(tile, true);
    for set in &sets {
        scene.sets[*set].heights_content.hash(&mut hasher);
        // Where one set holds throughout, it does not matter where its lens ends.
        let lens = set.checked_sub(1).and_then(|lens| scene.lenses.get(lens));
        if let Some(lens) = lens.filter(|_| sets.len() > 1) {
            lens.content.hash(&mut hasher);
        }
    }
    // Which layers the samples belong to.
    for layer in &scene.elevation_layers {
        (layer, scene.source(*layer).map(Source::version)).hash(&mut hasher);
    }
    hasher.finish()
}
