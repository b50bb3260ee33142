//! Ramps between screens that overlap in the room: those that are missing, and those that fade into nothing.
//!
//! In: a wall, its surfaces, its channels by screen, the edges on which another screen goes on. Out: sentences. How wide
//! ramps between different screens are to be is for projectors to show, and not judged.

use glam::DVec3;
use protocol::Wall;
use protocol::wall::Rect;

use crate::plan::face::Face;

use super::meeting::SharedEdge;
use super::overlaps::{EDGES, Shown};

/// How far apart surfaces are at most on which pictures blend, in metres: one may bulge.
const TOGETHER_M: f64 = 0.2;
/// Points so near are on a surface, and places so near are on its edge.
const TOUCH_M: f64 = 0.005;
const EDGE_M: f64 = 1e-4;
/// A channel that ends so near the edge of its canvas ends with it, in pixels.
const AT_EDGE_PX: u32 = 5;
/// Where along a ramp another picture is looked for, and how far into it: where the channel itself is nearly dark.
const ALONG: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
const INTO: f64 = 0.25;

pub(super) fn warn(
    wall: &Wall,
    faces: &[Option<Face<'_>>],
    by_screen: &[Vec<Shown<'_>>],
    shared: &[SharedEdge],
    warnings: &mut Vec<String>,
) {
    for (index, channels) in by_screen.iter().enumerate() {
        for shown in channels {
            for (edge, name) in EDGES.into_iter().enumerate() {
                let ramp_px = shown.ramp(edge);
                if ramp_px > 0 && fades_into_nothing(wall, faces, by_screen, index, shown, edge) {
                    warnings.push(format!(
                        "the {name} ramp of {} is {ramp_px} pixels wide, but nothing else shows the same there to that eye, so that the picture fades into black; write blend_px = {{ {name} = 0 }}",
                        shown.name()
                    ));
                }
            }
        }
    }
    for shared in shared {
        missing(wall, by_screen, shared, warnings);
    }
}

/// Whether no other channel shows what is under a ramp.
fn fades_into_nothing(
    wall: &Wall,
    faces: &[Option<Face<'_>>],
    by_screen: &[Vec<Shown<'_>>],
    index: usize,
    shown: &Shown<'_>,
    edge: usize,
) -> bool {
    let (Some(screen), Some(Some(face))) = (wall.screens.get(index), faces.get(index)) else {
        return false;
    };
    let [width, height] = screen.size_px.map(f64::from);
    let mut places = ALONG
        .map(|share| under_ramp(shown, edge, share))
        .into_iter();
    !places.any(|[x, y]| {
        let point_m = face.shape.point_m(x / width, y / height);
        let screens = by_screen.iter().zip(faces).zip(&wall.screens).enumerate();
        screens
            .into_iter()
            .any(|(other, ((channels, face), screen))| {
                let at = if other == index {
                    Some([x, y])
                } else {
                    point_m
                        .zip(face.as_ref())
                        .and_then(|(point_m, face)| place_over(face, point_m))
                        .map(|[x, y]| {
                            let [width, height] = screen.size_px.map(f64::from);
                            [x * width, y * height]
                        })
                };
                at.is_some_and(|at| {
                    channels.iter().any(|candidate| {
                        !std::ptr::eq(candidate.channel, shown.channel)
                            && candidate.shares_eye(shown)
                            && contains(&candidate.channel.canvas_px, at)
                    })
                }) || at.is_some() && is_calibrated(wall, other)
            })
    })
}

/// Whether a calibration puts channels of a screen in place, of which nothing is known here.
fn is_calibrated(wall: &Wall, screen: usize) -> bool {
    let outputs = wall.hosts.iter().flat_map(|host| &host.outputs);
    outputs
        .flat_map(|output| &output.channels)
        .any(|channel| channel.screen == screen && channel.calibration.is_some())
}

/// A place under a ramp, in pixels of the canvas.
fn under_ramp(shown: &Shown<'_>, edge: usize, share: f64) -> [f64; 2] {
    let rect = shown.channel.canvas_px;
    let [left, top] = [rect.x, rect.y].map(f64::from);
    let [width, height] = [rect.width, rect.height].map(f64::from);
    let into = INTO * f64::from(shown.ramp(edge));
    match edge {
        0 => [left + into, top + share * height],
        1 => [left + width - into, top + share * height],
        2 => [left + share * width, top + into],
        _ => [left + share * width, top + height - into],
    }
}

/// The place of another screen over a point, in shares of its canvas. A screen whose edge is nearest is beside it.
fn place_over(face: &Face<'_>, point_m: DVec3) -> Option<[f64; 2]> {
    let place = face.nearest(point_m, TOGETHER_M)?;
    let is_over =
        place.point_m.distance(point_m) <= TOUCH_M || face.to_edges_m(place.point_m) > EDGE_M;
    is_over.then(|| face.shares(place.parameters))
}

fn contains(rect: &Rect, [x, y]: [f64; 2]) -> bool {
    (f64::from(rect.x)..=f64::from(rect.right())).contains(&x)
        && (f64::from(rect.y)..=f64::from(rect.bottom())).contains(&y)
}

/// Channels without a ramp at an edge on which another screen shows the same to the same eye.
fn missing(
    wall: &Wall,
    by_screen: &[Vec<Shown<'_>>],
    shared: &SharedEdge,
    warnings: &mut Vec<String>,
) {
    let (Some(screen), Some(other), Some(edge)) = (
        wall.screens.get(shared.screen),
        wall.screens.get(shared.other),
        shared.edge.ramp,
    ) else {
        return;
    };
    let (Some(channels), Some(others)) =
        (by_screen.get(shared.screen), by_screen.get(shared.other))
    else {
        return;
    };
    let [width, height] = screen.size_px;
    for shown in channels {
        let rect = shown.channel.canvas_px;
        let to_edge_px = match edge {
            0 => rect.x,
            1 => width.saturating_sub(rect.right()),
            2 => rect.y,
            _ => height.saturating_sub(rect.bottom()),
        };
        if to_edge_px <= AT_EDGE_PX
            && shown.ramp(edge) == 0
            && others.iter().any(|other| other.shares_eye(shown))
        {
            warnings.push(format!(
                "screens \"{}\" and \"{}\" overlap at the {} edge of \"{}\", but {} has no ramp there; write blend_px with {} = the pixels that overlap",
                screen.name,
                other.name,
                shared.edge.name,
                screen.name,
                shown.name(),
                EDGES[edge]
            ));
        }
    }
}
