//! Windows of QVR.
//! In: `window` blocks. Out: outputs, each with one channel of one screen. A window is one rectangle of the room; those
//! that show the same one, for one eye each, share a screen.

use glam::DVec3;

use super::block_name;
use crate::draft::{Builder, Host, MAX_POSITION_PX, MAX_SIZE_PX, Output, Window};
use crate::error::Trouble;
use crate::place::Picture;
use crate::room::{Corners, turn_of};
use crate::source::At;
use crate::stereo::{Eye, QUAD_BUFFER, Stereo};

/// QVR's window where no line says its size.
const SIZE_PX: [i64; 2] = [800, 600];
/// A full screen of which nothing is known.
const FULL_SIZE_PX: [i64; 2] = [1920, 1080];
/// Metres from pixel to pixel of a monitor of 96 pixels an inch.
const PITCH_M: f64 = 0.0254 / 96.0;

/// Reads a window and adds its output to the host.
pub(super) fn read(
    at: At<'_>,
    observers: &[(&str, usize)],
    host: &mut Host,
    builder: &mut Builder,
) -> Result<(), Trouble> {
    let name = block_name(at.carry());
    let mut output = Output {
        name: name.to_owned(),
        ..Output::default()
    };
    let Some(eye) = read_output_mode(at, &mut output, builder)? else {
        return builder.add_output(at, host, output);
    };
    let observer = read_observer(at, observers, builder)?;
    let Some(observer) = observer else {
        return builder.add_output(at, host, output);
    };
    let fullscreen = at.get("fullscreen").map_or(Ok(false), At::flag)?;
    let size = at
        .get("size")
        .map(|size| size.integers::<2>(1, MAX_SIZE_PX))
        .transpose()?;
    let wall = read_wall(at, builder)?;
    output.size_px = match (size, fullscreen) {
        (Some(size), _) => size,
        (None, false) => {
            assume_size(at, SIZE_PX, "QVR's default is taken", builder);
            SIZE_PX
        }
        (None, true) => {
            let (size, why) = match wall.and_then(|corners| full_size(corners.size_m())) {
                Some(size) => (
                    size,
                    "it fills a monitor of unknown size; 1080 pixels on the shorter side and square ones are assumed",
                ),
                None => (FULL_SIZE_PX, "it fills a monitor of unknown size"),
            };
            assume_size(at, size, why, builder);
            size
        }
    };
    let corners = match wall {
        Some(corners) => corners,
        None => read_centre(at, output.size_px, builder)?,
    };
    let corners = fixed_to_observer(at, corners, observer, builder)?;
    output.window = Some(read_placement(at, fullscreen, builder)?);
    let picture = Picture {
        name,
        observer,
        eye,
        region_px: [0, 0, output.size_px[0], output.size_px[1]],
        calibration: None,
    };
    builder.show(at, &mut output, corners, picture)?;
    builder.add_output(at, host, output)
}

fn assume_size(at: At<'_>, [width, height]: [i64; 2], why: &str, builder: &mut Builder) {
    builder.ledger.note(
        at,
        "size is not stated",
        format!("{why}: {width}×{height}"),
        "write the projector's pixels as size_px of the output, the screen and canvas_px",
    );
}

/// Full screens of 1080 pixels on the shorter side with square pixels.
fn full_size([width_m, height_m]: [f64; 2]) -> Option<[i64; 2]> {
    let density = 1080.0 / width_m.min(height_m);
    let size = [width_m, height_m].map(|m| (m * density).round());
    let fits = size
        .iter()
        .all(|px| (1.0..=MAX_SIZE_PX as f64).contains(px));
    fits.then_some(size.map(|px| px as i64))
}

fn read_observer(
    at: At<'_>,
    observers: &[(&str, usize)],
    builder: &mut Builder,
) -> Result<Option<usize>, Trouble> {
    let Some(reference) = at.get("observer") else {
        builder.ledger.note(
            at,
            "observer is not stated",
            "QVR shows nothing in a window without an observer, so it is left out",
            "write the output and its channel by hand",
        );
        return Ok(None);
    };
    let wanted = reference.text()?;
    let found = observers.iter().find(|(name, _)| *name == wanted);
    found
        .map(|(_, index)| Some(*index))
        .ok_or_else(|| reference.expected("the name of an observer of this file"))
}

/// The eye that the window is for, and how it shows both. `None` where it cannot be shown.
fn read_output_mode(
    at: At<'_>,
    output: &mut Output,
    builder: &mut Builder,
) -> Result<Option<Eye>, Trouble> {
    let Some(mode) = at.get("output").or_else(|| at.get("stereo_mode")) else {
        return Ok(Some(Eye::Centre));
    };
    let mut words = mode.words().iter().map(|word| word.text.as_str());
    let first = words.next().unwrap_or_default();
    let mut plugin = words.next();
    // First versions wrote "stereo red_cyan", or "stereo gl".
    let kind = match (first, plugin) {
        (
            "stereo",
            Some(kind @ ("gl" | "red_cyan" | "green_magenta" | "amber_blue" | "oculus")),
        ) => {
            plugin = words.next();
            kind
        }
        _ => first,
    };
    let (eye, stereo) = match kind {
        "center" | "none" => (Eye::Centre, Stereo::Off),
        "left" => (Eye::Left, Stereo::Off),
        "right" => (Eye::Right, Stereo::Off),
        "red_cyan" => (Eye::Centre, Stereo::RedCyan),
        "green_magenta" => (Eye::Centre, Stereo::GreenMagenta),
        "amber_blue" => (Eye::Centre, Stereo::AmberBlue),
        "stereo" | "gl" => {
            builder
                .ledger
                .note(mode, mode.source(), QUAD_BUFFER.0, QUAD_BUFFER.1);
            (Eye::Centre, Stereo::Off)
        }
        "oculus" | "openvr" | "googlevr" | "osvr" => {
            builder.ledger.list(
                mode,
                "head-mounted displays are not screens of a room, so the window is left out",
                "nothing",
            );
            return Ok(None);
        }
        _ => {
            return Err(mode.expected(
                "one of center, left, right, stereo, red_cyan, green_magenta, amber_blue, oculus, openvr, googlevr",
            ));
        }
    };
    output.stereo = stereo;
    mode.carry();
    if plugin.is_some() {
        builder.ledger.note(
            mode,
            mode.source(),
            "output plugins are programs of QVR, so its picture is shown as it is",
            "if the plugin warps or blends, write calibration = { file = … } on the channel",
        );
    }
    Ok(Some(eye))
}

