//! The master's own logic: sessions with nodes, the frame loop, captures, and the node processes of this machine.
//!
//! In: a wall, a scene, a cluster identity. Out: views and swaps to the nodes, a report, pictures.
//! It must not draw or read data: the `terrawall` command alone brings the node and the importer in.

mod capture;
mod director;
mod events;
mod frame_loop;
pub mod launch;
mod master;
mod server;
mod session;

pub use capture::CapturedOutput;
pub use master::{Master, MasterError, MasterOptions, MasterOutcome, Notice, StartError};
