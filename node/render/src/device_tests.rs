//! Tests that need a device: the vertex stage against f64, from space down to the ground. Without an adapter they say so and pass, unless `REQUIRE_GPU=1`.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "a test that panics has failed"
)]

use std::sync::mpsc;

use geodesy::Ellipsoid;
use geodesy::frame::FixedPoint;
use glam::{DMat3, DVec3, Vec3};
use wgpu::util::DeviceExt as _;

use crate::canvas::{PixelRect, PlanarScreen};
use crate::gpu::{Gpu, GpuError};

/// A device, or `None` with a loud word where there is none and none is required.
pub(crate) fn device() -> Option<Gpu> {
    match Gpu::open(None) {
        Ok(gpu) => Some(gpu),
        Err(error @ GpuError::NoAdapter) if std::env::var("REQUIRE_GPU").as_deref() != Ok("1") => {
            eprintln!("SKIPPED: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// Runs a compute pipeline over storage buffers and returns the words of the last one.
fn run_words(
    gpu: &Gpu,
    source: &str,
    buffers: &[&[u8]],
    output_bytes: u64,
    groups: [u32; 3],
) -> Vec<u32> {
    let module = gpu
        .device
        .create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("probe"),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
    let pipeline = gpu
        .device
        .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("probe"),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    let mut storage: Vec<wgpu::Buffer> = buffers
        .iter()
        .map(|contents| {
            let descriptor = wgpu::util::BufferInitDescriptor {
                label: None,
                contents,
                usage,
            };
            gpu.device.create_buffer_init(&descriptor)
        })
        .collect();
    storage.push(gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: output_bytes,
        usage,
        mapped_at_creation: false,
    }));
    let mut entries = Vec::new();
    for (binding, buffer) in (0..).zip(&storage) {
        entries.push(wgpu::BindGroupEntry {
            binding,
            resource: buffer.as_entire_binding(),
        });
    }
    let bindings = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    });
    let read = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: output_bytes,
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = gpu
        .device
        .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups(groups[0], groups[1], groups[2]);
    }
    encoder.copy_buffer_to_buffer(storage.last().unwrap(), 0, &read, 0, output_bytes);
    gpu.queue.submit([encoder.finish()]);
    let (sender, receiver) = mpsc::channel();
    read.slice(..)
        .map_async(wgpu::MapMode::Read, move |result| {
            sender.send(result).unwrap();
        });
    gpu.wait().unwrap();
    receiver.recv().unwrap().unwrap();
    bytemuck::pod_collect_to_vec(&read.slice(..).get_mapped_range().unwrap())
}

const POSITION_PROBE: &str = "
#import shared::fixed_point
@group(0) @binding(0) var<storage, read> points: array<u32>;
@group(0) @binding(1) var<storage, read> viewer: array<u32>;
@group(0) @binding(2) var<storage, read_write> relative: array<f32>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    if i >= arrayLength(&points) / 6u { return; }
    for (var c = 0u; c < 3u; c++) {
        let p = i * 6u + c * 2u;
        relative[i * 3u + c] = fixed_difference(points[p], points[p + 1u], viewer[c * 2u], viewer[c * 2u + 1u]);
    }
}";

#[test]
fn vertices_on_the_device_are_within_a_hundredth_of_a_pixel_of_f64() {
    let Some(gpu) = device() else { return };
    let source = shaders::resolve_text("probe", POSITION_PROBE).unwrap();
    // A dense wall: 8K over 90°.
    let pixels_per_radian = 5000.0;
    let mut worst: f64 = 0.0;
    for altitude_m in [2.0, 50.0, 1e3, 1e5, 4e5, 1e7, 4e7] {
        let normal = Ellipsoid::normal(45.832_6, 6.865_2);
        let eye = Ellipsoid::EARTH.point(normal, 4810.0 + altitude_m);
        let viewer = FixedPoint::from_ecef(eye);
        let [east, north, _] = Ellipsoid::east_north_up(normal);
        let mut points = Vec::new();
        for n in 0..4096 {
            // From straight below out to several thousand times the altitude.
            let reach = altitude_m * 1.005_f64.powi(n) * 0.01;
            let angle = f64::from(n) * 2.4;
            let aside = (east * angle.cos() + north * angle.sin()) * reach.min(6e6);
            let below = Ellipsoid::EARTH.normal_below(eye + aside);
            points.push(Ellipsoid::EARTH.point(below, 4810.0));
        }
        let words: Vec<u32> = points
            .iter()
            .flat_map(|point| FixedPoint::from_ecef(*point).words())
            .collect();
        let viewer_words = viewer.words();
        let buffers = [
            bytemuck::cast_slice(&words),
            bytemuck::cast_slice(&viewer_words),
        ];
        let bytes = points.len() as u64 * 12;
        let result = run_words(
            &gpu,
            &source,
            &buffers,
            bytes,
            [points.len().div_ceil(64) as u32, 1, 1],
        );
        for (point, relative) in points.iter().zip(result.chunks_exact(3)) {
            let device = Vec3::new(
                f32::from_bits(relative[0]),
                f32::from_bits(relative[1]),
                f32::from_bits(relative[2]),
            );
            let exact = *point - eye;
            let angle = (device.as_dvec3() - exact).length() / exact.length();
            worst = worst.max(angle * pixels_per_radian);
            assert_eq!(
                device,
                FixedPoint::from_ecef(*point).relative_to(viewer),
                "the CPU's twin"
            );
        }
    }
    eprintln!("largest vertex error: {worst:.5} px at {pixels_per_radian} px/rad");
    assert!(worst <= 0.01, "{worst} px");
}

#[test]
fn clip_positions_are_within_a_hundredth_of_a_pixel_of_f64() {
    // The matrix is f32 and its product is taken on the device; here with the same operations.
    let screen = PlanarScreen {
        lower_left_m: DVec3::new(-2.0, -1.125, -3.0),
        right: DVec3::X,
        up: DVec3::Y,
        size_m: [4.0, 2.25],
        size_px: [3840, 2160],
    };
    let room = DMat3::from_euler(glam::EulerRot::ZYX, 2.0, 0.3, -1.2);
    let whole = PixelRect {
        x: 0,
        y: 0,
        width: 3840,
        height: 2160,
    };
    let mut worst: f64 = 0.0;
    for block in screen.blocks(whole, room) {
        for n in 0..2000 {
            let (px, py) = (f64::from(n * 7 % 3840), f64::from(n * 13 % 2160));
            let distance = 2.0 * 1.01_f64.powi(n);
            let on_screen = DVec3::new(-2.0 + px / 960.0, 1.125 - py / 960.0, -3.0);
            let relative = room * on_screen * (distance / 3.0);
            let clip = block.clip_from_relative * relative.as_vec3().extend(1.0);
            let x = f64::from(clip.x / clip.w * 0.5 + 0.5) * f64::from(block.area.width);
            let y = f64::from(0.5 - clip.y / clip.w * 0.5) * f64::from(block.area.height);
            let error = (x + f64::from(block.area.x) - px).hypot(y + f64::from(block.area.y) - py);
            let inside = (-100.0..2148.0).contains(&x) && (-100.0..2148.0).contains(&y);
            if inside {
                worst = worst.max(error);
            }
        }
    }
    assert!(worst <= 0.01, "{worst} px");
}
