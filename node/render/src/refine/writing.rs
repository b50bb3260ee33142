//! Meshes out of marks: the list of their vertices, then vertices, indices and arguments.
//! In: what was marked and counted, where meshes are to lie. Out: passes that write the caller's buffers. It waits for
//! nothing unless passes are timed.

use std::num::NonZeroU64;
use std::ops::Range;

use shaders::{Emission, EmitLeaf};

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::recorder::{PassTimes, Recorder};
use crate::refine::buffers::GeometryBuffers;
use crate::refine::marking::Marking;
use crate::refine::missing;
use crate::refine::pipelines::{COMPACT, EMIT, Pipelines};
use crate::scratch::{Growing, bind};

/// Bytes of an entry of the list of vertices.
const ENTRY_BYTES: u64 = 8;
/// Meshes that entries of the list have bits for.
const MOST_MESHES: usize = 1 << 14;
/// Vertices and indices at which what is bound of their buffers may begin: both are multiples of 256 bytes, more than
/// any device asks for.
const WINDOW_STEP: u32 = 64;
const VERTEX_BYTES: u64 = terrain::Vertex::BYTES as u64;
const INDEX_BYTES: u64 = 4;
const ARGUMENT_BYTES: u64 = 20;
/// Invocations of a workgroup, and workgroups along the first axis of a dispatch.
const LANES: u64 = 64;
const ROW: u64 = 32_768;

/// What writing needs beside marks.
#[derive(Debug)]
pub(super) struct Writing {
    emissions: Growing,
    entries: Growing,
}

/// Where meshes go.
pub(super) struct Targets<'a> {
    pub(super) vertices: &'a wgpu::Buffer,
    pub(super) indices: &'a wgpu::Buffer,
    pub(super) arguments: &'a wgpu::Buffer,
}

impl Writing {
    pub(super) fn new() -> Self {
        let storage = wgpu::BufferUsages::STORAGE;
        Self {
            emissions: Growing::new("meshes to write", storage),
            entries: Growing::new("vertices to write", storage),
        }
    }

    #[expect(
        clippy::too_many_arguments,
        reason = "what is read and what is written"
    )]
    pub(super) fn run(
        &mut self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        geometry: &GeometryBuffers,
        marking: &Marking,
        emits: &[EmitLeaf],
        targets: &Targets<'_>,
        times: &mut Option<PassTimes>,
    ) -> Result<(), RenderError> {
        let extents = extents(geometry, marking, emits, targets)?;
        let bound = gpu.device.limits().max_storage_buffer_binding_size;
        for (meshes, window) in windows(&extents, bound) {
            let Some(entries) = self.prepare(gpu, meshes, &window) else {
                continue;
            };
            let mut recorder = Recorder::new(gpu, times);
            let compact = pipelines.get(gpu, COMPACT)?;
            let resources = [
                self.emissions.binding(),
                marking.summed.binding(),
                self.entries.binding(),
                Some(targets.arguments.as_entire_binding()),
            ];
            let bindings = bind(gpu, compact, resources).ok_or_else(missing)?;
            recorder.pass("compact", |pass| {
                pass.set_pipeline(compact);
                pass.set_bind_group(0, &bindings, &[]);
                let words = (terrain::MARK_WORDS as u64).div_ceil(LANES) as u32;
                pass.dispatch_workgroups(words, meshes.len() as u32, 1);
            })?;
            let emit = pipelines.get(gpu, EMIT)?;
            let resources = [
                self.emissions.binding(),
                self.entries.binding(),
                marking.summed.binding(),
                geometry.heights(),
                geometry.borders(),
                geometry.blocks(),
                part(targets.vertices, &window.vertices, VERTEX_BYTES),
                part(targets.indices, &window.indices, INDEX_BYTES),
            ];
            let bindings = bind(gpu, emit, resources).ok_or_else(missing)?;
            recorder.pass("emit", |pass| {
                pass.set_pipeline(emit);
                pass.set_bind_group(0, &bindings, &[]);
                let groups = u64::from(entries).div_ceil(LANES);
                let rows = groups.div_ceil(ROW);
                pass.dispatch_workgroups(groups.min(ROW) as u32, rows as u32, 1);
            })?;
            recorder.finish()?;
        }
        Ok(())
    }

    /// Writes the records of meshes, and makes room for their list; its length. `None` for nothing to do.
    fn prepare(&mut self, gpu: &Gpu, meshes: &[Extent], window: &Window) -> Option<u32> {
        let mut emissions = Vec::with_capacity(meshes.len());
        let mut entries = 0_u32;
        for mesh in meshes {
            let leaf = &mesh.leaf;
            emissions.push(Emission {
                place: leaf.place,
                geometry: leaf.geometry,
                first_vertex: leaf.first_vertex,
                first_index: leaf.first_index,
                unit_m: leaf.unit_m,
                argument: leaf.argument,
                record: leaf.record,
                first_entry: entries,
                vertices: mesh.vertices,
                triangles: mesh.triangles,
                entries: 0,
                window_vertex: window.vertices.start,
                window_index: window.indices.start,
            });
            entries = entries.saturating_add(mesh.vertices);
        }
        if entries == 0 {
            return None;
        }
        for emission in &mut emissions {
            emission.entries = entries;
        }
        self.emissions.write(gpu, &emissions);
        self.entries.reserve(gpu, u64::from(entries) * ENTRY_BYTES);
        Some(entries)
    }
}

