//! Channels by meshes and by VIOSO's files, and screens that are given by points.
//! In: files of a known projector, or of a known surface. Out: verdicts.

use std::path::Path;

use glam::DVec3;

use super::files;
use super::geometry::{CANVAS_PX, HEAD_M, SETTINGS, SIZE_PX, Setting, Surface, in_frustum};
use super::{Shown, WHOLE_PX, check, lit, open, wall};

/// Nodes of meshes: a cell is two pixels large.
const NODES: [u32; 2] = [49, 37];

/// Checks a channel that shows the whole canvas by a file.
fn check_file(setting: &Setting, name: &str, bytes: &[u8], keys: &str) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), bytes).unwrap();
    let shown = Shown {
        canvas_px: WHOLE_PX,
        keys,
    };
    let what = format!("{name} on {:?}", setting.surface);
    let screen = setting.surface.screen();
    check(&what, &screen, &shown, folder.path(), &lit(setting));
}

/// Where on the canvas the projector's place lies, right and down; it goes on beyond the canvas.
fn shares(setting: &Setting, place: [f64; 2]) -> [f64; 2] {
    setting.surface.shares(setting.ideal_m(place).unwrap())
}

/// Places or points at the middles of the output's pixels.
fn at_pixels<T>(at: impl Fn([f64; 2]) -> T) -> Vec<T> {
    let [width, height] = SIZE_PX;
    let middle = |pixel: u32, of: u32| (f64::from(pixel) + 0.5) / f64::from(of);
    (0..height)
        .flat_map(|y| (0..width).map(move |x| [middle(x, width), middle(y, height)]))
        .map(at)
        .collect()
}

#[test]
fn meshes_of_domeprojection_bourke_and_obj_are_places_on_the_canvas() {
    for setting in SETTINGS {
        let text = files::domeprojection(NODES, |place| shares(&setting, place));
        let keys = Shown::calibrated("a.csv");
        check_file(&setting, "a.csv", text.as_bytes(), &keys);
        let aspect = f64::from(SIZE_PX[0]) / f64::from(SIZE_PX[1]);
        let text = files::bourke(NODES, aspect, |place| (shares(&setting, place), 1.0));
        let keys = Shown::calibrated("a.data");
        check_file(&setting, "a.data", text.as_bytes(), &keys);
        // As a warp, v is a place on the output, −1…1 to the right and up.
        let text = files::obj(NODES, |place| {
            let [u, v] = shares(&setting, place);
            let position = [2.0 * place[0] - 1.0, 1.0 - 2.0 * place[1], 0.0];
            (position, [u, 1.0 - v])
        });
        let keys = Shown::calibrated("a.obj");
        check_file(&setting, "a.obj", text.as_bytes(), &keys);
    }
}

#[test]
fn points_of_a_pfm_and_of_an_obj_are_points_of_the_room() {
    for setting in SETTINGS {
        let points = at_pixels(|place| {
            setting
                .lit_m(place)
                .map_or([f32::NAN; 3], |point_m| point_m.as_vec3().to_array())
        });
        let keys = Shown::calibrated("a.pfm");
        check_file(&setting, "a.pfm", &files::pfm(SIZE_PX[0], &points), &keys);
        // vt is the place on the output, to the right and up. The mesh goes on beyond the canvas.
        let text = files::obj(NODES, |place| {
            let point_m = setting.ideal_m(place).unwrap();
            (point_m.to_array(), [place[0], 1.0 - place[1]])
        });
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.obj"), text).unwrap();
        let keys = Shown::calibrated("a.obj");
        let shown = Shown {
            canvas_px: WHOLE_PX,
            keys: &keys,
        };
        let [width, height] = SIZE_PX.map(f64::from);
        let truth = |x: f64, y: f64| setting.ideal_m([x / width, y / height]);
        let screen = setting.surface.screen();
        check("a.obj of points", &screen, &shown, folder.path(), &truth);
    }
}

#[test]
fn files_of_vioso_hold_places_or_points() {
    /// `FLAG_WARPFILE_HEADER_3D`.
    const POINTS: u32 = 0x40;
    for setting in SETTINGS {
        let places = at_pixels(|place| {
            let [u, v] = shares(&setting, place).map(|share| share as f32);
            [u, v, 1.0, 0.0]
        });
        let points = at_pixels(|place| match setting.lit_m(place) {
            Some(point_m) => point_m.as_vec3().extend(1.0).to_array(),
            None => [0.0; 4],
        });
        let blocks = [
            files::vwf("flat", 0, [1.0; 3], SIZE_PX, &places),
            files::vwf("deep", POINTS, [1.0; 3], SIZE_PX, &points),
        ];
        let set = files::vwf_set(&blocks);
        for region in ["flat", "deep", "1"] {
            let keys = format!("calibration = {{ file = \"a.vwf\", region = \"{region}\" }}\n");
            check_file(&setting, "a.vwf", &set, &keys);
        }
    }
}

/// A channel by a file: the light of its pixels.
fn light_of(name: &str, bytes: &[u8]) -> std::sync::Arc<render::LightMap> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), bytes).unwrap();
    let keys = Shown::calibrated(name);
    let shown = Shown {
        canvas_px: WHOLE_PX,
        keys: &keys,
    };
    let wall = wall(&Surface::Plane.screen(), &shown, folder.path());
    let (_, plan) = open(&wall);
    plan.channels[0].light.clone().expect("light")
}

