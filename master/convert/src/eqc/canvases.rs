//! Canvases and layouts of Equalizer.
//! In: canvases with segments, layouts with views. Out: a channel for each view in each segment. Where segments are cut
//! from one wall with the same pixels, they share a screen; a wall of a view holds over one of a segment, and that over
//! the canvas's.

use super::compounds::Modes;
use super::frustum::{self, Eyes, Mode, WALL};
use super::machines::{ChannelBlock, Machines};
use super::observers::Observers;
use super::{name_of, refer, shares_of};
use crate::draft::{Builder, Channel, MAX_SIZE_PX, Screen, Shape};
use crate::error::Trouble;
use crate::place::{Picture, is_square, region_of_shares};
use crate::room::Corners;
use crate::source::At;
use crate::stereo::{Eye, Stereo};

/// A view of a layout.
struct View {
    shares: [f64; 4],
    observer: usize,
    is_stereo: bool,
    corners: Option<Corners>,
}

/// A view in a segment.
struct Piece<'t> {
    at: At<'t>,
    name: String,
    channel: ChannelBlock<'t>,
    eye: Eye,
    stereo: Stereo,
    observer: usize,
    /// Within the output, from the upper left corner.
    region_px: [i64; 4],
    /// The wall that it is cut from, and which part it is.
    wall: Corners,
    shares: [f64; 4],
}

/// Reads all canvases.
pub(super) fn read<'t>(
    config: At<'t>,
    modes: &Modes,
    observers: &mut Observers<'t>,
    machines: &mut Machines<'t>,
    builder: &mut Builder,
) -> Result<(), Trouble> {
    for canvas in config.all("canvas") {
        canvas.carry();
        let views = read_views(config, canvas, observers, builder)?;
        let wall = frustum::read(canvas, builder)?;
        let mut pieces = Vec::new();
        for segment in canvas.all("segment") {
            read_segment(segment, &views, wall, modes, machines, builder, &mut pieces)?;
        }
        show_all(canvas, pieces, machines, builder)?;
    }
    Ok(())
}

