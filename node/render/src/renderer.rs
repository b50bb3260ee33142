//! From a view to finished pictures: select, gather data, build meshes, draw blocks.
//!
//! In: a scene, views. Out: one picture per output, and what is still missing for the best one. It never
//! waits for data: what is not in memory is asked for, and its best ancestor is shown meanwhile. It knows
//! no network and no window.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use geodesy::frame::{FixedPoint, scalar_f32, vector_f32};
use geodesy::{Horizon, Tile};
use glam::{DMat3, DVec3};
use shaders::{FrameUniform, TileRecord};
use terrain::{Frustum, Lattice, LodLimits, LodView, Selection};
use tiles::{DatasetId, Lookup, TileCache};

use crate::canvas::{Block, OutputPlan, PlanarScreen, to_sphere_space};
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::meshes::{MeshDraw, MeshRequest, Meshes};
use crate::pipelines::Pipelines;
use crate::scene::{Heights, Layer, Ranges, SceneData};
use crate::target::{BlockTarget, OutputTarget, Picture};
use crate::textures::{LAYER_SIDE, RELIEF_BATCH, ReliefJob, SurfaceTextures};

/// Limits of memory and time.
#[derive(Clone, Copy, Debug)]
pub struct RenderBudget {
    /// GPU memory for tiles and meshes in bytes.
    pub gpu_bytes: u64,
    /// Time that uploads may take from one frame.
    pub upload: Duration,
}

/// Where the viewer is, and how the screens stand around the eye.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewPoint {
    /// The eye of each screen in ECEF metres.
    pub eyes: Vec<DVec3>,
    /// The room's x, y and z axes in ECEF, as columns.
    pub room: DMat3,
    /// The screens in room axes, each relative to its eye.
    pub screens: Vec<PlanarScreen>,
    /// Density of the wall's densest screen. The same on every node.
    pub pixels_per_radian: f64,
}

/// What one call of [`Renderer::draw`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameStatistics {
    /// False where nothing had changed and the old picture stands.
    pub redrawn: bool,
    /// True when every visible tile shows the best data that exists.
    pub converged: bool,
    /// Tiles that are still on their way.
    pub pending_tiles: u32,
    /// Leaves of the selection over the whole planet.
    pub selected_tiles: u32,
    /// Patches drawn, over all blocks.
    pub drawn_tiles: u32,
    /// Triangles drawn.
    pub triangles: u64,
    /// Layers uploaded or processed in this frame.
    pub uploads: u32,
    /// Meshes built in this frame.
    pub meshes_built: u32,
    /// The side in pixels beyond which tiles were split: the scene's, or more where budgets forbid it.
    pub achieved_tile_px: f64,
}

/// Draws one scene for the outputs of one node.
pub struct Renderer {
    gpu: Arc<Gpu>,
    cache: Arc<TileCache>,
    budget: RenderBudget,
    outputs: Vec<(OutputPlan, OutputTarget, Option<BlockTarget>)>,
    textures: SurfaceTextures,
    pipelines: Pipelines,
    meshes: Option<Meshes>,
    scene: Option<LoadedScene>,
    frame: u64,
    /// The light has changed since the last picture.
    relit: bool,
    used: HashSet<u64>,
    new_tiles: Vec<u64>,
    last: Option<LastFrame>,
}

struct LoadedScene {
    data: SceneData,
    elevation: Option<Layer>,
    imagery: Option<Layer>,
}

impl LoadedScene {
    fn ranges(&self) -> Ranges<'_> {
        Ranges {
            elevation: self.elevation.as_ref(),
            imagery: self.imagery.as_ref(),
            refinement: self.data.refinement,
        }
    }
}

/// What the standing picture was made from.
#[derive(Debug)]
struct LastFrame {
    view: ViewPoint,
    draws: Vec<BlockDraws>,
    records: Vec<TileRecord>,
    arrivals: u64,
    statistics: FrameStatistics,
}

