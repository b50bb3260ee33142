//! CPU twins of the compute stages: the same arithmetic on the same layouts, to test a device against and
//! to read the mathematics in. One file a stage, named as the stage; `support` holds what stages share, as
//! `wgsl/shared` does. A `run` takes the stage's input slots of 275² words each, of which it reads a shorter
//! or missing one as holes, and returns the words that the device would write.

mod support;

pub mod aspect;
pub mod elevation;
pub mod fuse_colour;
pub mod fuse_elevation;
pub mod hillshade;
pub mod imagery;
pub mod isolines;
pub mod leaf_heights;
pub mod lens;
pub mod ramp;
pub mod relief;
pub mod resample;
pub mod sar_gamma;
pub mod sar_linear;
pub mod sar_logarithmic;
pub mod slope;
pub mod surface;
