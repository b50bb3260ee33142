//! Which marks are set, and how much geometry they make.
//! In: records of leaves, what errors they allow. Out: marks on the device, counts on this side. It goes on until nothing
//! more follows from any mark, however many passes that takes; only counts and the worklist's ends are read back.

use shaders::{RefineLeaf, RefineLevelUniform};
use terrain::LeafCount;

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::recorder::{PassTimes, Recorder, read_mapped};
use crate::refine::buffers::GeometryBuffers;
use crate::refine::fill::marks_of_level;
use crate::refine::pipelines::{
    ADVANCE, BOTTOM_UP, COUNT_LEAVES, COUNT_WORDS, Pipelines, SEED_MARKS, TOP_DOWN,
};
use crate::refine::{MarkLimits, Marked, Method, missing};
use crate::scratch::{Growing, bind, write_uniforms};

const MARK_WORDS: u64 = terrain::MARK_WORDS as u64;
/// Bytes of a word's marks with what comes before it.
pub(super) const SUMMED_BYTES: u64 = 16;
/// Leaves that entries of lists have bits for.
const MOST_LEAVES: usize = 1 << 14;
/// Passes over the worklist that are encoded together: what the last marks took and some more, but no fewer and no
/// more than these. To begin with, the levels of marks and some way back up again.
const PASSES: (u32, u32) = (8, 64);
const FIRST_PASSES: u32 = 20;
const MORE_PASSES: u32 = 2;
/// Entries of the worklist that there is room for to begin with.
const FIRST_ENTRIES: u64 = 1 << 17;
/// Entries of the worklist that are always there for one leaf: its centre and the middles of its edges.
const SEEDS: u64 = 5;
/// Words of the window over the worklist: three of the dispatch, start, end, passes.
const WINDOW_WORDS: u64 = 6;
/// Invocations of a workgroup.
const LANES: u32 = 64;

/// What is marked.
#[derive(Debug)]
pub(super) struct Marking {
    leaves: Growing,
    allowances: Growing,
    pub(super) marks: Growing,
    /// Marks by words, with what comes before each.
    pub(super) summed: Growing,
    counts: Growing,
    worklist: Growing,
    window: Growing,
    steps: Growing,
    staging: Growing,
    /// Entries that the worklist had to hold last, or more.
    pub(super) entries: u64,
    /// Passes that are encoded together.
    passes: u32,
    /// What was counted last, by leaf.
    pub(super) counted: Vec<LeafCount>,
}

/// The worklist after some passes.
struct Progress {
    /// Marks in the window: those from which nothing was drawn yet.
    open: u32,
    /// Marks that were to be entered.
    length: u64,
    /// Passes that had anything to do.
    passes: u32,
}

impl Marking {
    pub(super) fn new() -> Self {
        let storage = wgpu::BufferUsages::STORAGE;
        Self {
            leaves: Growing::new("leaves", storage),
            allowances: Growing::new("allowances", storage),
            marks: Growing::new("marks", storage),
            summed: Growing::new("counted marks", storage),
            counts: Growing::new("counts", storage),
            worklist: Growing::new("worklist", storage),
            window: Growing::new("window", storage | wgpu::BufferUsages::INDIRECT),
            steps: Growing::new("steps", wgpu::BufferUsages::UNIFORM),
            staging: Growing::staging("counts read back"),
            entries: FIRST_ENTRIES,
            passes: FIRST_PASSES,
            counted: Vec::new(),
        }
    }