/// The patches of one block.
#[derive(Debug, PartialEq)]
struct BlockDraws {
    output: usize,
    /// Index of the tile's record, and its mesh.
    patches: Vec<(u32, MeshDraw)>,
}

/// What a leaf shows in this frame.
struct Surface {
    record: u32,
    mesh: MeshDraw,
}

impl Renderer {
    /// A renderer for these outputs. It draws black until it has a scene.
    pub fn new(
        gpu: Arc<Gpu>,
        cache: Arc<TileCache>,
        outputs: &[OutputPlan],
        budget: RenderBudget,
    ) -> Result<Self, RenderError> {
        let textures = SurfaceTextures::new(&gpu, budget.gpu_bytes / 8 * 7)?;
        let pipelines = Pipelines::new(&gpu, &textures)?;
        let outputs = outputs
            .iter()
            .map(|plan| Ok((plan.clone(), OutputTarget::new(&gpu, plan)?, None)))
            .collect::<Result<_, RenderError>>()?;
        Ok(Self {
            gpu,
            cache,
            budget,
            outputs,
            textures,
            pipelines,
            meshes: None,
            scene: None,
            frame: 0,
            relit: false,
            used: HashSet::new(),
            new_tiles: Vec::new(),
            last: None,
        })
    }

    /// Takes a new scene. Its indices are read at once, its tiles when they are looked at. On an error
    /// the old scene stays.
    pub fn set_scene(&mut self, data: SceneData) -> Result<(), RenderError> {
        let open = |source: &Option<_>, kind| {
            source
                .as_ref()
                .map(|source| Layer::open(&self.cache, source, &data.ellipsoid, kind))
                .transpose()
        };
        let elevation = open(&data.elevation, tiles::Kind::Elevation)?;
        let imagery = open(&data.imagery, tiles::Kind::Imagery)?;
        let same =
            |old: Option<&Layer>, new: Option<&Layer>| old.map(|l| l.id) == new.map(|l| l.id);
        let kept = self.scene.as_ref().is_some_and(|old| {
            same(old.elevation.as_ref(), elevation.as_ref())
                && same(old.imagery.as_ref(), imagery.as_ref())
                && old.data.refinement == data.refinement
                && old.data.ellipsoid == data.ellipsoid
        });
        if !kept {
            self.meshes = Some(Meshes::new(
                &self.gpu,
                data.refinement,
                self.budget.gpu_bytes / 8,
            )?);
            self.textures.clear();
        }
        self.scene = Some(LoadedScene {
            data,
            elevation,
            imagery,
        });
        self.last = None;
        Ok(())
    }

    /// Moves the sun without taking a new scene.
    pub fn set_sun(&mut self, direction: DVec3) {
        if let Some(scene) = &mut self.scene
            && scene.data.light.sun != direction
        {
            scene.data.light.sun = direction;
            self.relit = true;
        }
    }

    /// Numbers of tiles whose data was used for the first time since the last call, at most `most`; the
    /// rest comes with the next call. A number means the same data set and tile on every node.
    pub fn take_new_tiles(&mut self, most: usize) -> Vec<u64> {
        let rest = self.new_tiles.split_off(most.min(self.new_tiles.len()));
        std::mem::replace(&mut self.new_tiles, rest)
    }

