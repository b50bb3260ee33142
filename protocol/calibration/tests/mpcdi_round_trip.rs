//! MPCDI archives: round trips of every profile through our own writer, and what it refuses to write.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod support;

use calibration::{
    Axes, Calibration, CanvasPlace, Choice, Frustum, Gamma, Grid, Map, Mapping, Options, Placement,
    PointOrigin, Projector, Region, Texels, Uplift, mpcdi, read,
};
use support::read_as;

fn region(name: &str, mapping: Mapping) -> Region {
    Region {
        name: name.to_owned(),
        size_px: [4, 2],
        mapping,
        alpha: Some(
            Map::new(
                4,
                2,
                Texels::Grey(vec![0.0, 0.2, 0.4, 1.0, 1.0, 0.6, 0.8, 0.0]),
            )
            .unwrap(),
        ),
        beta: Some(Map::new(4, 2, Texels::Colour(vec![[1.0, 0.0, 12345.0 / 65535.0]; 8])).unwrap()),
        gamma: Gamma {
            alpha: 2.2,
            beta: 0.45,
        },
        uplift: Uplift::default(),
        canvas: Some(CanvasPlace {
            x: 0.25,
            y: 0.5,
            width: 0.5,
            height: 0.125,
            buffer: "main <\"&'>".to_owned(),
            size_px: Some([20_000, 3000]),
        }),
        distortion: None,
    }
}

/// Places that survive being turned upside down without rounding, with a hole.
fn places() -> Grid<[f32; 2]> {
    let mut values: Vec<[f32; 2]> = (0..15_u8)
        .map(|index| [f32::from(index) / 16.0, f32::from(index % 5) / 8.0])
        .collect();
    values[7] = [f32::NAN; 2];
    Grid::new(5, 3, Placement::Centres, values).unwrap()
}

fn points() -> Grid<[f32; 3]> {
    let mut values: Vec<[f32; 3]> = (0..8_u8)
        .map(|index| [f32::from(index) * 0.3, 1.7 - f32::from(index), -2.4])
        .collect();
    values[3] = [f32::NAN; 3];
    Grid::new(4, 2, Placement::Centres, values).unwrap()
}

const EDGES: Frustum = Frustum {
    yaw_deg: -54.649_008_076_582_3,
    pitch_deg: 30.086_445,
    roll_deg: -35.25,
    left_deg: -26.5,
    right_deg: 26.4,
    up_deg: 20.5,
    down_deg: -20.6,
};

fn round_trip(regions: Vec<Region>) -> Calibration {
    let written = Calibration {
        regions,
        date: "2026-11-23 & later".to_owned(),
        notes: vec![],
    };
    let bytes = mpcdi::write(&written).unwrap();
    assert_eq!(
        bytes,
        mpcdi::write(&written).unwrap(),
        "the same calibration makes the same bytes"
    );
    let found = read_as(&bytes, "a.mpcdi").unwrap();
    assert_eq!(found.date, written.date);
    assert!(found.notes.is_empty(), "{:?}", found.notes);
    assert_eq!(found.regions.len(), written.regions.len());
    for (found, written) in found.regions.iter().zip(&written.regions) {
        assert_eq!(
            (&found.name, found.size_px),
            (&written.name, written.size_px)
        );
        assert_eq!(found.alpha, written.alpha);
        assert_eq!(found.beta, written.beta);
        assert_eq!(found.gamma, written.gamma);
        assert_eq!(found.canvas, written.canvas);
    }
    found
}

#[test]
fn canvases_come_back_as_they_were() {
    let mut second = region("right & \"low\"", Mapping::Canvas(places()));
    second.canvas.as_mut().unwrap().buffer = "other".to_owned();
    let found = round_trip(vec![region("left", Mapping::Canvas(places())), second]);
    for region in &found.regions {
        let Mapping::Canvas(uv) = &region.mapping else {
            panic!("a canvas is due")
        };
        assert!(support::same(&uv.values, &places().values));
    }
}

#[test]
fn frusta_come_back_as_they_were() {
    let mapping = Mapping::Frustum {
        frustum: EDGES,
        uv: places(),
    };
    let found = round_trip(vec![region("a", mapping)]);
    let Mapping::Frustum { frustum, uv } = &found.regions[0].mapping else {
        panic!("a frustum is due")
    };
    assert_eq!(*frustum, EDGES);
    assert!(support::same(&uv.values, &places().values));
}

#[test]
fn points_come_back_as_they_were() {
    for origin in [
        PointOrigin::CentreOfMass,
        PointOrigin::IdealEyePoint,
        PointOrigin::FloorCentre,
    ] {
        let mapping = Mapping::Points {
            points_m: points(),
            origin,
            projector: None,
        };
        let found = round_trip(vec![region("a", mapping)]);
        let Mapping::Points {
            points_m,
            origin: told,
            projector: None,
        } = &found.regions[0].mapping
        else {
            panic!()
        };
        assert_eq!(*told, origin);
        assert!(support::same(&points_m.values, &points().values));
    }
}

#[test]
fn shader_lamps_come_back_as_they_were_in_any_axes() {
    let surveyor = Axes {
        yaw: [0.0, 0.0, -1.0],
        pitch: [1.0, 0.0, 0.0],
        roll: [0.0, 1.0, 0.0],
    };
    for axes in [Axes::ROOM, surveyor] {
        let projector = Projector {
            position_m: [0.5, 2.25, -1.125],
            frustum: EDGES,
            axes,
        };
        let mapping = Mapping::Points {
            points_m: points(),
            origin: PointOrigin::FloorCentre,
            projector: Some(Box::new(projector.clone())),
        };
        let mut lamp = region("a", mapping);
        lamp.distortion = Some(places());
        let found = round_trip(vec![lamp]);
        let Mapping::Points {
            points_m,
            projector: Some(told),
            ..
        } = &found.regions[0].mapping
        else {
            panic!()
        };
        assert_eq!(**told, projector);
        assert!(support::same(&points_m.values, &points().values));
        assert!(support::same(
            &found.regions[0].distortion.as_ref().unwrap().values,
            &places().values
        ));
    }
}

