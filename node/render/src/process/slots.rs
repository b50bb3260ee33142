//! The GPU's memory of processing results: slots of 275×275 words, each known by what it holds.
//! In: contents that are wanted, numbers of runs. Out: textures to read and to write. Within a byte budget the result
//! unused for longest makes room; what the present run uses stays. It does not know how results are made.

use std::collections::{BTreeSet, HashMap};

use geodesy::Tile;

use crate::gpu::Gpu;

/// Nodes along a side of a slot: a tile's 257 and nine border nodes at each end.
pub(crate) const SLOT_SIDE: u32 = geodesy::STORED_NODES as u32;
/// Bytes of a slot.
pub(crate) const SLOT_BYTES: u64 = SLOT_SIDE as u64 * SLOT_SIDE as u64 * 4;

/// What a result is: the tile, and a number that stands for data, stages and parameters together.
pub(crate) type ResultKey = (Tile, u64);

/// One texture of words.
#[derive(Debug)]
pub(crate) struct Slot {
    pub(crate) texture: wgpu::Texture,
    pub(crate) view: wgpu::TextureView,
    used: u64,
}

impl Slot {
    /// Fills the slot with 275×275 words.
    pub(crate) fn write(&self, gpu: &Gpu, words: &[u32]) {
        gpu.queue.write_texture(
            self.texture.as_image_copy(),
            bytemuck::cast_slice(words),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(SLOT_SIDE * 4),
                rows_per_image: Some(SLOT_SIDE),
            },
            self.texture.size(),
        );
    }
}

/// All slots, lent to results.
#[derive(Debug)]
pub(crate) struct Slots {
    lent: HashMap<ResultKey, Slot>,
    /// The same results, those unused for longest first.
    order: BTreeSet<(u64, ResultKey)>,
    most: usize,
}

impl Slots {
    /// As many slots as the budget holds, at least 64.
    pub(crate) fn new(budget_bytes: u64) -> Self {
        Self {
            lent: HashMap::new(),
            order: BTreeSet::new(),
            most: (budget_bytes / SLOT_BYTES).clamp(64, 1 << 20) as usize,
        }
    }

    /// The slot of a result, which counts as used in this run.
    pub(crate) fn get(&mut self, key: ResultKey, run: u64) -> Option<&Slot> {
        let slot = self.lent.get_mut(&key)?;
        if slot.used != run {
            self.order.remove(&(slot.used, key));
            self.order.insert((run, key));
            slot.used = run;
        }
        Some(slot)
    }

    /// The slot of a result. Does not count as use.
    pub(crate) fn peek(&self, key: ResultKey) -> Option<&Slot> {
        self.lent.get(&key)
    }

    /// True where the result is there. Does not count as use.
    pub(crate) fn holds(&self, key: ResultKey) -> bool {
        self.lent.contains_key(&key)
    }

    /// Lends a slot to a result that has none, for the caller to fill. A tile's own chain of stages must fit
    /// whatever the budget says, so slots in use in this run are never taken; beyond the budget a new one is made
    /// only while all are in use, and given up again as soon as they are not.
    pub(crate) fn lend(&mut self, gpu: &Gpu, key: ResultKey, run: u64) {
        let recycled = if self.lent.len() < self.most {
            None
        } else {
            self.take_oldest(run)
        };
        let mut slot = recycled.unwrap_or_else(|| new_slot(gpu));
        slot.used = run;
        self.forget(key);
        self.order.insert((run, key));
        self.lent.insert(key, slot);
        while self.lent.len() > self.most && self.take_oldest(run).is_some() {}
    }

    /// Takes the slot unused for longest, unless this run uses it.
    fn take_oldest(&mut self, run: u64) -> Option<Slot> {
        let (used, key) = *self.order.first()?;
        if used >= run {
            return None;
        }
        self.order.remove(&(used, key));
        self.lent.remove(&key)
    }

    /// Forgets a result that could not be made.
    pub(crate) fn forget(&mut self, key: ResultKey) {
        if let Some(slot) = self.lent.remove(&key) {
            self.order.remove(&(slot.used, key));
        }
    }
}

fn new_slot(gpu: &Gpu) -> Slot {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("slot"),
        size: wgpu::Extent3d {
            width: SLOT_SIDE,
            height: SLOT_SIDE,
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::R32Uint,
        usage: wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    Slot {
        texture,
        view,
        used: 0,
    }
}
