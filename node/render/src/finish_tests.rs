//! Outputs are finished as geometry and light say: warps against directions that are computed here, blending and stereo
//! against the same formulas in 64 bits.
#![allow(
    clippy::unwrap_used,
    clippy::indexing_slicing,
    reason = "a test that panics has failed"
)]

use std::sync::Arc;

use glam::{DMat3, DVec3};
use wgpu::util::{DeviceExt as _, TextureDataOrder};

use crate::canvas::{PixelRect, PlanarScreen};
use crate::device_tests::device;
use crate::finish::Finisher;
use crate::gpu::Gpu;
use crate::outputs::{
    ChannelPlan, ChannelSource, LightMap, OutputPlan, StereoMode, StereoPlan, Uplift, WarpMap,
    WarpPart,
};
use crate::recorder::Recorder;
use crate::renderer::{EyeView, PlannedBlock, ViewPoint};
use crate::target::{COLOUR, ColourTarget, LIGHT, OutputTarget, Picture};
use crate::test_planet::empty_output;

/// IEC 61966-2-1.
fn to_light(value: f64) -> f64 {
    if value <= 0.04045 {
        value / 12.92
    } else {
        ((value + 0.055) / 1.055).powf(2.4)
    }
}

fn to_value(light: f64) -> f64 {
    let light = light.clamp(0.0, 1.0);
    if light <= 0.003_130_8 {
        light * 12.92
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    }
}

fn code(value: f64) -> u8 {
    (value * 255.0).round() as u8
}

/// A picture on the device, as if a block had been drawn.
fn drawn(gpu: &Gpu, size: [u32; 2], colour: impl Fn(u32, u32) -> [u8; 3]) -> ColourTarget {
    let mut bytes = Vec::new();
    for y in 0..size[1] {
        for x in 0..size[0] {
            let [red, green, blue] = colour(x, y);
            bytes.extend([red, green, blue, 255]);
        }
    }
    let descriptor = wgpu::TextureDescriptor {
        label: Some("drawn"),
        size: wgpu::Extent3d {
            width: size[0],
            height: size[1],
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: COLOUR,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[LIGHT],
    };
    let order = TextureDataOrder::LayerMajor;
    let texture = gpu
        .device
        .create_texture_with_data(&gpu.queue, &descriptor, order, &bytes);
    let light = wgpu::TextureViewDescriptor {
        format: Some(LIGHT),
        ..wgpu::TextureViewDescriptor::default()
    };
    ColourTarget {
        view: texture.create_view(&wgpu::TextureViewDescriptor::default()),
        light_view: texture.create_view(&light),
        texture,
    }
}

/// Finishes one output from the pictures drawn for its channels, one each.
fn finished(gpu: &Gpu, plan: &OutputPlan, view: &ViewPoint, pictures: &[ColourTarget]) -> Picture {
    let blocks: Vec<PlannedBlock> = plan
        .channels
        .iter()
        .enumerate()
        .map(|(channel, planned)| {
            let (seen, part) = match &planned.source {
                ChannelSource::Canvas { view, .. } => (*view, None),
                ChannelSource::Warped { warp, .. } => (view.warps[*warp][0].view, Some(0)),
            };
            PlannedBlock {
                output: 0,
                channel,
                part,
                eye: 0,
                block: view.views[seen].screen.whole(view.room).unwrap(),
            }
        })
        .collect();
    let mut finisher = Finisher::new(gpu, std::slice::from_ref(plan)).unwrap();
    let size = [pictures[0].texture.width(), pictures[0].texture.height()];
    finisher.prepare(gpu, &[plan], view, &blocks, &|_| size);
    let target = OutputTarget::new(gpu, plan).unwrap();
    let mut untimed = None;
    let mut recorder = Recorder::new(gpu, &mut untimed);
    for (number, (block, picture)) in blocks.iter().zip(pictures).enumerate() {
        let channel = &plan.channels[block.channel];
        finisher
            .finish_block(
                gpu,
                &mut recorder,
                (number, block),
                (channel, view),
                picture,
                &target,
            )
            .unwrap();
    }
    finisher
        .finish_output(gpu, &mut recorder, 0, plan, &target)
        .unwrap();
    recorder.finish().unwrap();
    target.read(gpu, "test").unwrap()
}

fn rect([width, height]: [u32; 2]) -> PixelRect {
    PixelRect {
        x: 0,
        y: 0,
        width,
        height,
    }
}

/// A view of one plane, which channels show pixel for pixel.
fn flat(size_px: [u32; 2]) -> ViewPoint {
    let screen = PlanarScreen {
        lower_left_m: DVec3::new(-1.0, -1.0, -2.0),
        right: DVec3::X,
        up: DVec3::Y,
        size_m: [2.0, 2.0],
        size_px,
    };
    ViewPoint {
        eyes: vec![DVec3::ZERO],
        room: DMat3::IDENTITY,
        views: vec![EyeView { eye: 0, screen }],
        warps: Vec::new(),
        pixels_per_radian: 100.0,
    }
}

struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        low + (high - low) * ((self.0 >> 33) as f64 / f64::from(1_u32 << 31))
    }
}

