//! Samples that all tests share, and what a wall file may say.
//! In: nothing. Out: texts with names and formats; the keys of the wall file's schema.
#![allow(dead_code, reason = "each test uses its part")]

use convert::Format;

/// Every sample: name, text, format.
pub(crate) const SAMPLES: [(&str, &str, Format); 10] = [
    ("desk.qvr", include_str!("../samples/desk.qvr"), Format::Qvr),
    ("cave.qvr", include_str!("../samples/cave.qvr"), Format::Qvr),
    (
        "cluster.qvr",
        include_str!("../samples/cluster.qvr"),
        Format::Qvr,
    ),
    (
        "desk.json",
        include_str!("../samples/desk.json"),
        Format::Sgct,
    ),
    (
        "cave.json",
        include_str!("../samples/cave.json"),
        Format::Sgct,
    ),
    (
        "cluster.json",
        include_str!("../samples/cluster.json"),
        Format::Sgct,
    ),
    (
        "desk.eqc",
        include_str!("../samples/desk.eqc"),
        Format::Equalizer,
    ),
    (
        "cave.eqc",
        include_str!("../samples/cave.eqc"),
        Format::Equalizer,
    ),
    (
        "cluster.eqc",
        include_str!("../samples/cluster.eqc"),
        Format::Equalizer,
    ),
    (
        "compounds.eqc",
        include_str!("../samples/compounds.eqc"),
        Format::Equalizer,
    ),
];

/// Which keys a table of the wall file may have, by its path.
pub(crate) const SCHEMA: [(&str, &[&str]); 14] = [
    ("", &["wall", "observers", "trackers", "screens", "hosts"]),
    ("wall", &["name", "fps"]),
    (
        "observers",
        &["name", "head_m", "looks_deg", "eye_separation_m", "tracker"],
    ),
    (
        "trackers",
        &[
            "name",
            "kind",
            "source",
            "body",
            "to_room",
            "unit_m",
            "to_head",
            "smoothing",
            "latency_ms",
        ],
    ),
    ("trackers.to_room", &["origin_m", "x", "y", "z"]),
    ("trackers.to_head", &["offset_m", "looks_deg"]),
    (
        "screens",
        &[
            "name",
            "observer",
            "size_px",
            "kind",
            "corners_m",
            "centre_m",
            "radius_m",
            "tilt_deg",
            "fisheye_deg",
        ],
    ),
    (
        "screens.corners_m",
        &["bottom_left", "bottom_right", "top_left"],
    ),
    ("hosts", &["name", "outputs"]),
    (
        "hosts.outputs",
        &[
            "name",
            "size_px",
            "window",
            "headless",
            "gpu",
            "stereo",
            "swap_eyes",
            "gamma",
            "channels",
        ],
    ),
    (
        "hosts.outputs.window",
        &["position_px", "fullscreen", "monitor"],
    ),
    (
        "hosts.outputs.channels",
        &[
            "screen",
            "eye",
            "canvas_px",
            "output_px",
            "blend_px",
            "blend_gamma",
            "black_level",
            "calibration",
        ],
    ),
    ("hosts.outputs.channels.calibration", &["file", "region"]),
    (
        "hosts.outputs.channels.blend_px",
        &["left", "right", "top", "bottom"],
    ),
];
