//! The real picture: a renderer for all outputs of a host on one adapter, and the surfaces of its windows.
//! In: a wall, scenes, views in the words of `protocol`. Out: the same in the words of `render`. Sun and
//! eyes are derived here with the four basic operations and square roots only, so that every node
//! computes the same bits.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::DVec3;
use protocol::message::{CacheLevel, Drawable, TileCounters, TileNews};
use protocol::pattern::Pattern;
use protocol::scene::{LayerKind, Sun};
use protocol::{Pose, Scene, View, Wall};
use render::{
    CacheConfig, ErrorMeasure, Fetched, Gpu, Level, PassTime, RenderBudget, RenderError,
    StageTiming, TileCache, sun_over,
};
use winit::event_loop::OwnedDisplayHandle;

use repositories::Repositories;

use crate::addresses::{Addresses, repositories};
use crate::cache;
use crate::device::{self, Device};
use crate::displays::Displays;
use crate::known_scenes::{Known, KnownScenes};
use crate::patterns;
use crate::picture::{
    Drawn, OutputImage, Picture, PictureError, PictureMaker, PictureRequest, comparable,
};
use crate::scene_data::scene_data;
use crate::troubles::{Fineness, Troubles};

const MIB: u64 = 1 << 20;
/// How long another node's claim to a tile holds that gives no sign of life.
const LEASE: Duration = Duration::from_secs(5);
/// Tiles that are asked for at the same time: over a network, most of the time is spent waiting.
const REQUESTS: usize = 16;
/// Share of a frame's time that bringing data to the GPU and preparing another scene may take.
const UPLOAD_SHARE: f64 = 0.25;

/// Draws a host's outputs with the graphics adapter of this machine.
pub(crate) struct WallPicture {
    displays: Displays,
    /// Index of the host in its wall.
    host: usize,
    largest_side_px: u32,
    adapter: String,
    cache: Arc<TileCache>,
    repositories: Arc<Repositories>,
    troubles: Troubles,
    /// What the renderers may use of each adapter's memory.
    gpu_mib: u64,
    /// How fine the tiles of the last picture were.
    fineness: Option<Fineness>,
    /// One for each adapter that draws outputs of this host, at least one.
    devices: Vec<Device>,
    scenes: KnownScenes,
    /// Where the sun of the last view stands in scenes that the camera lights.
    camera_sun: DVec3,
    /// The elevation of the scene that was taken last.
    elevation: Vec<PathBuf>,
}

/// Opens this machine's graphics adapter once, and makes a picture for each wall that the node joins.
pub struct WallPictureMaker {
    gpu: Arc<Gpu>,
    /// Adapters that outputs have asked for, by number.
    others: HashMap<u32, Arc<Gpu>>,
    /// All that outputs ask for are the one that was opened first.
    only_one: bool,
}

impl WallPictureMaker {
    /// Opens the adapter whose name contains the variable `WGPU_ADAPTER_NAME`, or the fastest one; for
    /// windows on `display` where there is to be one.
    ///
    /// # Errors
    /// No driver, no such adapter, or one that cannot be used.
    pub fn open(display: Option<OwnedDisplayHandle>) -> Result<Self, PictureError> {
        let wanted = std::env::var("WGPU_ADAPTER_NAME")
            .ok()
            .filter(|name| !name.is_empty());
        let gpu = match display {
            Some(display) => Gpu::open_for_display(Box::new(display), wanted.as_deref()),
            None => Gpu::open(wanted.as_deref()),
        };
        Ok(Self {
            gpu: Arc::new(gpu.map_err(|error| unavailable(&error))?),
            others: HashMap::new(),
            only_one: false,
        })
    }

    /// Takes the adapter that was opened for every adapter that a wall names, as on a machine that is not the wall's.
    #[must_use]
    pub fn with_one_adapter(mut self) -> Self {
        self.only_one = true;
        self
    }

    /// The adapter that an output names; without a number the one that was opened first.
    fn gpu(&mut self, number: Option<u32>) -> Result<Arc<Gpu>, PictureError> {
        let Some(number) = number.filter(|_| !self.only_one) else {
            return Ok(Arc::clone(&self.gpu));
        };
        if let Some(open) = self.others.get(&number) {
            return Ok(Arc::clone(open));
        }
        let opened = self.gpu.open_number(number);
        let opened = Arc::new(opened.map_err(|error| unavailable(&error))?);
        self.others.insert(number, Arc::clone(&opened));
        Ok(opened)
    }

