//! From a view to finished pictures: select, gather data, build meshes, draw blocks.
//!
//! In: a scene, views. Out: one picture per output, and what is still missing for the best one. It never
//! waits for data: what is not in memory is asked for, and its best ancestor is shown meanwhile. It knows
//! no network and no window.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::{DMat3, DVec3};
use shaders::{FrameUniform, TileRecord};
use tiles::TileCache;

use crate::canvas::{Block, ChannelPlan, OutputPlan, PlanarScreen};
use crate::error::RenderError;
use crate::gather::{BlockDraws, Gather};
use crate::gpu::Gpu;
use crate::meshes::Meshes;
use crate::pipelines::Pipelines;
use crate::scene::{Layer, LoadedScene, SceneData};
use crate::target::{BlockLayout, BlockTarget, OutputTarget, Picture};
use crate::textures::SurfaceTextures;
use crate::uniform::frame_uniform;

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

/// A block, and which channel of which output it is drawn for.
pub(crate) struct PlannedBlock {
    pub(crate) output: usize,
    channel: usize,
    pub(crate) screen: usize,
    pub(crate) block: Block,
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

impl LastFrame {
    /// True where only tiles on their way can change the picture, and none has come.
    fn waits_for_arrivals(&self, arrivals: u64) -> bool {
        self.statistics.pending_tiles > 0 && self.arrivals == arrivals
    }
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
        let same = |old: Option<&Layer>, new: Option<&Layer>| {
            old.map(Layer::version) == new.map(Layer::version)
        };
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
            && (last.statistics.converged || last.waits_for_arrivals(arrivals))
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
                .map(|planned| frame_uniform(&scene.data, view, planned.screen, &planned.block))
                .collect();
            self.pipelines
                .write(&self.gpu, &self.textures, &frames, &records);
            let filled = filled_blocks(scene, view, &blocks);
            self.render(&blocks, &draws, &filled)?;
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
        blocks: &[PlannedBlock],
        draws: &[BlockDraws],
        filled: &[bool],
    ) -> Result<(), RenderError> {
        let Some(meshes) = &self.meshes else {
            return Ok(());
        };
        let mut encoder = self
            .gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let layouts = block_layouts(&self.outputs, blocks);
        for (index, (planned, draws)) in blocks.iter().zip(draws).enumerate() {
            let block = &planned.block;
            let Some((plan, target, scratch)) = self.outputs.get_mut(planned.output) else {
                continue;
            };
            let layout = layouts[planned.output];
            // A tracked head can lose or find a screen, and with it the blocks of an output.
            if scratch.as_ref().is_some_and(|block| block.layout != layout) {
                *scratch = None;
            }
            let scratch = scratch.get_or_insert_with(|| BlockTarget::new(&self.gpu, layout));
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
            pass.set_vertex_buffer(0, meshes.written());
            pass.set_index_buffer(meshes.indices.slice(..), wgpu::IndexFormat::Uint16);
            for (record, mesh) in &draws.patches {
                let range = mesh.first_index..mesh.first_index + mesh.index_count;
                pass.draw_indexed(range, mesh.base_vertex, *record..*record + 1);
            }
            if !filled.get(index).copied().unwrap_or_default() {
                pass.set_pipeline(&self.pipelines.atmosphere);
                pass.draw(0..3, 0..1);
            }
            drop(pass);
            if let Some((texture, _)) = &scratch.colour
                && let Some(channel) = plan.channels.get(planned.channel)
            {
                copy_block(&mut encoder, texture, target, channel, block);
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

/// All blocks of all channels of all outputs, in a fixed order.
fn plan_blocks(
    outputs: &[(OutputPlan, OutputTarget, Option<BlockTarget>)],
    view: &ViewPoint,
) -> Vec<PlannedBlock> {
    let mut blocks = Vec::new();
    for (output, (plan, _, _)) in outputs.iter().enumerate() {
        for (index, channel) in plan.channels.iter().enumerate() {
            let Some(screen) = view.screens.get(channel.screen) else {
                continue;
            };
            let of_channel = screen.blocks(channel.canvas_px, view.room);
            blocks.extend(of_channel.into_iter().map(|block| PlannedBlock {
                output,
                channel: index,
                screen: channel.screen,
                block,
            }));
        }
    }
    blocks
}

/// Whether the planet, at its lowest, fills each block.
fn filled_blocks(scene: &LoadedScene, view: &ViewPoint, blocks: &[PlannedBlock]) -> Vec<bool> {
    let floor_m = scene.ranges().floor_m();
    let (a, b) = (
        scene.data.ellipsoid.semi_major_m,
        scene.data.ellipsoid.semi_minor_m,
    );
    let semi_axes_m = DVec3::new(a, a, b) + floor_m;
    let filled = |planned: &PlannedBlock| {
        view.eyes
            .get(planned.screen)
            .is_some_and(|eye| planned.block.is_filled_by(semi_axes_m, *eye))
    };
    blocks.iter().map(filled).collect()
}

/// How large each output's block target must be, and whether it can be drawn to directly.
fn block_layouts(
    outputs: &[(OutputPlan, OutputTarget, Option<BlockTarget>)],
    blocks: &[PlannedBlock],
) -> Vec<BlockLayout> {
    let mut layouts = vec![BlockLayout::default(); outputs.len()];
    let mut counts = vec![0_u32; outputs.len()];
    for planned in blocks {
        let output = planned.output;
        let layout = &mut layouts[output];
        let wanted = planned.block.wanted;
        layout.size[0] = layout.size[0].max(wanted.x + wanted.width);
        layout.size[1] = layout.size[1].max(wanted.y + wanted.height);
        counts[output] += 1;
        layout.direct = counts[output] == 1
            && (wanted.x, wanted.y) == (0, 0)
            && outputs[output].0.size_px == [wanted.width, wanted.height];
    }
    layouts
}

/// Copies a block's wanted part to its place in the output.
fn copy_block(
    encoder: &mut wgpu::CommandEncoder,
    block_texture: &wgpu::Texture,
    target: &OutputTarget,
    channel: &ChannelPlan,
    block: &Block,
) {
    let wanted = block.wanted;
    let on_canvas = (block.area.x + wanted.x, block.area.y + wanted.y);
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
