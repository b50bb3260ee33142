//! Measures that make no screen are refused by name, with a remedy.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod common;

use common::{
    SIEGEN_HEAD, SIEGEN_RADIUS_M, SIEGEN_WALLS, arc, fisheye, grid, planar, rectangle, siegen,
};
use glam::DVec3;
use screens::{
    Cylinder, CylinderMapping, Planar, Points, PointsAt, Shape, ShapeError, Sphere, SphereMapping,
};

/// Refused with this key, and a text that says what to do.
fn refused(shape: &Shape, key: &str, says: &str) {
    let error = shape.check().unwrap_err();
    assert_eq!(error.key(), key, "{error}");
    let text = error.to_string();
    assert!(text.contains(says), "{text}");
    let remedies = ["write", "correct", "measure", "turn", "name", "must be"];
    assert!(
        remedies.iter().any(|remedy| text.contains(remedy)),
        "{text}"
    );
}

fn planar_of(change: impl Fn(&mut Planar)) -> Shape {
    let Shape::Planar(mut shape) = planar() else {
        panic!("a plane")
    };
    change(&mut shape);
    Shape::Planar(shape)
}

fn chord_of(change: impl Fn(&mut Cylinder)) -> Shape {
    let Shape::Cylinder(mut shape) = siegen(1) else {
        panic!("a cylinder")
    };
    change(&mut shape);
    Shape::Cylinder(shape)
}

fn arc_of(change: impl Fn(&mut Cylinder)) -> Shape {
    let Shape::Cylinder(mut shape) = arc([-90.0, 90.0]) else {
        panic!("a cylinder")
    };
    change(&mut shape);
    Shape::Cylinder(shape)
}

fn dome_of(change: impl Fn(&mut Sphere)) -> Shape {
    let Shape::Sphere(mut shape) = fisheye(180.0) else {
        panic!("a sphere")
    };
    change(&mut shape);
    Shape::Sphere(shape)
}

#[test]
fn planes_without_area_or_right_angles() {
    refused(
        &planar_of(|p| p.top_left_m.x = f64::NAN),
        "corners_m.top_left",
        "finite",
    );
    refused(
        &planar_of(|p| p.bottom_left_m.z = 2e4),
        "corners_m.bottom_left",
        "10 km",
    );
    refused(
        &planar_of(|p| p.bottom_right_m = p.bottom_left_m),
        "corners_m",
        "no area",
    );
    refused(
        &planar_of(|p| p.top_left_m = p.bottom_right_m),
        "corners_m",
        "rectangle",
    );
    refused(
        &planar_of(|p| p.top_left_m.x += 0.01),
        "corners_m",
        "9.5 mm",
    );
    assert_eq!(planar_of(|p| p.top_left_m.x += 0.001).check(), Ok(()));
}

#[test]
fn cylinders_that_are_none() {
    refused(&arc_of(|c| c.foot_m.y = f64::INFINITY), "foot_m", "finite");
    refused(&arc_of(|c| c.axis = DVec3::ZERO), "axis", "no direction");
    refused(
        &arc_of(|c| c.axis = DVec3::new(0.0, 0.05, 1.0)),
        "axis",
        "straight ahead",
    );
    for radius_m in [0.0, -1.0, f64::NAN, 1e5] {
        refused(
            &arc_of(|c| c.radius_m = radius_m),
            "radius_m",
            "out of range",
        );
    }
    let with = |azimuth_deg, height_m| {
        arc_of(|c| {
            c.mapping = CylinderMapping::Arc {
                azimuth_deg,
                height_m,
            }
        })
    };
    refused(
        &with([40.0, -40.0], [0.0, 1.0]),
        "azimuth_deg",
        "left-handed",
    );
    refused(&with([40.0, 40.0], [0.0, 1.0]), "azimuth_deg", "no width");
    refused(
        &with([-200.0, 200.0], [0.0, 1.0]),
        "azimuth_deg",
        "whole turn",
    );
    refused(
        &with([0.0, f64::NAN], [0.0, 1.0]),
        "azimuth_deg",
        "out of range",
    );
    refused(
        &with([0.0, 90.0], [1.0, 0.0]),
        "height_m",
        "lower edge first",
    );
    refused(&with([0.0, 90.0], [0.0, f64::NAN]), "height_m", "finite");
    assert_eq!(with([0.0, 360.0], [-1.0, 1.0]).check(), Ok(()));
}