const OUTPUT: [u32; 2] = [160, 128];
const DRAWN: [u32; 2] = [512, 448];

/// A part of a cylinder of 2.5 m around the room's y axis: 80° wide, 2.6 m high.
fn on_cylinder(x: f64, y: f64) -> DVec3 {
    let azimuth = (x / f64::from(OUTPUT[0]) * 80.0 - 40.0).to_radians();
    let height_m = (1.0 - y / f64::from(OUTPUT[1])) * 2.6;
    DVec3::new(2.5 * azimuth.sin(), height_m, -2.5 * azimuth.cos())
}

/// The view of an eye that just covers it, on a plane at 1 m that is turned a little.
fn covering(eye_m: DVec3, turn: DMat3) -> PlanarScreen {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for y in 0..=OUTPUT[1] {
        for x in 0..=OUTPUT[0] {
            let along = turn.transpose() * (on_cylinder(f64::from(x), f64::from(y)) - eye_m);
            let place = [along.x / -along.z, along.y / -along.z];
            for axis in 0..2 {
                low[axis] = low[axis].min(place[axis] - 0.01);
                high[axis] = high[axis].max(place[axis] + 0.01);
            }
        }
    }
    PlanarScreen {
        lower_left_m: turn * DVec3::new(low[0], low[1], -1.0),
        right: turn.x_axis,
        up: turn.y_axis,
        size_m: [high[0] - low[0], high[1] - low[1]],
        size_px: DRAWN,
    }
}

/// Linear light of a scene of stripes around the room, by the direction from the eye: two components, one for each
/// axis. Triangle waves, so that light changes evenly from place to place.
fn scene(direction: DVec3) -> [f64; 2] {
    let wave = |phase: f64| {
        let share = phase - phase.floor();
        0.1 + 0.8 * (1.0 - (2.0 * share - 1.0).abs())
    };
    let level = (direction.x * direction.x + direction.z * direction.z).sqrt();
    [
        wave(direction.x.atan2(-direction.z) * 5.0),
        wave((direction.y / level).atan() * 5.0 + 0.25),
    ]
}

