//! `terrawall bench frame`: what a frame of 1280×720 with elevation and imagery costs on the local adapter.
//!
//! In: the imported data. Out: milliseconds of moving frames over the globe and at 500 km, whether a still frame is
//! drawn at all, how long a cold start takes to converge, and what warping adds on a curved screen. No network takes
//! part.

mod warped;

use std::path::Path;
use std::time::{Duration, Instant};

use node::{Picture, PictureRequest, WallPictureMaker};
use protocol::message::ErrorMeasured;
use protocol::report::ErrorReport;
use protocol::wall::Viewers;
use protocol::{Camera, Orbit, Place, Scene, View, Wall};
use serde::Serialize;

use crate::args::BenchFrame;
use crate::failure::Failure;
use crate::plot::{Plot, Series};
use crate::{interrupt, output};
use warped::WarpFigures;

/// A picture that has not converged by then never will.
const PATIENCE: Duration = Duration::from_secs(60);

/// One display of 1280×720.
const WALL: &str = "\
[wall]
name = \"bench\"
fps = 60

[[observers]]
name = \"viewer\"
head_m = [0.0, 1.5, 1.2]

[[screens]]
name = \"front\"
kind = \"planar\"
observer = \"viewer\"
corners_m = { bottom_left = [-0.8, 1.05, 0.0], bottom_right = [0.8, 1.05, 0.0], top_left = [-0.8, 1.95, 0.0] }
size_px = [1280, 720]

