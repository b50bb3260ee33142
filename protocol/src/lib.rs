//! What master and nodes must agree on.
//!
//! | module | duty |
//! |---|---|
//! | [`wall`] | a display installation: TOML → validated [`Wall`], and the geometry of its screens |
//! | [`scene`] | what is shown: TOML → validated [`Scene`] |
//! | [`camera`] | places and poses, keyframed paths, steering by mouse and keys |
//! | [`message`] | everything that master and nodes say to each other |
//! | [`codec`] | the bytes of those messages; the only file that knows the encoding |
//! | [`capture`] | pictures cut into messages and put together again |
//! | [`barrier`], [`follower`] | the swap barrier: the master's side and a node's side |
//! | [`membership`] | who may join, who is in, who has left |
//! | [`change`] | which revision of the scene is shown, prepared and queued |
//! | [`clock`], [`pacing`] | one clock for all nodes, and the moments at which they present |
//! | [`pattern`] | the test patterns that outputs can show |
//! | [`report`] | what was measured |
//!
//! Nothing here opens a socket, reads a clock or touches a GPU: state machines take time and messages
//! as arguments, so thousands of schedules can be tested in virtual time.

pub mod barrier;
pub mod camera;
pub mod capture;
pub mod change;
pub mod clock;
pub mod codec;
mod config;
pub mod follower;
pub mod membership;
pub mod message;
pub mod pacing;
pub mod pattern;
pub mod report;
pub mod scene;
#[cfg(test)]
mod sim;
pub mod wall;

pub use camera::{Camera, Keyframe, Orbit, Path, Place, Pose};
pub use config::{ConfigError, Fault};
pub use message::{PROTOCOL_VERSION, ToMaster, ToNode, View};
pub use scene::{Scene, SceneError};
pub use wall::{Wall, WallError};
