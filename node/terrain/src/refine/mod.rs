//! Refinement: which vertices of a leaf's lattice a mesh needs so that no sample is further off than a view
//! allows, as edge mark arrays (Lambers 2011, §3.3.3). In: leaves, error pyramids, allowances. Out: marks and
//! triangles. This is the reference that the compute passes equal mark for mark; integers decide, never a float.

mod allowance;
mod anchors;
mod border;
mod bottom_up;
mod code;
mod count;
mod emit;
mod eye_cell;
mod geometry_error;
mod links;
mod marks;
mod minimum;
mod normals;
mod oracle;
mod pyramid;
mod top_down;
mod triangles;
mod uniform;

pub use allowance::{BlockRanges, RefineView, allowances, height_unit};
pub use anchors::{ANCHOR_WORDS, anchors};
pub use border::{
    BORDER_NODES, BORDER_WORDS, border_index, border_positions, border_words, quantise,
};
pub use bottom_up::bottom_up;
pub use code::{code_down, code_up, decode};
pub use count::{LeafCount, PrefixSums, count, prefix_sums};
pub use emit::emit;
pub use eye_cell::{EyeCell, distance_m, eye_cell, least_distance_m};
pub use geometry_error::TileGeometryError;
pub use links::{Domain, Link, LinkKind, NOT_AT_HAND, RefinedLeaf, ring};
pub use marks::{DEEPEST_MARK, LATTICE_NODES, MARK_WORDS, Marks, Pair, pair};
pub use minimum::minimum;
pub use oracle::{Measured, measure};
pub use pyramid::pyramid;
pub use top_down::top_down;
pub use triangles::triangles;
pub use uniform::uniform;

/// Words of a leaf's allowance table: 256 blocks of 16×16 cells, then the 17×17 coarse marks.
pub const ALLOWANCE_WORDS: usize = 545;

/// Blocks of 16×16 cells in a leaf.
pub const BLOCKS: usize = 256;
