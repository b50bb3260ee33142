//! Refinement on the GPU: heights of leaves, bounds of their errors, marks, and meshes.
//! In: fused heights, what lies beside what, how much error each leaf allows. Out: vertices, indices and arguments of
//! indirect draws in the caller's buffers. Only counts are read back, so that the caller knows how much room to give.
//! It knows no tile and keeps nothing but what the last call of [`Refiner::mark`] marked.

use std::sync::Arc;

use shaders::{EmitLeaf, RefineLeaf};
use terrain::LeafCount;

use crate::error::RenderError;
use crate::gpu::Gpu;

use self::fill::Fill;
use self::marking::Marking;
use self::pipelines::Pipelines;
use self::writing::{Targets, Writing};

pub(crate) use self::buffers::GeometryBuffers;
use crate::recorder::PassTimes;

mod buffers;
mod fill;
mod marking;
mod pipelines;
mod writing;

#[cfg(test)]
#[path = "refine_tests.rs"]
mod tests;

/// The heights of one leaf that are to be made.
pub(crate) struct HeightsJob<'a> {
    /// Where in the geometry buffers.
    pub(crate) slot: u32,
    /// Fused heights, a slot of 275² words; `None`: all heights are 0.
    pub(crate) input: Option<&'a wgpu::TextureView>,
    /// Node (0, 0) of the leaf in the input's lattice, in steps of 2^-shift of its cells.
    pub(crate) origin: [i32; 2],
    /// Levels from the leaf up to the tile of the input.
    pub(crate) shift: u32,
    /// Units of height in a metre, a power of two.
    pub(crate) units_per_m: f32,
}

/// How marks are found.
pub(crate) enum Method<'a> {
    /// From the coarsest mesh, splitting what fails.
    TopDown,
    /// From the finest marks, keeping what is needed.
    BottomUp,
    /// These marks, `terrain::MARK_WORDS` words a leaf.
    Given(&'a [u32]),
}

/// How much may be marked.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MarkLimits {
    /// Triangles that there is room for. Marks are given up where they must come to more.
    pub(crate) most_triangles: u32,
}

/// What marking came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Marked {
    /// How much geometry each leaf needs, in the order of the leaves.
    Counts(Vec<LeafCount>),
    /// More than the limits: nothing is marked. Allow more error.
    TooMany,
}

/// The passes of refinement, and what is marked.
#[derive(Debug)]
pub(crate) struct Refiner {
    pipelines: Pipelines,
    fill: Fill,
    marking: Marking,
    writing: Writing,
}

impl Refiner {
    /// Compiles nothing yet: see [`Refiner::warm`].
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self {
            pipelines: Pipelines::default(),
            fill: Fill::new(gpu),
            marking: Marking::new(),
            writing: Writing::new(),
        }
    }

    /// Makes all pipelines in the background, so that the first use of one costs no frame.
    pub(crate) fn warm(&self, gpu: &Arc<Gpu>) {
        self.pipelines.warm(gpu);
    }

    /// Writes what the CPU knows of a leaf's geometry: its border vertices and the anchors of its inner ones.
    pub(crate) fn write_border(
        &self,
        gpu: &Gpu,
        geometry: &GeometryBuffers,
        slot: u32,
        border: &[u32],
        anchors: &[u32],
    ) {
        geometry.write_border(gpu, slot, border, anchors);
    }

    /// Makes heights, and their error pyramids if asked, without which marks can only be given. Their borders must have
    /// been written. Submitted, not waited for.
    pub(crate) fn make_geometry(
        &mut self,
        gpu: &Gpu,
        geometry: &GeometryBuffers,
        jobs: &[HeightsJob<'_>],
        errors: bool,
        times: &mut Option<PassTimes>,
    ) -> Result<(), RenderError> {
        self.fill
            .run(gpu, &self.pipelines, geometry, jobs, errors, times)
    }

    /// Marks leaves and counts. `allowances` holds `terrain::ALLOWANCE_WORDS` words a leaf; marks that are given need
    /// none. It waits for the device.
    #[expect(
        clippy::too_many_arguments,
        reason = "all of it is what marks depend on"
    )]
    pub(crate) fn mark(
        &mut self,
        gpu: &Gpu,
        geometry: &GeometryBuffers,
        leaves: &[RefineLeaf],
        allowances: &[u32],
        method: &Method<'_>,
        limits: MarkLimits,
        times: &mut Option<PassTimes>,
    ) -> Result<Marked, RenderError> {
        self.marking.run(
            gpu,
            &self.pipelines,
            geometry,
            leaves,
            allowances,
            method,
            limits,
            times,
        )
    }

    /// Writes meshes of leaves that were marked last: vertices as `terrain::Vertex`, indices local to each leaf,
    /// arguments of five words. Submitted, not waited for.
    #[expect(clippy::too_many_arguments, reason = "three buffers are written")]
    pub(crate) fn emit(
        &mut self,
        gpu: &Gpu,
        geometry: &GeometryBuffers,
        emits: &[EmitLeaf],
        vertices: &wgpu::Buffer,
        indices: &wgpu::Buffer,
        arguments: &wgpu::Buffer,
        times: &mut Option<PassTimes>,
    ) -> Result<(), RenderError> {
        let targets = Targets {
            vertices,
            indices,
            arguments,
        };
        self.writing.run(
            gpu,
            &self.pipelines,
            geometry,
            &self.marking,
            emits,
            &targets,
            times,
        )
    }

    /// The marks of the leaves that were marked last, `terrain::MARK_WORDS` words each.
    #[cfg(test)]
    pub(crate) fn marks(&self, gpu: &Gpu) -> Result<Vec<u32>, RenderError> {
        let marks = self.marking.marks.buffer().ok_or_else(missing)?;
        let bytes = crate::readback::read_buffer(gpu, marks)?;
        let mut words: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes);
        words.truncate(self.marking.counted.len() * terrain::MARK_WORDS);
        Ok(words)
    }
}

/// A buffer that should have been made before: a defect of the program.
fn missing() -> RenderError {
    RenderError::Mesh("refinement lacks a buffer that an earlier step makes".to_owned())
}
