//! What has to be done to show a tile: uploads and stages, each known by what it makes.
//!
//! In: a scene, a tile, whose samples each layer has there. Out: a plan, inputs before what reads them. The same
//! parameters give the same numbers, so results are found again whatever revision they were made for. Where the rim
//! of a lens passes through the tile, it is processed with both parameter sets and the results are put together
//! sample by sample (Lambers, §1.5.2). It makes nothing itself.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};

use bytemuck::bytes_of;
use geodesy::Tile;
use shaders::Stage;

use crate::layer::{Fusion, Process};
use crate::loaded::{Active, LoadedScene};
use crate::process::uniforms::{self, Step};
use crate::source::Source;

/// How raw samples are packed into words.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Packing {
    Heights,
    Amplitudes,
    Colours {
        channels: [u8; 3],
        range: [f64; 2],
    },
    /// Bytes that are shown as they are, as a stage without any effect would leave them.
    Finished {
        channels: [u8; 3],
    },
}

/// One thing to do.
#[derive(Debug)]
pub(crate) enum Work {
    /// Bring a layer's raw samples of a tile to the GPU.
    Upload {
        layer: usize,
        source: Tile,
        packing: Packing,
    },
    /// A tile of holes.
    Holes { word: u32 },
    /// Run a stage over earlier results of the plan.
    Stage {
        stage: Stage,
        uniform: Vec<u8>,
        inputs: Vec<usize>,
    },
}

/// A result and how it is made.
#[derive(Debug)]
pub(crate) struct Node {
    /// The tile and what stands for everything that went into the result.
    pub(crate) key: (Tile, u64),
    pub(crate) work: Work,
}

/// All that leads to one result.
#[derive(Debug)]
pub(crate) struct Plan {
    pub(crate) nodes: Vec<Node>,
    /// The result; `None` where no layer has anything here.
    pub(crate) root: Option<usize>,
}

impl Plan {
    /// To the fused heights of a tile. `sources` tells by layer whose samples it has there.
    pub(crate) fn of_heights(scene: &LoadedScene, tile: Tile, sources: &[Option<Tile>]) -> Self {
        let mut planner = Planner::new(scene, tile, sources);
        let root = planner.heights();
        Self {
            nodes: planner.nodes,
            root,
        }
    }

    /// To the fused colours of a tile.
    pub(crate) fn of_colours(scene: &LoadedScene, tile: Tile, sources: &[Option<Tile>]) -> Self {
        let mut planner = Planner::new(scene, tile, sources);
        let heights = if scene.colours_from_heights {
            planner.heights()
        } else {
            None
        };
        let root = planner.colours(heights);
        Self {
            nodes: planner.nodes,
            root,
        }
    }

    /// The result's key.
    pub(crate) fn key(&self) -> Option<(Tile, u64)> {
        self.root.and_then(|root| Some(self.nodes.get(root)?.key))
    }
}

struct Planner<'a> {
    scene: &'a LoadedScene,
    tile: Tile,
    sources: &'a [Option<Tile>],
    nodes: Vec<Node>,
}

impl<'a> Planner<'a> {
    fn new(scene: &'a LoadedScene, tile: Tile, sources: &'a [Option<Tile>]) -> Self {
        Self {
            scene,
            tile,
            sources,
            nodes: Vec::new(),
        }
    }

    /// The node that makes this, a new one where there is none.
    fn node(&mut self, tile: Tile, work: Work) -> usize {
        let mut hasher = DefaultHasher::new();
        match &work {
            Work::Upload { layer, packing, .. } => {
                let source = self.scene.source(*layer);
                source.map(Source::version).hash(&mut hasher);
                let packed = match packing {
                    Packing::Heights => (0, [0; 3], [0; 2]),
                    Packing::Amplitudes => (1, [0; 3], [0; 2]),
                    Packing::Colours { channels, range } => (2, *channels, range.map(f64::to_bits)),
                    Packing::Finished { channels } => (3, *channels, [0; 2]),
                };
                packed.hash(&mut hasher);
            }
            Work::Holes { word } => (u64::MAX, word).hash(&mut hasher),
            Work::Stage {
                stage,
                uniform,
                inputs,
            } => {
                (stage, uniform).hash(&mut hasher);
                for input in inputs {
                    self.nodes[*input].key.hash(&mut hasher);
                }
            }
        }
        let key = (tile, hasher.finish());
        if let Some(known) = self.nodes.iter().position(|node| node.key == key) {
            return known;
        }
        self.nodes.push(Node { key, work });
        self.nodes.len() - 1
    }

    fn stage(&mut self, (stage, uniform): Step, inputs: Vec<usize>) -> usize {
        let work = Work::Stage {
            stage,
            uniform,
            inputs,
        };
        self.node(self.tile, work)
    }