    /// Draws the view into every output and waits for the GPU. Draws nothing where nothing changed.
    pub fn draw(&mut self, view: &ViewPoint) -> Result<FrameStatistics, RenderError> {
        let arrivals = self.cache.generation();
        if let Some(last) = &self.last
            && !self.relit
            && last.view == *view
            && (last.statistics.converged || last.arrivals == arrivals)
            && last.statistics.uploads == 0
        {
            return Ok(FrameStatistics {
                redrawn: false,
                ..last.statistics
            });
        }
        self.frame += 1;
        let (Some(scene), Some(meshes)) = (&self.scene, &mut self.meshes) else {
            return Ok(FrameStatistics {
                converged: true,
                ..FrameStatistics::default()
            });
        };
        let mut gather = Gather {
            gpu: &self.gpu,
            cache: &self.cache,
            textures: &mut self.textures,
            meshes,
            scene,
            frame: self.frame,
            upload_until: Instant::now() + self.budget.upload,
            wants: Vec::new(),
            pending: 0,
            shown: Vec::new(),
            statistics: FrameStatistics {
                converged: true,
                ..FrameStatistics::default()
            },
        };
        let blocks = plan_blocks(&self.outputs, view);
        let (draws, records) = gather.run(view, &blocks);
        let mut statistics = gather.statistics;
        let wants = std::mem::take(&mut gather.wants);
        let pending = gather.pending;
        let shown = std::mem::take(&mut gather.shown);
        self.new_tiles
            .extend(shown.into_iter().filter(|number| self.used.insert(*number)));
        statistics.pending_tiles = pending;
        statistics.converged &= pending == 0;
        self.cache.request(&wants);
        let relit = std::mem::take(&mut self.relit);
        let unchanged = self.last.as_ref().is_some_and(|last| {
            !relit
                && last.view == *view
                && last.draws == draws
                && last.records == records
                && statistics.meshes_built == 0
        });
        if !unchanged {
            let frames: Vec<FrameUniform> = blocks
                .iter()
                .map(|(_, screen, block)| frame_uniform(&scene.data, view, *screen, block))
                .collect();
            self.pipelines
                .write(&self.gpu, &self.textures, &frames, &records);
            self.render(&blocks, &draws)?;
        }
        statistics.redrawn = !unchanged;
        self.last = Some(LastFrame {
            view: view.clone(),
            draws,
            records,
            arrivals,
            statistics,
        });
        Ok(statistics)
    }

    fn render(
        &mut self,
        blocks: &[(usize, usize, Block)],
        draws: &[BlockDraws],
    ) -> Result<(), RenderError> {
        let Some(meshes) = &self.meshes else {
            return Ok(());
        };
        let mut encoder = self
            .gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let layouts = block_layouts(&self.outputs, blocks);
        for (index, ((output, _, block), draws)) in blocks.iter().zip(draws).enumerate() {
            let Some((plan, target, scratch)) = self.outputs.get_mut(*output) else {
                continue;
            };
            let layout = layouts[*output];
            let scratch = scratch
                .get_or_insert_with(|| BlockTarget::new(&self.gpu, layout.size, layout.direct));
            let colour = scratch
                .colour
                .as_ref()
                .map_or(&target.view, |(_, view)| view);
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("block"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: colour,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &scratch.depth,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Clear(0.0),
                        store: wgpu::StoreOp::Discard,
                    }),
                    stencil_ops: None,
                }),
                ..wgpu::RenderPassDescriptor::default()
            });
            pass.set_viewport(
                0.0,
                0.0,
                block.area.width as f32,
                block.area.height as f32,
                0.0,
                1.0,
            );
            let wanted = block.wanted;
            pass.set_scissor_rect(wanted.x, wanted.y, wanted.width, wanted.height);
            pass.set_bind_group(
                0,
                &self.pipelines.bindings,
                &[self.pipelines.frame_offset(index)],
            );
            pass.set_pipeline(&self.pipelines.terrain);
            pass.set_vertex_buffer(0, meshes.vertices.slice(..));
            pass.set_index_buffer(meshes.indices.slice(..), wgpu::IndexFormat::Uint16);
            for (record, mesh) in &draws.patches {
                let range = mesh.first_index..mesh.first_index + mesh.index_count;
                pass.draw_indexed(range, mesh.base_vertex, *record..*record + 1);
            }
            pass.set_pipeline(&self.pipelines.atmosphere);
            pass.draw(0..3, 0..1);
            drop(pass);
            if let Some((texture, _)) = &scratch.colour {
                copy_block(&mut encoder, texture, target, plan, block);
            }
        }
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.wait()?;
        Ok(())
    }

    /// The finished pictures, in the order of the outputs.
    pub fn read_pictures(&self) -> Result<Vec<(String, Picture)>, RenderError> {
        self.outputs
            .iter()
            .map(|(plan, target, _)| Ok((plan.name.clone(), target.read(&self.gpu, &plan.name)?)))
            .collect()
    }

    /// The finished picture of one output as a texture, for a window.
    pub(crate) fn output_view(&self, output: usize) -> Option<&wgpu::TextureView> {
        self.outputs.get(output).map(|(_, target, _)| &target.view)
    }

    /// The tile cache.
    #[must_use]
    pub fn cache(&self) -> &Arc<TileCache> {
        &self.cache
    }

    /// The graphics device.
    #[must_use]
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }
}

