//! A wall that stands nowhere: two projectors on a cylinder, the left one calibrated by points of the room, the right one by
//! places on the canvas.
//!
//! In: a folder. Out: a wall file, and the archives that it names. Both mappings follow the head.

use std::path::Path;

use calibration::{
    Calibration, Gamma, Grid, Map, Mapping, Placement, PointOrigin, Region, Texels, Uplift, mpcdi,
};
use toml::Table;

/// Pixels of a projector.
const SIZE_PX: [u32; 2] = [640, 480];
const RADIUS_M: f64 = 2.6;
/// Azimuths of the canvas in degrees, and its heights in metres.
const AZIMUTH_DEG: [f64; 2] = [-55.0, 55.0];
const HEIGHT_M: [f64; 2] = [0.3, 2.7];
/// Where on the canvas both projectors shine, as shares of its width.
const OVERLAP: [f64; 2] = [0.42, 0.58];
/// How values of the maps of light become light.
const GAMMA: f32 = 1.8;

/// Writes the archives into a folder. Returns the wall, which names them by their whole paths.
///
/// # Panics
/// If the folder cannot be written to.
#[must_use]
pub fn calibrated_cylinder(folder: &Path) -> Table {
    let mut channels = Vec::new();
    for is_right in [false, true] {
        let name = if is_right { "right" } else { "left" };
        let file = folder.join(format!("{name}.mpcdi"));
        let written = Calibration {
            regions: vec![region(name, is_right)],
            ..Calibration::default()
        };
        let bytes = mpcdi::write(&written).expect("an archive");
        std::fs::write(&file, bytes).expect("a folder to write to");
        channels.push(format!(
            "[[hosts.outputs]]\nname = \"{name}\"\nsize_px = {SIZE_PX:?}\nheadless = true\ngamma = 2.2\n\
             [[hosts.outputs.channels]]\nscreen = \"cylinder\"\ncanvas_px = [0, 0, 1000, 480]\nsize_px = {SIZE_PX:?}\n\
             calibration = {{ file = {file:?} }}\n"
        ));
    }
    let text = format!(
        "[wall]\nname = \"calibrated-cylinder\"\nfps = 60\n[[observers]]\nname = \"viewer\"\nhead_m = [0.0, 1.6, 0.0]\n\
         [[screens]]\nname = \"cylinder\"\nkind = \"cylinder\"\nobserver = \"viewer\"\nsize_px = [1000, 480]\n\
         foot_m = [0.0, 0.0, 0.0]\nradius_m = {RADIUS_M:?}\nazimuth_deg = {AZIMUTH_DEG:?}\nheight_m = {HEIGHT_M:?}\n\
         [[hosts]]\nname = \"projection\"\n{}",
        channels.concat()
    );
    text.parse().expect("a wall file")
}

/// Where on the canvas a place of a projector's picture is shown. Both stand askew, so that rows rise and columns lean.
fn on_canvas(is_right: bool, [x, y]: [f64; 2]) -> [f64; 2] {
    let [first, last] = if is_right {
        [OVERLAP[0] - 0.03, 1.02]
    } else {
        [-0.02, OVERLAP[1] + 0.03]
    };
    let lean = if is_right { 0.02 } else { -0.02 };
    [
        first + (last - first) * x + lean * (y - 0.5),
        -0.04 + 1.08 * y + 0.03 * (x - 0.5) * (y - 0.5) + lean * (x - 0.5),
    ]
}

/// The share of light that a projector gives at a share of the canvas's width: both add up to all of it.
fn share(is_right: bool, x: f64) -> f64 {
    let [first, last] = OVERLAP;
    let right = ((x - first) / (last - first)).clamp(0.0, 1.0);
    if is_right { right } else { 1.0 - right }
}

fn region(name: &str, is_right: bool) -> Region {
    let [width, height] = SIZE_PX;
    let middle = |cell: u32, cells: u32| (f64::from(cell) + 0.5) / f64::from(cells);
    let places =
        || (0..height).flat_map(|y| (0..width).map(move |x| [middle(x, width), middle(y, height)]));
    let shares = || places().map(|place| on_canvas(is_right, place));
    let mapping = if is_right {
        let uv = shares().map(|place| place.map(|share| share as f32));
        let uv = Grid::new(width, height, Placement::Centres, uv.collect());
        Mapping::Canvas(uv.expect("a grid"))
    } else {
        let points_m = shares().map(|[x, y]| {
            let azimuth_deg = AZIMUTH_DEG[0] + (AZIMUTH_DEG[1] - AZIMUTH_DEG[0]) * x;
            let (sine, cosine) = azimuth_deg.to_radians().sin_cos();
            let height_m = HEIGHT_M[1] + (HEIGHT_M[0] - HEIGHT_M[1]) * y;
            [RADIUS_M * sine, height_m, -RADIUS_M * cosine].map(|value| value as f32)
        });
        let points_m = Grid::new(width, height, Placement::Centres, points_m.collect());
        Mapping::Points {
            points_m: points_m.expect("a grid"),
            origin: PointOrigin::FloorCentre,
            projector: None,
        }
    };
    let alpha = shares().map(|[x, _]| share(is_right, x).powf(1.0 / f64::from(GAMMA)) as f32);
    Region {
        name: name.to_owned(),
        size_px: SIZE_PX,
        mapping,
        alpha: Map::new(width, height, Texels::Grey(alpha.collect())),
        beta: None,
        gamma: Gamma {
            alpha: GAMMA,
            beta: 1.0,
        },
        uplift: Uplift::default(),
        canvas: None,
        distortion: None,
    }
}
