//! What passes take: by the device's own clock where it has one, by waiting for each pass where not.
//! In: passes as they are encoded. Out: labels and milliseconds in the order of running. Passes that are timed are
//! waited for; what they compute is the same.

use std::time::Instant;

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::readback::map;

/// Passes that one submission can time. Those beyond are run and not timed.
const MOST_PASSES: u32 = 128;

/// Times of passes.
#[derive(Debug)]
pub(crate) struct PassTimes {
    device: Option<DeviceClock>,
    taken: Vec<(&'static str, f64)>,
}

#[derive(Debug)]
struct DeviceClock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    read: wgpu::Buffer,
    ms_per_tick: f64,
}

impl PassTimes {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        // A driver that computes on the processor stamps when it takes a pass, not when it has done it.
        let timed = !gpu.is_software()
            && gpu
                .device
                .features()
                .contains(wgpu::Features::TIMESTAMP_QUERY);
        let clock = if timed {
            "the device's clock"
        } else {
            "this side's clock, waiting included"
        };
        tracing::info!(clock, adapter = gpu.name(), "passes are timed");
        Self {
            device: timed.then(|| DeviceClock::new(gpu)),
            taken: Vec::new(),
        }
    }

    /// As on a device that has no clock.
    #[cfg(test)]
    pub(crate) fn without_device_clock() -> Self {
        Self {
            device: None,
            taken: Vec::new(),
        }
    }

    /// Labels and milliseconds since the last call.
    pub(crate) fn take(&mut self) -> Vec<(&'static str, f64)> {
        std::mem::take(&mut self.taken)
    }
}

impl DeviceClock {
    fn new(gpu: &Gpu) -> Self {
        let buffer = |usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("times of passes"),
                size: u64::from(MOST_PASSES) * 16,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        Self {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("times of passes"),
                ty: wgpu::QueryType::Timestamp,
                count: MOST_PASSES * 2,
            }),
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            read: buffer(wgpu::BufferUsages::MAP_READ),
            ms_per_tick: f64::from(gpu.queue.get_timestamp_period()) * 1e-6,
        }
    }

    /// Ticks at the beginnings and ends of the first `passes` passes.
    fn ticks(&self, gpu: &Gpu, passes: u32) -> Result<Vec<u64>, RenderError> {
        let bytes = u64::from(passes) * 16;
        let mut encoder = encoder(gpu);
        encoder.resolve_query_set(&self.queries, 0..2 * passes, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.read, 0, bytes);
        gpu.queue.submit([encoder.finish()]);
        read_mapped(gpu, &self.read, bytes)
    }
}

/// Encodes passes, times them where that is wanted, and submits them.
pub(crate) struct Recorder<'a> {
    gpu: &'a Gpu,
    times: &'a mut Option<PassTimes>,
    pub(crate) encoder: wgpu::CommandEncoder,
    labels: Vec<&'static str>,
}

impl<'a> Recorder<'a> {
    pub(crate) fn new(gpu: &'a Gpu, times: &'a mut Option<PassTimes>) -> Self {
        Self {
            gpu,
            times,
            encoder: encoder(gpu),
            labels: Vec::new(),
        }
    }

    /// Whether anybody wants the times of single passes.
    pub(crate) fn is_timed(&self) -> bool {
        self.times.is_some()
    }

    /// One pass.
    pub(crate) fn pass(
        &mut self,
        label: &'static str,
        run: impl FnOnce(&mut wgpu::ComputePass<'_>),
    ) -> Result<(), RenderError> {
        self.timed(label, |encoder, stamps| {
            let timestamp_writes =
                stamps.map(|(query_set, first)| wgpu::ComputePassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: Some(first),
                    end_of_pass_write_index: Some(first + 1),
                });
            run(
                &mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some(label),
                    timestamp_writes,
                }),
            );
        })
    }

    /// One pass that draws over all of what `into` holds, or over a part of it.
    pub(crate) fn render_pass(
        &mut self,
        label: &'static str,
        into: &wgpu::TextureView,
        run: impl FnOnce(&mut wgpu::RenderPass<'_>),
    ) -> Result<(), RenderError> {
        self.timed(label, |encoder, stamps| {
            let timestamp_writes =
                stamps.map(|(query_set, first)| wgpu::RenderPassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: Some(first),
                    end_of_pass_write_index: Some(first + 1),
                });
            run(&mut encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some(label),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: into,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Load,
                        store: wgpu::StoreOp::Store,
                    },
                })],
                timestamp_writes,
                ..wgpu::RenderPassDescriptor::default()
            }));
        })
    }

    /// Encodes one pass; the device's queries for it are those at the number given and at the next.
    fn timed(
        &mut self,
        label: &'static str,
        encode: impl FnOnce(&mut wgpu::CommandEncoder, Option<(&wgpu::QuerySet, u32)>),
    ) -> Result<(), RenderError> {
        let waits = self
            .times
            .as_ref()
            .is_some_and(|times| times.device.is_none());
        if waits {
            self.flush()?;
        }
        let number = self.labels.len() as u32;
        let clock = self.times.as_ref().and_then(|times| times.device.as_ref());
        let stamps = clock
            .filter(|_| number < MOST_PASSES)
            .map(|clock| (&clock.queries, 2 * number));
        if stamps.is_some() {
            self.labels.push(label);
        }
        let before = Instant::now();
        encode(&mut self.encoder, stamps);
        if waits {
            self.flush()?;
            let ms = before.elapsed().as_secs_f64() * 1e3;
            if let Some(times) = self.times {
                times.taken.push((label, ms));
            }
        }
        Ok(())
    }

    /// Submits what there is and waits for it.
    fn flush(&mut self) -> Result<(), RenderError> {
        let full = std::mem::replace(&mut self.encoder, encoder(self.gpu));
        self.gpu.queue.submit([full.finish()]);
        Ok(self.gpu.wait()?)
    }

    /// Submits everything.
    pub(crate) fn finish(self) -> Result<(), RenderError> {
        self.gpu.queue.submit([self.encoder.finish()]);
        let Some(times) = self.times else {
            return Ok(());
        };
        if let Some(clock) = &times.device
            && !self.labels.is_empty()
        {
            let ticks = clock.ticks(self.gpu, self.labels.len() as u32)?;
            for (label, pair) in self.labels.iter().zip(ticks.chunks_exact(2)) {
                let &[start, end] = pair else { continue };
                let ms = end.saturating_sub(start) as f64 * clock.ms_per_tick;
                times.taken.push((label, ms));
            }
        }
        Ok(())
    }
}

fn encoder(gpu: &Gpu) -> wgpu::CommandEncoder {
    gpu.device
        .create_command_encoder(&wgpu::CommandEncoderDescriptor {
            label: Some("passes"),
        })
}

/// Waits for the device and reads the first bytes of a buffer that can be mapped.
pub(crate) fn read_mapped<T: bytemuck::Pod>(
    gpu: &Gpu,
    buffer: &wgpu::Buffer,
    bytes: u64,
) -> Result<Vec<T>, RenderError> {
    if bytes == 0 {
        return Ok(Vec::new());
    }
    map(gpu, buffer, bytes, "counts of the mesh", |bytes| {
        bytemuck::pod_collect_to_vec(bytes)
    })
}
