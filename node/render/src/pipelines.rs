//! The draw pipelines and what is bound to them: terrain, sky, and the copy into a window.
//! In: a device. Out: pipelines, layouts, and the growing buffers for frames and tile records.

use std::cell::OnceCell;

use shaders::{FrameUniform, Stage, TileRecord};

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::target::{COLOUR, DEPTH};
use crate::textures::SurfaceTextures;

/// As [`terrain::Vertex`]: fixed-point position, ellipsoid normal, lattice position.
const ATTRIBUTES: [wgpu::VertexAttribute; 4] = wgpu::vertex_attr_array![
    0 => Uint32x4,
    1 => Uint32x2,
    2 => Snorm16x4,
    3 => Uint16x2,
];

/// Everything that draws.
#[derive(Debug)]
pub(crate) struct Pipelines {
    pub(crate) terrain: wgpu::RenderPipeline,
    pub(crate) atmosphere: wgpu::RenderPipeline,
    /// The edges of triangles; made when it is first wanted.
    wireframe: OnceCell<wgpu::RenderPipeline>,
    pipeline_layout: wgpu::PipelineLayout,
    layout: wgpu::BindGroupLayout,
    sampler: wgpu::Sampler,
    frames: wgpu::Buffer,
    frame_stride: u64,
    records: wgpu::Buffer,
    /// Layers of the arrays that are bound.
    bound_layers: u32,
    pub(crate) bindings: wgpu::BindGroup,
}

impl Pipelines {
    pub(crate) fn new(gpu: &Gpu, textures: &SurfaceTextures) -> Result<Self, RenderError> {
        let layout = bind_group_layout(gpu);
        let pipeline_layout = gpu
            .device
            .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("draw"),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
        let terrain = draw_pipeline(gpu, &pipeline_layout, Stage::Terrain)?;
        let atmosphere = draw_pipeline(gpu, &pipeline_layout, Stage::Atmosphere)?;
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("bilinear"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        let alignment = u64::from(gpu.device.limits().min_uniform_buffer_offset_alignment);
        let frame_stride = (size_of::<FrameUniform>() as u64).next_multiple_of(alignment);
        let frames = frame_buffer(gpu, frame_stride);
        let records = record_buffer(gpu, 64);
        let bindings = bind(gpu, &layout, &frames, &records, textures, &sampler);
        Ok(Self {
            terrain,
            atmosphere,
            wireframe: OnceCell::new(),
            pipeline_layout,
            layout,
            sampler,
            frames,
            frame_stride,
            records,
            bound_layers: textures.arrays.layers,
            bindings,
        })
    }

    /// Writes what every block and every tile of this frame needs; buffers grow as they must.
    pub(crate) fn write(
        &mut self,
        gpu: &Gpu,
        textures: &SurfaceTextures,
        frames: &[FrameUniform],
        records: &[TileRecord],
    ) {
        let frame_bytes = self.frame_stride * frames.len() as u64;
        let record_bytes = size_of_val(records) as u64;
        let stale = self.bound_layers != textures.arrays.layers;
        if stale || frame_bytes > self.frames.size() || record_bytes > self.records.size() {
            self.bound_layers = textures.arrays.layers;
            if frame_bytes > self.frames.size() {
                self.frames = frame_buffer(gpu, frame_bytes.next_power_of_two());
            }
            if record_bytes > self.records.size() {
                self.records = record_buffer(gpu, records.len().next_power_of_two());
            }
            self.bindings = bind(
                gpu,
                &self.layout,
                &self.frames,
                &self.records,
                textures,
                &self.sampler,
            );
        }
        for (index, frame) in frames.iter().enumerate() {
            let offset = index as u64 * self.frame_stride;
            gpu.queue
                .write_buffer(&self.frames, offset, bytemuck::bytes_of(frame));
        }
        gpu.queue
            .write_buffer(&self.records, 0, bytemuck::cast_slice(records));
    }

    /// The pipeline that draws edges. Refused by a device that draws no lines.
    pub(crate) fn wireframe(&self, gpu: &Gpu) -> Result<&wgpu::RenderPipeline, RenderError> {
        if let Some(made) = self.wireframe.get() {
            return Ok(made);
        }
        if !gpu
            .device
            .features()
            .contains(wgpu::Features::POLYGON_MODE_LINE)
        {
            return Err(RenderError::NoWireframe {
                adapter: gpu.name(),
            });
        }
        let made = draw_pipeline(gpu, &self.pipeline_layout, Stage::Wireframe)?;
        Ok(self.wireframe.get_or_init(|| made))
    }

    /// The dynamic offset of a block's frame.
    pub(crate) fn frame_offset(&self, block: usize) -> u32 {
        (block as u64 * self.frame_stride) as u32
    }
}

fn frame_buffer(gpu: &Gpu, size: u64) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("frames"),
        size,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn record_buffer(gpu: &Gpu, records: usize) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("tile records"),
        size: (records * size_of::<TileRecord>()) as u64,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn bind_group_layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    let entry = |binding, visibility, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty,
        count: None,
    };
    let layers = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: true },
        view_dimension: wgpu::TextureViewDimension::D2Array,
        multisampled: false,
    };
    let both = wgpu::ShaderStages::VERTEX_FRAGMENT;
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("draw"),
            entries: &[
                entry(
                    0,
                    both,
                    wgpu::BindingType::Buffer {
                        ty: wgpu::BufferBindingType::Uniform,
                        has_dynamic_offset: true,
                        min_binding_size: wgpu::BufferSize::new(size_of::<FrameUniform>() as u64),
                    },
                ),
                entry(
                    1,
                    wgpu::ShaderStages::VERTEX,
                    wgpu::BindingType::Buffer {
                        ty: wgpu::BufferBindingType::Storage { read_only: true },
                        has_dynamic_offset: false,
                        min_binding_size: wgpu::BufferSize::new(size_of::<TileRecord>() as u64),
                    },
                ),
                entry(2, wgpu::ShaderStages::FRAGMENT, layers),
                entry(3, wgpu::ShaderStages::FRAGMENT, layers),
                entry(
                    4,
                    wgpu::ShaderStages::FRAGMENT,
                    wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
                ),
            ],
        })
}

