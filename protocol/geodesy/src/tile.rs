//! Tile addresses: face, level, x, y of six quadtrees that know their neighbours across faces.
//! In: addresses. Out: parents, children, neighbours, the path number of a tile. No geometry here.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::cube::{FACES, Face};

/// The deepest level: its lattice cells are about 9 mm wide on Earth.
pub const MAX_LEVEL: u8 = 22;

/// One square of a cube face at a level: x counts along u, y along v, both in 0…2^level − 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Tile {
    level: u8,
    face: Face,
    y: u32,
    x: u32,
}

/// Why a tile address was refused.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum TileError {
    /// Some part of the address is out of its range.
    #[error("no tile {face}/{level}/{x}/{y}: faces are 0…5, levels 0…22, x and y 0…2^level−1")]
    OutOfRange {
        /// The face that was given.
        face: u8,
        /// The level that was given.
        level: u8,
        /// The column that was given.
        x: u32,
        /// The row that was given.
        y: u32,
    },
    /// The text is not of the form face/level/x/y.
    #[error("\"{0}\" is no tile: write FACE/LEVEL/X/Y, for example 2/3/5/1")]
    Unreadable(String),
}

/// One of the eight directions in a face's own (u, v) plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// Towards −u.
    Left,
    /// Towards +u.
    Right,
    /// Towards −v.
    Down,
    /// Towards +v.
    Up,
    /// Towards −u, −v.
    LeftDown,
    /// Towards +u, −v.
    RightDown,
    /// Towards −u, +v.
    LeftUp,
    /// Towards +u, +v.
    RightUp,
}

impl Direction {
    /// The four edges, in the bit order of the border variants of a mesh: left, right, down, up.
    pub const EDGES: [Self; 4] = [Self::Left, Self::Right, Self::Down, Self::Up];
    /// All eight: the edges, then the corners.
    pub const ALL: [Self; 8] = [
        Self::Left,
        Self::Right,
        Self::Down,
        Self::Up,
        Self::LeftDown,
        Self::RightDown,
        Self::LeftUp,
        Self::RightUp,
    ];

    /// The step in x and y, each −1, 0 or 1.
    #[must_use]
    pub const fn step(self) -> (i64, i64) {
        match self {
            Self::Left => (-1, 0),
            Self::Right => (1, 0),
            Self::Down => (0, -1),
            Self::Up => (0, 1),
            Self::LeftDown => (-1, -1),
            Self::RightDown => (1, -1),
            Self::LeftUp => (-1, 1),
            Self::RightUp => (1, 1),
        }
    }
}

impl Tile {
    /// The six roots, by face number.
    pub const ROOTS: [Self; 6] = [
        Self::root(FACES[0]),
        Self::root(FACES[1]),
        Self::root(FACES[2]),
        Self::root(FACES[3]),
        Self::root(FACES[4]),
        Self::root(FACES[5]),
    ];

    /// The tile of a whole face.
    #[must_use]
    pub const fn root(face: Face) -> Self {
        Self {
            level: 0,
            face,
            y: 0,
            x: 0,
        }
    }

    /// A tile from its address.
    pub fn new(face: u8, level: u8, x: u32, y: u32) -> Result<Self, TileError> {
        let error = TileError::OutOfRange { face, level, x, y };
        let Some(cube_face) = Face::new(face) else {
            return Err(error);
        };
        if level > MAX_LEVEL || x >> level != 0 || y >> level != 0 {
            return Err(error);
        }
        Ok(Self {
            level,
            face: cube_face,
            y,
            x,
        })
    }

    /// The cube face.
    #[must_use]
    pub const fn face(self) -> Face {
        self.face
    }

    /// The level, 0 for a whole face.
    #[must_use]
    pub const fn level(self) -> u8 {
        self.level
    }

    /// The column along u.
    #[must_use]
    pub const fn x(self) -> u32 {
        self.x
    }

    /// The row along v.
    #[must_use]
    pub const fn y(self) -> u32 {
        self.y
    }

    /// The tile one level up that contains this one; `None` for a root.
    #[must_use]
    pub fn parent(self) -> Option<Self> {
        let level = self.level.checked_sub(1)?;
        Some(Self {
            level,
            face: self.face,
            y: self.y >> 1,
            x: self.x >> 1,
        })
    }

    /// The ancestor at `level`; the tile itself where `level` is its own or deeper.
    #[must_use]
    pub fn ancestor(self, level: u8) -> Self {
        let shift = self.level.saturating_sub(level);
        Self {
            level: self.level - shift,
            face: self.face,
            y: self.y >> shift,
            x: self.x >> shift,
        }
    }