    #[expect(
        clippy::too_many_arguments,
        reason = "all of it is what marks depend on"
    )]
    pub(super) fn run(
        &mut self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        geometry: &GeometryBuffers,
        leaves: &[RefineLeaf],
        allowances: &[u32],
        method: &Method<'_>,
        limits: MarkLimits,
        times: &mut Option<PassTimes>,
    ) -> Result<Marked, RenderError> {
        self.counted.clear();
        if leaves.is_empty() {
            return Ok(Marked::Counts(Vec::new()));
        }
        check(gpu, geometry, leaves, allowances, method)?;
        let count = leaves.len() as u64;
        self.leaves.write(gpu, leaves);
        self.allowances.write(gpu, allowances);
        self.marks.reserve(gpu, count * MARK_WORDS * 4);
        self.summed.reserve(gpu, count * MARK_WORDS * SUMMED_BYTES);
        self.counts
            .reserve(gpu, count * size_of::<LeafCount>() as u64);
        self.window.reserve(gpu, WINDOW_WORDS * 4);
        // A mesh has about two triangles a vertex, and leaves around the visible ones have marks too.
        let most = u64::from(limits.most_triangles) * 2 + count * SEEDS;
        let counted = match method {
            Method::TopDown => self.top_down(gpu, pipelines, geometry, leaves, most, times)?,
            Method::BottomUp => {
                self.reserve_worklist(gpu, count * SEEDS);
                let mut recorder = Recorder::new(gpu, times);
                self.seed(gpu, pipelines, leaves.len(), &mut recorder)?;
                self.bottom_up(gpu, pipelines, geometry, leaves, &mut recorder)?;
                Some(self.count(gpu, pipelines, leaves.len(), recorder)?.0)
            }
            Method::Given(marks) => {
                self.marks.write(gpu, marks);
                self.reserve_worklist(gpu, count * SEEDS);
                let recorder = Recorder::new(gpu, times);
                let (counted, _) = self.count(gpu, pipelines, leaves.len(), recorder)?;
                self.counted.clone_from(&counted);
                return Ok(Marked::Counts(counted));
            }
        };
        let within = |counted: &Vec<LeafCount>| {
            let marks = counted.iter().map(|count| u64::from(count.vertices));
            marks.sum::<u64>() <= most + 4 * count
        };
        match counted.filter(within) {
            Some(counted) => {
                self.counted.clone_from(&counted);
                Ok(Marked::Counts(counted))
            }
            None => Ok(Marked::TooMany),
        }
    }

    /// Marks top down. `None` where the worklist would need more than `most` entries.
    fn top_down(
        &mut self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        geometry: &GeometryBuffers,
        leaves: &[RefineLeaf],
        most: u64,
        times: &mut Option<PassTimes>,
    ) -> Result<Option<Vec<LeafCount>>, RenderError> {
        let all = leaves.len() as u64 * terrain::LATTICE_NODES as u64;
        let most = most.min(all).min(most_entries(gpu));
        let seeds = leaves.len() as u64 * SEEDS;
        loop {
            let capacity = self.entries.max(seeds).min(most);
            self.reserve_worklist(gpu, capacity);
            let mut recorder = Recorder::new(gpu, times);
            self.seed(gpu, pipelines, leaves.len(), &mut recorder)?;
            self.follow(gpu, pipelines, geometry, &mut recorder)?;
            let (mut counted, mut progress) = self.count(gpu, pipelines, leaves.len(), recorder)?;
            while progress.length <= capacity && progress.open > 0 {
                let mut recorder = Recorder::new(gpu, times);
                self.follow(gpu, pipelines, geometry, &mut recorder)?;
                (counted, progress) = self.count(gpu, pipelines, leaves.len(), recorder)?;
            }
            if progress.length <= capacity {
                self.passes = (progress.passes + MORE_PASSES).clamp(PASSES.0, PASSES.1);
                return Ok(Some(counted));
            }
            if capacity >= most {
                return Ok(None);
            }
            // What did not fit in was lost: all over again, with room for what follows from it too.
            self.entries = (progress.length * 2).min(most);
        }
    }

    fn reserve_worklist(&mut self, gpu: &Gpu, entries: u64) {
        self.worklist.reserve(gpu, 4 + entries.max(3) * 4);
    }

    /// Clears all marks, and sets those that always are; the window shows them.
    fn seed(
        &self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        leaves: usize,
        recorder: &mut Recorder<'_>,
    ) -> Result<(), RenderError> {
        let (Some(marks), Some(worklist), Some(window)) = (
            self.marks.buffer(),
            self.worklist.buffer(),
            self.window.buffer(),
        ) else {
            return Err(missing());
        };
        recorder
            .encoder
            .clear_buffer(marks, 0, Some(self.marks.bytes()));
        recorder.encoder.clear_buffer(worklist, 0, Some(4));
        recorder.encoder.clear_buffer(window, 0, None);
        let pipeline = pipelines.get(gpu, SEED_MARKS)?;
        let resources = [
            self.leaves.binding(),
            self.marks.binding(),
            self.worklist.binding(),
        ];
        let bindings = bind(gpu, pipeline, resources).ok_or_else(missing)?;
        let advance = pipelines.get(gpu, ADVANCE)?;
        let resources = [self.worklist.binding(), self.window.binding()];
        let advance_bindings = bind(gpu, advance, resources).ok_or_else(missing)?;
        recorder.pass("seed marks", |pass| {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bindings, &[]);
            pass.dispatch_workgroups((leaves as u32).div_ceil(LANES), 1, 1);
            pass.set_pipeline(advance);
            pass.set_bind_group(0, &advance_bindings, &[]);
            pass.dispatch_workgroups(1, 1, 1);
        })
    }

    /// Some passes, each over what the window shows, which then moves on. Those that find nothing in it are empty.
    fn follow(
        &self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        geometry: &GeometryBuffers,
        recorder: &mut Recorder<'_>,
    ) -> Result<(), RenderError> {
        let advance = pipelines.get(gpu, ADVANCE)?;
        let resources = [self.worklist.binding(), self.window.binding()];
        let advance_bindings = bind(gpu, advance, resources).ok_or_else(missing)?;
        let follow = pipelines.get(gpu, TOP_DOWN)?;
        let resources = [
            self.leaves.binding(),
            self.allowances.binding(),
            geometry.errors(),
            self.window.binding(),
            self.marks.binding(),
            self.worklist.binding(),
        ];
        let bindings = bind(gpu, follow, resources).ok_or_else(missing)?;
        let window = self.window.buffer().ok_or_else(missing)?;
        let run = |pass: &mut wgpu::ComputePass<'_>| {
            pass.set_pipeline(follow);
            pass.set_bind_group(0, &bindings, &[]);
            pass.dispatch_workgroups_indirect(window, 0);
            pass.set_pipeline(advance);
            pass.set_bind_group(0, &advance_bindings, &[]);
            pass.dispatch_workgroups(1, 1, 1);
        };
        if recorder.is_timed() {
            for _ in 0..self.passes {
                recorder.pass("top-down marks", run)?;
            }
            return Ok(());
        }
        recorder.pass("top-down marks", |pass| {
            for _ in 0..self.passes {
                run(pass);
            }
        })
    }

    /// All marks once, by falling absolute level. Each run of leaves of one level takes its step of it.
    fn bottom_up(
        &mut self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        geometry: &GeometryBuffers,
        leaves: &[RefineLeaf],
        recorder: &mut Recorder<'_>,
    ) -> Result<(), RenderError> {
        let deepest = u32::from(terrain::DEEPEST_MARK);
        let mut steps = Vec::new();
        let mut first_place = 0;
        for run in leaves.chunk_by(|a, b| a.level == b.level) {
            let level = run.first().map_or(0, |leaf| leaf.level);
            for mark_level in 0..=deepest {
                let step = RefineLevelUniform {
                    level: mark_level,
                    first_place,
                    padding: [0; 2],
                };
                steps.push((2 * level + mark_level, step, run.len() as u32));
            }
            first_place += run.len() as u32;
        }
        steps.sort_by_key(|(absolute, _, _)| std::cmp::Reverse(*absolute));
        let uniforms: Vec<_> = steps.iter().map(|(_, step, _)| *step).collect();
        let stride = write_uniforms(gpu, &mut self.steps, &uniforms);
        let pipeline = pipelines.get(gpu, BOTTOM_UP)?;
        let mut dispatches = Vec::with_capacity(steps.len());
        for (number, (_, step, leaves)) in (0..).zip(&steps) {
            let resources = [
                self.steps
                    .part(number, stride, size_of::<RefineLevelUniform>() as u64),
                self.leaves.binding(),
                self.allowances.binding(),
                geometry.errors(),
                self.marks.binding(),
            ];
            let bindings = bind(gpu, pipeline, resources).ok_or_else(missing)?;
            let groups = marks_of_level(step.level).div_ceil(LANES);
            dispatches.push((bindings, groups, *leaves));
        }
        recorder.pass("bottom-up marks", |pass| {
            pass.set_pipeline(pipeline);
            for (bindings, groups, leaves) in &dispatches {
                pass.set_bind_group(0, bindings, &[]);
                pass.dispatch_workgroups(*groups, *leaves, 1);
            }
        })
    }

    /// Counts what is marked, and reads that and the worklist's ends back.
    fn count(
        &mut self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        leaves: usize,
        mut recorder: Recorder<'_>,
    ) -> Result<(Vec<LeafCount>, Progress), RenderError> {
        let words = pipelines.get(gpu, COUNT_WORDS)?;
        let resources = [self.marks.binding(), self.summed.binding()];
        let word_bindings = bind(gpu, words, resources).ok_or_else(missing)?;
        let sums = pipelines.get(gpu, COUNT_LEAVES)?;
        let resources = [self.summed.binding(), self.counts.binding()];
        let sum_bindings = bind(gpu, sums, resources).ok_or_else(missing)?;
        recorder.pass("count", |pass| {
            pass.set_pipeline(words);
            pass.set_bind_group(0, &word_bindings, &[]);
            pass.dispatch_workgroups((MARK_WORDS as u32).div_ceil(LANES), leaves as u32, 1);
            pass.set_pipeline(sums);
            pass.set_bind_group(0, &sum_bindings, &[]);
            pass.dispatch_workgroups(leaves as u32, 1, 1);
        })?;
        let (Some(counts), Some(worklist), Some(window)) = (
            self.counts.buffer(),
            self.worklist.buffer(),
            self.window.buffer(),
        ) else {
            return Err(missing());
        };
        // The worklist's length, the window, then counts.
        let counts_at = 4 + WINDOW_WORDS * 4;
        let counts_bytes = (leaves * size_of::<LeafCount>()) as u64;
        let bytes = counts_at + counts_bytes;
        let staging = self.staging.reserve(gpu, bytes);
        let encoder = &mut recorder.encoder;
        encoder.copy_buffer_to_buffer(worklist, 0, staging, 0, 4);
        encoder.copy_buffer_to_buffer(window, 0, staging, 4, WINDOW_WORDS * 4);
        encoder.copy_buffer_to_buffer(counts, 0, staging, counts_at, counts_bytes);
        recorder.finish()?;
        let read: Vec<u32> = read_mapped(gpu, staging, bytes)?;
        let Some(([length, _, _, _, start, end, passes], counts)) = read.split_first_chunk() else {
            return Err(missing());
        };
        let counted = counts
            .chunks_exact(2)
            .map(|pair| LeafCount {
                vertices: pair.first().copied().unwrap_or_default(),
                triangles: pair.last().copied().unwrap_or_default(),
            })
            .collect();
        let progress = Progress {
            open: end.saturating_sub(*start),
            length: u64::from(*length),
            passes: *passes,
        };
        Ok((counted, progress))
    }
}

