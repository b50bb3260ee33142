//! Where the samples of one elevation layer come from, seen from one leaf.
//! In: a leaf, the levels along its border, the layer's resident tiles. Out: the layer's sample at a vertex,
//! in exact integers. It fuses nothing, and waits for nothing: data that is not there is an error.

use geodesy::{CELLS, Direction, LatticePoint, Tile};

use crate::mesh::{ElevationLayer, Lattice, MeshError};
use crate::seams::DataLevels;

/// One layer's data at the vertices of one leaf.
pub(crate) struct LayerSources<'a> {
    inside: Option<Source<'a>>,
    border: Border<'a>,
}

impl<'a> LayerSources<'a> {
    /// The layer's resident data for the inside and for each part of the border.
    pub(crate) fn find(leaf: Tile, layer: &ElevationLayer<'a>) -> Result<Self, MeshError> {
        Ok(Self {
            inside: Source::find(leaf, layer.levels.inside, &[], layer.data)?,
            border: Border::find(leaf, &layer.levels, layer.data)?,
        })
    }

    /// The layer's sample in quanta at the leaf's node (i, j); `None` where no valid node contributes.
    #[inline]
    pub(crate) fn sample(&self, i: u16, j: u16) -> Option<i32> {
        let edge = CELLS as u16;
        let on_border = i == 0 || j == 0 || i == edge || j == edge;
        let source = if on_border {
            self.border.at(i, j)
        } else {
            self.inside.as_ref()
        };
        source?.height(i64::from(i), i64::from(j))
    }
}

/// Resident data as seen from one leaf.
#[derive(Clone, Copy)]
struct Source<'a> {
    lattice: &'a dyn Lattice,
    leaf: Tile,
    tile: Tile,
    /// Levels between the leaf and the data; positions count in 2^-shift lattice units of the data.
    shift: u32,
    /// Where the leaf's node (0, 0) lies in the data, where that is the leaf's own or an ancestor's;
    /// `None` for data of a tile beside, maybe across a face edge.
    origin: Option<(i64, i64)>,
}

impl<'a> Source<'a> {
    /// The first resident tile at `level` among the leaf's ancestor and the tiles beside that in the given
    /// directions; no data at all for a negative level.
    fn find(
        leaf: Tile,
        level: i8,
        beside: &[Direction],
        data: &dyn Fn(Tile) -> Option<&'a dyn Lattice>,
    ) -> Result<Option<Self>, MeshError> {
        let Ok(level) = u8::try_from(level) else {
            return Ok(None);
        };
        let own = leaf.ancestor(level);
        let mut candidates = [Some(own), None, None, None];
        for (slot, direction) in candidates[1..].iter_mut().zip(beside) {
            *slot = own.neighbour(*direction);
        }
        candidates.sort_unstable();
        for wanted in candidates.into_iter().flatten() {
            let Some(lattice) = data(wanted) else {
                continue;
            };
            let found = lattice.tile();
            if found != wanted {
                return Err(MeshError::WrongTile { wanted, found });
            }
            let shift = u32::from(leaf.level() - wanted.level());
            let origin = wanted.contains(leaf).then(|| {
                let along =
                    |leaf: u32, data: u32| (i64::from(leaf) - (i64::from(data) << shift)) * CELLS;
                (along(leaf.x(), wanted.x()), along(leaf.y(), wanted.y()))
            });
            return Ok(Some(Self {
                lattice,
                leaf,
                tile: wanted,
                shift,
                origin,
            }));
        }
        Err(MeshError::NotResident { tile: own })
    }

    /// The height in quanta at the leaf's node (i, j); `None` where no valid node contributes.
    fn height(&self, i: i64, j: i64) -> Option<i32> {
        let position = match self.origin {
            Some(_) if self.shift == 0 => return self.lattice.height(i, j),
            Some((u, v)) => Some((u + i, v + j)),
            None => LatticePoint::of_tile(self.leaf, i, j).position_in(self.tile),
        };
        // Sources beside are chosen because they touch, so there always is a position.
        let (u, v) = position?;
        bilinear(self.lattice, u, v, self.shift)
    }
}

/// Up to this shift 64 bits hold twice the weighted sum of heights: 1 + 31 + 2 · 14 bits.
const NARROW_SHIFT: u32 = 14;

