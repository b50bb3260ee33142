//! Memory layouts that the CPU writes and shaders read. Field for field as in the WGSL structs.
//! Plain data: no behaviour, no device.

use bytemuck::{Pod, Zeroable};

/// A height that is not there, in the buffer that the relief stage reads.
pub const INVALID_HEIGHT: i32 = i32::MIN;

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

/// One tile for the relief stage: `Relief` in process/relief.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ReliefRecord {
    /// Cell coordinates s, t of node (0, 0), 0…1.
    pub origin: [f32; 2],
    /// Cell coordinates from node to node.
    pub step: f32,
    /// Metres in a quantum of height.
    pub quantum_m: f32,
    /// The planet's mean radius in metres.
    pub radius_m: f32,
    /// Cube face, 0…5.
    pub face: u32,
    /// The layer to write.
    pub layer: u32,
    /// Where the tile's heights begin in the buffer, in words.
    pub first: u32,
}
