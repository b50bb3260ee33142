//! The list of stages that refine meshes: names, sources, twins, what they write.
//! In: a [`RefineStage`]. Out: its WGSL with imports resolved. It compiles nothing.

use crate::resolve::{self, ResolveError};

/// One compute stage of refinement. Unlike those of [`Stage`](crate::Stage) they work on buffers of many leaves at once;
/// what each binds, all in group 0, is in its source. Their entry points are `main`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RefineStage {
    /// Fused heights to heights of a leaf's nodes in units.
    LeafHeights,
    /// Errors of the two deepest levels.
    PyramidFine,
    /// Errors of one of the other levels.
    Pyramid,
    /// Marks that are always set.
    SeedMarks,
    /// Moves the window over the worklist.
    Advance,
    /// What follows from the marks in the window.
    TopDown,
    /// All marks of one absolute level.
    BottomUp,
    /// Vertices and triangles of words.
    CountWords,
    /// Vertices and triangles of leaves.
    CountLeaves,
    /// The list of vertices to be written.
    Compact,
    /// Vertices and triangles.
    Emit,
}

impl RefineStage {
    /// Every stage in the order of work.
    pub const ALL: [Self; 11] = [
        Self::LeafHeights,
        Self::PyramidFine,
        Self::Pyramid,
        Self::SeedMarks,
        Self::Advance,
        Self::TopDown,
        Self::BottomUp,
        Self::CountWords,
        Self::CountLeaves,
        Self::Compact,
        Self::Emit,
    ];

    /// Path of the file below `wgsl/`, without its ending.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::LeafHeights => "refine/leaf_heights",
            Self::PyramidFine => "refine/pyramid_fine",
            Self::Pyramid => "refine/pyramid",
            Self::SeedMarks => "refine/seed_marks",
            Self::Advance => "refine/advance",
            Self::TopDown => "refine/top_down",
            Self::BottomUp => "refine/bottom_up",
            Self::CountWords => "refine/count_words",
            Self::CountLeaves => "refine/count_leaves",
            Self::Compact => "refine/compact",
            Self::Emit => "refine/emit",
        }
    }

    /// The twin on the CPU, from the root of the repository. Where the device needs several passes for what is one
    /// function there, all of them have that as their twin, and are compared with it together.
    #[must_use]
    pub const fn twin(self) -> &'static str {
        match self {
            Self::LeafHeights => "shaders/src/cpu/leaf_heights.rs",
            Self::PyramidFine | Self::Pyramid => "node/terrain/src/refine/pyramid.rs",
            Self::SeedMarks | Self::Advance | Self::TopDown => {
                "node/terrain/src/refine/top_down.rs"
            }
            Self::BottomUp => "node/terrain/src/refine/bottom_up.rs",
            Self::CountWords | Self::CountLeaves => "node/terrain/src/refine/count.rs",
            Self::Compact | Self::Emit => "node/terrain/src/refine/emit.rs",
        }
    }

    /// The stage's source with its imports resolved.
    pub fn source(self) -> Result<String, ResolveError> {
        resolve::resolve(self.name(), self.text())
    }

    const fn text(self) -> &'static str {
        match self {
            Self::LeafHeights => include_str!("../wgsl/refine/leaf_heights.wgsl"),
            Self::PyramidFine => include_str!("../wgsl/refine/pyramid_fine.wgsl"),
            Self::Pyramid => include_str!("../wgsl/refine/pyramid.wgsl"),
            Self::SeedMarks => include_str!("../wgsl/refine/seed_marks.wgsl"),
            Self::Advance => include_str!("../wgsl/refine/advance.wgsl"),
            Self::TopDown => include_str!("../wgsl/refine/top_down.wgsl"),
            Self::BottomUp => include_str!("../wgsl/refine/bottom_up.wgsl"),
            Self::CountWords => include_str!("../wgsl/refine/count_words.wgsl"),
            Self::CountLeaves => include_str!("../wgsl/refine/count_leaves.wgsl"),
            Self::Compact => include_str!("../wgsl/refine/compact.wgsl"),
            Self::Emit => include_str!("../wgsl/refine/emit.wgsl"),
        }
    }
}
