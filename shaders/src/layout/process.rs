//! Uniforms of the stages that work on one layer or on fused heights: `wgsl/process/*.wgsl`.
//! Field for field as in the WGSL structs; sizes are multiples of 16 bytes. Plain data.

use bytemuck::{Pod, Zeroable};

/// What the words of a slot are, for the resampling stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum SampleForm {
    /// Bits of an f32: heights in metres, or amplitudes; `INVALID_WORD` is a hole.
    Number = 0,
    /// Raw colours, 10:10:10:2.
    RawColour = 1,
}

/// Where a tile lies on its cube face, for tangent frames: `TileGeometry` in shared/tangent.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct TileGeometry {
    /// Cell coordinates s, t of node (0, 0), less ½: −½…½. Counted from the face's middle, because there,
    /// at the poles, directions turn fastest and f32 must be finest.
    pub from_centre: [f32; 2],
    /// Cell coordinates from node to node.
    pub step: f32,
    /// The planet's mean radius in metres.
    pub radius_m: f32,
    /// Cube face, 0…5.
    pub face: u32,
    /// Unused.
    pub padding: [u32; 3],
}

impl TileGeometry {
    /// The geometry of tile (`face`, `level`, `x`, `y`): face 0…5, level 0…22, x and y 0…2^level − 1.
    #[must_use]
    pub fn new(face: u8, level: u8, x: u32, y: u32, radius_m: f32) -> Self {
        // All numbers here are whole and at most 2^23, or powers of two: exact in f32.
        let tiles = 1_i32 << level.min(22);
        let from_centre = |index: u32| (2 * index as i32 - tiles) as f32 / (2 * tiles) as f32;
        Self {
            from_centre: [from_centre(x), from_centre(y)],
            step: 1.0 / (tiles as f32 * 256.0),
            radius_m,
            face: u32::from(face),
            padding: [0; 3],
        }
    }
}

/// `Resample` in process/resample.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct ResampleUniform {
    /// Node (0, 0) of the result in the ancestor's lattice, in steps of 2^-shift of its cells: the tile's
    /// place within its ancestor, (x − (ancestor.x << shift)) · 256 and the same of y.
    pub origin: [i32; 2],
    /// Levels from the result up to the ancestor, 0…22.
    pub shift: u32,
    /// A [`SampleForm`] as number.
    pub form: u32,
}

/// `Elevation` in process/elevation.wgsl: clamp((h + `datum_shift_m`) · scale + `offset_m`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ElevationUniform {
    /// Exaggeration.
    pub scale: f32,
    /// Added before scaling, metres.
    pub datum_shift_m: f32,
    /// Added after scaling, metres.
    pub offset_m: f32,
    /// Lowest result, metres.
    pub lowest_m: f32,
    /// Highest result, metres.
    pub highest_m: f32,
    /// Unused.
    pub padding: [u32; 3],
}

/// `Imagery` in process/imagery.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ImageryUniform {
    /// Factor on light: 2^stops. Codes are multiplied by its root.
    pub gain: f32,
    /// Factor on the distance of codes from ½.
    pub contrast: f32,
    /// Factor on the distance of codes from their luma.
    pub saturation: f32,
    /// Exponent of codes: 1 / gamma.
    pub inverse_gamma: f32,
    /// Factors of red, green, blue; one unused.
    pub tint: [f32; 4],
}

/// `Sar` in shared/amplitude.wgsl, of the three stages process/sar_*.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SarUniform {
    /// Amplitude shown as 0.
    pub lowest: f32,
    /// Amplitude shown as 1; above `lowest`.
    pub highest: f32,
    /// c of Lambers' eq. 2.4, ≥ 1; of the logarithmic stage only.
    pub strength: f32,
    /// γ of Lambers' eq. 2.5, above 0; of the gamma stage only.
    pub exponent: f32,
    /// Factors of red, green, blue; one unused.
    pub tint: [f32; 4],
}

/// `Ramp` in process/ramp.wgsl. Stop n is component n mod 4 of vector n / 4.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct RampUniform {
    /// Stops, 1…32.
    pub count: u32,
    /// Unused.
    pub padding: [u32; 3],
    /// Heights of the stops in metres, rising.
    pub heights: [[f32; 4]; 8],
    /// Colours of the stops: red in the lowest byte, then green, blue, alpha.
    pub colours: [[u32; 4]; 8],
}

/// `Isolines` in process/isolines.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct IsolinesUniform {
    /// Metres between lines, above 0.
    pub spacing_m: f32,
    /// Half the width of a line, in samples.
    pub half_width: f32,
    /// Half the width of a bold line, in samples.
    pub bold_half_width: f32,
    /// Each how-manieth line is bold; 0: none.
    pub bold_every: u32,
    /// Gamma encoded red, green, blue, 0…1; one unused.
    pub colour: [f32; 4],
}

/// `Slope` in process/slope.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SlopeUniform {
    /// Where the tile lies.
    pub tile: TileGeometry,
    /// Gamma encoded colour of `range_deg[0]` and below, 0…1; one unused.
    pub gentle: [f32; 4],
    /// Gamma encoded colour of `range_deg[1]` and above, 0…1; one unused.
    pub steep: [f32; 4],
    /// Angles from the horizontal, degrees, rising.
    pub range_deg: [f32; 2],
    /// Unused.
    pub padding: [u32; 2],
}

/// `Aspect` in process/aspect.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct AspectUniform {
    /// Where the tile lies.
    pub tile: TileGeometry,
    /// Saturation of all colours, 0…1.
    pub saturation: f32,
    /// Their largest component, 0…1.
    pub brightness: f32,
    /// Sine of the steepness up to which ground is flat and has no colour, 0…1.
    pub flat_sine: f32,
    /// Unused.
    pub padding: u32,
}

/// `Hillshade` in process/hillshade.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct HillshadeUniform {
    /// Where the tile lies.
    pub tile: TileGeometry,
    /// Unit vector to the light: (sin az · cos alt, cos az · cos alt, sin alt) along east, north, up.
    pub light: [f32; 3],
    /// Factor on slopes.
    pub exaggeration: f32,
}

/// `Relief` in process/relief.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ReliefUniform {
    /// Where the tile lies.
    pub tile: TileGeometry,
    /// The layer to write.
    pub layer: u32,
    /// Unused.
    pub padding: [u32; 3],
}