fn bind(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    frames: &wgpu::Buffer,
    records: &wgpu::Buffer,
    textures: &SurfaceTextures,
    sampler: &wgpu::Sampler,
) -> wgpu::BindGroup {
    let frame = wgpu::BufferBinding {
        buffer: frames,
        offset: 0,
        size: wgpu::BufferSize::new(size_of::<FrameUniform>() as u64),
    };
    let resources = [
        wgpu::BindingResource::Buffer(frame),
        records.as_entire_binding(),
        wgpu::BindingResource::TextureView(&textures.arrays.imagery_view),
        wgpu::BindingResource::TextureView(&textures.arrays.relief_view),
        wgpu::BindingResource::Sampler(sampler),
    ];
    let mut entries = Vec::with_capacity(resources.len());
    for (binding, resource) in (0..).zip(resources) {
        entries.push(wgpu::BindGroupEntry { binding, resource });
    }
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("draw"),
        layout,
        entries: &entries,
    })
}

fn draw_pipeline(
    gpu: &Gpu,
    layout: &wgpu::PipelineLayout,
    stage: Stage,
) -> Result<wgpu::RenderPipeline, RenderError> {
    let module = gpu
        .device
        .create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(stage.name()),
            source: wgpu::ShaderSource::Wgsl(stage.source()?.into()),
        });
    let is_wireframe = stage == Stage::Wireframe;
    let is_terrain = stage == Stage::Terrain || is_wireframe;
    let vertices = wgpu::VertexBufferLayout {
        array_stride: terrain::Vertex::BYTES as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &ATTRIBUTES,
    };
    let buffers: &[Option<wgpu::VertexBufferLayout<'_>>] =
        if is_terrain { &[Some(vertices)] } else { &[] };
    let depth = wgpu::DepthStencilState {
        format: DEPTH,
        depth_write_enabled: Some(is_terrain && !is_wireframe),
        // Reversed depth: nearer is greater; the sky shows only where nothing was drawn (depth 0).
        depth_compare: Some(if is_terrain {
            wgpu::CompareFunction::Greater
        } else {
            wgpu::CompareFunction::Equal
        }),
        stencil: wgpu::StencilState::default(),
        bias: wgpu::DepthBiasState::default(),
    };
    Ok(gpu
        .device
        .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(stage.name()),
            layout: Some(layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex_main"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers,
            },
            primitive: wgpu::PrimitiveState {
                cull_mode: is_terrain.then_some(wgpu::Face::Back),
                polygon_mode: if is_wireframe {
                    wgpu::PolygonMode::Line
                } else {
                    wgpu::PolygonMode::Fill
                },
                ..wgpu::PrimitiveState::default()
            },
            depth_stencil: Some(depth),
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment_main"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(COLOUR.into())],
            }),
            multiview_mask: None,
            cache: None,
        }))
}
