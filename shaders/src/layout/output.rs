//! What the stages that finish outputs read: `wgsl/output/*.wgsl`.
//! Field for field as in the WGSL structs. Plain data: no behaviour, no device.

use bytemuck::{Pod, Zeroable};

/// What a channel's pixels have in common: `Finish` in shared/light.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct FinishUniform {
    /// Where the channel's first pixel lies in the target.
    pub place: [i32; 2],
    /// Exponent of the display; 0 for the sRGB curve.
    pub gamma: f32,
    /// 1 where the channel has maps of light.
    pub has_light: u32,
    /// How black is lifted: 1 for all that is darker or lighter, 0 for what lies below it only.
    pub dark: f32,
    /// 1 where what is lifted is scaled to stay within full light.
    pub bright: f32,
    /// Unused.
    pub padding: [u32; 2],
}

/// `Warp` in output/warp.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct WarpUniform {
    /// What the pixels have in common.
    pub finish: FinishUniform,
    /// The eye in room metres.
    pub eye: [f32; 4],
    /// Product with a direction from the eye: pixels to the right in the picture, times depth.
    pub across: [f32; 4],
    /// The same, down.
    pub down: [f32; 4],
    /// Product with a direction from the eye: depth.
    pub ahead: [f32; 4],
    /// Pixels of the picture that hold something.
    pub picture_size: [f32; 2],
    /// Pixels of its whole texture.
    pub texture_size: [f32; 2],
}

/// `Lit` in output/light.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LitUniform {
    /// What the pixels have in common.
    pub finish: FinishUniform,
    /// What leads from a pixel of the target to the picture's.
    pub to_picture: [i32; 2],
    /// Unused.
    pub padding: [i32; 2],
}

/// `Stereo` in output/stereo.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct StereoUniform {
    /// How the pictures share the output.
    pub mode: u32,
    /// 1 where each picture takes the other's place.
    pub swapped: u32,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// By colour: 1 for each component that is the left eye's. Then the exponent of the display; 0 for the sRGB curve.
    pub left: [f32; 4],
}