    /// A layer's raw samples on the tile's lattice; `None` where it has none.
    fn samples(&mut self, active: &Active) -> Option<usize> {
        let source = (*self.sources.get(active.layer)?)?;
        let packing = match &active.process {
            Process::Elevation(_) => Packing::Heights,
            Process::Sar(_) => Packing::Amplitudes,
            Process::Imagery(imagery) => Packing::Colours {
                channels: imagery.channels,
                range: imagery
                    .range
                    .unwrap_or(self.scene.source(active.layer)?.range),
            },
            _ => return None,
        };
        let work = Work::Upload {
            layer: active.layer,
            source,
            packing,
        };
        let raw = self.node(source, work);
        if source == self.tile {
            return Some(raw);
        }
        let colours = matches!(packing, Packing::Colours { .. });
        let resample = uniforms::resample(self.tile, source, colours);
        Some(self.stage(resample, vec![raw]))
    }

    /// Colours that need no stage at all: bytes of this very tile without any change.
    fn finished(&mut self, active: &Active) -> Option<usize> {
        let Process::Imagery(imagery) = &active.process else {
            return None;
        };
        let source = (*self.sources.get(active.layer)?)?;
        let data = &self.scene.source(active.layer)?.data.dataset;
        let plain = source == self.tile
            && data.sample_type == tiles::SampleType::U8
            && imagery.changes_nothing();
        let channels = imagery.channels;
        let work = Work::Upload {
            layer: active.layer,
            source,
            packing: Packing::Finished { channels },
        };
        plain.then(|| self.node(source, work))
    }

    /// A layer's result from its samples or from the fused heights.
    fn processed(&mut self, active: &Active, heights: Option<usize>) -> Option<usize> {
        if let Some(finished) = self.finished(active) {
            return Some(finished);
        }
        let input = if active.process.data_kind().is_some() {
            self.samples(active)?
        } else {
            heights?
        };
        let range = self
            .scene
            .source(active.layer)
            .map_or([0.0, 1.0], |source| source.range);
        Some(
            match uniforms::process(&active.process, &self.scene.ground, self.tile, range) {
                Some(step) => self.stage(step, vec![input]),
                None => input,
            },
        )
    }

    /// All layers of a set, fused.
    fn fused(&mut self, stage: Stage, layers: &[Active], heights: Option<usize>) -> Option<usize> {
        let mut inputs = Vec::with_capacity(layers.len());
        let mut fusions: Vec<Fusion> = Vec::with_capacity(layers.len());
        for active in layers {
            if let Some(input) = self.processed(active, heights) {
                inputs.push(input);
                fusions.push(active.fusion);
            }
        }
        match (inputs.as_slice(), fusions.as_slice()) {
            ([], _) => None,
            // Over nothing every blend is the layer itself; heights over nothing are not dimmed either.
            ([only], [fusion]) if stage == Stage::FuseElevation || fusion.opacity >= 1.0 => {
                Some(*only)
            }
            _ => {
                let uniform = uniforms::fuse(&fusions);
                Some(self.stage((stage, bytes_of(&uniform).to_vec()), inputs))
            }
        }
    }

    fn heights(&mut self) -> Option<usize> {
        let scene = self.scene;
        let mut result = None;
        for (index, set) in scene.sets_in(self.tile, true).into_iter().enumerate() {
            let fused = self.fused(Stage::FuseElevation, &scene.sets[set].heights, None);
            result = if index == 0 {
                fused
            } else {
                self.within(set, result, fused, shaders::INVALID_WORD)
            };
        }
        result
    }

    fn colours(&mut self, heights: Option<usize>) -> Option<usize> {
        let scene = self.scene;
        let mut result = None;
        for (index, set) in scene.sets_in(self.tile, false).into_iter().enumerate() {
            let fused = self.fused(Stage::FuseColour, &scene.sets[set].colours, heights);
            result = if index == 0 {
                fused
            } else {
                self.within(set, result, fused, 0)
            };
        }
        result
    }

    /// One result outside a lens, another inside.
    fn within(
        &mut self,
        set: usize,
        outside: Option<usize>,
        inside: Option<usize>,
        hole: u32,
    ) -> Option<usize> {
        if outside == inside {
            return outside;
        }
        let lens = self.scene.lenses.get(set.checked_sub(1)?)?;
        let uniform = uniforms::lens(&lens.circle, self.tile);
        let mut or_holes = |node: Option<usize>| {
            node.unwrap_or_else(|| self.node(self.tile, Work::Holes { word: hole }))
        };
        let inputs = vec![or_holes(outside), or_holes(inside)];
        Some(self.stage((Stage::Lens, bytes_of(&uniform).to_vec()), inputs))
    }
}
