//! Calibration files of projectors, read into one neutral form: which point of the picture, or of the room,
//! an output pixel shows, how much light it gives, and how dark it can get.
//! In: bytes in memory. Out: a [`Calibration`], or an error that names the part and the remedy. What a file
//! says is never trusted: sizes are bounded before anything is kept, and nothing is unpacked to disk.

mod bourke;
mod detect;
mod domeprojection;
mod error;
mod grid;
mod map;
mod mesh;
mod model;
pub mod mpcdi;
mod obj;
mod options;
mod pfm;
mod read;
mod text;
mod vwf;

pub use detect::detect;
pub use error::ReadError;
pub use grid::{Grid, Placement, Sample};
pub use map::{Map, Texels};
pub use mesh::{Mesh, RasteriseError, Vertex};
pub use model::{
    Axes, Calibration, CanvasPlace, Frustum, Gamma, Mapping, PointOrigin, Projector, Region, Uplift,
};
pub use obj::read_mesh as read_obj_mesh;
pub use options::{Choice, Format, Limits, ObjMeaning, Options, PfmMeaning, RowOrder};
pub use read::{load, read};

/// Largest width or height of an output, a grid or a picture.
pub const MAX_SIZE_PX: u32 = 16_384;