fn read_views<'t>(
    config: At<'t>,
    canvas: At<'t>,
    observers: &mut Observers<'t>,
    builder: &mut Builder,
) -> Result<Vec<View>, Trouble> {
    let is_off = |at: &At<'_>| matches!(at.words(), [word] if !word.quoted && word.text == "OFF");
    let reference = canvas.all("layout").find(|at| !is_off(at));
    for other in canvas.all("layout") {
        if reference.is_none_or(|reference| !reference.is_same(other)) {
            builder.ledger.list(
                other,
                "a wall shows one layout: the first that a canvas names",
                "make a wall file of its own for the other one",
            );
        }
    }
    let layout = match reference {
        Some(reference) => {
            let found = refer(reference, config.all("layout"))?;
            reference.carry();
            Some(found.ok_or_else(|| reference.expected("a layout of this file"))?)
        }
        None => None,
    };
    let mut views = Vec::new();
    for at in layout
        .into_iter()
        .flat_map(|layout| layout.carry().all("view"))
    {
        at.carry();
        let observer = match at.get("observer") {
            Some(reference) => {
                let found = refer(reference, observers.list.iter().map(|(at, _)| *at))?;
                let found = found.and_then(|found| {
                    let same = |(at, _): &&(At<'_>, usize)| at.is_same(found);
                    observers.list.iter().find(same)
                });
                let found = found.ok_or_else(|| reference.expected("an observer of this file"))?;
                reference.carry();
                found.1
            }
            None => observers.nobody(at, builder)?,
        };
        views.push(View {
            shares: shares_of(at)?,
            observer,
            is_stereo: match at.get("mode") {
                Some(mode) => mode.one_of(&[("MONO", false), ("STEREO", true)])?,
                None => false,
            },
            corners: frustum::read(at, builder)?,
        });
    }
    if views.is_empty() {
        builder.ledger.note(
            canvas,
            "no layout with a view is stated",
            "one view all over the canvas is assumed",
            "nothing",
        );
        views.push(View {
            shares: [0.0, 0.0, 1.0, 1.0],
            observer: match observers.list.first() {
                Some((_, observer)) => *observer,
                None => observers.nobody(canvas, builder)?,
            },
            is_stereo: false,
            corners: None,
        });
    }
    Ok(views)
}

fn read_segment<'t>(
    at: At<'t>,
    views: &[View],
    canvas_wall: Option<Corners>,
    modes: &Modes,
    machines: &mut Machines<'t>,
    builder: &mut Builder,
    pieces: &mut Vec<Piece<'t>>,
) -> Result<(), Trouble> {
    let Some(reference) = at.carry().get("channel") else {
        builder.ledger.list(
            at,
            "it names no channel, so nothing shows it",
            "write its channel by hand",
        );
        return Ok(());
    };
    let channel_name = reference.text()?;
    let channel = machines
        .channel(channel_name)
        .ok_or_else(|| reference.expected("the name of a channel of this file"))?;
    machines.set_used(channel_name);
    let shares = shares_of(at)?;
    let own_wall = frustum::read(at, builder)?;
    if let Some(viewport) = at.get("viewport").filter(|_| own_wall.is_some()) {
        builder.ledger.note(
            viewport,
            viewport.source(),
            "the segment has a wall of its own, so it is a screen of its own and no part of the canvas",
            "nothing",
        );
    }
    let eyes = Eyes::read(at, Eyes::ALL)?;
    let name = name_of(at)?.unwrap_or(channel_name);
    let mut seen = false;
    for view in views {
        let Some(shown) = intersection(shares, view.shares) else {
            continue;
        };
        seen = true;
        let [_, _, width, height] = channel.region_px;
        let Some(region) = region_of_shares(within(shown, shares), [width, height]) else {
            continue;
        };
        let (wall, part) = match (view.corners, own_wall, canvas_wall) {
            (Some(wall), ..) => (wall, within(shown, view.shares)),
            (None, Some(wall), _) => (wall, within(shown, shares)),
            (None, None, Some(wall)) => (wall, shown),
            (None, None, None) => {
                builder.ledger.note(
                    at,
                    "no wall and no projection is stated",
                    "Equalizer's default is taken: 1.6 m × 1 m, one metre in front of the origin",
                    "measure the screen and correct corners_m",
                );
                let [bottom_left, bottom_right, top_left] = WALL;
                (Corners::new(bottom_left, bottom_right, top_left), shown)
            }
        };
        let mode = modes.of(channel_name);
        let is_quad = machines
            .output(&channel)
            .is_some_and(|(_, is_quad)| is_quad);
        let (eye, stereo) = choose_eye(at, eyes, view.is_stereo, mode, is_quad, builder);
        let [x, y, ..] = channel.region_px;
        pieces.push(Piece {
            at,
            name: name.to_owned(),
            channel: channel.clone(),
            eye,
            stereo,
            observer: view.observer,
            region_px: [x + region[0], y + region[1], region[2], region[3]],
            wall,
            shares: part,
        });
    }
    if !seen {
        builder.ledger.list(
            at,
            "no view of the layout reaches it, so it shows nothing",
            "write its channel by hand",
        );
    }
    Ok(())
}

/// The eye for which a channel is, and how it shows both.
pub(super) fn choose_eye(
    at: At<'_>,
    eyes: Eyes,
    is_stereo: bool,
    mode: Mode,
    is_quad_buffered: bool,
    builder: &mut Builder,
) -> (Eye, Stereo) {
    match eyes.single() {
        Some(_) if !is_stereo && eyes.centre => (Eye::Centre, Stereo::Off),
        Some(eye) => (eye, Stereo::Off),
        None if is_stereo && eyes.left => (Eye::Centre, mode.stereo(at, is_quad_buffered, builder)),
        None => (Eye::Centre, Stereo::Off),
    }
}

