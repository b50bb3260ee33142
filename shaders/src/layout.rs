//! Memory layouts that the CPU writes and shaders read. Field for field as in the WGSL structs.
//! Plain data: no behaviour, no device.

use bytemuck::{Pod, Zeroable};

mod fuse;
mod output;
mod process;
mod refine;

pub use fuse::{Blend, FuseInput, FuseUniform, LensUniform, SurfaceUniform};
pub use output::{FinishUniform, LitUniform, StereoUniform, WarpUniform};
pub use process::{
    AspectUniform, ElevationUniform, HillshadeUniform, ImageryUniform, IsolinesUniform,
    RampUniform, ReliefUniform, ResampleUniform, SampleForm, SarUniform, SlopeUniform,
    TileGeometry,
};
pub use refine::{Emission, EmitLeaf, LeafHeightsUniform, RefineLeaf, RefineLevelUniform};

/// Texels along a side of a slot: a tile's nodes −9…265. Node (i, j) is texel (i + 9, j + 9).
pub const SLOT_SIDE: u32 = 275;
/// Texels along a side of a relief or surface layer: nodes −1…257. Node (i, j) is texel (i + 1, j + 1).
pub const LAYER_SIDE: u32 = 259;
/// A height or amplitude that is not there. It is compared as a word, never as a float.
pub const INVALID_WORD: u32 = 0xFFFF_FFFF;

/// The word of a raw colour: 10 bits each of red (lowest), green and blue, 0…1023, marked as valid. Larger
/// numbers are cut to 1023. A hole is the word 0.
#[must_use]
pub const fn raw_colour(red: u32, green: u32, blue: u32) -> u32 {
    const fn ten_bits(value: u32) -> u32 {
        if value > 1023 { 1023 } else { value }
    }
    ten_bits(red) | ten_bits(green) << 10 | ten_bits(blue) << 20 | 3 << 30
}

/// What a whole block of pixels has in common: `Frame` in draw/terrain.wgsl and draw/atmosphere.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct FrameUniform {
    /// Viewer-relative metres in ECEF axes to clip space, column by column.
    pub clip_from_relative: [[f32; 4]; 4],
    /// Words of the viewer's fixed-point x and y.
    pub viewer_xy: [u32; 4],
    /// Words of the viewer's fixed-point z; two unused.
    pub viewer_z: [u32; 4],
    /// Unit vector to the sun in ECEF axes; ambient share of light, 0…1.
    pub sun: [f32; 4],
    /// Haze colour, gamma encoded 0…1; thickness of the haze layer in metres, 0 for none.
    pub haze: [f32; 4],
    /// Slope factor for shading; longest path through the haze in metres; two unused.
    pub shading: [f32; 4],
    /// Viewer in ellipsoid units; the air's scale height in the same units, 0 for none.
    pub sky_viewer: [f32; 4],
    /// Ray through the corner of the block's first pixel, ellipsoid units.
    pub sky_ray: [f32; 4],
    /// Change of the ray per pixel to the right.
    pub sky_ray_x: [f32; 4],
    /// Change of the ray per pixel down.
    pub sky_ray_y: [f32; 4],
}

/// What one tile's patch needs: `TileRecord` in draw/terrain.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct TileRecord {
    /// Lattice units to imagery texture coordinates: offset x, y; scale; layer.
    pub imagery: [f32; 4],
    /// The same for the relief texture.
    pub relief: [f32; 4],
    /// Cube face, 0…5; three unused.
    pub face: [u32; 4],
}
