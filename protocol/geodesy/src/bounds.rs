//! What space a tile can take up, given the range of its heights.
//! In: an ellipsoid, a tile, lowest and highest elevation. Out: a hull of points and a ball around the
//! surface. Both are conservative: no point of the tile between the two heights lies outside.

use glam::DVec3;

use crate::ellipsoid::Ellipsoid;
use crate::lattice::{CELLS, LatticePoint};
use crate::tile::Tile;

/// Room for the rounding of f64 and of fixed-point positions, in metres.
const SLACK_M: f64 = 1e-5;

/// A ball in ECEF metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre in ECEF metres.
    pub centre: DVec3,
    /// Radius in metres.
    pub radius_m: f64,
}

/// Eight points whose convex hull holds the tile's surface between two heights: its corners at the
/// lowest height, and the corners of a roof that touches the highest surface above the tile's middle.
#[derive(Clone, Copy, Debug)]
pub struct TileHull {
    /// The four lower corners, then the four upper ones, in ECEF metres.
    pub corners: [DVec3; 8],
    /// A ball around the tile's surface between the two heights. It is tighter than a ball around
    /// `corners`, whose roof stands clear of the surface.
    pub ball: Ball,
}

impl TileHull {
    /// The hull of `tile` for elevations within `lowest_m`…`highest_m` above the ellipsoid.
    #[must_use]
    pub fn new(ellipsoid: &Ellipsoid, tile: Tile, lowest_m: f64, highest_m: f64) -> Self {
        let (lowest_m, highest_m) = (lowest_m - SLACK_M, highest_m + SLACK_M);
        let node = |i, j| LatticePoint::of_tile(tile, i, j).normal();
        let normals = [
            node(0, 0),
            node(CELLS, 0),
            node(0, CELLS),
            node(CELLS, CELLS),
        ];
        let middle = node(CELLS / 2, CELLS / 2);
        let middle_base = ellipsoid.point(middle, 0.0);
        // The roof is the tangent plane at the middle of the highest surface. That surface is convex and
        // `middle` is its normal there, so all of it lies below the plane.
        let roof = middle.dot(middle_base) + highest_m;
        // On a sphere the sides of a tile are planes through the centre, and the hull is exact. On an
        // ellipsoid the normals along a side leave its plane by the height times the squared
        // eccentricity times a sine; where the roof stands above the surface that is the hull's error.
        let (a, b) = (ellipsoid.semi_major_m, ellipsoid.semi_minor_m);
        let (large, small) = (a.max(b), a.min(b));
        let eccentricity_squared = 1.0 - (small * small) / (large * large);
        let deviation =
            3.0 * eccentricity_squared * (1.0 + lowest_m.abs().max(highest_m.abs()) / small);

        let centre = middle_base + middle * (0.5 * (lowest_m + highest_m));
        let mut corners = [DVec3::ZERO; 8];
        let mut farthest_squared = 0.0_f64;
        for (index, n) in normals.into_iter().enumerate() {
            let base = ellipsoid.point(n, 0.0);
            let (lower, top) = (base + n * lowest_m, base + n * highest_m);
            let upright = middle.dot(n);
            let rise = ((roof - middle.dot(top)) / upright).max(0.0);
            let outward = (n - middle * upright).normalize_or_zero();
            let aside = outward * (deviation * rise + SLACK_M);
            corners[index] = lower + aside;
            corners[index + 4] = top + n * rise + aside;
            farthest_squared = farthest_squared
                .max(lower.distance_squared(centre))
                .max(top.distance_squared(centre));
        }
        // On an ellipsoid the farthest point need not be a corner, though it is next to one.
        let growth = 1.0 + 0.001_f64.max(0.5 * eccentricity_squared);
        let half_height = 0.5 * (highest_m - lowest_m);
        let radius_m = farthest_squared.sqrt().max(half_height) * growth + SLACK_M;
        Self {
            corners,
            ball: Ball { centre, radius_m },
        }
    }
}
