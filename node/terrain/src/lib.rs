//! Decides what is drawn: quadtree selection, culling, seams, meshes.
//!
//! The way of a frame through this crate:
//! 1. [`select()`]: eye and wall pixels in, the leaves of six restricted quadtrees over the whole planet out.
//! 2. [`cull()`]: those leaves that some frustum may see and the planet does not hide.
//! 3. [`seams()`]: for each such leaf and elevation layer, whose data sets the heights along its border.
//! 4. [`build`]: the vertices of one leaf, in exact fixed point, to be drawn with the indices of a [`Patch`]. A
//!    function that the caller gives fuses the layers.
//!
//! Steps 1 and 3 depend on the eye, the index of the data and the wall's pixels only, never on one node's
//! frustum, so that two nodes that see the same ground draw the same triangles. No trigonometry and no
//! platform mathematics is used, only + − × ÷ √, which every processor rounds alike.
//!
//! No I/O, no GPU, no clock: data comes in through [`Lattice`] and [`HeightRanges`].

mod cull;
mod mesh;
mod patch;
mod refine;
mod seams;
mod select;
mod solid_angle;
mod source;
mod tile_set;
mod walk;

pub use cull::{Frustum, cull};
pub use mesh::{ElevationLayer, Heights, Lattice, MAX_ELEVATION_LAYERS, MeshError, Vertex, build};
pub use patch::{LATTICE_STEPS, MAX_REFINEMENT, Patch, PatchError};
pub use refine::*;
pub use seams::{DataLevels, NO_DATA, Seams, seams};
pub use select::{EdgeNeighbour, HeightRanges, LodLimits, LodView, Relief, Selection, select};
pub use walk::{Walk, Walker};
