//! Edge marks: which node of a leaf's lattice halves which pair of triangles (Lambers 2011, §3.3.3).
//! In: nodes of a lattice of 2^k × 2^k cells. Out: their pairs, and the bits that say which nodes are vertices.
//! Geometry of whole numbers only: no heights, no neighbours.

use geodesy::{LATTICE_BITS, NODES};

/// Words of a leaf's marks: 257 rows of 9. Mark (x, y) is bit x mod 32 of word 9 y + ⌊x / 32⌋.
pub const MARK_WORDS: usize = NODES as usize * ROW_WORDS;

/// Nodes of a leaf's lattice; node (x, y) is number 257 y + x.
pub const LATTICE_NODES: usize = (NODES * NODES) as usize;

/// The level of the marks of the smallest hypotenuses.
pub const DEEPEST_MARK: u8 = 2 * (LATTICE_BITS - 1);

/// Words of a row of marks.
const ROW_WORDS: usize = 9;

/// The last coordinate of a leaf's lattice, and its middle.
pub(crate) const LAST: u16 = 1 << LATTICE_BITS;
pub(crate) const MIDDLE: u16 = LAST / 2;

/// The pair of triangles that share the hypotenuse of which a mark is the midpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// The level of refinement: 0 on the leaf's edges, even for hypotenuses along an axis, odd for diagonals.
    pub level: u8,
    /// The larger extent of the hypotenuse along an axis in cells: d = 2^(k − ⌈level / 2⌉).
    pub size: u16,
    /// The ends of the hypotenuse: the one with the smaller x first, or with the smaller y if x is the same.
    pub ends: [[u16; 2]; 2],
    /// The corners opposite, at the right angles. Side 0 is the one whose node has the smaller number: below the
    /// hypotenuse, or left of an upright one. `None` where it lies outside, in the neighbouring leaf.
    pub apexes: [Option<[u16; 2]>; 2],
}

/// The pair of mark (x, y) in a lattice of 2^k × 2^k cells, k being 1…15. `None` for the four corners and the centre,
/// which halve nothing, and outside.
///
/// Let b be the position of the lowest bit that is set in x or y, counted from 1. Then d = 2^b. Where both have it,
/// the hypotenuse is a diagonal, of level 2 (k − b) − 1; else it lies along an axis, and its level is 2 (k − b). (The
/// source prints k − 2 (b − 1) for the odd levels, which is the same for its example k = 3 only.)
#[must_use]
pub const fn pair(k: u8, x: u16, y: u16) -> Option<Pair> {
    if k == 0 || k > 15 || x > 1 << k || y > 1 << k || x | y == 0 {
        return None;
    }
    let bit = (x | y).trailing_zeros() as u8;
    // The corners share bit k, the centre bit k − 1 in both.
    if bit >= k || (bit == k - 1 && x == y) {
        return None;
    }
    let half = 1 << bit;
    let size = 2 * half;
    let last = 1 << k;
    let depth = k - 1 - bit;
    if x & y & half != 0 {
        let (left, right, down, up) = (x - half, x + half, y - half, y + half);
        let rising = (x / size) % 2 == (y / size) % 2;
        let (ends, apexes) = if rising {
            ([[left, down], [right, up]], [[right, down], [left, up]])
        } else {
            ([[left, up], [right, down]], [[left, down], [right, up]])
        };
        return Some(Pair {
            level: 2 * depth - 1,
            size,
            ends,
            apexes: [Some(apexes[0]), Some(apexes[1])],
        });
    }
    let horizontal = y.is_multiple_of(size);
    let along = if horizontal { x } else { y };
    let across = if horizontal { y } else { x };
    let before = if across == 0 {
        None
    } else {
        Some(across - half)
    };
    let after = if across == last {
        None
    } else {
        Some(across + half)
    };
    Some(Pair {
        level: 2 * depth,
        size,
        ends: [
            place(horizontal, along - half, across),
            place(horizontal, along + half, across),
        ],
        apexes: [
            match before {
                Some(across) => Some(place(horizontal, along, across)),
                None => None,
            },
            match after {
                Some(across) => Some(place(horizontal, along, across)),
                None => None,
            },
        ],
    })
}

const fn place(horizontal: bool, along: u16, across: u16) -> [u16; 2] {
    if horizontal {
        [along, across]
    } else {
        [across, along]
    }
}

/// The side on which the triangle with this apex lies of its hypotenuse with midpoint `mark`.
pub(crate) const fn side_of(apex: [u16; 2], mark: [u16; 2]) -> usize {
    (apex[1] > mark[1] || (apex[1] == mark[1] && apex[0] > mark[0])) as usize
}

/// The node halfway between two whose coordinates differ by even numbers.
pub(crate) const fn between(from: [u16; 2], to: [u16; 2]) -> [u16; 2] {
    [u16::midpoint(from[0], to[0]), u16::midpoint(from[1], to[1])]
}

