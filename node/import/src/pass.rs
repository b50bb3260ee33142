//! The tiles of one pass: which exist already, which were made, and how a tile is put together from its layers.
//! In: a tile to make. Out: the tile in the staging store, unless nothing about it is new. A tile's nodes come, in this
//! order, from the repository's tile of the same level, from what is imported (samples or finer tiles), and, where
//! both have nothing, from coarser tiles of the repository.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::{Arc, Mutex, PoisonError};

use geodesy::{BORDER, CELLS, Direction, LatticePoint, Tile};
use tiles::{Index, Kind, Origin, Repository, SampleType, TileData};

use crate::error::ImportError;
use crate::filter::{children_in_reach, filtered, finer_tiles_at};
use crate::lru::Lru;
use crate::nodes::{Nodes, Sample, View};
use crate::resample::{MOST_CHANNELS, Resampler, beyond_nodes};

/// A tile that this pass has made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Made {
    pub(crate) lowest: f64,
    pub(crate) highest: f64,
    pub(crate) bytes: u64,
}

/// Where a tile is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Place {
    Old,
    New,
    Finer,
}

/// How a tile is to be made.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Recipe<'list> {
    /// From these sources.
    Sources(&'list [usize]),
    /// From the tiles of the next finer level.
    Children,
    /// From what it has, its holes filled from coarser tiles.
    HolesOnly,
}

/// One pass over the sources that share a level.
pub(crate) struct Pass<'import> {
    pub(crate) resampler: Resampler<'import>,
    /// The repository as it was, with its index; `None` before the first import.
    pub(crate) old: Option<(&'import Repository, &'import Index)>,
    /// Finished tiles, up to the wanted level.
    pub(crate) staged: Repository,
    /// Finished tiles beyond the wanted level.
    pub(crate) finer: Repository,
    /// The level that is wanted.
    pub(crate) level: u8,
    pub(crate) sample_type: SampleType,
    pub(crate) made: Mutex<HashMap<Tile, Made>>,
    pub(crate) tiles: Lru<(u8, Tile), Arc<TileData>>,
    /// True once the finer levels of the repository are at work.
    pub(crate) filling: bool,
}

type Found = Result<Option<Arc<TileData>>, ImportError>;

