//! The picture: from views and tiles to pixels, with wgpu.
//!
//! In: a scene, views, a tile cache. Out: one picture per output, in memory or in windows, and a word on
//! whether it shows the best data there is. It knows no network, and reads no file but through the cache.

mod arrivals;
mod canvas;
mod elevation;
mod error;
mod fetch;
mod finish;
mod gather;
mod geometry;
mod gpu;
mod ground;
mod heights;
mod layer;
mod layers;
mod leaf_geometry;
mod loaded;
mod meshes;
mod outputs;
mod pipelines;
mod pool;
mod process;
mod ranges;
mod readback;
mod recorder;
mod refine;
mod refining;
mod renderer;
mod room;
mod scene;
mod scratch;
mod show;
mod sight;
mod source;
mod spans;
mod target;
mod textures;
mod timing;
mod uniform;
mod window;

#[cfg(test)]
mod away_tests;
#[cfg(test)]
mod device_tests;
#[cfg(test)]
mod error_tests;
#[cfg(test)]
mod finish_tests;
#[cfg(test)]
mod picture_tests;
#[cfg(test)]
mod process_tests;
#[cfg(test)]
mod stage_tests;
#[cfg(test)]
mod test_planet;

pub use canvas::{BLOCK_PX, PixelRect, PlanarScreen};
pub use error::RenderError;
pub use fetch::{Fetched, FetchedTile, Unfetched, fetch};
pub use gpu::{Gpu, GpuError};
pub use layer::{
    Aspect, Blend, Elevation, Fusion, Hillshade, Imagery, Isolines, LayerData, LayerParameters,
    LensData, Process, Ramp, RampStop, Sar, SarMapping, Slope,
};
pub use outputs::{
    ChannelPlan, ChannelSource, LightMap, OutputPlan, StereoMode, StereoPlan, Uplift, WarpMap,
    WarpPart,
};
pub use renderer::{
    AheadStatistics, ErrorMeasure, EyeView, FrameStatistics, Needs, PassTime, RenderBudget,
    Renderer, ViewPoint,
};
pub use scene::{Air, Light, Refine, SceneData, sun_over};
pub use target::Picture;
pub use tiles::{
    CacheConfig, Directories, DiskRate, Level, OpenDataset, Opener, TileCache, Wish, count_on_disk,
    measure_disk, upkeep,
};
pub use timing::{SampleWords, StageTiming, time_stages};
pub use window::WindowSurface;