/// Puts the pieces of a canvas into their outputs.
fn show_all<'t>(
    canvas: At<'t>,
    pieces: Vec<Piece<'t>>,
    machines: &mut Machines<'t>,
    builder: &mut Builder,
) -> Result<(), Trouble> {
    let mut groups: Vec<Vec<Piece<'t>>> = Vec::new();
    for piece in pieces {
        let group = groups.iter_mut().find(|group| {
            group
                .first()
                .is_some_and(|p| (p.wall, p.observer) == (piece.wall, piece.observer))
        });
        match group {
            Some(group) => group.push(piece),
            None => groups.push(vec![piece]),
        }
    }
    for group in groups {
        let size_px = common_size(&group);
        let shared = match (size_px, group.first()) {
            (Some(size_px), Some(first)) if group.len() > 1 => builder
                .rectangle(canvas, first.wall, first.observer)
                .filter(|corners| is_square(corners.size_m(), size_px))
                .map(|corners| (corners, size_px, first.observer)),
            _ => None,
        };
        let screen = match shared {
            Some((corners, size_px, observer)) => {
                let screen = Screen {
                    name: name_of(canvas)?.unwrap_or("canvas").to_owned(),
                    observer,
                    size_px,
                    shape: Shape::Planar(corners),
                };
                Some((builder.screen(canvas, screen)?, size_px))
            }
            None => None,
        };
        for piece in group {
            let Some((output, _)) = machines.output(&piece.channel) else {
                continue;
            };
            let eye = builder.join(piece.at, output, piece.eye, piece.stereo);
            let Some((screen, size_px)) = screen else {
                let picture = Picture {
                    name: &piece.name,
                    observer: piece.observer,
                    eye,
                    region_px: piece.region_px,
                    calibration: None,
                };
                let corners = piece.wall.part(piece.shares);
                builder.show(piece.at, output, corners, picture)?;
                continue;
            };
            if !builder.has_room(piece.at, output, piece.region_px) {
                continue;
            }
            let [x, y, width, height] = piece.region_px;
            output.channels.push(Channel {
                screen,
                eye,
                canvas_px: part_px(piece.shares, size_px, [width, height]),
                output_px: [x, y],
                calibration: None,
            });
        }
    }
    Ok(())
}

/// The size of the canvas of which all pieces are parts. `None` where their pixels differ.
fn common_size(group: &[Piece<'_>]) -> Option<[i64; 2]> {
    let mut size = [0.0_f64; 2];
    for axis in 0..2 {
        let whole = |piece: &Piece<'_>| {
            piece.region_px.get(axis + 2).map_or(0.0, |px| *px as f64)
                / piece.shares.get(axis + 2).map_or(1.0, |share| *share)
        };
        let sizes = group.iter().map(whole);
        let (least, most) = sizes.fold((f64::MAX, 0.0_f64), |(a, b), s| (a.min(s), b.max(s)));
        // Shares are often written with four digits.
        if most - least > 2.0_f64.max(2e-3 * most) || most > MAX_SIZE_PX as f64 {
            return None;
        }
        *size.get_mut(axis)? = (0.5 * (least + most)).round();
    }
    let size = size.map(|side| side as i64);
    let fits = |piece: &Piece<'_>| {
        let [_, _, width, height] = piece.region_px;
        width <= size[0] && height <= size[1]
    };
    group.iter().all(fits).then_some(size)
}

/// Where a part of a canvas with this many pixels lies, from the upper left corner.
fn part_px(
    [x, y, _, height]: [f64; 4],
    size: [i64; 2],
    [width_px, height_px]: [i64; 2],
) -> [i64; 4] {
    let left = (x * size[0] as f64).round() as i64;
    let top = ((1.0 - y - height) * size[1] as f64).round() as i64;
    [
        left.clamp(0, size[0] - width_px),
        top.clamp(0, size[1] - height_px),
        width_px,
        height_px,
    ]
}

/// What two rectangles of shares have in common.
fn intersection(one: [f64; 4], other: [f64; 4]) -> Option<[f64; 4]> {
    let (left, bottom) = (one[0].max(other[0]), one[1].max(other[1]));
    let right = (one[0] + one[2]).min(other[0] + other[2]);
    let top = (one[1] + one[3]).min(other[1] + other[3]);
    let shared = [left, bottom, right - left, top - bottom];
    // Edges that touch share nothing; they may be off by the last of four digits.
    (shared[2] > 1e-3 && shared[3] > 1e-3).then_some(shared)
}

/// The shares that a part has of a whole.
fn within(part: [f64; 4], whole: [f64; 4]) -> [f64; 4] {
    [
        (part[0] - whole[0]) / whole[2],
        (part[1] - whole[1]) / whole[3],
        part[2] / whole[2],
        part[3] / whole[3],
    ]
}
