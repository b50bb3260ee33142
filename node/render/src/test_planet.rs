//! A made-up planet for tests of pictures: repositories, scenes, views, and renderers that have settled.
//! In: a device. Out: what tests draw with. Nothing outside tests uses it.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use geodesy::{Ellipsoid, LatticePoint, Tile};
use glam::{DMat3, DVec3};
use tiles::{
    CacheConfig, Dataset, Directories, Index, Kind, Opener, Repository, SampleType, Samples,
    TileCache, TileData, Validity,
};

use crate::canvas::{PixelRect, PlanarScreen};
use crate::device_tests::device;
use crate::layer::{Blend, Elevation, Fusion, Imagery, LayerData, LayerParameters, Process};
use crate::outputs::{ChannelPlan, ChannelSource, OutputPlan};
use crate::renderer::{EyeView, FrameStatistics, RenderBudget, Renderer, ViewPoint};
use crate::scene::{Air, Light, Refine, SceneData};
use crate::target::Picture;

pub(crate) const CANVAS: [u32; 2] = [320, 180];

/// Heights and colours that any node of any level can be asked for.
pub(crate) fn tile_data(tile: Tile, kind: Kind) -> TileData {
    let (mut heights, mut colours) = (Vec::new(), Vec::new());
    for j in -9..266 {
        for i in -9..266 {
            let n = LatticePoint::of_tile(tile, i, j).normal();
            let hills = (n.x * 60.0).sin() * (n.y * 50.0).cos() * (n.z * 70.0).sin();
            heights.push((hills * 6000.0 * 16.0) as i32);
            let checks = (n * 12.0).floor().as_i64vec3();
            let dark = (checks.x + checks.y + checks.z) & 1 == 0;
            colours.extend_from_slice(if dark {
                &[40, 90, 160]
            } else {
                &[200, 180, 120]
            });
        }
    }
    let (channels, samples) = match kind {
        Kind::Elevation => (1, Samples::I32(heights)),
        _ => (3, Samples::U8(colours)),
    };
    TileData::new(tile, kind, channels, samples, Validity::All).unwrap()
}

/// A repository with all tiles of levels 0 and 1, and those of level 2 on two faces only, so that
/// data of different levels meet.
pub(crate) fn repository(kind: Kind) -> (tempfile::TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let root = directory.path().join("data");
    let (sample_type, channels) = if kind == Kind::Elevation {
        (SampleType::I32, 1)
    } else {
        (SampleType::U8, 3)
    };
    let mut dataset = Dataset::new("planet", kind, sample_type, channels);
    dataset.deepest_level = 2;
    let repository = Repository::create(&root, dataset).unwrap();
    let mut index = Index::new();
    let mut level: Vec<Tile> = Tile::ROOTS.to_vec();
    for depth in 0..3 {
        for tile in &level {
            if depth < 2 || tile.face().number() < 2 {
                let data = tile_data(*tile, kind);
                repository
                    .write_atomic(*tile, &data.encode().unwrap())
                    .unwrap();
                index.insert_tile(&data);
            }
        }
        level = level
            .iter()
            .flat_map(|tile| tile.children().unwrap())
            .collect();
    }
    repository.store_index(&index).unwrap();
    (directory, root)
}

pub(crate) struct Planet {
    pub(crate) gpu: Arc<crate::gpu::Gpu>,
    elevation: (tempfile::TempDir, PathBuf),
    imagery: (tempfile::TempDir, PathBuf),
}

/// A layer as a scene without any wishes has it.
pub(crate) fn plain(name: &str, repository: Option<&PathBuf>, process: Process) -> LayerData {
    LayerData {
        name: name.to_owned(),
        repository: repository.cloned(),
        parameters: LayerParameters {
            fusion: Fusion {
                priority: 0,
                weight: 1.0,
                opacity: 1.0,
                blend: Blend::Normal,
            },
            process,
        },
    }
}

pub(crate) const HEIGHTS: Elevation = Elevation {
    scale: 1.0,
    offset_m: 0.0,
    datum_shift_m: 0.0,
    clamp_m: [-500_000.0, 500_000.0],
};
pub(crate) const COLOURS: Imagery = Imagery {
    exposure_stops: 0.0,
    contrast: 1.0,
    saturation: 1.0,
    gamma: 1.0,
    channels: [0, 1, 2],
    range: None,
    tint: [1.0; 3],
};

impl Planet {
    pub(crate) fn layers(&self) -> Vec<LayerData> {
        vec![
            plain("colours", Some(&self.imagery.1), Process::Imagery(COLOURS)),
            plain(
                "heights",
                Some(&self.elevation.1),
                Process::Elevation(HEIGHTS),
            ),
        ]
    }

    pub(crate) fn new() -> Option<Self> {
        Some(Self {
            gpu: Arc::new(device()?),
            elevation: repository(Kind::Elevation),
            imagery: repository(Kind::Imagery),
        })
    }

