//! Samples of the sources at the nodes of the lattice.
//! In: a tile, the sources that may touch it. Out: its 275² nodes, border included, also over face edges. What a node
//! gets depends on the node alone, never on the tile that asks, so tiles that share nodes agree bit for bit.

use std::sync::Arc;

use geodesy::{BORDER, CELLS, Face, LatticePoint, NODES, STORED_NODES, Tile, TilePosition};
use tiles::{Kind, MAX_CHANNELS, Origin};

use crate::error::SourceError;
use crate::grid::Position;
use crate::nodes::{Nodes, Sample};
use crate::placing::{BLOCK, Placing, exact, face_cells, face_point, smooth, trusted};
use crate::sampler::{Sampler, Value};
use crate::source::{ChunkCache, Source};

/// Heights of more quanta than this do not fit into a tile; fill values that nobody declared are like that.
const LARGEST_HEIGHT: f64 = 2.0e9;

/// The most channels that a data set has.
pub(crate) const MOST_CHANNELS: usize = MAX_CHANNELS as usize;

/// What all tiles of one pass share.
pub(crate) struct Resampler<'pass> {
    pub(crate) sources: &'pass [Source],
    pub(crate) cache: &'pass ChunkCache,
    pub(crate) kind: Kind,
    /// Metres a quantum for elevation, 1 for other kinds.
    pub(crate) quantum: f64,
    pub(crate) channels: usize,
}

/// A rectangle of nodes of a face's lattice.
#[derive(Clone, Copy, Debug)]
struct Rect {
    face: Face,
    level: u8,
    gx: i64,
    gy: i64,
    width: i64,
    height: i64,
}

/// One source at work on one tile.
struct Reader<'pass, const ROOM: usize> {
    sampler: Sampler<'pass, ROOM>,
    source: &'pass Source,
    scale: f64,
    offset: f64,
    /// Nodes that came from it.
    count: usize,
}

type Error = Arc<SourceError>;

