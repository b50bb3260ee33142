//! What a wall describes, in figures, and all that is odd about it.
//!
//! In: a wall and its surfaces. Out: findings for people and for JSON. It prints nothing.

use glam::DVec3;
use protocol::Wall;
use protocol::wall::{Eye, Output, Screen, ScreenShape, Surfaces};
use screens::Density;
use serde::Serialize;

use crate::plan::face::Face;

use super::calibrated::{self, ChannelFindings, Measured};
use super::{canvases, eyes, heads, meeting, overlaps, ramps, windows};

/// Samples along a row and a column.
const STEPS: u32 = 256;

/// What was found.
#[derive(Debug, Serialize)]
pub(super) struct Findings {
    pub(super) name: String,
    pub(super) fps: f64,
    pub(super) hosts: usize,
    pub(super) outputs: usize,
    pub(super) pixels: u64,
    pixels_per_radian: f64,
    pub(super) screens: Vec<ScreenFindings>,
    pub(super) calibrated: Vec<ChannelFindings>,
    observers: Vec<ObserverFindings>,
    trackers: Vec<TrackerFindings>,
    pub(super) warnings: Vec<String>,
}

/// One screen, as the resting head of its observer sees it.
#[derive(Debug, Serialize)]
pub(super) struct ScreenFindings {
    pub(super) name: String,
    pub(super) kind: &'static str,
    observer: String,
    pub(super) size_px: [u32; 2],
    /// Along the middle row and the middle column, on the surface.
    pub(super) size_m: [f64; 2],
    /// From the head to the nearest point.
    pub(super) distance_m: f64,
    /// The angles that the middle row and the middle column sweep.
    pub(super) field_of_view_deg: [f64; 2],
    /// `None` where the head sees nothing from the front.
    pub(super) pixels_per_radian: Option<Range>,
    /// The share of the canvas that the head sees from the front.
    seen_share: f64,
    pub(super) outputs: Shown,
}

/// Pixels to a radian.
#[derive(Debug, Serialize)]
pub(super) struct Range {
    pub(super) sparsest: f64,
    pub(super) densest: f64,
}

impl From<Density> for Range {
    fn from(density: Density) -> Self {
        Self {
            sparsest: density.sparsest,
            densest: density.densest,
        }
    }
}

/// How many outputs show a screen for which eye.
#[derive(Debug, Default, Serialize)]
pub(super) struct Shown {
    pub(super) centre: usize,
    pub(super) left: usize,
    pub(super) right: usize,
}

/// A head at rest.
#[derive(Debug, Serialize)]
struct ObserverFindings {
    name: String,
    head_m: [f64; 3],
    left_eye_m: [f64; 3],
    right_eye_m: [f64; 3],
    tracker: Option<String>,
}

/// What follows heads.
#[derive(Debug, Serialize)]
struct TrackerFindings {
    name: String,
    origin_m: [f64; 3],
    observers: Vec<String>,
}

impl Findings {
    pub(super) fn new(wall: &Wall, surfaces: &Surfaces) -> Self {
        let outputs = || wall.hosts.iter().flat_map(|host| &host.outputs);
        let faces: Vec<Option<Face<'_>>> = (0..wall.screens.len())
            .map(|index| surfaces.shape(index).map(Face::new))
            .collect();
        let channels = Measured::all(wall, surfaces);
        let screens = wall.screens.iter().zip(&faces).enumerate();
        let screens = screens
            .filter_map(|(index, (screen, face))| measure(wall, index, screen, face.as_ref()?));
        Self {
            name: wall.name.clone(),
            fps: wall.fps,
            hosts: wall.hosts.len(),
            outputs: outputs().count(),
            pixels: outputs()
                .map(|output| u64::from(output.size_px[0]) * u64::from(output.size_px[1]))
                .sum(),
            pixels_per_radian: surfaces.pixels_per_radian_from(wall, &wall.heads()),
            screens: screens.collect(),
            calibrated: channels.iter().filter_map(|it| it.findings(wall)).collect(),
            observers: wall.observers.iter().map(|it| observer(wall, it)).collect(),
            trackers: trackers(wall),
            warnings: warnings(wall, &faces, &channels),
        }
    }
}

