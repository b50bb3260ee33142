//! Leaves beside leaves: which marks of two leaves are one and the same vertex.
//! In: a selection, the leaves at hand. Out: links along edges, across cube faces too, and for each mark its twins.
//! It decides nothing about marks; that a link is missing only means that the neighbour is not at hand.

use std::collections::HashMap;
use std::hash::BuildHasherDefault;

use geodesy::{Direction, LatticePoint, Tile};

use super::marks::{LAST, MIDDLE};
use crate::select::{EdgeNeighbour, Selection};
use crate::tile_set::{KeyHasher, key};

/// Stands in [`Link::places`] and in records for a leaf that is not at hand.
pub const NOT_AT_HAND: u16 = u16::MAX;

/// How a neighbour's level compares with a leaf's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkKind {
    /// The neighbour is of the same level.
    Same,
    /// The neighbour is a level up; the leaf's edge is half of its.
    Coarser,
    /// There are two neighbours a level down.
    Finer,
}

/// What lies beyond an edge of a leaf, as far as it is at hand.
///
/// t counts lattice units along the leaf's edge, 0…256: y on its left and right, x on its lower and upper edge. t' is
/// the same on the neighbour's edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// How the levels compare. Same: t' = t, or 256 − t if flipped. Coarser: t' = 128 half + t / 2, or
    /// 128 half + (256 − t) / 2, for even t. Finer: t' = s, or 256 − s, where s is 2 t in the first and 2 (t − 128) in the second.
    pub kind: LinkKind,
    /// The neighbour's place in the domain; for finer ones those of the two, the one at smaller t first, either
    /// of which may be [`NOT_AT_HAND`]. The second is 0 for the other kinds.
    pub places: [u16; 2],
    /// Which of the neighbour's edges it is, as a number in [`Direction::EDGES`].
    pub edge: u8,
    /// Whether t' falls while t grows: at edges between cube faces.
    pub flip: bool,
    /// Which half of a coarser neighbour's edge the leaf lies on: 1 where t' is 128 and more. Else 0.
    pub half: u8,
}

/// A leaf of a domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RefinedLeaf {
    /// The leaf.
    pub tile: Tile,
    /// What is at hand beyond each of [`Direction::EDGES`]; `None` where nothing is.
    pub links: [Option<Link>; 4],
    /// Bit n is set if finer leaves lie beyond edge n, at hand or not.
    pub finer: u8,
    /// Bit n is set if a coarser leaf lies beyond edge n, at hand or not.
    pub coarser: u8,
}

impl RefinedLeaf {
    /// Whether a mark may be set: not the odd ones along an edge beyond which lies a coarser leaf.
    pub(crate) const fn may_have(&self, [x, y]: [u16; 2]) -> bool {
        let beside = (x == 0) as u8
            | ((x == LAST) as u8) << 1
            | ((y == 0) as u8) << 2
            | ((y == LAST) as u8) << 3;
        // The corners are even both ways, so an odd coordinate is always the one along the edge.
        (x | y) & 1 == 0 || self.coarser & beside == 0
    }

    /// The midpoints of the edges beyond which finer leaves lie: these are always set.
    pub(crate) fn forced(&self) -> impl Iterator<Item = [u16; 2]> + use<> {
        let finer = self.finer;
        (0..4)
            .filter(move |edge| finer >> edge & 1 == 1)
            .map(|edge| on_edge(edge, MIDDLE))
    }
}

/// The leaves that are refined together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Domain {
    /// The leaves; their index is their place.
    pub leaves: Vec<RefinedLeaf>,
}

impl Domain {
    /// The most leaves that a domain can have: places are 16-bit numbers, and one of them says that there is none.
    pub const MOST_LEAVES: usize = NOT_AT_HAND as usize;

