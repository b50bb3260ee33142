//! Level of detail: which tiles of the six quadtrees make up the planet for one eye.
//! In: an eye, the wall's pixels per radian, limits, height ranges of tiles. Out: the leaves of a
//! restricted quadtree over the whole planet. It knows no frustum: what two nodes both see, both see alike.

use geodesy::{Direction, Ellipsoid, MAX_LEVEL, Tile, TileHull};
use glam::DVec3;

use crate::refine::least_distance_m;
use crate::solid_angle::Criterion;
use crate::tile_set::{TileSet, key};

/// All directions: no tile covers more.
const WHOLE_SKY_SR: f64 = 4.0 * std::f64::consts::PI;

/// What the level of detail depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LodView {
    /// The observer's eye in ECEF metres.
    pub eye: DVec3,
    /// Pixels of the wall's densest channel per radian at the observer's head.
    pub pixels_per_radian: f64,
}

/// What bounds the level of detail.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LodLimits {
    /// No tile is deeper than this: the finest level of any data, at most [`MAX_LEVEL`].
    pub deepest_level: u8,
    /// A tile that covers more pixels than a square of this side is split.
    pub tile_px: f64,
    /// No more leaves than this over the whole planet; `tile_px` is raised until they fit. The six
    /// roots are always there.
    pub most_tiles: usize,
}

impl Default for LodLimits {
    fn default() -> Self {
        Self {
            deepest_level: MAX_LEVEL,
            tile_px: 257.0,
            most_tiles: 8192,
        }
    }
}

/// A range of heights, and the level of the tile that it was measured on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relief {
    /// Lowest elevation in metres.
    pub lowest_m: f64,
    /// Highest elevation in metres.
    pub highest_m: f64,
    /// Level of the measured tile: the asking tile's own, or an ancestor's.
    pub level: u8,
}

/// The heights that a tile can take.
pub trait HeightRanges {
    /// Lowest and highest elevation in metres of anything drawn within `tile`: its own data, any
    /// ancestor's data shown in its place, data of its neighbours along its border, and 0 where there
    /// may be a hole. The answer must be the same on every node and may not depend on what is loaded.
    /// A range that is too wide costs tiles; one that is too narrow may cull what is visible.
    fn range_m(&self, tile: Tile) -> (f64, f64);

    /// The heights that decide how many pixels `tile` covers, and whose they are. Bound by the same rule
    /// as [`HeightRanges::range_m`], but not to be conservative.
    fn relief(&self, tile: Tile) -> Relief {
        let (lowest_m, highest_m) = self.range_m(tile);
        Relief {
            lowest_m,
            highest_m,
            level: tile.level(),
        }
    }

    /// How near, in metres, an eye of so many pixels per radian may come to `tile` before it is divided whether or not
    /// that shows anything else: its own curve would show. Bound by the same rule: the same answer on every node.
    fn nearest_m(&self, _tile: Tile, _pixels_per_radian: f64) -> f64 {
        0.0
    }

    /// Whether the children of `tile` could show anything that it cannot: finer data, or data that its
    /// own patch is too coarse for. Bound by the same rule: the same answer on every node.
    fn is_worth_dividing(&self, _tile: Tile) -> bool {
        true
    }
}

impl<F: Fn(Tile) -> (f64, f64)> HeightRanges for F {
    fn range_m(&self, tile: Tile) -> (f64, f64) {
        self(tile)
    }
}

/// What lies beyond an edge of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgeNeighbour {
    /// One leaf of the same level.
    Same(Tile),
    /// One leaf a level up; this leaf holds half of its edge.
    Coarser(Tile),
    /// Two leaves a level down, in the order of the growing coordinate along this leaf's edge (v for
    /// left and right, u for down and up).
    Finer([Tile; 2]),
}

/// The leaves of six restricted quadtrees: they cover the planet once, and leaves that touch, even at a
/// corner, differ by at most one level.
#[derive(Clone, Debug)]
pub struct Selection {
    leaves: Vec<Tile>,
    divided: TileSet,
    achieved_tile_px: f64,
}

