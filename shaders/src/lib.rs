//! The shaders: WGSL, one stage a file, resolved and listed here, and a CPU twin for every compute stage.
//!
//! In: a [`Stage`]. Out: its complete WGSL source, and the memory layouts that it shares with the CPU.
//! It opens no device and knows no tile: `render` does.

mod layout;
mod resolve;

pub mod cpu;

pub use layout::{FrameUniform, INVALID_HEIGHT, ReliefRecord, TileRecord};
pub use resolve::ResolveError;

/// One shader module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Compute: elevation to surface normals.
    Relief,
    /// Draw: the planet's surface.
    Terrain,
    /// Draw: the rim of air and the sky.
    Atmosphere,
    /// Draw: a finished picture into a window.
    Copy,
}

impl Stage {
    /// Every stage.
    pub const ALL: [Self; 4] = [Self::Relief, Self::Terrain, Self::Atmosphere, Self::Copy];

    /// Path of the file below `wgsl/`, without its ending.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Relief => "process/relief",
            Self::Terrain => "draw/terrain",
            Self::Atmosphere => "draw/atmosphere",
            Self::Copy => "output/copy",
        }
    }

    /// True for stages that must have a CPU twin.
    #[must_use]
    pub const fn is_compute(self) -> bool {
        matches!(self, Self::Relief)
    }

    /// The stage's source with its imports resolved.
    pub fn source(self) -> Result<String, ResolveError> {
        let text = match self {
            Self::Relief => include_str!("../wgsl/process/relief.wgsl"),
            Self::Terrain => include_str!("../wgsl/draw/terrain.wgsl"),
            Self::Atmosphere => include_str!("../wgsl/draw/atmosphere.wgsl"),
            Self::Copy => include_str!("../wgsl/output/copy.wgsl"),
        };
        resolve::resolve(self.name(), text)
    }
}

/// Resolves the imports of a WGSL text that is not one of the stages, for tests that call shared
/// functions on a device.
pub fn resolve_text(name: &str, text: &str) -> Result<String, ResolveError> {
    resolve::resolve(name, text)
}
