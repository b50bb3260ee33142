//! The geodetic normals of one tile's lattice, row by row.
//! In: a tile. Out: the normal of any of its nodes, the same bits as those of `LatticePoint::normal`, at the price
//! of a square root and three quotients. It knows no heights.

use geodesy::{CELLS, LATTICE_BITS, NODES, Tile, st_to_uv};
use glam::DVec3;

/// Cube coordinates of a tile's columns and rows.
pub(crate) struct Normals {
    right: DVec3,
    up: DVec3,
    outward: DVec3,
    u: [f64; NODES as usize],
    v: [f64; NODES as usize],
}

impl Normals {
    pub(crate) fn new(tile: Tile) -> Self {
        // Dyadic, so exact: the same quotients as LatticePoint::normal divides out.
        let per_step = 1.0 / (CELLS << tile.level()) as f64;
        let along = |index: u32| {
            let start = f64::from(index) * f64::from(1_u16 << LATTICE_BITS);
            std::array::from_fn(|i| st_to_uv((start + i as f64) * per_step))
        };
        let [right, up, outward] = tile.face().frame();
        Self {
            right,
            up,
            outward,
            u: along(tile.x()),
            v: along(tile.y()),
        }
    }

    /// The unit normal at node (x, y), each 0…256; beyond, that of the far edge.
    #[inline]
    pub(crate) fn at(&self, x: u16, y: u16) -> DVec3 {
        let last = (NODES - 1) as usize;
        let u = self.u[usize::from(x).min(last)];
        let v = self.v[usize::from(y).min(last)];
        // The axes' vectors have one component each, so the sums only gather u, v and 1.
        let cube = (self.outward + self.up * v) + self.right * u;
        let length = (cube.x * cube.x + cube.y * cube.y + cube.z * cube.z).sqrt();
        DVec3::new(cube.x / length, cube.y / length, cube.z / length)
    }
}