#[test]
fn what_is_seen_through_a_warp_is_where_geometry_says_for_a_hundred_heads() {
    let Some(gpu) = device() else { return };
    let centre = |pixel: u32| f64::from(pixel) + 0.5;
    let points_m = (0..OUTPUT[1])
        .flat_map(|y| (0..OUTPUT[0]).map(move |x| (x, y)))
        .map(|(x, y)| on_cylinder(centre(x), centre(y)).as_vec3().to_array())
        .collect();
    let map = Arc::new(WarpMap {
        size_px: OUTPUT,
        points_m,
    });
    let channel = ChannelPlan {
        picture: 0,
        output_px: rect(OUTPUT),
        source: ChannelSource::Warped { warp: 0, map },
        light: None,
    };
    let plan = OutputPlan {
        channels: vec![channel],
        ..empty_output("curved", OUTPUT)
    };
    let mut random = Random(3);
    let mut worst_px = 0.0_f64;
    for head in 0..100 {
        let eye_m = DVec3::new(
            random.between(-0.8, 0.8),
            random.between(0.6, 2.2),
            random.between(-0.6, 1.0),
        );
        let turn = DMat3::from_rotation_y(random.between(-0.2, 0.2))
            * DMat3::from_rotation_x(random.between(-0.2, 0.2));
        let screen = covering(eye_m, turn);
        let view = ViewPoint {
            views: vec![EyeView { eye: 0, screen }],
            warps: vec![vec![WarpPart {
                rect_px: rect(OUTPUT),
                view: 0,
                eye_m,
            }]],
            ..flat(DRAWN)
        };
        let picture = drawn(&gpu, DRAWN, |x, y| {
            let [a, b] = scene(screen.ray_through([centre(x), centre(y)]));
            [code(to_value(a)), code(to_value(b)), 0]
        });
        let made = finished(&gpu, &plan, &view, &[picture]);
        // How far each square of pixels lies beside its place, by least squares: one number averages out the rounding
        // to bytes.
        let step = 1e-3;
        for top in (0..OUTPUT[1]).step_by(16) {
            for left in (0..OUTPUT[0]).step_by(16) {
                for component in 0..2 {
                    let (mut beside, mut weight) = (0.0, 0.0);
                    for (x, y) in
                        (top..top + 16).flat_map(|y| (left..left + 16).map(move |x| (x, y)))
                    {
                        let seen = |dx: f64, dy: f64| {
                            let point = on_cylinder(centre(x) + dx, centre(y) + dy);
                            scene(point - eye_m)[component]
                        };
                        let slope = if component == 0 {
                            (seen(step, 0.0) - seen(-step, 0.0)) / (2.0 * step)
                        } else {
                            (seen(0.0, step) - seen(0.0, -step)) / (2.0 * step)
                        };
                        // At the tip of a wave light is no measure of place.
                        let bends =
                            (seen(1.5, 1.5) + seen(-1.5, -1.5) - 2.0 * seen(0.0, 0.0)).abs();
                        if bends > 0.2 * slope.abs() {
                            continue;
                        }
                        let index = (4 * (y * OUTPUT[0] + x)) as usize + component;
                        let found = to_light(f64::from(made.rgba[index]) / 255.0);
                        beside += (found - seen(0.0, 0.0)) * slope;
                        weight += slope * slope;
                    }
                    if weight > 1e-3 {
                        let px = (beside / weight).abs();
                        assert!(
                            px < 0.1,
                            "head {head} at {eye_m}: {px} pixels at {left}, {top}"
                        );
                        worst_px = worst_px.max(px);
                    }
                }
            }
        }
    }
    eprintln!("through the warp everything lies within {worst_px:.3} pixels of its place");
    assert!(worst_px > 0.0, "nothing was measured");
}

#[test]
fn blending_is_done_in_linear_light() {
    let Some(gpu) = device() else { return };
    let size = [16, 8];
    let colour = |x: u32, y: u32| [(x * 16) as u8, (y * 32) as u8, 200];
    let alpha: Vec<[f32; 3]> = (0..128).map(|i| [i as f32 / 127.0, 1.0, 0.25]).collect();
    let beta: Vec<[f32; 3]> = (0..128).map(|i| [0.0, 0.02, i as f32 / 1270.0]).collect();
    let below = Uplift {
        dark: 0.0,
        bright: 1.0,
    };
    for (gamma, uplift) in [
        (None, Uplift::default()),
        (Some(2.2), Uplift::default()),
        (None, below),
    ] {
        let channel = ChannelPlan {
            picture: 0,
            output_px: rect(size),
            source: ChannelSource::Canvas {
                view: 0,
                origin_px: [0, 0],
            },
            light: Some(Arc::new(LightMap {
                size_px: size,
                alpha: alpha.clone(),
                beta: beta.clone(),
                uplift,
            })),
        };
        let plan = OutputPlan {
            gamma,
            channels: vec![channel],
            ..empty_output("blended", size)
        };
        let made = finished(&gpu, &plan, &flat(size), &[drawn(&gpu, size, colour)]);
        for (index, pixel) in made.rgba.chunks(4).enumerate() {
            let (x, y) = (index as u32 % size[0], index as u32 / size[0]);
            for component in 0..3 {
                let own = to_light(f64::from(colour(x, y)[component]) / 255.0);
                let (alpha, beta) = (
                    f64::from(alpha[index][component]),
                    f64::from(beta[index][component]),
                );
                let [dark, bright] = [uplift.dark, uplift.bright].map(f64::from);
                let lifted = own * alpha * (1.0 - dark * bright * beta) + dark * beta;
                let light = lifted.max(beta);
                let due = match gamma {
                    None => to_value(light),
                    Some(gamma) => light.powf(1.0 / gamma),
                };
                let off = (due * 255.0 - f64::from(pixel[component])).abs();
                // Maps are kept in 16 bits: one part in 2048, which counts most in the dark.
                assert!(off <= 1.0, "{gamma:?} {index} {component}: {due} {pixel:?}");
            }
        }
    }
}

