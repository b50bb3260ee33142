//! From geometries to meshes: what error each leaf allows, and the mesh that keeps it.
//! In: the visible leaves with those around them, their geometries. Out: a mesh for each visible leaf.
//! What a mesh depends on is its key, and all of that comes from view and scene alone: so a mesh is used again while the
//! view barely moves, and still is the same on every node. No geometry is read back, only how much of it there is.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::sync::Arc;

use geodesy::Tile;
use geodesy::frame::scalar_f32;
use glam::DVec3;
use shaders::{EmitLeaf, RefineLeaf};
use terrain::{Domain, RefineView, Selection};

use crate::error::RenderError;
use crate::gather::Gather;
use crate::geometry::{Geometry, TableKey, table_key};
use crate::meshes::{Mesh, MeshKey};
use crate::process::Plan;
use crate::ranges::{CURVED_SHARE, FLAT_LEVEL, curved_m};
use crate::refine::{MarkLimits, Marked, Method};
use crate::scene::Refine;

/// The share of the room for meshes that a finer τ may be expected to take for it to be tried: 4 of 5.
const ROOMY: (u64, u64) = (4, 5);
/// Frames after which a finer τ is tried again that did not fit.
const PATIENCE_FRAMES: u64 = 60;

/// The leaves that a view refines, with what they are made of.
#[derive(Debug)]
pub(crate) struct Refined {
    /// Visible leaves and those around them, sorted.
    pub(crate) domain: Vec<Tile>,
    /// Their geometries; `None` where data has left memory meanwhile.
    pub(crate) geometries: Vec<Option<Geometry>>,
    /// How the fused heights of each came about, and on which tile's lattice.
    pub(crate) plans: Vec<(Tile, Arc<Plan>)>,
    /// Edges of each beyond which a coarser leaf lies.
    pub(crate) coarser: Vec<u8>,
    /// The visible leaves that are drawn, with their meshes.
    pub(crate) drawn: Vec<(Tile, MeshKey)>,
    /// Visible leaves that nothing could be drawn for.
    pub(crate) undrawn: u64,
    /// The eye, and what was selected for it.
    pub(crate) eye: DVec3,
    pub(crate) selection: Selection,
}

impl Refined {
    /// The place of a leaf in the domain.
    pub(crate) fn place(&self, leaf: Tile) -> Option<usize> {
        self.domain.binary_search(&leaf).ok()
    }

    fn geometry(&self, leaf: Tile) -> Option<&Geometry> {
        self.geometries.get(self.place(leaf)?)?.as_ref()
    }
}

/// What became of meshes under one τ.
enum Tried {
    Fits(HashMap<Tile, Mesh>),
    /// More marks than there could ever be room for.
    TooMany,
    /// There is no room beside what is there.
    NoRoom,
}

/// How many times the scene's τ meshes may be off, so that all of them fit. A finer one is tried again from time to
/// time, and not while it has just failed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TauSteps {
    steps: u32,
    /// The frame in which a finer one did not fit.
    missed: u64,
}

impl TauSteps {
    pub(crate) const FIRST: Self = Self {
        steps: 1,
        missed: 0,
    };

    fn missed(&mut self, frame: u64) {
        self.steps += 1.max(self.steps / 4);
        self.missed = frame;
    }

    fn fitted(&mut self, roomy: bool, frame: u64) {
        if self.steps > 1 && roomy && frame > self.missed + PATIENCE_FRAMES {
            // For the next frame. What fits now stands.
            self.steps -= 1;
        }
    }
}

