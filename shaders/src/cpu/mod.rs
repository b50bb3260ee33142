//! CPU twins of the compute stages: the same arithmetic on the same layouts, to test a device against and
//! to read the mathematics in. One file a stage, named as the stage.

pub mod relief;