impl Pass<'_> {
    fn kind(&self) -> Kind {
        self.resampler.kind
    }

    fn colour(&self) -> bool {
        self.kind() == Kind::Imagery
    }

    fn channels(&self) -> usize {
        self.resampler.channels
    }

    /// Tiles beyond the wanted level are set apart, except when those of the repository are filled.
    fn place_of(&self, tile: Tile) -> Place {
        if tile.level() > self.level && !self.filling {
            Place::Finer
        } else {
            Place::New
        }
    }

    /// Whether this pass has made the tile.
    pub(crate) fn is_made(&self, tile: Tile) -> bool {
        self.made
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .contains_key(&tile)
    }

    /// Whether the repository had the tile. Levels that will not be kept have no past.
    pub(crate) fn is_old(&self, tile: Tile) -> bool {
        self.place_of(tile) == Place::New && self.old.is_some_and(|(_, index)| index.contains(tile))
    }

    fn exists(&self, tile: Tile) -> bool {
        self.is_made(tile) || self.is_old(tile)
    }

    fn load(&self, place: Place, tile: Tile) -> Found {
        let store = match place {
            Place::Old => match self.old {
                Some((repository, _)) => repository,
                None => return Ok(None),
            },
            Place::New => &self.staged,
            Place::Finer => &self.finer,
        };
        let key = (place as u8, tile);
        if let Some(data) = self.tiles.get(key) {
            return Ok(Some(data));
        }
        let bytes = store
            .read(tile)
            .map_err(|e| ImportError::repository(store.root(), &e))?;
        let data = match bytes
            .as_deref()
            .map(|bytes| TileData::decode_tile(bytes, tile))
        {
            Some(Ok(data)) => Arc::new(data),
            broken => {
                let problem = match broken {
                    Some(Err(error)) => error.to_string(),
                    _ => "its file is missing, though the index lists it".to_owned(),
                };
                return Err(ImportError::Tile {
                    directory: store.root().to_owned(),
                    tile,
                    problem: format!("{problem}. Import the sources into a new directory."),
                });
            }
        };
        self.tiles
            .insert(key, data.clone(), data.byte_size() as u64);
        Ok(Some(data))
    }

    /// The tile as the repository had it.
    fn old_tile(&self, tile: Tile) -> Found {
        if self.is_old(tile) {
            self.load(Place::Old, tile)
        } else {
            Ok(None)
        }
    }

    /// The tile as it is now.
    fn tile_now(&self, tile: Tile) -> Found {
        if self.is_made(tile) {
            self.load(self.place_of(tile), tile)
        } else {
            self.old_tile(tile)
        }
    }

    /// Takes over a tile that an earlier run finished. False where its file is broken: it is made again.
    pub(crate) fn take_over(&self, tile: Tile, bytes: u64) -> bool {
        let Ok(Some(data)) = self.load(self.place_of(tile), tile) else {
            return false;
        };
        self.note(&data, bytes);
        true
    }

    fn note(&self, data: &TileData, bytes: u64) {
        let made = Made {
            lowest: data.statistics.lowest,
            highest: data.statistics.highest,
            bytes,
        };
        self.made
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(data.tile, made);
    }

    /// Makes one tile.
    pub(crate) fn make(&self, tile: Tile, recipe: Recipe<'_>) -> Result<(), ImportError> {
        match self.sample_type {
            SampleType::I32 => self.make_as::<i32>(tile, recipe),
            SampleType::U8 => self.make_as::<u8>(tile, recipe),
            SampleType::U16 => self.make_as::<u16>(tile, recipe),
            SampleType::F32 => self.make_as::<f32>(tile, recipe),
        }
    }

    fn make_as<T: Sample>(&self, tile: Tile, recipe: Recipe<'_>) -> Result<(), ImportError> {
        let old = self.old_tile(tile)?;
        let mut nodes = match &old {
            Some(data) => self.unpacked::<T>(data)?,
            None => Nodes::empty(self.channels()),
        };
        if old.is_none() {
            self.borrow_border(tile, &mut nodes)?;
        }
        let mut origin = None;
        let exists = match recipe {
            Recipe::Sources(candidates) => {
                origin = self.resampler.fill(tile, candidates, &mut nodes)?;
                old.is_some() || nodes.any_core()
            }
            Recipe::Children => {
                self.filter_children(tile, &mut nodes)?;
                let children = tile.children().into_iter().flatten();
                old.is_some() || children.into_iter().any(|child| self.exists(child))
            }
            Recipe::HolesOnly => old.is_some(),
        };
        if !exists {
            return Ok(());
        }
        self.fill_holes(tile, &mut nodes)?;
        let inconsistent = |error: tiles::EncodeError| ImportError::Tile {
            directory: self.staged.root().to_owned(),
            tile,
            problem: error.to_string(),
        };
        let data = nodes.into_tile(tile, self.kind()).map_err(inconsistent)?;
        if old.is_some_and(|old| *old == data) {
            return Ok(());
        }
        let bytes = self.encoded(&data, origin).map_err(inconsistent)?;
        let store = if self.place_of(tile) == Place::New {
            &self.staged
        } else {
            &self.finer
        };
        store
            .write_atomic(tile, &bytes)
            .map_err(|error| ImportError::repository(store.root(), &error))?;
        let data = Arc::new(data);
        let key = (self.place_of(tile) as u8, tile);
        self.tiles
            .insert(key, data.clone(), data.byte_size() as u64);
        self.note(&data, bytes.len() as u64);
        Ok(())
    }

    fn encoded(
        &self,
        data: &TileData,
        origin: Option<Origin>,
    ) -> Result<Vec<u8>, tiles::EncodeError> {
        match origin {
            Some(origin) => data.encode_resampled(&origin),
            None => data.encode(),
        }
    }

    fn unpacked<T: Sample>(&self, data: &TileData) -> Result<Nodes<T>, ImportError> {
        Nodes::of_tile(data).ok_or_else(|| self.stranger(data.tile))
    }

    fn view<'data, T: Sample>(&self, data: &'data TileData) -> Result<View<'data, T>, ImportError> {
        View::of(data).ok_or_else(|| self.stranger(data.tile))
    }

    fn stranger(&self, tile: Tile) -> ImportError {
        ImportError::Tile {
            directory: self.staged.root().to_owned(),
            tile,
            problem:
                "its samples are of another type than the data set's. Import into a new directory."
                    .to_owned(),
        }
    }

    /// The border that a new tile has from old neighbours.
    fn borrow_border<T: Sample>(
        &self,
        tile: Tile,
        nodes: &mut Nodes<T>,
    ) -> Result<(), ImportError> {
        if self.old.is_none() || self.place_of(tile) == Place::Finer {
            return Ok(());
        }
        let mut beside = Vec::new();
        for direction in Direction::ALL {
            if let Some(neighbour) = tile.neighbour(direction)
                && let Some(data) = self.old_tile(neighbour)?
            {
                beside.push(data);
            }
        }
        if beside.is_empty() {
            return Ok(());
        }
        let stored = -BORDER..=CELLS + BORDER;
        for j in stored.clone() {
            for i in stored.clone() {
                if (1..CELLS).contains(&i) && (1..CELLS).contains(&j) {
                    continue;
                }
                let point = LatticePoint::of_tile(tile, i, j);
                for data in &beside {
                    let view = self.view::<T>(data)?;
                    let value = point.within(data.tile).and_then(|(ni, nj)| view.at(ni, nj));
                    if let Some(value) = value {
                        nodes.set(i, j, value);
                    }
                }
            }
        }
        Ok(())
    }

    /// Replaces what finer tiles know better.
    fn filter_children<T: Sample>(
        &self,
        tile: Tile,
        nodes: &mut Nodes<T>,
    ) -> Result<(), ImportError> {
        let channels = self.channels();
        let mut sample = [T::default(); MOST_CHANNELS];
        let sample = &mut sample[..channels];
        for (child, first_i, first_j) in children_in_reach(tile) {
            if !self.exists(child) {
                continue;
            }
            let Some(data) = self.tile_now(child)? else {
                continue;
            };
            let view = self.view::<T>(&data)?;
            let within =
                |first: i64| (-BORDER - first).max(0)..=(CELLS + BORDER - first).min(CELLS / 2);
            for b in within(first_j) {
                for a in within(first_i) {
                    if filtered(&view, 2 * a, 2 * b, self.colour(), sample) {
                        nodes.set(first_i + a, first_j + b, sample);
                    }
                }
            }
        }
        let mut at_hand: Vec<Arc<TileData>> = Vec::new();
        for (i, j) in beyond_nodes(tile).chain(face_edge_nodes(tile)) {
            for (finer, fi, fj) in finer_tiles_at(LatticePoint::of_tile(tile, i, j)) {
                let data = match at_hand.iter().find(|data| data.tile == finer) {
                    Some(data) => Some(data.clone()),
                    None if self.exists(finer) => self.tile_now(finer)?,
                    None => None,
                };
                let Some(data) = data else { continue };
                if !at_hand.iter().any(|known| known.tile == finer) {
                    at_hand.push(data.clone());
                }
                if filtered(&self.view::<T>(&data)?, fi, fj, self.colour(), sample) {
                    nodes.set(i, j, sample);
                }
                break;
            }
        }
        Ok(())
    }

    /// Coarser tiles above `tile` that holes may be filled from, the finest first.
    fn coarser(&self, tile: Tile) -> Result<Vec<Arc<TileData>>, ImportError> {
        let mut found = Vec::new();
        for ancestor in tile.lineage().skip(1) {
            let data = match self.old {
                _ if self.filling => self.tile_now(ancestor)?,
                Some((_, index)) if index.contains(ancestor) => self.load(Place::Old, ancestor)?,
                _ => None,
            };
            found.extend(data);
        }
        Ok(found)
    }

    fn fill_holes<T: Sample>(&self, tile: Tile, nodes: &mut Nodes<T>) -> Result<(), ImportError> {
        if nodes.is_full() || self.old.is_none() || self.place_of(tile) == Place::Finer {
            return Ok(());
        }
        let own = self.coarser(tile)?;
        let mut known: HashMap<Tile, Vec<Arc<TileData>>> = HashMap::new();
        let mut sample = [T::default(); MOST_CHANNELS];
        let sample = &mut sample[..self.channels()];
        let stored = -BORDER..=CELLS + BORDER;
        for j in stored.clone() {
            for i in stored.clone() {
                if nodes.valid.get(TileData::index(i, j)) == Some(&true) {
                    continue;
                }
                if (1..CELLS).contains(&i) && (1..CELLS).contains(&j) {
                    for data in &own {
                        if upsampled(&self.view::<T>(data)?, tile, i, j, sample) {
                            nodes.set(i, j, sample);
                            break;
                        }
                    }
                    continue;
                }
                // Whatever lies above any tile around the node counts, the finest first, so that all those
                // tiles fill it with the same.
                let point = LatticePoint::of_tile(tile, i, j);
                let mut candidates = Vec::new();
                for around in point.tiles() {
                    let Some((ai, aj)) = point.within(around) else {
                        continue;
                    };
                    let above = match known.entry(around) {
                        Entry::Occupied(entry) => entry.into_mut(),
                        Entry::Vacant(entry) => entry.insert(self.coarser(around)?),
                    };
                    candidates.extend(above.iter().map(|data| (data.clone(), around, ai, aj)));
                }
                candidates.sort_by_key(|(data, ..)| std::cmp::Reverse(data.tile.level()));
                for (data, around, ai, aj) in candidates {
                    if upsampled(&self.view::<T>(&data)?, around, ai, aj, sample) {
                        nodes.set(i, j, sample);
                        break;
                    }
                }
            }
        }
        Ok(())
    }
}