/// A mesh to be written, and how large it is.
#[derive(Clone, Copy, Debug)]
struct Extent {
    leaf: EmitLeaf,
    vertices: u32,
    triangles: u32,
}

impl Extent {
    fn vertices(&self) -> Range<u32> {
        self.leaf.first_vertex..self.leaf.first_vertex.saturating_add(self.vertices)
    }

    fn indices(&self) -> Range<u32> {
        let indices = self.triangles.saturating_mul(3);
        self.leaf.first_index..self.leaf.first_index.saturating_add(indices)
    }
}

/// What is bound of the buffers of vertices and of indices, counted in them.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Window {
    vertices: Range<u32>,
    indices: Range<u32>,
}

impl Window {
    fn of(mesh: &Extent) -> Self {
        let from_step = |range: Range<u32>| range.start - range.start % WINDOW_STEP..range.end;
        Self {
            vertices: from_step(mesh.vertices()),
            indices: from_step(mesh.indices()),
        }
    }

    fn joined(&self, other: &Self) -> Self {
        let join = |a: &Range<u32>, b: &Range<u32>| a.start.min(b.start)..a.end.max(b.end);
        Self {
            vertices: join(&self.vertices, &other.vertices),
            indices: join(&self.indices, &other.indices),
        }
    }

    fn fits(&self, bytes: u64) -> bool {
        self.vertices.len() as u64 * VERTEX_BYTES <= bytes
            && self.indices.len() as u64 * INDEX_BYTES <= bytes
    }
}

/// Meshes in groups that lie side by side, so that what is bound of the buffers for one group is at most this large: a
/// device binds less than it has.
fn windows(meshes: &[Extent], bytes: u64) -> Vec<(&[Extent], Window)> {
    let mut groups = Vec::new();
    let mut begin = 0;
    let mut window: Option<Window> = None;
    for (index, mesh) in meshes.iter().enumerate() {
        let own = Window::of(mesh);
        let joined = window
            .as_ref()
            .map_or_else(|| own.clone(), |window| window.joined(&own));
        if joined.fits(bytes) && index - begin < MOST_MESHES {
            window = Some(joined);
            continue;
        }
        groups.extend(window.replace(own).zip(meshes.get(begin..index)));
        begin = index;
    }
    groups.extend(window.zip(meshes.get(begin..)));
    groups
        .into_iter()
        .map(|(window, meshes)| (meshes, window))
        .collect()
}

