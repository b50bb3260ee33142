//! The real picture: one renderer for all outputs of a host, and the surfaces of its windows.
//! In: a wall, scenes, views in the words of `protocol`. Out: the same in the words of `render`. Sun and
//! eyes are derived here with the four basic operations and square roots only, so that every node
//! computes the same bits.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::{DMat3, DVec3};
use protocol::message::TileCounters;
use protocol::scene::{LayerKind, Sun};
use protocol::wall::{Host, Screen};
use protocol::{Pose, Scene, View, Wall};
use render::{
    CacheConfig, ChannelPlan, ErrorMeasure, Gpu, OutputPlan, PassTime, PixelRect, PlanarScreen,
    RenderBudget, RenderError, Renderer, StageTiming, TileCache, ViewPoint, WindowSurface,
    sun_over,
};
use winit::event_loop::OwnedDisplayHandle;

use crate::known_scenes::KnownScenes;
use crate::picture::{
    Drawn, OutputImage, Picture, PictureError, PictureMaker, PictureRequest, comparable,
};
use crate::scene_data::scene_data;

const MIB: u64 = 1 << 20;
/// Share of a frame's time that bringing data to the GPU and preparing another scene may take.
const UPLOAD_SHARE: f64 = 0.25;

/// Draws a host's outputs with the graphics adapter of this machine.
pub(crate) struct WallPicture {
    wall: Wall,
    renderer: Renderer,
    surfaces: Vec<WindowSurface>,
    scenes: KnownScenes,
    /// Where the sun of the last view stands in scenes that the camera lights.
    camera_sun: DVec3,
    /// The elevation of the scene that was taken last.
    elevation: Vec<PathBuf>,
}

/// Opens this machine's graphics adapter once, and makes a picture for each wall that the node joins.
pub struct WallPictureMaker {
    gpu: Arc<Gpu>,
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
        })
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
        Ok(Box::new(WallPicture::open(
            Arc::clone(&self.gpu),
            &request,
        )?))
    }
}

fn unavailable(error: &dyn std::fmt::Display) -> PictureError {
    PictureError::Unavailable(error.to_string())
}

impl WallPicture {
    /// Opens cache and surfaces for a host.
    fn open(gpu: Arc<Gpu>, request: &PictureRequest<'_>) -> Result<Self, PictureError> {
        let wall = request.wall.clone();
        let Some(host) = wall.hosts.get(request.host) else {
            return Err(PictureError::Unavailable(format!(
                "the wall has no host {}",
                request.host
            )));
        };
        let threads = std::thread::available_parallelism()
            .map_or(2, usize::from)
            .clamp(2, 8);
        let cache = TileCache::open(&CacheConfig {
            ram_bytes: wall.cache.ram_mib * MIB,
            disk_bytes: wall.cache.disk_mib * MIB,
            disk_directory: cache_directory(&wall),
            threads,
        })
        .map_err(|error| unavailable(&error))?;
        let budget = RenderBudget {
            gpu_bytes: wall.cache.gpu_mib * MIB,
            upload: Duration::from_secs_f64(UPLOAD_SHARE / wall.fps),
            // Who starts several nodes on a machine gives each one thread of the software driver.
            shared: std::env::var("LP_NUM_THREADS").is_ok_and(|threads| threads == "1"),
        };
        let plans = output_plans(host);
        let renderer = Renderer::new(gpu, Arc::new(cache), &plans, budget)
            .map_err(|error| unavailable(&error))?;
        let mut surfaces = Vec::new();
        for (index, window) in request.windows.iter().enumerate() {
            if let (Some(window), Some(plan)) = (window, plans.get(index)) {
                let size = window.inner_size();
                let size = [size.width, size.height];
                let surface =
                    WindowSurface::new(&renderer, Arc::clone(window), index, &plan.name, size);
                surfaces.push(surface.map_err(|error| unavailable(&error))?);
            }
        }
        Ok(Self {
            wall,
            renderer,
            surfaces,
            scenes: KnownScenes::default(),
            camera_sun: DVec3::X,
            elevation: Vec::new(),
        })
    }

    fn view_point(&self, view: &View) -> ViewPoint {
        let pose = &view.pose;
        let room = DMat3::from_cols(
            DVec3::from(pose.right),
            DVec3::from(pose.up),
            DVec3::from(pose.back),
        );
        let position = DVec3::from(pose.position_m);
        // The pose is that of the first observer's resting head; every head moves relative to it.
        let rest = self
            .wall
            .observers
            .first()
            .map_or(DVec3::ZERO, |first| DVec3::from(first.head_m));
        let head = |screen: &Screen| {
            let resting = self
                .wall
                .observers
                .get(screen.observer)
                .map_or([0.0; 3], |o| o.head_m);
            DVec3::from(
                view.heads_m
                    .get(screen.observer)
                    .copied()
                    .unwrap_or(resting),
            )
        };
        ViewPoint {
            eyes: self
                .wall
                .screens
                .iter()
                .map(|s| position + room * (head(s) - rest))
                .collect(),
            room,
            screens: self
                .wall
                .screens
                .iter()
                .map(|s| planar(s, head(s).to_array()))
                .collect(),
            pixels_per_radian: self.wall.pixels_per_radian_from(&view.heads_m),
        }
    }
}

/// The wall's cache directory, else the user's; none where the user has no home.
fn cache_directory(wall: &Wall) -> Option<PathBuf> {
    let of_variable = |name: &str| {
        std::env::var_os(name)
            .filter(|value| !value.is_empty())
            .map(PathBuf::from)
    };
    let of_user = || {
        of_variable("XDG_CACHE_HOME")
            .or_else(|| of_variable("HOME").map(|home| home.join(".cache")))
    };
    let named = wall.cache.directory.as_ref().map(PathBuf::from);
    named.or_else(|| of_user().map(|caches| caches.join("terrawall")))
}

