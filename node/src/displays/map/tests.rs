//! Calibrated channels and surfaces by points: what each pixel shows lies where the geometry of a known projector says.
//! In: files of every kind that these tests write of one projector in front of a plane or a cylinder. Out: verdicts, in
//! pixels of the output, from several heads. Nothing here shares a formula with the code that it judges.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod archives;
mod files;
mod geometry;
mod meshes;

use std::path::Path;

use glam::DVec3;
use protocol::camera::Pose;
use protocol::wall::{Head, Viewers};
use protocol::{View, Wall};
use render::{ChannelSource, OutputPlan, WarpMap};

use super::super::Displays;
use geometry::{HEAD_M, SIZE_PX, Setting};

/// Most that a pixel may be off, in pixels of the output.
const MOST_PX: f64 = 0.1;
/// Heads that look, besides the one for which calibrations are made: metres in the room.
const HEADS_M: [[f64; 3]; 5] = [
    HEAD_M,
    [-0.7, 1.4, 0.6],
    [0.8, 1.9, -0.3],
    [0.1, 1.1, 1.2],
    [-0.4, 2.1, 0.2],
];

/// How a channel is shown: keys of the wall file besides the screen's.
struct Shown<'a> {
    /// `canvas_px` of the channel.
    canvas_px: [u32; 4],
    /// `calibration = …` and the like.
    keys: &'a str,
}

impl Shown<'_> {
    /// A channel that shows all of the canvas by a file.
    fn calibrated(file: &str) -> String {
        format!("calibration = {{ file = \"{file}\" }}\n")
    }
}

/// The whole canvas of all settings, in pixels.
const WHOLE_PX: [u32; 4] = [0, 0, geometry::CANVAS_PX[0], geometry::CANVAS_PX[1]];

/// The wall: one observer, one screen, one output whose only channel is `shown`.
fn wall(screen: &str, shown: &Shown<'_>, folder: &Path) -> Wall {
    let [width, height] = SIZE_PX;
    let [canvas_width, canvas_height] = geometry::CANVAS_PX;
    let (canvas_px, keys) = (shown.canvas_px, shown.keys);
    let text = format!(
        "[wall]\nname = \"test\"\nfps = 60\n[[observers]]\nname = \"viewer\"\nhead_m = {HEAD_M:?}\n\
         [[screens]]\nname = \"screen\"\nobserver = \"viewer\"\nsize_px = [{canvas_width}, {canvas_height}]\n{screen}\n\
         [[hosts]]\nname = \"host\"\n[[hosts.outputs]]\nname = \"output\"\nsize_px = [{width}, {height}]\nheadless = true\n\
         [[hosts.outputs.channels]]\nscreen = \"screen\"\ncanvas_px = {canvas_px:?}\nsize_px = [{width}, {height}]\n{keys}"
    );
    let mut wall = Wall::parse(&text, "test.toml").unwrap_or_else(|error| panic!("{error}"));
    for file in wall.files_mut() {
        *file = folder.join(&file).to_str().unwrap().to_owned();
    }
    wall
}

/// Opens the wall's only host.
fn open(wall: &Wall) -> (Displays, OutputPlan) {
    super::super::surfaces(wall).unwrap();
    let (displays, mut plans) = Displays::open(wall, 0, 8192).unwrap();
    (displays, plans.pop().unwrap())
}

fn map_of(plan: &OutputPlan) -> &WarpMap {
    let ChannelSource::Warped { map, .. } = &plan.channels[0].source else {
        panic!("the channel is not warped");
    };
    map
}

/// What a node draws for a head.
fn view(head_m: [f64; 3]) -> View {
    View {
        epoch: 1,
        frame: 1,
        scene_revision: 0,
        wall_revision: 0,
        sent_us: 0,
        pose: Pose {
            position_m: [0.0; 3],
            right: [1.0, 0.0, 0.0],
            up: [0.0, 1.0, 0.0],
            back: [0.0, 0.0, 1.0],
        },
        viewers: Viewers {
            heads: vec![Head {
                position_m: head_m,
                right: [1.0, 0.0, 0.0],
            }],
            pixels_per_radian: 1000.0,
        },
        settle: false,
        previous_swap: None,
    }
}

/// How many pixels of a channel were compared, and the worst of them.
#[derive(Debug)]
struct Found {
    compared: usize,
    worst_px: f64,
    /// The most pixels to a radian that each head finds.
    densest: [f64; HEADS_M.len()],
}

