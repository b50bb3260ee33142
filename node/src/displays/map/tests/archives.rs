//! Channels by MPCDI archives of every profile.
//! In: archives of a known projector. Out: verdicts. Places and points stand in the files as the geometry says them.

use std::path::Path;

use calibration::{
    Axes, Calibration, CanvasPlace, Frustum, Gamma, Grid, Mapping, Placement, PointOrigin,
    Projector, Region, Uplift, mpcdi,
};
use glam::DVec3;

use super::geometry::{CANVAS_PX, HEAD_M, SETTINGS, SIZE_PX, Setting, Surface, in_frustum};
use super::{Shown, WHOLE_PX, check, lit, open, wall};

/// A frustum from the head that holds all that the projector lights.
const FRUSTUM: Frustum = Frustum {
    yaw_deg: 8.0,
    pitch_deg: -6.0,
    roll_deg: 11.0,
    left_deg: -48.0,
    right_deg: 52.0,
    up_deg: 41.0,
    down_deg: -44.0,
};

/// A region that is mapped so.
fn region(mapping: Mapping) -> Region {
    Region {
        name: "left".to_owned(),
        size_px: SIZE_PX,
        mapping,
        alpha: None,
        beta: None,
        gamma: Gamma::default(),
        uplift: Uplift::default(),
        canvas: None,
        distortion: None,
    }
}

/// Samples at the middles of so many cells, by shares of the picture.
fn grid<const N: usize>(
    [width, height]: [u32; 2],
    at: impl Fn([f64; 2]) -> Option<[f64; N]>,
) -> Vec<[f32; N]> {
    let middle = |cell: u32, cells: u32| (f64::from(cell) + 0.5) / f64::from(cells);
    (0..height)
        .flat_map(|y| (0..width).map(move |x| [middle(x, width), middle(y, height)]))
        .map(|place| at(place).map_or([f32::NAN; N], |values| values.map(|value| value as f32)))
        .collect()
}

fn uv(size: [u32; 2], at: impl Fn([f64; 2]) -> Option<[f64; 2]>) -> Grid<[f32; 2]> {
    Grid::new(size[0], size[1], Placement::Centres, grid(size, at)).unwrap()
}

fn points(size: [u32; 2], at: impl Fn([f64; 2]) -> Option<[f64; 3]>) -> Grid<[f32; 3]> {
    Grid::new(size[0], size[1], Placement::Centres, grid(size, at)).unwrap()
}

/// Writes an archive of one region.
fn write(folder: &Path, region: Region) {
    let written = Calibration {
        regions: vec![region],
        ..Calibration::default()
    };
    std::fs::write(folder.join("a.mpcdi"), mpcdi::write(&written).unwrap()).unwrap();
}

/// Writes an archive of one region that is mapped so, and has nothing else.
pub(super) fn write_mapping(folder: &Path, mapping: Mapping) {
    write(folder, region(mapping));
}

/// Writes an archive and checks a channel that shows the whole canvas by it.
fn check_region(what: &str, setting: &Setting, region: Region) {
    check_region_by(what, setting, region, &lit(setting));
}

/// The same with another truth.
fn check_region_by(
    what: &str,
    setting: &Setting,
    region: Region,
    truth: &dyn Fn(f64, f64) -> Option<DVec3>,
) {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), region);
    let keys = Shown::calibrated("a.mpcdi");
    let shown = Shown {
        canvas_px: WHOLE_PX,
        keys: &keys,
    };
    let what = format!("{what} on {:?}", setting.surface);
    let screen = setting.surface.screen();
    check(&what, &screen, &shown, folder.path(), truth);
}

#[test]
fn places_on_a_canvas_are_those_of_its_screen() {
    for setting in SETTINGS {
        // Every pixel has its sample, and every other one.
        for size in [SIZE_PX, [48, 36]] {
            let places = uv(size, |place| {
                Some(setting.surface.shares(setting.ideal_m(place)?))
            });
            check_region("2d", &setting, region(Mapping::Canvas(places)));
        }
    }
}

