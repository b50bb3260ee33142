//! How a circle lies to a tile: outside, inside, or with its rim between the nodes.
//! In: a circle, a tile. Out: the relation, never wrong: balls around ever smaller parts of the tile decide,
//! and where the smallest ones leave it open the tile counts as a border tile. It visits no single node.

use glam::DVec3;

use super::Circle;
use crate::lattice::{CELLS, LatticePoint};
use crate::tile::Tile;

/// Cells along the side of the smallest part of a tile that is looked at.
const SMALLEST_PART: i64 = 8;

/// From a tile to any node one step outside it, in units of 1/256 of a tile's share of its cube edge: normals
/// move by at most 1.706 of these from node to node (4/3 · √(1+3u)/(1+u²), largest at u = 0.39), and a
/// corner of the border is two steps away.
const BORDER_STEP: f64 = 3.5;

/// Room for the rounding of f64, as a share of the planet's radius: 6 µm on Earth.
const SLACK: f64 = 1e-12;

/// How a circle lies to a tile's lattice with its border of one node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Relation {
    /// No node is inside the circle.
    Outside,
    /// Every node is inside the circle.
    Inside,
    /// The rim may pass between the nodes.
    Border,
}

impl Circle {
    /// How the circle lies to a tile's nodes −1…257. `Outside` and `Inside` are certain;
    /// `Border` may be said where the rim passes up to 20 samples beside the tile, and farther for circles of
    /// more than 1.8 radians.
    #[must_use]
    pub fn relation(&self, tile: Tile) -> Relation {
        let (a, b) = (self.ellipsoid.semi_major_m, self.ellipsoid.semi_minor_m);
        // The largest radius of curvature: a normal turned by an angle moves its point by no more than the
        // angle times this.
        let widest_m = (a * a / b).max(b * b / a);
        let step = BORDER_STEP / (CELLS << tile.level()) as f64;
        let parts = Parts {
            circle: self,
            tile,
            widest_m,
            room_m: widest_m * (step + SLACK),
        };
        parts.relation(0, 0, CELLS)
    }
}

/// The parts of one tile.
struct Parts<'a> {
    circle: &'a Circle,
    tile: Tile,
    widest_m: f64,
    /// How far nodes may lie beyond the part that stands for them.
    room_m: f64,
}

impl Parts<'_> {
    fn normal(&self, i: i64, j: i64) -> DVec3 {
        LatticePoint::of_tile(self.tile, i, j).normal()
    }

    /// The relation of the part of `size` × `size` cells from node (i, j).
    fn relation(&self, i: i64, j: i64, size: i64) -> Relation {
        let half = size / 2;
        let middle = self.normal(i + half, j + half);
        // Sides of a part are arcs of great circles on the sphere of normals. A cap that holds the corners
        // holds the part, as caps smaller than a half sphere are convex.
        let widest_chord_squared = [
            self.normal(i, j),
            self.normal(i + size, j),
            self.normal(i, j + size),
            self.normal(i + size, j + size),
        ]
        .into_iter()
        .map(|corner| corner.distance_squared(middle))
        .fold(0.0, f64::max);
        // Chord to angle: 2 asin(c/2) ≤ c (1 + 0.056 c²) up to a right angle; a face's half is 54.8°.
        let angle = widest_chord_squared.sqrt() * (1.0 + 0.056 * widest_chord_squared);
        let reach_m = self.widest_m * angle + self.room_m;
        let circle = self.circle;
        let distance_m = circle.ellipsoid.point(middle, 0.0).distance(circle.centre);
        if distance_m - reach_m > circle.chord_m {
            return Relation::Outside;
        }
        if distance_m + reach_m < circle.chord_m {
            return Relation::Inside;
        }
        if size <= SMALLEST_PART {
            return Relation::Border;
        }
        let first = self.relation(i, j, half);
        let alike = first != Relation::Border
            && [(i + half, j), (i, j + half), (i + half, j + half)]
                .into_iter()
                .all(|(i, j)| self.relation(i, j, half) == first);
        if alike { first } else { Relation::Border }
    }
}