#[test]
fn each_eye_has_its_pixels() {
    let Some(gpu) = device() else { return };
    let size = [8_u32, 6_u32];
    let left = |x: u32, y: u32| [(x * 30) as u8, (y * 40) as u8, 10];
    let right = |x: u32, y: u32| [250 - (x * 30) as u8, (y * 20) as u8, 240];
    let channel = |picture: usize| ChannelPlan {
        picture,
        output_px: rect(size),
        source: ChannelSource::Canvas {
            view: 0,
            origin_px: [0, 0],
        },
        // Full light, so that pictures go through the pass that is tested, and not through a copy.
        light: Some(Arc::new(LightMap {
            size_px: size,
            alpha: vec![[1.0; 3]; 48],
            beta: Vec::new(),
            uplift: Uplift::default(),
        })),
    };
    let mean = |gamma: Option<f64>, a: [u8; 3], b: [u8; 3]| {
        let half = |a: u8, b: u8| {
            let values = [a, b].map(|value| f64::from(value) / 255.0);
            match gamma {
                None => code(to_value(0.5 * values.map(to_light).iter().sum::<f64>())),
                Some(gamma) => {
                    let light = 0.5 * values.map(|value| value.powf(gamma)).iter().sum::<f64>();
                    code(light.powf(1.0 / gamma))
                }
            }
        };
        [half(a[0], b[0]), half(a[1], b[1]), half(a[2], b[2])]
    };
    let modes = [
        StereoMode::SideBySide,
        StereoMode::TopBottom,
        StereoMode::Anaglyph {
            left: [true, false, false],
        },
        StereoMode::Rows,
        StereoMode::Columns,
        StereoMode::Checkerboard,
    ];
    for mode in modes {
        for (swapped, gamma) in [(false, None), (true, None), (false, Some(2.2))] {
            let plan = OutputPlan {
                gamma,
                stereo: Some(StereoPlan { mode, swapped }),
                channels: vec![channel(0), channel(1)],
                ..empty_output("both", size)
            };
            let pictures = [drawn(&gpu, size, left), drawn(&gpu, size, right)];
            let made = finished(&gpu, &plan, &flat(size), &pictures);
            let eye = |second: bool, x: u32, y: u32| {
                let drawn = if second != swapped {
                    right(x, y)
                } else {
                    left(x, y)
                };
                // An eye's own picture is in the display's values already.
                drawn.map(|value| match gamma {
                    None => value,
                    Some(gamma) => code(to_light(f64::from(value) / 255.0).powf(1.0 / gamma)),
                })
            };
            // Those values are rounded once more on the way.
            let most = if gamma.is_some() { 2 } else { 1 };
            for (index, pixel) in made.rgba.chunks(4).enumerate() {
                let (x, y) = (index as u32 % size[0], index as u32 / size[0]);
                let due = match mode {
                    StereoMode::SideBySide => {
                        let (second, x) = (x >= 4, 2 * (x % 4));
                        mean(gamma, eye(second, x, y), eye(second, x + 1, y))
                    }
                    StereoMode::TopBottom => {
                        let (second, y) = (y >= 3, 2 * (y % 3));
                        mean(gamma, eye(second, x, y), eye(second, x, y + 1))
                    }
                    StereoMode::Anaglyph { .. } => {
                        let (first, second) = (eye(false, x, y), eye(true, x, y));
                        [first[0], second[1], second[2]]
                    }
                    StereoMode::Rows => eye(y % 2 == 1, x, y),
                    StereoMode::Columns => eye(x % 2 == 1, x, y),
                    StereoMode::Checkerboard => eye((x + y) % 2 == 1, x, y),
                };
                let off = pixel
                    .iter()
                    .zip(due)
                    .map(|(found, due)| found.abs_diff(due));
                assert!(
                    off.max() <= Some(most),
                    "{mode:?} {swapped} {gamma:?} {x} {y}: {pixel:?} {due:?}"
                );
            }
        }
    }
}

#[test]
fn a_map_of_another_size_is_refused() {
    let Some(gpu) = device() else { return };
    let plan = OutputPlan {
        channels: vec![ChannelPlan {
            picture: 0,
            output_px: rect([4, 4]),
            source: ChannelSource::Warped {
                warp: 0,
                map: Arc::new(WarpMap {
                    size_px: [4, 4],
                    points_m: vec![[0.0; 3]; 15],
                }),
            },
            light: None,
        }],
        ..empty_output("odd", [4, 4])
    };
    let refused = Finisher::new(&gpu, &[plan]).unwrap_err().to_string();
    assert!(
        refused.contains("odd") && refused.contains("points"),
        "{refused}"
    );
}
