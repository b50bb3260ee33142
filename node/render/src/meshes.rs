//! Meshes of leaves on the GPU: spans of one vertex buffer and one index buffer, and the arguments that draw them.
//! In: how much room a mesh needs. Out: where it is to be written and how it is drawn. A mesh in use in this frame never
//! makes room for another; of the others the one unused for longest does. It neither makes nor reads geometry.

use std::collections::HashMap;

use geodesy::Tile;
use terrain::Vertex;

use crate::gpu::Gpu;
use crate::spans::Spans;

const VERTEX_BYTES: u64 = Vertex::BYTES as u64;
const INDEX_BYTES: u64 = 4;
/// Words of the arguments of an indexed indirect draw.
pub(crate) const ARGUMENT_WORDS: u64 = 5;
/// Vertices that there is room for to begin with; three indices to a triangle, two triangles to a vertex.
const FIRST_VERTICES: u32 = 1 << 16;
const INDICES_PER_VERTEX: u32 = 6;
/// Meshes that there is room for to begin with.
const FIRST_MESHES: u32 = 256;

/// A tile, and a number that stands for all that its mesh depends on.
pub(crate) type MeshKey = (Tile, u64);

/// How one mesh is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MeshDraw {
    /// Which arguments draw it. The tile's record has the same number.
    pub(crate) argument: u32,
    /// Changes with what the arguments draw.
    pub(crate) serial: u64,
    pub(crate) triangles: u32,
}

/// Where one mesh lies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mesh {
    pub(crate) first_vertex: u32,
    pub(crate) vertices: u32,
    pub(crate) first_index: u32,
    pub(crate) indices: u32,
    argument: u32,
    serial: u64,
    used: u64,
}

impl Mesh {
    pub(crate) fn draw(&self) -> MeshDraw {
        MeshDraw {
            argument: self.argument,
            serial: self.serial,
            triangles: self.indices / 3,
        }
    }
}

/// All meshes.
#[derive(Debug)]
pub(crate) struct Meshes {
    pub(crate) vertices: wgpu::Buffer,
    pub(crate) indices: wgpu::Buffer,
    pub(crate) arguments: wgpu::Buffer,
    vertex_spans: Spans,
    index_spans: Spans,
    argument_spans: Spans,
    most_vertices: u32,
    known: HashMap<MeshKey, Mesh>,
    serial: u64,
}

impl Meshes {
    /// Room for meshes within `budget_bytes`, but for at least one leaf's whole lattice.
    pub(crate) fn new(gpu: &Gpu, budget_bytes: u64) -> Self {
        let per_vertex = VERTEX_BYTES + INDEX_BYTES * u64::from(INDICES_PER_VERTEX);
        let limit = gpu.device.limits().max_buffer_size / VERTEX_BYTES;
        let most = (budget_bytes / per_vertex).min(limit);
        let most_vertices = u32::try_from(most)
            .unwrap_or(u32::MAX)
            .max(2 * FIRST_VERTICES);
        Self {
            vertices: vertex_buffer(gpu, FIRST_VERTICES),
            indices: index_buffer(gpu, FIRST_VERTICES * INDICES_PER_VERTEX),
            arguments: argument_buffer(gpu, FIRST_MESHES),
            vertex_spans: Spans::new(FIRST_VERTICES),
            index_spans: Spans::new(FIRST_VERTICES * INDICES_PER_VERTEX),
            argument_spans: Spans::new(FIRST_MESHES),
            most_vertices,
            known: HashMap::new(),
            serial: 0,
        }
    }

    /// Triangles that fit if nothing else is there.
    pub(crate) fn most_triangles(&self) -> u32 {
        self.most_vertices.saturating_mul(INDICES_PER_VERTEX / 3)
    }

    /// The mesh, which counts as used in this frame.
    pub(crate) fn get(&mut self, key: MeshKey, frame: u64) -> Option<Mesh> {
        let mesh = self.known.get_mut(&key)?;
        mesh.used = frame;
        Some(*mesh)
    }

