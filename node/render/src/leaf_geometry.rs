//! From elevation to geometry: the heights of every leaf of a domain in their slots, with their error pyramids where
//! meshes keep a bound.
//! In: a selection, leaves, the elevation they show. Out: geometries, made where they are not there. Heights come from the
//! processed and fused samples on the device, borders from the CPU, so that neighbours meet bit for bit. It marks nothing.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::sync::Arc;

use geodesy::Tile;
use geodesy::frame::scalar_f32;
use glam::DVec3;
use terrain::{ElevationLayer, Selection};

use crate::elevation::GatheredHeights;
use crate::error::RenderError;
use crate::gather::Gather;
use crate::geometry::{Geometry, GeometryKey};
use crate::ground::{LeafSources, leaf_words};
use crate::heights::{VertexHeights, heights_content};
use crate::process::{Made, Plan};
use crate::refine::HeightsJob;
use crate::refining::Refined;

/// Steps on a processor that computes the stages itself which the geometry of one leaf counts for.
const GEOMETRY_STEPS: u32 = 2;
/// Leaves whose heights go to the device together, so that it works while the next ones are worked out.
const LEAVES_AT_ONCE: usize = 16;

/// A leaf whose heights are on their way to the device.
struct Waiting {
    key: GeometryKey,
    slot: u32,
    unit_m: f64,
    input: Option<wgpu::TextureView>,
    origin: [i32; 2],
    shift: u32,
}