impl Resampler<'_> {
    /// Puts the samples of `candidates` (indices into the sources, later ones win) into the nodes of `tile`.
    /// Answers with the origin of most of them, where one source alone explains the tile.
    pub(crate) fn fill<T: Sample>(
        &self,
        tile: Tile,
        candidates: &[usize],
        nodes: &mut Nodes<T>,
    ) -> Result<Option<Origin>, Error> {
        // Heights and colours must not carry the room that many bands need.
        match self.channels {
            1 => self.fill_with::<T, 1>(tile, candidates, nodes),
            2 | 3 => self.fill_with::<T, 3>(tile, candidates, nodes),
            _ => self.fill_with::<T, MOST_CHANNELS>(tile, candidates, nodes),
        }
    }

    fn fill_with<T: Sample, const ROOM: usize>(
        &self,
        tile: Tile,
        candidates: &[usize],
        nodes: &mut Nodes<T>,
    ) -> Result<Option<Origin>, Error> {
        let mut readers: Vec<Reader<'_, ROOM>> = candidates
            .iter()
            .filter_map(|number| self.reader(*number))
            .collect();
        let (level, face) = (tile.level(), tile.face());
        let side = face_cells(level);
        let (left, lower) = (i64::from(tile.x()) * CELLS, i64::from(tile.y()) * CELLS);
        let (gx, gy) = ((left - BORDER).max(0), (lower - BORDER).max(0));
        let width = (left + CELLS + BORDER).min(side) - gx + 1;
        let height = (lower + CELLS + BORDER).min(side) - gy + 1;
        let rect = Rect {
            face,
            level,
            gx,
            gy,
            width,
            height,
        };
        self.fill_rect(rect, &mut readers, |x, y, value: &[T]| {
            nodes.set(x - left, y - lower, value);
        })?;
        for strip in beyond_the_face(tile) {
            let rect = strip.rect;
            let mut values = vec![None; (rect.width * rect.height) as usize];
            let place = |x: i64, y: i64| ((y - rect.gy) * rect.width + x - rect.gx) as usize;
            self.fill_rect(rect, &mut readers, |x, y, value: &[T]| {
                let mut samples = [T::default(); ROOM];
                samples[..value.len()].copy_from_slice(value);
                if let Some(target) = values.get_mut(place(x, y)) {
                    *target = Some(samples);
                }
            })?;
            for (i, j, x, y) in strip.nodes {
                if let Some(Some(samples)) = values.get(place(x, y)) {
                    nodes.set(i, j, &samples[..self.channels]);
                }
            }
        }
        let most = readers.into_iter().max_by_key(|reader| reader.count);
        Ok(match most {
            Some(reader)
                if self.kind == Kind::Elevation
                    && 2 * reader.count > STORED_NODES * STORED_NODES =>
            {
                self.origin(tile, reader)?
            }
            _ => None,
        })
    }

    fn reader<const ROOM: usize>(&self, number: usize) -> Option<Reader<'_, ROOM>> {
        let source = self.sources.get(number)?;
        let sampler = Sampler::new(source, number, self.cache);
        let (scale, offset) = match self.kind {
            Kind::Elevation => (
                source.description.scale / self.quantum,
                source.description.offset / self.quantum,
            ),
            Kind::Imagery | Kind::Sar => (1.0, 0.0),
        };
        Some(Reader {
            sampler,
            source,
            scale,
            offset,
            count: 0,
        })
    }

    /// Calls `put` for each node of a rectangle that gets a value, once for each source that has one.
    fn fill_rect<T: Sample, const ROOM: usize>(
        &self,
        rect: Rect,
        readers: &mut [Reader<'_, ROOM>],
        mut put: impl FnMut(i64, i64, &[T]),
    ) -> Result<(), Error> {
        let last_x = rect.gx + rect.width - 1;
        let last_y = rect.gy + rect.height - 1;
        let mut positions = [None; (BLOCK * BLOCK) as usize];
        let mut values: [Option<Value<ROOM>>; (BLOCK * BLOCK) as usize] =
            [None; (BLOCK * BLOCK) as usize];
        for by in rect.gy / BLOCK..=last_y / BLOCK {
            for bx in rect.gx / BLOCK..=last_x / BLOCK {
                let columns = rect.gx.max(bx * BLOCK)..=last_x.min(bx * BLOCK + BLOCK - 1);
                let rows = rect.gy.max(by * BLOCK)..=last_y.min(by * BLOCK + BLOCK - 1);
                let count = (columns.end() - columns.start() + 1) as usize
                    * (rows.end() - rows.start() + 1) as usize;
                for reader in readers.iter_mut() {
                    let (positions, values) = (&mut positions[..count], &mut values[..count]);
                    if !place_block(reader.source, rect, (bx, by), &columns, &rows, positions) {
                        continue;
                    }
                    reader.sampler.values(positions, values)?;
                    let nodes = rows
                        .clone()
                        .flat_map(|y| columns.clone().map(move |x| (x, y)));
                    for ((x, y), value) in nodes.zip(values.iter()) {
                        let Some(value) = value else { continue };
                        let numbers = value.map(|number| number * reader.scale + reader.offset);
                        if self.kind == Kind::Elevation && numbers[0].abs() > LARGEST_HEIGHT {
                            continue;
                        }
                        put(x, y, &numbers.map(T::nearest)[..self.channels]);
                        reader.count += 1;
                    }
                }
            }
        }
        Ok(())
    }

    /// The window of a source that explains a tile's heights, for the encoder.
    fn origin<const ROOM: usize>(
        &self,
        tile: Tile,
        mut reader: Reader<'_, ROOM>,
    ) -> Result<Option<Origin>, Error> {
        let grid = reader.source.grid();
        let middle = TilePosition {
            tile,
            i: CELLS as f64 / 2.0,
            j: CELLS as f64 / 2.0,
        };
        let (latitude, longitude) = geodesy::Ellipsoid::angles_deg(middle.normal());
        let near = grid
            .position(latitude, longitude, None)
            .filter(|_| grid.crs.is_geographic())
            .map(|position| grid.longitude_of(position));
        let place = |i, j| {
            let position = exact(grid, LatticePoint::of_tile(tile, i, j), near)?;
            Some([position.column, position.row])
        };
        let period = (grid.period() > 0.0).then(|| grid.period());
        let mut failed = None;
        let mut last = 0_i32;
        let (scale, offset) = (reader.scale, reader.offset);
        let sampler = &mut reader.sampler;
        let value = |column, row| {
            match sampler.sample(column, row) {
                Ok((value, true)) => last = i32::nearest(value[0] * scale + offset),
                Ok((_, false)) => {}
                Err(error) => failed = Some(error),
            }
            last
        };
        let origin = Origin::gather(place, period, value);
        match failed {
            Some(error) => Err(error),
            None => Ok(origin),
        }
    }
}

