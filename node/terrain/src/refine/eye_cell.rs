//! Eye cells: a leaf's own grid of eyes, coarse where the leaf is far, so that its mesh stays while the view barely moves.
//! In: a tile, its heights, the eye. Out: a ball that holds the eye and every other eye of the same cell. A pure
//! function of the view, without history: all nodes, and a tiled wall and a single picture, find the same cell.

use geodesy::{CELLS, Ellipsoid, LatticePoint, Tile, TileHull};
use glam::DVec3;

/// A cell is at most this share of the distance from the eye to the leaf. It decides how long a mesh
/// lasts, and how much of the tolerance is given away for it.
const CELL_SHARE: f64 = 1.0 / 32.0;
/// Cells smaller than this do not pay: the eye itself is taken.
const SMALLEST_CELL_M: f64 = 1e-3;
/// Half the diagonal of a cube of side 1, √3/2, with room for the rounding of large coordinates.
const CIRCUMRADIUS: f64 = 0.867;

/// The eyes for which a leaf has one and the same mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeCell {
    /// Centre of the ball in ECEF metres.
    pub centre: DVec3,
    /// Every eye that gives this cell lies within this many metres of the centre; 0 for an eye by itself.
    pub radius_m: f64,
}

impl EyeCell {
    /// The cell that holds one eye alone.
    #[must_use]
    pub const fn exact(eye: DVec3) -> Self {
        Self {
            centre: eye,
            radius_m: 0.0,
        }
    }

    /// The bits of centre and radius, to hash and compare cells by.
    #[must_use]
    pub fn to_bits(&self) -> [u64; 4] {
        let [x, y, z] = self.centre.to_array();
        [x, y, z, self.radius_m].map(f64::to_bits)
    }
}

/// The cell of an eye (ECEF metres) for a leaf whose heights lie within `range_m` (lowest and highest, in
/// metres above the ellipsoid).
///
/// Cells are cubes whose side is the largest power of two that is at most 1/32 of the distance from the eye
/// to the leaf. All leaves share one grid and its halves: a mesh depends on the cells of all leaves around its own,
/// and where those change together it is made anew least often. Where the eye may be within the leaf's hull, or the cell would be smaller than a millimetre, it is the
/// eye alone.
#[must_use]
pub fn eye_cell(ellipsoid: &Ellipsoid, tile: Tile, range_m: (f64, f64), eye: DVec3) -> EyeCell {
    let side_m = power_of_two_below(distance_m(ellipsoid, tile, range_m, eye) * CELL_SHARE);
    if !(side_m >= SMALLEST_CELL_M && side_m.is_finite() && eye.is_finite()) {
        return EyeCell::exact(eye);
    }
    let snap = |c: f64| ((c / side_m).floor() + 0.5) * side_m;
    EyeCell {
        centre: DVec3::new(snap(eye.x), snap(eye.y), snap(eye.z)),
        radius_m: CIRCUMRADIUS * side_m,
    }
}

/// A lower bound of the distance from the eye to the surface of a leaf whose heights lie within `range_m`, in metres: that
/// to the ball around it, or to the upright box around its hull, whichever is farther. Not positive where the eye may be
/// inside.
#[must_use]
pub fn distance_m(ellipsoid: &Ellipsoid, tile: Tile, range_m: (f64, f64), eye: DVec3) -> f64 {
    let hull = TileHull::new(ellipsoid, tile, range_m.0, range_m.1);
    let to_ball = eye.distance(hull.ball.centre) - hull.ball.radius_m;
    let up = LatticePoint::of_tile(tile, CELLS / 2, CELLS / 2).normal();
    let [first, second, ..] = hull.corners;
    let along = second - first;
    let right = (along - up * along.dot(up)).normalize_or_zero();
    let axes = [right, up.cross(right), up];
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for corner in hull.corners {
        for (axis, (low, high)) in axes.iter().zip(low.iter_mut().zip(&mut high)) {
            let place = (corner - eye).dot(*axis);
            *low = low.min(place);
            *high = high.max(place);
        }
    }
    let gaps = low
        .iter()
        .zip(&high)
        .map(|(low, high)| low.max(-high).max(0.0));
    let to_box = gaps.map(|gap| gap * gap).sum::<f64>().sqrt();
    to_ball.max(to_box)
}

/// As [`distance_m`], but for a leaf under the eye at least how far the eye is above its highest place. Beyond the
/// horizon of a large leaf that says more than its box does.
#[must_use]
pub fn least_distance_m(ellipsoid: &Ellipsoid, tile: Tile, range_m: (f64, f64), eye: DVec3) -> f64 {
    let below = ellipsoid.normal_below(eye);
    let height_m = (eye - ellipsoid.point(below, 0.0)).dot(below);
    distance_m(ellipsoid, tile, range_m, eye).max(height_m - range_m.1)
}

/// The largest power of two that is not above a positive number; 0 for anything below the normal numbers.
fn power_of_two_below(number: f64) -> f64 {
    if number >= f64::MIN_POSITIVE {
        f64::from_bits(number.to_bits() & 0x7ff0_0000_0000_0000)
    } else {
        0.0
    }
}
