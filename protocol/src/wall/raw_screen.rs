//! Screens out of TOML: keys, types, and which of them a kind of screen has. What the values mean is checked
//! afterwards.

use super::raw::{find, number_or, numbers_or};
use super::{CylinderCanvas, Observer, PlanarCorners, Screen, ScreenShape, SphereCanvas};
use crate::config::{ConfigError, Fault, Table};

const CORNERS: &str =
    "corners_m = { bottom_left = [-2, 0, 0], bottom_right = [2, 0, 0], top_left = [-2, 2.25, 0] }";
const AZIMUTH: &str = "azimuth_deg = [-45.0, 45.0]";

/// Reads one `[[screens]]`.
pub(super) fn read(table: &Table<'_, '_>, observers: &[Observer]) -> Result<Screen, ConfigError> {
    let name = table.require("name", "name = \"front\"")?.text()?;
    let kind = table.require("kind", "kind = \"planar\"")?;
    let shape = match kind.text()?.as_str() {
        "planar" => {
            only(table, &["corners_m"])?;
            ScreenShape::Planar(read_corners(table)?)
        }
        "cylinder" => read_cylinder(table)?,
        "sphere" => read_sphere(table)?,
        "surface" => {
            only(table, &["file", "unit_m"])?;
            ScreenShape::Surface {
                file: table.require("file", "file = \"screen.obj\"")?.text()?,
                unit_m: number_or(table, "unit_m", 1.0)?,
            }
        }
        _ => {
            return Err(kind.error(
                Fault::OutOfRange,
                "unknown kind of screen; write \"planar\", \"cylinder\", \"sphere\" or \"surface\"",
            ));
        }
    };
    let reference = table.require("observer", "observer = \"viewer\"")?;
    let observer = find(
        &reference,
        "observer",
        observers.iter().map(|o| o.name.as_str()),
    )?;
    let example = "size_px = [1920, 1080]";
    Ok(Screen {
        name,
        observer,
        shape,
        size_px: table.require("size_px", example)?.integers(example)?,
    })
}

/// Refuses keys that no screen has, and those that this kind has not.
fn only(table: &Table<'_, '_>, of_kind: &[&str]) -> Result<(), ConfigError> {
    let keys = [&["name", "kind", "observer", "size_px"], of_kind].concat();
    table.check_only(&keys)
}

fn read_cylinder(table: &Table<'_, '_>) -> Result<ScreenShape, ConfigError> {
    let common = ["foot_m", "axis", "radius_m"];
    let canvas = if table.get("corners_m").is_some() {
        only(
            table,
            &[&common[..], &["corners_m", "aligned_from_m"]].concat(),
        )?;
        let example = "aligned_from_m = [0.0, 1.7, 0.0]";
        CylinderCanvas::Chord {
            corners_m: read_corners(table)?,
            aligned_from_m: table.require("aligned_from_m", example)?.numbers(example)?,
        }
    } else {
        only(table, &[&common[..], &["azimuth_deg", "height_m"]].concat())?;
        let height = "height_m = [0.0, 2.6]";
        CylinderCanvas::Arc {
            azimuth_deg: table.require("azimuth_deg", AZIMUTH)?.numbers(AZIMUTH)?,
            height_m: table.require("height_m", height)?.numbers(height)?,
        }
    };
    let foot = "foot_m = [0.0, 0.0, 0.0]";
    Ok(ScreenShape::Cylinder {
        foot_m: table.require("foot_m", foot)?.numbers(foot)?,
        axis: numbers_or(table, "axis", "axis = [0.0, 1.0, 0.0]", [0.0, 1.0, 0.0])?,
        radius_m: table.require("radius_m", "radius_m = 2.5")?.number()?,
        canvas,
    })
}

fn read_sphere(table: &Table<'_, '_>) -> Result<ScreenShape, ConfigError> {
    let common = ["centre_m", "radius_m", "tilt_deg"];
    let canvas = match table.get("fisheye_deg") {
        Some(field) => {
            only(table, &[&common[..], &["fisheye_deg"]].concat())?;
            SphereCanvas::Fisheye {
                field_deg: field.number()?,
            }
        }
        None => {
            only(
                table,
                &[&common[..], &["azimuth_deg", "elevation_deg"]].concat(),
            )?;
            let elevation = "elevation_deg = [-10.0, 40.0]";
            let example = "fisheye_deg = 180.0, or azimuth_deg = [-45.0, 45.0] and elevation_deg = [-10.0, 40.0]";
            SphereCanvas::Grid {
                azimuth_deg: table.require("azimuth_deg", example)?.numbers(AZIMUTH)?,
                elevation_deg: table
                    .require("elevation_deg", elevation)?
                    .numbers(elevation)?,
            }
        }
    };
    let centre = "centre_m = [0.0, 1.5, 0.0]";
    Ok(ScreenShape::Sphere {
        centre_m: table.require("centre_m", centre)?.numbers(centre)?,
        radius_m: table.require("radius_m", "radius_m = 5.0")?.number()?,
        tilt_deg: number_or(table, "tilt_deg", 0.0)?,
        canvas,
    })
}

fn read_corners(screen: &Table<'_, '_>) -> Result<PlanarCorners, ConfigError> {
    let table = screen.require("corners_m", CORNERS)?.table()?;
    let table = table.only(&["bottom_left", "bottom_right", "top_left"])?;
    let corner = |key: &str| table.require(key, CORNERS)?.numbers("[-2.0, 0.0, 0.0]");
    Ok(PlanarCorners {
        bottom_left: corner("bottom_left")?,
        bottom_right: corner("bottom_right")?,
        top_left: corner("top_left")?,
    })
}
