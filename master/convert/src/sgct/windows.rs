//! Windows and viewports of SGCT.
//! In: `windows` of a node. Out: outputs with a channel for each viewport. Places and sizes of viewports are shares of
//! the window, y up.

use super::members;
use super::projection::{self, Dome, Projection};
use super::users::Users;
use crate::draft::{
    Builder, Channel, Host, MAX_POSITION_PX, MAX_SIZE_PX, Output, Screen, Shape, Window,
};
use crate::error::Trouble;
use crate::place::{Picture, region_of_shares};
use crate::source::At;
use crate::stereo::{Eye, QUAD_BUFFER, Stereo};

/// The size of a window where none is stated.
const SIZE_PX: [i64; 2] = [1280, 720];
/// Calibration files that are read, by extension.
const CALIBRATIONS: [&str; 6] = ["obj", "pfm", "csv", "data", "mpcdi", "vwf"];

/// Reads a window and adds its output to the host.
pub(super) fn read(
    at: At<'_>,
    index: usize,
    users: &Users,
    host: &mut Host,
    builder: &mut Builder,
) -> Result<(), Trouble> {
    let name = match at.get("name") {
        Some(name) => name.text()?.to_owned(),
        None => format!("window-{}", index + 1),
    };
    let mut output = Output {
        size_px: read_size(at, builder)?,
        name,
        ..Output::default()
    };
    read_stereo(at, &mut output, builder)?;
    output.window = read_placement(at, builder)?;
    for key in ["mirrorx", "mirrory"] {
        // Not mirrored is what outputs are. Anything else is left for the list.
        if let Some(mirror) = at.get(key)
            && matches!(mirror.words(), [word] if word.text == "false")
        {
            mirror.carry();
        }
    }
    match at
        .get("viewports")
        .filter(|list| list.children().next().is_some())
    {
        Some(list) => {
            let several = list.children().nth(1).is_some();
            for (number, viewport) in list.children().enumerate() {
                let name = match several {
                    true => format!("{} {} {}", host.name, output.name, number + 1),
                    false => format!("{} {}", host.name, output.name),
                };
                read_viewport(viewport, false, &name, users, &mut output, builder)?;
            }
        }
        None => {
            let name = format!("{} {}", host.name, output.name);
            builder.ledger.note(
                at,
                "no viewport is stated",
                "one that fills the window is assumed",
                "measure the screen and correct corners_m",
            );
            read_viewport(at, true, &name, users, &mut output, builder)?;
        }
    }
    builder.add_output(at, host, output)
}

fn read_size(at: At<'_>, builder: &mut Builder) -> Result<[i64; 2], Trouble> {
    let Some(size) = at.get("size") else {
        builder.ledger.note(
            at,
            "size is not stated",
            format!("{}×{} pixels are assumed", SIZE_PX[0], SIZE_PX[1]),
            "write the projector's pixels as size_px of the output, the screen and canvas_px",
        );
        return Ok(SIZE_PX);
    };
    pair(size, 1, MAX_SIZE_PX)
}

fn pair(at: At<'_>, least: i64, most: i64) -> Result<[i64; 2], Trouble> {
    let mut numbers = [0; 2];
    for (number, key) in numbers.iter_mut().zip(["x", "y"]) {
        *number = at
            .get(key)
            .ok_or_else(|| at.expected("an object with x and y"))?
            .integer(least, most)?;
    }
    Ok(numbers)
}

fn read_placement(at: At<'_>, builder: &mut Builder) -> Result<Option<Window>, Trouble> {
    if at.get("hidden").map_or(Ok(false), At::flag)? {
        return Ok(None);
    }
    let fullscreen = at.get("fullscreen").map_or(Ok(false), At::flag)?;
    // SGCT regards the monitor for full screens alone; −1 is the primary one.
    let monitor = match at.get("monitor").filter(|_| fullscreen) {
        Some(monitor) => Some(monitor.integer(-1, 255)?).filter(|index| *index >= 0),
        None => None,
    };
    let position_px = match at.get("pos").filter(|_| monitor.is_none()) {
        Some(position) => pair(position, -MAX_POSITION_PX, MAX_POSITION_PX)?,
        None => {
            if monitor.is_none() {
                builder.ledger.note(
                    at,
                    "pos is not stated",
                    "the upper left corner of the desktop is assumed",
                    "correct position_px, or write monitor",
                );
            }
            [0, 0]
        }
    };
    Ok(Some(Window {
        position_px,
        fullscreen,
        monitor,
    }))
}

