//! The files of a region in an archive's description.
//! In: a `<fileset>`. Out: paths and how to read what is there. It opens no part.

use super::document::unread;
use super::xml::Element;
use crate::{PointOrigin, ReadError};

/// The geometry's file.
pub(super) struct GeometryEntry {
    pub(super) path: String,
    /// Metres in a unit; 1 where the geometry has no points.
    pub(super) unit_m: f64,
    pub(super) origin: PointOrigin,
}

/// A map of light.
pub(super) struct LightEntry {
    pub(super) path: String,
    /// 1 or 3, where it is told.
    pub(super) channels: Option<u8>,
    /// 8 or 16, where it is told.
    pub(super) depth: Option<u8>,
    /// The exponent to light, 1 where it is not told.
    pub(super) gamma: f32,
}

/// The files of a region.
pub(super) struct FileSet {
    pub(super) geometry: GeometryEntry,
    pub(super) alpha: Option<LightEntry>,
    pub(super) beta: Option<LightEntry>,
    pub(super) distortion: Option<String>,
}

impl FileSet {
    pub(super) fn read(
        set: Element<'_, '_>,
        has_points: bool,
        notes: &mut Vec<String>,
    ) -> Result<Self, ReadError> {
        notes.extend(unread(
            set,
            &["geometryWarpFile", "alphaMap", "betaMap", "distortionMap"],
        ));
        let geometry = read_geometry(set.needed_child("geometryWarpFile")?, has_points, notes)?;
        let light = |name: &str| set.child(name).map(read_light).transpose();
        let distortion = set.child("distortionMap");
        Ok(Self {
            geometry,
            alpha: light("alphaMap")?,
            beta: light("betaMap")?,
            distortion: distortion
                .map(|map| map.needed_text("path").map(str::to_owned))
                .transpose()?,
        })
    }
}

fn read_geometry(
    element: Element<'_, '_>,
    has_points: bool,
    notes: &mut Vec<String>,
) -> Result<GeometryEntry, ReadError> {
    notes.extend(unread(
        element,
        &["path", "interpolation", "geometricUnit", "originOf3DData"],
    ));
    let text = |name: &str| element.child(name).map_or("", Element::text);
    let interpolation = text("interpolation");
    if !["", "linear"]
        .iter()
        .any(|known| interpolation.eq_ignore_ascii_case(known))
    {
        notes.push(format!(
            "{}:{}: interpolation \"{interpolation}\" is not known; samples are joined linearly",
            element.file,
            element.line()
        ));
    }
    let mut unit_m = 1.0;
    let mut origin = PointOrigin::Unknown;
    if has_points {
        let unit = element.needed_text("geometricUnit")?;
        unit_m = metres_in(unit)
            .ok_or_else(|| element.refuse("geometricUnit", unit, "mm, cm, dm, m, in, ft or yd"))?;
        let told = text("originOf3DData");
        origin = match told.to_ascii_lowercase().as_str() {
            "centerofmass" => PointOrigin::CentreOfMass,
            "idealeyepoint" => PointOrigin::IdealEyePoint,
            "floorcenter" => PointOrigin::FloorCentre,
            _ => {
                notes.push(format!(
                    "{}:{}: originOf3DData \"{told}\" does not tell where points count from",
                    element.file,
                    element.line()
                ));
                PointOrigin::Unknown
            }
        };
    }
    Ok(GeometryEntry {
        path: element.needed_text("path")?.to_owned(),
        unit_m,
        origin,
    })
}

/// Metres in a unit: the metric ones, and the international inch, foot and yard.
fn metres_in(unit: &str) -> Option<f64> {
    Some(match unit.to_ascii_lowercase().as_str() {
        "mm" => 0.001,
        "cm" => 0.01,
        "dm" => 0.1,
        "m" => 1.0,
        "in" => 0.0254,
        "ft" => 0.3048,
        "yd" => 0.9144,
        _ => return None,
    })
}

fn read_light(element: Element<'_, '_>) -> Result<LightEntry, ReadError> {
    let count = |name: &str, allowed: [u8; 2]| -> Result<Option<u8>, ReadError> {
        let Some(child) = element.child(name) else {
            return Ok(None);
        };
        let value = child
            .text()
            .parse()
            .ok()
            .filter(|value| allowed.contains(value));
        let [low, high] = allowed;
        value
            .map(Some)
            .ok_or_else(|| child.refuse(name, child.text(), &format!("{low} or {high}")))
    };
    let gamma = match element.child("gammaEmbedded") {
        Some(child) => child.number("gammaEmbedded", child.text(), 0.01..=100.0)? as f32,
        None => 1.0,
    };
    Ok(LightEntry {
        path: element.needed_text("path")?.to_owned(),
        channels: count("componentDepth", [1, 3])?,
        depth: count("bitDepth", [8, 16])?,
        gamma,
    })
}
