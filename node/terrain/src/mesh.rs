//! The vertices of one leaf.
//! In: a tile, its seams, a patch, resident elevation data. Out: vertices in exact fixed point, and their
//! range of heights. Heights are exact integer arithmetic, so that all leaves that share a vertex make
//! the same bits of it. It draws nothing and waits for nothing: data that is not there is an error.

use geodesy::frame::FixedPoint;
use geodesy::{CELLS, Direction, Ellipsoid, LatticePoint, NODES, Tile, st_to_uv};
use glam::DVec3;
use thiserror::Error;

use crate::patch::Patch;
use crate::seams::DataLevels;

/// The elevation of one tile on its lattice.
pub trait Lattice {
    /// The tile.
    fn tile(&self) -> Tile;

    /// The elevation in quanta at node (i, j), each 0…256; `None` where the node is not valid. Nodes
    /// that two tiles of a level share must have the same value and validity in both.
    fn height(&self, i: i64, j: i64) -> Option<i32>;
}

/// A vertex as the GPU reads it: 36 bytes without padding, all little-endian words.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Vertex {
    /// ECEF position, [`FixedPoint::words`]: x, y, z with the low word first.
    pub position: [u32; 6],
    /// The ellipsoid's unit normal as signed normalised 16-bit numbers; the last is 0.
    pub normal: [i16; 4],
    /// The place in the tile in lattice units: (i, j), each 0…256.
    pub lattice: [u16; 2],
}

impl Vertex {
    /// Size in a vertex buffer.
    pub const BYTES: usize = 36;

    /// The vertex as a vertex buffer holds it, in the order of the fields.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        let words = self.position.iter().flat_map(|word| word.to_le_bytes());
        let normal = self.normal.iter().flat_map(|part| part.to_le_bytes());
        let lattice = self.lattice.iter().flat_map(|part| part.to_le_bytes());
        for (target, byte) in bytes.iter_mut().zip(words.chain(normal).chain(lattice)) {
            *target = byte;
        }
        bytes
    }

    /// The position.
    #[must_use]
    pub fn point(&self) -> FixedPoint {
        let [x0, x1, y0, y1, z0, z1] = self.position;
        FixedPoint(
            [(x0, x1), (y0, y1), (z0, z1)]
                .map(|(low, high)| (u64::from(high) << 32 | u64::from(low)) as i64),
        )
    }
}

/// The range of heights of a built mesh, in metres above the ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heights {
    /// The lowest vertex.
    pub lowest_m: f64,
    /// The highest vertex.
    pub highest_m: f64,
}

/// Why a mesh could not be built.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum MeshError {
    /// The seams name a level of data, but neither the leaf's ancestor at that level nor any tile beside
    /// it that touches the border there is resident. Loading those of [`DataLevels::ancestors`] cures it.
    #[error("no elevation is resident at the level that tile {tile} stands for")]
    NotResident {
        /// The leaf's own ancestor at that level, or the leaf itself.
        tile: Tile,
    },
    /// The data for a tile says that it belongs to another.
    #[error("the elevation for tile {wanted} says it is of tile {found}")]
    WrongTile {
        /// The tile that was asked for.
        wanted: Tile,
        /// The tile of the data.
        found: Tile,
    },
}

