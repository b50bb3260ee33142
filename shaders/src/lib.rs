//! The shaders: WGSL, one stage a file, resolved and listed here, and a CPU twin for every compute stage.
//!
//! In: a [`Stage`]. Out: its complete WGSL source, and the memory layouts that it shares with the CPU.
//! It opens no device and knows no tile: `render` does.

mod layout;
mod refine_stage;
mod resolve;
mod stage;

pub mod cpu;

pub use layout::{
    AspectUniform, Blend, ElevationUniform, Emission, EmitLeaf, FinishUniform, FrameUniform,
    FuseInput, FuseUniform, HillshadeUniform, INVALID_WORD, ImageryUniform, IsolinesUniform,
    LAYER_SIDE, LeafHeightsUniform, LensUniform, LitUniform, RampUniform, RefineLeaf,
    RefineLevelUniform, ReliefUniform, ResampleUniform, SLOT_SIDE, SampleForm, SarUniform,
    SlopeUniform, StereoUniform, SurfaceUniform, TileGeometry, TileRecord, WarpUniform, raw_colour,
};
pub use refine_stage::RefineStage;
pub use resolve::ResolveError;
pub use stage::Stage;

/// Resolves the imports of a WGSL text that is not one of the stages, for tests that call shared
/// functions on a device.
pub fn resolve_text(name: &str, text: &str) -> Result<String, ResolveError> {
    resolve::resolve(name, text)
}
