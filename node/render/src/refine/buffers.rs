//! The geometries of leaves on the GPU, a slot each: heights, error pyramids, border vertices, anchors.
//! In: how many slots. Out: buffers that stages bind whole. Who holds which slot is not known here.

use std::num::NonZeroU64;

use crate::gpu::Gpu;

/// Words of one slot in each buffer.
const HEIGHT_WORDS: u64 = terrain::LATTICE_NODES as u64;
const BORDER_WORDS: u64 = (terrain::BORDER_NODES * terrain::BORDER_WORDS) as u64;
const ANCHOR_WORDS: u64 = (terrain::BLOCKS * terrain::ANCHOR_WORDS) as u64;

/// Slots that are taken into use together.
const SLOTS_AT_ONCE: u32 = 32;

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
    /// How many of them are bound.
    used: u32,
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
            used: SLOTS_AT_ONCE.min(slots.max(1)),
        }
    }

    /// Slots from now on reach this far. No more is bound, because what is bound must be cleared first.
    pub(crate) fn use_up_to(&mut self, slots: u32) {
        let used = slots.next_multiple_of(SLOTS_AT_ONCE).min(self.slots);
        self.used = self.used.max(used);
    }

    /// Slots in use.
    pub(crate) const fn in_use(&self) -> u32 {
        self.used
    }

    /// Heights of all slots in use.
    pub(crate) fn heights(&self) -> Option<wgpu::BindingResource<'_>> {
        self.part(&self.heights, HEIGHT_WORDS)
    }

    /// Errors of all slots in use.
    pub(crate) fn errors(&self) -> Option<wgpu::BindingResource<'_>> {
        self.part(&self.errors, HEIGHT_WORDS)
    }

    /// Borders of all slots in use.
    pub(crate) fn borders(&self) -> Option<wgpu::BindingResource<'_>> {
        self.part(&self.borders, BORDER_WORDS)
    }

    /// Anchors of all slots in use.
    pub(crate) fn blocks(&self) -> Option<wgpu::BindingResource<'_>> {
        self.part(&self.blocks, ANCHOR_WORDS)
    }

    fn part<'a>(&self, buffer: &'a wgpu::Buffer, words: u64) -> Option<wgpu::BindingResource<'a>> {
        Some(wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer,
            offset: 0,
            size: NonZeroU64::new(words * 4 * u64::from(self.used)),
        }))
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
