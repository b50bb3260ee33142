//! A scene that is opened and put in order: data sets, and what is visible under which parameters.
//!
//! In: a scene, the tile cache. Out: per parameter set (the scene's own and each lens's) the layers that show
//! anything, sorted as they are fused; which lenses touch a tile. It processes nothing.

use std::cell::RefCell;
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::rc::Rc;
use std::sync::Arc;

use geodesy::{Circle, Relation, Tile};
use tiles::TileCache;

use crate::error::RenderError;
use crate::layer::{Fusion, LayerParameters, Process};
use crate::process::{Ground, MOST_INPUTS, Plan};
use crate::scene::SceneData;
use crate::source::Source;

/// Answers of each sort that a scene remembers before it begins anew: more than a selection has tiles.
const MOST_MEMORIES: usize = 65_536;
/// Plans that it remembers: those of several views with all ancestors.
const MOST_PLANS: usize = 8_192;

/// A layer under a parameter set, where it shows anything.
#[derive(Clone, Debug)]
pub(crate) struct Active {
    /// Index of the layer.
    pub(crate) layer: usize,
    pub(crate) fusion: Fusion,
    pub(crate) process: Process,
}

/// What is visible under one set of parameters, in the order of fusion.
#[derive(Clone, Debug, Default)]
pub(crate) struct ParameterSet {
    pub(crate) heights: Vec<Active>,
    pub(crate) colours: Vec<Active>,
    /// Stands for all that decides heights.
    pub(crate) heights_content: u64,
}

/// A lens, and whether it has to do with heights, colours or both.
#[derive(Debug)]
pub(crate) struct LoadedLens {
    pub(crate) circle: Circle,
    pub(crate) changes_heights: bool,
    pub(crate) changes_colours: bool,
    /// Stands for its place and size.
    pub(crate) content: u64,
}

/// Answers that only depend on the scene, remembered because every frame asks for them.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    pub(crate) ranges_m: HashMap<Tile, (f64, f64)>,
    plans: HashMap<(Tile, bool), Arc<Plan>>,
}

/// A scene with its data opened.
pub(crate) struct LoadedScene {
    pub(crate) revision: u64,
    pub(crate) data: SceneData,
    pub(crate) ground: Ground,
    /// The data of each layer that has any.
    pub(crate) sources: Vec<Option<Source>>,
    /// The scene's own parameters, then those of each lens.
    pub(crate) sets: Vec<ParameterSet>,
    pub(crate) lenses: Vec<LoadedLens>,
    /// Layers of elevation that are visible under any set, in the order of layers.
    pub(crate) elevation_layers: Vec<usize>,
    /// Layers with other data that are visible under any set.
    pub(crate) colour_layers: Vec<usize>,
    /// Some set draws lines, which must be as sharp as the screen.
    pub(crate) sharp: bool,
    /// Some set makes colours of heights.
    pub(crate) colours_from_heights: bool,
    /// How tiles lie to each lens. Shared with other scenes of the same lenses.
    relations: Rc<RefCell<HashMap<Tile, Arc<[Relation]>>>>,
    pub(crate) memory: RefCell<Memory>,
}