fn output_plans(host: &Host) -> Vec<OutputPlan> {
    let outputs = host.outputs.iter();
    outputs
        .map(|output| OutputPlan {
            name: output.name.clone(),
            size_px: output.size_px,
            channels: output
                .channels
                .iter()
                .map(|channel| ChannelPlan {
                    screen: channel.screen,
                    canvas_px: PixelRect {
                        x: channel.canvas_px.x,
                        y: channel.canvas_px.y,
                        width: channel.canvas_px.width,
                        height: channel.canvas_px.height,
                    },
                    output_px: channel.output_px,
                })
                .collect(),
        })
        .collect()
}

/// The screen from a head. A head behind the screen, which only a tracker can report, sees a screen of
/// no size: nothing is drawn for it.
fn planar(screen: &Screen, head_m: [f64; 3]) -> PlanarScreen {
    screen.eye_to_screen(head_m).map_or(
        PlanarScreen {
            lower_left_m: DVec3::NEG_Z,
            right: DVec3::X,
            up: DVec3::Y,
            size_m: [1.0, 1.0],
            size_px: [0, 0],
        },
        |seen| PlanarScreen {
            lower_left_m: DVec3::from(seen.lower_left_m),
            right: DVec3::from(seen.right),
            up: DVec3::from(seen.up),
            size_m: [seen.width_m, seen.height_m],
            size_px: screen.size_px,
        },
    )
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
        self.renderer
            .open_ahead(&scene_data(scene, self.camera_sun))
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
        self.renderer
            .prepare_scene(self.scenes.next_number(), data)
            .map_err(|error| PictureError::Scene(error.to_string()))?;
        self.scenes.taken(revision, sun);
        self.elevation = elevation_of(scene);
        Ok(())
    }

    fn draw(&mut self, view: &View) -> Result<Drawn, PictureError> {
        let Some(known) = self.scenes.of_revision(view.scene_revision) else {
            return Err(PictureError::Frame(format!(
                "frame {} shows revision {} of the scene, which was not prepared",
                view.frame, view.scene_revision
            )));
        };
        let view_point = self.view_point(view);
        // First: the sun is the shown scene's, and this view's on every node.
        self.renderer
            .show(known.number)
            .map_err(|error| frame_error(&error))?;
        self.camera_sun = sun_of_camera(&view.pose);
        if known.sun == Sun::Camera {
            self.renderer.set_sun(self.camera_sun);
        }
        let statistics = self
            .renderer
            .draw_shown(&view_point, known.number)
            .map_err(|error| frame_error(&error))?;
        self.scenes.drawn(known);
        if statistics.redrawn {
            for surface in &mut self.surfaces {
                surface
                    .prepare(self.renderer.gpu())
                    .map_err(|error| frame_error(&error))?;
            }
        }
        Ok(Drawn {
            redrawn: statistics.redrawn,
            converged: statistics.converged,
            pending_tiles: statistics.pending_tiles,
            triangles: statistics.triangles,
            refined_leaves: if statistics.redrawn {
                statistics.refined_leaves
            } else {
                0
            },
            achieved_tau_px: statistics.achieved_tau_px,
        })
    }

    fn prepare_ahead(&mut self, at_most: Duration) -> Result<Option<u64>, PictureError> {
        let statistics = self
            .renderer
            .prepare_ahead(Instant::now() + at_most)
            .map_err(|error| frame_error(&error))?;
        Ok(self.scenes.preparing(statistics.prepared))
    }

    fn ground_under(&self, output: usize, pixel: [f64; 2]) -> Option<[f64; 2]> {
        self.renderer.ground_under(output, pixel)
    }

    fn present(&mut self) -> Result<(), PictureError> {
        for surface in &mut self.surfaces {
            surface.present(self.renderer.gpu());
        }
        Ok(())
    }

    fn capture(&mut self) -> Result<Vec<OutputImage>, PictureError> {
        let pictures = self
            .renderer
            .read_pictures()
            .map_err(|error| frame_error(&error))?;
        let images = pictures.into_iter().map(|(output, picture)| OutputImage {
            output,
            width: picture.width,
            height: picture.height,
            rgba: picture.rgba,
        });
        Ok(images.collect())
    }

    fn measure_error(&mut self) -> Result<ErrorMeasure, PictureError> {
        let measure = self
            .renderer
            .measure_error()
            .map_err(|error| frame_error(&error))?;
        comparable(measure)
    }

    fn minimum_triangles(&mut self) -> Result<u64, PictureError> {
        self.renderer
            .minimum_triangles()
            .map_err(|error| frame_error(&error))
    }

    fn time_passes(&mut self, on: bool) {
        self.renderer.time_passes(on);
    }

    fn take_pass_times(&mut self) -> Vec<PassTime> {
        self.renderer.take_pass_times()
    }

    fn ground_height_m(&self, latitude_deg: f64, longitude_deg: f64) -> Result<f64, PictureError> {
        self.renderer
            .ground_height_m(latitude_deg, longitude_deg)
            .map_err(|error| frame_error(&error))
    }

    fn finest_tiles(&self, most: usize) -> Result<Vec<u64>, PictureError> {
        let cache = self.renderer.cache();
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
        let counters = self.renderer.cache().counters();
        TileCounters {
            distinct: counters.distinct,
            repository_reads: counters.repository_reads,
            disk_hits: counters.disk_hits,
            ram_hits: counters.ram_hits,
            corrupt: counters.corrupt,
        }
    }

    fn take_new_tiles(&mut self, most: usize) -> Vec<u64> {
        self.renderer.take_new_tiles(most)
    }
}