/// All blocks of all outputs with output and screen index, in a fixed order.
fn plan_blocks(
    outputs: &[(OutputPlan, OutputTarget, Option<BlockTarget>)],
    view: &ViewPoint,
) -> Vec<(usize, usize, Block)> {
    let mut blocks = Vec::new();
    for (output, (plan, _, _)) in outputs.iter().enumerate() {
        for channel in &plan.channels {
            let Some(screen) = view.screens.get(channel.screen) else {
                continue;
            };
            let of_channel = screen.blocks(channel.canvas_px, view.room);
            blocks.extend(
                of_channel
                    .into_iter()
                    .map(|block| (output, channel.screen, block)),
            );
        }
    }
    blocks
}

#[derive(Clone, Copy, Debug, Default)]
struct BlockLayout {
    size: [u32; 2],
    direct: bool,
}

/// How large each output's block target must be, and whether it can be drawn to directly.
fn block_layouts(
    outputs: &[(OutputPlan, OutputTarget, Option<BlockTarget>)],
    blocks: &[(usize, usize, Block)],
) -> Vec<BlockLayout> {
    let mut layouts = vec![BlockLayout::default(); outputs.len()];
    let mut counts = vec![0_u32; outputs.len()];
    for (output, _, block) in blocks {
        let layout = &mut layouts[*output];
        let wanted = block.wanted;
        layout.size[0] = layout.size[0].max(wanted.x + wanted.width);
        layout.size[1] = layout.size[1].max(wanted.y + wanted.height);
        counts[*output] += 1;
        layout.direct = counts[*output] == 1
            && (wanted.x, wanted.y) == (0, 0)
            && outputs[*output].0.size_px == [wanted.width, wanted.height];
    }
    layouts
}

/// Copies a block's wanted part to its place in the output.
fn copy_block(
    encoder: &mut wgpu::CommandEncoder,
    block_texture: &wgpu::Texture,
    target: &OutputTarget,
    plan: &OutputPlan,
    block: &Block,
) {
    let wanted = block.wanted;
    let on_canvas = (block.area.x + wanted.x, block.area.y + wanted.y);
    let channel = plan.channels.iter().find(|channel| {
        let rect = channel.canvas_px;
        (rect.x..rect.x + rect.width).contains(&on_canvas.0)
            && (rect.y..rect.y + rect.height).contains(&on_canvas.1)
    });
    let Some(channel) = channel else { return };
    let [left, top] = channel.output_px;
    let place = wgpu::Origin3d {
        x: left + on_canvas.0 - channel.canvas_px.x,
        y: top + on_canvas.1 - channel.canvas_px.y,
        z: 0,
    };
    encoder.copy_texture_to_texture(
        wgpu::TexelCopyTextureInfo {
            origin: wgpu::Origin3d {
                x: wanted.x,
                y: wanted.y,
                z: 0,
            },
            ..block_texture.as_image_copy()
        },
        wgpu::TexelCopyTextureInfo {
            origin: place,
            ..target.texture.as_image_copy()
        },
        wgpu::Extent3d {
            width: wanted.width,
            height: wanted.height,
            depth_or_array_layers: 1,
        },
    );
}

