//! What a plan shows of a wall, measured once: surfaces, densities, parts of canvases, heads, extents.
//!
//! In: a wall and its surfaces. Out: what views draw. It knows no page.

use std::collections::BTreeMap;

use glam::DVec3;
use protocol::Wall;
use protocol::wall::{Observer, Rect, Screen, Surfaces, Tracker};
use screens::HeadPose;

use super::channels;
use super::colour::Scale;
use super::face::Face;
use super::people::HEAD_M;

/// Length of the arrow along which a head looks, in metres.
pub(super) const LOOK_M: f64 = 0.6;
/// Length of a tracker's axes, in metres.
pub(super) const TRACKER_AXIS_M: f64 = 0.3;
/// Cells of density on the whole plan, and on a side of one screen.
const CELLS: f64 = 8000.0;
const FEWEST_CELLS: f64 = 4.0;
const MOST_CELLS: f64 = 20.0;
/// Samples along a side of a part of a canvas.
const PART_STEPS: u32 = 24;
/// How far tracker origins may widen the plan, in its extents: others are only told of.
const WIDEN: f64 = 0.5;

/// A cell of a surface with one density.
pub(super) struct Cell {
    pub(super) corners_m: [DVec3; 4],
    pub(super) density: f64,
}

/// A part of a canvas, and who shows it.
pub(super) struct Part {
    pub(super) is_whole: bool,
    pub(super) middle_m: Option<DVec3>,
    pub(super) outline_m: Vec<DVec3>,
    /// Where ramps end.
    pub(super) ramps_m: Vec<Vec<DVec3>>,
    /// One line a host.
    pub(super) names: Vec<String>,
}

/// A screen as it is drawn.
pub(super) struct Drawn<'a> {
    pub(super) index: usize,
    pub(super) screen: &'a Screen,
    pub(super) outline_m: Vec<DVec3>,
    pub(super) cells: Vec<Cell>,
    pub(super) parts: Vec<Part>,
    /// Where the lines of sight of its head go.
    pub(super) corners_m: Vec<DVec3>,
    /// The sum of the cells' areas times their normals, in square metres: how much each view sees of it.
    pub(super) seen_m2: DVec3,
    pub(super) density: Option<screens::Density>,
    pub(super) calibrated: Vec<Calibrated>,
}

/// A channel whose pixels a calibration file puts in place.
pub(super) struct Calibrated {
    /// `HOST/OUTPUT`.
    pub(super) name: String,
    pub(super) size_px: [u32; 2],
    pub(super) density: Option<screens::Density>,
}

/// A head at rest, with its eyes.
pub(super) struct Person<'a> {
    pub(super) observer: &'a Observer,
    pub(super) pose: HeadPose,
    pub(super) eyes_m: [DVec3; 2],
}

/// All of it.
pub(super) struct Room<'a> {
    pub(super) wall: &'a Wall,
    pub(super) screens: Vec<Drawn<'a>>,
    pub(super) people: Vec<Person<'a>>,
    /// Trackers whose origin is on the plan, and the others.
    pub(super) trackers: Vec<&'a Tracker>,
    pub(super) far_trackers: Vec<&'a Tracker>,
    pub(super) scale: Option<Scale>,
    pub(super) bounds_m: [DVec3; 2],
}

impl<'a> Room<'a> {
    pub(super) fn new(wall: &'a Wall, surfaces: &Surfaces) -> Self {
        let people: Vec<Person<'a>> = wall.observers.iter().map(person).collect();
        let cells_a_side = (CELLS / wall.screens.len().max(1) as f64)
            .sqrt()
            .clamp(FEWEST_CELLS, MOST_CELLS) as u32;
        let mut screens = Vec::new();
        for (index, screen) in wall.screens.iter().enumerate() {
            if let Some(shape) = surfaces.shape(index) {
                let face = Face::new(shape);
                let mut drawn = drawn(wall, index, screen, &face, cells_a_side);
                channels::add(&mut drawn, wall, surfaces);
                screens.push(drawn);
            }
        }
        // The floor's origin is always in sight.
        let mut low = DVec3::ZERO;
        let mut high = DVec3::ZERO;
        let mut widen = |point: DVec3| (low, high) = (low.min(point), high.max(point));
        for screen in &screens {
            let corners = screen.cells.iter().flat_map(|cell| cell.corners_m);
            let parts = screen.parts.iter().flat_map(|part| &part.outline_m);
            screen
                .outline_m
                .iter()
                .chain(parts)
                .copied()
                .chain(corners)
                .for_each(&mut widen);
        }
        for person in &people {
            widen(person.pose.position_m - DVec3::splat(HEAD_M));
            widen(person.pose.position_m + DVec3::splat(HEAD_M));
        }
        let reach = DVec3::splat(WIDEN * (high - low).max_element());
        let (low_of_room, high_of_room) = (low, high);
        let (trackers, far_trackers): (Vec<&Tracker>, Vec<&Tracker>) =
            wall.trackers.iter().partition(|tracker| {
                let origin = DVec3::from(tracker.to_room.origin_m);
                origin.cmpge(low_of_room - reach).all() && origin.cmple(high_of_room + reach).all()
            });
        for tracker in &trackers {
            let origin = DVec3::from(tracker.to_room.origin_m);
            (low, high) = (low.min(origin), high.max(origin));
        }
        // No extent may vanish, and nothing stands on the very edge.
        let rim = 0.04 * (high - low).max_element().max(0.1);
        let densities = screens
            .iter()
            .flat_map(|screen| screen.cells.iter().map(|cell| cell.density));
        let scale = Scale::new(densities);
        Self {
            wall,
            screens,
            people,
            trackers,
            far_trackers,
            scale,
            bounds_m: [low - DVec3::splat(rim), high + DVec3::splat(rim)],
        }
    }

