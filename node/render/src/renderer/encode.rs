//! The passes of one frame on the device: blocks of terrain and air, then what outputs make of them.
//!
//! In: blocks, what each of them draws. Out: finished pictures of all outputs. What is to be drawn is decided elsewhere.

use crate::error::RenderError;
use crate::gather::BlockDraws;
use crate::meshes::ARGUMENT_WORDS;
use crate::outputs::OutputPlan;
use crate::recorder::Recorder;
use crate::renderer::blocks::{PlannedBlock, block_layouts, copy_block, dark_pictures};
use crate::renderer::{Renderer, ViewPoint};
use crate::target::BlockTarget;

impl Renderer {
    /// Draws blocks into their outputs, and waits for the device. `filled` are blocks that terrain covers whole.
    pub(super) fn render(
        &mut self,
        view: &ViewPoint,
        blocks: &[PlannedBlock],
        draws: &[BlockDraws],
        filled: &[bool],
        wireframe: bool,
    ) -> Result<(), RenderError> {
        let meshes = &self.meshes;
        let wireframe = match wireframe {
            true => Some(self.pipelines.wireframe(&self.gpu)?),
            false => None,
        };
        let mut recorder = Recorder::new(&self.gpu, &mut self.times);
        let layouts = block_layouts(&self.outputs, blocks);
        for ((_, _, scratch), layout) in self.outputs.iter_mut().zip(&layouts) {
            // A tracked head can lose or find a screen, and with it the blocks of an output.
            if layout.size == [0, 0] || scratch.as_ref().is_some_and(|block| block.suits(*layout)) {
                continue;
            }
            *scratch = Some(BlockTarget::new(&self.gpu, *layout));
        }
        let outputs = &self.outputs;
        let size_of_scratch = |output: usize| {
            let scratch = outputs
                .get(output)
                .and_then(|(_, _, scratch)| scratch.as_ref());
            scratch.map_or([1, 1], |scratch| scratch.layout.size)
        };
        let plans: Vec<&OutputPlan> = outputs.iter().map(|(plan, _, _)| plan).collect();
        self.finisher
            .prepare(&self.gpu, &plans, view, blocks, &size_of_scratch);
        for (output, picture) in dark_pictures(outputs, blocks) {
            if let Some((_, target, _)) = outputs.get(output) {
                clear(&mut recorder.encoder, target.picture(picture));
            }
        }
        for (index, (planned, draws)) in blocks.iter().zip(draws).enumerate() {
            let block = &planned.block;
            let Some((plan, target, Some(scratch))) = outputs.get(planned.output) else {
                continue;
            };
            let colour = scratch
                .colour
                .as_ref()
                .map_or(&target.view, |drawn| &drawn.view);
            let mut pass = recorder
                .encoder
                .begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some("block"),
                    color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                        view: colour,
                        depth_slice: None,
                        resolve_target: None,
                        ops: wgpu::Operations {
                            load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                            store: wgpu::StoreOp::Store,
                        },
                    })],
                    depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                        view: &scratch.depth,
                        depth_ops: Some(wgpu::Operations {
                            load: wgpu::LoadOp::Clear(0.0),
                            store: wgpu::StoreOp::Discard,
                        }),
                        stencil_ops: None,
                    }),
                    ..wgpu::RenderPassDescriptor::default()
                });
            pass.set_viewport(
                0.0,
                0.0,
                block.area.width as f32,
                block.area.height as f32,
                0.0,
                1.0,
            );
            let wanted = block.wanted;
            pass.set_scissor_rect(wanted.x, wanted.y, wanted.width, wanted.height);
            pass.set_bind_group(
                0,
                &self.pipelines.bindings,
                &[self.pipelines.frame_offset(index)],
            );
            pass.set_pipeline(&self.pipelines.terrain);
            pass.set_vertex_buffer(0, meshes.vertices.slice(..));
            pass.set_index_buffer(meshes.indices.slice(..), wgpu::IndexFormat::Uint32);
            for draw in &draws.patches {
                let offset = u64::from(draw.argument) * ARGUMENT_WORDS * 4;
                pass.draw_indexed_indirect(&meshes.arguments, offset);
            }
            if let Some(wireframe) = wireframe {
                pass.set_pipeline(wireframe);
                for draw in &draws.patches {
                    let offset = u64::from(draw.argument) * ARGUMENT_WORDS * 4;
                    pass.draw_indexed_indirect(&meshes.arguments, offset);
                }
            }
            if !filled.get(index).copied().unwrap_or_default() {
                pass.set_pipeline(&self.pipelines.atmosphere);
                pass.draw(0..3, 0..1);
            }
            drop(pass);
            if let Some(drawn) = &scratch.colour
                && let Some(channel) = plan.channels.get(planned.channel)
            {
                if channel.is_plain(plan) {
                    let texture = target.picture_texture(channel.picture);
                    copy_block(
                        &mut recorder.encoder,
                        &drawn.texture,
                        texture,
                        channel,
                        planned,
                    );
                } else {
                    let (block, channel) = ((index, planned), (channel, view));
                    self.finisher.finish_block(
                        &self.gpu,
                        &mut recorder,
                        block,
                        channel,
                        drawn,
                        target,
                    )?;
                }
            }
        }
        for (index, (plan, target, _)) in outputs.iter().enumerate() {
            self.finisher
                .finish_output(&self.gpu, &mut recorder, index, plan, target)?;
        }
        recorder.finish()?;
        self.write_instead();
        self.gpu.queue.submit([]);
        self.gpu.wait()?;
        Ok(())
    }
}

/// Makes a picture black.
fn clear(encoder: &mut wgpu::CommandEncoder, view: &wgpu::TextureView) {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("dark"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                store: wgpu::StoreOp::Store,
            },
        })],
        ..wgpu::RenderPassDescriptor::default()
    });
}
