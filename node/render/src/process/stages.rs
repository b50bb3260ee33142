//! Runs compute stages: pipelines, uniforms, and one pass of dispatches for whatever was asked for.
//! In: a stage, its uniform, textures to read and to write. Out: work submitted to the device, in the order it was
//! asked for. It knows no tile and decides nothing.

use std::sync::{Arc, OnceLock};

use shaders::Stage;

use crate::error::RenderError;
use crate::gpu::Gpu;

/// Bytes of uniforms that one submission may need.
const UNIFORM_BYTES: u64 = 64 * 1024;
/// Textures that a fusing stage reads.
pub(crate) const MOST_INPUTS: usize = 8;

/// The compute pipelines, each made when it is first needed, or by [`Stages::warm`].
#[derive(Debug, Default)]
struct Pipelines {
    made: [OnceLock<wgpu::ComputePipeline>; Stage::ALL.len()],
}

impl Pipelines {
    fn get(&self, gpu: &Gpu, stage: Stage) -> Result<&wgpu::ComputePipeline, RenderError> {
        let index = Stage::ALL.iter().position(|known| *known == stage);
        let Some(slot) = index.and_then(|index| self.made.get(index)) else {
            return Err(RenderError::Stage(stage.name()));
        };
        if let Some(made) = slot.get() {
            return Ok(made);
        }
        let made = pipeline(gpu, stage)?;
        Ok(slot.get_or_init(|| made))
    }
}

fn pipeline(gpu: &Gpu, stage: Stage) -> Result<wgpu::ComputePipeline, RenderError> {
    let module = gpu
        .device
        .create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(stage.name()),
            source: wgpu::ShaderSource::Wgsl(stage.source()?.into()),
        });
    Ok(gpu
        .device
        .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(stage.name()),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        }))
}

/// One dispatch.
pub(crate) struct Dispatch<'a> {
    pub(crate) stage: Stage,
    pub(crate) uniform: &'a [u8],
    pub(crate) result: &'a wgpu::TextureView,
    /// At least one. Where the stage could read more, the last is repeated.
    pub(crate) inputs: &'a [&'a wgpu::TextureView],
    /// Nodes along a side of the result.
    pub(crate) side: u32,
}

/// Encodes dispatches and submits them.
#[derive(Debug)]
pub(crate) struct Stages {
    pipelines: Arc<Pipelines>,
    uniforms: wgpu::Buffer,
    alignment: u64,
    cursor: u64,
    encoder: Option<wgpu::CommandEncoder>,
}

impl Stages {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self {
            pipelines: Arc::default(),
            uniforms: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("stage uniforms"),
                size: UNIFORM_BYTES,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            alignment: u64::from(gpu.device.limits().min_uniform_buffer_offset_alignment).max(16),
            cursor: 0,
            encoder: None,
        }
    }

    /// Makes the pipelines of all stages in the background, so that the first use of one costs no frame.
    pub(crate) fn warm(&self, gpu: &Arc<Gpu>) {
        let (pipelines, gpu) = (Arc::clone(&self.pipelines), Arc::clone(gpu));
        let warming = std::thread::Builder::new()
            .name("shader compiler".to_owned())
            .spawn(move || {
                for stage in Stage::ALL.into_iter().filter(|stage| stage.is_compute()) {
                    if let Err(error) = pipelines.get(&gpu, stage) {
                        tracing::error!(%error, stage = stage.name(), "a stage does not compile");
                    }
                }
            });
        if let Err(error) = warming {
            tracing::warn!(%error, "stages are compiled when they are first used");
        }
    }

    /// Adds a dispatch to the submission that is being put together.
    pub(crate) fn run(&mut self, gpu: &Gpu, dispatch: &Dispatch<'_>) -> Result<(), RenderError> {
        let bytes = dispatch.uniform.len() as u64;
        if self.cursor + bytes > UNIFORM_BYTES {
            self.submit(gpu);
        }
        let pipeline = self.pipelines.get(gpu, dispatch.stage)?;
        let offset = self.cursor;
        self.cursor = (offset + bytes).next_multiple_of(self.alignment);
        gpu.queue
            .write_buffer(&self.uniforms, offset, dispatch.uniform);
        let mut entries = vec![
            wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer: &self.uniforms,
                    offset,
                    size: std::num::NonZeroU64::new(bytes),
                }),
            },
            wgpu::BindGroupEntry {
                binding: 1,
                resource: wgpu::BindingResource::TextureView(dispatch.result),
            },
        ];
        let last = dispatch.inputs.last().copied();
        let inputs = (0..dispatch.stage.inputs())
            .filter_map(|index| dispatch.inputs.get(index).copied().or(last));
        for (binding, view) in (2..).zip(inputs) {
            entries.push(wgpu::BindGroupEntry {
                binding,
                resource: wgpu::BindingResource::TextureView(view),
            });
        }
        let bindings = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(dispatch.stage.name()),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        let encoder = self.encoder.get_or_insert_with(|| {
            gpu.device
                .create_command_encoder(&wgpu::CommandEncoderDescriptor {
                    label: Some("process"),
                })
        });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        let groups = dispatch.side.div_ceil(8);
        pass.dispatch_workgroups(groups, groups, 1);
        Ok(())
    }

    /// Sends what was put together.
    pub(crate) fn submit(&mut self, gpu: &Gpu) {
        self.cursor = 0;
        if let Some(encoder) = self.encoder.take() {
            gpu.queue.submit([encoder.finish()]);
        }
    }
}
