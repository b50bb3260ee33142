//! One frame's way from a view to draws: selection, culling, data, meshes and layers.
//!
//! In: a scene, a view, the blocks to draw, what caches and pools hold. Out: patches per block with their
//! records, wishes for what is missing, and figures. It submits uploads, but draws nothing, and it never waits.

use std::collections::{HashMap, HashSet};
use std::time::Instant;

use geodesy::frame::scalar_f32;
use geodesy::{Horizon, Tile};
use glam::DVec3;
use shaders::TileRecord;
use terrain::{Frustum, Lattice, LodLimits, LodView, Selection};
use tiles::{DatasetId, Lookup, TileCache};

use crate::gpu::Gpu;
use crate::layers::LAYER_SIDE;
use crate::meshes::{MeshDraw, MeshRequest, Meshes};
use crate::renderer::{FrameStatistics, PlannedBlock, ViewPoint};
use crate::scene::{Heights, Layer, LoadedScene};
use crate::textures::{RELIEF_BATCH, ReliefJob, SurfaceTextures};

/// The patches of one block.
#[derive(Debug, PartialEq)]
pub(crate) struct BlockDraws {
    pub(crate) output: usize,
    /// Index of the tile's record, and its mesh.
    pub(crate) patches: Vec<(u32, MeshDraw)>,
}

/// Leaves over the whole planet that one selection may have.
const MOST_LEAVES: usize = 32_768;

/// What an eye sees: leaves of the planet, those visible in each block, and in any.
struct Sight {
    selection: Selection,
    visible_in: Vec<Vec<Tile>>,
    visible: Vec<Tile>,
}

/// What a leaf shows in this frame.
struct Surface {
    record: u32,
    mesh: MeshDraw,
}

/// What one frame works with, and what it has found so far.
pub(crate) struct Gather<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) cache: &'a TileCache,
    pub(crate) textures: &'a mut SurfaceTextures,
    pub(crate) meshes: &'a mut Meshes,
    pub(crate) scene: &'a LoadedScene,
    pub(crate) frame: u64,
    pub(crate) upload_until: Instant,
    pub(crate) wants: Vec<(DatasetId, Tile, f32)>,
    /// Wanted tiles that can be expected; those that failed to load are tried again, but not waited for.
    pub(crate) pending: u32,
    /// Numbers of the tiles whose data was brought to the GPU or into a mesh.
    pub(crate) shown: Vec<u64>,
    pub(crate) statistics: FrameStatistics,
}

