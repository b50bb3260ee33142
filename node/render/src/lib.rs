//! The picture: from views and tiles to pixels, with wgpu.
//!
//! In: a scene, views, a tile cache. Out: one picture per output, in memory or in windows, and a word on
//! whether it shows the best data there is. It knows no network, and reads no file but through the cache.

mod canvas;
mod error;
mod gather;
mod gpu;
mod layers;
mod meshes;
mod pipelines;
mod pool;
mod renderer;
mod scene;
mod target;
mod textures;
mod uniform;
mod window;

#[cfg(test)]
mod device_tests;
#[cfg(test)]
mod picture_tests;

pub use canvas::{BLOCK_PX, ChannelPlan, OutputPlan, PixelRect, PlanarScreen};
pub use error::RenderError;
pub use gpu::{Gpu, GpuError};
pub use pool::LayerPool;
pub use renderer::{FrameStatistics, RenderBudget, Renderer, ViewPoint};
pub use scene::{Air, Light, SceneData, sun_over};
pub use target::Picture;
pub use tiles::{CacheConfig, TileCache};
pub use window::WindowSurface;
