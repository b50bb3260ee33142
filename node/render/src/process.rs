//! Live processing: from raw samples to the layers that the terrain shader samples, on the GPU.
//!
//! In: plans, decoded tiles. Out: layers of relief and of colour, and results kept for the next change of parameters.
//! What is kept is known by what went into it. It never waits for data and does not decide what is shown.

mod plan;
mod slots;
mod stages;
pub(crate) mod uniforms;
mod words;

use std::sync::Arc;

use bytemuck::bytes_of;
use shaders::{ReliefUniform, Stage, SurfaceUniform};
use tiles::{Lookup, TileCache};

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::layers::LAYER_SIDE;
use crate::loaded::LoadedScene;

use plan::Packing;
pub(crate) use plan::{Plan, Work};
pub(crate) use slots::{SLOT_SIDE, Slot, Slots};
pub(crate) use stages::{Dispatch, MOST_INPUTS, Stages};
pub(crate) use uniforms::{Ground, elevation_uniform, fuse};
pub(crate) use words::shown_channels;

/// Colour of ground that no layer covers, gamma encoded.
pub(crate) const NEUTRAL: [u8; 3] = [150, 146, 138];

/// Where a finished result goes.
pub(crate) enum Finish<'a> {
    /// Heights become relief.
    Relief {
        arrays: &'a wgpu::TextureView,
        layer: u32,
    },
    /// Colours are laid over the bare ground.
    Surface {
        arrays: &'a wgpu::TextureView,
        layer: u32,
    },
}

/// What became of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Made {
    /// The result is finished.
    Whole,
    /// No more steps were allowed. What is made is kept, and the next run goes on from there.
    Part,
    /// Raw samples have left memory meanwhile.
    Nothing,
}

/// The processing of one device.
#[derive(Debug)]
pub(crate) struct Processor {
    slots: Slots,
    stages: Stages,
    /// Counts runs: what a run uses stays, and no more.
    runs: u64,
}

impl Processor {
    pub(crate) fn new(gpu: &Gpu, budget_bytes: u64) -> Self {
        Self {
            slots: Slots::new(budget_bytes),
            stages: Stages::new(gpu),
            runs: 0,
        }
    }

    /// Compiles all stages in the background.
    pub(crate) fn warm(&self, gpu: &Arc<Gpu>) {
        self.stages.warm(gpu);
    }

    /// Nodes of a plan that must be made for its root, inputs first.
    pub(crate) fn missing(&self, plan: &Plan) -> Vec<usize> {
        let mut wanted = vec![false; plan.nodes.len()];
        if let Some(root) = plan.root {
            wanted[root] = true;
        }
        // Inputs stand before what reads them.
        for index in (0..plan.nodes.len()).rev() {
            if !wanted[index] {
                continue;
            }
            if self.slots.holds(plan.nodes[index].key) {
                wanted[index] = false;
            } else if let Work::Stage { inputs, .. } = &plan.nodes[index].work {
                for input in inputs {
                    wanted[*input] = true;
                }
            }
        }
        (0..plan.nodes.len())
            .filter(|index| wanted[*index])
            .collect()
    }

    /// Makes what a plan leads to and finishes it, in no more steps than are left where these are counted. Does not
    /// wait for the device.
    pub(crate) fn run(
        &mut self,
        gpu: &Gpu,
        scene: &LoadedScene,
        cache: &TileCache,
        plan: &Plan,
        finish: &Finish<'_>,
        steps_left: Option<&mut u32>,
    ) -> Result<Made, RenderError> {
        self.begin();
        let made = self.make(gpu, scene, cache, plan, finish, steps_left);
        // Whatever became of it: results that are kept must be in the device's hands before their inputs are lent again.
        self.stages.submit(gpu);
        made
    }

    /// Begins a run. What is used from now on stays until the next one begins.
    pub(crate) fn begin(&mut self) {
        self.runs += 1;
    }

    /// Sends what was begun to the device.
    pub(crate) fn submit(&mut self, gpu: &Gpu) {
        self.stages.submit(gpu);
    }

    /// Makes what a plan leads to, as part of the present run.
    pub(crate) fn make_root(
        &mut self,
        gpu: &Gpu,
        scene: &LoadedScene,
        cache: &TileCache,
        plan: &Plan,
    ) -> Result<Made, RenderError> {
        self.make_nodes(gpu, scene, cache, plan, None)
    }

    /// A result to read.
    pub(crate) fn slot(&self, key: slots::ResultKey) -> Option<&Slot> {
        self.slots.peek(key)
    }

