//! The data behind a scene: one elevation and one imagery data set in the tile cache.
//! In: repositories. Out: which data a tile shows now, which it should show, and height ranges for the
//! level of detail. The ranges come from the index alone, so they are the same on every node at once.

use std::path::PathBuf;
use std::sync::Arc;

use geodesy::{Ellipsoid, Tile};
use terrain::{HeightRanges, Lattice, Relief};
use tiles::{DatasetId, Lookup, OpenDataset, TileCache, TileData};

use crate::error::RenderError;

/// Sun and ambient light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit vector towards the sun in ECEF axes.
    pub sun: glam::DVec3,
    /// Share of light that is there in full shadow, 0…1.
    pub ambient: f64,
    /// Factor on slopes for shading only, ≥ 0; 1 is the truth.
    pub relief: f64,
}

/// The direction to a sun in the zenith of a place, in degrees.
#[must_use]
pub fn sun_over(latitude_deg: f64, longitude_deg: f64) -> glam::DVec3 {
    Ellipsoid::normal(latitude_deg, longitude_deg)
}

/// The air around the planet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Scale height in metres; 0 switches air off.
    pub thickness_m: f64,
    /// Its colour, gamma encoded, 0…1.
    pub colour: [f64; 3],
}

/// What to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneData {
    /// The planet.
    pub ellipsoid: Ellipsoid,
    /// Name and repository of the elevation layer.
    pub elevation: Option<(String, PathBuf)>,
    /// Name and repository of the imagery layer.
    pub imagery: Option<(String, PathBuf)>,
    /// Light.
    pub light: Light,
    /// Air.
    pub air: Air,
    /// Refinement level l of the base patches, 0…7.
    pub refinement: u8,
    /// Side in pixels beyond which a tile is split.
    pub tile_px: f64,
    /// No tile is split beyond this level.
    pub deepest_level: u8,
}

/// One opened layer.
#[derive(Clone)]
pub(crate) struct Layer {
    pub(crate) id: DatasetId,
    /// Tells this layer's tiles from those of others; the same on every node.
    seed: u64,
    pub(crate) data: Arc<OpenDataset>,
}

/// A tile's data as the mesh reads it.
#[derive(Debug)]
pub(crate) struct Heights(pub(crate) Arc<TileData>);

impl Lattice for Heights {
    fn tile(&self) -> Tile {
        self.0.tile
    }

    fn height(&self, i: i64, j: i64) -> Option<i32> {
        self.0.height(i, j)
    }
}

impl Layer {
    pub(crate) fn open(
        cache: &TileCache,
        (name, path): &(String, PathBuf),
        ellipsoid: &Ellipsoid,
        kind: tiles::Kind,
    ) -> Result<Self, RenderError> {
        let refuse = |reason: String| RenderError::Layer {
            layer: name.clone(),
            reason,
        };
        let id = cache
            .add_dataset(path)
            .map_err(|error| refuse(error.to_string()))?;
        let data = cache
            .dataset(id)
            .ok_or_else(|| refuse("it was closed again".to_owned()))?;
        let found = data.dataset.kind;
        if found != kind {
            return Err(refuse(format!(
                "{} holds {found:?} tiles, the scene asks for {kind:?}: correct the layer's kind or its repository",
                path.display()
            )));
        }
        if data.dataset.ellipsoid != *ellipsoid {
            return Err(refuse(format!(
                "{} was imported for an ellipsoid of {} m × {} m, the scene's planet has {} m × {} m",
                path.display(),
                data.dataset.ellipsoid.semi_major_m,
                data.dataset.ellipsoid.semi_minor_m,
                ellipsoid.semi_major_m,
                ellipsoid.semi_minor_m
            )));
        }
        // The last 16 of the id's 32 hexadecimal digits.
        let digits = id.to_string().split_off(16);
        let seed = u64::from_str_radix(&digits, 16).unwrap_or_default();
        Ok(Self { id, seed, data })
    }

    /// Changes when the layer's tiles may have changed: another data set, or another import into it.
    pub(crate) fn version(&self) -> (DatasetId, u32) {
        (self.id, self.data.dataset.revision)
    }

