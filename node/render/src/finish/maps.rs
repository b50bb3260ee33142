//! The maps of channels on the device: which point of the room each pixel lights, and how bright it is to be.
//! In: maps of the plan. Out: textures. A map of another size than its channel is refused.

use half::f16;
use wgpu::util::{DeviceExt as _, TextureDataOrder};

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::outputs::{ChannelPlan, ChannelSource, LightMap, OutputPlan, Uplift};

/// The maps of one channel.
#[derive(Debug)]
pub(super) struct ChannelMaps {
    pub(super) points: Option<wgpu::TextureView>,
    pub(super) light: Option<wgpu::TextureView>,
}

impl ChannelMaps {
    pub(super) fn new(
        gpu: &Gpu,
        plan: &OutputPlan,
        channel: &ChannelPlan,
    ) -> Result<Self, RenderError> {
        let size_px = [channel.output_px.width, channel.output_px.height];
        let pixels = size_px[0] as usize * size_px[1] as usize;
        let refuse = |what: &str| RenderError::Map {
            output: plan.name.clone(),
            what: what.to_owned(),
        };
        let points = match &channel.source {
            ChannelSource::Canvas { .. } => None,
            ChannelSource::Warped { map, .. } => {
                if map.size_px != size_px || map.points_m.len() != pixels {
                    return Err(refuse("points"));
                }
                Some(point_texture(gpu, size_px, &map.points_m))
            }
        };
        let light = match &channel.light {
            None => None,
            Some(map) => {
                let fits = |values: &[[f32; 3]]| values.len() == pixels;
                if map.size_px != size_px
                    || !fits(&map.alpha)
                    || !(map.beta.is_empty() || fits(&map.beta))
                {
                    return Err(refuse("light"));
                }
                Some(light_texture(gpu, size_px, map))
            }
        };
        Ok(Self { points, light })
    }
}

/// Full light for one pixel.
pub(super) fn no_light() -> LightMap {
    LightMap {
        size_px: [1, 1],
        alpha: vec![[1.0; 3]],
        beta: Vec::new(),
        uplift: Uplift::default(),
    }
}

fn point_texture(gpu: &Gpu, size_px: [u32; 2], points_m: &[[f32; 3]]) -> wgpu::TextureView {
    let texels: Vec<[f32; 4]> = points_m
        .iter()
        .map(|[x, y, z]| {
            if [x, y, z].iter().all(|part| part.is_finite()) {
                [*x, *y, *z, 1.0]
            } else {
                [0.0; 4]
            }
        })
        .collect();
    let format = wgpu::TextureFormat::Rgba32Float;
    texture(
        gpu,
        "points",
        size_px,
        1,
        format,
        bytemuck::cast_slice(&texels),
    )
}

/// Alpha and beta as two layers.
pub(super) fn light_texture(gpu: &Gpu, size_px: [u32; 2], map: &LightMap) -> wgpu::TextureView {
    let pixels = size_px[0] as usize * size_px[1] as usize;
    let mut texels: Vec<[u16; 4]> = Vec::with_capacity(2 * pixels);
    let half = |share: f32| f16::from_f32(share.clamp(0.0, 1.0)).to_bits();
    let texel = |[red, green, blue]: &[f32; 3]| [half(*red), half(*green), half(*blue), 0];
    texels.extend(map.alpha.iter().map(texel));
    texels.extend(map.beta.iter().map(texel));
    texels.resize(2 * pixels, [0; 4]);
    let format = wgpu::TextureFormat::Rgba16Float;
    let bytes = bytemuck::cast_slice(&texels);
    texture(gpu, "light", size_px, 2, format, bytes)
}

fn texture(
    gpu: &Gpu,
    label: &str,
    [width, height]: [u32; 2],
    layers: u32,
    format: wgpu::TextureFormat,
    bytes: &[u8],
) -> wgpu::TextureView {
    let descriptor = wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: layers,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    };
    let order = TextureDataOrder::LayerMajor;
    let texture = gpu
        .device
        .create_texture_with_data(&gpu.queue, &descriptor, order, bytes);
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}