    /// How fast each processing stage is on this adapter, and last a copy of the same bytes.
    ///
    /// # Errors
    /// A device that fails.
    pub fn time_stages(&self) -> Result<Vec<StageTiming>, PictureError> {
        render::time_stages(&self.gpu, &render::SampleWords::hills())
            .map_err(|error| PictureError::Unavailable(error.to_string()))
    }
}

impl PictureMaker for WallPictureMaker {
    fn adapter(&self) -> String {
        self.gpu.name()
    }

    fn make(&mut self, request: PictureRequest<'_>) -> Result<Box<dyn Picture>, PictureError> {
        Ok(Box::new(WallPicture::open(self, &request)?))
    }
}

fn unavailable(error: &dyn std::fmt::Display) -> PictureError {
    PictureError::Unavailable(error.to_string())
}

impl WallPicture {
    /// Opens cache, adapters and surfaces for a host.
    fn open(
        maker: &mut WallPictureMaker,
        request: &PictureRequest<'_>,
    ) -> Result<Self, PictureError> {
        let wall = request.wall;
        let (displays, plans) = Displays::open(wall, request.host, maker.gpu.largest_side_px())?;
        let threads = std::thread::available_parallelism()
            .map_or(2, usize::from)
            .clamp(2, 8);
        let repositories = repositories().map_err(|error| unavailable(&error))?;
        let opener = Addresses(Arc::clone(&repositories));
        let config = CacheConfig {
            ram_bytes: wall.cache.ram_mib * MIB,
            disk_bytes: wall.cache.disk_mib * MIB,
            disk_directory: cache::directory(wall),
            lease: LEASE,
            requests: REQUESTS.max(threads),
            decoders: threads,
        };
        let cache =
            TileCache::open_with(&config, Arc::new(opener)).map_err(|error| unavailable(&error))?;
        let cache = Arc::new(cache);
        let budget = RenderBudget {
            gpu_bytes: wall.cache.gpu_mib * MIB,
            upload: Duration::from_secs_f64(UPLOAD_SHARE / wall.fps),
            // Who starts several nodes on a machine gives each one thread of the software driver.
            shared: std::env::var("LP_NUM_THREADS").is_ok_and(|threads| threads == "1"),
        };
        let outputs = wall.hosts.get(request.host).map(|host| &host.outputs);
        let gpus: Vec<Option<u32>> = outputs
            .into_iter()
            .flatten()
            .map(|output| output.gpu)
            .collect();
        let mut devices = Vec::new();
        for (number, outputs) in device::by_adapter(&gpus) {
            let gpu = maker.gpu(number)?;
            let device = Device::open(gpu, &cache, &plans, &request.windows, outputs, budget);
            devices.push(device.map_err(|error| unavailable(&error))?);
        }
        Ok(Self {
            displays,
            host: request.host,
            largest_side_px: maker.gpu.largest_side_px(),
            adapter: maker.gpu.name(),
            cache,
            repositories,
            troubles: Troubles::default(),
            gpu_mib: wall.cache.gpu_mib,
            fineness: None,
            devices,
            scenes: KnownScenes::default(),
            camera_sun: DVec3::X,
            elevation: Vec::new(),
        })
    }
}

impl WallPicture {
    /// The scene of a view.
    fn known(&self, view: &View) -> Result<Known, PictureError> {
        self.scenes.of_revision(view.scene_revision).ok_or_else(|| {
            PictureError::Frame(format!(
                "frame {} shows revision {} of the scene, which was not prepared",
                view.frame, view.scene_revision
            ))
        })
    }
}

/// Over the viewer's left shoulder.
fn sun_of_camera(pose: &Pose) -> DVec3 {
    let shoulder =
        DVec3::from(pose.back) - DVec3::from(pose.right) * 0.7 + DVec3::from(pose.up) * 0.6;
    shoulder.normalize_or(DVec3::X)
}

/// The repositories of a scene's layers of elevation.
fn elevation_of(scene: &Scene) -> Vec<PathBuf> {
    let layers = scene.layers.iter();
    layers
        .filter(|layer| layer.kind() == LayerKind::Elevation)
        .filter_map(|layer| layer.repository.as_ref().map(PathBuf::from))
        .collect()
}

fn frame_error(error: &RenderError) -> PictureError {
    PictureError::Frame(error.to_string())
}

impl Picture for WallPicture {
    fn open_ahead(&mut self, scene: &Scene) -> bool {
        let data = scene_data(scene, self.camera_sun);
        // All of them: each is to begin.
        let open = self.devices.iter_mut();
        let open = open.map(|device| device.renderer.open_ahead(&data));
        open.fold(true, |all, open| all & open)
    }

