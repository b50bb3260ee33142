//! SGCT configurations: nodes, windows and viewports, users and trackers (sgct/sgct, sgct.schema.json).
//! In: JSON. Out: a draft. Meshes are named, not read.

mod parse;
mod projection;
mod users;
mod windows;

pub(crate) use parse::parse;

use crate::draft::{Builder, Host};
use crate::error::Trouble;
use crate::ledger::Reason;
use crate::source::{At, Tree};

/// Reads a parsed configuration.
pub(crate) fn read(tree: &Tree, builder: &mut Builder) -> Result<(), Trouble> {
    let root = tree.root();
    if let Some(version) = root.get("version")
        && version.integer(0, 1000)? != 1
    {
        builder.ledger.note(
            version,
            version.source(),
            "version 1 of the format is known, so it is read as that",
            "check the result",
        );
    }
    if let Some(name) = root.get("meta").and_then(|meta| meta.get("name")) {
        name.text()?.clone_into(&mut builder.draft.name);
        builder.tidy_name(name);
    }
    let display = root
        .get("settings")
        .and_then(|settings| settings.get("display"));
    match display.and_then(|display| display.get("refreshrate")) {
        Some(rate) => {
            let rate_hz = rate.number()?;
            if (1.0..=240.0).contains(&rate_hz) {
                builder.draft.fps = rate_hz;
            } else {
                builder.ledger.note(
                    rate,
                    rate.source(),
                    "a wall shows 1…240 frames a second, so 60 are assumed",
                    "write fps as the projectors have it",
                );
            }
        }
        None => builder.assume_fps(root),
    }
    let users = users::read(root, builder)?;
    for node in root.get("nodes").into_iter().flat_map(At::children) {
        let name = match node.get("address") {
            Some(address) => address.text()?,
            None => {
                builder.ledger.note(
                    node,
                    "address is not stated",
                    "the host is named \"node\"",
                    "name it as the node names itself",
                );
                "node"
            }
        };
        let mut host = Host {
            name: name.to_owned(),
            outputs: Vec::new(),
        };
        let list = node.get("windows").into_iter().flat_map(At::children);
        for (index, window) in list.enumerate() {
            windows::read(window, index, &users, &mut host, builder)?;
        }
        builder.add_host(node, host)?;
    }
    Ok(())
}

/// Numbers of an object, by their keys.
fn members<const N: usize>(at: At<'_>, keys: [&'static str; N]) -> Result<[f64; N], Trouble> {
    let mut numbers = [0.0; N];
    for (number, key) in numbers.iter_mut().zip(keys) {
        *number = at
            .get(key)
            .ok_or_else(|| at.expected(&format!("an object with {}", keys.join(", "))))?
            .number()?;
    }
    Ok(numbers)
}

fn vector(at: At<'_>) -> Result<[f64; 3], Trouble> {
    members(at, ["x", "y", "z"])
}

/// Why a key that nobody reads is not carried over.
pub(crate) fn reason(at: At<'_>) -> Reason {
    match at.key() {
        "masteraddress" | "port" | "datatransferport" => (
            "nodes find the master by the address that they are started with",
            "start a node on each machine with the master's address",
        ),
        "$schema" | "generator" | "meta" | "author" | "description" | "license" => (
            "it tells about the file, not about the wall",
            "keep it as a comment if it matters",
        ),
        "scene" | "capture" => (
            "it is about what is shown, not about the wall",
            "set it in the scene file, or when capturing",
        ),
        "firmsync" | "swaplock" | "swapinterval" => (
            "every wall waits for the vertical retrace and for its slowest node",
            "nothing",
        ),
        "settings" | "debuglog" | "threadaffinity" | "depthbuffertexture" | "normaltexture"
        | "positiontexture" | "precision" | "bufferbitdepth" | "msaa" | "fxaa" | "alpha"
        | "noerror" | "quality" | "interpolation" | "alwaysrender" => (
            "how pictures are computed is the renderer's own affair",
            "nothing",
        ),
        "autoiconify" | "hidemousecursor" | "floating" | "border" | "resizable"
        | "takescreenshot" | "draw2d" | "draw3d" | "tags" | "id" => {
            ("windows of a wall have no such setting", "nothing")
        }
        "spout" | "ndi" | "blitwindowid" => (
            "outputs are shown or captured; they are not handed to other programs or windows",
            "capture the output through the master",
        ),
        "res" => (
            "an output renders its own pixels",
            "write another size_px if it should render more or fewer",
        ),
        "mirrorx" | "mirrory" => (
            "outputs are not mirrored",
            "mirror the picture in the projector's own menu",
        ),
        "overlay" => ("outputs have no pictures laid over them", "nothing"),
        "blendmask" | "blacklevelmask" => (
            "blending comes from blend_px, or from a calibration file with masks",
            "write blend_px and black_level on the channel, or a calibration file that has alpha and beta",
        ),
        "scalablemesh" => (
            "this kind of calibration is not read",
            "export the calibration as MPCDI, and write calibration = { file = … }",
        ),
        "tracked" => (
            "screens stand in the room and do not follow heads",
            "nothing, unless the screen was worn on the head",
        ),
        "matrix" | "transformation" => (
            "the order of its numbers is not settled between versions of SGCT",
            "write to_room or to_head of the tracker, or head_m and looks_deg of the observer",
        ),
        "buttons" | "axes" | "devices" | "trackers" | "sensors" => (
            "wall files know trackers of heads: one sensor for each observer",
            "steer by the window's keys, or through the master's interface",
        ),
        "offset" | "background" => (
            "domes have no offset and nothing beyond their edge",
            "correct centre_m if the dome stands elsewhere",
        ),
        "monitor" | "pos" => (
            "SGCT regards the monitor for full screens alone, and the position for windows",
            "nothing",
        ),
        _ => (
            "this key is not known here",
            "check its spelling, and see whether a wall file can say it otherwise",
        ),
    }
}