fn read_stereo(at: At<'_>, output: &mut Output, builder: &mut Builder) -> Result<(), Trouble> {
    let Some(at) = at.get("stereo") else {
        return Ok(());
    };
    // SGCT counts rows from below and gives the lowest one to the left eye; wall files count from above. In the
    // checkerboard, SGCT gives pixels to the left eye whose column and row from below add up to an odd number
    // (src/internalshaders.h).
    let even_rows = output.size_px[1] % 2 == 0;
    let name = at.text()?;
    let (stereo, swap_eyes) = match name {
        "none" | "no_stereo" => (Stereo::Off, false),
        "side_by_side" => (Stereo::SideBySide, false),
        "side_by_side_inverted" => (Stereo::SideBySide, true),
        "top_bottom" => (Stereo::TopBottom, false),
        "top_bottom_inverted" => (Stereo::TopBottom, true),
        "vertical_interlaced" => (Stereo::InterlacedRows, even_rows),
        "vertical_interlaced_inverted" => (Stereo::InterlacedRows, !even_rows),
        "checkerboard" => (Stereo::Checkerboard, !even_rows),
        "checkerboard_inverted" => (Stereo::Checkerboard, even_rows),
        "anaglyph_red_cyan" => (Stereo::RedCyan, false),
        "anaglyph_amber_blue" => (Stereo::AmberBlue, false),
        "anaglyph_wimmer" => {
            builder.ledger.note(
                at,
                at.source(),
                "of the kinds of red-cyan anaglyphs there is one, which mixes no colours",
                "nothing",
            );
            (Stereo::RedCyan, false)
        }
        "active" | "quadbuffer" => {
            builder
                .ledger
                .note(at, at.source(), QUAD_BUFFER.0, QUAD_BUFFER.1);
            (Stereo::Off, false)
        }
        "test" | "dummy" => {
            builder.ledger.note(
                at,
                at.source(),
                "it is for tests of SGCT, so the output shows the middle between the eyes",
                "write stereo if the output shows both eyes",
            );
            (Stereo::Off, false)
        }
        _ => {
            return Err(at.expected("a way of stereo of the SGCT schema, for example side_by_side"));
        }
    };
    (output.stereo, output.swap_eyes) = (stereo, swap_eyes);
    Ok(())
}

/// Reads a viewport. A window without any stands for its only one; its size and place are others.
fn read_viewport(
    at: At<'_>,
    is_window: bool,
    name: &str,
    users: &Users,
    output: &mut Output,
    builder: &mut Builder,
) -> Result<(), Trouble> {
    at.carry();
    let share = |key: &'static str, default: [f64; 2]| match at.get(key).filter(|_| !is_window) {
        Some(pair) => members(pair, ["x", "y"]),
        None => Ok(default),
    };
    let ([x, y], [width, height]) = (share("pos", [0.0; 2])?, share("size", [1.0; 2])?);
    let Some(region_px) = region_of_shares([x, y, width, height], output.size_px) else {
        builder.ledger.list(
            at,
            "it is empty or leaves the window, so it is left out",
            "correct its place, and write the channel by hand",
        );
        return Ok(());
    };
    let observer = users.of(at)?;
    let eye = match at.get("eye") {
        Some(eye) => eye.one_of(&[
            ("center", Eye::Centre),
            ("left", Eye::Left),
            ("right", Eye::Right),
        ])?,
        None => Eye::Centre,
    };
    let eye = builder.eye_in(at, output.stereo, eye);
    let calibration = read_mesh(at, builder)?;
    let picture = Picture {
        name,
        observer,
        eye,
        region_px,
        calibration,
    };
    match projection::read(at, builder)? {
        Some(Projection::Plane(corners)) => builder.show(at, output, corners, picture),
        Some(Projection::Dome(dome)) => show_dome(at, &dome, picture, output, builder),
        None => {
            builder.ledger.list(
                at,
                "wall files have planes, cylinders, domes and surfaces from files, and of SGCT's projections the planar ones and the fisheye are converted, so it is left out",
                "write the screen by hand",
            );
            Ok(())
        }
    }
}