    /// The person who looks at a screen.
    pub(super) fn viewer(&self, screen: &Screen) -> Option<&Person<'a>> {
        self.people.get(screen.observer)
    }
}

fn person(observer: &Observer) -> Person<'_> {
    let pose = HeadPose::new(DVec3::from(observer.head_m), observer.looks_deg);
    Person {
        observer,
        pose,
        eyes_m: screens::eyes(&pose, observer.eye_separation_m),
    }
}

fn drawn<'a>(
    wall: &Wall,
    index: usize,
    screen: &'a Screen,
    face: &Face<'_>,
    cells_a_side: u32,
) -> Drawn<'a> {
    let head_m = wall
        .observers
        .get(screen.observer)
        .map(|observer| DVec3::from(observer.head_m));
    let share = |index: u32| f64::from(index) / f64::from(cells_a_side);
    let mut cells = Vec::new();
    let mut seen_m2 = DVec3::ZERO;
    for row in 0..cells_a_side {
        for column in 0..cells_a_side {
            let (u, v) = (
                [share(column), share(column + 1)],
                [share(row), share(row + 1)],
            );
            let corners = [
                face.point_m([u[0], v[0]]),
                face.point_m([u[1], v[0]]),
                face.point_m([u[1], v[1]]),
                face.point_m([u[0], v[1]]),
            ];
            let [Some(a), Some(b), Some(c), Some(d)] = corners else {
                continue;
            };
            seen_m2 += ((c - a).cross(d - b) * 0.5).abs();
            let middle = [0.5 * (u[0] + u[1]), 0.5 * (v[0] + v[1])];
            let density =
                head_m.and_then(|head_m| face.pixels_per_radian(middle, screen.size_px, head_m));
            cells.push(Cell {
                corners_m: [a, b, c, d],
                // Not a number is drawn in grey: nobody sees it.
                density: density.unwrap_or(f64::NAN),
            });
        }
    }
    let corners = face.edges();
    let corners_m = corners
        .iter()
        .flat_map(|edge| face.along(edge, if corners.len() == 1 { 4 } else { 1 }))
        .map(|place| place.point_m);
    let mut corners_m: Vec<DVec3> = corners_m.collect();
    corners_m.dedup_by(|a, b| a.distance(*b) < 1e-6);
    Drawn {
        index,
        screen,
        outline_m: face.outline_m(),
        cells,
        parts: parts(wall, index, screen, face),
        corners_m,
        seen_m2,
        density: head_m
            .and_then(|head_m| screens::pixel_density(face.shape, screen.size_px, head_m)),
        calibrated: Vec::new(),
    }
}

/// The parts of a canvas that channels show, each once. What calibrations put in place is not among them.
fn parts(wall: &Wall, index: usize, screen: &Screen, face: &Face<'_>) -> Vec<Part> {
    // By rectangle: ramps, and the names of outputs by host.
    type Shown<'w> = (Vec<[u32; 4]>, BTreeMap<&'w str, Vec<&'w str>>);
    let mut shown: Vec<(Rect, Shown<'_>)> = Vec::new();
    for host in &wall.hosts {
        for output in &host.outputs {
            for channel in output
                .channels
                .iter()
                .filter(|channel| channel.screen == index && channel.calibration.is_none())
            {
                let known = shown
                    .iter_mut()
                    .position(|(rect, _)| *rect == channel.canvas_px);
                let known = known.unwrap_or_else(|| {
                    shown.push((channel.canvas_px, Shown::default()));
                    shown.len() - 1
                });
                if let Some((_, (ramps, names))) = shown.get_mut(known) {
                    ramps.push(channel.blend.ramps_px);
                    names.entry(&host.name).or_default().push(&output.name);
                }
            }
        }
    }
    let [width, height] = screen.size_px.map(f64::from);
    let line = |from: [f64; 2], to: [f64; 2]| -> Vec<DVec3> {
        let along = (0..=PART_STEPS).map(|step| f64::from(step) / f64::from(PART_STEPS));
        let at = |axis: usize, share: f64| from[axis] + (to[axis] - from[axis]) * share;
        along
            .filter_map(|share| {
                face.shape
                    .point_m(at(0, share) / width, at(1, share) / height)
            })
            .collect()
    };
    shown
        .into_iter()
        .map(|(rect, (mut ramps, names))| {
            let [left, top] = [rect.x, rect.y].map(f64::from);
            let [right, bottom] = [rect.right(), rect.bottom()].map(f64::from);
            let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
            let sides = (0..4).map(|corner| (corners[corner], corners[(corner + 1) % 4]));
            ramps.sort_unstable();
            ramps.dedup();
            let ramps_m = ramps.into_iter().flat_map(|ramps| {
                let [l, r, t, b] = ramps.map(f64::from);
                let inner = [
                    (l, [left + l, top], [left + l, bottom]),
                    (r, [right - r, top], [right - r, bottom]),
                    (t, [left, top + t], [right, top + t]),
                    (b, [left, bottom - b], [right, bottom - b]),
                ];
                inner.into_iter().filter(|(ramp, ..)| *ramp > 0.0)
            });
            let names = names
                .into_iter()
                .map(|(host, outputs)| format!("{host}: {}", outputs.join(", ")));
            Part {
                is_whole: [rect.width, rect.height] == screen.size_px,
                middle_m: face
                    .shape
                    .point_m(0.5 * (left + right) / width, 0.5 * (top + bottom) / height),
                outline_m: sides.flat_map(|(from, to)| line(from, to)).collect(),
                ramps_m: ramps_m.map(|(_, from, to)| line(from, to)).collect(),
                names: names.collect(),
            }
        })
        .collect()
}