impl Gather<'_> {
    pub(crate) fn run(
        &mut self,
        view: &ViewPoint,
        blocks: &[PlannedBlock],
    ) -> (Vec<BlockDraws>, Vec<TileRecord>) {
        let screens = (0..view.eyes.len())
            .filter(|screen| blocks.iter().any(|planned| planned.screen == *screen))
            .count();
        let room = self.meshes.capacity().min(self.textures.most_tiles());
        let most_visible = room / screens.max(1);
        let mut records = Vec::new();
        let mut draws: Vec<BlockDraws> = blocks
            .iter()
            .map(|planned| BlockDraws {
                output: planned.output,
                patches: Vec::new(),
            })
            .collect();
        for (screen, eye) in view.eyes.iter().enumerate() {
            let of_screen: Vec<usize> = (0..blocks.len())
                .filter(|index| blocks[*index].screen == screen)
                .collect();
            if of_screen.is_empty() {
                continue;
            }
            let sight = self.see(
                *eye,
                view.pixels_per_radian,
                &of_screen,
                blocks,
                most_visible,
            );
            let Sight {
                selection,
                visible_in,
                visible,
            } = sight;
            self.statistics.selected_tiles += selection.leaves().len() as u32;
            self.statistics.achieved_tile_px = self
                .statistics
                .achieved_tile_px
                .max(selection.achieved_tile_px());
            // Beside what is drawn, some of what was: a viewer comes back, and ancestors stand in.
            let room = visible.len() + visible.len() / 2 + 32;
            self.textures.reserve(self.gpu, room);
            let surfaces = self.surfaces(*eye, &selection, &visible, &mut records);
            for (index, tiles) in of_screen.iter().zip(visible_in) {
                for tile in tiles {
                    if let Some(surface) = surfaces.get(&tile) {
                        draws[*index].patches.push((surface.record, surface.mesh));
                        self.statistics.drawn_tiles += 1;
                        self.statistics.triangles += u64::from(surface.mesh.index_count / 3);
                    }
                }
            }
        }
        (draws, records)
    }

    /// Selects for an eye and culls for each block. Where more is visible than the budgets hold, tiles are
    /// split later, by whole factors of √2, until it fits.
    fn see(
        &self,
        eye: DVec3,
        pixels_per_radian: f64,
        of_screen: &[usize],
        blocks: &[PlannedBlock],
        most_visible: usize,
    ) -> Sight {
        let ellipsoid = &self.scene.data.ellipsoid;
        let ranges = self.scene.ranges();
        let horizon = Horizon::new(ellipsoid, ranges.floor_m(), eye);
        let mut limits = LodLimits {
            deepest_level: self.scene.data.deepest_level,
            tile_px: self.scene.data.tile_px,
            most_tiles: MOST_LEAVES,
        };
        loop {
            let lod = LodView {
                eye,
                pixels_per_radian,
            };
            let selection = terrain::select(ellipsoid, &lod, &limits, &ranges);
            let visible_in: Vec<Vec<Tile>> = of_screen
                .iter()
                .map(|index| {
                    let frustum =
                        Frustum::from_corners(eye, blocks[*index].block.corner_directions);
                    terrain::cull(ellipsoid, &selection, &[frustum], &horizon, &ranges)
                })
                .collect();
            let mut visible: Vec<Tile> = visible_in.iter().flatten().copied().collect();
            visible.sort_unstable();
            visible.dedup();
            // Six roots are the least there can be.
            if visible.len() <= most_visible || selection.leaves().len() <= Tile::ROOTS.len() {
                return Sight {
                    selection,
                    visible_in,
                    visible,
                };
            }
            limits.tile_px = selection.achieved_tile_px() * std::f64::consts::SQRT_2;
        }
    }

    /// Finds or makes what each visible leaf needs: its mesh, its imagery layer, its relief layer.
    fn surfaces(
        &mut self,
        eye: DVec3,
        selection: &Selection,
        visible: &[Tile],
        records: &mut Vec<TileRecord>,
    ) -> HashMap<Tile, Surface> {
        let heights = self.gather_heights(eye, selection, visible);
        self.prepare_relief(visible, &heights);
        let data = |tile: Tile| {
            heights
                .resident
                .get(&tile)
                .map(|heights| heights as &dyn Lattice)
        };
        let quantum_m = self
            .scene
            .elevation
            .as_ref()
            .map_or(1.0, |layer| layer.data.dataset.unit());
        let shown_level = |leaf: Tile| heights.shown.get(&leaf).map(|tile| tile.level());
        let mut surfaces = HashMap::with_capacity(visible.len());
        for leaf in visible {
            let request = MeshRequest {
                tile: *leaf,
                seams: terrain::seams(*leaf, selection, &shown_level),
                quantum_m,
                data: &data,
            };
            let prepared =
                self.meshes
                    .prepare(self.gpu, &self.scene.data.ellipsoid, &request, self.frame);
            let Some((mesh, built)) = prepared else {
                self.statistics.converged = false;
                continue;
            };
            self.statistics.meshes_built += u32::from(built);
            let record = TileRecord {
                imagery: self.imagery_place(eye, *leaf),
                relief: self.relief_place(*leaf),
                face: [u32::from(leaf.face().number()), 0, 0, 0],
            };
            surfaces.insert(
                *leaf,
                Surface {
                    record: records.len() as u32,
                    mesh,
                },
            );
            records.push(record);
        }
        surfaces
    }

    /// What each visible leaf and each of its neighbours shows of the elevation; asks for the rest.
    fn gather_heights(
        &mut self,
        eye: DVec3,
        selection: &Selection,
        visible: &[Tile],
    ) -> GatheredHeights {
        let mut gathered = GatheredHeights::default();
        let Some(layer) = &self.scene.elevation else {
            return gathered;
        };
        for root in Tile::ROOTS {
            self.want(layer, root, &self.cache.get(layer.id, root), f32::MAX);
        }
        for leaf in visible {
            gathered.add(self.cache, layer, *leaf);
            for around in selection.leaves_around(*leaf) {
                gathered.add(self.cache, layer, around);
            }
        }
        let mut missing: Vec<Tile> = gathered.missing.iter().copied().collect();
        missing.sort_unstable();
        missing.dedup();
        self.shown
            .extend(gathered.resident.keys().map(|tile| layer.number(*tile)));
        for tile in missing {
            let urgency = priority(&self.scene.data.ellipsoid, eye, tile);
            self.want(layer, tile, &self.cache.get(layer.id, tile), urgency);
        }
        gathered
    }

    /// Wishes for a tile that is not in memory.
    fn want(&mut self, layer: &Layer, tile: Tile, found: &Lookup, priority: f32) {
        match found {
            Lookup::Pending => self.pending += 1,
            Lookup::Failed(_) => {}
            Lookup::Ready(_) | Lookup::Absent => return,
        }
        self.wants.push((layer.id, tile, priority));
    }

    fn may_upload(&self) -> bool {
        // At least one a frame, or a slow machine would never finish.
        self.statistics.uploads == 0 || Instant::now() < self.upload_until
    }

    /// Makes relief layers for what the visible leaves show, coarse levels first, within the budget.
    fn prepare_relief(&mut self, visible: &[Tile], heights: &GatheredHeights) {
        let Some(layer) = &self.scene.elevation else {
            return;
        };
        let mut shown: Vec<Tile> = visible
            .iter()
            .filter_map(|leaf| heights.shown.get(leaf))
            .copied()
            .collect();
        shown.sort_unstable();
        shown.dedup();
        shown.retain(|tile| self.textures.relief.get(*tile, self.frame).is_none());
        for batch in shown.chunks(RELIEF_BATCH) {
            if !self.may_upload() {
                self.statistics.converged = false;
                return;
            }
            let mut jobs = Vec::with_capacity(batch.len());
            for tile in batch {
                let Some(data) = heights.resident.get(tile) else {
                    continue;
                };
                let Some(lent) = self.textures.relief.lend(*tile, self.frame) else {
                    self.statistics.converged = false;
                    continue;
                };
                jobs.push(ReliefJob {
                    data: &data.0,
                    layer: lent,
                    quantum_m: layer.data.dataset.unit(),
                });
            }
            self.statistics.uploads += jobs.len() as u32;
            self.textures
                .process_relief(self.gpu, &self.scene.data.ellipsoid, &jobs);
        }
    }

    fn relief_place(&mut self, leaf: Tile) -> [f32; 4] {
        let Some(layer) = &self.scene.elevation else {
            return place(leaf, leaf, 0);
        };
        let Some(best) = layer.best(leaf) else {
            return place(leaf, leaf, 0);
        };
        for tile in best.lineage() {
            if let Some(found) = self.textures.relief.get(tile, self.frame) {
                return place(leaf, tile, found);
            }
        }
        place(leaf, leaf, 0)
    }

    /// The imagery a leaf shows: the finest of its lineage that is or can now be brought to the GPU.
    fn imagery_place(&mut self, eye: DVec3, leaf: Tile) -> [f32; 4] {
        let Some(layer) = &self.scene.imagery else {
            return place(leaf, leaf, 0);
        };
        let Some(best) = layer.best(leaf) else {
            return place(leaf, leaf, 0);
        };
        for tile in best.lineage() {
            if let Some(found) = self.textures.imagery.get(tile, self.frame) {
                return place(leaf, tile, found);
            }
            let found = self.cache.get(layer.id, tile);
            match found {
                Lookup::Ready(data) if self.may_upload() => {
                    if let Some(lent) = self.textures.imagery.lend(tile, self.frame) {
                        self.textures.upload_imagery(self.gpu, &data, lent);
                        self.shown.push(layer.number(tile));
                        self.statistics.uploads += 1;
                        return place(leaf, tile, lent);
                    }
                    self.statistics.converged = false;
                }
                Lookup::Ready(_) => self.statistics.converged = false,
                Lookup::Pending | Lookup::Failed(_) => {
                    let urgency = priority(&self.scene.data.ellipsoid, eye, tile);
                    self.want(layer, tile, &found, urgency);
                }
                Lookup::Absent => {}
            }
        }
        place(leaf, leaf, 0)
    }
}

