//! What space a tile can take up, given the range of its heights.
//! In: an ellipsoid, a tile, lowest and highest elevation. Out: a hull of points and a ball around them.

use glam::DVec3;

use crate::ellipsoid::Ellipsoid;
use crate::lattice::{CELLS, LatticePoint};
use crate::tile::Tile;

/// A ball in ECEF metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre in ECEF metres.
    pub centre: DVec3,
    /// Radius in metres.
    pub radius_m: f64,
}

/// Eight points whose convex hull holds the tile's surface between two heights: its corners at the
/// lowest height, and at a height that clears the bulge between them.
#[derive(Clone, Copy, Debug)]
pub struct TileHull {
    /// The four lower corners, then the four upper ones, in ECEF metres.
    pub corners: [DVec3; 8],
    /// A ball around the hull.
    pub ball: Ball,
}

impl TileHull {
    /// The hull of `tile` for elevations within `lowest_m`…`highest_m` above the ellipsoid.
    #[must_use]
    pub fn new(ellipsoid: &Ellipsoid, tile: Tile, lowest_m: f64, highest_m: f64) -> Self {
        let node = |i, j| LatticePoint::of_tile(tile, i, j).normal();
        let normals = [node(0, 0), node(CELLS, 0), node(0, CELLS), node(CELLS, CELLS)];
        let middle = node(CELLS / 2, CELLS / 2);
        let lower = normals.map(|n| ellipsoid.point(n, lowest_m));
        // The face through the four upper corners must lie outside the surface: raise the corners by
        // what the surface bulges above their plane, which is largest near the middle or an edge's middle.
        let top = normals.map(|n| ellipsoid.point(n, highest_m));
        let lowest_cosine = normals.iter().map(|n| n.dot(middle)).fold(1.0, f64::min);
        let reach = ellipsoid.largest_radius_m() + highest_m;
        let bulge = reach * (1.0 / lowest_cosine.max(0.2) - 1.0);
        let mut corners = [DVec3::ZERO; 8];
        for (index, n) in normals.iter().enumerate() {
            corners[index] = lower[index];
            corners[index + 4] = top[index] + *n * bulge * 1.01;
        }
        // Edges bow sideways too (great-circle-like edges stay within planes through the axis crossing
        // only on a sphere): widen the ball a little instead of trusting the eight points alone.
        let centre = ellipsoid.point(middle, 0.5 * (lowest_m + highest_m));
        let farthest = lower.iter().chain(&top).map(|p| p.distance(centre)).fold(0.0, f64::max);
        let half_height = 0.5 * (highest_m - lowest_m);
        Self { corners, ball: Ball { centre, radius_m: farthest.max(half_height) * 1.001 } }
    }
}