/// Every pixel of the channel, seen from every head: its direction is that of `truth`, and what the node draws for it holds
/// that direction. `truth` is the point of the room that a place in the output lights. Pixels at whose place or beside which
/// nothing is lit may be dark; all others must not.
fn compare(
    displays: &Displays,
    plan: &OutputPlan,
    truth: &dyn Fn(f64, f64) -> Option<DVec3>,
) -> Found {
    let map = map_of(plan);
    assert_eq!(map.size_px, SIZE_PX);
    let mut found = Found {
        compared: 0,
        worst_px: 0.0,
        densest: [0.0; HEADS_M.len()],
    };
    for (head_m, densest) in HEADS_M.into_iter().zip(&mut found.densest) {
        let drawn = displays.view_point(&view(head_m));
        let eye_m = DVec3::from(head_m);
        for (x, y) in (0..SIZE_PX[1]).flat_map(|y| (0..SIZE_PX[0]).map(move |x| (x, y))) {
            let (middle_x, middle_y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
            let around = [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]
                .map(|[right, down]| truth(middle_x + right, middle_y + down));
            let lit = map.point_m(x, y);
            if around.iter().any(Option::is_none) {
                assert!(
                    lit.is_none() || around.iter().any(Option::is_some),
                    "({x}, {y}) lights what is off the screen"
                );
                continue;
            }
            let [here, right, left, down, up] =
                around.map(|point_m| (point_m.unwrap() - eye_m).normalize());
            let lit = lit.unwrap_or_else(|| panic!("({x}, {y}) is dark"));
            // The narrowest way to a neighbour is what a pixel spans.
            let pixel = [right, left, down, up].map(|beside| beside.distance(here));
            let pixel = pixel.into_iter().fold(f64::INFINITY, f64::min);
            let off_px = (lit - eye_m).normalize().distance(here) / pixel;
            found.worst_px = found.worst_px.max(off_px);
            *densest = densest.max(narrowest(right - left, down - up).recip());
            found.compared += 1;
            let part = drawn.warps[0]
                .iter()
                .find(|part| {
                    part.rect_px.x <= x
                        && x < part.rect_px.x + part.rect_px.width
                        && part.rect_px.y <= y
                        && y < part.rect_px.y + part.rect_px.height
                })
                .expect("a part for every pixel");
            assert!(part.eye_m.distance(eye_m) < 1e-6);
            let screen = &drawn.views[part.view].screen;
            // The view is 1 m wide per tangent: where the direction meets its plane, in metres from the lower left corner.
            let ahead = screen.up.cross(screen.right);
            let met =
                here * (screen.lower_left_m.dot(ahead) / here.dot(ahead)) - screen.lower_left_m;
            let place = [
                met.dot(screen.right) / screen.size_m[0],
                met.dot(screen.up) / screen.size_m[1],
            ];
            assert!(
                here.dot(ahead) > 0.0 && place.iter().all(|share| (0.0..=1.0).contains(share)),
                "({x}, {y}) is not in the picture that is drawn for it: {place:?}"
            );
        }
    }
    found
}

/// The narrowest radius in radians of a pixel that is an ellipse: the smaller singular value, by central differences over two
/// pixels to the right and two down.
fn narrowest(across: DVec3, along: DVec3) -> f64 {
    let (a, b, both) = (
        across.length_squared(),
        along.length_squared(),
        across.dot(along),
    );
    let least_squared = 0.5 * (a + b - ((a - b).powi(2) + 4.0 * both * both).sqrt());
    0.5 * least_squared.sqrt()
}

/// How dense the wall's pixels are is what detail follows: of calibrated channels neither less than the densest pixel, nor much
/// more, whatever their canvas has.
fn check_densities(what: &str, wall: &Wall, found: &Found) {
    let surfaces = super::super::surfaces(wall).unwrap();
    let is_calibrated = wall.hosts[0].outputs[0].channels[0].calibration.is_some();
    assert_eq!(surfaces.calibrated().len(), usize::from(is_calibrated));
    for (head_m, densest) in HEADS_M.into_iter().zip(found.densest) {
        let heads = view(head_m).viewers.heads;
        let said = surfaces.pixels_per_radian_from(wall, &heads);
        assert!(
            said > 0.995 * densest,
            "{what}: {said} pixels to a radian from {head_m:?}, but one pixel has {densest}"
        );
        assert!(
            said < 1.1 * densest || !is_calibrated,
            "{what}: {said} pixels to a radian from {head_m:?}, but no pixel has more than {densest}"
        );
    }
}

/// A file of a known projector, in a channel of a known screen: half of the pixels or more are compared, and none is off.
fn check(
    what: &str,
    screen: &str,
    shown: &Shown<'_>,
    folder: &Path,
    truth: &dyn Fn(f64, f64) -> Option<DVec3>,
) {
    let wall = wall(screen, shown, folder);
    let (displays, plan) = open(&wall);
    let found = compare(&displays, &plan, truth);
    let all = SIZE_PX[0] as usize * SIZE_PX[1] as usize * HEADS_M.len();
    assert!(
        found.compared * 2 > all,
        "{what}: only {} of {all} pixels are compared",
        found.compared
    );
    assert!(
        found.worst_px < MOST_PX,
        "{what}: off by {} pixels",
        found.worst_px
    );
    check_densities(what, &wall, &found);
    // A bar that any mistake of half a pixel would break: the same with a truth of half a pixel beside.
    let beside = compare(&displays, &plan, &|x, y| truth(x + 0.5, y));
    assert!(
        beside.worst_px > 0.4,
        "{what}: half a pixel beside is off by {} pixels only",
        beside.worst_px
    );
}

/// The point that a setting's projector lights at a place in pixels of the output.
fn lit(setting: &Setting) -> impl Fn(f64, f64) -> Option<DVec3> {
    let setting = *setting;
    move |x, y| {
        let [width, height] = SIZE_PX.map(f64::from);
        setting.lit_m([x / width, y / height])
    }
}
