//! Meshes out of marks: the list of their vertices, then vertices, indices and arguments.
//! In: what was marked and counted, where meshes are to lie. Out: passes that write the caller's buffers. It waits for
//! nothing unless passes are timed.

use shaders::{Emission, EmitLeaf};

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::refine::buffers::GeometryBuffers;
use crate::refine::marking::Marking;
use crate::refine::missing;
use crate::refine::pipelines::{COMPACT, EMIT, Pipelines};
use crate::refine::scratch::{Growing, bind};
use crate::refine::times::{PassTimes, Recorder};

/// Bytes of an entry of the list of vertices.
const ENTRY_BYTES: u64 = 8;
/// Meshes that entries of the list have bits for.
const MOST_MESHES: usize = 1 << 14;
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
        for emits in emits.chunks(MOST_MESHES) {
            let Some(entries) = self.prepare(gpu, geometry, marking, emits, targets)? else {
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
                pass.dispatch_workgroups(words, emits.len() as u32, 1);
            })?;
            let emit = pipelines.get(gpu, EMIT)?;
            let resources = [
                self.emissions.binding(),
                self.entries.binding(),
                marking.summed.binding(),
                geometry.heights(),
                geometry.borders(),
                geometry.blocks(),
                Some(targets.vertices.as_entire_binding()),
                Some(targets.indices.as_entire_binding()),
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
    fn prepare(
        &mut self,
        gpu: &Gpu,
        geometry: &GeometryBuffers,
        marking: &Marking,
        emits: &[EmitLeaf],
        targets: &Targets<'_>,
    ) -> Result<Option<u32>, RenderError> {
        let mut emissions = Vec::with_capacity(emits.len());
        let mut entries = 0_u32;
        for leaf in emits {
            let Some(count) = marking.counted.get(leaf.place as usize) else {
                return Err(RenderError::Mesh(format!(
                    "a mesh of leaf {} of {} that were marked",
                    leaf.place,
                    marking.counted.len()
                )));
            };
            let ends = [
                (u64::from(leaf.first_vertex) + u64::from(count.vertices)) * 36,
                (u64::from(leaf.first_index) + 3 * u64::from(count.triangles)) * 4,
                (u64::from(leaf.argument) + 1) * 20,
            ];
            let sizes =
                [targets.vertices, targets.indices, targets.arguments].map(wgpu::Buffer::size);
            let fits = ends.iter().zip(sizes).all(|(end, size)| *end <= size);
            if !fits || leaf.geometry >= geometry.in_use() {
                return Err(RenderError::Mesh(format!(
                    "a mesh of {} vertices and {} triangles lies beyond its buffers",
                    count.vertices, count.triangles
                )));
            }
            emissions.push(Emission {
                place: leaf.place,
                geometry: leaf.geometry,
                first_vertex: leaf.first_vertex,
                first_index: leaf.first_index,
                unit_m: leaf.unit_m,
                argument: leaf.argument,
                record: leaf.record,
                first_entry: entries,
                vertices: count.vertices,
                triangles: count.triangles,
                entries: 0,
                padding: 0,
            });
            entries = entries.saturating_add(count.vertices);
        }
        if entries == 0 {
            return Ok(None);
        }
        for emission in &mut emissions {
            emission.entries = entries;
        }
        self.emissions.write(gpu, &emissions);
        self.entries.reserve(gpu, u64::from(entries) * ENTRY_BYTES);
        Ok(Some(entries))
    }
}
