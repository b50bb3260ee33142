//! Where pictures are drawn: one picture per output, and the block that is being drawn for it.
//! In: outputs' sizes. Out: textures to draw into, copies between them, and pixels read back.

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::outputs::OutputPlan;
use crate::readback::{map, staging};

/// Pictures hold gamma-encoded colour as it goes to a screen or into a PNG.
pub(crate) const COLOUR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The same, read as linear light.
pub(crate) const LIGHT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

/// The finished picture of one output.
#[derive(Debug)]
pub(crate) struct OutputTarget {
    pub(crate) texture: wgpu::Texture,
    pub(crate) view: wgpu::TextureView,
    /// The pictures of the left and the right eye, of an output that shows both.
    eyes: Vec<(wgpu::Texture, wgpu::TextureView)>,
}

/// What blocks are drawn to.
#[derive(Debug)]
pub(crate) struct ColourTarget {
    pub(crate) texture: wgpu::Texture,
    pub(crate) view: wgpu::TextureView,
    /// For reading it as linear light.
    pub(crate) light_view: wgpu::TextureView,
}

/// What the blocks of one output need of their target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct BlockLayout {
    /// Pixels that hold every block's wanted part.
    pub(crate) size: [u32; 2],
    /// The output is exactly one block's part, and can be drawn to without a copy.
    pub(crate) direct: bool,
}

/// Depth, and where needed colour, of the block being drawn for one output.
#[derive(Debug)]
pub(crate) struct BlockTarget {
    pub(crate) layout: BlockLayout,
    /// `None` where the output is exactly one block's part and is drawn to directly.
    pub(crate) colour: Option<ColourTarget>,
    pub(crate) depth: wgpu::TextureView,
}

/// Pixels of one output, row by row from the top, four bytes each: red, green, blue, 255.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// width × height × 4 bytes.
    pub rgba: Vec<u8>,
}

fn texture(
    gpu: &Gpu,
    label: &str,
    [width, height]: [u32; 2],
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: if format == COLOUR { &[LIGHT] } else { &[] },
    })
}

impl OutputTarget {
    pub(crate) fn new(gpu: &Gpu, plan: &OutputPlan) -> Result<Self, RenderError> {
        let most = gpu.device.limits().max_texture_dimension_2d;
        let [width, height] = plan.size_px;
        if width == 0 || height == 0 || width > most || height > most {
            return Err(RenderError::OutputTooLarge {
                output: plan.name.clone(),
                width,
                height,
                most,
            });
        }
        let usage = wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::TEXTURE_BINDING;
        let make = || {
            let texture = texture(gpu, &plan.name, plan.size_px, COLOUR, usage);
            let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
            (texture, view)
        };
        let eyes = if plan.pictures() > 1 {
            vec![make(), make()]
        } else {
            Vec::new()
        };
        let (texture, view) = make();
        Ok(Self {
            texture,
            view,
            eyes,
        })
    }

    /// What channels of a picture are drawn to: the output itself, or one eye's picture.
    pub(crate) fn picture(&self, number: usize) -> &wgpu::TextureView {
        self.eyes.get(number).map_or(&self.view, |(_, view)| view)
    }

    /// The same as a texture.
    pub(crate) fn picture_texture(&self, number: usize) -> &wgpu::Texture {
        self.eyes
            .get(number)
            .map_or(&self.texture, |(texture, _)| texture)
    }

    /// Copies the picture to the CPU. Waits for the GPU.
    pub(crate) fn read(&self, gpu: &Gpu, name: &str) -> Result<Picture, RenderError> {
        let (width, height) = (self.texture.width(), self.texture.height());
        let row_bytes = (width * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = staging(gpu, u64::from(row_bytes) * u64::from(height));
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_texture_to_buffer(
            self.texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row_bytes),
                    rows_per_image: Some(height),
                },
            },
            self.texture.size(),
        );
        gpu.queue.submit([encoder.finish()]);
        let rgba = map(gpu, &buffer, buffer.size(), name, |bytes| {
            let rows = bytes.chunks(row_bytes as usize);
            rows.flat_map(|row| row.get(..(width * 4) as usize).unwrap_or(row))
                .copied()
                .collect()
        })?;
        Ok(Picture {
            width,
            height,
            rgba,
        })
    }
}

impl BlockTarget {
    /// Whether blocks of a layout can be drawn to it: it is large enough, and not needlessly large.
    pub(crate) fn suits(&self, layout: BlockLayout) -> bool {
        let sides = self.layout.size.iter().zip(layout.size);
        let mut fits = sides.map(|(own, due)| *own >= due && *own <= 2 * due);
        self.layout.direct == layout.direct
            && if layout.direct {
                self.layout.size == layout.size
            } else {
                fits.all(|fits| fits)
            }
    }

    /// A target for a layout, without colour of its own where the output is drawn to directly.
    pub(crate) fn new(gpu: &Gpu, layout: BlockLayout) -> Self {
        let BlockLayout { size, direct } = layout;
        let view =
            |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let colour = (!direct).then(|| {
            let usage = wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::TEXTURE_BINDING;
            let colour = texture(gpu, "block", size, COLOUR, usage);
            let light = wgpu::TextureViewDescriptor {
                format: Some(LIGHT),
                usage: Some(wgpu::TextureUsages::TEXTURE_BINDING),
                ..wgpu::TextureViewDescriptor::default()
            };
            ColourTarget {
                view: view(&colour),
                light_view: colour.create_view(&light),
                texture: colour,
            }
        });
        let depth = texture(
            gpu,
            "block depth",
            size,
            DEPTH,
            wgpu::TextureUsages::empty(),
        );
        Self {
            layout,
            colour,
            depth: view(&depth),
        }
    }
}
