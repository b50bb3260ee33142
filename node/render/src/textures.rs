//! What tiles look like on the GPU: imagery and relief as layers of two texture arrays.
//! In: decoded tiles. Out: layers that the terrain shader samples. Both arrays share one byte budget;
//! when it is spent, the layer unused for longest is overwritten.

use bytemuck::{bytes_of, cast_slice};
use geodesy::frame::scalar_f32;
use geodesy::{Ellipsoid, Tile};
use shaders::{INVALID_HEIGHT, ReliefRecord, Stage};
use tiles::{Samples, TileData};
use wgpu::util::DeviceExt as _;

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::layers::{LAYER_SIDE, LayerArrays};
use crate::pool::LayerPool;

/// Bytes of one layer of either array.
pub(crate) const LAYER_BYTES: u64 = LAYER_SIDE as u64 * LAYER_SIDE as u64 * 4;
/// Tiles that one run of the relief stage takes.
pub(crate) const RELIEF_BATCH: usize = 8;
const HEIGHT_WORDS: usize = geodesy::STORED_NODES * geodesy::STORED_NODES;
/// Colour of ground that no imagery covers, gamma encoded.
const NEUTRAL: [u8; 4] = [150, 146, 138, 255];

/// Layers of each array to begin with; what a view needs comes on top.
const FIRST_LAYERS: u32 = 64;

/// The two arrays, and who holds which layer.
#[derive(Debug)]
pub(crate) struct SurfaceTextures {
    pub(crate) imagery: LayerPool,
    pub(crate) relief: LayerPool,
    pub(crate) arrays: LayerArrays,
    /// Layers of each array that the budget allows.
    most_layers: u32,
    heights: wgpu::Buffer,
    records: wgpu::Buffer,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    scratch: Vec<u8>,
}

/// One elevation tile on its way to its relief layer.
pub(crate) struct ReliefJob<'a> {
    pub(crate) data: &'a TileData,
    pub(crate) layer: u32,
    pub(crate) quantum_m: f64,
}

impl SurfaceTextures {
    /// Arrays that together stay within `budget_bytes`, with at least 32 layers each.
    pub(crate) fn new(gpu: &Gpu, budget_bytes: u64) -> Result<Self, RenderError> {
        let most = u64::from(gpu.device.limits().max_texture_array_layers);
        let most_layers = (budget_bytes / (2 * LAYER_BYTES)).clamp(32, most) as u32;
        let arrays = LayerArrays::new(gpu, FIRST_LAYERS.min(most_layers));
        let heights = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("heights"),
            size: (RELIEF_BATCH * HEIGHT_WORDS * 4) as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let records = gpu
            .device
            .create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("relief records"),
                contents: &[0; RELIEF_BATCH * size_of::<ReliefRecord>()],
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            });
        let module = gpu
            .device
            .create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(Stage::Relief.name()),
                source: wgpu::ShaderSource::Wgsl(Stage::Relief.source()?.into()),
            });
        let pipeline = gpu
            .device
            .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("relief"),
                layout: None,
                module: &module,
                entry_point: Some("main"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            });
        let bindings = bind_relief(gpu, &pipeline, &heights, &records, &arrays);
        let textures = Self {
            imagery: LayerPool::new(arrays.layers),
            relief: LayerPool::new(arrays.layers),
            arrays,
            most_layers,
            heights,
            records,
            pipeline,
            bindings,
            scratch: Vec::new(),
        };
        let neutral = NEUTRAL.repeat((LAYER_SIDE * LAYER_SIDE) as usize);
        textures.write_layer(gpu, 0, &neutral);
        Ok(textures)
    }

    /// Tiles that the budget has room for. Layer 0 holds none.
    pub(crate) fn most_tiles(&self) -> usize {
        self.most_layers as usize - 1
    }

    /// Makes room for `layers` tiles in each array, as far as the budget goes. What is there stays.
    pub(crate) fn reserve(&mut self, gpu: &Gpu, layers: usize) {
        let wanted = u32::try_from(layers)
            .unwrap_or(u32::MAX)
            .min(self.most_layers);
        if wanted <= self.arrays.layers {
            return;
        }
        let grown = wanted.next_power_of_two().min(self.most_layers);
        self.arrays = self.arrays.grown(gpu, grown);
        self.imagery.grow(grown);
        self.relief.grow(grown);
        self.bindings = bind_relief(
            gpu,
            &self.pipeline,
            &self.heights,
            &self.records,
            &self.arrays,
        );
    }

    /// Forgets every tile, for a new scene.
    pub(crate) fn clear(&mut self) {
        self.imagery.clear();
        self.relief.clear();
    }

    /// Writes an imagery tile to its layer.
    pub(crate) fn upload_imagery(&mut self, gpu: &Gpu, data: &TileData, layer: u32) {
        let mut texels = std::mem::take(&mut self.scratch);
        imagery_texels(data, &mut texels);
        self.write_layer(gpu, layer, &texels);
        self.scratch = texels;
    }

    fn write_layer(&self, gpu: &Gpu, layer: u32, texels: &[u8]) {
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture: &self.arrays.imagery,
                mip_level: 0,
                origin: wgpu::Origin3d {
                    x: 0,
                    y: 0,
                    z: layer,
                },
                aspect: wgpu::TextureAspect::All,
            },
            texels,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(LAYER_SIDE * 4),
                rows_per_image: Some(LAYER_SIDE),
            },
            wgpu::Extent3d {
                width: LAYER_SIDE,
                height: LAYER_SIDE,
                depth_or_array_layers: 1,
            },
        );
    }

    /// Runs the relief stage for up to [`RELIEF_BATCH`] tiles and submits it.
    pub(crate) fn process_relief(&self, gpu: &Gpu, ellipsoid: &Ellipsoid, jobs: &[ReliefJob<'_>]) {
        let jobs = &jobs[..jobs.len().min(RELIEF_BATCH)];
        if jobs.is_empty() {
            return;
        }
        for (index, job) in jobs.iter().enumerate() {
            let first = index * HEIGHT_WORDS;
            let record = relief_record(
                ellipsoid,
                job.data.tile,
                job.quantum_m,
                job.layer,
                first as u32,
            );
            let heights = relief_heights(job.data);
            gpu.queue
                .write_buffer(&self.heights, (first * 4) as u64, cast_slice(&heights));
            let offset = index * size_of::<ReliefRecord>();
            gpu.queue
                .write_buffer(&self.records, offset as u64, bytes_of(&record));
        }
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.bindings, &[]);
            let groups = LAYER_SIDE.div_ceil(8);
            pass.dispatch_workgroups(groups, groups, jobs.len() as u32);
        }
        gpu.queue.submit([encoder.finish()]);
    }
}

