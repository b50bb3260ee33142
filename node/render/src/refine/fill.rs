//! Heights of leaves and their error pyramids, many leaves at once.
//! In: jobs. Out: passes that write the geometry buffers. It waits for nothing unless passes are timed.

use shaders::{LeafHeightsUniform, RefineLevelUniform};

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::recorder::{PassTimes, Recorder};
use crate::refine::buffers::GeometryBuffers;
use crate::refine::pipelines::{
    HEIGHTS, HEIGHTS_RESAMPLED, PYRAMID_11, PYRAMID_12, PYRAMID_COARSE, PYRAMID_FINE, Pipelines,
};
use crate::refine::{HeightsJob, missing};
use crate::scratch::{Growing, bind, write_uniforms};

/// Invocations of a workgroup.
const LANES: u32 = 64;
/// Squares of two cells in a leaf.
const SQUARES: u32 = 128 * 128;
/// Workgroups along an axis of a dispatch that any device runs.
const MOST_GROUPS: usize = 65_535;

/// What filling needs beside the geometry buffers.
#[derive(Debug)]
pub(super) struct Fill {
    jobs: Growing,
    heights: Growing,
    levels: Growing,
    nothing: wgpu::TextureView,
}

impl Fill {
    pub(super) fn new(gpu: &Gpu) -> Self {
        let uniform = wgpu::BufferUsages::UNIFORM;
        // Its one texel is 0, and reading beyond it reads that or 0.
        let nothing = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("no heights"),
            size: wgpu::Extent3d {
                width: 1,
                height: 1,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R32Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        Self {
            jobs: Growing::new("geometry jobs", wgpu::BufferUsages::STORAGE),
            heights: Growing::new("heights uniforms", uniform),
            levels: Growing::new("pyramid levels", uniform),
            nothing: nothing.create_view(&wgpu::TextureViewDescriptor::default()),
        }
    }

    pub(super) fn run(
        &mut self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        geometry: &GeometryBuffers,
        jobs: &[HeightsJob<'_>],
        errors: bool,
        times: &mut Option<PassTimes>,
    ) -> Result<(), RenderError> {
        for jobs in jobs.chunks(MOST_GROUPS) {
            self.run_some(gpu, pipelines, geometry, jobs, errors, times)?;
        }
        Ok(())
    }

    fn run_some(
        &mut self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        geometry: &GeometryBuffers,
        jobs: &[HeightsJob<'_>],
        errors: bool,
        times: &mut Option<PassTimes>,
    ) -> Result<(), RenderError> {
        if jobs.iter().any(|job| job.slot >= geometry.in_use()) {
            return Err(RenderError::Mesh(format!(
                "heights for a slot beyond the {} in use",
                geometry.in_use()
            )));
        }
        let slots: Vec<u32> = jobs.iter().map(|job| job.slot).collect();
        self.jobs.write(gpu, &slots);
        let uniforms: Vec<_> = jobs
            .iter()
            .map(|job| LeafHeightsUniform {
                origin: job.origin,
                shift: job.shift,
                units_per_m: job.units_per_m,
                slot: job.slot,
                padding: [0; 3],
            })
            .collect();
        let stride = write_uniforms(gpu, &mut self.heights, &uniforms);
        let mut recorder = Recorder::new(gpu, times);
        let mut heights = Vec::with_capacity(jobs.len());
        for (number, job) in (0..).zip(jobs) {
            let between = job.input.is_some() && job.shift > 0;
            let kernel = if between { HEIGHTS_RESAMPLED } else { HEIGHTS };
            let pipeline = pipelines.get(gpu, kernel)?;
            let input = job.input.unwrap_or(&self.nothing);
            let resources = [
                self.heights
                    .part(number, stride, size_of::<LeafHeightsUniform>() as u64),
                Some(wgpu::BindingResource::TextureView(input)),
                geometry.borders(),
                geometry.heights(),
            ];
            let bindings = bind(gpu, pipeline, resources).ok_or_else(missing)?;
            heights.push((pipeline, bindings));
        }
        recorder.pass("heights", |pass| {
            for (pipeline, bindings) in &heights {
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, bindings, &[]);
                pass.dispatch_workgroups((terrain::LATTICE_NODES as u32).div_ceil(LANES), 1, 1);
            }
        })?;
        if errors {
            self.pyramids(gpu, pipelines, geometry, jobs.len() as u32, &mut recorder)?;
        }
        recorder.finish()
    }

    fn pyramids(
        &mut self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        geometry: &GeometryBuffers,
        jobs: u32,
        recorder: &mut Recorder<'_>,
    ) -> Result<(), RenderError> {
        let levels: Vec<_> = (0..=12)
            .map(|level| RefineLevelUniform {
                level,
                first_place: 0,
                padding: [0; 2],
            })
            .collect();
        let stride = write_uniforms(gpu, &mut self.levels, &levels);
        let fine = pipelines.get(gpu, PYRAMID_FINE)?;
        let resources = [self.jobs.binding(), geometry.heights(), geometry.errors()];
        let bindings = bind(gpu, fine, resources).ok_or_else(missing)?;
        let mut steps = vec![(fine, bindings, SQUARES / LANES)];
        for level in (0..=12_u32).rev() {
            let kernel = match level {
                12 => PYRAMID_12,
                11 => PYRAMID_11,
                _ => PYRAMID_COARSE,
            };
            let pipeline = pipelines.get(gpu, kernel)?;
            let resources = [
                self.levels.part(
                    u64::from(level),
                    stride,
                    size_of::<RefineLevelUniform>() as u64,
                ),
                self.jobs.binding(),
                geometry.heights(),
                geometry.errors(),
            ];
            let bindings = bind(gpu, pipeline, resources).ok_or_else(missing)?;
            steps.push((pipeline, bindings, marks_of_level(level).div_ceil(LANES)));
        }
        recorder.pass("error pyramid", |pass| {
            for (pipeline, bindings, groups) in &steps {
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, bindings, &[]);
                pass.dispatch_workgroups(*groups, jobs, 1);
            }
        })
    }
}

/// Marks of a level, 0…14: horizontal and vertical ones, or diagonal ones.
pub(super) const fn marks_of_level(level: u32) -> u32 {
    let cells = 1 << (7 - (14 - level) / 2);
    if level % 2 == 1 {
        cells * cells
    } else {
        2 * cells * (cells + 1)
    }
}
