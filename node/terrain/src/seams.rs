//! Seams: whose data decides the heights along a leaf's border.
//! In: a leaf, the selection, the level of the data that each leaf shows. Out: a small key from which the
//! leaf's vertices follow. Two leaves that share a vertex derive the same level for it.

use geodesy::{Direction, Tile};

use crate::select::{EdgeNeighbour, Selection};

/// The data level of a leaf that shows nothing: its heights are 0.
pub const NO_DATA: i8 = -1;

/// For one leaf: the level of the elevation data at its inner vertices and all along its border. It
/// identifies the leaf's vertices: same tile, same `DataLevels`, same bits.
///
/// Levels are −1 ([`NO_DATA`]) or 0…the leaf's own level. On the border each is the coarsest that any leaf
/// touching the vertex shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DataLevels {
    /// The level this leaf shows.
    pub inside: i8,
    /// At the corners left-down, right-down, left-up, right-up.
    pub corners: [i8; 4],
    /// Along the halves of the edges: for each of [`Direction::EDGES`] the half with the smaller
    /// coordinate along the edge, then the other. The vertex between them has the coarser of the two.
    pub half_edges: [[i8; 2]; 4],
}

impl DataLevels {
    /// The leaf itself or its ancestors at all the levels named here, sorted: with these resident,
    /// [`build`](crate::build) never lacks data. At most 13, mostly one or two.
    #[must_use]
    pub fn ancestors(&self, leaf: Tile) -> Vec<Tile> {
        let along_edges = self.half_edges.as_flattened();
        let levels = std::iter::once(&self.inside)
            .chain(&self.corners)
            .chain(along_edges);
        let mut tiles: Vec<Tile> = levels
            .filter_map(|level| u8::try_from(*level).ok())
            .map(|level| leaf.ancestor(level))
            .collect();
        tiles.sort_unstable();
        tiles.dedup();
        tiles
    }
}

/// All that a leaf's mesh depends on beside its tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Seams {
    /// Which of a patch's 16 index lists: bit n is set where finer leaves lie beyond edge n of
    /// [`Direction::EDGES`].
    pub variant: u8,
    /// Which data sets the heights of the vertices.
    pub levels: DataLevels,
}

impl Seams {
    /// The seams of a leaf whose neighbours are all of its level and show the same level of data.
    #[must_use]
    pub fn uniform(level: i8) -> Self {
        let levels = DataLevels {
            inside: level,
            corners: [level; 4],
            half_edges: [[level; 2]; 4],
        };
        Self { variant: 0, levels }
    }
}

/// The seams of a leaf. `shown_level` tells which level of elevation data a leaf shows: its own, an
/// ancestor's, or `None` for no data. It is asked for the leaf and each leaf around it.
///
/// A leaf that is not to count answers with the asking leaf's own level: then that leaf's data decides.
///
/// For a picture that is the same on every node, `shown_level` must answer for a leaf that this node
/// culled with the level it would show once loaded, as the index of the data tells.
#[must_use]
pub fn seams(leaf: Tile, selection: &Selection, shown_level: &dyn Fn(Tile) -> Option<u8>) -> Seams {
    let shown = |tile: Tile| {
        shown_level(tile)
            .and_then(|level| i8::try_from(level).ok())
            .unwrap_or(NO_DATA)
    };
    let inside = shown(leaf);
    let mut variant = 0;
    let mut half_edges = [[inside; 2]; 4];
    for (bit, edge) in Direction::EDGES.into_iter().enumerate() {
        let beyond = match selection.edge_neighbour(leaf, edge) {
            Some(EdgeNeighbour::Same(tile) | EdgeNeighbour::Coarser(tile)) => [shown(tile); 2],
            Some(EdgeNeighbour::Finer(tiles)) => {
                variant |= 1 << bit;
                tiles.map(shown)
            }
            None => continue,
        };
        half_edges[bit] = beyond.map(|level| level.min(inside));
    }
    // Around a corner lie the leaf, the leaf beyond either edge next to the corner, and the leaf beyond
    // the corner itself, some of which may be one and the same.
    let [left, right, down, up] = half_edges;
    let corners = [
        (Direction::LeftDown, left[0].min(down[0])),
        (Direction::RightDown, right[0].min(down[1])),
        (Direction::LeftUp, left[1].min(up[0])),
        (Direction::RightUp, right[1].min(up[1])),
    ]
    .map(|(corner, edges)| {
        selection
            .corner_neighbour(leaf, corner)
            .map_or(edges, |tile| edges.min(shown(tile)))
    });
    Seams {
        variant,
        levels: DataLevels {
            inside,
            corners,
            half_edges,
        },
    }
}