#[test]
fn a_region_lies_where_its_archive_says_on_the_channels_part_of_the_canvas() {
    let place = CanvasPlace {
        x: 0.15,
        y: 0.1,
        width: 0.8,
        height: 0.75,
        buffer: "wall".to_owned(),
        size_px: None,
    };
    let part_px = [60, 20, 400, 330];
    for setting in SETTINGS {
        let folder = tempfile::tempdir().unwrap();
        // From shares of the canvas to those of the region, which lies on the channel's part.
        let own = |shares: [f64; 2]| {
            let on_part = [0, 1].map(|axis| {
                (shares[axis] * f64::from(CANVAS_PX[axis]) - f64::from(part_px[axis]))
                    / f64::from(part_px[axis + 2])
            });
            [
                (on_part[0] - place.x) / place.width,
                (on_part[1] - place.y) / place.height,
            ]
        };
        let places = uv(SIZE_PX, |at| {
            Some(own(setting.surface.shares(setting.ideal_m(at)?)))
        });
        let mut region = region(Mapping::Canvas(places));
        region.canvas = Some(place.clone());
        write(folder.path(), region);
        let keys = "calibration = { file = \"a.mpcdi\", region = \"left\" }\n";
        let shown = Shown {
            canvas_px: part_px,
            keys,
        };
        let truth = lit(&setting);
        let in_region = move |x: f64, y: f64| {
            let point_m = truth(x, y)?;
            let own = own(setting.surface.shares(point_m));
            own.iter()
                .all(|share| (0.0..=1.0).contains(share))
                .then_some(point_m)
        };
        check(
            "2d region",
            &setting.surface.screen(),
            &shown,
            folder.path(),
            &in_region,
        );
    }
}

#[test]
fn places_in_a_frustum_are_seen_on_the_screen_from_the_head_it_is_made_for() {
    for setting in SETTINGS {
        let places = uv(SIZE_PX, |place| {
            let from_head = setting.ideal_m(place)? - DVec3::from(HEAD_M);
            Some(in_frustum(&FRUSTUM, from_head))
        });
        let mapping = Mapping::Frustum {
            frustum: FRUSTUM,
            uv: places,
        };
        check_region("3d", &setting, region(mapping));
    }
}

#[test]
fn points_count_from_where_their_archive_says() {
    for setting in SETTINGS {
        for (origin, from_m) in [
            (PointOrigin::FloorCentre, DVec3::ZERO),
            (PointOrigin::Unknown, DVec3::ZERO),
            (PointOrigin::IdealEyePoint, DVec3::from(HEAD_M)),
        ] {
            // Points go on where the screen, as the wall file has it, does not.
            let points_m = points([48, 36], |place| {
                let point_m = setting.ideal_m(place)? - from_m;
                Some(point_m.to_array())
            });
            let mapping = Mapping::Points {
                points_m,
                origin,
                projector: None,
            };
            let [width, height] = SIZE_PX.map(f64::from);
            let truth = |x: f64, y: f64| setting.ideal_m([x / width, y / height]);
            check_region_by(&format!("a3 {origin:?}"), &setting, region(mapping), &truth);
        }
    }
}

#[test]
fn points_of_projectors_in_other_axes_are_turned_and_lenses_are_undone() {
    // A surveyor's axes: x to the right, y ahead, z up (tvaneerd/mpcdi, `MPCDI_explained.md`).
    let axes = Axes {
        yaw: [0.0, 0.0, -1.0],
        pitch: [1.0, 0.0, 0.0],
        roll: [0.0, 1.0, 0.0],
    };
    for (setting, lens) in SETTINGS.into_iter().zip([0.12, -0.1]) {
        let setting = Setting { lens, ..setting };
        let mapping = Mapping::Points {
            // What an ideal projector lights: its lens is told apart.
            points_m: points([96, 72], |place| Some(setting.ideal_m(place)?.to_array())),
            origin: PointOrigin::FloorCentre,
            projector: Some(Box::new(Projector {
                position_m: [-0.5, 2.4, 0.7],
                frustum: FRUSTUM,
                axes,
            })),
        };
        let mut region = region(mapping);
        region.distortion = Some(uv(SIZE_PX, |place| Some(setting.through_lens(place))));
        let [width, height] = SIZE_PX.map(f64::from);
        // Beyond the ideal picture the archive knows no points.
        let truth = move |x: f64, y: f64| {
            let ideal = setting.through_lens([x / width, y / height]);
            let is_in = ideal.iter().all(|share| (0.0..=1.0).contains(share));
            is_in.then(|| setting.ideal_m(ideal)).flatten()
        };
        check_region_by("sl", &setting, region, &truth);
    }
}