    /// Room for a new mesh, to be written by the caller. `None` where even without all meshes that are not in use in
    /// this frame there is none.
    pub(crate) fn lend(
        &mut self,
        gpu: &Gpu,
        key: MeshKey,
        vertices: u32,
        triangles: u32,
        frame: u64,
    ) -> Option<Mesh> {
        self.forget(key);
        let indices = triangles.checked_mul(3)?;
        let first_vertex = self.room(gpu, vertices, frame, Room::Vertices)?;
        let Some(first_index) = self.room(gpu, indices, frame, Room::Indices) else {
            self.vertex_spans.take_back(first_vertex, vertices);
            return None;
        };
        let Some(argument) = self.room(gpu, 1, frame, Room::Arguments) else {
            self.vertex_spans.take_back(first_vertex, vertices);
            self.index_spans.take_back(first_index, indices);
            return None;
        };
        self.serial += 1;
        let mesh = Mesh {
            first_vertex,
            vertices,
            first_index,
            indices,
            argument,
            serial: self.serial,
            used: frame,
        };
        self.known.insert(key, mesh);
        Some(mesh)
    }

    /// Forgets all meshes.
    pub(crate) fn clear(&mut self) {
        let keys: Vec<MeshKey> = self.known.keys().copied().collect();
        for key in keys {
            self.forget(key);
        }
    }

    /// Forgets a mesh.
    pub(crate) fn forget(&mut self, key: MeshKey) {
        if let Some(mesh) = self.known.remove(&key) {
            self.vertex_spans
                .take_back(mesh.first_vertex, mesh.vertices);
            self.index_spans.take_back(mesh.first_index, mesh.indices);
            self.argument_spans.take_back(mesh.argument, 1);
        }
    }

    fn spans(&mut self, room: Room) -> &mut Spans {
        match room {
            Room::Vertices => &mut self.vertex_spans,
            Room::Indices => &mut self.index_spans,
            Room::Arguments => &mut self.argument_spans,
        }
    }

    /// A span: a free one, else of a buffer made larger, else of the meshes unused for longest.
    fn room(&mut self, gpu: &Gpu, length: u32, frame: u64, room: Room) -> Option<u32> {
        loop {
            if let Some(start) = self.spans(room).lend(length) {
                return Some(start);
            }
            if !self.grow(gpu, room) && !self.evict(frame) {
                return None;
            }
        }
    }

    /// Doubles a buffer within the budget. What is in it stays. False where it is as large as it may be.
    fn grow(&mut self, gpu: &Gpu, room: Room) -> bool {
        let most = match room {
            Room::Vertices => self.most_vertices,
            Room::Indices => self.most_vertices.saturating_mul(INDICES_PER_VERTEX),
            Room::Arguments => 1 << 16,
        };
        let capacity = self.spans(room).capacity();
        let grown = capacity.saturating_mul(2).min(most);
        if grown <= capacity {
            return false;
        }
        let (old, new) = match room {
            Room::Vertices => (&mut self.vertices, vertex_buffer(gpu, grown)),
            Room::Indices => (&mut self.indices, index_buffer(gpu, grown)),
            Room::Arguments => (&mut self.arguments, argument_buffer(gpu, grown)),
        };
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor {
                label: Some("meshes grow"),
            });
        encoder.copy_buffer_to_buffer(old, 0, &new, 0, old.size());
        gpu.queue.submit([encoder.finish()]);
        *old = new;
        self.spans(room).grow(grown);
        true
    }

    /// Gives up the mesh unused for longest; false where all are in use.
    fn evict(&mut self, frame: u64) -> bool {
        let oldest = self
            .known
            .iter()
            .filter(|(_, mesh)| mesh.used < frame)
            .min_by_key(|(key, mesh)| (mesh.used, **key))
            .map(|(key, _)| *key);
        oldest.inspect(|key| self.forget(*key)).is_some()
    }
}

#[derive(Clone, Copy)]
enum Room {
    Vertices,
    Indices,
    Arguments,
}

fn buffer(gpu: &Gpu, label: &'static str, bytes: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes,
        usage: usage
            | wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_SRC
            | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn vertex_buffer(gpu: &Gpu, vertices: u32) -> wgpu::Buffer {
    let bytes = u64::from(vertices) * VERTEX_BYTES;
    buffer(gpu, "mesh vertices", bytes, wgpu::BufferUsages::VERTEX)
}

fn index_buffer(gpu: &Gpu, indices: u32) -> wgpu::Buffer {
    let bytes = u64::from(indices) * INDEX_BYTES;
    buffer(gpu, "mesh indices", bytes, wgpu::BufferUsages::INDEX)
}

fn argument_buffer(gpu: &Gpu, meshes: u32) -> wgpu::Buffer {
    let bytes = u64::from(meshes) * ARGUMENT_WORDS * 4;
    buffer(gpu, "draw arguments", bytes, wgpu::BufferUsages::INDIRECT)
}
