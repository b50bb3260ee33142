//! The master's own logic: sessions with nodes, the frame loop, the control API, captures, and the node processes of
//! this machine.
//!
//! In: a wall, a scene, a cluster identity, changes of the scene. Out: views and swaps to the nodes, a report, pictures.
//! It must not draw or read data: the `terrawall` command alone brings the node and the importer in.

mod capture;
mod change;
mod control;
mod director;
mod events;
mod frame_loop;
mod heads;
mod installation;
pub mod launch;
mod lens;
mod master;
mod notice;
mod server;
mod session;
mod wall_file;

pub use capture::CapturedOutput;
pub use control::{ControlError, ControlOptions, DEFAULT_CONTROL_ADDRESS};
pub use master::{Master, MasterError, MasterOptions, MasterOutcome, OpenSurfaces, StartError};
pub use notice::Notice;
pub use wall_file::WallFile;