#[test]
fn chords_that_are_none() {
    let with = |corners, aligned_from_m| {
        chord_of(|c| {
            c.mapping = CylinderMapping::Chord {
                corners,
                aligned_from_m,
            }
        })
    };
    let corners = rectangle(SIEGEN_WALLS[1]);
    assert_eq!(with(corners, SIEGEN_HEAD).check(), Ok(()));
    refused(
        &with(corners, DVec3::new(0.0, 1.7, SIEGEN_RADIUS_M)),
        "aligned_from_m",
        "inside",
    );
    refused(
        &with(corners, DVec3::new(9.0, 1.7, 0.0)),
        "aligned_from_m",
        "inside",
    );
    refused(&with(corners, DVec3::NAN), "aligned_from_m", "finite");
    // Left and right exchanged.
    let [left, right, _] = SIEGEN_WALLS[1];
    let mirrored = rectangle([right, left, [right[0], 2.6, right[2]]]);
    refused(
        &with(mirrored, SIEGEN_HEAD),
        "aligned_from_m",
        "left-handed",
    );
    let mut off = corners;
    off.bottom_right_m *= DVec3::new(1.2, 1.0, 1.2);
    refused(&with(off, SIEGEN_HEAD), "corners_m", "bottom_right");
    let thin = Planar {
        top_left_m: corners.bottom_left_m,
        ..corners
    };
    refused(&with(thin, SIEGEN_HEAD), "corners_m", "no area");
    // A canvas on its corner: three of them on the cylinder, the fourth far outside.
    let at = |azimuth: f64, height_m: f64| {
        let (sine, cosine) = azimuth.sin_cos();
        DVec3::new(SIEGEN_RADIUS_M * sine, height_m, -SIEGEN_RADIUS_M * cosine)
    };
    let rise_m = SIEGEN_RADIUS_M * 2.0 * 0.15_f64.sin();
    let askew = Planar {
        bottom_left_m: at(-0.15, 1.7),
        bottom_right_m: at(0.15, 1.7 - rise_m),
        top_left_m: at(0.15, 1.7 + rise_m),
    };
    refused(&with(askew, SIEGEN_HEAD), "corners_m", "upper right corner");
}

#[test]
fn spheres_that_are_none() {
    refused(&dome_of(|d| d.centre_m.x = f64::NAN), "centre_m", "finite");
    refused(&dome_of(|d| d.radius_m = 0.0), "radius_m", "out of range");
    refused(&dome_of(|d| d.tilt_deg = 200.0), "tilt_deg", "-180");
    for field_deg in [0.0, 361.0, f64::NAN] {
        refused(
            &dome_of(|d| d.mapping = SphereMapping::Fisheye { field_deg }),
            "fisheye_deg",
            "1 to 360",
        );
    }
    refused(
        &grid([10.0, -10.0], [0.0, 10.0]),
        "azimuth_deg",
        "left-handed",
    );
    refused(
        &grid([-10.0, 10.0], [10.0, 0.0]),
        "elevation_deg",
        "upside down",
    );
    refused(
        &grid([-10.0, 10.0], [0.0, 91.0]),
        "elevation_deg",
        "out of range",
    );
    assert_eq!(grid([-180.0, 180.0], [-90.0, 90.0]).check(), Ok(()));
    assert_eq!(fisheye(360.0).check(), Ok(()));
}

#[test]
fn points_that_are_no_surface() {
    let points = |width, height, points_m: Vec<[f32; 3]>| {
        Points::new(width, height, points_m, PointsAt::Corners)
    };
    let square = vec![
        [0.0, 1.0, -1.0],
        [1.0, 1.0, -1.0],
        [0.0, 0.0, -1.0],
        [1.0, 0.0, -1.0],
    ];
    assert_eq!(
        Shape::Points(points(2, 2, square.clone()).unwrap()).check(),
        Ok(())
    );
    let with = |point: [f32; 3]| {
        let mut points_m = square.clone();
        points_m[2] = point;
        points(2, 2, points_m).unwrap_err()
    };
    assert_eq!(
        with([0.0, f32::INFINITY, 0.0]),
        ShapeError::PointNotInRoom { column: 0, row: 1 }
    );
    assert_eq!(
        with([2e4, 0.0, 0.0]),
        ShapeError::PointNotInRoom { column: 0, row: 1 }
    );
    assert_eq!(with([f32::NAN, f32::INFINITY, 0.0]), ShapeError::NoSurface);
    assert_eq!(with([0.0, f32::NAN, 0.0]), ShapeError::NoSurface);
    assert_eq!(
        points(2, 2, vec![[1.0; 3]; 4]).unwrap_err(),
        ShapeError::NoSurface
    );
    let count = ShapeError::PointCount {
        width: 2,
        height: 3,
        count: 4,
    };
    assert_eq!(points(2, 3, square).unwrap_err(), count);
    for (width, height) in [
        (1, 9),
        (9, 1),
        (0, 0),
        (16_384, 16_384),
        (u32::MAX, u32::MAX),
    ] {
        let error = points(width, height, Vec::new()).unwrap_err();
        assert_eq!(error, ShapeError::PointSize { width, height });
        assert_eq!(error.key(), "file");
    }
}