#[test]
fn the_even_mapping_and_meshes_become_places_of_pixels() {
    let corners = vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
    let mesh = Grid::new(2, 2, Placement::Corners, corners).unwrap();
    let mut plain = region("b", Mapping::Identity);
    plain.alpha = None;
    plain.beta = None;
    plain.canvas = None;
    plain.gamma = Gamma::default();
    let calibration = Calibration {
        regions: vec![plain, region("c", Mapping::Canvas(mesh))],
        ..Calibration::default()
    };
    let found = read_as(&mpcdi::write(&calibration).unwrap(), "a.mpcdi").unwrap();
    for region in &found.regions {
        let Mapping::Canvas(uv) = &region.mapping else {
            panic!("a canvas is due")
        };
        let near = uv
            .values
            .iter()
            .flatten()
            .zip(support::even(4, 2).iter().flatten())
            .all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(near, "{:?}", uv.values);
    }
    let white = found.regions[0].alpha.as_ref().unwrap();
    assert_eq!(
        white.texels,
        Texels::Grey(vec![1.0; 8]),
        "other readers want an alpha map"
    );
    let place = found.regions[0].canvas.as_ref().unwrap();
    assert_eq!(
        (place.x, place.y, place.width, place.height),
        (0.0, 0.0, 1.0, 1.0)
    );
}

#[test]
fn a_chosen_region_is_read_alone() {
    let calibration = Calibration {
        regions: ["left", "right"]
            .map(|name| region(name, Mapping::Canvas(places())))
            .to_vec(),
        ..Calibration::default()
    };
    let bytes = mpcdi::write(&calibration).unwrap();
    for choice in [
        Choice::Name("right".to_owned()),
        Choice::Name("1".to_owned()),
        Choice::Number(1),
    ] {
        let options = Options {
            region: Some(choice),
            ..Options::default()
        };
        let found = read(&bytes, "a.mpcdi", &options).unwrap();
        assert_eq!(found.regions.len(), 1);
        assert_eq!(found.regions[0].name, "right");
    }
}

#[test]
fn what_an_archive_cannot_hold_is_not_written() {
    use calibration::mpcdi::WriteError;
    let write = |regions: Vec<Region>| {
        let calibration = Calibration {
            regions,
            ..Calibration::default()
        };
        mpcdi::write(&calibration).unwrap_err()
    };
    let with = |change: fn(&mut Region)| {
        let mut changed = region("a", Mapping::Canvas(places()));
        change(&mut changed);
        write(vec![changed])
    };
    assert!(matches!(write(vec![]), WriteError::NoRegion));
    let of_points = Mapping::Points {
        points_m: points(),
        origin: PointOrigin::Unknown,
        projector: None,
    };
    let mixed = write(vec![region("a", Mapping::Identity), region("b", of_points)]);
    assert!(matches!(mixed, WriteError::MixedProfiles { .. }), "{mixed}");
    let twice = write(vec![
        region("a", Mapping::Identity),
        region("a", Mapping::Identity),
    ]);
    assert!(matches!(twice, WriteError::BadName { .. }), "{twice}");
    for name in ["", " a", "a\n"] {
        assert!(matches!(
            write(vec![region(name, Mapping::Identity)]),
            WriteError::BadName { .. }
        ));
    }
    assert!(matches!(
        with(|region| region.size_px = [0, 2]),
        WriteError::BadSize { .. }
    ));
    assert!(matches!(
        with(|region| region.size_px = [8, 2]),
        WriteError::WrongSize { .. }
    ));
    assert!(matches!(
        with(|region| region.gamma.alpha = f32::NAN),
        WriteError::NotANumber { .. }
    ));
    assert!(matches!(
        with(|region| region.uplift.dark = 0.0),
        WriteError::Uplift { .. }
    ));
    assert!(matches!(
        with(|region| region.canvas.as_mut().unwrap().width = f64::NAN),
        WriteError::NotANumber { .. }
    ));
    assert!(matches!(
        with(|region| region.alpha.as_mut().unwrap().texels = Texels::Grey(vec![f32::NAN; 8])),
        WriteError::NotANumber { .. }
    ));
    assert!(matches!(
        with(|region| region.alpha.as_mut().unwrap().texels = Texels::Grey(vec![1.0; 7])),
        WriteError::BadSize { .. }
    ));
    assert!(matches!(
        with(|region| if let Mapping::Canvas(uv) = &mut region.mapping {
            uv.values.pop();
        }),
        WriteError::BadSize { .. }
    ));
    assert!(matches!(
        with(|region| if let Mapping::Canvas(uv) = &mut region.mapping {
            uv.values.fill([f32::NAN; 2]);
        }),
        WriteError::NothingMapped { .. }
    ));
    let mut lamp = region("a", Mapping::Identity);
    lamp.mapping = Mapping::Points {
        points_m: points(),
        origin: PointOrigin::Unknown,
        projector: Some(Box::new(Projector {
            position_m: [0.0; 3],
            frustum: EDGES,
            axes: Axes::ROOM,
        })),
    };
    assert!(matches!(write(vec![lamp]), WriteError::NoDistortion { .. }));
}
