//! Pictures of a made-up planet: tiled equals single, what does not change is not drawn, and small
//! budgets still converge. Needs a device, as in `device_tests`.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use geodesy::{Ellipsoid, LatticePoint, Tile};
use glam::{DMat3, DVec3};
use tiles::{
    CacheConfig, Dataset, Index, Kind, Repository, SampleType, Samples, TileCache, TileData,
    Validity,
};

use crate::canvas::{ChannelPlan, OutputPlan, PixelRect, PlanarScreen};
use crate::device_tests::device;
use crate::renderer::{FrameStatistics, RenderBudget, Renderer, ViewPoint};
use crate::scene::{Air, Light, SceneData};
use crate::target::Picture;

const CANVAS: [u32; 2] = [320, 180];

/// Heights and colours that any node of any level can be asked for.
fn tile_data(tile: Tile, kind: Kind) -> TileData {
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
fn repository(kind: Kind) -> (tempfile::TempDir, PathBuf) {
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

struct Planet {
    gpu: Arc<crate::gpu::Gpu>,
    elevation: (tempfile::TempDir, PathBuf),
    imagery: (tempfile::TempDir, PathBuf),
}

impl Planet {
    fn new() -> Option<Self> {
        Some(Self {
            gpu: Arc::new(device()?),
            elevation: repository(Kind::Elevation),
            imagery: repository(Kind::Imagery),
        })
    }

    fn renderer(&self, outputs: &[OutputPlan], gpu_bytes: u64) -> Renderer {
        let config = CacheConfig {
            ram_bytes: 256 << 20,
            disk_bytes: 0,
            disk_directory: None,
            threads: 2,
        };
        let cache = Arc::new(TileCache::open(&config).unwrap());
        let budget = RenderBudget {
            gpu_bytes,
            upload: Duration::from_millis(5),
        };
        let mut renderer = Renderer::new(Arc::clone(&self.gpu), cache, outputs, budget).unwrap();
        let scene = SceneData {
            ellipsoid: Ellipsoid::EARTH,
            elevation: Some(("heights".to_owned(), self.elevation.1.clone())),
            imagery: Some(("colours".to_owned(), self.imagery.1.clone())),
            light: Light {
                sun: DVec3::new(0.8, 0.3, 0.5).normalize(),
                ambient: 0.1,
                relief: 2.0,
            },
            air: Air {
                thickness_m: 10_000.0,
                colour: [0.5, 0.7, 1.0],
            },
            refinement: 3,
            tile_px: 100.0,
            deepest_level: 8,
        };
        renderer.set_scene(scene).unwrap();
        renderer
    }
}

fn output(rect: PixelRect) -> OutputPlan {
    OutputPlan {
        name: format!("{},{}", rect.x, rect.y),
        size_px: [rect.width, rect.height],
        channels: vec![ChannelPlan {
            screen: 0,
            canvas_px: rect,
            output_px: [0, 0],
        }],
    }
}

fn view(latitude_deg: f64, longitude_deg: f64, altitude_m: f64, pitch_deg: f64) -> ViewPoint {
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
        screens: vec![screen],
        pixels_per_radian: 400.0,
    }
}

fn views() -> [ViewPoint; 5] {
    [
        view(20.0, 10.0, 1.2e7, -90.0),
        view(-5.0, 44.0, 4e5, -12.0),
        view(46.0, 46.0, 12_000.0, -15.0),
        view(90.0, 0.0, 8e5, -90.0),
        view(45.0, 0.5, 7000.0, -1.0),
    ]
}

fn settle(renderer: &mut Renderer, view: &ViewPoint) -> FrameStatistics {
    let start = Instant::now();
    loop {
        let statistics = renderer.draw(view).unwrap();
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

fn picture(renderer: &Renderer) -> Picture {
    renderer.read_pictures().unwrap().remove(0).1
}

#[test]
fn tiled_pictures_equal_the_single_one_bit_for_bit() {
    let Some(planet) = Planet::new() else { return };
    let whole = PixelRect {
        x: 0,
        y: 0,
        width: CANVAS[0],
        height: CANVAS[1],
    };
    let mut single = planet.renderer(&[output(whole)], 64 << 20);
    // Odd sizes and places, so that nothing falls on convenient borders.
    let parts = [
        (0, 0, 101, 77),
        (101, 0, 219, 77),
        (0, 77, 37, 103),
        (37, 77, 283, 103),
    ]
    .map(|(x, y, width, height)| PixelRect {
        x,
        y,
        width,
        height,
    });
    let mut tiled = parts.map(|part| planet.renderer(&[output(part)], 64 << 20));
    for view in views() {
        settle(&mut single, &view);
        let whole = picture(&single);
        let shades: std::collections::HashSet<&[u8]> = whole.rgba.chunks(4).collect();
        assert!(shades.len() > 100, "the picture shows something");
        for (renderer, part) in tiled.iter_mut().zip(parts) {
            settle(renderer, &view);
            let piece = picture(renderer);
            for (row, line) in piece.rgba.chunks((part.width * 4) as usize).enumerate() {
                let first = ((part.y as usize + row) * CANVAS[0] as usize + part.x as usize) * 4;
                let expected = &whole.rgba[first..first + line.len()];
                assert!(
                    line == expected,
                    "row {row} of the part at {},{} differs",
                    part.x,
                    part.y
                );
            }
        }
    }
}

#[test]
fn a_node_with_several_channels_composes_them() {
    let Some(planet) = Planet::new() else { return };
    let whole = PixelRect {
        x: 0,
        y: 0,
        width: CANVAS[0],
        height: CANVAS[1],
    };
    let mut single = planet.renderer(&[output(whole)], 64 << 20);
    let left = PixelRect {
        x: 0,
        y: 0,
        width: 100,
        height: 180,
    };
    let right = PixelRect {
        x: 220,
        y: 0,
        width: 100,
        height: 180,
    };
    let two = OutputPlan {
        name: "two".to_owned(),
        size_px: [200, 180],
        channels: vec![
            ChannelPlan {
                screen: 0,
                canvas_px: right,
                output_px: [0, 0],
            },
            ChannelPlan {
                screen: 0,
                canvas_px: left,
                output_px: [100, 0],
            },
        ],
    };
    let mut swapped = planet.renderer(&[two], 64 << 20);
    let view = &views()[0];
    settle(&mut single, view);
    settle(&mut swapped, view);
    let (whole, swapped) = (picture(&single), picture(&swapped));
    for row in 0..180 {
        let line = &whole.rgba[row * 1280..(row + 1) * 1280];
        let made = &swapped.rgba[row * 800..(row + 1) * 800];
        assert_eq!(&made[..400], &line[880..]);
        assert_eq!(&made[400..], &line[..400]);
    }
}

#[test]
fn two_eyes_share_tiles_without_sharing_seams() {
    let Some(planet) = Planet::new() else { return };
    let [width, height] = CANVAS;
    let rect = PixelRect {
        x: 0,
        y: 0,
        width,
        height,
    };
    let channel = |screen: usize| ChannelPlan {
        screen,
        canvas_px: rect,
        output_px: [0, screen as u32 * height],
    };
    let both = OutputPlan {
        name: "both".to_owned(),
        size_px: [width, 2 * height],
        channels: vec![channel(0), channel(1)],
    };
    // The same place from near and far: the same tiles beside neighbours of other levels.
    let (far, near) = (view(46.0, 46.0, 3e6, -60.0), view(46.0, 46.0, 9e5, -60.0));
    let pair = ViewPoint {
        eyes: vec![far.eyes[0], near.eyes[0]],
        screens: vec![far.screens[0], near.screens[0]],
        ..far.clone()
    };
    let mut together = planet.renderer(&[both], 64 << 20);
    settle(&mut together, &pair);
    let made = picture(&together);
    let mut alone = planet.renderer(&[output(rect)], 64 << 20);
    for (half, view) in made.rgba.chunks(made.rgba.len() / 2).zip([far, near]) {
        settle(&mut alone, &view);
        assert!(
            half == picture(&alone).rgba.as_slice(),
            "one eye's picture is not its own"
        );
    }
}

#[test]
fn what_does_not_change_is_not_drawn_again() {
    let Some(planet) = Planet::new() else { return };
    let whole = PixelRect {
        x: 0,
        y: 0,
        width: CANVAS[0],
        height: CANVAS[1],
    };
    let mut renderer = planet.renderer(&[output(whole)], 64 << 20);
    let [first, second, ..] = views();
    settle(&mut renderer, &first);
    for _ in 0..5 {
        assert!(!renderer.draw(&first).unwrap().redrawn);
    }
    assert!(renderer.draw(&second).unwrap().redrawn);
    settle(&mut renderer, &second);
    assert!(!renderer.draw(&second).unwrap().redrawn);
    renderer.set_sun(DVec3::Z);
    assert!(
        renderer.draw(&second).unwrap().redrawn,
        "light is part of the picture"
    );
}

#[test]
fn the_smallest_budget_still_converges_and_then_loads_nothing() {
    let Some(planet) = Planet::new() else { return };
    let whole = PixelRect {
        x: 0,
        y: 0,
        width: CANVAS[0],
        height: CANVAS[1],
    };
    let mut renderer = planet.renderer(&[output(whole)], 0);
    // As a wall eight times as dense sees it: far more tiles than the least budget holds.
    let view = &ViewPoint {
        pixels_per_radian: 3200.0,
        ..views()[0].clone()
    };
    let settled = settle(&mut renderer, view);
    let px = settled.achieved_tile_px;
    assert!(px > 100.0, "quality drops and says so: split at {px} px");
    assert!(settled.drawn_tiles <= 31, "{settled:?}");
    let before = renderer.cache().counters();
    for _ in 0..20 {
        let again = renderer.draw(view).unwrap();
        assert!(!again.redrawn && again.converged);
    }
    assert_eq!(
        before.repository_reads,
        renderer.cache().counters().repository_reads
    );
}