[[hosts]]
name = \"here\"
[[hosts.outputs]]
name = \"out\"
size_px = [1280, 720]
headless = true
channels = [{ screen = \"front\", canvas_px = [0, 0, 1280, 720] }]
";

/// What was measured.
#[derive(Debug, Serialize)]
pub(crate) struct Figures {
    adapter: String,
    /// From opening the adapter to a converged globe, nothing being cached, in milliseconds.
    cold_start_ms: f64,
    views: Vec<ViewFigures>,
    warp: WarpFigures,
    /// Of the last picture of each view.
    error_px: ErrorReport,
}

/// One moving view.
#[derive(Debug, Serialize)]
struct ViewFigures {
    name: String,
    p50_ms: f64,
    p99_ms: f64,
    triangles: u64,
    /// Frames that were drawn although nothing had changed, of as many still frames.
    still_frames_redrawn: u32,
    frames_ms: Vec<f64>,
}

/// Runs the bench and prints its table.
pub(crate) fn run(args: &BenchFrame) -> Result<(), Failure> {
    let figures = measure(&args.data, args.frames)?;
    if let Some(report) = &args.report {
        output::json_file(report, &figures)?;
    }
    if args.json {
        output::json(&figures)
    } else {
        print(&figures)
    }
}

/// Prints figures as a table.
pub(crate) fn print(figures: &Figures) -> Result<(), Failure> {
    let rows: Vec<Vec<String>> = figures
        .views
        .iter()
        .map(|view| {
            vec![
                view.name.clone(),
                format!("{:.1}", view.p50_ms),
                format!("{:.1}", view.p99_ms),
                view.triangles.to_string(),
                view.still_frames_redrawn.to_string(),
            ]
        })
        .collect();
    output::table(
        &[
            "moving view",
            "p50 ms",
            "p99 ms",
            "triangles",
            "redrawn when still",
        ],
        &rows,
    )?;
    let error = &figures.error_px;
    output::line(format!(
        "the surface is off by at most {:.3} pixels in {} pictures (τ = {})",
        error.measured_max.unwrap_or(f64::NAN),
        error.views,
        error.tau
    ))?;
    output::line(figures.warp.line())?;
    output::line(format!(
        "cold start to a converged globe: {:.0} ms ({})",
        figures.cold_start_ms, figures.adapter
    ))
}

/// Frame times over frames.
pub(crate) fn plot(figures: &Figures) -> Plot {
    let line = |view: &ViewFigures| Series {
        name: view.name.clone(),
        points: view
            .frames_ms
            .iter()
            .enumerate()
            .map(|(index, ms)| (index as f64, *ms))
            .collect(),
    };
    Plot {
        title: format!("Frames of 1280×720 on {}", figures.adapter),
        x_label: "frame".to_owned(),
        y_label: "ms".to_owned(),
        series: figures.views.iter().map(line).collect(),
    }
}

/// Measures `frames` moving and as many still frames of each view.
pub(crate) fn measure(data: &Path, frames: u32) -> Result<Figures, Failure> {
    let scene = scene(data)?;
    let start = Instant::now();
    let mut maker = WallPictureMaker::open(None)?;
    let adapter = node::PictureMaker::adapter(&maker);
    let mut bench = Bench::open(&mut maker, WALL, scene)?;
    // The rival's paths: 0.01 rad a frame around the globe, 0.003 rad at 500 km.
    let globe = orbit(20.0, 12e6, 0.01);
    bench.scene.camera = globe.clone();
    bench.picture.prepare_scene(1, &bench.scene)?;
    bench.settle()?;
    let cold_start_ms = start.elapsed().as_secs_f64() * 1e3;
    let views = vec![
        bench.view("globe", globe, frames)?,
        bench.view("500 km", near(), frames)?,
    ];
    let Bench {
        scene, error_px, ..
    } = bench;
    let warp = warped::measure(&mut maker, scene, frames)?;
    Ok(Figures {
        adapter,
        cold_start_ms,
        views,
        warp,
        error_px,
    })
}

struct Bench {
    picture: Box<dyn Picture>,
    viewers: Viewers,
    scene: Scene,
    frame: u64,
    error_px: ErrorReport,
    _cache: tempfile::TempDir,
}

impl Bench {
    /// A wall on an open device, with nothing in memory or on disk: a cold start has no cache, not even one that an
    /// earlier run left.
    fn open(maker: &mut WallPictureMaker, wall: &str, scene: Scene) -> Result<Self, Failure> {
        let mut wall = Wall::parse(wall, "the wall of the bench")?;
        let cache = tempfile::tempdir().map_err(Failure::failed)?;
        wall.cache.directory = Some(cache.path().to_string_lossy().into_owned());
        let request = PictureRequest {
            wall: &wall,
            host: 0,
            windows: vec![None],
        };
        Ok(Self {
            picture: node::PictureMaker::make(maker, request)?,
            viewers: node::viewers(&wall)?,
            error_px: ErrorReport::new(scene.mesh.tau),
            scene,
            frame: 0,
            _cache: cache,
        })
    }

    /// Draws the camera's pose after so many frames.
    fn draw(&mut self, camera_frame: u32) -> Result<node::Drawn, Failure> {
        self.frame += 1;
        let view = View {
            epoch: 0,
            frame: self.frame,
            scene_revision: 1,
            sent_us: 0,
            pose: self
                .scene
                .camera
                .pose(&self.scene.planet, f64::from(camera_frame)),
            wall_revision: 0,
            viewers: self.viewers.clone(),
            settle: false,
            previous_swap: None,
        };
        if interrupt::requested() {
            return Err(Failure::failed("interrupted"));
        }
        Ok(self.picture.draw(&view)?)
    }

    /// Draws the first pose until nothing is missing.
    fn settle(&mut self) -> Result<(), Failure> {
        let deadline = Instant::now() + PATIENCE;
        while !self.draw(0)?.converged {
            if Instant::now() > deadline {
                return Err(Failure::failed(format!(
                    "the picture did not converge within {PATIENCE:?}"
                )));
            }
        }
        Ok(())
    }

    /// Measures one camera: still frames, then moving ones.
    fn view(&mut self, name: &str, camera: Camera, frames: u32) -> Result<ViewFigures, Failure> {
        self.scene.camera = camera;
        self.settle()?;
        let mut redrawn = 0;
        for _ in 0..frames {
            redrawn += u32::from(self.draw(0)?.redrawn);
        }
        let mut frames_ms = Vec::new();
        let mut triangles = 0;
        for frame in 1..=frames {
            let start = Instant::now();
            let drawn = self.draw(frame)?;
            frames_ms.push(start.elapsed().as_secs_f64() * 1e3);
            triangles = triangles.max(drawn.triangles);
        }
        let measure = self.picture.measure_error()?;
        self.error_px.add(&ErrorMeasured {
            max_px: measure.max_px,
            samples: measure.samples,
            uncovered: measure.uncovered,
            tau_px: measure.tau_px,
        });
        Ok(ViewFigures {
            name: name.to_owned(),
            p50_ms: quantile(&frames_ms, 0.5),
            p99_ms: quantile(&frames_ms, 0.99),
            triangles,
            still_frames_redrawn: redrawn,
            frames_ms,
        })
    }
}

/// The value that a share of the values does not exceed.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let index = ((sorted.len() as f64 * share).ceil() as usize).max(1) - 1;
    sorted.get(index).copied().unwrap_or(f64::NAN)
}

/// The rival's path at 500 km.
fn near() -> Camera {
    orbit(45.0, 500e3, 0.003)
}

/// Straight down from a height, around the Earth's axis, a second of camera time being a frame.
fn orbit(latitude_deg: f64, altitude_m: f64, radians_per_frame: f64) -> Camera {
    Camera::Orbit(Orbit {
        place: Place {
            latitude_deg,
            longitude_deg: 6.0,
            altitude_m,
            heading_deg: 0.0,
            pitch_deg: -90.0,
            roll_deg: 0.0,
        },
        centre_latitude_deg: 90.0,
        centre_longitude_deg: 0.0,
        degrees_per_second: radians_per_frame.to_degrees(),
    })
}

/// The imported data as a scene.
fn scene(data: &Path) -> Result<Scene, Failure> {
    for name in ["elevation", "imagery"] {
        if !data.join(name).is_dir() {
            return Err(Failure::configuration(format!(
                "{} is not there: run make data, or name the folder that holds elevation/ and imagery/ with --data",
                data.join(name).display()
            )));
        }
    }
    let text = "\
[camera]
mode = \"fixed\"
place = { latitude_deg = 0, longitude_deg = 0, altitude_m = 1e7, pitch_deg = -90 }

[layers.relief]
kind = \"elevation\"
repository = \"elevation\"

[layers.colour]
kind = \"imagery\"
repository = \"imagery\"
";
    Ok(Scene::parse(text, "the scene of the bench")?.resolve(&std::path::absolute(data)?)?)
}
