//! Lattice nodes: where the samples of a tile lie, and which node of which tile is the same point.
//! In: a tile and a node index, border included. Out: one integer address a point of the planet, its
//! direction, and every tile that holds it. A point on a shared edge has one address from all sides.

use glam::DVec3;

use crate::cube::{FACES, Face, st_to_uv, uv_to_st};
use crate::tile::{MAX_LEVEL, Tile};

/// k: a tile has 2^k cells a side.
pub const LATTICE_BITS: u8 = 8;
/// Cells along a tile's side.
pub const CELLS: i64 = 1 << LATTICE_BITS;
/// Nodes along a tile's side, both edges included.
pub const NODES: i64 = CELLS + 1;
/// Nodes beyond each edge that a tile stores, so that filters up to 19×19 need no neighbour.
pub const BORDER: i64 = 9;
/// Nodes along a side of the stored array.
pub const STORED_NODES: usize = (NODES + 2 * BORDER) as usize;
/// The finest level at which points are addressed.
pub const MAX_POINT_LEVEL: u8 = MAX_LEVEL;

/// A node of the lattice of one level, as an integer point on the surface of a cube of half width
/// 2^(level + 8). Every representation of the same point compares equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct LatticePoint {
    level: u8,
    cube: [i64; 3],
}

/// A position within a tile in lattice units: (0, 0) is the left lower node, 256 the far edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TilePosition {
    /// The tile.
    pub tile: Tile,
    /// Lattice units along u, 0…256.
    pub i: f64,
    /// Lattice units along v, 0…256.
    pub j: f64,
}

impl LatticePoint {
    /// Node (i, j) of `tile`. Indices may lie up to a whole tile outside 0…256: they continue over
    /// face edges. Beyond a cube corner, where no lattice continues, they fold along u, then along v.
    #[must_use]
    pub fn of_tile(tile: Tile, i: i64, j: i64) -> Self {
        let half = CELLS << tile.level();
        let u = 2 * (i64::from(tile.x()) * CELLS + i) - half;
        let v = 2 * (i64::from(tile.y()) * CELLS + j) - half;
        Self {
            level: tile.level(),
            cube: tile.face().fold(u, v, half),
        }
    }

    /// The level of the lattice.
    #[must_use]
    pub const fn level(self) -> u8 {
        self.level
    }

    /// The integer cube point: components in −2^(level+8)…2^(level+8), at least one at an end.
    #[must_use]
    pub const fn cube(self) -> [i64; 3] {
        self.cube
    }

    fn half(self) -> i64 {
        CELLS << self.level
    }

    /// The unit normal of the planet at this point. The same bits for every tile that shares it.
    #[must_use]
    pub fn normal(self) -> DVec3 {
        let scale = 2.0 * self.half() as f64;
        let half = self.half();
        let component = |c: i64| st_to_uv((c + half) as f64 / scale);
        let [x, y, z] = self.cube.map(component);
        let length = (x * x + y * y + z * z).sqrt();
        DVec3::new(x / length, y / length, z / length)
    }

    /// True on the edge between two cube faces.
    #[must_use]
    pub fn on_face_edge(self) -> bool {
        self.faces_met() > 1
    }

    /// True at the meeting of three cube faces.
    #[must_use]
    pub fn on_cube_corner(self) -> bool {
        self.faces_met() > 2
    }

    fn faces_met(self) -> usize {
        self.cube.iter().filter(|c| c.abs() == self.half()).count()
    }

    /// The same point in the lattice of a finer or coarser level; `None` where the coarser lattice has
    /// no node there.
    #[must_use]
    pub fn at_level(self, level: u8) -> Option<Self> {
        if level >= self.level {
            let shift = level - self.level;
            return Some(Self {
                level,
                cube: self.cube.map(|c| c << shift),
            });
        }
        // Cube components step by two from node to node, and all share the parity of `half`.
        let shift = self.level - level;
        let half = self.half();
        let fits = |c: &i64| (c + half) % (2_i64 << shift) == 0;
        self.cube.iter().all(fits).then(|| Self {
            level,
            cube: self.cube.map(|c| c >> shift),
        })
    }

    /// The one tile that owns this node: the lowest face that holds it, and there the tile whose left
    /// or lower edge it lies on (the last tile, at the face's far edges). Its index is 0…256.
    #[must_use]
    pub fn owner(self) -> (Tile, i64, i64) {
        let face = Face::of_integer_point(self.cube, self.half()).unwrap_or(FACES[0]);
        self.on_face(face)
    }