    /// This tile and then each ancestor, up to the root.
    pub fn lineage(self) -> impl Iterator<Item = Self> {
        std::iter::successors(Some(self), |tile| tile.parent())
    }

    /// True where `other` is this tile or lies within it.
    #[must_use]
    pub fn contains(self, other: Self) -> bool {
        other.level >= self.level && other.ancestor(self.level) == self
    }

    /// The four tiles one level down, in the order (0,0), (1,0), (0,1), (1,1); `None` at the last level.
    #[must_use]
    pub fn children(self) -> Option<[Self; 4]> {
        if self.level >= MAX_LEVEL {
            return None;
        }
        let child = |dx, dy| Self {
            level: self.level + 1,
            face: self.face,
            y: self.y * 2 + dy,
            x: self.x * 2 + dx,
        };
        Some([child(0, 0), child(1, 0), child(0, 1), child(1, 1)])
    }

    /// Which child of its parent this is: 0…3 as in [`Tile::children`]; 0 for a root.
    #[must_use]
    pub const fn child_index(self) -> usize {
        ((self.x & 1) + 2 * (self.y & 1)) as usize
    }

    /// The tile of the same level beside this one, across face edges too. `None` only for the
    /// diagonal at a cube corner, where three tiles meet instead of four.
    #[must_use]
    pub fn neighbour(self, direction: Direction) -> Option<Self> {
        let (dx, dy) = direction.step();
        // Tile centres are odd integers on a cube of half width 2^level.
        let half = 1_i64 << self.level;
        let u = 2 * (i64::from(self.x) + dx) + 1 - half;
        let v = 2 * (i64::from(self.y) + dy) + 1 - half;
        if u.abs() > half && v.abs() > half {
            return None;
        }
        Some(Self::of_centre(self.face, u, v, self.level))
    }

    fn of_centre(face: Face, u: i64, v: i64, level: u8) -> Self {
        let half = 1_i64 << level;
        let (face, u, v) = if u.abs() <= half && v.abs() <= half {
            (face, u, v)
        } else {
            // A centre one tile beyond the edge folds to one half step inside the next face; the fold
            // keeps it off every other edge, so exactly one face holds it.
            let point = face.fold(u, v, half);
            let face = Face::of_integer_point(point, half).unwrap_or(face);
            let (u, v) = face.integer_uv(point);
            (face, u, v)
        };
        Self {
            level,
            face,
            y: ((v + half - 1) / 2) as u32,
            x: ((u + half - 1) / 2) as u32,
        }
    }

    /// A number that is unique over all tiles: a leading 1, three bits of face, then x and y
    /// interleaved (y above x), so that numeric order within a level follows the quadtree.
    #[must_use]
    pub fn id(self) -> u64 {
        let mut id = 8 | u64::from(self.face.number());
        for bit in (0..self.level).rev() {
            id = id << 2 | u64::from(self.y >> bit & 1) << 1 | u64::from(self.x >> bit & 1);
        }
        id
    }

    /// The tile of a number made by [`Tile::id`]; `None` for any other number.
    #[must_use]
    pub fn from_id(id: u64) -> Option<Self> {
        let bits = 63_u32.checked_sub(id.leading_zeros())?;
        let level = bits.checked_sub(3)?;
        if level % 2 != 0 || level / 2 > u32::from(MAX_LEVEL) {
            return None;
        }
        let level = (level / 2) as u8;
        let face = Face::new((id >> (2 * level) & 7) as u8)?;
        let (mut x, mut y) = (0, 0);
        for bit in (0..level).rev() {
            y = y << 1 | (id >> (2 * bit + 1) & 1) as u32;
            x = x << 1 | (id >> (2 * bit) & 1) as u32;
        }
        Some(Self { level, face, y, x })
    }
}

impl std::fmt::Display for Tile {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            formatter,
            "{}/{}/{}/{}",
            self.face.number(),
            self.level,
            self.x,
            self.y
        )
    }
}

impl std::str::FromStr for Tile {
    type Err = TileError;

    fn from_str(text: &str) -> Result<Self, TileError> {
        let unreadable = || TileError::Unreadable(text.to_owned());
        let numbers = text
            .split('/')
            .map(str::parse::<u32>)
            .collect::<Result<Vec<_>, _>>()
            .map_err(|_| unreadable())?;
        let [face, level, x, y] = numbers[..] else {
            return Err(unreadable());
        };
        let small = |n: u32| u8::try_from(n).map_err(|_| unreadable());
        Self::new(small(face)?, small(level)?, x, y)
    }
}
