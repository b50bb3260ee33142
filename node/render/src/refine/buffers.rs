//! The geometries of leaves on the GPU, a slot each: heights, error pyramids, border vertices, anchors.
//! In: how many slots. Out: buffers that stages bind whole. Who holds which slot is not known here.

use crate::gpu::Gpu;

/// Words of one slot in each buffer.
const HEIGHT_WORDS: u64 = terrain::LATTICE_NODES as u64;
const BORDER_WORDS: u64 = (terrain::BORDER_NODES * terrain::BORDER_WORDS) as u64;
const ANCHOR_WORDS: u64 = (terrain::BLOCKS * terrain::ANCHOR_WORDS) as u64;

/// Slots of geometries.
#[derive(Debug)]
pub(crate) struct GeometryBuffers {
    /// Heights of 257² nodes in units, i32.
    pub(crate) heights: wgpu::Buffer,
    /// Codes of the two sides' errors of 257² nodes.
    pub(crate) errors: wgpu::Buffer,
    /// Ten words for each of 1024 border nodes.
    pub(crate) borders: wgpu::Buffer,
    /// The anchors of 256 blocks.
    pub(crate) blocks: wgpu::Buffer,
    /// How many slots there are.
    pub(crate) slots: u32,
}

fn buffer(gpu: &Gpu, label: &str, words: u64, slots: u32) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: words * 4 * u64::from(slots.max(1)),
        usage: wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_SRC
            | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

impl GeometryBuffers {
    /// Bytes of one slot in all buffers together.
    pub(crate) const fn bytes_per_slot() -> u64 {
        (2 * HEIGHT_WORDS + BORDER_WORDS + ANCHOR_WORDS) * 4
    }

    /// Empty slots.
    pub(crate) fn new(gpu: &Gpu, slots: u32) -> Self {
        Self {
            heights: buffer(gpu, "leaf heights", HEIGHT_WORDS, slots),
            errors: buffer(gpu, "error pyramids", HEIGHT_WORDS, slots),
            borders: buffer(gpu, "leaf borders", BORDER_WORDS, slots),
            blocks: buffer(gpu, "leaf anchors", ANCHOR_WORDS, slots),
            slots,
        }
    }

    /// As many slots as asked for, the first of them with what these have.
    pub(crate) fn grown(&self, gpu: &Gpu, slots: u32) -> Self {
        let grown = Self::new(gpu, slots);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor {
                label: Some("geometries grow"),
            });
        for (old, new) in [
            (&self.heights, &grown.heights),
            (&self.errors, &grown.errors),
            (&self.borders, &grown.borders),
            (&self.blocks, &grown.blocks),
        ] {
            encoder.copy_buffer_to_buffer(old, 0, new, 0, old.size().min(new.size()));
        }
        gpu.queue.submit([encoder.finish()]);
        grown
    }

    /// Writes a slot's border vertices and anchors. Words beyond a slot's are not written, nor is a slot that does not
    /// exist: making its heights is refused.
    pub(crate) fn write_border(&self, gpu: &Gpu, slot: u32, border: &[u32], anchors: &[u32]) {
        if slot >= self.slots {
            return;
        }
        for (buffer, words, size) in [
            (&self.borders, border, BORDER_WORDS),
            (&self.blocks, anchors, ANCHOR_WORDS),
        ] {
            let words = words.get(..size as usize).unwrap_or(words);
            let offset = u64::from(slot) * size * 4;
            gpu.queue
                .write_buffer(buffer, offset, bytemuck::cast_slice(words));
        }
    }
}