    /// Links leaves of a selection. Their places are the order of `tiles`, which must be distinct leaves of
    /// `selection`. A tile that is not one of its leaves is linked with nothing. Those after
    /// [`Domain::MOST_LEAVES`] are left out, which the length of `leaves` tells.
    #[must_use]
    pub fn new(selection: &Selection, tiles: &[Tile]) -> Self {
        let tiles = tiles.get(..Self::MOST_LEAVES).unwrap_or(tiles);
        let mut places: Places = HashMap::with_capacity_and_hasher(
            tiles.len(),
            BuildHasherDefault::<KeyHasher>::default(),
        );
        places.extend((0..).zip(tiles).map(|(place, tile)| (key(*tile), place)));
        let leaves = tiles
            .iter()
            .map(|tile| refined_leaf(selection, *tile, &places))
            .collect();
        Self { leaves }
    }

    /// The record of a leaf as compute passes read it, 12 words; `geometry` is the slot of its heights and errors.
    ///
    /// Two words for each of [`Direction::EDGES`]: place of the (first) neighbour in bits 0…15, kind in bits 16, 17
    /// (0 nothing at hand, 1 same, 2 coarser, 3 finer), `edge` in bits 18, 19, `flip` in bit 20, `half` in bit 21; then the
    /// place of the second finer leaf. Either place of finer leaves may be [`NOT_AT_HAND`]. Then flags (`finer` in bits
    /// 0…3, `coarser` in bits 4…7), `geometry`, the tile's level, 0. All zero for a place that is none.
    #[must_use]
    pub fn record(&self, place: usize, geometry: u32) -> [u32; 12] {
        let mut record = [0; 12];
        let Some(leaf) = self.leaves.get(place) else {
            return record;
        };
        for (words, link) in record.chunks_exact_mut(2).zip(&leaf.links) {
            let (Some(link), [first, second]) = (link, words) else {
                continue;
            };
            let kind = match link.kind {
                LinkKind::Same => 1,
                LinkKind::Coarser => 2,
                LinkKind::Finer => 3,
            };
            *first = u32::from(link.places[0])
                | kind << 16
                | u32::from(link.edge) << 18
                | u32::from(link.flip) << 20
                | u32::from(link.half) << 21;
            *second = u32::from(link.places[1]);
        }
        record[8] = u32::from(leaf.finer) | u32::from(leaf.coarser) << 4;
        record[9] = geometry;
        record[10] = u32::from(leaf.tile.level());
        record
    }

    /// The same vertex in other leaves at hand: their places and marks, for a mark on the border of the leaf at
    /// `place`. At most one for each edge that it lies on, or two at the middle beside finer leaves; none for
    /// inner marks and for odd ones beside a coarser leaf. Leaves that touch at a corner only are no twins: corners are always set.
    pub fn twins(
        &self,
        place: u16,
        x: u16,
        y: u16,
    ) -> impl Iterator<Item = (u16, [u16; 2])> + use<> {
        let leaf = self.leaves.get(usize::from(place));
        let links = leaf.map_or([None; 4], |leaf| leaf.links);
        let along = [(x == 0, y), (x == LAST, y), (y == 0, x), (y == LAST, x)];
        links
            .into_iter()
            .zip(along)
            .filter_map(|(link, (on_it, t))| link.filter(|_| on_it).map(|link| link.twins(t)))
            .flatten()
            .flatten()
    }
}

type Places = HashMap<u64, u16, BuildHasherDefault<KeyHasher>>;

impl Link {
    /// The twins of the mark at t.
    fn twins(&self, t: u16) -> [Option<(u16, [u16; 2])>; 2] {
        let [first, second] = self.places;
        let flipped = |t: u16| if self.flip { LAST - t } else { t };
        let at =
            |place: u16, t: u16| (place != NOT_AT_HAND).then(|| (place, on_edge(self.edge, t)));
        match self.kind {
            LinkKind::Same => [at(first, flipped(t)), None],
            LinkKind::Coarser if t % 2 == 1 => [None, None],
            LinkKind::Coarser => {
                let t = MIDDLE * u16::from(self.half) + flipped(t) / 2;
                [at(first, t), None]
            }
            LinkKind::Finer => [
                (t <= MIDDLE).then(|| at(first, flipped(2 * t))).flatten(),
                (t >= MIDDLE)
                    .then(|| at(second, flipped(2 * (t - MIDDLE))))
                    .flatten(),
            ],
        }
    }
}