fn read_mesh(at: At<'_>, builder: &mut Builder) -> Result<Option<String>, Trouble> {
    let Some(mesh) = at.get("mesh") else {
        return Ok(None);
    };
    let file = mesh.text()?;
    if file.is_empty() {
        return Ok(None);
    }
    let extension = file.rsplit_once('.').map_or("", |(_, extension)| extension);
    if CALIBRATIONS.contains(&extension.to_ascii_lowercase().as_str()) {
        return Ok(Some(file.to_owned()));
    }
    builder.ledger.list(
        mesh,
        format!("of calibration files, {} are read", CALIBRATIONS.join(", ")),
        "export the calibration in one of those formats, and write calibration = { file = … }",
    );
    Ok(None)
}

/// Shows a fisheye picture: its square canvas is as large as fits, less what is cropped, in the middle of the region.
fn show_dome(
    at: At<'_>,
    dome: &Dome,
    picture: Picture<'_>,
    output: &mut Output,
    builder: &mut Builder,
) -> Result<(), Trouble> {
    let [x, y, width, height] = picture.region_px;
    let [left, right, bottom, top] = dome.crop;
    let (across, along) = (1.0 - left - right, 1.0 - bottom - top);
    let side = (width as f64 / across).min(height as f64 / along).round();
    if side > MAX_SIZE_PX as f64 {
        builder.ledger.list(
            at,
            format!("its canvas would be {side} pixels wide, at most {MAX_SIZE_PX} are possible, so it is left out"),
            "write the screen by hand",
        );
        return Ok(());
    }
    let start = [(left * side).round() as i64, (top * side).round() as i64];
    let side = (side as i64).max(1);
    let shown = [
        ((across * side as f64).round() as i64)
            .min(width)
            .min(side - start[0]),
        ((along * side as f64).round() as i64)
            .min(height)
            .min(side - start[1]),
    ];
    if shown[0] < 1 || shown[1] < 1 {
        builder.ledger.list(
            at,
            "nothing of the picture is left after the crop, so it is left out",
            "write the screen by hand",
        );
        return Ok(());
    }
    if !builder.has_room(at, output, picture.region_px) {
        return Ok(());
    }
    let fills = [width - shown[0], height - shown[1]]
        .iter()
        .all(|rest| *rest <= 1);
    if !dome.keeps_aspect && !fills {
        builder.ledger.note(
            at,
            "keepaspectratio is false",
            "canvases of domes are square, so the picture is not stretched but stands in the middle of the region",
            "use a calibration file if the projector stretches its pixels",
        );
    }
    let head = builder
        .draft
        .observers
        .get(picture.observer)
        .map(|o| o.head_m);
    if head.is_some_and(|head| head.iter().any(|m| m.abs() > 1e-6)) {
        builder.ledger.note(
            at,
            "a dome whose user is not in its middle",
            "SGCT shows it on the faces of a cube about the origin, here it is a sphere about the origin",
            "measure where the dome's centre is, and correct centre_m",
        );
    }
    let screen = Screen {
        name: picture.name.to_owned(),
        observer: picture.observer,
        size_px: [side, side],
        shape: Shape::Dome {
            centre_m: [0.0; 3],
            radius_m: dome.radius_m,
            tilt_deg: dome.tilt_deg,
            fisheye_deg: dome.fisheye_deg,
        },
    };
    let screen = builder.screen(at, screen)?;
    output.channels.push(Channel {
        screen,
        eye: picture.eye,
        canvas_px: [start[0], start[1], shown[0], shown[1]],
        output_px: [x + (width - shown[0]) / 2, y + (height - shown[1]) / 2],
        calibration: picture.calibration,
    });
    Ok(())
}