/// Meshes in the order in which they lie in the vertex buffer. Refuses what lies beyond a buffer.
fn extents(
    geometry: &GeometryBuffers,
    marking: &Marking,
    emits: &[EmitLeaf],
    targets: &Targets<'_>,
) -> Result<Vec<Extent>, RenderError> {
    let mut extents = Vec::with_capacity(emits.len());
    for leaf in emits {
        let Some(count) = marking.counted.get(leaf.place as usize) else {
            return Err(RenderError::Mesh(format!(
                "a mesh of leaf {} of {} that were marked",
                leaf.place,
                marking.counted.len()
            )));
        };
        let ends = [
            (u64::from(leaf.first_vertex) + u64::from(count.vertices)) * VERTEX_BYTES,
            (u64::from(leaf.first_index) + 3 * u64::from(count.triangles)) * INDEX_BYTES,
            (u64::from(leaf.argument) + 1) * ARGUMENT_BYTES,
        ];
        let sizes = [targets.vertices, targets.indices, targets.arguments].map(wgpu::Buffer::size);
        let fits = ends.iter().zip(sizes).all(|(end, size)| *end <= size);
        if !fits || leaf.geometry >= geometry.in_use() {
            return Err(RenderError::Mesh(format!(
                "a mesh of {} vertices and {} triangles lies beyond its buffers",
                count.vertices, count.triangles
            )));
        }
        extents.push(Extent {
            leaf: *leaf,
            vertices: count.vertices,
            triangles: count.triangles,
        });
    }
    extents.sort_by_key(|mesh| mesh.leaf.first_vertex);
    Ok(extents)
}

/// A part of a buffer of elements of this many bytes.
fn part<'a>(
    buffer: &'a wgpu::Buffer,
    range: &Range<u32>,
    element_bytes: u64,
) -> Option<wgpu::BindingResource<'a>> {
    Some(wgpu::BindingResource::Buffer(wgpu::BufferBinding {
        buffer,
        offset: u64::from(range.start) * element_bytes,
        size: Some(NonZeroU64::new(range.len() as u64 * element_bytes)?),
    }))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;

    fn mesh(first_vertex: u32, vertices: u32, first_index: u32, triangles: u32) -> Extent {
        let leaf = EmitLeaf {
            place: 0,
            geometry: 0,
            first_vertex,
            first_index,
            unit_m: 1.0,
            argument: 0,
            record: 0,
            padding: 0,
        };
        Extent {
            leaf,
            vertices,
            triangles,
        }
    }

    #[test]
    fn windows_hold_all_meshes_once_and_are_no_larger_than_asked() {
        let mut state = 5_u32;
        let mut random = move |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        for _ in 0..200 {
            let mut first_vertex = 0;
            let meshes: Vec<Extent> = (0..random(40))
                .map(|_| {
                    first_vertex += random(3000);
                    let vertices = 1 + random(2000);
                    let mesh = mesh(first_vertex, vertices, random(40_000), 1 + random(4000));
                    first_vertex += vertices;
                    mesh
                })
                .collect();
            let bytes = 200_000;
            let groups = windows(&meshes, bytes);
            let held: usize = groups.iter().map(|(meshes, _)| meshes.len()).sum();
            assert_eq!(held, meshes.len());
            for (meshes, window) in &groups {
                assert!(window.fits(bytes) && !meshes.is_empty());
                assert_eq!(
                    (
                        window.vertices.start % WINDOW_STEP,
                        window.indices.start % WINDOW_STEP
                    ),
                    (0, 0)
                );
                for mesh in *meshes {
                    let own = Window::of(mesh);
                    assert_eq!(window.joined(&own), *window);
                }
            }
            let first = meshes.iter().map(|mesh| mesh.leaf.first_vertex);
            let grouped = groups.iter().flat_map(|(meshes, _)| *meshes);
            assert!(first.eq(grouped.map(|mesh| mesh.leaf.first_vertex)));
        }
    }

    #[test]
    fn meshes_side_by_side_are_one_group_while_they_fit() {
        let meshes = [
            mesh(0, 100, 0, 100),
            mesh(100, 100, 300, 100),
            mesh(200, 100, 600, 100),
        ];
        assert_eq!(windows(&meshes, 300 * VERTEX_BYTES).len(), 1);
        assert_eq!(windows(&meshes, 299 * VERTEX_BYTES).len(), 2);
        assert_eq!(windows(&[], 1).len(), 0);
    }
}