/// Entries of the worklist that the device can bind.
fn most_entries(gpu: &Gpu) -> u64 {
    gpu.device.limits().max_storage_buffer_binding_size / 4 - 1
}

/// Refuses what does not fit together or is too much for the device.
fn check(
    gpu: &Gpu,
    geometry: &GeometryBuffers,
    leaves: &[RefineLeaf],
    allowances: &[u32],
    method: &Method<'_>,
) -> Result<(), RenderError> {
    let limit = gpu.device.limits().max_storage_buffer_binding_size;
    let bound = (limit / (MARK_WORDS * SUMMED_BYTES)) as usize;
    let most = MOST_LEAVES.min(bound);
    if leaves.len() > most {
        return Err(RenderError::Mesh(format!(
            "{} leaves are to be refined at once; this device refines at most {most}: raise mesh.tile_px",
            leaves.len()
        )));
    }
    let due = match method {
        Method::Given(marks) => (marks.len(), leaves.len() * terrain::MARK_WORDS),
        Method::TopDown | Method::BottomUp => {
            (allowances.len(), leaves.len() * terrain::ALLOWANCE_WORDS)
        }
    };
    if due.0 != due.1 {
        return Err(RenderError::Mesh(format!(
            "{} words of marks or allowances for {} leaves, which have {}",
            due.0,
            leaves.len(),
            due.1
        )));
    }
    if leaves.iter().any(|leaf| leaf.geometry >= geometry.in_use()) {
        return Err(RenderError::Mesh(format!(
            "a leaf's geometry is in a slot beyond the {} that there are",
            geometry.in_use()
        )));
    }
    Ok(())
}
