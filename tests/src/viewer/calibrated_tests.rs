//! The viewer's eye before calibrated channels: what it sees is the light that a known warp puts on a cylinder.
//!
//! In: files of every kind of mapping for one warp, and pictures whose light is a function of the room. Out: verdicts.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use calibration::{
    Calibration, CanvasPlace, Frustum, Gamma, Grid, Mapping, Placement, PointOrigin, Region,
    Uplift, mpcdi,
};

use super::*;

/// Pixels of the output.
const SIZE_PX: [u32; 2] = [320, 200];
const HEAD_M: [f64; 3] = [0.2, 1.4, 0.3];
const RADIUS_M: f64 = 2.5;
/// A frustum from the head, level and straight ahead but for a turn to the right.
const YAW_DEG: f64 = 12.0;
const HALF_DEG: f64 = 60.0;

/// Where on the canvas a place of the output is shown: askew and bent.
fn warp([x, y]: [f64; 2]) -> [f64; 2] {
    [0.1 + 0.7 * x + 0.08 * x * y, 0.12 + 0.75 * y + 0.05 * x * x]
}

/// The point of the cylinder at shares of the canvas: azimuths −50…50°, heights 0.2…2.6 m.
fn on_cylinder([x, y]: [f64; 2]) -> DVec3 {
    let (sine, cosine) = (-50.0 + 100.0 * x).to_radians().sin_cos();
    DVec3::new(RADIUS_M * sine, 2.6 - 2.4 * y, -RADIUS_M * cosine)
}

/// The light at a point of the room.
fn light_at(point_m: DVec3) -> f64 {
    0.5 + 0.2 * (4.0 * point_m.x).sin() + 0.2 * (5.0 * point_m.y).cos()
}

fn grid<const N: usize>(at: impl Fn([f64; 2]) -> [f64; N]) -> Grid<[f32; N]> {
    // A sample for every other pixel.
    let [width, height] = SIZE_PX.map(|side| side / 2);
    let middle = |cell: u32, cells: u32| (f64::from(cell) + 0.5) / f64::from(cells);
    let places =
        (0..height).flat_map(|y| (0..width).map(move |x| [middle(x, width), middle(y, height)]));
    let values = places.map(|place| at(place).map(|value| value as f32));
    Grid::new(width, height, Placement::Centres, values.collect()).unwrap()
}

/// The same warp as each kind of mapping, and where its region lies on the canvas.
fn mappings() -> Vec<(Mapping, Option<CanvasPlace>)> {
    let from_head = |point_m: DVec3| point_m - DVec3::from(HEAD_M);
    let in_frustum = |place: [f64; 2]| {
        let [x, y, z] = from_head(on_cylinder(warp(place))).to_array();
        let (sine, cosine) = YAW_DEG.to_radians().sin_cos();
        let depth = x * sine - z * cosine;
        let edge = HALF_DEG.to_radians().tan();
        [
            0.5 + 0.5 * (x * cosine + z * sine) / depth / edge,
            0.5 - 0.5 * y / depth / edge,
        ]
    };
    let part = CanvasPlace {
        x: 0.05,
        y: 0.1,
        width: 0.9,
        height: 0.85,
        buffer: "wall".to_owned(),
        size_px: None,
    };
    let in_part = {
        let part = part.clone();
        move |place: [f64; 2]| {
            let [x, y] = warp(place);
            [(x - part.x) / part.width, (y - part.y) / part.height]
        }
    };
    let points = |from_m: DVec3, origin| Mapping::Points {
        points_m: grid(|place| (on_cylinder(warp(place)) - from_m).to_array()),
        origin,
        projector: None,
    };
    vec![
        (Mapping::Canvas(grid(warp)), None),
        (Mapping::Canvas(grid(in_part)), Some(part)),
        (
            Mapping::Frustum {
                frustum: Frustum {
                    yaw_deg: YAW_DEG,
                    pitch_deg: 0.0,
                    roll_deg: 0.0,
                    left_deg: -HALF_DEG,
                    right_deg: HALF_DEG,
                    up_deg: HALF_DEG,
                    down_deg: -HALF_DEG,
                },
                uv: grid(in_frustum),
            },
            None,
        ),
        (points(DVec3::ZERO, PointOrigin::FloorCentre), None),
        (
            points(DVec3::from(HEAD_M), PointOrigin::IdealEyePoint),
            None,
        ),
    ]
}

