//! The data behind a layer: one data set of the tile cache.
//! In: a repository. Out: which data a tile shows now, which it should show, and figures of the whole data set that
//! decide how its samples are shown. All but what is in memory comes from files read when the layer is opened, so it
//! is the same on every node at once.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use geodesy::{Ellipsoid, Tile};
use terrain::Lattice;
use tiles::{DatasetId, Kind, Lookup, OpenDataset, SampleType, TileCache, TileData};

use crate::error::RenderError;

/// Tiles of the finest level from which mean and deviation of radar amplitude are taken.
const STATISTICS_TILES: usize = 8;

/// One opened data set.
#[derive(Clone)]
pub(crate) struct Source {
    pub(crate) id: DatasetId,
    pub(crate) path: PathBuf,
    pub(crate) data: Arc<OpenDataset>,
    /// Samples that are shown as 0 and 1 where nobody asks for others.
    pub(crate) range: [f64; 2],
    /// Lowest and highest sample of any tile.
    pub(crate) bounds: (f64, f64),
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

impl Source {
    pub(crate) fn open(
        cache: &TileCache,
        layer: &str,
        path: &Path,
        ellipsoid: &Ellipsoid,
        kind: Kind,
    ) -> Result<Self, RenderError> {
        let refuse = |reason: String| RenderError::Layer {
            layer: layer.to_owned(),
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
        let bounds = bounds(&data, |_| true).unwrap_or_default();
        let range = match kind {
            Kind::Elevation => [0.0, 1.0],
            Kind::Imagery if data.dataset.sample_type == SampleType::U8 => [0.0, 255.0],
            Kind::Imagery => whole_range(&data),
            Kind::Sar => amplitude_range(&data).map_err(refuse)?,
        };
        Ok(Self {
            id,
            path: path.to_owned(),
            data,
            range,
            bounds,
        })
    }

    /// Refuses channels that the data does not have.
    pub(crate) fn check_channels(&self, layer: &str, channels: [u8; 3]) -> Result<(), RenderError> {
        let available = self.data.dataset.channels;
        let shown = crate::process::shown_channels(channels, available);
        match shown.into_iter().find(|channel| *channel >= available) {
            None => Ok(()),
            Some(channel) => Err(RenderError::Layer {
                layer: layer.to_owned(),
                reason: format!(
                    "{} has {available} channels, numbered from 0, and no channel {channel}: correct the layer's channels",
                    self.path.display()
                ),
            }),
        }
    }

    /// Changes when the layer's tiles may have changed: another data set, or another import into it.
    pub(crate) fn version(&self) -> (DatasetId, u32) {
        (self.id, self.data.dataset.revision)
    }

    /// A number of a tile of this data set that is the same on every node.
    pub(crate) fn number(&self, tile: Tile) -> u64 {
        self.id.number(tile)
    }

    /// The tile whose data a leaf should show: itself, or its finest ancestor that exists.
    pub(crate) fn best(&self, leaf: Tile) -> Option<Tile> {
        self.data.index.best(leaf)
    }

    /// Whether any child of the tile has data of its own.
    pub(crate) fn is_finer_below(&self, tile: Tile) -> bool {
        let index = &self.data.index;
        tile.level() < index.deepest_level()
            && tile
                .children()
                .is_some_and(|children| children.iter().any(|child| index.contains(*child)))
    }

    /// Bounds of the samples that may be shown within a tile: of its own data, and of any coarser level that may stand
    /// in for it. Each level is smoothed, and has bounds of its own.
    pub(crate) fn bounds_in(&self, tile: Tile) -> Option<(f64, f64)> {
        let index = &self.data.index;
        let levels = self.best(tile)?.lineage();
        levels
            .filter_map(|level| index.range(level))
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// What can stand in now for a tile that is not in memory: the finest of its ancestors that is. Never blocks.
    pub(crate) fn stand_in(&self, cache: &TileCache, tile: Tile) -> Option<Arc<TileData>> {
        tile.lineage()
            .skip(1)
            .find_map(|tile| match cache.get(self.id, tile) {
                Lookup::Ready(data) => Some(data),
                _ => None,
            })
    }
}

/// The range of all samples of the finest level. Coarser levels are smoothed, and the coarsest may not hold a
/// single node of a small data set.
fn whole_range(data: &OpenDataset) -> [f64; 2] {
    let deepest = data.index.deepest_level();
    match bounds(data, |tile| tile.level() == deepest) {
        Some((low, high)) if low < high => [low, high],
        _ => [0.0, 1.0],
    }
}

/// Lowest and highest sample of some tiles. A tile without any valid node of its own says 0 and 0, which is left
/// out.
fn bounds(data: &OpenDataset, counts: impl Fn(Tile) -> bool) -> Option<(f64, f64)> {
    let tiles = data.index.tiles().into_iter().filter(|tile| counts(*tile));
    tiles
        .filter_map(|tile| data.index.range(tile))
        .filter(|range| *range != (0.0, 0.0))
        .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// 0 to mean + 3 deviations of the finest data (Lambers, eq. 2.3), over a few tiles spread over the data set.
fn amplitude_range(data: &OpenDataset) -> Result<[f64; 2], String> {
    let tiles = data.index.tiles();
    let deepest = tiles.iter().map(|tile| tile.level()).max();
    let finest: Vec<Tile> = tiles
        .into_iter()
        .filter(|tile| Some(tile.level()) == deepest)
        .collect();
    let step = finest.len().div_ceil(STATISTICS_TILES).max(1);
    let (mut sum, mut squares, mut count) = (0.0, 0.0, 0_u64);
    for tile in finest.into_iter().step_by(step) {
        let found = data.read_now(tile).map_err(|error| error.to_string())?;
        let Some(found) = found else { continue };
        sum += found.statistics.sum;
        squares += found.statistics.sum_of_squares;
        count += found.statistics.count;
    }
    if count == 0 {
        return Ok(whole_range(data));
    }
    let mean = sum / count as f64;
    let deviation = (squares / count as f64 - mean * mean).max(0.0).sqrt();
    let highest = mean + 3.0 * deviation;
    Ok([0.0, if highest > 0.0 { highest } else { 1.0 }])
}