/// What is legal but odd, one sentence each.
fn warnings(wall: &Wall, faces: &[Option<Face<'_>>], channels: &[Measured<'_>]) -> Vec<String> {
    let mut warnings = Vec::new();
    heads::warn(wall, faces, &mut warnings);
    canvases::warn(wall, faces, channels, &mut warnings);
    calibrated::warn(wall, faces, channels, &mut warnings);
    let shared = meeting::warn(wall, faces, &mut warnings);
    eyes::warn(wall, &mut warnings);
    let by_screen = overlaps::by_screen(wall);
    overlaps::warn(wall, &by_screen, &mut warnings);
    ramps::warn(wall, faces, &by_screen, &shared, &mut warnings);
    windows::warn(wall, &mut warnings);
    warnings
}

fn measure(wall: &Wall, index: usize, screen: &Screen, face: &Face<'_>) -> Option<ScreenFindings> {
    let observer = wall.observers.get(screen.observer)?;
    let head_m = DVec3::from(observer.head_m);
    let density = screens::pixel_density(face.shape, screen.size_px, head_m);
    let [width, height] = [false, true].map(|is_column| sweep(face, head_m, is_column));
    let nearest = face.nearest(head_m, f64::INFINITY)?;
    Some(ScreenFindings {
        name: screen.name.clone(),
        kind: match screen.shape {
            ScreenShape::Planar(_) => "planar",
            ScreenShape::Cylinder { .. } => "cylinder",
            ScreenShape::Sphere { .. } => "sphere",
            ScreenShape::Surface { .. } => "surface",
        },
        observer: observer.name.clone(),
        size_px: screen.size_px,
        size_m: [width.0, height.0],
        distance_m: nearest.point_m.distance(head_m),
        field_of_view_deg: [width.1, height.1],
        seen_share: density.map_or(0.0, |density| density.seen_share),
        pixels_per_radian: density.map(Range::from),
        outputs: shown(wall, index),
    })
}

/// Along the middle row or column: metres on the surface, and degrees as the head sees it.
fn sweep(face: &Face<'_>, head_m: DVec3, is_column: bool) -> (f64, f64) {
    let places = (0..=STEPS).map(|step| {
        let share = f64::from(step) / f64::from(STEPS);
        let [x, y] = if is_column {
            [0.5, share]
        } else {
            [share, 0.5]
        };
        face.shape.point_m(x, y)
    });
    let places: Vec<Option<DVec3>> = places.collect();
    let mut swept = (0.0, 0.0);
    for pair in places.windows(2) {
        if let [Some(from), Some(to)] = pair {
            swept.0 += from.distance(*to);
            let (from, to) = (*from - head_m, *to - head_m);
            swept.1 += from.cross(to).length().atan2(from.dot(to)).to_degrees();
        }
    }
    swept
}

fn shown(wall: &Wall, index: usize) -> Shown {
    let outputs = || wall.hosts.iter().flat_map(|host| &host.outputs);
    let count = |eye: Eye| {
        let shows = |output: &&Output| {
            output
                .sights()
                .any(|sight| sight.screen == index && sight.eye == eye)
        };
        outputs().filter(shows).count()
    };
    Shown {
        centre: count(Eye::Centre),
        left: count(Eye::Left),
        right: count(Eye::Right),
    }
}

fn observer(wall: &Wall, observer: &protocol::wall::Observer) -> ObserverFindings {
    let head = observer.resting_head();
    let tracker = observer.tracker.and_then(|index| wall.trackers.get(index));
    ObserverFindings {
        name: observer.name.clone(),
        head_m: observer.head_m,
        left_eye_m: head.eye_m(Eye::Left, observer.eye_separation_m),
        right_eye_m: head.eye_m(Eye::Right, observer.eye_separation_m),
        tracker: tracker.map(|tracker| tracker.name.clone()),
    }
}

fn trackers(wall: &Wall) -> Vec<TrackerFindings> {
    let trackers = wall.trackers.iter().enumerate();
    trackers
        .map(|(index, tracker)| TrackerFindings {
            name: tracker.name.clone(),
            origin_m: tracker.to_room.origin_m,
            observers: wall
                .observers
                .iter()
                .filter(|observer| observer.tracker == Some(index))
                .map(|observer| observer.name.clone())
                .collect(),
        })
        .collect()
}