#[test]
fn a_channel_may_have_another_size_than_its_region_but_not_another_shape() {
    let setting = SETTINGS[0];
    let mut larger = region(Mapping::Canvas(uv([192, 144], |place| {
        Some(setting.surface.shares(setting.ideal_m(place)?))
    })));
    larger.size_px = [192, 144];
    check_region("a region of twice the size", &setting, larger.clone());
    larger.size_px = [192, 120];
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), larger);
    let keys = Shown::calibrated("a.mpcdi");
    let shown = Shown {
        canvas_px: WHOLE_PX,
        keys: &keys,
    };
    let wall = wall(&setting.surface.screen(), &shown, folder.path());
    let refused = super::super::super::surfaces(&wall).unwrap_err();
    assert!(
        refused.to_string().contains("size_px = [192, 120]"),
        "{refused}"
    );
}

#[test]
fn points_from_a_centre_of_mass_are_refused() {
    let setting = SETTINGS[0];
    let mapping = Mapping::Points {
        points_m: points([48, 36], |place| Some(setting.lit_m(place)?.to_array())),
        origin: PointOrigin::CentreOfMass,
        projector: None,
    };
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), region(mapping));
    let keys = Shown::calibrated("a.mpcdi");
    let shown = Shown {
        canvas_px: WHOLE_PX,
        keys: &keys,
    };
    let wall = wall(&Surface::Plane.screen(), &shown, folder.path());
    let refused = super::super::super::surfaces(&wall).unwrap_err();
    assert!(refused.to_string().contains("centre of mass"), "{refused}");
}

/// Alpha, beta and their gammas reach the plan: light = value ^ `gammaEmbedded`.
#[test]
fn light_of_an_archive_reaches_the_plan() {
    use calibration::{Map, Texels};
    let setting = SETTINGS[0];
    let [width, height] = SIZE_PX;
    let count = width * height;
    let share = |index: u32| f64::from(index) / f64::from(count - 1);
    let texels = |scale: f64| {
        Texels::Grey(
            (0..count)
                .map(|index| (share(index) * scale) as f32)
                .collect(),
        )
    };
    let mut region = region(Mapping::Canvas(uv(SIZE_PX, |place| {
        Some(setting.surface.shares(setting.ideal_m(place)?))
    })));
    region.alpha = Map::new(width, height, texels(1.0));
    region.beta = Map::new(width, height, texels(0.25));
    region.gamma = Gamma {
        alpha: 2.2,
        beta: 1.4,
    };
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), region);
    let keys = Shown::calibrated("a.mpcdi");
    let shown = Shown {
        canvas_px: WHOLE_PX,
        keys: &keys,
    };
    let wall = wall(&setting.surface.screen(), &shown, folder.path());
    let (_, plan) = open(&wall);
    let light = plan.channels[0].light.as_ref().expect("light");
    assert_eq!((light.uplift.dark, light.uplift.bright), (1.0, 1.0));
    for (index, (alpha, beta)) in (0..count).zip(light.alpha.iter().zip(&light.beta)) {
        let wanted = [share(index).powf(2.2), (share(index) * 0.25).powf(1.4)];
        for part in 0..3 {
            let found = [alpha[part], beta[part]].map(f64::from);
            // Maps have 16 bits.
            assert!((found[0] - wanted[0]).abs() < 5e-5, "{index}: {found:?}");
            assert!((found[1] - wanted[1]).abs() < 5e-5, "{index}: {found:?}");
        }
    }
}
