//! Buffers that grow with what is asked of them and are used again.
//! In: sizes, contents. Out: buffers at least that large, and bindings of exactly that much. What was in a buffer that
//! grows is lost.

use std::num::NonZeroU64;

use crate::gpu::Gpu;

/// One buffer, made when it is first needed.
#[derive(Debug)]
pub(crate) struct Growing {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: Option<wgpu::Buffer>,
    /// Bytes in use.
    bytes: u64,
}

impl Growing {
    pub(crate) const fn new(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self {
            label,
            usage: usage
                .union(wgpu::BufferUsages::COPY_DST)
                .union(wgpu::BufferUsages::COPY_SRC),
            buffer: None,
            bytes: 0,
        }
    }

    /// For what is read back.
    pub(crate) const fn staging(label: &'static str) -> Self {
        Self {
            label,
            usage: wgpu::BufferUsages::MAP_READ.union(wgpu::BufferUsages::COPY_DST),
            buffer: None,
            bytes: 0,
        }
    }

    /// A buffer with room for this much, half as much again where it must grow.
    pub(crate) fn reserve(&mut self, gpu: &Gpu, bytes: u64) -> &wgpu::Buffer {
        self.bytes = bytes.next_multiple_of(4).max(16);
        let needed = self.bytes;
        if self
            .buffer
            .as_ref()
            .is_some_and(|buffer| buffer.size() < needed)
        {
            self.buffer = None;
        }
        self.buffer.get_or_insert_with(|| {
            let limit = gpu.device.limits().max_buffer_size;
            let ample = (needed + needed / 2).next_multiple_of(4).min(limit);
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(self.label),
                size: ample.max(needed),
                usage: self.usage,
                mapped_at_creation: false,
            })
        })
    }

    /// Makes room for these and writes them.
    pub(crate) fn write<T: bytemuck::Pod>(&mut self, gpu: &Gpu, contents: &[T]) {
        let contents: &[u8] = bytemuck::cast_slice(contents);
        let buffer = self.reserve(gpu, contents.len() as u64);
        if !contents.is_empty() {
            gpu.queue.write_buffer(buffer, 0, contents);
        }
    }

    /// The buffer, if anything was ever asked of it.
    pub(crate) fn buffer(&self) -> Option<&wgpu::Buffer> {
        self.buffer.as_ref()
    }

    /// Bytes in use.
    pub(crate) const fn bytes(&self) -> u64 {
        self.bytes
    }

    /// What is in use of it.
    pub(crate) fn binding(&self) -> Option<wgpu::BindingResource<'_>> {
        Some(wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: self.buffer.as_ref()?,
            offset: 0,
            size: NonZeroU64::new(self.bytes),
        }))
    }

    /// One of many equal parts of it that lie `stride` bytes apart.
    pub(crate) fn part(
        &self,
        number: u64,
        stride: u64,
        bytes: u64,
    ) -> Option<wgpu::BindingResource<'_>> {
        Some(wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: self.buffer.as_ref()?,
            offset: number * stride,
            size: NonZeroU64::new(bytes),
        }))
    }
}

/// Uniforms side by side, each where a binding may begin.
pub(crate) fn write_uniforms<T: bytemuck::Pod>(
    gpu: &Gpu,
    into: &mut Growing,
    uniforms: &[T],
) -> u64 {
    let alignment = u64::from(gpu.device.limits().min_uniform_buffer_offset_alignment);
    let size = size_of::<T>() as u64;
    let stride = size.next_multiple_of(alignment.max(16));
    let mut bytes = Vec::with_capacity(uniforms.len() * stride as usize);
    for uniform in uniforms {
        bytes.extend_from_slice(bytemuck::bytes_of(uniform));
        bytes.resize(bytes.len().next_multiple_of(stride as usize), 0);
    }
    into.write(gpu, &bytes);
    stride
}

/// A bind group of these resources, numbered from 0. `None` where one of them does not exist.
pub(crate) fn bind<const N: usize>(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    resources: [Option<wgpu::BindingResource<'_>>; N],
) -> Option<wgpu::BindGroup> {
    let mut entries = Vec::with_capacity(N);
    for (binding, resource) in (0..).zip(resources) {
        entries.push(wgpu::BindGroupEntry {
            binding,
            resource: resource?,
        });
    }
    Some(gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("refine"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    }))
}
