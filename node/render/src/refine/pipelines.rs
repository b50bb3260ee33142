//! The pipelines of refinement, each made when it is first needed, or in the background.
//! In: a kernel. Out: its pipeline. It runs nothing.

use std::sync::{Arc, OnceLock};

use shaders::RefineStage;

use crate::error::RenderError;
use crate::gpu::Gpu;

/// A stage, and the value of its constant where it has one that compilers should know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Kernel {
    pub(crate) stage: RefineStage,
    constant: Option<(&'static str, u8)>,
}

const fn plain(stage: RefineStage) -> Kernel {
    Kernel {
        stage,
        constant: None,
    }
}

const fn with(stage: RefineStage, name: &'static str, value: u8) -> Kernel {
    Kernel {
        stage,
        constant: Some((name, value)),
    }
}

pub(crate) const HEIGHTS: Kernel = with(RefineStage::LeafHeights, "RESAMPLED", 0);
pub(crate) const HEIGHTS_RESAMPLED: Kernel = with(RefineStage::LeafHeights, "RESAMPLED", 1);
pub(crate) const PYRAMID_FINE: Kernel = plain(RefineStage::PyramidFine);
pub(crate) const PYRAMID_12: Kernel = with(RefineStage::Pyramid, "KIND", 0);
pub(crate) const PYRAMID_11: Kernel = with(RefineStage::Pyramid, "KIND", 1);
pub(crate) const PYRAMID_COARSE: Kernel = with(RefineStage::Pyramid, "KIND", 2);
pub(crate) const SEED_MARKS: Kernel = plain(RefineStage::SeedMarks);
pub(crate) const ADVANCE: Kernel = plain(RefineStage::Advance);
pub(crate) const TOP_DOWN: Kernel = plain(RefineStage::TopDown);
pub(crate) const BOTTOM_UP: Kernel = plain(RefineStage::BottomUp);
pub(crate) const COUNT_WORDS: Kernel = plain(RefineStage::CountWords);
pub(crate) const COUNT_LEAVES: Kernel = plain(RefineStage::CountLeaves);
pub(crate) const COMPACT: Kernel = plain(RefineStage::Compact);
pub(crate) const EMIT: Kernel = plain(RefineStage::Emit);

/// All of them, in the order in which the first picture needs them.
const KERNELS: [Kernel; 14] = [
    HEIGHTS,
    HEIGHTS_RESAMPLED,
    PYRAMID_FINE,
    PYRAMID_12,
    PYRAMID_11,
    PYRAMID_COARSE,
    SEED_MARKS,
    ADVANCE,
    TOP_DOWN,
    COUNT_WORDS,
    COUNT_LEAVES,
    COMPACT,
    EMIT,
    BOTTOM_UP,
];

#[derive(Debug, Default)]
struct Made {
    pipelines: [OnceLock<wgpu::ComputePipeline>; KERNELS.len()],
}

/// The pipelines.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pipelines(Arc<Made>);

impl Pipelines {
    pub(crate) fn get(
        &self,
        gpu: &Gpu,
        kernel: Kernel,
    ) -> Result<&wgpu::ComputePipeline, RenderError> {
        let index = KERNELS.iter().position(|known| *known == kernel);
        let Some(slot) = index.and_then(|index| self.0.pipelines.get(index)) else {
            return Err(RenderError::Stage(kernel.stage.name()));
        };
        if let Some(made) = slot.get() {
            return Ok(made);
        }
        let made = pipeline(gpu, kernel)?;
        Ok(slot.get_or_init(|| made))
    }

    /// Makes all of them in a thread of its own.
    pub(crate) fn warm(&self, gpu: &Arc<Gpu>) {
        let (pipelines, gpu) = (self.clone(), Arc::clone(gpu));
        let warming = std::thread::Builder::new()
            .name("refinement compiler".to_owned())
            .spawn(move || {
                for kernel in KERNELS {
                    if let Err(error) = pipelines.get(&gpu, kernel) {
                        tracing::error!(%error, stage = kernel.stage.name(), "a stage does not compile");
                    }
                }
            });
        if let Err(error) = warming {
            tracing::warn!(%error, "stages of refinement are compiled when they are first used");
        }
    }
}

fn pipeline(gpu: &Gpu, kernel: Kernel) -> Result<wgpu::ComputePipeline, RenderError> {
    let name = kernel.stage.name();
    let module = gpu
        .device
        .create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(name),
            source: wgpu::ShaderSource::Wgsl(kernel.stage.source()?.into()),
        });
    let constants: Vec<(&str, f64)> = kernel
        .constant
        .iter()
        .map(|(name, value)| (*name, f64::from(*value)))
        .collect();
    Ok(gpu
        .device
        .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &constants,
                // Every stage writes what it reads of it.
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        }))
}