/// The mark at t along an edge, by the edge's number in [`Direction::EDGES`].
const fn on_edge(edge: u8, t: u16) -> [u16; 2] {
    match edge {
        0 => [0, t],
        1 => [LAST, t],
        2 => [t, 0],
        _ => [t, LAST],
    }
}

fn refined_leaf(selection: &Selection, tile: Tile, places: &Places) -> RefinedLeaf {
    let mut leaf = RefinedLeaf {
        tile,
        links: [None; 4],
        finer: 0,
        coarser: 0,
    };
    let place_of = |tile: Tile| places.get(&key(tile)).copied().unwrap_or(NOT_AT_HAND);
    for (bit, edge) in Direction::EDGES.into_iter().enumerate() {
        let (kind, places) = match selection.edge_neighbour(tile, edge) {
            Some(EdgeNeighbour::Same(beside)) => (LinkKind::Same, [place_of(beside), 0]),
            Some(EdgeNeighbour::Coarser(beside)) => {
                leaf.coarser |= 1 << bit;
                (LinkKind::Coarser, [place_of(beside), 0])
            }
            Some(EdgeNeighbour::Finer(beside)) => {
                leaf.finer |= 1 << bit;
                (LinkKind::Finer, beside.map(place_of))
            }
            None => continue,
        };
        let nothing =
            places[0] == NOT_AT_HAND && (kind != LinkKind::Finer || places[1] == NOT_AT_HAND);
        if nothing {
            continue;
        }
        leaf.links[bit] = meeting(tile, edge).map(|(beside, number, flip)| Link {
            kind,
            places,
            edge: number,
            flip,
            // The tile of our level beyond the edge is a child of the coarser leaf: its row or column tells.
            half: match kind {
                LinkKind::Coarser if number < 2 => (beside.y() % 2) as u8,
                LinkKind::Coarser => (beside.x() % 2) as u8,
                LinkKind::Same | LinkKind::Finer => 0,
            },
        });
    }
    leaf
}

/// The tile of the same level beyond an edge, which of its edges that is, and whether it runs the other way.
fn meeting(tile: Tile, edge: Direction) -> Option<(Tile, u8, bool)> {
    let number = Direction::EDGES.iter().position(|other| *other == edge)?;
    let beside = tile.neighbour(edge)?;
    let back = Direction::EDGES
        .iter()
        .position(|back| beside.neighbour(*back) == Some(tile))?;
    let start = |tile: Tile, edge: usize| {
        let [x, y] = on_edge(edge as u8, 0);
        LatticePoint::of_tile(tile, i64::from(x), i64::from(y))
    };
    let flip = start(tile, number) != start(beside, back);
    Some((beside, back as u8, flip))
}

/// The leaves that must be refined together so that the marks of those in `visible` are what they would be were all of
/// the planet refined; sorted and distinct.
///
/// What splits in a leaf asks for splits within the quadrants that it touches, so it comes around the corners of
/// quadrants only: to a leaf from those that touch it. There is one way further. Beside a leaf lie one of its level and, around
/// a corner of both, two finer ones along an edge of that. The nearer one touches the leaf; the other does not, but its
/// quadrant at the middle of that edge meets the nearer one's, whose edge is a quadrant's of their neighbour:
/// what splits there comes through both to the middle of the leaf's edge. So the other belongs to them too.
#[must_use]
pub fn ring(selection: &Selection, visible: &[Tile]) -> Vec<Tile> {
    let mut tiles = visible.to_vec();
    for leaf in visible {
        let around = selection.leaves_around(*leaf);
        for edge in Direction::EDGES {
            let Some(EdgeNeighbour::Same(beside)) = selection.edge_neighbour(*leaf, edge) else {
                continue;
            };
            for edge in Direction::EDGES {
                if let Some(EdgeNeighbour::Finer(finer)) = selection.edge_neighbour(beside, edge)
                    && finer.iter().any(|tile| around.contains(tile))
                {
                    tiles.extend(finer);
                }
            }
        }
        tiles.extend(around);
    }
    tiles.sort_unstable();
    tiles.dedup();
    tiles
}