impl LoadedScene {
    /// Opens a scene. Data that `known` scenes have open, or that was `opened` ahead, is not opened again.
    pub(crate) fn open(
        cache: &TileCache,
        revision: u64,
        data: SceneData,
        known: &[&Self],
        opened: &[Source],
    ) -> Result<Self, RenderError> {
        let mut sources = Vec::with_capacity(data.layers.len());
        for layer in &data.layers {
            let Some((path, kind)) = layer
                .repository
                .as_ref()
                .zip(layer.parameters.process.data_kind())
            else {
                sources.push(None);
                continue;
            };
            let open = known
                .iter()
                .filter(|scene| scene.data.ellipsoid == data.ellipsoid)
                .flat_map(|scene| scene.sources.iter().flatten())
                .chain(opened)
                .find(|source| {
                    let dataset = &source.data.dataset;
                    source.path == *path
                        && dataset.kind == kind
                        && dataset.ellipsoid == data.ellipsoid
                });
            let source = match open {
                Some(source) => source.clone(),
                None => Source::open(cache, &layer.name, path, &data.ellipsoid, kind)?,
            };
            sources.push(Some(source));
        }
        let mut sets = vec![ParameterSet::of(data.layers.iter().map(|l| &l.parameters))];
        let mut lenses = Vec::with_capacity(data.lenses.len());
        for lens in &data.lenses {
            let circle = Circle::new(
                &data.ellipsoid,
                lens.latitude_deg,
                lens.longitude_deg,
                lens.radius_m,
            )
            .map_err(|error| RenderError::Lens {
                lens: lens.name.clone(),
                reason: error.to_string(),
            })?;
            let within = (0..data.layers.len()).map(|index| {
                let own = lens.layers.iter().find(|(layer, _)| *layer == index);
                own.map_or(&data.layers[index].parameters, |(_, parameters)| parameters)
            });
            let set = ParameterSet::of(within);
            let outside = &sets[0];
            let changes_heights = set.heights_content != outside.heights_content;
            let changes_colours = content_of(&set.colours) != content_of(&outside.colours);
            let mut hasher = DefaultHasher::new();
            (
                lens.latitude_deg.to_bits(),
                lens.longitude_deg.to_bits(),
                lens.radius_m.to_bits(),
            )
                .hash(&mut hasher);
            lenses.push(LoadedLens {
                circle,
                changes_heights,
                changes_colours,
                content: hasher.finish(),
            });
            sets.push(set);
        }
        check(&data, &sources, &sets)?;
        let places = |lenses: &[LoadedLens]| -> Vec<u64> {
            lenses.iter().map(|lens| lens.content).collect()
        };
        let relations = known
            .iter()
            .filter(|scene| scene.data.ellipsoid == data.ellipsoid)
            .find(|scene| places(&scene.lenses) == places(&lenses))
            .map_or_else(Rc::default, |scene| Rc::clone(&scene.relations));
        let layers_of = |heights: bool| {
            let mut layers: Vec<usize> = sets
                .iter()
                .flat_map(|set| if heights { &set.heights } else { &set.colours })
                .map(|active| active.layer)
                .filter(|layer| sources[*layer].is_some())
                .collect();
            layers.sort_unstable();
            layers.dedup();
            layers
        };
        let (elevation_layers, colour_layers) = (layers_of(true), layers_of(false));
        let colours = || sets.iter().flat_map(|set| &set.colours);
        Ok(Self {
            revision,
            ground: Ground::new(data.ellipsoid, data.tile_px),
            elevation_layers,
            colour_layers,
            sharp: colours().any(|active| matches!(active.process, Process::Isolines(_))),
            colours_from_heights: colours().any(|active| active.process.data_kind().is_none()),
            data,
            sources,
            sets,
            lenses,
            relations,
            memory: RefCell::default(),
        })
    }

    /// The data of a layer.
    pub(crate) fn source(&self, layer: usize) -> Option<&Source> {
        self.sources.get(layer)?.as_ref()
    }

    /// How a tile lies to each lens.
    pub(crate) fn relations(&self, tile: Tile) -> Arc<[Relation]> {
        let relations = &self.relations;
        if let Some(known) = relations.borrow().get(&tile) {
            return Arc::clone(known);
        }
        let found: Arc<[Relation]> = self
            .lenses
            .iter()
            .map(|lens| lens.circle.relation(tile))
            .collect();
        let mut relations = relations.borrow_mut();
        if relations.len() >= MOST_MEMORIES {
            relations.clear();
        }
        relations.insert(tile, Arc::clone(&found));
        found
    }

    /// The parameter sets that decide heights (or else colours) somewhere in a tile: the one that holds where no
    /// rim passes, then the lenses whose rims do, later ones above.
    pub(crate) fn sets_in(&self, tile: Tile, heights: bool) -> Vec<usize> {
        let mut sets = vec![0];
        // A lens that changes nothing hides an earlier one all the same: its parameters are the scene's.
        let changes = |lens: &LoadedLens| {
            if heights {
                lens.changes_heights
            } else {
                lens.changes_colours
            }
        };
        if !self.lenses.iter().any(changes) {
            return sets;
        }
        for (lens, relation) in self.relations(tile).iter().enumerate() {
            match relation {
                Relation::Inside => sets = vec![lens + 1],
                Relation::Border => sets.push(lens + 1),
                Relation::Outside => {}
            }
        }
        sets
    }

    /// The tile on whose lattice a leaf's fused heights are made: of the finest data there, or finer, down to the leaf
    /// itself, as long as the rim of a lens cuts it, which must be as sharp as the screen. `None` where there are none.
    pub(crate) fn heights_tile(&self, leaf: Tile) -> Option<Tile> {
        let level = self.finest(&self.elevation_layers, leaf)?;
        Some(self.uncut(leaf, level, true))
    }

