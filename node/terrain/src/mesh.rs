//! The vertices of one leaf.
//! In: a tile, elevation layers with their seams, lattice nodes, how layers fuse. Out: vertices in exact fixed point,
//! and their range of heights. Samples are exact integer arithmetic and go through one function of the place,
//! so that all leaves that share a vertex make the same bits of it. It draws nothing and waits for nothing.

use geodesy::frame::FixedPoint;
use geodesy::{CELLS, Ellipsoid, NODES, Tile, st_to_uv};
use glam::DVec3;
use thiserror::Error;

use crate::seams::DataLevels;
use crate::source::LayerSources;

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

    /// A vertex as [`Vertex::to_bytes`] wrote it; `None` where these are not [`Vertex::BYTES`] bytes.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; Self::BYTES] = bytes.try_into().ok()?;
        let (words, _) = bytes.as_chunks::<4>();
        let [x0, x1, y0, y1, z0, z1, normal_xy, normal_z, lattice] = *words else {
            return None;
        };
        let halves = |[a, b, c, d]: [u8; 4]| [[a, b], [c, d]];
        let ([nx, ny], [nz, nw]) = (halves(normal_xy), halves(normal_z));
        Some(Self {
            position: [x0, x1, y0, y1, z0, z1].map(u32::from_le_bytes),
            normal: [nx, ny, nz, nw].map(i16::from_le_bytes),
            lattice: halves(lattice).map(u16::from_le_bytes),
        })
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

/// The most elevation layers that one mesh is made of.
pub const MAX_ELEVATION_LAYERS: usize = 8;

/// One elevation layer of a leaf: whose data it shows where, and that data.
#[derive(Clone, Copy)]
pub struct ElevationLayer<'a> {
    /// The level of the layer's data inside the leaf and along its border, from [`seams`](crate::seams())
    /// with what leaves show of this layer.
    pub levels: DataLevels,
    /// The layer's resident elevation for a tile of any level.
    pub data: &'a dyn Fn(Tile) -> Option<&'a dyn Lattice>,
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
    /// More layers than [`MAX_ELEVATION_LAYERS`].
    #[error("{0} elevation layers: a mesh takes at most {MAX_ELEVATION_LAYERS}")]
    TooManyLayers(usize),
    /// The fuse function gave an infinite height or none that is a number.
    #[error(
        "the fused height at node {i}, {j} of tile {tile} is not finite: correct the layers' parameters"
    )]
    NotFinite {
        /// The leaf.
        tile: Tile,
        /// The vertex along u, 0…256.
        i: u16,
        /// The vertex along v, 0…256.
        j: u16,
    },
}

/// Builds the vertices of `tile`, one for each of `positions` and in their order, onto the end of `out`.
///
/// Positions are lattice nodes (i along u, j along v), each 0…256, as those of a [`Patch`](crate::Patch) or of
/// [`border_positions`](crate::border_positions). A run of them with the same j costs the least.
///
/// At each vertex every layer gives a sample in its own quanta. At inner vertices it is the layer's data of
/// level `levels.inside`: the tile's own or an ancestor's. Border vertices take the level that `levels` gives
/// for them, out of the first resident tile of that level, in the order of tiles, that touches the vertex; a
/// leaf on the other side finds the same. Within coarser data samples are bilinear over the valid nodes,
/// rounded half away from zero. Where no valid node has any weight, or the level is
/// [`NO_DATA`](crate::NO_DATA), the sample is `None`.
///
/// `fuse` makes the height in metres above the ellipsoid out of the geodetic unit normal at the vertex and the
/// samples there, one for each of `layers` and in their order. It must be finite and a function of
/// these alone, whose bits depend on nothing else: then all leaves that share a vertex make the same bits of
/// it, because normals and samples have the same bits in all of them.
///
/// At most [`MAX_ELEVATION_LAYERS`]. On an error `out` is as it was.
pub fn build<'a>(
    ellipsoid: &Ellipsoid,
    tile: Tile,
    layers: &[ElevationLayer<'a>],
    positions: &[[u16; 2]],
    fuse: &dyn Fn(DVec3, &[Option<i32>]) -> f64,
    out: &mut Vec<Vertex>,
) -> Result<Heights, MeshError> {
    let mut samples = [None; MAX_ELEVATION_LAYERS];
    let Some(samples) = samples.get_mut(..layers.len()) else {
        return Err(MeshError::TooManyLayers(layers.len()));
    };
    let mut sources = Vec::with_capacity(layers.len());
    for layer in layers {
        sources.push(LayerSources::find(tile, layer)?);
    }
    let axes = Axes::new(tile);
    let (mut lowest_m, mut highest_m) = (f64::INFINITY, f64::NEG_INFINITY);
    let before = out.len();
    out.reserve(positions.len());
    let [right, up, outward] = tile.face().frame();
    let mut row = u16::MAX;
    let mut row_start = outward;
    for &[i, j] in positions {
        if j != row {
            row = j;
            row_start = outward + up * axes.v(j);
        }
        for (sample, source) in samples.iter_mut().zip(&sources) {
            *sample = source.sample(i, j);
        }
        // The axes' vectors have one component each, so the sum only gathers u, v and 1. From there on the
        // same operations in the same order as LatticePoint::normal, whose bits these are.
        let cube = row_start + right * axes.u(i);
        let length = (cube.x * cube.x + cube.y * cube.y + cube.z * cube.z).sqrt();
        let normal = DVec3::new(cube.x / length, cube.y / length, cube.z / length);
        let height_m = fuse(normal, samples);
        if !height_m.is_finite() {
            out.truncate(before);
            return Err(MeshError::NotFinite { tile, i, j });
        }
        lowest_m = lowest_m.min(height_m);
        highest_m = highest_m.max(height_m);
        let position = ellipsoid.point(normal, height_m);
        out.push(Vertex {
            position: FixedPoint::from_ecef(position).words(),
            normal: snorm(normal),
            lattice: [i, j],
        });
    }
    Ok(Heights {
        lowest_m,
        highest_m,
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
