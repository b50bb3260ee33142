//! Peers that stand for trackers, for tests and demonstrations: a VRPN server and DTrack's packets. In: poses,
//! buttons, analog values. Out: the bytes that real ones send, over real sockets. No wall at work needs them.

mod dtrack_packet;
mod vrpn_server;

pub use dtrack_packet::{SimBody, SimFlystick, dtrack_packet};
pub use vrpn_server::VrpnServer;
