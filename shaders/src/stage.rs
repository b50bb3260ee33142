//! The list of stages: names, sources, what each reads and writes.
//! In: a [`Stage`]. Out: its WGSL with imports resolved. It compiles nothing.

use crate::resolve::{self, ResolveError};

/// One shader module.
///
/// Every compute stage binds, in group 0: its uniform (0), its result (1), its inputs (2 and on). Its entry
/// point is `main`, its workgroups are 8×8. All but [`Stage::Relief`] and [`Stage::Surface`] write a slot of
/// [`SLOT_SIDE`](crate::SLOT_SIDE)² words; those two write one layer of an array of
/// [`LAYER_SIDE`](crate::LAYER_SIDE)² texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// Compute: an ancestor's samples on a finer tile's lattice.
    Resample,
    /// Compute: raw heights to heights.
    Elevation,
    /// Compute: raw colours to colours.
    Imagery,
    /// Compute: radar amplitude to grey, linear.
    SarLinear,
    /// Compute: radar amplitude to grey, logarithmic.
    SarLogarithmic,
    /// Compute: radar amplitude to grey, by a power.
    SarGamma,
    /// Compute: heights to colours.
    Ramp,
    /// Compute: heights to lines of equal height.
    Isolines,
    /// Compute: heights to colours of steepness.
    Slope,
    /// Compute: heights to colours of the direction of descent.
    Aspect,
    /// Compute: heights to light and shade.
    Hillshade,
    /// Compute: several heights to one.
    FuseElevation,
    /// Compute: several colours to one.
    FuseColour,
    /// Compute: one result outside a lens, another inside.
    Lens,
    /// Compute: fused heights to surface normals.
    Relief,
    /// Compute: fused colour over bare ground.
    Surface,
    /// Draw: the planet's surface.
    Terrain,
    /// Draw: the edges of its triangles.
    Wireframe,
    /// Draw: the rim of air and the sky.
    Atmosphere,
    /// Draw: a picture on a plane onto a curved screen.
    Warp,
    /// Draw: a channel's light, blended.
    Light,
    /// Draw: the pictures of both eyes into one.
    Stereo,
    /// Draw: a finished picture into a window.
    Copy,
}

impl Stage {
    /// Every stage; the compute stages in the order in which a tile meets them.
    pub const ALL: [Self; 23] = [
        Self::Resample,
        Self::Elevation,
        Self::Imagery,
        Self::SarLinear,
        Self::SarLogarithmic,
        Self::SarGamma,
        Self::Ramp,
        Self::Isolines,
        Self::Slope,
        Self::Aspect,
        Self::Hillshade,
        Self::FuseElevation,
        Self::FuseColour,
        Self::Lens,
        Self::Relief,
        Self::Surface,
        Self::Terrain,
        Self::Wireframe,
        Self::Atmosphere,
        Self::Warp,
        Self::Light,
        Self::Stereo,
        Self::Copy,
    ];

    /// Path of the file below `wgsl/`, without its ending.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Resample => "process/resample",
            Self::Elevation => "process/elevation",
            Self::Imagery => "process/imagery",
            Self::SarLinear => "process/sar_linear",
            Self::SarLogarithmic => "process/sar_logarithmic",
            Self::SarGamma => "process/sar_gamma",
            Self::Ramp => "process/ramp",
            Self::Isolines => "process/isolines",
            Self::Slope => "process/slope",
            Self::Aspect => "process/aspect",
            Self::Hillshade => "process/hillshade",
            Self::FuseElevation => "fuse/fuse_elevation",
            Self::FuseColour => "fuse/fuse_colour",
            Self::Lens => "fuse/lens",
            Self::Relief => "process/relief",
            Self::Surface => "fuse/surface",
            Self::Terrain => "draw/terrain",
            Self::Wireframe => "draw/wireframe",
            Self::Atmosphere => "draw/atmosphere",
            Self::Warp => "output/warp",
            Self::Light => "output/light",
            Self::Stereo => "output/stereo",
            Self::Copy => "output/copy",
        }
    }

    /// True for stages that must have a CPU twin.
    #[must_use]
    pub const fn is_compute(self) -> bool {
        self.inputs() > 0
    }

    /// Input slots that a compute stage binds, all of them in any case; 0 for the stages that draw.
    #[must_use]
    pub const fn inputs(self) -> usize {
        match self {
            Self::Terrain
            | Self::Wireframe
            | Self::Atmosphere
            | Self::Warp
            | Self::Light
            | Self::Stereo
            | Self::Copy => 0,
            Self::Lens => 2,
            Self::FuseElevation | Self::FuseColour => 8,
            _ => 1,
        }
    }

    /// The stage's source with its imports resolved.
    pub fn source(self) -> Result<String, ResolveError> {
        resolve::resolve(self.name(), self.text())
    }

    const fn text(self) -> &'static str {
        match self {
            Self::Resample => include_str!("../wgsl/process/resample.wgsl"),
            Self::Elevation => include_str!("../wgsl/process/elevation.wgsl"),
            Self::Imagery => include_str!("../wgsl/process/imagery.wgsl"),
            Self::SarLinear => include_str!("../wgsl/process/sar_linear.wgsl"),
            Self::SarLogarithmic => include_str!("../wgsl/process/sar_logarithmic.wgsl"),
            Self::SarGamma => include_str!("../wgsl/process/sar_gamma.wgsl"),
            Self::Ramp => include_str!("../wgsl/process/ramp.wgsl"),
            Self::Isolines => include_str!("../wgsl/process/isolines.wgsl"),
            Self::Slope => include_str!("../wgsl/process/slope.wgsl"),
            Self::Aspect => include_str!("../wgsl/process/aspect.wgsl"),
            Self::Hillshade => include_str!("../wgsl/process/hillshade.wgsl"),
            Self::FuseElevation => include_str!("../wgsl/fuse/fuse_elevation.wgsl"),
            Self::FuseColour => include_str!("../wgsl/fuse/fuse_colour.wgsl"),
            Self::Lens => include_str!("../wgsl/fuse/lens.wgsl"),
            Self::Relief => include_str!("../wgsl/process/relief.wgsl"),
            Self::Surface => include_str!("../wgsl/fuse/surface.wgsl"),
            Self::Terrain => include_str!("../wgsl/draw/terrain.wgsl"),
            Self::Wireframe => include_str!("../wgsl/draw/wireframe.wgsl"),
            Self::Atmosphere => include_str!("../wgsl/draw/atmosphere.wgsl"),
            Self::Warp => include_str!("../wgsl/output/warp.wgsl"),
            Self::Light => include_str!("../wgsl/output/light.wgsl"),
            Self::Stereo => include_str!("../wgsl/output/stereo.wgsl"),
            Self::Copy => include_str!("../wgsl/output/copy.wgsl"),
        }
    }
}
