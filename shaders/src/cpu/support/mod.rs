//! What several twins share, one file for each file of `wgsl/shared` that compute stages import.

pub(super) mod amplitude;
pub(super) mod colour;
pub(super) mod slot;
pub(super) mod tangent;