/// The number of a node of a leaf's lattice.
pub(crate) const fn node(mark: [u16; 2]) -> usize {
    mark[1] as usize * NODES as usize + mark[0] as usize
}

/// The triangles with their right angle at `mark` inside a leaf, as the ends of their hypotenuses: those that appear
/// when the mark is set. Side 0 first end, side 0 second end, side 1 likewise; for the centre the leaf's left, right, lower
/// and upper edge. The midpoints of the hypotenuses are marks, unless `mark` is of the deepest level.
pub(crate) fn children(mark: [u16; 2]) -> impl Iterator<Item = [[u16; 2]; 2]> {
    const EDGES: [[[u16; 2]; 2]; 4] = [
        [[0, 0], [0, LAST]],
        [[LAST, 0], [LAST, LAST]],
        [[0, 0], [LAST, 0]],
        [[0, LAST], [LAST, LAST]],
    ];
    let legs = if mark == [MIDDLE; 2] {
        EDGES.map(Some)
    } else if let Some(own) = pair(LATTICE_BITS, mark[0], mark[1]) {
        let [first, second] = own.ends;
        let [below, above] = own.apexes;
        [
            (below, first),
            (below, second),
            (above, first),
            (above, second),
        ]
        .map(|(apex, end)| apex.map(|apex| [apex, end]))
    } else {
        [None; 4]
    };
    legs.into_iter().flatten()
}

/// All marks of a level in a leaf, row by row.
pub(crate) fn marks_of_level(level: u8) -> impl Iterator<Item = [u16; 2]> {
    let half = LAST >> (level.div_ceil(2) + 1);
    let diagonal = !level.is_multiple_of(2);
    let rows = (0..=LAST / half.max(1)).filter(move |row| !diagonal || row % 2 == 1);
    rows.flat_map(move |row| {
        let first = (row + 1 + u16::from(diagonal)) % 2 * half;
        (first..=LAST)
            .step_by(2 * usize::from(half.max(1)))
            .map(move |x| [x, row * half])
    })
}

/// The marks of one leaf: a set bit is a vertex of its mesh. The corners and the centre always are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Marks(Vec<u32>);

impl Default for Marks {
    fn default() -> Self {
        Self::new()
    }
}

impl Marks {
    /// The coarsest mesh: the corners and the centre.
    #[must_use]
    pub fn new() -> Self {
        let mut marks = Self(vec![0; MARK_WORDS]);
        for [x, y] in [[0, 0], [LAST, 0], [0, LAST], [LAST, LAST], [MIDDLE, MIDDLE]] {
            marks.set(x, y);
        }
        marks
    }

    /// Marks that were made elsewhere. `None` unless there are [`MARK_WORDS`] words, without bits that are no mark's.
    #[must_use]
    pub fn from_words(words: Vec<u32>) -> Option<Self> {
        let beyond = |row: &[u32]| row.last().is_none_or(|last| *last > 1);
        let sane = words.len() == MARK_WORDS && !words.chunks(ROW_WORDS).any(beyond);
        sane.then_some(Self(words))
    }

    /// The words; mark (x, y) is bit x mod 32 of word 9 y + ⌊x / 32⌋.
    #[must_use]
    pub fn words(&self) -> &[u32] {
        &self.0
    }

    /// Whether the mesh has a vertex at (x, y); false outside 0…256.
    #[must_use]
    pub fn is_set(&self, x: u16, y: u16) -> bool {
        x <= LAST
            && self
                .0
                .get(word(x, y))
                .is_some_and(|word| word >> (x % 32) & 1 == 1)
    }

    /// Sets a mark. True if it was not set before; outside 0…256 nothing is set.
    pub fn set(&mut self, x: u16, y: u16) -> bool {
        if x > LAST {
            return false;
        }
        let Some(word) = self.0.get_mut(word(x, y)) else {
            return false;
        };
        let before = *word;
        *word |= 1 << (x % 32);
        *word != before
    }

    /// How many marks are set: the mesh's vertices.
    #[must_use]
    pub fn count(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// The marks that are set, in the order of their bits: by y, then x.
    pub fn positions(&self) -> impl Iterator<Item = [u16; 2]> {
        self.0.iter().enumerate().flat_map(|(number, word)| {
            let x = (number % ROW_WORDS * 32) as u16;
            let y = (number / ROW_WORDS) as u16;
            let mut rest = *word;
            std::iter::from_fn(move || {
                let bit = rest.trailing_zeros() as u16;
                rest &= rest.wrapping_sub(1);
                (bit < 32).then_some([x + bit, y])
            })
        })
    }
}

fn word(x: u16, y: u16) -> usize {
    usize::from(y) * ROW_WORDS + usize::from(x / 32)
}