/// Blend and black pictures of a VIOSO file: light is their value, whose gamma it does not tell; black is scaled by the
/// header's first factor and lifted by the others (`VIOSOWarpBlend/VWF.h`, `FLAG_WARPFILE_HEADER_BLACKLEVEL_CORR`).
#[test]
fn light_of_vioso_reaches_the_plan() {
    const BLACK_LEVEL: u32 = 0x20;
    let setting = SETTINGS[0];
    let places = at_pixels(|place| {
        let [u, v] = shares(&setting, place).map(|share| share as f32);
        [u, v, 1.0, 0.0]
    });
    let count = SIZE_PX[0] * SIZE_PX[1];
    let greys: Vec<u8> = (0..count).map(|index| (index % 251) as u8).collect();
    let blacks: Vec<u8> = (0..count).map(|index| (index % 97) as u8).collect();
    let mut bytes = files::vwf("a", BLACK_LEVEL, [0.5, 0.75, 0.25], SIZE_PX, &places);
    bytes.extend(files::bitmap(SIZE_PX, &greys));
    bytes.extend(files::bitmap(SIZE_PX, &blacks));
    let light = light_of("a.vwf", &bytes);
    assert_eq!((light.uplift.dark, light.uplift.bright), (0.75, 0.25));
    for (index, (alpha, beta)) in light.alpha.iter().zip(&light.beta).enumerate() {
        let wanted = [
            f32::from(greys[index]) / 255.0,
            f32::from(blacks[index]) / 255.0 * 0.5,
        ];
        assert!((alpha[0] - wanted[0]).abs() < 1e-5, "{index}: {alpha:?}");
        assert!((beta[2] - wanted[1]).abs() < 1e-5, "{index}: {beta:?}");
    }
}

/// The fifth number of a node of Bourke's mesh multiplies the light; between nodes it is linear.
#[test]
fn light_of_bourkes_mesh_reaches_the_plan() {
    let setting = SETTINGS[0];
    let aspect = f64::from(SIZE_PX[0]) / f64::from(SIZE_PX[1]);
    let falling = |place: [f64; 2]| 1.0 - 0.8 * place[0];
    let text = files::bourke(NODES, aspect, |place| {
        (shares(&setting, place), falling(place))
    });
    let light = light_of("a.data", text.as_bytes());
    for (found, wanted) in light.alpha.iter().zip(at_pixels(falling)) {
        assert!((f64::from(found[1]) - wanted).abs() < 1e-4, "{found:?}");
    }
    assert!(light.beta.is_empty());
}

/// Writes the points of a setting's surface over its canvas in millimetres, as an OBJ and as a PFM. Returns the screens.
fn surfaces(surface: Surface, folder: &Path) -> [String; 2] {
    let in_mm = |place: [f64; 2]| surface.point_m(place) * 1000.0;
    let text = files::obj([257, 65], |place| {
        (in_mm(place).to_array(), [place[0], 1.0 - place[1]])
    });
    std::fs::write(folder.join("screen.obj"), text).unwrap();
    let middle = |cell: u32, cells: u32| (f64::from(cell) + 0.5) / f64::from(cells);
    let cells =
        (0..64_u32).flat_map(|y| (0..256_u32).map(move |x| [middle(x, 256), middle(y, 64)]));
    let points: Vec<[f32; 3]> = cells
        .map(|place| in_mm(place).as_vec3().to_array())
        .collect();
    std::fs::write(folder.join("screen.pfm"), files::pfm(256, &points)).unwrap();
    ["screen.obj", "screen.pfm"]
        .map(|file| format!("kind = \"surface\"\nfile = \"{file}\"\nunit_m = 0.001"))
}

#[test]
fn a_channel_on_a_surface_by_points_shows_its_part_of_the_canvas() {
    let [x, y] = [300, 250];
    for Setting { surface, .. } in SETTINGS {
        let folder = tempfile::tempdir().unwrap();
        for screen in surfaces(surface, folder.path()) {
            let shown = Shown {
                canvas_px: [x, y, SIZE_PX[0], SIZE_PX[1]],
                keys: "",
            };
            let [width, height] = CANVAS_PX.map(f64::from);
            let truth = |x_px: f64, y_px: f64| {
                Some(surface.point_m([
                    (f64::from(x) + x_px) / width,
                    (f64::from(y) + y_px) / height,
                ]))
            };
            check(&screen, &screen, &shown, folder.path(), &truth);
        }
    }
}

#[test]
fn a_calibrated_channel_on_a_surface_by_points_lights_its_points() {
    let frustum = calibration::Frustum {
        left_deg: -60.0,
        right_deg: 60.0,
        up_deg: 50.0,
        down_deg: -50.0,
        ..calibration::Frustum::default()
    };
    for setting in SETTINGS {
        let folder = tempfile::tempdir().unwrap();
        let mapping = |is_in_frustum: bool| {
            let places = at_pixels(|place| {
                let point_m = setting.ideal_m(place).unwrap();
                let place = if is_in_frustum {
                    in_frustum(&frustum, point_m - DVec3::from(HEAD_M))
                } else {
                    setting.surface.shares(point_m)
                };
                place.map(|share| share as f32)
            });
            let [width, height] = SIZE_PX;
            let uv = calibration::Grid::new(width, height, calibration::Placement::Centres, places);
            let uv = uv.unwrap();
            if is_in_frustum {
                calibration::Mapping::Frustum { frustum, uv }
            } else {
                calibration::Mapping::Canvas(uv)
            }
        };
        for screen in surfaces(setting.surface, folder.path()) {
            for is_in_frustum in [false, true] {
                super::archives::write_mapping(folder.path(), mapping(is_in_frustum));
                let keys = Shown::calibrated("a.mpcdi");
                let shown = Shown {
                    canvas_px: WHOLE_PX,
                    keys: &keys,
                };
                check(&screen, &screen, &shown, folder.path(), &lit(&setting));
            }
        }
    }
}