#[test]
fn light_of_calibrated_channels_is_seen_where_it_falls() {
    for (mapping, canvas) in mappings() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.mpcdi");
        let region = Region {
            name: "a".to_owned(),
            size_px: SIZE_PX,
            mapping,
            alpha: None,
            beta: None,
            gamma: Gamma::default(),
            uplift: Uplift::default(),
            canvas,
            distortion: None,
        };
        let written = Calibration {
            regions: vec![region],
            ..Calibration::default()
        };
        std::fs::write(&file, mpcdi::write(&written).unwrap()).unwrap();
        let text = format!(
            "[wall]\nname = \"test\"\nfps = 30\n[[observers]]\nname = \"viewer\"\nhead_m = {HEAD_M:?}\n\
             [[screens]]\nname = \"wall\"\nkind = \"cylinder\"\nobserver = \"viewer\"\nsize_px = [800, 400]\n\
             foot_m = [0.0, 0.0, 0.0]\nradius_m = {RADIUS_M:?}\nazimuth_deg = [-50.0, 50.0]\nheight_m = [0.2, 2.6]\n\
             [[hosts]]\nname = \"a\"\n[[hosts.outputs]]\nname = \"p\"\nsize_px = {SIZE_PX:?}\nheadless = true\n\
             channels = [{{ screen = \"wall\", canvas_px = [0, 0, 800, 400], size_px = {SIZE_PX:?}, \
             calibration = {{ file = {file:?} }} }}]\n"
        );
        let wall = Wall::parse(&text, "test").unwrap();
        let picture = RgbImage::from_fn(SIZE_PX[0], SIZE_PX[1], |x, y| {
            let share = |pixel: u32, of: u32| (f64::from(pixel) + 0.5) / f64::from(of);
            let place = [share(x, SIZE_PX[0]), share(y, SIZE_PX[1])];
            encoded(DVec3::splat(light_at(on_cylinder(warp(place)))))
        });
        picture.save(folder.path().join("a-p.png")).unwrap();
        let room = Room::load(&wall, folder.path());
        for eye_m in [HEAD_M, [-0.8, 1.1, 0.9], [0.6, 1.8, -0.7]] {
            let camera = Camera::new(DVec3::from(eye_m), 5.0, -2.0, 60.0, [60, 40]);
            let seen = room.seen(&camera, Eye::Left, 1);
            let mut compared = 0;
            for (x, y, pixel) in seen.picture.enumerate_pixels() {
                if !seen.complete[(y * 60 + x) as usize] {
                    continue;
                }
                compared += 1;
                // Onto the cylinder about the room's y axis, by hand.
                let along = camera.direction([f64::from(x) + 0.5, f64::from(y) + 0.5]);
                let [ox, _, oz] = eye_m;
                let square = along.x * along.x + along.z * along.z;
                let half = ox * along.x + oz * along.z;
                let rest = ox * ox + oz * oz - RADIUS_M * RADIUS_M;
                let far = (-half + (half * half - square * rest).sqrt()) / square;
                let light = light_at(DVec3::from(eye_m) + along * far);
                let value = flip::to_value(light) * 255.0;
                let off = (f64::from(pixel.0[1]) - value).abs();
                assert!(
                    off < 2.0,
                    "{:?} from {eye_m:?}: ({x}, {y}) is {pixel:?}, not {value}",
                    written.regions[0].mapping.name()
                );
            }
            assert!(compared > 1000, "{compared} pixels are seen");
        }
    }
}

/// A name for what a test says.
trait Named {
    fn name(&self) -> &'static str;
}

impl Named for Mapping {
    fn name(&self) -> &'static str {
        match self {
            Self::Canvas(_) => "places on a canvas",
            Self::Frustum { .. } => "places in a frustum",
            Self::Points { .. } => "points",
            Self::Identity => "nothing",
        }
    }
}
