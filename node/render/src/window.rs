//! Windows: shows finished outputs on surfaces that a window system lends.
//! In: a window handle, a finished output. Out: presented frames. It opens no window and reads no event.

use shaders::Stage;

use crate::error::RenderError;
use crate::finish::full_screen_pipeline;
use crate::gpu::Gpu;
use crate::renderer::Renderer;

/// The surface of one window, and the pipeline that copies an output to it.
#[derive(Debug)]
pub struct WindowSurface {
    output: String,
    index: usize,
    /// Before the surface: fields are dropped in this order, and a surface must not go while a picture of its
    /// own is still held, as it is when a node leaves between drawing and presenting.
    acquired: Option<wgpu::SurfaceTexture>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    pipeline: wgpu::RenderPipeline,
    bindings: wgpu::BindGroup,
}

impl WindowSurface {
    /// Binds output `index` of the renderer to a window of `size` pixels.
    pub fn new(
        renderer: &Renderer,
        window: impl Into<wgpu::SurfaceTarget<'static>>,
        index: usize,
        output: &str,
        size: [u32; 2],
    ) -> Result<Self, RenderError> {
        let gpu = renderer.gpu();
        let refuse = |reason: String| RenderError::Window {
            output: output.to_owned(),
            reason,
        };
        let surface = gpu
            .instance
            .create_surface(window)
            .map_err(|error| refuse(error.to_string()))?;
        let capabilities = surface.get_capabilities(&gpu.adapter);
        // Outputs hold gamma-encoded bytes already: the surface must not encode them again.
        let format = capabilities
            .formats
            .iter()
            .copied()
            .find(|format| !format.is_srgb())
            .ok_or_else(|| refuse("it offers no plain 8-bit colour format".to_owned()))?;
        // The wall has its own clock; a driver that waits for a retrace of its own would fight it, but
        // tearing is worse: FIFO, which every driver has.
        let config = surface
            .get_default_config(&gpu.adapter, size[0].max(1), size[1].max(1))
            .map(|config| wgpu::SurfaceConfiguration {
                format,
                present_mode: wgpu::PresentMode::Fifo,
                ..config
            })
            .ok_or_else(|| refuse(format!("{} cannot show it", gpu.name())))?;
        surface.configure(&gpu.device, &config);
        let pipeline = full_screen_pipeline(gpu, Stage::Copy, format)?;
        let view = renderer
            .output_view(index)
            .ok_or_else(|| refuse("the renderer has no such output".to_owned()))?;
        let bindings = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("window"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(view),
            }],
        });
        Ok(Self {
            output: output.to_owned(),
            index,
            surface,
            config,
            pipeline,
            bindings,
            acquired: None,
        })
    }

    /// Index of the output that the window shows.
    #[must_use]
    pub fn index(&self) -> usize {
        self.index
    }

    /// Follows a change of the window's size. The picture keeps its own.
    pub fn resize(&mut self, gpu: &Gpu, size: [u32; 2]) {
        if size[0] > 0 && size[1] > 0 && size != [self.config.width, self.config.height] {
            // A surface cannot change while a picture of its old size is held.
            self.acquired = None;
            self.config.width = size[0];
            self.config.height = size[1];
            self.surface.configure(&gpu.device, &self.config);
        }
    }

    /// Copies the output to the next picture of the window, to be shown by [`WindowSurface::present`].
    /// A window that is hidden has no next picture; that is no error.
    pub fn prepare(&mut self, gpu: &Gpu) -> Result<(), RenderError> {
        use wgpu::CurrentSurfaceTexture as Current;
        // A picture that was prepared and never presented, because the wall went on without it, is drawn over:
        // a window gives out one at a time.
        let next = match self.acquired.take() {
            Some(texture) => Current::Success(texture),
            None => self.surface.get_current_texture(),
        };
        let texture = match next {
            Current::Success(texture) | Current::Suboptimal(texture) => texture,
            Current::Timeout | Current::Occluded => return Ok(()),
            Current::Outdated | Current::Lost => {
                self.surface.configure(&gpu.device, &self.config);
                return Ok(());
            }
            Current::Validation => {
                return Err(RenderError::Window {
                    output: self.output.clone(),
                    reason: "the driver refused its next picture".to_owned(),
                });
            }
        };
        let view = texture
            .texture
            .create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("window"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..wgpu::RenderPassDescriptor::default()
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.bindings, &[]);
            pass.draw(0..3, 0..1);
        }
        gpu.queue.submit([encoder.finish()]);
        gpu.wait()?;
        self.acquired = Some(texture);
        Ok(())
    }

    /// Shows what [`WindowSurface::prepare`] has copied.
    pub fn present(&mut self, gpu: &Gpu) {
        if let Some(texture) = self.acquired.take() {
            gpu.queue.present(texture);
        }
    }
}
