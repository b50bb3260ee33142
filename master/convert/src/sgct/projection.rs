//! Projections of SGCT's viewports.
//! In: `projection` objects. Out: corners of a plane, or a dome. A plane by fields of view has its corners at
//! orientation · (d·tan left, d·tan down, −d) and so on, plus the offset, counted from the room's origin and not from
//! the user (src/baseviewport.cpp). A fisheye's middle looks to the zenith, lowered to the front by its tilt.

use super::users::turn;
use super::{members, vector};
use crate::draft::Builder;
use crate::error::Trouble;
use crate::room::Corners;
use crate::source::At;
use glam::{DMat3, DVec3};

/// SGCT's distance from the origin to a plane that is given by fields of view.
const DISTANCE_M: f64 = 10.0;
/// SGCT's diameter of a dome.
const DIAMETER_M: f64 = 14.8;

/// What a viewport shows.
pub(super) enum Projection {
    Plane(Corners),
    Dome(Dome),
}

/// A fisheye picture.
pub(super) struct Dome {
    pub(super) radius_m: f64,
    pub(super) fisheye_deg: f64,
    pub(super) tilt_deg: f64,
    /// Shares of the picture that are not shown: left, right, bottom, top.
    pub(super) crop: [f64; 4],
    pub(super) keeps_aspect: bool,
}

/// Reads the projection of a viewport. `None` where a wall file has no such screen.
pub(super) fn read(viewport: At<'_>, builder: &mut Builder) -> Result<Option<Projection>, Trouble> {
    let Some(at) = viewport.get("projection") else {
        builder.ledger.note(
            viewport,
            "projection is not stated",
            "SGCT's default plane is taken: 2 m × 2 m, 2 m in front of the origin",
            "measure the screen and correct corners_m",
        );
        let plane = Corners::new([-1.0, -1.0, -2.0], [1.0, -1.0, -2.0], [-1.0, 1.0, -2.0]);
        return Ok(Some(Projection::Plane(plane)));
    };
    let kind = at
        .get("type")
        .ok_or_else(|| at.expected("an object with type"))?
        .text()?;
    match kind {
        "PlanarProjection" => read_planar(at, builder).map(Some),
        "TextureMappedProjection" => {
            builder.ledger.note(
                at,
                "TextureMappedProjection",
                "it is treated as a PlanarProjection",
                "check its screen",
            );
            read_planar(at, builder).map(Some)
        }
        "ProjectionPlane" => {
            let corner = |key: &'static str| {
                at.get(key)
                    .ok_or_else(|| at.expected("an object with lowerleft, upperleft, upperright"))
                    .and_then(vector)
            };
            let [lower_left, upper_left, upper_right] = [
                corner("lowerleft")?,
                corner("upperleft")?,
                corner("upperright")?,
            ]
            .map(DVec3::from);
            Ok(Some(Projection::Plane(Corners {
                bottom_left: lower_left,
                bottom_right: lower_left + upper_right - upper_left,
                top_left: upper_left,
            })))
        }
        "FisheyeProjection" => read_fisheye(at, builder).map(|dome| Some(Projection::Dome(dome))),
        _ => Ok(None),
    }
}

fn read_planar(at: At<'_>, builder: &mut Builder) -> Result<Projection, Trouble> {
    let field = at
        .get("fov")
        .ok_or_else(|| at.expected("an object with fov"))?;
    let across = read_field(field, "hfov", ["left", "right"])?;
    let along = read_field(field, "vfov", ["down", "up"])?;
    let distance = at.get("distance").or_else(|| field.get("distance"));
    let distance_m = match distance {
        Some(distance) => distance.number()?,
        None => {
            builder.ledger.note(
                at,
                "distance is not stated",
                "SGCT's 10 m to the screen are taken; the size of the screen follows from it",
                "measure the screen and correct corners_m: it matters as soon as heads move or eyes differ",
            );
            DISTANCE_M
        }
    };
    if distance_m <= 0.0 {
        return Err(at.expected("a distance above 0"));
    }
    let rotation = at.get("orientation").map_or(Ok(DMat3::IDENTITY), turn)?;
    let offset = at.get("offset").map_or(Ok([0.0; 3]), vector)?;
    let angles = [across[0], across[1], along[0], along[1]];
    Corners::from_field(angles, distance_m, rotation, offset.into())
        .map(Projection::Plane)
        .ok_or_else(|| field.expected("angles below 89.9° to each side"))
}

/// The angles to both sides in degrees, to the left and down negative. Those of one side hold over the whole one.
fn read_field(
    at: At<'_>,
    whole: &'static str,
    sides: [&'static str; 2],
) -> Result<[f64; 2], Trouble> {
    let half = at
        .get(whole)
        .map(At::number)
        .transpose()?
        .map(|whole| 0.5 * whole);
    let mut angles = [0.0; 2];
    for (angle, key) in angles.iter_mut().zip(sides) {
        *angle = match (at.get(key), half) {
            (Some(side), _) => side.number()?,
            (None, Some(half)) => half,
            (None, None) => {
                return Err(at.expected(&format!(
                    "an object with {whole}, or {}",
                    sides.join(" and ")
                )));
            }
        };
    }
    Ok([-angles[0], angles[1]])
}

fn read_fisheye(at: At<'_>, builder: &mut Builder) -> Result<Dome, Trouble> {
    let mut missing = Vec::new();
    let mut number = |key: &'static str, default: f64| match at.get(key) {
        Some(value) => value.number(),
        None => {
            missing.push(format!("{key} ({default})"));
            Ok(default)
        }
    };
    let fisheye_deg = number("fov", 180.0)?;
    let tilt_deg = number("tilt", 0.0)?;
    let diameter_m = number("diameter", DIAMETER_M)?;
    if !missing.is_empty() {
        builder.ledger.note(
            at,
            format!("not stated: {}", missing.join(", ")),
            "SGCT's defaults are taken",
            "correct fisheye_deg, tilt_deg and radius_m of the dome",
        );
    }
    if !(1.0..=360.0).contains(&fisheye_deg) {
        return Err(at.expected("a fov within 1…360"));
    }
    if !(0.01..=1000.0).contains(&diameter_m) {
        return Err(at.expected("a diameter within 0.01…1000 m"));
    }
    let crop = match at.get("crop") {
        Some(crop) => members(crop, ["left", "right", "bottom", "top"])?,
        None => [0.0; 4],
    };
    let [left, right, bottom, top] = crop;
    let is_sound = crop.iter().all(|share| (0.0..1.0).contains(share))
        && left + right < 0.99
        && bottom + top < 0.99;
    if !is_sound {
        return Err(at.expected("a crop that leaves something"));
    }
    Ok(Dome {
        radius_m: 0.5 * diameter_m,
        fisheye_deg,
        tilt_deg,
        crop,
        keeps_aspect: at.get("keepaspectratio").map_or(Ok(true), At::flag)?,
    })
}