/// Selects the leaves for a view. The result is the smallest restricted quadtree in which no leaf
/// above `deepest_level` that is worth dividing covers more than `tile_px`² pixels, and none is nearer than
/// [`HeightRanges::nearest_m`]; it does not depend on the order of work.
///
/// A tile's pixels are the solid angle of the convex hull of [`TileHull::corners`] times
/// `pixels_per_radian`², with the heights of [`HeightRanges::relief`]. If there are more than `most_tiles` leaves, `tile_px` grows by factors of √2;
/// [`Selection::achieved_tile_px`] tells what it came to. A view that is not finite selects the roots.
#[must_use]
pub fn select(
    ellipsoid: &Ellipsoid,
    view: &LodView,
    limits: &LodLimits,
    ranges: &dyn HeightRanges,
) -> Selection {
    let sane = view.eye.is_finite() && view.pixels_per_radian.is_finite() && limits.tile_px > 0.0;
    let most_tiles = if sane {
        limits.most_tiles.max(Tile::ROOTS.len())
    } else {
        Tile::ROOTS.len()
    };
    let below = ellipsoid.normal_below(view.eye);
    let eye_height_m = (view.eye - ellipsoid.point(below, 0.0)).dot(below);
    let mut tile_px = limits.tile_px;
    loop {
        let radians = tile_px / view.pixels_per_radian;
        let steradians = if sane {
            radians * radians
        } else {
            f64::INFINITY
        };
        let criterion = Criterion::new(view.eye, steradians);
        let wanted = |tile: Tile| {
            let nearest_m = ranges.nearest_m(tile, view.pixels_per_radian);
            if nearest_m > 0.0
                && steradians < WHOLE_SKY_SR
                && least_distance_m(ellipsoid, tile, ranges.range_m(tile), view.eye) < nearest_m
            {
                return true;
            }
            if !ranges.is_worth_dividing(tile) {
                return false;
            }
            let (lowest_m, highest_m) = slab(tile, ranges.relief(tile), eye_height_m);
            criterion.exceeded_by(&TileHull::new(ellipsoid, tile, lowest_m, highest_m).corners)
        };
        // Grows without end only until the threshold passes 4π, which nothing exceeds.
        if let Some(selection) = Selection::grow(limits.deepest_level, most_tiles, tile_px, &wanted)
        {
            return selection;
        }
        tile_px *= std::f64::consts::SQRT_2;
    }
}

/// The heights of a tile that count for its pixels. A tile below the depth of its data knows only the range
/// of a wider one; taken whole, it would be a tower, and split for its height alone. Relief shrinks with
/// width, so it gets its share of the range, where the range comes nearest to the eye.
fn slab(tile: Tile, relief: Relief, eye_height_m: f64) -> (f64, f64) {
    let Relief {
        lowest_m,
        highest_m,
        level,
    } = relief;
    let share = 1.0 / f64::from(1_u32 << tile.level().saturating_sub(level).min(MAX_LEVEL));
    let half_m = 0.5 * share * (highest_m - lowest_m);
    // Not `clamp`: a broken range must not be able to panic here.
    let middle_m = eye_height_m.max(lowest_m + half_m).min(highest_m - half_m);
    (middle_m - half_m, middle_m + half_m)
}

impl Selection {
    /// The smallest restricted forest in which every tile above `deepest_level` that is `wanted` is divided;
    /// `None` as soon as it has more than `most_tiles` leaves.
    fn grow(
        deepest_level: u8,
        most_tiles: usize,
        tile_px: f64,
        wanted: &dyn Fn(Tile) -> bool,
    ) -> Option<Self> {
        let mut growth = Growth {
            divided: TileSet::with_capacity(512),
            tiles: Vec::with_capacity(2048),
        };
        growth.tiles.extend(Tile::ROOTS);
        let mut next = 0;
        while let Some(tile) = growth.tiles.get(next).copied() {
            next += 1;
            if tile.level() < deepest_level && !growth.divided.contains(tile) && wanted(tile) {
                growth.divide(tile);
                // Each division turns one leaf into four.
                if (growth.tiles.len() - Tile::ROOTS.len()) / 4 * 3 + Tile::ROOTS.len() > most_tiles
                {
                    return None;
                }
            }
        }
        let Growth {
            divided,
            tiles: mut leaves,
        } = growth;
        leaves.retain(|tile| !divided.contains(*tile));
        leaves.sort_unstable_by_key(|tile| key(*tile));
        Some(Self {
            leaves,
            divided,
            achieved_tile_px: tile_px,
        })
    }

    /// The leaves, sorted as tiles are: by level, face, row, column.
    #[must_use]
    pub fn leaves(&self) -> &[Tile] {
        &self.leaves
    }

    /// The side in pixels above which tiles were split: `LodLimits::tile_px`, or more if that gave too
    /// many leaves.
    #[must_use]
    pub fn achieved_tile_px(&self) -> f64 {
        self.achieved_tile_px
    }

    /// True for the tiles of [`Selection::leaves`]. Constant time.
    #[must_use]
    pub fn is_leaf(&self, tile: Tile) -> bool {
        self.exists(tile) && !self.divided.contains(tile)
    }

    /// True for a tile that is covered by leaves of deeper levels. Constant time.
    #[must_use]
    pub fn is_divided(&self, tile: Tile) -> bool {
        self.divided.contains(tile)
    }

