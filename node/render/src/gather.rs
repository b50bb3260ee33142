//! One frame's way from a view to draws: selection, culling, data, meshes and layers.
//!
//! In: a scene, a view, the blocks to draw, what caches and pools hold. Out: patches per block with their
//! records, wishes for what is missing, and figures. It submits uploads, but draws nothing, and it waits for no data.

use std::collections::{HashMap, HashSet};
use std::time::Instant;

use bytemuck::Zeroable as _;
use geodesy::Tile;
use geodesy::frame::scalar_f32;
use glam::DVec3;
use shaders::TileRecord;
use terrain::Selection;
use tiles::{DatasetId, Lookup, TileCache};

use crate::arrivals::Arrivals;
use crate::error::RenderError;
use crate::geometry::Geometries;
use crate::gpu::Gpu;
use crate::layers::LAYER_SIDE;
use crate::loaded::LoadedScene;
use crate::meshes::{MeshDraw, Meshes};
use crate::process::Processor;
use crate::recorder::PassTimes;
use crate::refine::Refiner;
use crate::refining::{Refined, TauSteps};
use crate::renderer::{FrameStatistics, PlannedBlock, ViewPoint};
use crate::room::Most;
use crate::sight::Sight;
use crate::source::Source;
use crate::textures::SurfaceTextures;

/// The patches of one block.
#[derive(Debug, PartialEq)]
pub(crate) struct BlockDraws {
    pub(crate) output: usize,
    pub(crate) patches: Vec<MeshDraw>,
}

/// What one frame works with, and what it has found so far.
pub(crate) struct Gather<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) cache: &'a TileCache,
    pub(crate) textures: &'a mut SurfaceTextures,
    pub(crate) processor: &'a mut Processor,
    pub(crate) geometries: &'a mut Geometries,
    pub(crate) refiner: &'a mut Refiner,
    pub(crate) meshes: &'a mut Meshes,
    /// How many times the scene's τ a mesh may be off, so that all meshes fit.
    pub(crate) tau: &'a mut TauSteps,
    pub(crate) times: &'a mut Option<PassTimes>,
    pub(crate) scene: &'a LoadedScene,
    /// Another scene is shown or prepared beside this one, and needs as much room.
    pub(crate) shares: bool,
    /// The scene is in preparation: nothing of it is drawn yet, so all of it can be made bit by bit.
    pub(crate) ahead: bool,
    /// No picture was complete yet, and not much time has passed.
    pub(crate) first: bool,
    pub(crate) frame: u64,
    /// Where the room faces: a unit vector in ECEF axes.
    pub(crate) gaze: DVec3,
    pub(crate) upload_until: Instant,
    /// Steps of processing that this frame may still begin, on a device where a step takes long.
    pub(crate) steps_left: Option<u32>,
    /// Something was processed in this frame.
    pub(crate) worked: bool,
    pub(crate) arrivals: &'a mut Arrivals,
    pub(crate) wants: Vec<(DatasetId, Tile, f32)>,
    /// Wanted tiles that can be expected; those that failed to load are tried again, but not waited for.
    pub(crate) pending: HashSet<(DatasetId, Tile)>,
    /// Wanted tiles whose repository cannot be reached: the picture is not complete without them, but goes on.
    pub(crate) away: HashSet<(DatasetId, Tile)>,
    /// Something could be made now and was not: time or room were over.
    pub(crate) behind: bool,
    /// Some data could not be had; a later try may succeed.
    pub(crate) lacks: bool,
    /// Results that stand for those whose best data cannot be had: tile, whether heights → result.
    pub(crate) broken: HashMap<(Tile, bool), (Tile, u64)>,
    /// What each eye's leaves are made of.
    pub(crate) refined: Vec<Refined>,
    /// Numbers of the tiles whose data was brought to the GPU or into a mesh.
    pub(crate) shown: Vec<u64>,
    pub(crate) statistics: FrameStatistics,
}

