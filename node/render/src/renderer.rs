//! From a view to finished pictures: select, gather data, build meshes, draw blocks.
//!
//! In: a scene, views. Out: one picture per output, and what is still missing for the best one. It never
//! waits for data: what is not in memory is asked for, and its best ancestor is shown meanwhile. It knows
//! no network and no window.

mod ahead;
mod blocks;
mod encode;
mod foresight;
mod measure;
mod needs;
mod shown;
mod view;

use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use geodesy::Tile;
use glam::DVec3;
use shaders::{FrameUniform, TileRecord};
use tiles::{DatasetId, Level, TileCache, Wish, Wishes};

use crate::arrivals::Arrivals;
use crate::error::RenderError;
use crate::finish::Finisher;
use crate::gather::{BlockDraws, Gather};
use crate::geometry::Geometries;
use crate::gpu::Gpu;
use crate::loaded::LoadedScene;
use crate::meshes::Meshes;
use crate::outputs::OutputPlan;
use crate::pipelines::Pipelines;
use crate::process::Processor;
use crate::recorder::PassTimes;
use crate::refine::Refiner;
use crate::refining::{Refined, TauSteps};
use crate::room::Shares;
use crate::source::Source;
use crate::target::{BlockTarget, OutputTarget, Picture};
use crate::textures::SurfaceTextures;
use crate::uniform::frame_uniform;
use blocks::{filled_blocks, plan_blocks};
use foresight::Foresight;

pub use ahead::AheadStatistics;
pub(crate) use blocks::PlannedBlock;
pub use measure::{ErrorMeasure, PassTime};
pub use needs::Needs;
pub use view::{EyeView, FrameStatistics, RenderBudget, ViewPoint};

/// The longest that processing for the shown scene may hold up one frame.
const LONGEST_PROCESSING: Duration = Duration::from_millis(50);
/// The same before a first picture was complete, when nobody waits for this node yet.
const LONGEST_FIRST_PROCESSING: Duration = Duration::from_millis(250);
/// How long the first picture is a coarse one while the data for a better one is on its way.
const FIRST_PICTURE: Duration = Duration::from_secs(1);

/// What a stage takes of a tile where the processor computes it, roughly.
const STEP: Duration = Duration::from_millis(2);
/// Stages that are begun in a frame there, at least.
const LEAST_STEPS: u32 = 2;
/// How many times as many a node begins that has the processors for itself, and that while its picture stands.
const ALONE: u32 = 2;
const STANDING: u32 = 3;

/// Draws one scene for the outputs of one node.
pub struct Renderer {
    gpu: Arc<Gpu>,
    cache: Arc<TileCache>,
    budget: RenderBudget,
    outputs: Vec<(OutputPlan, OutputTarget, Option<BlockTarget>)>,
    textures: SurfaceTextures,
    processor: Processor,
    pipelines: Pipelines,
    finisher: Finisher,
    geometries: Geometries,
    refiner: Refiner,
    meshes: Meshes,
    /// How many times τ meshes may be off, so that all of them fit.
    tau: TauSteps,
    /// Times of passes on the device, while they are wanted.
    times: Option<PassTimes>,
    scene: Option<LoadedScene>,
    /// The scene in preparation.
    next: Option<LoadedScene>,
    /// What it waits for.
    next_wants: Vec<Wish>,
    /// Whether it was prepared for the view drawn last when that many tiles had arrived.
    next_prepared_at: Option<u64>,
    /// Data sets on their way for a scene to come, and those that have come.
    opening: Option<Receiver<Vec<Source>>>,
    opened: Vec<Source>,
    /// Another scene is shown since the last picture.
    switched: bool,
    /// How long the last picture took to encode and to be waited for.
    draw_time: Duration,
    /// Some picture was complete.
    complete: bool,
    /// When the first was begun.
    begun: Option<Instant>,
    frame: u64,
    /// The light has changed since the last picture, or what outputs are.
    relit: bool,
    /// Pictures that outputs show instead of the scene.
    instead: HashMap<usize, Picture>,
    used: HashSet<u64>,
    new_tiles: Vec<u64>,
    arrivals: Arrivals,
    /// Its own, beside those of other devices of the host.
    wishes: Wishes,
    foresight: Foresight,
    last: Option<LastFrame>,
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
    /// Not all was made that could be.
    behind: bool,
    /// Some data could not be had.
    lacks: bool,
    /// What each eye's leaves were made of.
    refined: Vec<Refined>,
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
    /// Some data could not be had.
    lacks: bool,
    refined: Vec<Refined>,
    statistics: FrameStatistics,
}

impl LastFrame {
    /// True where nothing is missing. Data that could not be had may come yet.
    fn is_final(&self, arrivals: u64) -> bool {
        self.statistics.converged && (!self.lacks || self.arrivals == arrivals)
    }

