//! The harness of tests that need more than one crate: the real command, its data, and the sources of the house.
//!
//! In: arguments of `terrawall`. Out: what the real program wrote and how it ended. It must not know how the
//! program does its work: tests here see what an operator sees.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

pub mod command;
pub mod data;
pub mod flights;
pub mod flip;
pub mod pictures;
pub mod rough;
pub mod sources;
pub mod viewer;