    pub(crate) fn renderer(&self, outputs: &[OutputPlan], gpu_bytes: u64) -> Renderer {
        self.renderer_with(outputs, gpu_bytes, Arc::new(Directories))
    }

    /// The same with data from wherever `opener` finds them.
    pub(crate) fn renderer_with(
        &self,
        outputs: &[OutputPlan],
        gpu_bytes: u64,
        opener: Arc<dyn Opener>,
    ) -> Renderer {
        let config = CacheConfig {
            ram_bytes: 256 << 20,
            disk_bytes: 0,
            disk_directory: None,
            lease: Duration::from_secs(5),
            requests: 2,
            decoders: 2,
        };
        let cache = Arc::new(TileCache::open_with(&config, opener).unwrap());
        let budget = RenderBudget {
            gpu_bytes,
            upload: Duration::from_millis(5),
            shared: false,
        };
        let mut renderer = Renderer::new(Arc::clone(&self.gpu), cache, outputs, budget).unwrap();
        renderer.prepare_scene(1, self.scene()).unwrap();
        renderer
    }

    /// Heights and colours as they are.
    pub(crate) fn scene(&self) -> SceneData {
        SceneData {
            ellipsoid: Ellipsoid::EARTH,
            layers: self.layers(),
            lenses: Vec::new(),
            light: Light {
                sun: DVec3::new(0.8, 0.3, 0.5).normalize(),
                ambient: 0.1,
                relief: 2.0,
            },
            air: Air {
                thickness_m: 10_000.0,
                colour: [0.5, 0.7, 1.0],
            },
            refine: Refine::TopDown,
            tau_px: 1.0,
            wireframe: false,
            refinement: 3,
            tile_px: 100.0,
            deepest_level: 8,
        }
    }
}

/// An output without any channel.
pub(crate) fn empty_output(name: &str, size_px: [u32; 2]) -> OutputPlan {
    OutputPlan {
        name: name.to_owned(),
        size_px,
        stereo: None,
        gamma: None,
        channels: Vec::new(),
    }
}

/// A part of a view, at a place of its output.
pub(crate) fn channel(view: usize, part: PixelRect, [x, y]: [u32; 2]) -> ChannelPlan {
    ChannelPlan {
        picture: 0,
        output_px: PixelRect { x, y, ..part },
        source: ChannelSource::Canvas {
            view,
            origin_px: [part.x, part.y],
        },
        light: None,
    }
}

/// An output that shows a part of the first view.
pub(crate) fn output(rect: PixelRect) -> OutputPlan {
    OutputPlan {
        channels: vec![channel(0, rect, [0, 0])],
        ..empty_output(&format!("{},{}", rect.x, rect.y), [rect.width, rect.height])
    }
}

pub(crate) fn view(
    latitude_deg: f64,
    longitude_deg: f64,
    altitude_m: f64,
    pitch_deg: f64,
) -> ViewPoint {
    let normal = Ellipsoid::normal(latitude_deg, longitude_deg);
    let [east, north, up] = Ellipsoid::east_north_up(normal);
    let (sine, cosine) = pitch_deg.to_radians().sin_cos();
    let forward = north * cosine + up * sine;
    let screen = PlanarScreen {
        lower_left_m: DVec3::new(-2.0, -1.125, -3.0),
        right: DVec3::X,
        up: DVec3::Y,
        size_m: [4.0, 2.25],
        size_px: CANVAS,
    };
    ViewPoint {
        eyes: vec![Ellipsoid::EARTH.point(normal, altitude_m)],
        room: DMat3::from_cols(east, east.cross(forward), -forward),
        views: vec![EyeView { eye: 0, screen }],
        warps: Vec::new(),
        pixels_per_radian: 400.0,
    }
}

pub(crate) fn views() -> [ViewPoint; 5] {
    [
        view(20.0, 10.0, 1.2e7, -90.0),
        view(-5.0, 44.0, 4e5, -12.0),
        view(46.0, 46.0, 12_000.0, -15.0),
        view(90.0, 0.0, 8e5, -90.0),
        view(45.0, 0.5, 7000.0, -1.0),
    ]
}

/// Draws scene 1 until nothing is missing.
pub(crate) fn settle(renderer: &mut Renderer, view: &ViewPoint) -> FrameStatistics {
    settle_on(renderer, view, 1)
}

/// Draws a scene until nothing is missing.
pub(crate) fn settle_on(
    renderer: &mut Renderer,
    view: &ViewPoint,
    revision: u64,
) -> FrameStatistics {
    let start = Instant::now();
    loop {
        let statistics = renderer.draw(view, revision).unwrap();
        if statistics.converged {
            return statistics;
        }
        assert!(
            start.elapsed() < Duration::from_secs(60),
            "never converged: {statistics:?}"
        );
        std::thread::sleep(Duration::from_millis(2));
    }
}

pub(crate) fn picture(renderer: &Renderer) -> Picture {
    renderer.read_pictures().unwrap().remove(0).1
}