    fn prepare_scene(&mut self, revision: u64, scene: &Scene) -> Result<(), PictureError> {
        let sun = scene.light.sun;
        let direction = match sun {
            Sun::Fixed {
                latitude_deg,
                longitude_deg,
            } => sun_over(latitude_deg, longitude_deg),
            Sun::Camera => self.camera_sun,
        };
        let data = scene_data(scene, direction);
        let number = self.scenes.next_number();
        let tile_px = data.tile_px;
        for device in &mut self.devices {
            device
                .renderer
                .prepare_scene(number, data.clone())
                .map_err(|error| PictureError::Scene(error.to_string()))?;
        }
        self.scenes.taken(revision, sun, tile_px);
        self.elevation = elevation_of(scene);
        Ok(())
    }

    fn set_wall(&mut self, wall: &Wall) -> Result<(), PictureError> {
        let (displays, plans) = Displays::open(wall, self.host, self.largest_side_px)
            .map_err(|error| PictureError::Frame(error.to_string()))?;
        for device in &mut self.devices {
            device
                .replace_plans(&plans)
                .map_err(|error| frame_error(&error))?;
        }
        self.displays = displays;
        Ok(())
    }

    fn show_patterns(&mut self, patterns: &[Option<Pattern>]) {
        let abouts = self.displays.about(self.host, &self.adapter);
        for (output, about) in abouts.iter().enumerate() {
            let pattern = patterns.get(output).copied().flatten();
            let picture = pattern.map(|pattern| render::Picture {
                width: about.size_px[0],
                height: about.size_px[1],
                rgba: patterns::draw(pattern, about),
            });
            for device in &mut self.devices {
                device.show_instead(output, picture.clone());
            }
        }
    }

    fn draw(&mut self, view: &View) -> Result<Drawn, PictureError> {
        let known = self.known(view)?;
        let view_point = self.displays.view_point(view);
        self.camera_sun = sun_of_camera(&view.pose);
        let sun = (known.sun == Sun::Camera).then_some(self.camera_sun);
        let mut frames = Vec::with_capacity(self.devices.len());
        for device in &mut self.devices {
            let drawn = device.draw(&view_point, known.number, sun);
            frames.push(drawn.map_err(|error| frame_error(&error))?);
        }
        let statistics = device::together(&frames);
        self.scenes.drawn(known);
        self.fineness = Some(Fineness {
            asked_px: known.tile_px,
            achieved_px: statistics.achieved_tile_px,
            is_device_bound: statistics.is_device_bound,
        });
        Ok(Drawn {
            redrawn: statistics.redrawn,
            converged: statistics.converged,
            pending_tiles: statistics.pending_tiles,
            triangles: statistics.triangles,
            refined_leaves: statistics.refined_leaves,
            achieved_tau_px: statistics.achieved_tau_px,
            achieved_tile_px: statistics.achieved_tile_px,
        })
    }

    fn fetch(
        &mut self,
        view: &View,
        known: &HashSet<u64>,
        patience: Duration,
    ) -> Result<Fetched, PictureError> {
        let scene = self.known(view)?;
        let view_point = self.displays.view_point(view);
        let mut wants = Vec::new();
        let mut fineness = Fineness {
            asked_px: scene.tile_px,
            achieved_px: 0.0,
            is_device_bound: false,
        };
        for device in &mut self.devices {
            let needs = device.renderer.needs(&view_point, scene.number);
            let needs = needs.map_err(|error| frame_error(&error))?;
            wants.extend(needs.wishes);
            fineness.achieved_px = fineness.achieved_px.max(needs.achieved_tile_px);
            fineness.is_device_bound |= needs.is_device_bound;
        }
        self.fineness = Some(fineness);
        self.scenes.drawn(scene);
        Ok(render::fetch(&self.cache, &wants, known, patience))
    }

    fn prepare_ahead(&mut self, at_most: Duration) -> Result<Option<u64>, PictureError> {
        let until = Instant::now() + at_most;
        let mut prepared = None;
        for (index, device) in self.devices.iter_mut().enumerate() {
            let statistics = device
                .renderer
                .prepare_ahead(until)
                .map_err(|error| frame_error(&error))?;
            // Prepared is what all have prepared.
            prepared = match index {
                0 => statistics.prepared,
                _ => prepared.filter(|number| statistics.prepared == Some(*number)),
            };
        }
        Ok(self.scenes.preparing(prepared))
    }

    fn ground_under(&self, output: usize, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let mut devices = self.devices.iter();
        devices.find_map(|device| device.ground_under(output, pixel))
    }