impl Gather<'_> {
    pub(crate) fn run(
        &mut self,
        view: &ViewPoint,
        blocks: &[PlannedBlock],
    ) -> Result<(Vec<BlockDraws>, Vec<TileRecord>), RenderError> {
        let most = Most::here(self.geometries, self.textures);
        let sights = self.scene.sights(view, blocks, most);
        let tiles = self.scene.distinct_tiles(&sights.visible);
        self.statistics.achieved_tile_px = sights.achieved_tile_px();
        self.statistics.is_device_bound = sights
            .bound
            .is_some_and(|bound| bound.is_of_device(self.geometries, self.textures));
        let sights = sights.of_eyes;
        for (_, _, sight) in &sights {
            self.statistics.selected_tiles += sight.selection.leaves().len() as u32;
        }
        // Beside what is drawn, some of what was: a viewer comes back, and ancestors stand in.
        let room = tiles * if self.shares { 5 } else { 3 } / 2 + 32;
        self.textures.reserve(self.gpu, room);
        let mut records = Vec::new();
        let mut draws: Vec<BlockDraws> = blocks
            .iter()
            .map(|planned| BlockDraws {
                output: planned.output,
                patches: Vec::new(),
            })
            .collect();
        for (eye, of_eye, mut sight) in sights {
            if self.first && self.is_far(eye) && self.waits(eye, &sight)? {
                // Until the data is there the roots stand for it: meshes of what stands in would be made for nothing.
                sight = self
                    .scene
                    .roots_seen(eye, view.pixels_per_radian, &of_eye, blocks);
            }
            let surfaces = self.surfaces(
                eye,
                view.pixels_per_radian,
                &sight.selection,
                &sight.visible,
                &mut records,
            )?;
            for (index, tiles) in of_eye.iter().zip(sight.visible_in) {
                for tile in tiles {
                    if let Some(draw) = surfaces.get(&tile) {
                        draws[*index].patches.push(*draw);
                        self.statistics.drawn_tiles += 1;
                        self.statistics.triangles += u64::from(draw.triangles);
                    }
                }
            }
        }
        Ok((draws, records))
    }

    /// From this far away the roots are flat enough.
    fn is_far(&self, eye: DVec3) -> bool {
        eye.length() > 1.5 * self.scene.data.ellipsoid.semi_major_m
    }

    /// Asks for all that a sight needs, and makes of it what can be made. True while some of it is on its way.
    fn waits(&mut self, eye: DVec3, sight: &Sight) -> Result<bool, RenderError> {
        self.want_roots();
        let domain = terrain::ring(&sight.selection, &sight.visible);
        self.elevation(eye, &domain);
        self.show(eye, &sight.visible)?;
        Ok(!self.pending.is_empty())
    }

    /// Finds or makes what each visible leaf needs: its mesh, its layer of colour, its layer of relief.
    fn surfaces(
        &mut self,
        eye: DVec3,
        pixels_per_radian: f64,
        selection: &Selection,
        visible: &[Tile],
        records: &mut Vec<TileRecord>,
    ) -> Result<HashMap<Tile, MeshDraw>, RenderError> {
        self.want_roots();
        let domain = terrain::ring(selection, visible);
        let elevation = self.elevation(eye, &domain);
        let shown = self.show(eye, visible)?;
        let mut refined = self.geometries(eye, selection, domain, &elevation)?;
        // Meshes depend on all leaves around them: made before those are there, they would be made for nothing.
        let meshes = if self.ahead && self.behind {
            HashMap::new()
        } else {
            self.meshes(pixels_per_radian, visible, &mut refined)?
        };
        let mut surfaces = HashMap::with_capacity(visible.len());
        for (leaf, shown) in visible.iter().zip(shown) {
            let Some(mesh) = meshes.get(leaf) else {
                self.behind |= !self.ahead;
                continue;
            };
            let place = |shown: Option<(Tile, u32)>| {
                let (tile, layer) = shown.unwrap_or((*leaf, 0));
                place(*leaf, tile, layer)
            };
            let record = TileRecord {
                imagery: place(shown.colours),
                relief: place(shown.heights),
                face: [u32::from(leaf.face().number()), 0, 0, 0],
            };
            let draw = mesh.draw();
            // A record has the number of the arguments that draw it. Where two eyes see one mesh, both see what came
            // in last.
            let number = draw.argument as usize;
            if records.len() <= number {
                records.resize(number + 1, TileRecord::zeroed());
            }
            records[number] = record;
            surfaces.insert(*leaf, draw);
        }
        self.refined.push(refined);
        Ok(surfaces)
    }

    /// Wishes for a tile that is not in memory.
    pub(crate) fn want(&mut self, source: &Source, tile: Tile, found: &Lookup, priority: f32) {
        let key = (source.id, tile);
        match found {
            Lookup::Pending => {
                self.pending.insert(key);
            }
            Lookup::Away(_) => {
                self.away.insert(key);
            }
            Lookup::Failed(_) => self.lacks = true,
            Lookup::Ready(_) | Lookup::Absent => return,
        }
        self.arrivals.wanted(key, false, self.frame);
        self.wants.push((source.id, tile, priority));
    }

    /// Whether a mesh may be built for the scene in preparation.
    pub(crate) fn may_build(&self) -> bool {
        // At least one a frame, or a slow machine would never finish.
        self.statistics.meshes_built == 0
            || match self.steps_left {
                Some(steps) => steps > 0,
                None => Instant::now() < self.upload_until,
            }
    }

    /// How soon the data of a tile is wanted.
    pub(crate) fn urgency(&self, eye: DVec3, tile: Tile) -> f32 {
        priority(&self.scene.data.ellipsoid, (eye, self.gaze), tile)
    }

    pub(crate) fn may_upload(&self) -> bool {
        // At least one a frame, or a slow machine would never finish.
        match self.steps_left {
            Some(steps) => steps > 0,
            None => !self.worked || Instant::now() < self.upload_until,
        }
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

/// Larger for what covers more of the screen, and for what lies ahead: coarse tiles, near tiles and those in the middle
/// of the sight first. What lies behind counts a quarter.
pub(crate) fn priority(
    ellipsoid: &geodesy::Ellipsoid,
    (eye, gaze): (DVec3, DVec3),
    tile: Tile,
) -> f32 {
    let middle = geodesy::LatticePoint::of_tile(tile, geodesy::CELLS / 2, geodesy::CELLS / 2);
    let to_tile = ellipsoid.point(middle.normal(), 0.0) - eye;
    let distance = to_tile.length().max(1.0);
    let width = ellipsoid.semi_major_m / f64::from(1_u32 << tile.level());
    let ahead = (to_tile / distance).dot(gaze).max(0.0);
    scalar_f32(width / distance * (0.25 + 0.75 * ahead))
}
