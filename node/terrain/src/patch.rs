//! Base patches: the triangles of one tile at a refinement level, shared by all tiles.
//! In: a refinement level. Out: vertex positions on the lattice and 16 index lists, one for each
//! combination of edges beyond which a finer leaf lies (Lambers 2011, §1.4.3). No heights here.

use geodesy::{CELLS, Direction, LATTICE_BITS};
use thiserror::Error;

/// The finest refinement: every triangle's corners are lattice nodes, half steps included.
pub const MAX_REFINEMENT: u8 = LATTICE_BITS - 1;

/// Lattice units along a tile's side: patch positions are 0…256.
pub const LATTICE_STEPS: u16 = CELLS as u16;

/// Squares a strip is wide: two of its rows of vertices fit a post-transform cache of 32.
const STRIP: u16 = 8;

/// The triangles of a tile at one refinement level l.
///
/// The tile is divided into 2^l × 2^l squares, each cut by both diagonals into four right isosceles triangles
/// whose hypotenuses are the square's edges. Where a finer leaf lies beyond a tile edge, the triangles on
/// that edge are split at the centre of their hypotenuse, which is where the finer leaf has its vertices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Patch {
    /// The refinement level l, 0…[`MAX_REFINEMENT`].
    pub refinement: u8,
    /// Lattice positions (i along u, j along v), each 0…[`LATTICE_STEPS`], sorted by j, then i. All
    /// variants share them; the midpoints on the four tile edges are always there.
    pub positions: Vec<[u16; 2]>,
    /// Triangles for each variant as triples of indices into `positions`, counter-clockwise seen from
    /// outside the planet. Bit n of a variant is set where a finer leaf lies beyond edge n of
    /// [`Direction::EDGES`].
    pub indices: [Vec<u16>; 16],
}

/// Why a patch was refused.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum PatchError {
    /// The refinement level is beyond the lattice.
    #[error(
        "refinement level {0}: it must be 0 to {MAX_REFINEMENT}, where every lattice node is used"
    )]
    TooFine(u8),
}

impl Patch {
    /// The patch of a refinement level. Errors beyond [`MAX_REFINEMENT`].
    pub fn new(refinement: u8) -> Result<Self, PatchError> {
        if refinement > MAX_REFINEMENT {
            return Err(PatchError::TooFine(refinement));
        }
        let layout = Layout {
            squares: 1 << refinement,
        };
        Ok(Self {
            refinement,
            positions: layout.positions(),
            indices: std::array::from_fn(|variant| layout.triangles(variant)),
        })
    }

    /// Triangles in a variant (its lowest four bits).
    #[must_use]
    pub fn triangles(&self, variant: u8) -> usize {
        self.indices[usize::from(variant & 15)].len() / 3
    }
}

/// Counts vertices in half steps: 2n + 1 rows of them for n squares a side. Even rows hold the squares'
/// corners (and, in the first and last row, the midpoints between); odd rows hold the squares' centres and the
/// midpoints on the left and right edge.
struct Layout {
    squares: u16,
}

impl Layout {
    /// True where the patch has a vertex at half steps (column, row).
    fn holds(&self, column: u16, row: u16) -> bool {
        let last = 2 * self.squares;
        let on_edge = |c| c == 0 || c == last;
        column % 2 == row % 2 || on_edge(row) || (row % 2 == 1 && on_edge(column))
    }

    fn positions(&self) -> Vec<[u16; 2]> {
        let last = 2 * self.squares;
        let step = LATTICE_STEPS / last;
        let steps = (0..=last).flat_map(|row| (0..=last).map(move |column| (column, row)));
        steps
            .filter(|(column, row)| self.holds(*column, *row))
            .map(|(column, row)| [column * step, row * step])
            .collect()
    }

    /// The index of the vertex at half steps (column, row); it must be one of the patch.
    fn index(&self, column: u16, row: u16) -> u16 {
        let n = self.squares;
        let before = if row == 0 {
            0
        } else {
            // The first row, then alternating odd rows (n + 2) and inner even rows (n + 1).
            (2 * n + 1) + (row / 2) * (n + 2) + ((row - 1) / 2) * (n + 1)
        };
        let within = if row == 0 || row == 2 * n {
            column
        } else if row.is_multiple_of(2) {
            column / 2
        } else if column == 0 {
            0
        } else {
            // Columns 0, 1, 3, 5, …, 2n−1, 2n.
            column / 2 + 1
        };
        before + within
    }

    fn triangles(&self, variant: usize) -> Vec<u16> {
        let n = self.squares;
        let split = |edge: Direction| {
            Direction::EDGES
                .iter()
                .position(|e| *e == edge)
                .is_some_and(|bit| variant >> bit & 1 == 1)
        };
        let (left, right) = (split(Direction::Left), split(Direction::Right));
        let (down, up) = (split(Direction::Down), split(Direction::Up));
        let mut indices = Vec::with_capacity(12 * usize::from(n) * usize::from(n + 1));
        for strip in (0..n).step_by(usize::from(STRIP)) {
            for row in 0..n {
                for column in strip..(strip + STRIP).min(n) {
                    let (x, y) = (2 * column, 2 * row);
                    let centre = self.index(x + 1, y + 1);
                    let mut side = |from: (u16, u16), to: (u16, u16), divided: bool| {
                        let (a, b) = (self.index(from.0, from.1), self.index(to.0, to.1));
                        if divided {
                            let middle = self
                                .index(u16::midpoint(from.0, to.0), u16::midpoint(from.1, to.1));
                            indices.extend([a, middle, centre, middle, b, centre]);
                        } else {
                            indices.extend([a, b, centre]);
                        }
                    };
                    side((x, y), (x + 2, y), down && row == 0);
                    side((x + 2, y), (x + 2, y + 2), right && column == n - 1);
                    side((x + 2, y + 2), (x, y + 2), up && row == n - 1);
                    side((x, y + 2), (x, y), left && column == 0);
                }
            }
        }
        indices
    }
}