    fn on_face(self, face: Face) -> (Tile, i64, i64) {
        let (u, v) = face.integer_uv(self.cube);
        let last = (1_i64 << self.level) - 1;
        let (gi, gj) = ((u + self.half()) / 2, (v + self.half()) / 2);
        let (x, y) = ((gi / CELLS).min(last), (gj / CELLS).min(last));
        let tile = Tile::new(face.number(), self.level, x as u32, y as u32);
        (
            tile.unwrap_or(Tile::root(face)),
            gi - x * CELLS,
            gj - y * CELLS,
        )
    }

    /// Where this node lies in `tile`'s own lattice (0…256 both ways), for a tile of the same level;
    /// `None` where the tile does not touch the node.
    #[must_use]
    pub fn within(self, tile: Tile) -> Option<(i64, i64)> {
        if tile.level() == self.level {
            self.position_in(tile)
        } else {
            None
        }
    }

    /// Where this node lies in a tile of its own or of a coarser level: `(u, v)` in steps of
    /// 2^-(self.level − tile.level) of that tile's lattice unit, each 0…256 · 2^(self.level − tile.level).
    /// `None` where the tile is finer or does not touch the node.
    #[must_use]
    pub fn position_in(self, tile: Tile) -> Option<(i64, i64)> {
        let shift = self.level.checked_sub(tile.level())?;
        if !self.lies_on(tile.face()) {
            return None;
        }
        let (u, v) = tile.face().integer_uv(self.cube);
        let side = CELLS << shift;
        let i = (u + self.half()) / 2 - i64::from(tile.x()) * side;
        let j = (v + self.half()) / 2 - i64::from(tile.y()) * side;
        ((0..=side).contains(&i) && (0..=side).contains(&j)).then_some((i, j))
    }

    fn lies_on(self, face: Face) -> bool {
        let (u, v) = face.integer_uv(self.cube);
        face.integer_point(u, v, self.half()) == self.cube
    }

    /// All tiles of this level that touch the node: one inside a tile, two on an edge, four at a tile
    /// corner, three at a cube corner. Sorted.
    #[must_use]
    pub fn tiles(self) -> Vec<Tile> {
        let mut found = Vec::with_capacity(4);
        for face in FACES.into_iter().filter(|face| self.lies_on(*face)) {
            let (tile, i, j) = self.on_face(face);
            let (x, y) = (i64::from(tile.x()), i64::from(tile.y()));
            let columns = if i == 0 && x > 0 { x - 1..=x } else { x..=x };
            for column in columns {
                let rows = if j == 0 && y > 0 { y - 1..=y } else { y..=y };
                for row in rows {
                    found.extend(Tile::new(
                        face.number(),
                        self.level,
                        column as u32,
                        row as u32,
                    ));
                }
            }
        }
        found.sort_unstable();
        found
    }
}

impl TilePosition {
    /// Where a direction from the planet's axis crossing, read as geodetic normal, falls at a level.
    #[must_use]
    pub fn of_normal(normal: DVec3, level: u8) -> Self {
        let face = Face::of_direction(normal);
        let (u, v) = face.uv_of(normal);
        let tiles = f64::from(1_u32 << level.min(MAX_LEVEL));
        let split = |w: f64| {
            let position = (uv_to_st(w) * tiles).clamp(0.0, tiles);
            let index = position.floor().min(tiles - 1.0);
            (index as u32, (position - index) * CELLS as f64)
        };
        let ((x, i), (y, j)) = (split(u), split(v));
        let tile = Tile::new(face.number(), level.min(MAX_LEVEL), x, y);
        Self {
            tile: tile.unwrap_or(Tile::root(face)),
            i,
            j,
        }
    }

    /// The unit normal at this position.
    #[must_use]
    pub fn normal(self) -> DVec3 {
        let tiles = f64::from(1_u32 << self.tile.level());
        let s = (f64::from(self.tile.x()) + self.i / CELLS as f64) / tiles;
        let t = (f64::from(self.tile.y()) + self.j / CELLS as f64) / tiles;
        self.tile
            .face()
            .cube_point(st_to_uv(s), st_to_uv(t))
            .normalize()
    }
}