/// Builds the vertices of `tile`, one for each of `patch.positions` and in their order, onto the end of `out`.
///
/// Inner vertices take their height from the data of level `levels.inside`: the tile's own or an ancestor's.
/// Border vertices take it from the level that `levels` gives for them, out of the first resident tile
/// of that level, in the order of tiles, that touches the vertex; a leaf on the other side finds the same. Within coarser data
/// heights are bilinear over the valid nodes, rounded half away from zero; where there are none the height is 0.
///
/// `quantum_m` is what one unit of [`Lattice::height`] means, a power of two. `data` gives the resident
/// elevation of a tile of any level. On an error `out` is as it was.
pub fn build<'a>(
    ellipsoid: &Ellipsoid,
    tile: Tile,
    levels: &DataLevels,
    patch: &Patch,
    quantum_m: f64,
    data: &dyn Fn(Tile) -> Option<&'a dyn Lattice>,
    out: &mut Vec<Vertex>,
) -> Result<Heights, MeshError> {
    let inside = Source::find(tile, levels.inside, &[], data)?;
    let border = Border::find(tile, levels, data)?;
    let axes = Axes::new(tile);
    let (mut lowest, mut highest) = (i32::MAX, i32::MIN);
    let edge = CELLS as u16;
    out.reserve(patch.positions.len());
    let [right, up, outward] = tile.face().frame();
    let mut row = u16::MAX;
    let mut row_start = outward;
    for &[i, j] in &patch.positions {
        if j != row {
            row = j;
            row_start = outward + up * axes.v(j);
        }
        let on_border = i == 0 || j == 0 || i == edge || j == edge;
        let source = if on_border {
            border.at(i, j)
        } else {
            inside.as_ref()
        };
        let quanta = source.map_or(0, |source| source.height(i64::from(i), i64::from(j)));
        lowest = lowest.min(quanta);
        highest = highest.max(quanta);
        // The axes' vectors have one component each, so the sum only gathers u, v and 1. From there on the
        // same operations in the same order as LatticePoint::normal, whose bits these are.
        let cube = row_start + right * axes.u(i);
        let length = (cube.x * cube.x + cube.y * cube.y + cube.z * cube.z).sqrt();
        let normal = DVec3::new(cube.x / length, cube.y / length, cube.z / length);
        let position = ellipsoid.point(normal, f64::from(quanta) * quantum_m);
        out.push(Vertex {
            position: FixedPoint::from_ecef(position).words(),
            normal: snorm(normal),
            lattice: [i, j],
        });
    }
    Ok(Heights {
        lowest_m: f64::from(lowest) * quantum_m,
        highest_m: f64::from(highest) * quantum_m,
    })
}

/// A unit vector as signed normalised 16-bit numbers, rounded half away from zero.
fn snorm(normal: DVec3) -> [i16; 4] {
    let part = |c: f64| (c * 32_767.0 + if c < 0.0 { -0.5 } else { 0.5 }) as i16;
    [part(normal.x), part(normal.y), part(normal.z), 0]
}

/// Cube coordinates of a tile's rows and columns, worked out once for each.
struct Axes {
    u: [f64; NODES as usize],
    y: f64,
    per_step: f64,
}

impl Axes {
    fn new(tile: Tile) -> Self {
        // Dyadic, so exact: the same quotients as LatticePoint::normal divides out.
        let per_step = 1.0 / (CELLS << tile.level()) as f64;
        let x = f64::from(tile.x()) * CELLS as f64;
        let y = f64::from(tile.y()) * CELLS as f64;
        let u = std::array::from_fn(|i| st_to_uv((x + i as f64) * per_step));
        Self { u, y, per_step }
    }

    fn u(&self, i: u16) -> f64 {
        self.u.get(usize::from(i)).copied().unwrap_or(1.0)
    }

    fn v(&self, j: u16) -> f64 {
        st_to_uv((self.y + f64::from(j)) * self.per_step)
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

    /// The height in quanta at the leaf's node (i, j).
    fn height(&self, i: i64, j: i64) -> i32 {
        let position = match self.origin {
            Some(_) if self.shift == 0 => return self.lattice.height(i, j).unwrap_or(0),
            Some((u, v)) => Some((u + i, v + j)),
            None => LatticePoint::of_tile(self.leaf, i, j).position_in(self.tile),
        };
        // Sources beside are chosen because they touch, so there always is a position.
        position.map_or(0, |(u, v)| bilinear(self.lattice, u, v, self.shift))
    }
}

/// Up to this shift 64 bits hold twice the weighted sum of heights: 1 + 31 + 2 · 14 bits.
const NARROW_SHIFT: u32 = 14;

/// The bilinear height at a position in 2^-shift lattice units, over the valid nodes around it.
///
/// The result is that of exact rational arithmetic: it does not depend on the shift in which a position is
/// expressed, and on a line between two nodes, not on what lies on either side.
fn bilinear(lattice: &dyn Lattice, u: i64, v: i64, shift: u32) -> i32 {
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
        return 0;
    }
    let rounded = if shift <= NARROW_SHIFT {
        let (sum, weights) = (sum as i64, weights as i64);
        (2 * sum.abs() + weights) / (2 * weights) * sum.signum()
    } else {
        ((2 * sum.abs() + weights) / (2 * weights) * sum.signum()) as i64
    };
    rounded as i32
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
