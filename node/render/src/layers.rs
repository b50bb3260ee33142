//! The texture arrays themselves: one layer of imagery and one of relief per tile, and how they grow.
//! In: a number of layers. Out: textures and views. It does not know which tile is where.

use crate::gpu::Gpu;

/// Texels along a side of a layer: a tile's 257 nodes and one border node at each end.
pub(crate) const LAYER_SIDE: u32 = 259;

/// Imagery and relief, with as many layers each.
#[derive(Debug)]
pub(crate) struct LayerArrays {
    pub(crate) layers: u32,
    pub(crate) imagery: wgpu::Texture,
    pub(crate) imagery_view: wgpu::TextureView,
    relief: wgpu::Texture,
    pub(crate) relief_view: wgpu::TextureView,
}

impl LayerArrays {
    pub(crate) fn new(gpu: &Gpu, layers: u32) -> Self {
        let imagery = array(gpu, "imagery", layers, wgpu::TextureFormat::Rgba8Unorm);
        let relief = array(gpu, "relief", layers, wgpu::TextureFormat::Rgba8Snorm);
        let view = |texture: &wgpu::Texture| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2Array),
                ..wgpu::TextureViewDescriptor::default()
            })
        };
        Self {
            layers,
            imagery_view: view(&imagery),
            relief_view: view(&relief),
            imagery,
            relief,
        }
    }

    /// Arrays of more layers, the first of which hold what these hold.
    pub(crate) fn grown(&self, gpu: &Gpu, layers: u32) -> Self {
        let grown = Self::new(gpu, layers);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (old, new) in [
            (&self.imagery, &grown.imagery),
            (&self.relief, &grown.relief),
        ] {
            encoder.copy_texture_to_texture(old.as_image_copy(), new.as_image_copy(), old.size());
        }
        gpu.queue.submit([encoder.finish()]);
        grown
    }
}

fn array(gpu: &Gpu, label: &str, layers: u32, format: wgpu::TextureFormat) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d {
            width: LAYER_SIDE,
            height: LAYER_SIDE,
            depth_or_array_layers: layers,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::COPY_DST
            // Written by compute stages.
            | wgpu::TextureUsages::STORAGE_BINDING,
        view_formats: &[],
    })
}