    /// True where only tiles on their way can change the picture, and none has come.
    fn waits_for_arrivals(&self, arrivals: u64) -> bool {
        self.statistics.pending_tiles > 0 && !self.behind && self.arrivals == arrivals
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
        let wishes = cache.wishes();
        let shares = Shares::of(budget.gpu_bytes);
        let textures = SurfaceTextures::new(&gpu, shares.textures);
        let processor = Processor::new(&gpu, shares.processing);
        let geometries = Geometries::new(&gpu, shares.geometries);
        let meshes = Meshes::new(&gpu, shares.meshes);
        let refiner = Refiner::new(&gpu);
        let pipelines = Pipelines::new(&gpu, &textures)?;
        let finisher = Finisher::new(&gpu, outputs)?;
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
            finisher,
            geometries,
            refiner,
            meshes,
            tau: TauSteps::FIRST,
            times: None,
            scene: None,
            next: None,
            next_wants: Vec::new(),
            next_prepared_at: None,
            opening: None,
            opened: Vec::new(),
            switched: false,
            draw_time: Duration::ZERO,
            complete: false,
            begun: None,
            frame: 0,
            relit: false,
            instead: HashMap::new(),
            used: HashSet::new(),
            new_tiles: Vec::new(),
            arrivals: Arrivals::default(),
            wishes,
            foresight: Foresight::default(),
            last: None,
        })
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

    /// How long tiles took from the first frame that wanted them to the one that could draw them, with the level of the
    /// cache that each was found at: what was not told yet, at most `most`.
    pub fn take_drawable(&mut self, most: usize) -> Vec<(Level, Duration)> {
        self.arrivals.take(most)
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
            && (self.next.is_none() || self.next_prepared_at == Some(arrivals))
            && last.view == *view
            && (last.is_final(arrivals) || last.waits_for_arrivals(arrivals))
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
            self.refiner.warm(&self.gpu);
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
        if self.last.as_ref().is_none_or(|last| last.view != *view) {
            self.next_prepared_at = None;
        }
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
        // The next scene is prepared after a frame, and wants what it wants as of that one.
        self.arrivals.forget_before(self.frame.saturating_sub(1));
        let (relit, switched) = (
            std::mem::take(&mut self.relit),
            std::mem::take(&mut self.switched),
        );
        let unchanged = self.last.as_ref().is_some_and(|last| {
            !relit
                && last.view == *view
                && last.draws == gathered.draws
                && last.records == gathered.records
                && gathered.statistics.refined_leaves == 0
                && gathered.statistics.processed_tiles == 0
        });
        if !unchanged {
            let frames: Vec<FrameUniform> = blocks
                .iter()
                .map(|planned| frame_uniform(&scene.data, view, planned.eye, &planned.block))
                .collect();
            self.pipelines
                .write(&self.gpu, &self.textures, &frames, &gathered.records);
            let filled = filled_blocks(scene, view, &blocks);
            let begin = Instant::now();
            self.render(
                view,
                &blocks,
                &gathered.draws,
                &filled,
                scene.data.wireframe,
            )?;
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
            behind: gathered.behind,
            lacks: gathered.lacks,
            refined: gathered.refined,
            statistics: gathered.statistics,
        });
        self.request();
        Ok(gathered.statistics)
    }

    /// Asks for all that is missing.
    fn request(&self) {
        let shown = self.last.as_ref().map(|last| last.wants.as_slice());
        let wants = [shown.unwrap_or_default(), &self.next_wants].concat();
        self.wishes.request(&wants);
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
        let begun = *self.begun.get_or_insert_with(Instant::now);
        let mut gather = Gather {
            gpu: &self.gpu,
            cache: &self.cache,
            textures: &mut self.textures,
            processor: &mut self.processor,
            geometries: &mut self.geometries,
            refiner: &mut self.refiner,
            meshes: &mut self.meshes,
            tau: &mut self.tau,
            times: &mut self.times,
            scene,
            shares: self.next.is_some() || self.last.is_some(),
            ahead,
            first: !self.complete && !ahead && begun.elapsed() < FIRST_PICTURE,
            frame: self.frame,
            gaze: -view.room.z_axis,
            upload_until,
            steps_left: (ahead && self.gpu.is_software()).then(|| {
                let steps = self.budget.upload.as_secs_f64() / STEP.as_secs_f64();
                let steps = (steps.round() as u32).max(LEAST_STEPS);
                let drawn = self.last.as_ref().map(|last| last.statistics.redrawn);
                match (self.budget.shared, drawn) {
                    (true, _) => steps,
                    (false, Some(false)) => steps * ALONE * STANDING,
                    (false, _) => steps * ALONE,
                }
            }),
            worked: false,
            arrivals: &mut self.arrivals,
            wants: Vec::new(),
            pending: HashSet::new(),
            away: HashSet::new(),
            behind: false,
            lacks: false,
            broken: HashMap::new(),
            refined: Vec::new(),
            shown: Vec::new(),
            statistics: FrameStatistics {
                converged: true,
                ..FrameStatistics::default()
            },
        };
        let (draws, records) = gather.run(view, blocks)?;
        let mut statistics = gather.statistics;
        statistics.pending_tiles = (gather.pending.len() + gather.away.len()) as u32;
        statistics.converged &= statistics.pending_tiles == 0 && !gather.behind;
        let (behind, lacks) = (gather.behind, gather.lacks);
        let pending = std::mem::take(&mut gather.pending);
        let wants = std::mem::take(&mut gather.wants);
        let shown = std::mem::take(&mut gather.shown);
        let refined = std::mem::take(&mut gather.refined);
        self.new_tiles
            .extend(shown.into_iter().filter(|number| self.used.insert(*number)));
        Ok(Gathered {
            draws,
            records,
            wants,
            pending,
            behind,
            lacks,
            refined,
            statistics,
        })
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
