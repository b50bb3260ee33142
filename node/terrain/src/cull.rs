//! Culling: which leaves some picture may show.
//! In: a selection, frusta, a horizon, height ranges. Out: leaves that may be visible. Conservative: it
//! never drops a leaf of which one point is visible. It comes last and changes no leaf's level.

use geodesy::{Ball, Ellipsoid, Horizon, Tile, TileHull};
use glam::{DMat4, DVec3};

use crate::select::{HeightRanges, Selection};

/// A view pyramid without near or far plane: four planes through the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frustum {
    eye: DVec3,
    /// Unit normals that point inwards.
    inwards: [DVec3; 4],
}

impl Frustum {
    /// The pyramid from `eye` (ECEF metres) through four directions, given in order around the picture,
    /// either way. They need not be of unit length. The pyramid must be narrower than a half space.
    #[must_use]
    pub fn from_corners(eye: DVec3, corners: [DVec3; 4]) -> Self {
        let corners = corners.map(DVec3::normalize_or_zero);
        let middle = corners.iter().sum::<DVec3>();
        let [a, b, c, d] = corners;
        let inwards = [(a, b), (b, c), (c, d), (d, a)].map(|(from, to)| {
            let normal = from.cross(to).normalize_or_zero();
            if normal.dot(middle) < 0.0 {
                -normal
            } else {
                normal
            }
        });
        Self { eye, inwards }
    }

    /// The pyramid of a projection from ECEF axes with the origin at `eye` to clip space (x and y within
    /// −w…w): rotation and projection only, no translation.
    #[must_use]
    pub fn from_view_projection(eye: DVec3, view_projection: &DMat4) -> Self {
        // Rows of the matrix combine to planes (G. Gribb and K. Hartmann, 2001). Through the eye, so
        // without a constant term.
        let [x, y, w] = [0, 1, 3].map(|row| view_projection.row(row).truncate());
        let inwards = [w + x, w - x, w + y, w - y].map(DVec3::normalize_or_zero);
        Self { eye, inwards }
    }

    /// The eye in ECEF metres.
    #[must_use]
    pub fn eye(&self) -> DVec3 {
        self.eye
    }

    /// False only if no point of the convex hull of `corners` or no point of the ball is inside.
    #[must_use]
    pub fn may_see(&self, hull: &TileHull) -> bool {
        let to_centre = hull.ball.centre - self.eye;
        if self
            .inwards
            .iter()
            .any(|inward| to_centre.dot(*inward) < -hull.ball.radius_m)
        {
            return false;
        }
        self.inwards.iter().all(|inward| {
            let offset = self.eye.dot(*inward);
            // A hair's breadth for the rounding of ECEF coordinates.
            hull.corners
                .iter()
                .any(|corner| corner.dot(*inward) - offset >= -1e-6)
        })
    }

    /// True if the point is inside the pyramid.
    #[must_use]
    pub fn contains(&self, point: DVec3) -> bool {
        self.inwards
            .iter()
            .all(|inward| (point - self.eye).dot(*inward) >= 0.0)
    }

    /// False only if no point of the ball is inside.
    #[must_use]
    pub fn may_see_ball(&self, ball: &Ball) -> bool {
        let to_centre = ball.centre - self.eye;
        self.inwards
            .iter()
            .all(|inward| to_centre.dot(*inward) >= -ball.radius_m)
    }
}

/// The leaves that some frustum may see and the planet does not hide, sorted as tiles are.
///
/// `horizon` and `ranges` must be those of the planet as it is drawn: the horizon's floor no higher than
/// the lowest height of any range.
#[must_use]
pub fn cull(
    ellipsoid: &Ellipsoid,
    selection: &Selection,
    frusta: &[Frustum],
    horizon: &Horizon,
    ranges: &dyn HeightRanges,
) -> Vec<Tile> {
    let visible = |tile: &Tile| {
        let (lowest_m, highest_m) = ranges.range_m(*tile);
        let hull = TileHull::new(ellipsoid, *tile, lowest_m, highest_m);
        !horizon.hides(&hull.ball) && frusta.iter().any(|frustum| frustum.may_see(&hull))
    };
    selection.leaves().iter().copied().filter(visible).collect()
}
