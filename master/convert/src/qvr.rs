//! QVR configurations: devices, observers, processes and their windows (marlam/qvr, libqvr/config.hpp).
//! In: lines of keys and words. Out: a draft. Both the present keys and those of the first versions are read.

mod observers;
mod parse;
mod windows;

pub(crate) use parse::parse;

use crate::draft::{Builder, Host};
use crate::error::Trouble;
use crate::ledger::Reason;
use crate::source::{At, Tree};

/// Reads a parsed configuration.
pub(crate) fn read(tree: &Tree, builder: &mut Builder) -> Result<(), Trouble> {
    let root = tree.root();
    builder.assume_fps(root);
    let mut names = Vec::new();
    for at in root.all("observer") {
        let index = observers::read(root, at, builder)?;
        names.push((block_name(at), index));
    }
    for at in root.all("process") {
        let mut host = Host {
            name: block_name(at.carry()).to_owned(),
            outputs: Vec::new(),
        };
        for window in at.all("window") {
            windows::read(window, &names, &mut host, builder)?;
        }
        builder.add_host(at, host)?;
    }
    Ok(())
}

/// The word after `device`, `observer`, `process` or `window`.
fn block_name(at: At<'_>) -> &str {
    at.words().first().map_or("", |word| word.text.as_str())
}

/// Why a key that nobody reads is not carried over.
pub(crate) fn reason(at: At<'_>) -> Reason {
    match at.key() {
        "device" => (
            "wall files know trackers of heads, not wands and buttons",
            "steer by the window's keys, or through the master's interface",
        ),
        "buttons" | "analogs" => (
            "wall files know trackers of heads, not buttons and joysticks",
            "steer by the window's keys, or through the master's interface",
        ),
        "navigation" | "navigation_position" | "navigation_forward" | "navigation_up" => (
            "how the viewer travels is part of the scene, not of the wall",
            "set the start in the scene file",
        ),
        "address" | "ipc" | "launcher" => (
            "nodes are started by themselves and find the master by its address",
            "start a node on that machine with the master's address",
        ),
        "display" => (
            "a node uses the display that it is started on",
            "set DISPLAY where the node is started; processes on one machine may become outputs of one host with gpu",
        ),
        "sync_to_vblank" => (
            "every wall waits for the vertical retrace and for its slowest node",
            "nothing",
        ),
        "decoupled_rendering" | "decoupled" => (
            "all outputs of a wall show the same frame",
            "use a wall of its own for pictures that may lag",
        ),
        "render_resolution_factor" => (
            "an output renders its own pixels",
            "write a smaller size_px if it takes too long",
        ),
        "type" | "position" | "forward" | "up" | "stereo_mode" => (
            "it is a key of QVR's first versions, and the present one stands beside it",
            "nothing",
        ),
        "process" => (
            "trackers are read by the master",
            "make sure that the master reaches the tracker",
        ),
        _ => (
            "this key is not known",
            "check its spelling, and see whether a wall file can say it otherwise",
        ),
    }
}