fn frame_uniform(
    scene: &SceneData,
    view: &ViewPoint,
    screen: usize,
    block: &Block,
) -> FrameUniform {
    let eye = view.eyes.get(screen).copied().unwrap_or_default();
    let [x0, x1, y0, y1, z0, z1] = FixedPoint::from_ecef(eye).words();
    let ellipsoid = scene.ellipsoid;
    let (a, b) = (ellipsoid.semi_major_m, ellipsoid.semi_minor_m);
    let sun = vector_f32(scene.light.sun);
    let air = scene.air;
    let [red, green, blue] = air.colour.map(scalar_f32);
    // The longest path through a shell of this thickness around a planet of this radius.
    let longest_m = (2.0 * a * air.thickness_m).sqrt();
    let sphere = vector_f32(eye / DVec3::new(a, a, b));
    let [corner, right, down] = block.ray.map(|ray| to_sphere_space(ray, a, b));
    FrameUniform {
        clip_from_relative: block.clip_from_relative.to_cols_array_2d(),
        viewer_xy: [x0, x1, y0, y1],
        viewer_z: [z0, z1, 0, 0],
        sun: [sun.x, sun.y, sun.z, scalar_f32(scene.light.ambient)],
        haze: [red, green, blue, scalar_f32(air.thickness_m)],
        shading: [
            scalar_f32(scene.light.relief),
            scalar_f32(longest_m.max(1.0)),
            0.0,
            0.0,
        ],
        sky_viewer: [
            sphere.x,
            sphere.y,
            sphere.z,
            scalar_f32(air.thickness_m / a),
        ],
        sky_ray: corner,
        sky_ray_x: right,
        sky_ray_y: down,
    }
}

/// One frame's way from a view to draws.
struct Gather<'a> {
    gpu: &'a Gpu,
    cache: &'a TileCache,
    textures: &'a mut SurfaceTextures,
    meshes: &'a mut Meshes,
    scene: &'a LoadedScene,
    frame: u64,
    upload_until: Instant,
    wants: Vec<(DatasetId, Tile, f32)>,
    /// Wanted tiles that can be expected; those that failed to load are tried again, but not waited for.
    pending: u32,
    /// Numbers of the tiles whose data was brought to the GPU or into a mesh.
    shown: Vec<u64>,
    statistics: FrameStatistics,
}

impl Gather<'_> {
    fn run(
        &mut self,
        view: &ViewPoint,
        blocks: &[(usize, usize, Block)],
    ) -> (Vec<BlockDraws>, Vec<TileRecord>) {
        let ranges = self.scene.ranges();
        let floor_m = ranges.floor_m();
        let mut records = Vec::new();
        let mut draws: Vec<BlockDraws> = blocks
            .iter()
            .map(|(output, ..)| BlockDraws {
                output: *output,
                patches: Vec::new(),
            })
            .collect();
        for (screen, eye) in view.eyes.iter().enumerate() {
            let of_screen: Vec<usize> = (0..blocks.len())
                .filter(|index| blocks[*index].1 == screen)
                .collect();
            if of_screen.is_empty() {
                continue;
            }
            let limits = LodLimits {
                deepest_level: self.scene.data.deepest_level,
                tile_px: self.scene.data.tile_px,
                most_tiles: 4 * self.meshes.capacity(),
            };
            let lod = LodView {
                eye: *eye,
                pixels_per_radian: view.pixels_per_radian,
            };
            let selection = terrain::select(&self.scene.data.ellipsoid, &lod, &limits, &ranges);
            self.statistics.selected_tiles += selection.leaves().len() as u32;
            self.statistics.achieved_tile_px = self
                .statistics
                .achieved_tile_px
                .max(selection.achieved_tile_px());
            let horizon = Horizon::new(&self.scene.data.ellipsoid, floor_m, *eye);
            let mut visible_in = Vec::with_capacity(of_screen.len());
            let mut visible: Vec<Tile> = Vec::new();
            for index in &of_screen {
                let frustum = Frustum::from_corners(*eye, blocks[*index].2.corner_directions);
                let tiles = terrain::cull(
                    &self.scene.data.ellipsoid,
                    &selection,
                    &[frustum],
                    &horizon,
                    &ranges,
                );
                visible.extend_from_slice(&tiles);
                visible_in.push(tiles);
            }
            visible.sort_unstable();
            visible.dedup();
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