/// The elevation that this frame uses.
#[derive(Default)]
struct GatheredHeights {
    /// Leaf → the tile whose data it shows.
    shown: HashMap<Tile, Tile>,
    /// Every tile that is shown.
    resident: HashMap<Tile, Heights>,
    missing: HashSet<Tile>,
}

impl GatheredHeights {
    fn add(&mut self, cache: &TileCache, layer: &Layer, leaf: Tile) {
        if self.shown.contains_key(&leaf) {
            return;
        }
        let Some(best) = layer.best(leaf) else { return };
        let Some(data) = layer.resident(cache, leaf) else {
            self.missing.insert(best);
            return;
        };
        if data.tile != best {
            self.missing.insert(best);
        }
        self.shown.insert(leaf, data.tile);
        self.resident
            .entry(data.tile)
            .or_insert_with(|| Heights(data));
    }
}

/// Where the lattice of `leaf` lies in the layer of `shown`, itself or an ancestor: offset, scale, layer.
fn place(leaf: Tile, shown: Tile, layer: u32) -> [f32; 4] {
    let side = f64::from(LAYER_SIDE);
    let shift = leaf.level().saturating_sub(shown.level());
    let share = 1.0 / f64::from(1_u32 << shift);
    let cells = geodesy::CELLS as f64;
    let first_x = f64::from(leaf.x() - (shown.x() << shift)) * share * cells;
    let first_y = f64::from(leaf.y() - (shown.y() << shift)) * share * cells;
    // Node 0 is the second texel of a layer; a texel's centre is half a texel in.
    [
        scalar_f32((first_x + 1.5) / side),
        scalar_f32((first_y + 1.5) / side),
        scalar_f32(share / side),
        layer as f32,
    ]
}

/// Larger for what covers more of the sight: coarse tiles and near tiles first.
fn priority(ellipsoid: &geodesy::Ellipsoid, eye: DVec3, tile: Tile) -> f32 {
    let middle = geodesy::LatticePoint::of_tile(tile, geodesy::CELLS / 2, geodesy::CELLS / 2);
    let distance = ellipsoid.point(middle.normal(), 0.0).distance(eye).max(1.0);
    let width = ellipsoid.semi_major_m / f64::from(1_u32 << tile.level());
    scalar_f32(width / distance)
}