impl Gather<'_> {
    /// Finds or makes the mesh of every visible leaf. Where they do not fit, τ grows by whole steps until they do.
    pub(crate) fn meshes(
        &mut self,
        pixels_per_radian: f64,
        visible: &[Tile],
        refined: &mut Refined,
    ) -> Result<HashMap<Tile, Mesh>, RenderError> {
        let refine = self.scene.data.refine;
        let bounded = refine.is_bounded();
        let tau_px = self.scene.data.tau_px;
        // What vertices themselves may be off comes on top, in whole steps too.
        let curved_px = self.curved_px(pixels_per_radian, visible, refined);
        let curved = if bounded && curved_px > CURVED_SHARE * tau_px {
            (curved_px / tau_px).ceil()
        } else {
            0.0
        };
        let mut gathered = false;
        loop {
            let steps = self.tau.steps;
            let view = RefineView {
                eye: refined.eye,
                pixels_per_radian,
                tau_px: tau_px * f64::from(steps),
            };
            let tried = self.try_meshes(&view, visible, refined)?;
            if let Tried::Fits(meshes) = tried {
                if bounded {
                    let achieved_px = tau_px * (f64::from(steps) + curved);
                    self.statistics.achieved_tau_px =
                        self.statistics.achieved_tau_px.max(achieved_px);
                }
                let triangles: u64 = meshes
                    .values()
                    .map(|mesh| u64::from(mesh.draw().triangles))
                    .sum();
                // Triangles grow as τ falls.
                let before = u64::from(steps.saturating_sub(1));
                let room = u64::from(self.meshes.most_triangles());
                let roomy = triangles * u64::from(steps) * ROOMY.1 < room * before * ROOMY.0;
                if !self.ahead {
                    self.tau.fitted(roomy, self.frame);
                }
                return Ok(meshes);
            }
            // What is shown comes first. The meshes of a scene in preparation can wait until it is.
            if self.ahead {
                return Ok(HashMap::new());
            }
            // Room lies scattered between meshes: where none is drawn in this frame yet, all are made anew, side by side.
            if matches!(tried, Tried::NoRoom) && !gathered && self.refined.is_empty() {
                gathered = true;
                self.meshes.clear();
                continue;
            }
            if !bounded || steps > 1 << 20 {
                return Err(RenderError::Mesh(format!(
                    "{} leaves do not fit into the memory for meshes: raise gpu_mib, or refine with \"top-down\"",
                    visible.len()
                )));
            }
            self.tau.missed(self.frame);
            tracing::debug!(tau_px = view.tau_px, "meshes do not fit");
        }
    }

    /// The pixels by which a vertex of a visible leaf may itself be off: nothing but for leaves so coarse that only
    /// lack of memory brings them near.
    fn curved_px(&self, pixels_per_radian: f64, visible: &[Tile], refined: &Refined) -> f64 {
        let ellipsoid = &self.scene.data.ellipsoid;
        let coarse = visible.iter().filter(|leaf| leaf.level() < FLAT_LEVEL);
        let off_px = |leaf: &Tile| {
            let range_m = refined
                .geometry(*leaf)
                .map_or((0.0, 0.0), |geometry| geometry.ground.range_m);
            let distance_m = terrain::least_distance_m(ellipsoid, *leaf, range_m, refined.eye);
            pixels_per_radian * curved_m(ellipsoid, leaf.level()) / distance_m.max(1.0)
        };
        coarse.map(off_px).fold(0.0, f64::max)
    }

    /// The meshes under one τ.
    fn try_meshes(
        &mut self,
        view: &RefineView,
        visible: &[Tile],
        refined: &mut Refined,
    ) -> Result<Tried, RenderError> {
        let tables = self.tables(view, refined);
        refined.drawn.clear();
        refined.undrawn = 0;
        let mut meshes = HashMap::with_capacity(visible.len());
        let mut missing: Vec<(Tile, MeshKey)> = Vec::new();
        for leaf in visible {
            if refined.geometry(*leaf).is_none() {
                refined.undrawn += 1;
                continue;
            }
            let key = (*leaf, self.mesh_content(*leaf, refined, &tables));
            refined.drawn.push((*leaf, key));
            match self.meshes.get(key, self.frame) {
                Some(mesh) => {
                    meshes.insert(*leaf, mesh);
                }
                None => missing.push((*leaf, key)),
            }
        }
        if missing.is_empty() {
            return Ok(Tried::Fits(meshes));
        }
        let leaves: Vec<Tile> = missing.iter().map(|(leaf, _)| *leaf).collect();
        let near: Vec<Tile> = terrain::ring(&refined.selection, &leaves)
            .into_iter()
            .filter(|leaf| refined.geometry(*leaf).is_some())
            .collect();
        let domain = Domain::new(&refined.selection, &near);
        let mut records = Vec::with_capacity(near.len());
        let mut allowances = Vec::new();
        for (place, leaf) in near.iter().enumerate() {
            let Some(geometry) = refined.geometry(*leaf) else {
                continue;
            };
            records.push(RefineLeaf::from_words(domain.record(place, geometry.slot)));
            match tables.get(leaf) {
                Some((_, table)) => allowances.extend_from_slice(table),
                None => allowances.resize(allowances.len() + terrain::ALLOWANCE_WORDS, 0),
            }
        }
        let given: Vec<u32>;
        let method = match self.scene.data.refine {
            Refine::TopDown => Method::TopDown,
            Refine::BottomUp => Method::BottomUp,
            all @ (Refine::Off | Refine::Fine) => {
                let levels = if all == Refine::Fine {
                    terrain::DEEPEST_MARK + 1
                } else {
                    2 * self.scene.data.refinement
                };
                let marks = terrain::uniform(&domain, levels);
                given = marks
                    .iter()
                    .flat_map(terrain::Marks::words)
                    .copied()
                    .collect();
                Method::Given(&given)
            }
        };
        let limits = MarkLimits {
            most_triangles: self.meshes.most_triangles(),
        };
        let marked = self.refiner.mark(
            self.gpu,
            &self.geometries.buffers,
            &records,
            &allowances,
            &method,
            limits,
            self.times,
        )?;
        let Marked::Counts(counts) = marked else {
            return Ok(Tried::TooMany);
        };
        let mut emits = Vec::with_capacity(missing.len());
        for (index, (leaf, key)) in missing.iter().enumerate() {
            let place = near.binary_search(leaf).ok();
            let Some((place, geometry, count)) =
                place.and_then(|place| Some((place, refined.geometry(*leaf)?, counts.get(place)?)))
            else {
                continue;
            };
            let lent =
                self.meshes
                    .lend(self.gpu, *key, count.vertices, count.triangles, self.frame);
            let Some(mesh) = lent else {
                for (_, key) in missing.iter().take(index) {
                    self.meshes.forget(*key);
                }
                return Ok(Tried::NoRoom);
            };
            emits.push(EmitLeaf {
                place: place as u32,
                geometry: geometry.slot,
                first_vertex: mesh.first_vertex,
                first_index: mesh.first_index,
                unit_m: scalar_f32(geometry.ground.unit_m),
                argument: mesh.draw().argument,
                record: mesh.draw().argument,
                padding: 0,
            });
            meshes.insert(*leaf, mesh);
        }
        let emitted = self.refiner.emit(
            self.gpu,
            &self.geometries.buffers,
            &emits,
            &self.meshes.vertices,
            &self.meshes.indices,
            &self.meshes.arguments,
            self.times,
        );
        if emitted.is_err() {
            for (_, key) in &missing {
                self.meshes.forget(*key);
            }
        }
        self.statistics.refined_leaves += emits.len() as u32;
        self.worked = true;
        emitted.map(|()| Tried::Fits(meshes))
    }

    /// What each leaf allows, by leaf; nothing where the mesh does not depend on the view.
    fn tables(
        &mut self,
        view: &RefineView,
        refined: &Refined,
    ) -> HashMap<Tile, (TableKey, Arc<Vec<u32>>)> {
        let mut tables = HashMap::with_capacity(refined.domain.len());
        if !self.scene.data.refine.is_bounded() {
            return tables;
        }
        let ellipsoid = &self.scene.data.ellipsoid;
        for geometry in refined.geometries.iter().flatten() {
            let (leaf, ground) = (geometry.key.0, &geometry.ground);
            let cell = terrain::eye_cell(ellipsoid, leaf, ground.range_m, view.eye);
            let key = table_key(&cell, view.pixels_per_radian, view.tau_px);
            let make =
                || terrain::allowances(&ground.shape, &ground.blocks, ground.unit_m, view, &cell);
            let table = self.geometries.allowances(geometry, key, self.frame, make);
            tables.insert(leaf, (key, table));
        }
        tables
    }

    /// A number that stands for all that a leaf's mesh depends on: its own heights and allowances, and those of its
    /// ring.
    fn mesh_content(
        &self,
        leaf: Tile,
        refined: &Refined,
        tables: &HashMap<Tile, (TableKey, Arc<Vec<u32>>)>,
    ) -> u64 {
        let mut hasher = DefaultHasher::new();
        let data = &self.scene.data;
        data.refine.hash(&mut hasher);
        if data.refine == Refine::Off {
            data.refinement.hash(&mut hasher);
        }
        let mut add = |tile: Tile| {
            tile.hash(&mut hasher);
            refined
                .geometry(tile)
                .map(|geometry| geometry.key)
                .hash(&mut hasher);
            tables.get(&tile).map(|(key, _)| key).hash(&mut hasher);
        };
        for tile in terrain::ring(&refined.selection, &[leaf]) {
            add(tile);
        }
        hasher.finish()
    }
}
