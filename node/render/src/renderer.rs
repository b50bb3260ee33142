//! From a view to finished pictures: select, gather data, build meshes, draw blocks.
//!
//! In: a scene, views. Out: one picture per output, and what is still missing for the best one. It never
//! waits for data: what is not in memory is asked for, and its best ancestor is shown meanwhile. It knows
//! no network and no window.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use geodesy::{Ellipsoid, Tile};
use glam::{DMat3, DVec3};
use shaders::{FrameUniform, TileRecord};
use tiles::{DatasetId, TileCache, Wish};

use crate::canvas::{Block, ChannelPlan, OutputPlan, PlanarScreen};
use crate::error::RenderError;
use crate::gather::{BlockDraws, Gather};
use crate::gpu::Gpu;
use crate::loaded::LoadedScene;
use crate::meshes::Meshes;
use crate::pipelines::Pipelines;
use crate::process::Processor;
use crate::ranges::Ranges;
use crate::scene::SceneData;
use crate::target::{BlockLayout, BlockTarget, OutputTarget, Picture};
use crate::textures::SurfaceTextures;
use crate::uniform::frame_uniform;

/// The longest that processing for the shown scene may hold up one frame.
const LONGEST_PROCESSING: Duration = Duration::from_millis(50);
/// The same before a first picture was complete, when nobody waits for this node yet.
const LONGEST_FIRST_PROCESSING: Duration = Duration::from_millis(250);

/// What a stage takes of a tile where the processor computes it, roughly.
const STEP: Duration = Duration::from_millis(2);
/// Stages that are begun in a frame there, at least.
const LEAST_STEPS: u32 = 2;

/// Limits of memory and time.
#[derive(Clone, Copy, Debug)]
pub struct RenderBudget {
    /// GPU memory for tiles and meshes in bytes.
    pub gpu_bytes: u64,
    /// Time that processing the next scene may take from one frame. What the shown scene lacks may take as long as its
    /// picture takes to draw, if that is more.
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
    /// Results made in this frame: fused heights or colours of a tile.
    pub processed_tiles: u32,
    /// The scene in preparation, once everything that this view needs of it is there.
    pub prepared: Option<u64>,
    /// Meshes built in this frame.
    pub meshes_built: u32,
    /// The side in pixels beyond which tiles were split: the scene's, or more where budgets forbid it.
    pub achieved_tile_px: f64,
}

/// What one call of [`Renderer::prepare_ahead`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AheadStatistics {
    /// The scene in preparation, once everything that the last view needs of it is there.
    pub prepared: Option<u64>,
    /// Results made.
    pub processed_tiles: u32,
}

/// Draws one scene for the outputs of one node.
pub struct Renderer {
    gpu: Arc<Gpu>,
    cache: Arc<TileCache>,
    budget: RenderBudget,
    outputs: Vec<(OutputPlan, OutputTarget, Option<BlockTarget>)>,
    textures: SurfaceTextures,
    processor: Processor,
    pipelines: Pipelines,
    /// Meshes by refinement of their patches: those of the shown scene, and of the next where it differs.
    meshes: Vec<(u8, Meshes)>,
    scene: Option<LoadedScene>,
    /// The scene in preparation.
    next: Option<LoadedScene>,
    /// What it waits for.
    next_wants: Vec<Wish>,
    /// Another scene is shown since the last picture.
    switched: bool,
    /// How long the last picture took the GPU.
    draw_time: Duration,
    /// Some picture was complete.
    complete: bool,
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
    wants: Vec<Wish>,
    /// Tiles on their way.
    pending: HashSet<(DatasetId, Tile)>,
    statistics: FrameStatistics,
}