    fn make(
        &mut self,
        gpu: &Gpu,
        scene: &LoadedScene,
        cache: &TileCache,
        plan: &Plan,
        finish: &Finish<'_>,
        mut steps_left: Option<&mut u32>,
    ) -> Result<Made, RenderError> {
        let Some(root) = plan.key() else {
            return Ok(Made::Whole);
        };
        let made = self.make_nodes(gpu, scene, cache, plan, steps_left.as_deref_mut())?;
        if made != Made::Whole {
            return Ok(made);
        }
        self.finish(gpu, scene, root, finish, steps_left)
    }

    fn make_nodes(
        &mut self,
        gpu: &Gpu,
        scene: &LoadedScene,
        cache: &TileCache,
        plan: &Plan,
        mut steps_left: Option<&mut u32>,
    ) -> Result<Made, RenderError> {
        let run = self.runs;
        let missing = self.missing(plan);
        // What is read must not be taken for what is written.
        for node in &plan.nodes {
            self.slots.get(node.key, run);
        }
        for index in missing {
            let node = &plan.nodes[index];
            match &node.work {
                Work::Upload {
                    layer,
                    source,
                    packing,
                } => {
                    let Some(data) = scene.source(*layer) else {
                        return Ok(Made::Nothing);
                    };
                    let Lookup::Ready(tile) = cache.get(data.id, *source) else {
                        return Ok(Made::Nothing);
                    };
                    let words = match packing {
                        Packing::Heights => words::heights(&tile, data.data.dataset.unit()),
                        Packing::Amplitudes => words::amplitudes(&tile),
                        Packing::Colours { channels, range } => {
                            words::colours(&tile, *channels, *range)
                        }
                        Packing::Finished { channels } => words::finished(&tile, *channels),
                    };
                    self.upload(gpu, node.key, &words, run);
                }
                Work::Holes { word } => {
                    self.upload(gpu, node.key, &vec![*word; words::WORDS], run);
                }
                Work::Stage {
                    stage,
                    uniform,
                    inputs,
                } => {
                    self.slots.lend(gpu, node.key, run);
                    let keys = inputs.iter().map(|input| plan.nodes[*input].key);
                    let views: Option<Vec<&wgpu::TextureView>> = keys
                        .map(|key| self.slots.peek(key).map(|slot| &slot.view))
                        .collect();
                    let (Some(inputs), Some(result)) = (views, self.slots.peek(node.key)) else {
                        self.slots.forget(node.key);
                        return Ok(Made::Nothing);
                    };
                    let dispatch = Dispatch {
                        stage: *stage,
                        uniform,
                        result: &result.view,
                        inputs: &inputs,
                        side: SLOT_SIDE,
                    };
                    if let Err(error) = self.stages.run(gpu, &dispatch) {
                        self.slots.forget(node.key);
                        return Err(error);
                    }
                }
            }
            if let Some(left) = &mut steps_left {
                **left = left.saturating_sub(1);
                if **left == 0 {
                    return Ok(Made::Part);
                }
            }
        }
        Ok(Made::Whole)
    }

    fn finish(
        &mut self,
        gpu: &Gpu,
        scene: &LoadedScene,
        root: slots::ResultKey,
        finish: &Finish<'_>,
        steps_left: Option<&mut u32>,
    ) -> Result<Made, RenderError> {
        let Some(slot) = self.slots.get(root, self.runs) else {
            return Ok(Made::Nothing);
        };
        let (stage, uniform, arrays) = match finish {
            Finish::Relief { arrays, layer } => {
                let uniform = ReliefUniform {
                    tile: uniforms::geometry(&scene.data.ellipsoid, root.0),
                    layer: *layer,
                    padding: [0; 3],
                };
                (Stage::Relief, bytes_of(&uniform).to_vec(), arrays)
            }
            Finish::Surface { arrays, layer } => {
                let [red, green, blue] = NEUTRAL.map(|part| f32::from(part) / 255.0);
                let uniform = SurfaceUniform {
                    ground: [red, green, blue, 1.0],
                    layer: *layer,
                    padding: [0; 3],
                };
                (Stage::Surface, bytes_of(&uniform).to_vec(), arrays)
            }
        };
        let dispatch = Dispatch {
            stage,
            uniform: &uniform,
            result: arrays,
            inputs: &[&slot.view],
            side: LAYER_SIDE,
        };
        self.stages.run(gpu, &dispatch)?;
        if let Some(left) = steps_left {
            *left = left.saturating_sub(1);
        }
        Ok(Made::Whole)
    }

    fn upload(&mut self, gpu: &Gpu, key: slots::ResultKey, words: &[u32], run: u64) {
        self.slots.lend(gpu, key, run);
        let Some(slot) = self.slots.peek(key) else {
            return;
        };
        slot.write(gpu, words);
    }
}
