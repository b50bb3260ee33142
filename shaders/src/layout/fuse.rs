//! Uniforms of the stages that put layers together: `wgsl/fuse/*.wgsl`.
//! Field for field as in the WGSL structs; sizes are multiples of 16 bytes. Plain data.

use bytemuck::{Pod, Zeroable};

/// How a group is laid over what is below it; the numbers of [`FuseInput::blend`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Blend {
    /// Covers.
    Normal = 0,
    /// Product.
    Multiply = 1,
    /// Complement of the product of complements; for heights it is read as `Normal`.
    Screen = 2,
    /// Sum.
    Add = 3,
}

/// One input of a fusion stage.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct FuseInput {
    /// Share within the group, ≥ 0; 0 takes the input away.
    pub weight: f32,
    /// 0…1; 0 takes the input away.
    pub opacity: f32,
    /// A [`Blend`] as number, the same throughout a group.
    pub blend: u32,
    /// Equal for inputs of equal priority and blend, which lie side by side.
    pub group: u32,
}

/// `Fuse` in shared/fusion.wgsl, of fuse/fuse_elevation.wgsl and fuse/fuse_colour.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct FuseUniform {
    /// Inputs in use, 0…8. Textures bound beyond them are not read.
    pub count: u32,
    /// Unused.
    pub padding: [u32; 3],
    /// From the lowest to the highest.
    pub inputs: [FuseInput; 8],
}

/// `Lens` in fuse/lens.wgsl: the polynomial whose values above 0 are outside. With x = (i − 128) / 137 and
/// y = (j − 128) / 137, the coefficient of x^n · y^m is number m · (degree + 1) + n.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LensUniform {
    /// 0…8, in x and in y.
    pub degree: u32,
    /// Unused.
    pub padding: [u32; 3],
    /// Coefficient n is component n mod 4 of vector n / 4.
    pub coefficients: [[f32; 4]; 21],
}

/// `Surface` in fuse/surface.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SurfaceUniform {
    /// Gamma encoded colour of ground that no layer covers, 0…1; one unused.
    pub ground: [f32; 4],
    /// The layer to write.
    pub layer: u32,
    /// Unused.
    pub padding: [u32; 3],
}