    /// The same for fused colours; lines of equal height are sharp everywhere.
    pub(crate) fn colours_tile(&self, leaf: Tile) -> Option<Tile> {
        let heights = if self.colours_from_heights {
            self.heights_tile(leaf)
        } else {
            None
        };
        let finest = self.finest(&self.colour_layers, leaf);
        let level = finest.max(heights.map(Tile::level))?;
        if self.sharp && heights.is_some() {
            return Some(leaf);
        }
        Some(self.uncut(leaf, level, false))
    }

    /// The coarsest tile between a level and a leaf in which one parameter set holds throughout, else the leaf.
    fn uncut(&self, leaf: Tile, level: u8, heights: bool) -> Tile {
        let cut = |tile: Tile| self.sets_in(tile, heights).len() > 1;
        (level..leaf.level())
            .map(|level| leaf.ancestor(level))
            .find(|tile| !cut(*tile))
            .unwrap_or(leaf)
    }

    fn finest(&self, layers: &[usize], leaf: Tile) -> Option<u8> {
        let best = layers
            .iter()
            .filter_map(|layer| self.source(*layer)?.best(leaf));
        best.map(Tile::level).max()
    }

    /// Whose samples each layer has in a tile: its own or its finest ancestor's.
    pub(crate) fn best_sources(&self, tile: Tile) -> Vec<Option<Tile>> {
        let best = |source: &Option<Source>| source.as_ref()?.best(tile);
        self.sources.iter().map(best).collect()
    }

    /// The plan to a tile's fused heights, or else colours.
    pub(crate) fn plan(&self, tile: Tile, heights: bool) -> Arc<Plan> {
        let key = (tile, heights);
        if let Some(known) = self.memory.borrow().plans.get(&key) {
            return Arc::clone(known);
        }
        let plan = Arc::new(self.plan_with(tile, heights, &self.best_sources(tile)));
        let plans = &mut self.memory.borrow_mut().plans;
        if plans.len() >= MOST_PLANS {
            plans.clear();
        }
        plans.insert(key, Arc::clone(&plan));
        plan
    }

    /// The same where layers show other data than their best.
    pub(crate) fn plan_with(&self, tile: Tile, heights: bool, sources: &[Option<Tile>]) -> Plan {
        if heights {
            Plan::of_heights(self, tile, sources)
        } else {
            Plan::of_colours(self, tile, sources)
        }
    }
}

impl Memory {
    /// Remembers a range of heights.
    pub(crate) fn keep_range(&mut self, tile: Tile, range_m: (f64, f64)) {
        if self.ranges_m.len() >= MOST_MEMORIES {
            self.ranges_m.clear();
        }
        self.ranges_m.insert(tile, range_m);
    }
}

impl ParameterSet {
    fn of<'a>(layers: impl Iterator<Item = &'a LayerParameters>) -> Self {
        let mut set = Self::default();
        for (layer, parameters) in layers.enumerate() {
            let fusion = parameters.fusion;
            if fusion.weight <= 0.0 || fusion.opacity <= 0.0 {
                continue;
            }
            let active = Active {
                layer,
                fusion,
                process: parameters.process.clone(),
            };
            if parameters.process.makes_heights() {
                set.heights.push(active);
            } else {
                set.colours.push(active);
            }
        }
        // Stable: equal layers stay in the order of their names.
        let order = |active: &Active| (active.fusion.priority, active.fusion.blend);
        set.heights.sort_by_key(order);
        set.colours.sort_by_key(order);
        set.heights_content = content_of(&set.heights);
        set
    }
}

/// A number that stands for layers and all their parameters.
fn content_of(layers: &[Active]) -> u64 {
    let mut hasher = DefaultHasher::new();
    for active in layers {
        // The debug form of plain numbers tells any two of them apart.
        format!("{active:?}").hash(&mut hasher);
    }
    hasher.finish()
}

fn check(
    data: &SceneData,
    sources: &[Option<Source>],
    sets: &[ParameterSet],
) -> Result<(), RenderError> {
    for set in sets {
        for (what, layers) in [("elevation", &set.heights), ("other", &set.colours)] {
            if layers.len() > MOST_INPUTS {
                return Err(RenderError::TooManyLayers {
                    what,
                    count: layers.len(),
                    most: MOST_INPUTS,
                });
            }
        }
        for active in &set.colours {
            if let (Process::Imagery(imagery), Some(Some(source)), Some(layer)) = (
                &active.process,
                sources.get(active.layer),
                data.layers.get(active.layer),
            ) {
                source.check_channels(&layer.name, imagery.channels)?;
            }
        }
    }
    Ok(())
}