    /// A number of a tile of this data set that is the same on every node.
    pub(crate) fn number(&self, tile: Tile) -> u64 {
        self.seed
            .wrapping_add(tile.id().wrapping_mul(0x9E37_79B9_7F4A_7C15))
    }

    /// The tile whose data a leaf should show: itself, or its finest ancestor that exists.
    pub(crate) fn best(&self, leaf: Tile) -> Option<Tile> {
        self.data.index.best(leaf)
    }

    /// The data that a leaf can show now: the finest of its lineage that is in memory. Never blocks.
    pub(crate) fn resident(&self, cache: &TileCache, leaf: Tile) -> Option<Arc<TileData>> {
        self.best(leaf)?
            .lineage()
            .find_map(|tile| match cache.get(self.id, tile) {
                Lookup::Ready(data) => Some(data),
                Lookup::Absent | Lookup::Pending | Lookup::Failed(_) => None,
            })
    }
}

/// A scene with its data opened.
pub(crate) struct LoadedScene {
    pub(crate) data: SceneData,
    pub(crate) elevation: Option<Layer>,
    pub(crate) imagery: Option<Layer>,
}

impl LoadedScene {
    /// What the level of detail asks.
    pub(crate) fn ranges(&self) -> Ranges<'_> {
        Ranges {
            elevation: self.elevation.as_ref(),
            imagery: self.imagery.as_ref(),
            refinement: self.data.refinement,
        }
    }
}

/// How deep a planet without elevation is divided for its curvature alone: at this level, with the base
/// patches on top, a chord is less than a metre off the ellipsoid.
const BARE_LEVEL: u8 = 6;

/// What the level of detail asks of the data, answered by the indices alone.
pub(crate) struct Ranges<'a> {
    pub(crate) elevation: Option<&'a Layer>,
    pub(crate) imagery: Option<&'a Layer>,
    pub(crate) refinement: u8,
}

impl HeightRanges for Ranges<'_> {
    fn range_m(&self, tile: Tile) -> (f64, f64) {
        let Some(layer) = self.elevation else {
            return (0.0, 0.0);
        };
        // A tile may show a coarser, smoothed level, whose values mix in those of its surroundings.
        let wide = layer.best(tile).map(|best| best.parent().unwrap_or(best));
        let range = wide.and_then(|tile| layer.data.index.range(tile));
        let (lowest, highest) = range.unwrap_or((0.0, 0.0));
        let unit = layer.data.dataset.unit();
        // Ground without data lies on the ellipsoid.
        ((lowest * unit).min(0.0), (highest * unit).max(0.0))
    }

    fn relief(&self, tile: Tile) -> Relief {
        let best = self
            .elevation
            .and_then(|layer| Some((layer, layer.best(tile)?)));
        let flat = Relief {
            lowest_m: 0.0,
            highest_m: 0.0,
            level: tile.level(),
        };
        best.map_or(flat, |(layer, best)| {
            let (lowest, highest) = layer.data.index.range(best).unwrap_or((0.0, 0.0));
            let unit = layer.data.dataset.unit();
            Relief {
                lowest_m: lowest * unit,
                highest_m: highest * unit,
                level: best.level(),
            }
        })
    }

    fn is_worth_dividing(&self, tile: Tile) -> bool {
        let finer = |layer: &Layer| {
            let index = &layer.data.index;
            tile.level() < index.deepest_level()
                && tile
                    .children()
                    .is_some_and(|children| children.iter().any(|c| index.contains(*c)))
        };
        // A patch has vertices on every node of data this many levels up.
        let reach = (geodesy::LATTICE_BITS - 1).saturating_sub(self.refinement);
        let meshed = self.elevation.map_or(BARE_LEVEL, |layer| {
            layer.best(tile).map_or(BARE_LEVEL, Tile::level)
        });
        tile.level() < meshed + reach
            || self.elevation.is_some_and(finer)
            || self.imagery.is_some_and(finer)
    }
}

impl Ranges<'_> {
    /// The lowest height drawn anywhere.
    pub(crate) fn floor_m(&self) -> f64 {
        Tile::ROOTS
            .iter()
            .map(|root| self.range_m(*root).0)
            .fold(0.0, f64::min)
    }
}