/// What a scene has for a view.
struct Gathered {
    draws: Vec<BlockDraws>,
    records: Vec<TileRecord>,
    wants: Vec<Wish>,
    /// Tiles on their way.
    pending: HashSet<(DatasetId, Tile)>,
    /// Not all was made that could be.
    behind: bool,
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
        // An eighth for meshes, a half for what is drawn, the rest for what it is made of.
        let textures = SurfaceTextures::new(&gpu, budget.gpu_bytes / 2);
        let processor = Processor::new(&gpu, budget.gpu_bytes / 8 * 3);
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
            processor,
            pipelines,
            meshes: Vec::new(),
            scene: None,
            next: None,
            next_wants: Vec::new(),
            switched: false,
            draw_time: Duration::ZERO,
            complete: false,
            frame: 0,
            relit: false,
            used: HashSet::new(),
            new_tiles: Vec::new(),
            last: None,
        })
    }

    /// Takes a scene. The first is shown at once; a later one is prepared while the shown one is drawn, and takes
    /// the place of another in preparation. Its indices are read at once where no scene has them open, its tiles when
    /// they are looked at. On an error nothing changes.
    pub fn prepare_scene(&mut self, revision: u64, data: SceneData) -> Result<(), RenderError> {
        let known: Vec<&LoadedScene> = self.scene.iter().chain(&self.next).collect();
        let refinement = data.refinement;
        let loaded = LoadedScene::open(&self.cache, revision, data, &known)?;
        if !self.meshes.iter().any(|(known, _)| *known == refinement) {
            let meshes = Meshes::new(&self.gpu, refinement, self.budget.gpu_bytes / 8)?;
            self.meshes.push((refinement, meshes));
        }
        if self.scene.is_none() {
            self.scene = Some(loaded);
            self.switched = true;
        } else {
            self.next = Some(loaded);
            self.next_wants.clear();
        }
        let scenes = [&self.scene, &self.next];
        self.meshes.retain(|(refinement, _)| {
            let mut used = scenes.iter().filter_map(|scene| scene.as_ref());
            used.any(|scene| scene.data.refinement == *refinement)
        });
        Ok(())
    }

    /// Shows a scene from the next picture on: the one in preparation, or the one that is shown already.
    pub fn show(&mut self, revision: u64) -> Result<(), RenderError> {
        let is = |scene: &Option<LoadedScene>| {
            scene
                .as_ref()
                .is_some_and(|scene| scene.revision == revision)
        };
        if is(&self.scene) {
            return Ok(());
        }
        if !is(&self.next) {
            return Err(RenderError::UnknownScene { revision });
        }
        let before = std::mem::replace(&mut self.scene, self.next.take());
        self.switched = true;
        self.next_wants.clear();
        // Everything else that a picture is made of is compared with the last one's.
        if let (Some(before), Some(scene)) = (before, &self.scene) {
            let (old, new) = (&before.data, &scene.data);
            self.relit |= (old.light, old.air, old.ellipsoid)
                != (new.light, new.air, new.ellipsoid)
                || old.refinement != new.refinement;
        }
        Ok(())
    }

    /// Moves the shown scene's sun without taking a new scene.
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

    /// Draws the view of a scene as [`Renderer::draw_shown`] does, then goes on preparing the next scene in what is
    /// left of the time that a frame has for it.
    pub fn draw(
        &mut self,
        view: &ViewPoint,
        revision: u64,
    ) -> Result<FrameStatistics, RenderError> {
        let until = Instant::now() + self.budget.upload;
        let mut statistics = self.draw_shown(view, revision)?;
        let ahead = self.prepare_ahead(until)?;
        statistics.prepared = ahead.prepared;
        statistics.processed_tiles += ahead.processed_tiles;
        Ok(statistics)
    }

    /// Draws the view of a scene into every output and waits for the GPU. Draws nothing where nothing changed.
    pub fn draw_shown(
        &mut self,
        view: &ViewPoint,
        revision: u64,
    ) -> Result<FrameStatistics, RenderError> {
        self.show(revision)?;
        let arrivals = self.cache.generation();
        if let Some(last) = &self.last
            && !self.relit
            && !self.switched
            && self.next.is_none()
            && last.view == *view
            && (last.statistics.converged || last.waits_for_arrivals(arrivals))
            && last.statistics.processed_tiles == 0
        {
            return Ok(FrameStatistics {
                redrawn: false,
                ..last.statistics
            });
        }
        self.frame += 1;
        let Some(scene) = self.scene.take() else {
            return Err(RenderError::UnknownScene { revision });
        };
        let drawn = self.draw_scene(&scene, view, arrivals);
        if self.frame == 1 {
            // Not before: the first picture needs the processors itself.
            self.processor.warm(&self.gpu);
        }
        self.scene = Some(scene);
        drawn
    }

    fn draw_scene(
        &mut self,
        scene: &LoadedScene,
        view: &ViewPoint,
        arrivals: u64,
    ) -> Result<FrameStatistics, RenderError> {
        let begin = Instant::now();
        let upload_until = begin + self.budget.upload;
        let blocks = plan_blocks(&self.outputs, view);
        let lacking = if self.complete {
            self.draw_time.min(LONGEST_PROCESSING)
        } else {
            LONGEST_FIRST_PROCESSING
        };
        let lacking_until = upload_until.max(begin + lacking);
        let mut gathered = self.gather(scene, view, &blocks, lacking_until, false)?;
        let (relit, switched) = (
            std::mem::take(&mut self.relit),
            std::mem::take(&mut self.switched),
        );
        let unchanged = self.last.as_ref().is_some_and(|last| {
            !relit
                && last.view == *view
                && last.draws == gathered.draws
                && last.records == gathered.records
                && gathered.statistics.meshes_built == 0
                && gathered.statistics.processed_tiles == 0
        });
        if !unchanged {
            let frames: Vec<FrameUniform> = blocks
                .iter()
                .map(|planned| frame_uniform(&scene.data, view, planned.screen, &planned.block))
                .collect();
            self.pipelines
                .write(&self.gpu, &self.textures, &frames, &gathered.records);
            let filled = filled_blocks(scene, view, &blocks);
            let begin = Instant::now();
            self.render(&blocks, &gathered.draws, &filled, scene.data.refinement)?;
            self.draw_time = begin.elapsed();
        }
        gathered.statistics.redrawn = !unchanged;
        self.complete |= gathered.statistics.converged;
        if switched {
            tracing::debug!(revision = scene.revision, "a scene is shown");
        }
        self.last = Some(LastFrame {
            view: view.clone(),
            draws: gathered.draws,
            records: gathered.records,
            arrivals,
            wants: gathered.wants,
            pending: gathered.pending,
            statistics: gathered.statistics,
        });
        self.request();
        Ok(gathered.statistics)
    }

    /// Goes on preparing the next scene for the view drawn last, once after each call of [`Renderer::draw_shown`]: until
    /// this moment, but no longer than the budget allows or, where that is more, a quarter of the time that the last
    /// picture took. It does at least one step, or a slow machine would never finish.
    pub fn prepare_ahead(&mut self, until: Instant) -> Result<AheadStatistics, RenderError> {
        let Some(view) = self.last.as_ref().map(|last| last.view.clone()) else {
            return Ok(AheadStatistics::default());
        };
        let Some(next) = self.next.take() else {
            return Ok(AheadStatistics::default());
        };
        // A driver that computes on the processor takes milliseconds for one stage, and much more where others want
        // the processor too. So a few are begun in each frame and nobody waits for them.
        if self.gpu.is_software() && !self.gpu.is_idle()? {
            self.next = Some(next);
            return Ok(AheadStatistics::default());
        }
        let until = until.min(Instant::now() + self.budget.upload.max(self.draw_time / 4));
        let blocks = plan_blocks(&self.outputs, &view);
        let ahead = self.gather(&next, &view, &blocks, until, true);
        let revision = next.revision;
        self.next = Some(next);
        let ahead = ahead?;
        self.next_wants = ahead.wants;
        self.request();
        // What the shown scene waits for as well does not keep the next one back: a viewer in flight always
        // waits for something.
        let prepared = !ahead.behind
            && self
                .last
                .as_ref()
                .is_some_and(|last| ahead.pending.is_subset(&last.pending));
        Ok(AheadStatistics {
            prepared: prepared.then_some(revision),
            processed_tiles: ahead.statistics.processed_tiles,
        })
    }

    /// Asks for all that is missing.
    fn request(&self) {
        let shown = self.last.as_ref().map(|last| last.wants.as_slice());
        let wants = [shown.unwrap_or_default(), &self.next_wants].concat();
        self.cache.request(&wants);
    }

    /// What a view needs of a scene: what is there, and as much more as can be made until then.
    fn gather(
        &mut self,
        scene: &LoadedScene,
        view: &ViewPoint,
        blocks: &[PlannedBlock],
        upload_until: Instant,
        ahead: bool,
    ) -> Result<Gathered, RenderError> {
        let refinement = scene.data.refinement;
        let of_scene = |(known, _): &&mut (u8, Meshes)| *known == refinement;
        let Some((_, meshes)) = self.meshes.iter_mut().find(of_scene) else {
            return Err(RenderError::UnknownScene {
                revision: scene.revision,
            });
        };
        let mut gather = Gather {
            gpu: &self.gpu,
            cache: &self.cache,
            textures: &mut self.textures,
            processor: &mut self.processor,
            meshes,
            scene,
            shares: self.next.is_some() || self.last.is_some(),
            ahead,
            frame: self.frame,
            upload_until,
            steps_left: (ahead && self.gpu.is_software()).then(|| {
                let steps = self.budget.upload.as_secs_f64() / STEP.as_secs_f64();
                (steps.round() as u32).max(LEAST_STEPS)
            }),
            worked: false,
            wants: Vec::new(),
            pending: HashSet::new(),
            behind: false,
            broken: HashMap::new(),
            shown: Vec::new(),
            statistics: FrameStatistics {
                converged: true,
                ..FrameStatistics::default()
            },
        };
        let (draws, records) = gather.run(view, blocks)?;
        let mut statistics = gather.statistics;
        statistics.pending_tiles = gather.pending.len() as u32;
        statistics.converged &= gather.pending.is_empty() && !gather.behind;
        let (pending, behind) = (std::mem::take(&mut gather.pending), gather.behind);
        let wants = std::mem::take(&mut gather.wants);
        let shown = std::mem::take(&mut gather.shown);
        self.new_tiles
            .extend(shown.into_iter().filter(|number| self.used.insert(*number)));
        Ok(Gathered {
            draws,
            records,
            wants,
            pending,
            behind,
            statistics,
        })
    }

    fn render(
        &mut self,
        blocks: &[PlannedBlock],
        draws: &[BlockDraws],
        filled: &[bool],
        refinement: u8,
    ) -> Result<(), RenderError> {
        let of_scene = |(known, _): &&(u8, Meshes)| *known == refinement;
        let Some((_, meshes)) = self.meshes.iter().find(of_scene) else {
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

    /// Latitude and longitude in degrees on the ellipsoid under a pixel of an output, y down, in the view drawn last.
    /// `None` beside the planet, and where nothing is drawn.
    #[must_use]
    pub fn ground_under(&self, output: usize, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let (view, scene) = (&self.last.as_ref()?.view, self.scene.as_ref()?);
        let (plan, _, _) = self.outputs.get(output)?;
        let [x, y] = pixel;
        let channel = plan.channels.iter().find(|channel| {
            let [left, top] = channel.output_px.map(f64::from);
            let (width, height) = (
                f64::from(channel.canvas_px.width),
                f64::from(channel.canvas_px.height),
            );
            (left..left + width).contains(&x) && (top..top + height).contains(&y)
        })?;
        let on_canvas = [
            x - f64::from(channel.output_px[0]) + f64::from(channel.canvas_px.x),
            y - f64::from(channel.output_px[1]) + f64::from(channel.canvas_px.y),
        ];
        let eye = *view.eyes.get(channel.screen)?;
        let ray = view.room * view.screens.get(channel.screen)?.ray_through(on_canvas);
        let normal = ground_hit(&scene.data.ellipsoid, eye, ray)?;
        let (latitude_deg, longitude_deg) = Ellipsoid::angles_deg(normal);
        Some([latitude_deg, longitude_deg])
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

/// The geodetic normal where a ray from an eye first meets the ellipsoid.
fn ground_hit(ellipsoid: &Ellipsoid, eye: DVec3, ray: DVec3) -> Option<DVec3> {
    let (a, b) = (ellipsoid.semi_major_m, ellipsoid.semi_minor_m);
    // In units of the semi-axes the ellipsoid is the unit sphere.
    let (from, along) = (eye / DVec3::new(a, a, b), ray / DVec3::new(a, a, b));
    let (square, half, rest) = (
        along.length_squared(),
        from.dot(along),
        from.length_squared() - 1.0,
    );
    let discriminant = half * half - square * rest;
    let distance = (-half - discriminant.sqrt()) / square;
    // NaN where the ray misses.
    (distance > 0.0).then(|| {
        let hit = eye + ray * distance;
        (hit / DVec3::new(a * a, a * a, b * b)).normalize()
    })
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
    let floor_m = Ranges(scene).floor_m();
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
