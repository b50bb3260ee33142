//! What makes a screen one that can be shown: a surface of some size that its observer sees from the front.

use glam::DVec3;

use super::check::{check_angles, check_file, check_point, check_size, out_of_range};
use super::{Observer, PlanarCorners, Screen, ScreenShape, Wall};
use crate::config::{Fault, Problem};

/// How far corners may be off a rectangle, in metres.
const RECTANGLE_TOLERANCE_M: f64 = 0.001;
/// How far from a screen's plane a head must be, in metres.
const NEAREST_HEAD_M: f64 = 0.01;
/// How much pixels of a planar screen may be off square.
const PIXEL_ASPECT_TOLERANCE: f64 = 0.02;

impl Wall {
    pub(super) fn check_screen(&self, key: &str, screen: &Screen) -> Result<(), Problem> {
        let Some(observer) = self.observers.get(screen.observer) else {
            let advice = "there is no such observer";
            return Err(Problem::new(Fault::Name, format!("{key}.observer"), advice));
        };
        check_size(&format!("{key}.size_px"), screen.size_px)?;
        match &screen.shape {
            ScreenShape::Planar(corners) => check_planar(key, screen, corners, observer),
            ScreenShape::Surface { file, unit_m } => {
                check_file(&format!("{key}.file"), file)?;
                if !(1e-6..=1e3).contains(unit_m) {
                    return Err(out_of_range(
                        &format!("{key}.unit_m"),
                        "write metres in a unit of the file, for example 0.001 for millimetres",
                    ));
                }
                Ok(())
            }
            ScreenShape::Cylinder { foot_m, .. } => {
                check_point(&format!("{key}.foot_m"), *foot_m)?;
                check_curved(key, screen, observer)
            }
            ScreenShape::Sphere {
                centre_m, tilt_deg, ..
            } => {
                check_point(&format!("{key}.centre_m"), *centre_m)?;
                check_angles(&format!("{key}.tilt_deg"), &[*tilt_deg])?;
                check_curved(key, screen, observer)
            }
        }
    }
}

fn check_planar(
    key: &str,
    screen: &Screen,
    corners: &PlanarCorners,
    observer: &Observer,
) -> Result<(), Problem> {
    let corners_key = format!("{key}.corners_m");
    for (name, corner) in [
        ("bottom_left", corners.bottom_left),
        ("bottom_right", corners.bottom_right),
        ("top_left", corners.top_left),
    ] {
        check_point(&format!("{corners_key}.{name}"), corner)?;
    }
    let bottom_left = DVec3::from(corners.bottom_left);
    let right = DVec3::from(corners.bottom_right) - bottom_left;
    let up = DVec3::from(corners.top_left) - bottom_left;
    let (width_m, height_m) = (right.length(), up.length());
    let geometry = |advice: String| Err(Problem::new(Fault::Geometry, corners_key.clone(), advice));
    if width_m.min(height_m) < RECTANGLE_TOLERANCE_M {
        return geometry(format!(
            "the screen is {width_m} m wide and {height_m} m high, so it has no area; write three different corners"
        ));
    }
    // How far the shorter edge's end lies beside the corner of a rectangle.
    let aside_m = right.dot(up).abs() / width_m.max(height_m);
    if aside_m > RECTANGLE_TOLERANCE_M {
        return geometry(format!(
            "the corners do not form a rectangle: the lower and the left edge are off a right angle by {:.1} mm, at most 1 mm is allowed; measure them again",
            aside_m * 1000.0
        ));
    }
    let back = right.cross(up).normalize();
    let distance_m = (DVec3::from(observer.head_m) - bottom_left).dot(back);
    if distance_m < -NEAREST_HEAD_M {
        return geometry(format!(
            "the head of observer \"{}\" is {:.3} m behind the screen; name the corners as that observer sees them (exchange left and right), or move head_m",
            observer.name, -distance_m
        ));
    }
    if distance_m < NEAREST_HEAD_M {
        return geometry(format!(
            "the head of observer \"{}\" is in the plane of the screen; move head_m at least {NEAREST_HEAD_M} m in front of it",
            observer.name
        ));
    }
    let [across, along] = [
        f64::from(screen.size_px[0]) / width_m,
        f64::from(screen.size_px[1]) / height_m,
    ];
    if (across / along - 1.0).abs() > PIXEL_ASPECT_TOLERANCE {
        let height_px = (across * height_m).round();
        return Err(Problem::new(
            Fault::Geometry,
            format!("{key}.size_px"),
            format!(
                "pixels are not square: {across:.1} a metre across, {along:.1} a metre up, at most 2 % apart is allowed; for {width_m:.3} m × {height_m:.3} m write size_px = [{}, {height_px}], or correct corners_m",
                screen.size_px[0]
            ),
        ));
    }
    Ok(())
}

/// A cylinder or a sphere: what it is must make sense, and its observer must see it from inside.
fn check_curved(key: &str, screen: &Screen, observer: &Observer) -> Result<(), Problem> {
    let Some(shape) = screen.shape.smooth() else {
        return Ok(());
    };
    shape.check().map_err(|error| {
        Problem::new(
            Fault::Geometry,
            format!("{key}.{}", error.key()),
            error.to_string(),
        )
    })?;
    // A head that sees a part of it from behind is odd, and may be meant.
    if screens::pixel_density(&shape, screen.size_px, DVec3::from(observer.head_m)).is_none() {
        return Err(Problem::new(
            Fault::Geometry,
            key,
            format!(
                "the head of observer \"{}\" does not see the screen from inside; move head_m within the radius",
                observer.name
            ),
        ));
    }
    Ok(())
}
