//! What the stages that refine meshes read: `wgsl/refine/*.wgsl`.
//! Field for field as in the WGSL structs. Plain data: no behaviour, no device.

use bytemuck::{Pod, Zeroable};

/// One leaf among those at hand: `Leaf` in shared/marks.wgsl. The fields' bits are those of `terrain::Domain::record`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct RefineLeaf {
    /// What lies beyond the edges left, right, down, up. First word: place of the leaf there (bits 0–15), kind of link
    /// (16–17: none, same, coarser, finer), its edge (18–19), whether it runs the other way (20), which half of it (21).
    /// Second word: place of the second of two finer leaves.
    pub links: [[u32; 2]; 4],
    /// Bit n: finer leaves beyond edge n; bit 4 + n: a coarser one.
    pub flags: u32,
    /// Its slot in the geometry buffers.
    pub geometry: u32,
    /// Level in the quadtree.
    pub level: u32,
    /// Unused.
    pub padding: u32,
}

impl RefineLeaf {
    /// The record that these words are.
    #[must_use]
    pub const fn from_words(words: [u32; 12]) -> Self {
        let [a, b, c, d, e, f, g, h, flags, geometry, level, padding] = words;
        Self {
            links: [[a, b], [c, d], [e, f], [g, h]],
            flags,
            geometry,
            level,
            padding,
        }
    }
}

/// One mesh to be written, as the caller asks for it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct EmitLeaf {
    /// The leaf's place among those that were marked last.
    pub place: u32,
    /// Its slot in the geometry buffers.
    pub geometry: u32,
    /// Where its vertices begin in the vertex buffer.
    pub first_vertex: u32,
    /// Where its indices begin in the index buffer.
    pub first_index: u32,
    /// Metres in a unit of height, a power of two.
    pub unit_m: f32,
    /// Which indirect arguments draw it.
    pub argument: u32,
    /// The first instance that the arguments name: the number of its tile record.
    pub record: u32,
    /// Unused.
    pub padding: u32,
}

/// One mesh to be written: `Emission` in shared/emission.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Emission {
    /// As in [`EmitLeaf`].
    pub place: u32,
    /// As in [`EmitLeaf`].
    pub geometry: u32,
    /// As in [`EmitLeaf`].
    pub first_vertex: u32,
    /// As in [`EmitLeaf`].
    pub first_index: u32,
    /// As in [`EmitLeaf`].
    pub unit_m: f32,
    /// As in [`EmitLeaf`].
    pub argument: u32,
    /// As in [`EmitLeaf`].
    pub record: u32,
    /// Where its vertices begin in the list of all that are written.
    pub first_entry: u32,
    /// Vertices of the mesh.
    pub vertices: u32,
    /// Triangles of the mesh.
    pub triangles: u32,
    /// Entries of the whole list: the same in all meshes.
    pub entries: u32,
    /// The vertex and the index at which what is bound of the two buffers begins: the same in all meshes.
    pub window_vertex: u32,
    /// See [`Emission::window_vertex`].
    pub window_index: u32,
}

/// `LeafHeights` in refine/leaf_heights.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LeafHeightsUniform {
    /// Node (0, 0) of the leaf in the input's lattice, in steps of 2^-shift of its cells.
    pub origin: [i32; 2],
    /// Levels from the leaf up to the tile of the input, 0…22.
    pub shift: u32,
    /// Units of height in a metre, a power of two.
    pub units_per_m: f32,
    /// Slot in the geometry buffers.
    pub slot: u32,
    /// Unused.
    pub padding: [u32; 3],
}

/// `Level` in refine/pyramid.wgsl and `Step` in refine/bottom_up.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct RefineLevelUniform {
    /// A level of marks: 0…12 for the pyramid, 0…14 for bottom up.
    pub level: u32,
    /// The place of the first leaf of the step; the pyramid has none.
    pub first_place: u32,
    /// Unused.
    pub padding: [u32; 2],
}
