//! Patch meshes on the GPU: one slot of a vertex buffer per tile and the data levels along its seams,
//! built when it is first drawn so. In: tiles with seams and lattices. Out: slots to draw. Least recently used slots are
//! taken again; a slot in use in this frame never is.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};

use geodesy::{Ellipsoid, Tile};
use glam::DVec3;
use terrain::{ElevationLayer, Patch, Vertex};

use crate::error::RenderError;
use crate::gpu::Gpu;

const VERTEX_BYTES: u64 = Vertex::BYTES as u64;

/// The base patch, and the meshes made from it.
#[derive(Debug)]
pub(crate) struct Meshes {
    patch: Patch,
    vertices: wgpu::Buffer,
    pub(crate) indices: wgpu::Buffer,
    /// First index and count of each of the 16 border variants.
    variants: [(u32, u32); 16],
    /// By all that a mesh's vertices depend on: two eyes may need one tile with different seams at once.
    slots: HashMap<MeshKey, Slot>,
    free: Vec<u32>,
    capacity: u32,
    /// Slots that were ever used: the lowest ones.
    used_slots: u32,
    vertices_scratch: Vec<Vertex>,
    bytes_scratch: Vec<u8>,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    slot: u32,
    used: u64,
}

/// What to draw for one tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MeshDraw {
    pub(crate) base_vertex: i32,
    pub(crate) first_index: u32,
    pub(crate) index_count: u32,
}

/// A tile, and a number that stands for all that its vertices depend on.
type MeshKey = (Tile, u64);

/// The leaf, what it shows, and how it meets its neighbours.
pub(crate) struct MeshRequest<'r, 'a> {
    pub(crate) tile: Tile,
    /// Which of the 16 border variants.
    pub(crate) variant: u8,
    /// The elevation layers, with their levels inside and along the border.
    pub(crate) layers: &'r [ElevationLayer<'a>],
    /// From normal and samples to a height in metres.
    pub(crate) fuse: &'r dyn Fn(DVec3, &[Option<i32>]) -> f64,
    /// Stands for whatever `fuse` depends on.
    pub(crate) content: u64,
}

impl MeshRequest<'_, '_> {
    fn key(&self) -> MeshKey {
        let mut hasher = DefaultHasher::new();
        self.content.hash(&mut hasher);
        for layer in self.layers {
            layer.levels.hash(&mut hasher);
        }
        (self.tile, hasher.finish())
    }
}

impl Meshes {
    /// Slots for patches of refinement level `refinement` within `budget_bytes`, at least 64.
    pub(crate) fn new(gpu: &Gpu, refinement: u8, budget_bytes: u64) -> Result<Self, RenderError> {
        let patch = Patch::new(refinement).map_err(|error| RenderError::Mesh(error.to_string()))?;
        let slot_bytes = patch.positions.len() as u64 * VERTEX_BYTES;
        let most = (gpu.device.limits().max_buffer_size / slot_bytes).min(8192);
        let capacity = (budget_bytes / slot_bytes).clamp(64, most.max(64)) as u32;
        let vertices = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("patch vertices"),
            size: u64::from(capacity) * slot_bytes,
            usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut all_indices: Vec<u16> = Vec::new();
        let mut variants = [(0, 0); 16];
        for (border, range) in variants.iter_mut().enumerate() {
            let indices = &patch.indices[border];
            *range = (all_indices.len() as u32, indices.len() as u32);
            all_indices.extend_from_slice(indices);
        }
        // Buffer copies move whole words.
        if all_indices.len() % 2 == 1 {
            all_indices.push(0);
        }
        let indices = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("patch indices"),
            size: size_of_val(all_indices.as_slice()) as u64,
            usage: wgpu::BufferUsages::INDEX | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        gpu.queue
            .write_buffer(&indices, 0, bytemuck::cast_slice(&all_indices));
        Ok(Self {
            patch,
            vertices,
            indices,
            variants,
            slots: HashMap::new(),
            free: (0..capacity).rev().collect(),
            capacity,
            used_slots: 0,
            vertices_scratch: Vec::new(),
            bytes_scratch: Vec::new(),
        })
    }

    /// Patches that can be drawn in one frame.
    pub(crate) fn capacity(&self) -> usize {
        self.capacity as usize
    }

    /// True where the mesh is there in this form. Does not count as use.
    pub(crate) fn holds(&self, request: &MeshRequest<'_, '_>) -> bool {
        self.slots.contains_key(&request.key())
    }

    /// The mesh of a tile, built and uploaded where it is not there in this form. The flag tells whether
    /// it was. `None` when every slot is in use in this frame, or data that the seams name is not in
    /// memory any more; the next frame asks for it again.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        ellipsoid: &Ellipsoid,
        request: &MeshRequest<'_, '_>,
        frame: u64,
    ) -> Option<(MeshDraw, bool)> {
        let key = request.key();
        if let Some(known) = self.slots.get_mut(&key) {
            known.used = frame;
            let slot = known.slot;
            return Some((self.draw(slot, request.variant), false));
        }
        let mut vertices = std::mem::take(&mut self.vertices_scratch);
        vertices.clear();
        let built = terrain::build(
            ellipsoid,
            request.tile,
            request.layers,
            &self.patch,
            request.fuse,
            &mut vertices,
        );
        let slot = match built {
            Ok(_) => self.slot_for(key, frame),
            Err(error) => {
                tracing::warn!(%error, "a mesh waits for its elevation");
                None
            }
        };
        if let Some(slot) = slot {
            self.bytes_scratch.clear();
            self.bytes_scratch
                .extend(vertices.iter().flat_map(Vertex::to_bytes));
            let offset = u64::from(slot) * self.patch.positions.len() as u64 * VERTEX_BYTES;
            gpu.queue
                .write_buffer(&self.vertices, offset, &self.bytes_scratch);
        }
        self.vertices_scratch = vertices;
        slot.map(|slot| (self.draw(slot, request.variant), true))
    }

    fn slot_for(&mut self, key: MeshKey, frame: u64) -> Option<u32> {
        let slot = self.free.pop().or_else(|| self.evict(frame))?;
        self.used_slots = self.used_slots.max(slot + 1);
        self.slots.insert(key, Slot { slot, used: frame });
        Some(slot)
    }

    /// The part of the vertex buffer that was ever written. No more is bound, because what is bound must
    /// be cleared first.
    pub(crate) fn written(&self) -> wgpu::BufferSlice<'_> {
        let slot_bytes = self.patch.positions.len() as u64 * VERTEX_BYTES;
        self.vertices
            .slice(..u64::from(self.used_slots.max(1)) * slot_bytes)
    }

    fn draw(&self, slot: u32, variant: u8) -> MeshDraw {
        let (first_index, index_count) = self.variants[usize::from(variant & 15)];
        MeshDraw {
            base_vertex: (slot as usize * self.patch.positions.len()) as i32,
            first_index,
            index_count,
        }
    }

    fn evict(&mut self, frame: u64) -> Option<u32> {
        let oldest = self
            .slots
            .iter()
            .filter(|(_, slot)| slot.used < frame)
            .min_by_key(|(key, slot)| (slot.used, **key))
            .map(|(key, _)| *key)?;
        self.slots.remove(&oldest).map(|slot| slot.slot)
    }
}