/// The bilinear height at a position in 2^-shift lattice units, over the valid nodes around it, rounded half
/// away from zero; `None` where no valid node has any weight.
///
/// The result is that of exact rational arithmetic: it does not depend on the shift in which a position is
/// expressed, and on a line between two nodes, not on what lies on either side.
fn bilinear(lattice: &dyn Lattice, u: i64, v: i64, shift: u32) -> Option<i32> {
    let one = 1_i64 << shift;
    let (i, j) = (u >> shift, v >> shift);
    let (right, up) = (u & (one - 1), v & (one - 1));
    // Weights reach 2^44 and heights 2^31: data that much coarser than its leaf is rare, but nothing
    // forbids it, and 64 bits do not hold the sum.
    let (mut sum, mut weights) = (0_i128, 0_i128);
    for (dj, weight_v) in [(0, one - up), (1, up)] {
        for (di, weight_u) in [(0, one - right), (1, right)] {
            let weight = weight_u * weight_v;
            if weight != 0
                && let Some(height) = lattice.height(i + di, j + dj)
            {
                sum += i128::from(weight) * i128::from(height);
                weights += i128::from(weight);
            }
        }
    }
    if weights == 0 {
        return None;
    }
    let rounded = if shift <= NARROW_SHIFT {
        let (sum, weights) = (sum as i64, weights as i64);
        (2 * sum.abs() + weights) / (2 * weights) * sum.signum()
    } else {
        ((2 * sum.abs() + weights) / (2 * weights) * sum.signum()) as i64
    };
    Some(rounded as i32)
}

/// The data along a leaf's border.
struct Border<'a> {
    corners: [Option<Source<'a>>; 4],
    /// For each of [`Direction::EDGES`] the two halves and, between, the vertex in the middle.
    edges: [[Option<Source<'a>>; 3]; 4],
}

impl<'a> Border<'a> {
    fn find(
        leaf: Tile,
        levels: &DataLevels,
        data: &dyn Fn(Tile) -> Option<&'a dyn Lattice>,
    ) -> Result<Self, MeshError> {
        // Tiles beside the ancestor matter where the leaf lies on its ancestor's edge.
        let touches = |level: i8, edge: Direction| {
            let own = leaf.ancestor(u8::try_from(level).unwrap_or(0));
            let shift = leaf.level() - own.level();
            match edge {
                Direction::Left => leaf.x() == own.x() << shift,
                Direction::Right => leaf.x() + 1 == (own.x() + 1) << shift,
                Direction::Down => leaf.y() == own.y() << shift,
                _ => leaf.y() + 1 == (own.y() + 1) << shift,
            }
        };
        let mut edges = [[None; 3]; 4];
        for ((edge, sources), [first, second]) in Direction::EDGES
            .into_iter()
            .zip(&mut edges)
            .zip(levels.half_edges)
        {
            let find = |level: i8| {
                let beside: &[Direction] = if touches(level, edge) { &[edge] } else { &[] };
                Source::find(leaf, level, beside, data)
            };
            let low = find(first)?;
            let high = if second == first { low } else { find(second)? };
            *sources = [low, if first <= second { low } else { high }, high];
        }
        let mut corners = [None; 4];
        let around = [
            (Direction::Left, Direction::Down, Direction::LeftDown),
            (Direction::Right, Direction::Down, Direction::RightDown),
            (Direction::Left, Direction::Up, Direction::LeftUp),
            (Direction::Right, Direction::Up, Direction::RightUp),
        ];
        for ((source, level), (side, end, corner)) in
            corners.iter_mut().zip(levels.corners).zip(around)
        {
            let beside: &[Direction] = match (touches(level, side), touches(level, end)) {
                (true, true) => &[side, end, corner],
                (true, false) => &[side],
                (false, true) => &[end],
                (false, false) => &[],
            };
            *source = Source::find(leaf, level, beside, data)?;
        }
        Ok(Self { corners, edges })
    }

    /// The data for a vertex on the border.
    fn at(&self, i: u16, j: u16) -> Option<&Source<'a>> {
        let last = CELLS as u16;
        let half = |along: u16| match along.cmp(&(last / 2)) {
            std::cmp::Ordering::Less => 0,
            std::cmp::Ordering::Equal => 1,
            std::cmp::Ordering::Greater => 2,
        };
        let found = match ((i == 0, i == last), (j == 0, j == last)) {
            ((true, _), (true, _)) => &self.corners[0],
            ((_, true), (true, _)) => &self.corners[1],
            ((true, _), (_, true)) => &self.corners[2],
            ((_, true), (_, true)) => &self.corners[3],
            ((true, _), _) => &self.edges[0][half(j)],
            ((_, true), _) => &self.edges[1][half(j)],
            (_, (true, _)) => &self.edges[2][half(i)],
            _ => &self.edges[3][half(i)],
        };
        found.as_ref()
    }
}