/// The corners that the window states, unless it is given by its centre.
fn read_wall(at: At<'_>, builder: &mut Builder) -> Result<Option<Corners>, Trouble> {
    let by_centre = at
        .get("screen_is_given_by_center")
        .map(At::flag)
        .transpose()?;
    let Some(wall) = at.get("screen_wall") else {
        return Ok(None);
    };
    if by_centre == Some(true) {
        builder.ledger.list(
            wall,
            "screen_is_given_by_center is true, so QVR does not regard it",
            "nothing, unless these corners were meant: then write corners_m",
        );
        return Ok(None);
    }
    let [a, b, c, d, e, f, g, h, i] = wall.numbers::<9>()?;
    if by_centre.is_none() {
        builder.ledger.note(
            at,
            "screen_is_given_by_center is not stated",
            "QVR would regard screen_wall only with \"false\"; here it is regarded",
            "check the corners of its screen",
        );
    }
    if let Some(centre) = at.get("screen_center") {
        builder.ledger.list(
            centre,
            "the corners of screen_wall place the screen",
            "nothing",
        );
    }
    Ok(Some(Corners::new([a, b, c], [d, e, f], [g, h, i])))
}

/// A monitor of which only the centre is known.
fn read_centre(at: At<'_>, size_px: [i64; 2], builder: &mut Builder) -> Result<Corners, Trouble> {
    let centre = match at.get("screen_center") {
        Some(centre) => centre.numbers()?,
        None => {
            builder.ledger.note(
                at,
                "neither screen_wall nor screen_center is stated",
                "QVR's default is taken: one metre in front of its origin",
                "measure the screen and correct corners_m",
            );
            [0.0, 0.0, -1.0]
        }
    };
    let [x, y, z] = centre;
    let [width_m, height_m] = size_px.map(|px| px as f64 * PITCH_M);
    builder.ledger.note(
        at,
        "the screen's size in metres is not stated",
        format!(
            "QVR asks the monitor; 96 pixels an inch are assumed around the centre, so it is {width_m:.3} m × {height_m:.3} m"
        ),
        "measure the screen and correct corners_m",
    );
    let (right, up) = (0.5 * width_m, 0.5 * height_m);
    Ok(Corners::new(
        [x - right, y - up, z],
        [x + right, y - up, z],
        [x - right, y + up, z],
    ))
}

/// The corners in the room: where they are fixed to the observer, QVR counts them from the head and along its axes.
fn fixed_to_observer(
    at: At<'_>,
    corners: Corners,
    observer: usize,
    builder: &mut Builder,
) -> Result<Corners, Trouble> {
    let fixed = match at.get("screen_is_fixed_to_observer") {
        Some(fixed) => fixed.flag()?,
        None => {
            builder.ledger.note(
                at,
                "screen_is_fixed_to_observer is not stated",
                "QVR's default is taken: true, the corners count from the head",
                "nothing, unless the corners are those of the room",
            );
            true
        }
    };
    let Some(observer) = builder.draft.observers.get(observer).filter(|_| fixed) else {
        return Ok(corners);
    };
    let head = DVec3::from(observer.head_m);
    let turn = turn_of(observer.looks_deg);
    if observer.tracker.is_some() {
        builder.ledger.note(
            at,
            "a screen that is fixed to a tracked observer",
            "screens stand in the room, so it stays where it is for the resting head",
            "nothing, unless it was worn on the head",
        );
    }
    Ok(corners.map(|corner| head + turn * corner))
}

fn read_placement(at: At<'_>, fullscreen: bool, builder: &mut Builder) -> Result<Window, Trouble> {
    let monitor = match at.get("display_screen") {
        Some(screen) => Some(screen.integer(-1, 255)?).filter(|index| *index >= 0),
        None => None,
    };
    let position = at
        .get("position")
        .map(|position| position.integers::<2>(-MAX_POSITION_PX, MAX_POSITION_PX))
        .transpose()?;
    if position.is_none() && !fullscreen {
        builder.ledger.note(
            at,
            "position is not stated",
            "the upper left corner of the desktop is assumed",
            "correct position_px",
        );
    }
    if fullscreen && monitor.is_none() {
        builder.ledger.note(
            at,
            "display_screen is not stated",
            "it fills the monitor on which position_px lies",
            "write monitor if the machine has several",
        );
    }
    Ok(Window {
        position_px: position.unwrap_or([0, 0]),
        fullscreen,
        monitor,
    })
}
