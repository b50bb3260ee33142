//! How many vertices and triangles a leaf's marks make, and where each word's own begin.
//! In: marks. Out: two counts, and exclusive prefix sums over the words, as the device makes them to write every
//! mark's vertex and triangles in one pass. It makes no geometry.

use geodesy::LATTICE_BITS;

use super::marks::{DEEPEST_MARK, MARK_WORDS, Marks, between, children, pair};

/// Words of marks in a row of nodes.
const ROW_WORDS: usize = 9;

/// How much geometry a leaf's marks make.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeafCount {
    /// Vertices: marks that are set.
    pub vertices: u32,
    /// Triangles that are drawn.
    pub triangles: u32,
}

/// For each of the [`MARK_WORDS`] words of a leaf, what all words before it make. A mark's vertex is
/// the word's own number and the set bits below the mark's; its triangles follow those of the word's marks before it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PrefixSums {
    /// Vertices of all words before.
    pub vertices: Vec<u32>,
    /// Triangles of all words before.
    pub triangles: Vec<u32>,
}

impl PrefixSums {
    /// The number of the vertex of mark (x, y), if it is set: its rank among all set marks.
    #[must_use]
    pub fn vertex(&self, marks: &Marks, x: u16, y: u16) -> Option<u32> {
        let at = usize::from(y) * ROW_WORDS + usize::from(x >> 5);
        let word = marks.words().get(at)?;
        let bit = 1_u32 << (x & 31);
        let before = (word & (bit - 1)).count_ones();
        (word & bit != 0).then_some(self.vertices.get(at)? + before)
    }
}

/// The vertices and triangles of a leaf.
#[must_use]
pub fn count(marks: &Marks) -> LeafCount {
    let mut all = LeafCount::default();
    for word in 0..MARK_WORDS {
        let own = count_word(marks, word);
        all.vertices += own.vertices;
        all.triangles += own.triangles;
    }
    all
}

/// The exclusive prefix sums over a leaf's words.
#[must_use]
pub fn prefix_sums(marks: &Marks) -> PrefixSums {
    let mut sums = PrefixSums {
        vertices: Vec::with_capacity(MARK_WORDS),
        triangles: Vec::with_capacity(MARK_WORDS),
    };
    let mut before = LeafCount::default();
    for word in 0..MARK_WORDS {
        sums.vertices.push(before.vertices);
        sums.triangles.push(before.triangles);
        let own = count_word(marks, word);
        before.vertices += own.vertices;
        before.triangles += own.triangles;
    }
    sums
}

/// What the marks of one word make.
fn count_word(marks: &Marks, word: usize) -> LeafCount {
    let mut left = marks.words().get(word).copied().unwrap_or_default();
    let mut own = LeafCount {
        vertices: left.count_ones(),
        triangles: 0,
    };
    let (first_x, y) = ((word % ROW_WORDS * 32) as u16, (word / ROW_WORDS) as u16);
    while left != 0 {
        let x = first_x + left.trailing_zeros() as u16;
        own.triangles += triangles_of(marks, x, y);
        left &= left - 1;
    }
    own
}

/// Triangles that are drawn and have their right angle at the set mark (x, y): 0…4.
fn triangles_of(marks: &Marks, x: u16, y: u16) -> u32 {
    // Those of the deepest marks have no mark of their own, so nothing splits them.
    let deepest = pair(LATTICE_BITS, x, y).is_some_and(|own| own.level == DEEPEST_MARK);
    let drawn = |[from, to]: &[[u16; 2]; 2]| {
        let [x, y] = between(*from, *to);
        deepest || !marks.is_set(x, y)
    };
    children([x, y]).filter(drawn).count() as u32
}
