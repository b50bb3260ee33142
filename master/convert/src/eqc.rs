//! Equalizer configurations: nodes, pipes, windows and channels; observers, layouts, canvases and compounds
//! (Eyescale/Equalizer, eq/server/loader.y).
//! In: nested braces. Out: a draft. Compounds that only share the work of drawing are not needed, and are listed.

mod canvases;
mod compounds;
mod frustum;
mod machines;
mod observers;
mod parse;

pub(crate) use parse::parse;

use crate::draft::Builder;
use crate::error::Trouble;
use crate::ledger::Reason;
use crate::source::{At, Tree};

/// Reads a parsed configuration.
pub(crate) fn read(tree: &Tree, builder: &mut Builder) -> Result<(), Trouble> {
    let root = tree.root();
    builder.assume_fps(root);
    let server = root.get("server").map_or(root, At::carry);
    // Of several configurations, Equalizer uses the first that suits an application.
    let Some(config) = server.all("config").next() else {
        return Ok(());
    };
    config.carry();
    let global = root.get("global");
    let mut machines = machines::read(config, global, builder)?;
    let mut observers = observers::read(config, global, builder)?;
    let modes = compounds::stereo_modes(config, global)?;
    canvases::read(config, &modes, &mut observers, &mut machines, builder)?;
    compounds::read(config, &modes, &mut observers, &mut machines, builder)?;
    machines.finish(builder)
}

/// A global default, for example `EQ_CONFIG_FATTR_EYE_BASE`.
fn global_of<'t>(global: Option<At<'t>>, key: &'static str) -> Option<At<'t>> {
    global.and_then(|global| global.get(key))
}

/// The text of a `name`, carried over.
fn name_of(at: At<'_>) -> Result<Option<&str>, Trouble> {
    at.get("name").map(At::text).transpose()
}

/// Shares x, y, width, height of a `viewport`; everything where it states none.
fn shares_of(at: At<'_>) -> Result<[f64; 4], Trouble> {
    let Some(viewport) = at.get("viewport") else {
        return Ok([0.0, 0.0, 1.0, 1.0]);
    };
    let shares = viewport.numbers::<4>()?;
    let [x, y, width, height] = shares;
    // Shares are often written with four digits.
    let is_inside =
        |start: f64, length: f64| start >= 0.0 && length > 0.0 && start + length <= 1.001;
    if is_inside(x, width) && is_inside(y, height) {
        return Ok(shares);
    }
    Err(viewport.expected("[ x y width height ] within 0…1 that is not empty"))
}

/// Finds what a reference means: a name in quotes, or a number.
fn refer<'t>(
    reference: At<'_>,
    mut things: impl Iterator<Item = At<'t>>,
) -> Result<Option<At<'t>>, Trouble> {
    let [word] = reference.words() else {
        return Err(reference.expected("a name in quotes or a number"));
    };
    if word.quoted {
        let named = |at: &At<'_>| {
            at.get("name")
                .is_some_and(|name| matches!(name.words(), [w] if w.text == word.text))
        };
        return Ok(things.find(named));
    }
    let index = reference.integer(0, 1 << 20)?;
    Ok(things.nth(usize::try_from(index).unwrap_or(usize::MAX)))
}

/// Why a key that nobody reads is not carried over.
pub(crate) fn reason(at: At<'_>) -> Reason {
    let key = at.key();
    let is_reference = at.parent().is_some_and(|parent| parent.key() == "channel");
    match key {
        "canvas" | "segment" | "layout" | "view" if is_reference => (
            "it says for which segment a compound shares the work of drawing",
            "nothing: every node draws what it shows",
        ),
        "compound" | "task" | "buffer" | "range" | "period" | "phase" | "zoom" | "pixel"
        | "subpixel" | "outputframe" | "inputframe" | "outputtiles" | "inputtiles"
        | "loadBalancer" => (
            "it shares the work of drawing among channels; here every node draws what it shows",
            "nothing",
        ),
        _ if key.ends_with("_equalizer") => (
            "it shares the work of drawing among channels; here every node draws what it shows",
            "nothing",
        ),
        "swapbarrier" | "hint_swapsync" | "NV_group" | "NV_barrier" | "latency" => (
            "every wall waits for the vertical retrace and for its slowest node",
            "nothing",
        ),
        "connection"
        | "hostname"
        | "interface"
        | "host"
        | "port"
        | "launch_command"
        | "launch_command_quote"
        | "launch_timeout"
        | "robustness"
        | "bandwidth"
        | "type" => (
            "nodes are started by themselves and find the master by its address",
            "start a node on that machine with the master's address",
        ),
        "focus_distance" | "focus_mode" => (
            "eyes converge on the screens, where they are in the room",
            "nothing",
        ),
        "opencv_camera" => (
            "heads are tracked by VRPN or DTrack",
            "write [[trackers]] if there is such a tracker",
        ),
        "layout" | "view" => (
            "a wall shows one layout",
            "make a wall file of its own for the other one",
        ),
        "config" => (
            "a wall file is one configuration",
            "put the other one into a file of its own",
        ),
        "window" | "channel" | "pipe" => (
            "nothing of it is on a screen: it draws for other channels",
            "nothing: every node draws what it shows",
        ),
        "eye_base" | "EQ_CONFIG_FATTR_EYE_BASE" => (
            "all observers say themselves how far their eyes are apart",
            "nothing",
        ),
        "attributes" | "global" => (
            "attributes of processes, threads and drivers are no part of a wall file",
            "nothing, but start a node where a command was launched",
        ),
        _ if key.starts_with("hint_") || key.starts_with("planes_") || key.starts_with("EQ_") => (
            "how pictures are computed is the renderer's own affair",
            "nothing",
        ),
        "thread_model" | "drawable" | "dump_image" | "DisplayCluster" => (
            "how pictures are computed is the renderer's own affair",
            "nothing",
        ),
        "name" => ("nothing of the wall bears this name", "nothing"),
        "wall" | "projection" => (
            "another wall or projection holds in its place",
            "check the corners of the screen",
        ),
        _ => (
            "this key is not known here",
            "check its spelling, and see whether a wall file can say it otherwise",
        ),
    }
}