/// The positions in `source` of the nodes of a block within a rectangle, row by row. False where none lies in it.
fn place_block(
    source: &Source,
    rect: Rect,
    (bx, by): (i64, i64),
    columns: &std::ops::RangeInclusive<i64>,
    rows: &std::ops::RangeInclusive<i64>,
    positions: &mut [Option<Position>],
) -> bool {
    let grid = source.grid();
    let Rect { face, level, .. } = rect;
    let placing = Placing::of_block(grid, face, level, bx, by);
    if matches!(placing, Placing::Outside) {
        return false;
    }
    let side = face_cells(level);
    let mut any = false;
    let nodes = rows
        .clone()
        .flat_map(|y| columns.clone().map(move |x| (x, y)));
    for ((x, y), target) in nodes.zip(positions) {
        // Two faces share the nodes of an edge: those are placed by themselves, the same from both.
        let on_edge = x == 0 || y == 0 || x == side || y == side;
        let position = match &placing {
            Placing::Smooth { columns, rows } if !on_edge => {
                Some(smooth(columns, rows, x - bx * BLOCK, y - by * BLOCK))
            }
            _ => trusted(grid, face_point(face, level, x, y)),
        };
        *target = position.and_then(|position| grid.place(position));
        any |= target.is_some();
    }
    any
}

/// Border nodes of a tile that lie on one other face.
struct Strip {
    rect: Rect,
    /// The tile's own index of each node, then its place in the other face's lattice.
    nodes: Vec<(i64, i64, i64, i64)>,
}

/// The nodes of a tile's stored array that lie beyond its face, by the face that owns them.
fn beyond_the_face(tile: Tile) -> Vec<Strip> {
    let mut strips: Vec<Strip> = Vec::new();
    for (i, j) in beyond_nodes(tile) {
        let (owner, oi, oj) = LatticePoint::of_tile(tile, i, j).owner();
        let (x, y) = (
            i64::from(owner.x()) * CELLS + oi,
            i64::from(owner.y()) * CELLS + oj,
        );
        let known = strips
            .iter_mut()
            .find(|strip| strip.rect.face == owner.face());
        match known {
            Some(Strip { rect, nodes }) => {
                let (right, upper) = (rect.gx + rect.width, rect.gy + rect.height);
                rect.gx = rect.gx.min(x);
                rect.gy = rect.gy.min(y);
                rect.width = right.max(x + 1) - rect.gx;
                rect.height = upper.max(y + 1) - rect.gy;
                nodes.push((i, j, x, y));
            }
            None => {
                let (face, level) = (owner.face(), tile.level());
                let rect = Rect {
                    face,
                    level,
                    gx: x,
                    gy: y,
                    width: 1,
                    height: 1,
                };
                strips.push(Strip {
                    rect,
                    nodes: vec![(i, j, x, y)],
                });
            }
        }
    }
    strips
}

/// Indices of the stored nodes of a tile that lie beyond the edges of its face.
pub(crate) fn beyond_nodes(tile: Tile) -> impl Iterator<Item = (i64, i64)> {
    let last = (1_u32 << tile.level()) - 1;
    let stored = -BORDER..NODES + BORDER;
    let columns = move |i: i64| (i < 0 && tile.x() == 0) || (i > CELLS && tile.x() == last);
    let rows = move |j: i64| (j < 0 && tile.y() == 0) || (j > CELLS && tile.y() == last);
    stored
        .clone()
        .flat_map(move |j| stored.clone().map(move |i| (i, j)))
        .filter(move |(i, j)| columns(*i) || rows(*j))
}