    fn forget_troubles(&mut self) {
        self.troubles = Troubles::default();
    }

    fn finish_loading(&mut self, at_most: Duration) {
        if !self.cache.finish(at_most) {
            tracing::debug!("some tiles are still on their way");
        }
    }

    fn take_troubles(&mut self) -> Vec<String> {
        let states = self.repositories.states();
        let mut sentences = self.troubles.of_repositories(&states);
        if let Some(fineness) = self.fineness {
            sentences.extend(self.troubles.of_tiles(fineness, self.gpu_mib));
        }
        sentences
    }

    fn present(&mut self) -> Result<(), PictureError> {
        for device in &mut self.devices {
            device.present();
        }
        Ok(())
    }

    fn capture(&mut self) -> Result<Vec<OutputImage>, PictureError> {
        let mut images = Vec::new();
        for device in &self.devices {
            images.extend(device.pictures().map_err(|error| frame_error(&error))?);
        }
        images.sort_by_key(|(output, _)| *output);
        Ok(images.into_iter().map(|(_, image)| image).collect())
    }

    fn measure_error(&mut self) -> Result<ErrorMeasure, PictureError> {
        let mut measures = Vec::with_capacity(self.devices.len());
        for device in &mut self.devices {
            let measured = device.renderer.measure_error();
            measures.push(measured.map_err(|error| frame_error(&error))?);
        }
        comparable(device::worst(&measures))
    }

    fn minimum_triangles(&mut self) -> Result<u64, PictureError> {
        let mut sum = 0;
        for device in &mut self.devices {
            let minimum = device.renderer.minimum_triangles();
            sum += minimum.map_err(|error| frame_error(&error))?;
        }
        Ok(sum)
    }

    fn time_passes(&mut self, on: bool) {
        for device in &mut self.devices {
            device.renderer.time_passes(on);
        }
    }

    fn take_pass_times(&mut self) -> Vec<PassTime> {
        let devices = self.devices.iter_mut();
        devices
            .flat_map(|device| device.renderer.take_pass_times())
            .collect()
    }

    fn ground_height_m(&self, latitude_deg: f64, longitude_deg: f64) -> Result<f64, PictureError> {
        let Some(device) = self.devices.first() else {
            return Err(PictureError::Frame("the host has no output".to_owned()));
        };
        device
            .renderer
            .ground_height_m(latitude_deg, longitude_deg)
            .map_err(|error| frame_error(&error))
    }

    fn finest_tiles(&self, most: usize) -> Result<Vec<u64>, PictureError> {
        let cache = &self.cache;
        let mut finest = Vec::new();
        for repository in &self.elevation {
            let id = cache
                .add_dataset(repository)
                .map_err(|error| PictureError::Scene(error.to_string()))?;
            let Some(data) = cache.dataset(id) else {
                continue;
            };
            let deepest = data.index.deepest_level();
            let tiles = data.index.tiles().into_iter();
            for tile in tiles.filter(|tile| tile.level() == deepest) {
                finest.push(tile.id());
            }
        }
        let step = finest.len().div_ceil(most.max(1)).max(1);
        Ok(finest.into_iter().step_by(step).take(most).collect())
    }

    fn counters(&self) -> TileCounters {
        let counters = self.cache.counters();
        TileCounters {
            distinct: counters.distinct,
            repository_reads: counters.repository_reads,
            disk_hits: counters.disk_hits,
            ram_hits: counters.ram_hits,
            corrupt: counters.corrupt,
            repository_bytes: counters.repository_bytes,
            failed: counters.failed,
            early_bytes: counters.early_bytes,
            vain_bytes: counters.vain_bytes,
        }
    }

    fn take_tile_news(&mut self, most: usize) -> TileNews {
        let mut news = TileNews {
            loaded: self.cache.take_loaded(most),
            ..TileNews::default()
        };
        for device in &mut self.devices {
            let left = most.saturating_sub(news.used.len());
            news.used.extend(device.renderer.take_new_tiles(left));
            let left = most.saturating_sub(news.drawable.len());
            let drawable = device.renderer.take_drawable(left);
            news.drawable.extend(drawable.into_iter().map(drawable_of));
        }
        news
    }
}

fn drawable_of((level, after): (Level, Duration)) -> Drawable {
    Drawable {
        level: match level {
            Level::Repository => CacheLevel::Repository,
            Level::Disk => CacheLevel::Disk,
            Level::Ram => CacheLevel::Ram,
        },
        after_us: u32::try_from(after.as_micros()).unwrap_or(u32::MAX),
    }
}
