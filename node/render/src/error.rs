//! What can go wrong between a view and a picture.

use thiserror::Error;

use crate::gpu::GpuError;

/// Why a picture could not be made.
#[derive(Debug, Error)]
pub enum RenderError {
    /// The device was lost or could not be opened.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// A shader could not be put together: a defect of the program, not of its input.
    #[error("shader source: {0}")]
    Shader(#[from] shaders::ResolveError),
    /// A stage that is not in the list of stages: a defect of the program.
    #[error("stage {0} is not listed")]
    Stage(&'static str),
    /// A layer's data cannot be opened.
    #[error("layer \"{layer}\": {reason}")]
    Layer {
        /// The layer's name in the scene.
        layer: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A lens that is no circle on the planet.
    #[error("lens \"{lens}\": {reason}")]
    Lens {
        /// The lens's name in the scene.
        lens: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The device draws no lines.
    #[error(
        "graphics adapter \"{adapter}\" cannot draw triangles as lines: set mesh.wireframe to false"
    )]
    NoWireframe {
        /// The adapter's name.
        adapter: String,
    },
    /// More layers than are fused.
    #[error(
        "{count} {what} layers are visible at once; at most {most} can be fused: set the weight of some to 0"
    )]
    TooManyLayers {
        /// "elevation" or "other".
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        most: usize,
    },
    /// A view of a scene that was not given before.
    #[error("a view of scene revision {revision} came before its scene")]
    UnknownScene {
        /// The revision.
        revision: u64,
    },
    /// An output is larger than the device can draw.
    #[error(
        "output \"{output}\" is {width}×{height} pixels; this graphics adapter draws at most {most} a side: split it into several outputs"
    )]
    OutputTooLarge {
        /// The output's name.
        output: String,
        /// Its width in pixels.
        width: u32,
        /// Its height in pixels.
        height: u32,
        /// The adapter's limit.
        most: u32,
    },
    /// A window could not be shown on its surface.
    #[error("window of output \"{output}\": {reason}")]
    Window {
        /// The output's name.
        output: String,
        /// What the window system said.
        reason: String,
    },
    /// An option of the scene that the mesh does not allow.
    #[error("mesh: {0}")]
    Mesh(String),
    /// A channel's map is not of its size: a defect of the program.
    #[error(
        "output \"{output}\": a map of {what} does not have as many values as the channel has pixels"
    )]
    Map {
        /// The output's name.
        output: String,
        /// What it maps to.
        what: String,
    },
    /// Outputs cannot change their size while they are shown.
    #[error(
        "output \"{output}\" has another size or shows other eyes than before: restart the wall for that"
    )]
    OtherOutputs {
        /// The output's name.
        output: String,
    },
    /// A finished picture could not be read back.
    #[error("output \"{output}\" could not be read back: {reason}")]
    Readback {
        /// The output's name.
        output: String,
        /// What the driver said.
        reason: String,
    },
}