impl Gather<'_> {
    /// Finds or makes the geometry of every leaf of a domain.
    pub(crate) fn geometries(
        &mut self,
        eye: DVec3,
        selection: &Selection,
        domain: Vec<Tile>,
        elevation: &[GatheredHeights],
    ) -> Result<Refined, RenderError> {
        let scene = self.scene;
        let heights = VertexHeights::new(scene);
        let data: Vec<_> = elevation
            .iter()
            .map(|gathered| |tile: Tile| gathered.data(tile))
            .collect();
        let mut geometries = Vec::with_capacity(domain.len());
        let mut plans = Vec::with_capacity(domain.len());
        let mut coarser_edges = Vec::with_capacity(domain.len());
        let mut waiting: Vec<Waiting> = Vec::new();
        self.processor.begin();
        for leaf in &domain {
            let mut layers = Vec::with_capacity(elevation.len());
            let mut coarser = 0;
            for (gathered, data) in elevation.iter().zip(&data) {
                let level = |beside: Tile| gathered.level_beside(*leaf, beside);
                let levels = terrain::seams(*leaf, selection, &level).levels;
                layers.push(ElevationLayer { levels, data });
            }
            for (bit, edge) in geodesy::Direction::EDGES.into_iter().enumerate() {
                let beyond = selection.edge_neighbour(*leaf, edge);
                if matches!(beyond, Some(terrain::EdgeNeighbour::Coarser(_))) {
                    coarser |= 1 << bit;
                }
            }
            let (tile, plan) = self.plan_shown(*leaf, elevation);
            let mut hasher = DefaultHasher::new();
            heights_content(scene, *leaf).hash(&mut hasher);
            plan.key().hash(&mut hasher);
            coarser.hash(&mut hasher);
            scene.data.refine.is_bounded().hash(&mut hasher);
            for layer in &layers {
                layer.levels.hash(&mut hasher);
            }
            let key = (*leaf, hasher.finish());
            plans.push((tile, Arc::clone(&plan)));
            coarser_edges.push(coarser);
            if let Some(known) = self.geometries.get(key, self.frame) {
                geometries.push(Some(known));
                continue;
            }
            if self.ahead && !self.may_build() {
                self.behind = true;
                geometries.push(None);
                continue;
            }
            let shown: Vec<_> = elevation
                .iter()
                .map(|gathered| {
                    gathered
                        .shown
                        .get(leaf)
                        .and_then(|tile| gathered.data(*tile))
                })
                .collect();
            let relations = scene.relations(*leaf);
            let sources = LeafSources {
                leaf: *leaf,
                layers: &layers,
                shown: &shown,
                relations: &relations,
                coarser,
            };
            let made = match self.make_geometry(&heights, &sources, key, tile, &plan) {
                Ok(made) => made,
                Err(error) => {
                    // Their slots hold what was there before.
                    for leaf in &waiting {
                        self.geometries.forget(leaf.key);
                    }
                    self.processor.submit(self.gpu);
                    return Err(error);
                }
            };
            if made.is_none() {
                self.behind = true;
            }
            geometries.push(made.map(|(geometry, heights)| {
                waiting.push(heights);
                geometry
            }));
            if waiting.len() == LEAVES_AT_ONCE {
                self.fill(&waiting)?;
                waiting.clear();
                // All of it is in the device's hands: its slots may be lent again.
                self.processor.begin();
            }
        }
        self.fill(&waiting)?;
        Ok(Refined {
            domain,
            geometries,
            plans,
            coarser: coarser_edges,
            drawn: Vec::new(),
            undrawn: 0,
            eye,
            selection: selection.clone(),
        })
    }

    /// The tile on whose lattice a leaf's heights are fused, and how, from the data that the leaf shows.
    fn plan_shown(&self, leaf: Tile, elevation: &[GatheredHeights]) -> (Tile, Arc<Plan>) {
        let scene = self.scene;
        let tile = scene.heights_tile(leaf).unwrap_or(leaf);
        let mut sources = scene.best_sources(tile);
        let mut best = true;
        for (layer, gathered) in scene.elevation_layers.iter().zip(elevation) {
            if let Some(source) = sources.get_mut(*layer) {
                let shown = gathered.shown.get(&leaf).copied();
                best &= *source == shown;
                *source = shown;
            }
        }
        let plan = if best {
            scene.plan(tile, true)
        } else {
            Arc::new(scene.plan_with(tile, true, &sources))
        };
        (tile, plan)
    }

    /// Makes the fused heights of a leaf and lends it a slot. `None` where data has left memory, or every slot is in use.
    fn make_geometry(
        &mut self,
        heights: &VertexHeights,
        sources: &LeafSources<'_, '_>,
        key: GeometryKey,
        tile: Tile,
        plan: &Plan,
    ) -> Result<Option<(Geometry, Waiting)>, RenderError> {
        let words = match leaf_words(self.scene, heights, sources) {
            Ok(words) => words,
            Err(error) => {
                tracing::warn!(%error, "a mesh waits for its elevation");
                return Ok(None);
            }
        };
        let input = match plan.key() {
            None => None,
            Some(root) => {
                let steps = self.processor.missing(plan).len() as u32;
                let made = self
                    .processor
                    .make_root(self.gpu, self.scene, self.cache, plan)?;
                if let Some(left) = &mut self.steps_left {
                    *left = left.saturating_sub(steps);
                }
                if made != Made::Whole {
                    return Ok(None);
                }
                self.processor.slot(root).map(|slot| slot.view.clone())
            }
        };
        if let Some(left) = &mut self.steps_left {
            *left = left.saturating_sub(GEOMETRY_STEPS);
        }
        let unit_m = words.ground.unit_m;
        let Some(geometry) = self.geometries.lend(key, words.ground, self.frame) else {
            return Ok(None);
        };
        self.refiner.write_border(
            self.gpu,
            &self.geometries.buffers,
            geometry.slot,
            &words.border,
            &words.anchors,
        );
        self.note_used(plan);
        self.statistics.meshes_built += 1;
        let leaf = sources.leaf;
        let shift = leaf.level().saturating_sub(tile.level());
        let along = |leaf: u32, data: u32| {
            let first = (i64::from(leaf) - (i64::from(data) << shift)) * geodesy::CELLS;
            i32::try_from(first).unwrap_or_default()
        };
        let waiting = Waiting {
            key,
            slot: geometry.slot,
            unit_m,
            input,
            origin: [along(leaf.x(), tile.x()), along(leaf.y(), tile.y())],
            shift: u32::from(shift),
        };
        Ok(Some((geometry, waiting)))
    }

    /// Brings heights into their slots, and makes their error pyramids where meshes are bounded by them.
    fn fill(&mut self, waiting: &[Waiting]) -> Result<(), RenderError> {
        // In any case: what is kept must be in the device's hands before what it was made of is lent again.
        self.processor.submit(self.gpu);
        if waiting.is_empty() {
            return Ok(());
        }
        let jobs: Vec<HeightsJob<'_>> = waiting
            .iter()
            .map(|leaf| HeightsJob {
                slot: leaf.slot,
                input: leaf.input.as_ref(),
                origin: leaf.origin,
                shift: leaf.shift,
                units_per_m: scalar_f32(1.0 / leaf.unit_m),
            })
            .collect();
        let made = self.refiner.make_geometry(
            self.gpu,
            &self.geometries.buffers,
            &jobs,
            self.scene.data.refine.is_bounded(),
            self.times,
        );
        if made.is_err() {
            for leaf in waiting {
                self.geometries.forget(leaf.key);
            }
        }
        self.worked = true;
        made
    }
}