/// Nodes of a tile on the edges of its face, which finer tiles of the other face may know.
fn face_edge_nodes(tile: Tile) -> impl Iterator<Item = (i64, i64)> {
    let last = (1_u32 << tile.level()) - 1;
    let inside = 0..=CELLS;
    let columns = [(0, tile.x() == 0), (CELLS, tile.x() == last)];
    let rows = [(0, tile.y() == 0), (CELLS, tile.y() == last)];
    let along_j = inside.clone().flat_map(move |j| {
        columns
            .into_iter()
            .filter(|(_, edge)| *edge)
            .map(move |(i, _)| (i, j))
    });
    let along_i = inside.flat_map(move |i| {
        rows.into_iter()
            .filter(|(_, edge)| *edge)
            .map(move |(j, _)| (i, j))
    });
    along_j.chain(along_i)
}

/// The bilinear value of a coarser tile at node (i, j), both 0…256, of a tile within it, exact in integers. False where
/// a node that it rests on holds no data.
fn upsampled<T: Sample>(view: &View<'_, T>, tile: Tile, i: i64, j: i64, result: &mut [T]) -> bool {
    let shift = u32::from(tile.level() - view.tile.level());
    let step = 1_i64 << shift;
    let along = |tile_index: u32, ancestor_index: u32, node: i64| {
        let offset = (i64::from(tile_index) - (i64::from(ancestor_index) << shift)) * CELLS + node;
        (offset >> shift, offset & (step - 1))
    };
    let (column, s) = along(tile.x(), view.tile.x(), i);
    let (row, t) = along(tile.y(), view.tile.y(), j);
    let corners = [
        (0, 0, (step - s) * (step - t)),
        (1, 0, s * (step - t)),
        (0, 1, (step - s) * t),
        (1, 1, s * t),
    ];
    for (channel, target) in result.iter_mut().enumerate() {
        let mut terms = [(0_i64, T::default()); 4];
        let mut count = 0;
        for (di, dj, weight) in corners.iter().filter(|corner| corner.2 > 0) {
            let Some(value) = view
                .at(column + di, row + dj)
                .and_then(|samples| samples.get(channel))
            else {
                return false;
            };
            terms[count] = (*weight, *value);
            count += 1;
        }
        *target = T::blend(&mut terms[..count], 2 * shift);
    }
    true
}
