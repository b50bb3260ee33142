//! What makes a scene one that can be shown: ranges, names, and paths that can be flown.
//! In: a scene from a file or from the wire. Out: nothing, or the first problem and what to do about it.

use std::ops::RangeInclusive;

use geodesy::Ellipsoid;

use super::{MAX_KEYFRAMES, MAX_LAYERS, Scene, Sun};
use crate::camera::{Camera, Path, Place};
use crate::config::{Fault, Problem};
use crate::wall::check_names;

/// Farthest viewpoint: far enough for any picture, near enough for fixed-point positions.
const MAX_ALTITUDE_M: f64 = 1e11;
/// Lowest viewpoint: below the deepest sea floor.
const MIN_ALTITUDE_M: f64 = -12_000.0;
/// Longest path of a repository in bytes.
const MAX_REPOSITORY_BYTES: usize = 4096;
/// Longest time of a camera path: one year.
const MAX_TIME_S: f64 = 31_557_600.0;
/// Widest arc between neighbouring keyframes. Nearer to 180° the great circle is not determined.
const MAX_ARC_DEG: f64 = 150.0;

impl Scene {
    /// The first problem of the scene.
    pub(super) fn check(&self) -> Result<(), Problem> {
        Ellipsoid::new(self.planet.semi_major_m, self.planet.semi_minor_m)
            .map_err(|error| Problem::new(Fault::OutOfRange, "planet", error.to_string()))?;
        check_camera(&self.camera)?;
        if self.layers.len() > MAX_LAYERS {
            let advice = format!(
                "there are {}; write at most {MAX_LAYERS}",
                self.layers.len()
            );
            return Err(Problem::new(Fault::OutOfRange, "layers", advice));
        }
        check_names(
            "layers",
            self.layers.iter().map(|layer| layer.name.as_str()),
        )?;
        for (index, layer) in self.layers.iter().enumerate() {
            let path = &layer.repository;
            if path.is_empty() || path.len() > MAX_REPOSITORY_BYTES || path.contains('\0') {
                let key = format!("layers[{index}].repository");
                let advice = "write the directory of a repository, made by `terrawall import`";
                return Err(Problem::new(Fault::OutOfRange, key, advice));
            }
        }
        if let Sun::Fixed {
            latitude_deg,
            longitude_deg,
        } = self.light.sun
        {
            check_range("light.sun.latitude_deg", latitude_deg, -90.0..=90.0)?;
            check_range("light.sun.longitude_deg", longitude_deg, -180.0..=180.0)?;
        }
        check_range("light.ambient", self.light.ambient, 0.0..=1.0)?;
        check_range("light.relief", self.light.relief, 0.0..=100.0)?;
        check_range(
            "atmosphere.thickness_m",
            self.atmosphere.thickness_m,
            1.0..=1e6,
        )?;
        for (index, share) in self.atmosphere.colour.into_iter().enumerate() {
            check_range(&format!("atmosphere.colour[{index}]"), share, 0.0..=1.0)?;
        }
        check_range(
            "mesh.refinement",
            f64::from(self.mesh.refinement),
            0.0..=7.0,
        )?;
        check_range("mesh.tile_px", self.mesh.tile_px, 16.0..=4096.0)?;
        let deepest = f64::from(geodesy::MAX_LEVEL);
        check_range(
            "mesh.deepest_level",
            f64::from(self.mesh.deepest_level),
            0.0..=deepest,
        )
    }
}

fn check_camera(camera: &Camera) -> Result<(), Problem> {
    match camera {
        Camera::Fixed(place) => check_place("camera.place", place),
        Camera::Orbit(orbit) => {
            check_place("camera.place", &orbit.place)?;
            check_range(
                "camera.centre.latitude_deg",
                orbit.centre_latitude_deg,
                -90.0..=90.0,
            )?;
            check_range(
                "camera.centre.longitude_deg",
                orbit.centre_longitude_deg,
                -180.0..=180.0,
            )?;
            check_range(
                "camera.degrees_per_second",
                orbit.degrees_per_second,
                -3600.0..=3600.0,
            )
        }
        Camera::Path(path) => check_path(path),
    }
}

fn check_path(path: &Path) -> Result<(), Problem> {
    let keyframes = &path.keyframes;
    if !(2..=MAX_KEYFRAMES).contains(&keyframes.len()) {
        let advice = format!(
            "there are {}; write at least 2 and at most {MAX_KEYFRAMES}, or mode = \"fixed\" for one place",
            keyframes.len()
        );
        return Err(Problem::new(Fault::OutOfRange, "camera.keyframes", advice));
    }
    for (index, keyframe) in keyframes.iter().enumerate() {
        let key = format!("camera.keyframes[{index}]");
        check_range(&format!("{key}.time_s"), keyframe.time_s, 0.0..=MAX_TIME_S)?;
        check_place(&format!("{key}.place"), &keyframe.place)?;
    }
    for (index, pair) in keyframes.windows(2).enumerate() {
        let [before, after] = pair else { continue };
        let key = format!("camera.keyframes[{}]", index + 1);
        // A millisecond keeps speeds finite.
        if after.time_s - before.time_s < 0.001 {
            let advice = format!(
                "keyframes must be in order of time; write more than {} s",
                before.time_s
            );
            return Err(Problem::new(
                Fault::OutOfRange,
                format!("{key}.time_s"),
                advice,
            ));
        }
        let arc_deg = before
            .place
            .normal()
            .angle_between(after.place.normal())
            .to_degrees();
        if arc_deg > MAX_ARC_DEG {
            let advice = format!(
                "this is {arc_deg:.0}° from the keyframe before, and the way between them is not determined; write a keyframe in between"
            );
            return Err(Problem::new(
                Fault::Geometry,
                format!("{key}.place"),
                advice,
            ));
        }
    }
    let (first, last) = (keyframes.first(), keyframes.last());
    if path.looped && first.map(|keyframe| keyframe.place) != last.map(|keyframe| keyframe.place) {
        let key = format!("camera.keyframes[{}].place", keyframes.len() - 1);
        let advice = "a looped path must end where it starts; repeat the first place here, or write looped = false";
        return Err(Problem::new(Fault::Geometry, key, advice));
    }
    Ok(())
}

fn check_place(key: &str, place: &Place) -> Result<(), Problem> {
    let check = |name: &str, value, range| check_range(&format!("{key}.{name}"), value, range);
    check("latitude_deg", place.latitude_deg, -90.0..=90.0)?;
    check("longitude_deg", place.longitude_deg, -180.0..=180.0)?;
    check(
        "altitude_m",
        place.altitude_m,
        MIN_ALTITUDE_M..=MAX_ALTITUDE_M,
    )?;
    check("heading_deg", place.heading_deg, -360.0..=360.0)?;
    check("pitch_deg", place.pitch_deg, -90.0..=90.0)?;
    check("roll_deg", place.roll_deg, -180.0..=180.0)
}

fn check_range(key: &str, value: f64, range: RangeInclusive<f64>) -> Result<(), Problem> {
    if range.contains(&value) {
        return Ok(());
    }
    let advice = format!("write a number within {}…{}", range.start(), range.end());
    Err(Problem::new(Fault::OutOfRange, key, advice))
}