fn bind_relief(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    heights: &wgpu::Buffer,
    records: &wgpu::Buffer,
    arrays: &LayerArrays,
) -> wgpu::BindGroup {
    let resources = [
        heights.as_entire_binding(),
        records.as_entire_binding(),
        wgpu::BindingResource::TextureView(&arrays.relief_view),
    ];
    let mut entries = Vec::with_capacity(resources.len());
    for (binding, resource) in (0..).zip(resources) {
        entries.push(wgpu::BindGroupEntry { binding, resource });
    }
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("relief"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    })
}

/// The relief stage's record of a tile.
pub(crate) fn relief_record(
    ellipsoid: &Ellipsoid,
    tile: Tile,
    quantum_m: f64,
    layer: u32,
    first: u32,
) -> ReliefRecord {
    let tiles = f64::from(1_u32 << tile.level());
    ReliefRecord {
        origin: [
            scalar_f32(f64::from(tile.x()) / tiles),
            scalar_f32(f64::from(tile.y()) / tiles),
        ],
        step: scalar_f32(1.0 / (tiles * geodesy::CELLS as f64)),
        quantum_m: scalar_f32(quantum_m),
        radius_m: scalar_f32(0.5 * (ellipsoid.semi_major_m + ellipsoid.semi_minor_m)),
        face: u32::from(tile.face().number()),
        layer,
        first,
    }
}

/// A tile's heights with holes marked for the relief stage.
pub(crate) fn relief_heights(data: &TileData) -> Vec<i32> {
    let Some(heights) = data.heights() else {
        return vec![INVALID_HEIGHT; HEIGHT_WORDS];
    };
    let mut marked = heights.to_vec();
    if !matches!(data.validity, tiles::Validity::All) {
        for (node, height) in marked.iter_mut().enumerate() {
            if !data.validity.is_valid(node) {
                *height = INVALID_HEIGHT;
            }
        }
    }
    marked
}

/// The 259×259 inner nodes of an imagery tile as RGBA; ground without imagery gets the neutral colour.
fn imagery_texels(data: &TileData, texels: &mut Vec<u8>) {
    let side = i64::from(LAYER_SIDE);
    texels.clear();
    texels.reserve((side * side * 4) as usize);
    let channels = usize::from(data.channels);
    let Samples::U8(samples) = &data.samples else {
        texels.extend(NEUTRAL.repeat((side * side) as usize));
        return;
    };
    for j in -1..side - 1 {
        let first = TileData::index(-1, j);
        for node in first..first + side as usize {
            let sample = samples.get(node * channels..(node + 1) * channels);
            match sample {
                Some([r, g, b, ..]) if data.validity.is_valid(node) => {
                    texels.extend_from_slice(&[*r, *g, *b, 255]);
                }
                Some([grey, ..]) if data.validity.is_valid(node) => {
                    texels.extend_from_slice(&[*grey, *grey, *grey, 255]);
                }
                _ => texels.extend_from_slice(&NEUTRAL),
            }
        }
    }
}
