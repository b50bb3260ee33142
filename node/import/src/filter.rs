//! From a level to the next coarser one.
//! In: finished tiles of the finer level. Out: filtered samples at their even nodes. The kernel is [1 2 1] by
//! [1 2 1]; on an edge between cube faces only along the edge, at a cube corner none, so that every node has one
//! value from all sides. Nodes without data weigh nothing; a node whose middle has none gets none.

use geodesy::{CELLS, LatticePoint, STORED_NODES, Tile};
use tiles::TileData;

use crate::nodes::{Sample, View};

/// The steps of the kernel in nodes along i and j, with their weights.
const INSIDE: [(i64, i64, i64); 9] = [
    (-1, -1, 1),
    (0, -1, 2),
    (1, -1, 1),
    (-1, 0, 2),
    (0, 0, 4),
    (1, 0, 2),
    (-1, 1, 1),
    (0, 1, 2),
    (1, 1, 1),
];
const ALONG_I: [(i64, i64, i64); 3] = [(-1, 0, 1), (0, 0, 2), (1, 0, 1)];
const ALONG_J: [(i64, i64, i64); 3] = [(0, -1, 1), (0, 0, 2), (0, 1, 1)];
const ALONE: [(i64, i64, i64); 1] = [(0, 0, 1)];

/// The filtered samples of node (i, j), both 0…256, into `result`; false where the node holds no data.
pub(crate) fn filtered<T: Sample>(
    view: &View<'_, T>,
    i: i64,
    j: i64,
    colour: bool,
    result: &mut [T],
) -> bool {
    let node = TileData::index(i, j);
    if view.get(node).is_none() {
        return false;
    }
    let last = (1_u32 << view.tile.level()) - 1;
    let on =
        |index: i64, place: u32| (index == 0 && place == 0) || (index == CELLS && place == last);
    let kernel: &[(i64, i64, i64)] = match (on(i, view.tile.x()), on(j, view.tile.y())) {
        (false, false) => &INSIDE,
        (true, false) => &ALONG_J,
        (false, true) => &ALONG_I,
        (true, true) => &ALONE,
    };
    let channels = view.channels;
    let row = STORED_NODES * channels;
    if view.full && kernel.len() == INSIDE.len() {
        for (channel, target) in result.iter_mut().enumerate() {
            let middle = node * channels + channel;
            let sample = |place: usize| view.values.get(place).copied().unwrap_or_default();
            let line = |at: usize| [sample(at - channels), sample(at), sample(at + channels)];
            let ([a, b, c], [d, e, f], [g, h, i]) =
                (line(middle - row), line(middle), line(middle + row));
            *target = T::smooth([a, b, c, d, e, f, g, h, i], colour);
        }
        return true;
    }
    let mut terms = [(0_i64, T::default()); 9];
    for (channel, target) in result.iter_mut().enumerate() {
        let mut count = 0;
        for (di, dj, weight) in kernel {
            let place = node as i64 + dj * STORED_NODES as i64 + di;
            if let Some(value) = view
                .get(place as usize)
                .and_then(|samples| samples.get(channel))
            {
                terms[count] = (*weight, *value);
                count += 1;
            }
        }
        *target = T::mean(&mut terms[..count], colour);
    }
    true
}

/// Tiles of the next finer level that lie within reach of a tile's stored array on its own face, with the
/// index in the tile of their first node.
pub(crate) fn children_in_reach(tile: Tile) -> impl Iterator<Item = (Tile, i64, i64)> {
    let level = tile.level() + 1;
    let (x, y) = (2 * i64::from(tile.x()), 2 * i64::from(tile.y()));
    (y - 1..=y + 2).flat_map(move |cy| {
        (x - 1..=x + 2).filter_map(move |cx| {
            let (column, row) = (u32::try_from(cx).ok()?, u32::try_from(cy).ok()?);
            let child = Tile::new(tile.face().number(), level, column, row).ok()?;
            Some((child, (cx - x) * CELLS / 2, (cy - y) * CELLS / 2))
        })
    })
}

/// Tiles of the next finer level that hold a node of a tile, where the node stands in the finer lattice too.
pub(crate) fn finer_tiles_at(point: LatticePoint) -> Vec<(Tile, i64, i64)> {
    let Some(finer) = point.at_level(point.level() + 1) else {
        return Vec::new();
    };
    let places = finer.tiles().into_iter();
    places
        .filter_map(|tile| finer.within(tile).map(|(i, j)| (tile, i, j)))
        .collect()
}
