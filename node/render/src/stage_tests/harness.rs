//! Runs one compute stage on a device: slots in, words out.
//! In: a stage, its uniform's bytes, words of 275×275 slots. Out: the words that it wrote. It uses nothing of how
//! `process` runs stages, so that neither hides the other's mistakes.

use std::sync::mpsc;

use shaders::{LAYER_SIDE, SLOT_SIDE, Stage};
use wgpu::util::DeviceExt as _;

use crate::gpu::Gpu;

/// Layers of the array that relief and surface write into, and the one that is written.
const LAYERS: u32 = 3;
pub(super) const LAYER: u32 = 1;

/// Runs a stage. Inputs that are missing are filled up with the last.
pub(super) fn run(gpu: &Gpu, stage: Stage, uniform: &[u8], inputs: &[&[u32]]) -> Vec<u32> {
    let pipeline = pipeline(gpu, stage);
    let uniform = gpu
        .device
        .create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: None,
            contents: uniform,
            usage: wgpu::BufferUsages::UNIFORM,
        });
    let (side, layers, format) = match stage {
        Stage::Relief => (LAYER_SIDE, LAYERS, wgpu::TextureFormat::Rgba8Snorm),
        Stage::Surface => (LAYER_SIDE, LAYERS, wgpu::TextureFormat::Rgba8Unorm),
        _ => (SLOT_SIDE, 1, wgpu::TextureFormat::R32Uint),
    };
    let result = texture(
        gpu,
        side,
        layers,
        format,
        wgpu::TextureUsages::STORAGE_BINDING,
    );
    let result_view = result.create_view(&wgpu::TextureViewDescriptor {
        dimension: (layers > 1).then_some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    });
    let slots: Vec<wgpu::TextureView> = inputs.iter().map(|words| slot(gpu, words)).collect();
    let mut entries = vec![
        wgpu::BindGroupEntry {
            binding: 0,
            resource: uniform.as_entire_binding(),
        },
        wgpu::BindGroupEntry {
            binding: 1,
            resource: wgpu::BindingResource::TextureView(&result_view),
        },
    ];
    for input in 0..stage.inputs() {
        let view = slots.get(input).or(slots.last()).unwrap();
        entries.push(wgpu::BindGroupEntry {
            binding: 2 + input as u32,
            resource: wgpu::BindingResource::TextureView(view),
        });
    }
    let bindings = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    });
    let mut encoder = gpu
        .device
        .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups(side.div_ceil(8), side.div_ceil(8), 1);
    }
    let mut read = read_back(gpu, encoder, &result, side, layers);
    if layers > 1 {
        let texels = (side * side) as usize;
        let written: Vec<u32> = read.drain(texels..2 * texels).collect();
        assert!(
            read.iter().all(|word| *word == 0),
            "{} writes into other layers",
            stage.name()
        );
        return written;
    }
    read
}

fn pipeline(gpu: &Gpu, stage: Stage) -> wgpu::ComputePipeline {
    let module = gpu
        .device
        .create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(stage.name()),
            source: wgpu::ShaderSource::Wgsl(stage.source().unwrap().into()),
        });
    gpu.device
        .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(stage.name()),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
}

fn extent(side: u32, layers: u32) -> wgpu::Extent3d {
    wgpu::Extent3d {
        width: side,
        height: side,
        depth_or_array_layers: layers,
    }
}

fn texture(
    gpu: &Gpu,
    side: u32,
    layers: u32,
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: extent(side, layers),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: usage | wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

fn slot(gpu: &Gpu, words: &[u32]) -> wgpu::TextureView {
    let slot = texture(
        gpu,
        SLOT_SIDE,
        1,
        wgpu::TextureFormat::R32Uint,
        wgpu::TextureUsages::TEXTURE_BINDING,
    );
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(SLOT_SIDE * 4),
        rows_per_image: None,
    };
    let size = extent(SLOT_SIDE, 1);
    gpu.queue.write_texture(
        slot.as_image_copy(),
        bytemuck::cast_slice(words),
        layout,
        size,
    );
    slot.create_view(&wgpu::TextureViewDescriptor::default())
}

/// Submits, waits, and returns the texture's words, layer by layer.
fn read_back(
    gpu: &Gpu,
    mut encoder: wgpu::CommandEncoder,
    from: &wgpu::Texture,
    side: u32,
    layers: u32,
) -> Vec<u32> {
    let row_bytes = (side * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(row_bytes) * u64::from(side * layers),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let to = wgpu::TexelCopyBufferInfo {
        buffer: &buffer,
        layout: wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(row_bytes),
            rows_per_image: Some(side),
        },
    };
    encoder.copy_texture_to_buffer(from.as_image_copy(), to, extent(side, layers));
    gpu.queue.submit([encoder.finish()]);
    let (sender, receiver) = mpsc::channel();
    buffer
        .slice(..)
        .map_async(wgpu::MapMode::Read, move |mapped| {
            sender.send(mapped).unwrap();
        });
    gpu.wait().unwrap();
    receiver.recv().unwrap().unwrap();
    let bytes: Vec<u32> =
        bytemuck::pod_collect_to_vec(&buffer.slice(..).get_mapped_range().unwrap());
    let rows = bytes.chunks_exact(row_bytes as usize / 4);
    rows.flat_map(|row| &row[..side as usize])
        .copied()
        .collect()
}