    /// The leaf that is the tile or its ancestor; `None` where the tile is divided into leaves.
    #[must_use]
    pub fn leaf_at(&self, tile: Tile) -> Option<Tile> {
        if self.divided.contains(tile) {
            return None;
        }
        tile.lineage().find(|ancestor| self.exists(*ancestor))
    }

    /// What lies beyond an edge of a leaf. `None` if `leaf` is no leaf, or `edge` is a corner.
    #[must_use]
    pub fn edge_neighbour(&self, leaf: Tile, edge: Direction) -> Option<EdgeNeighbour> {
        if !self.is_leaf(leaf) {
            return None;
        }
        let halves = edge_children(edge)?;
        let beside = leaf.neighbour(edge)?;
        if self.divided.contains(beside) {
            // Our own children, were there any, know which children of the neighbour they touch,
            // whatever the orientation of its face.
            let children = leaf.children()?;
            let [first, second] = halves.map(|child| children[child].neighbour(edge));
            return Some(EdgeNeighbour::Finer([first?, second?]));
        }
        if self.exists(beside) {
            return Some(EdgeNeighbour::Same(beside));
        }
        beside.parent().map(EdgeNeighbour::Coarser)
    }

    /// The leaf beyond a corner of a leaf; `None` at a cube corner, where nothing lies between the two
    /// edge neighbours, and for a `corner` that is an edge.
    #[must_use]
    pub fn corner_neighbour(&self, leaf: Tile, corner: Direction) -> Option<Tile> {
        let child = corner_child(corner)?;
        let beyond = leaf.neighbour(corner)?;
        if self.divided.contains(beyond) {
            return leaf.children()?[child].neighbour(corner);
        }
        if self.exists(beyond) {
            Some(beyond)
        } else {
            beyond.parent()
        }
    }

    /// All leaves that touch a leaf along an edge or at a corner, itself left out; sorted, at most 12.
    #[must_use]
    pub fn leaves_around(&self, leaf: Tile) -> Vec<Tile> {
        let mut around = Vec::with_capacity(12);
        for direction in Direction::ALL {
            match self.edge_neighbour(leaf, direction) {
                Some(EdgeNeighbour::Same(tile) | EdgeNeighbour::Coarser(tile)) => around.push(tile),
                Some(EdgeNeighbour::Finer(tiles)) => around.extend(tiles),
                None if self.is_leaf(leaf) => around.extend(self.corner_neighbour(leaf, direction)),
                None => {}
            }
        }
        around.sort_unstable();
        around.dedup();
        around
    }

    fn exists(&self, tile: Tile) -> bool {
        tile.parent()
            .is_none_or(|parent| self.divided.contains(parent))
    }
}

/// The children of a tile along one of its edges, in the order of the growing coordinate.
fn edge_children(edge: Direction) -> Option<[usize; 2]> {
    match edge {
        Direction::Left => Some([0, 2]),
        Direction::Right => Some([1, 3]),
        Direction::Down => Some([0, 1]),
        Direction::Up => Some([2, 3]),
        _ => None,
    }
}

/// The child of a tile at one of its corners.
fn corner_child(corner: Direction) -> Option<usize> {
    match corner {
        Direction::LeftDown => Some(0),
        Direction::RightDown => Some(1),
        Direction::LeftUp => Some(2),
        Direction::RightUp => Some(3),
        _ => None,
    }
}

/// A forest while it grows.
struct Growth {
    divided: TileSet,
    /// Every tile that exists, divided or not, in the order of its making.
    tiles: Vec<Tile>,
}

impl Growth {
    /// Divides an existing tile, and first whatever must be divided so that all tiles of its level
    /// around it exist. Recursion is at most one deep per level.
    fn divide(&mut self, tile: Tile) {
        let Some(children) = tile.children() else {
            return;
        };
        if !self.divided.insert(tile) {
            return;
        }
        // Five of the eight neighbours have other parents than this tile, and those are three: the ones
        // towards the side and the corner of its parent at which this tile lies.
        let towards = match tile.child_index() {
            0 => [Direction::Left, Direction::Down, Direction::LeftDown],
            1 => [Direction::Right, Direction::Down, Direction::RightDown],
            2 => [Direction::Left, Direction::Up, Direction::LeftUp],
            _ => [Direction::Right, Direction::Up, Direction::RightUp],
        };
        for neighbour in towards
            .into_iter()
            .filter_map(|direction| tile.neighbour(direction))
        {
            if let Some(parent) = neighbour.parent() {
                self.divide(parent);
            }
        }
        self.tiles.extend(children);
    }
}
