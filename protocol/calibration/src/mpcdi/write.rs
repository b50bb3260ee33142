//! Writing an archive.
//! In: a calibration. Out: the bytes of an `.mpcdi` archive that this crate and others read. Layout and conventions:
//! see [`read`](fn@crate::read) and the module's sources. It writes no file.

mod check;

use std::io::{Cursor, Write as _};

use zip::CompressionMethod;
use zip::write::{SimpleFileOptions, ZipWriter};

use super::document::Profile;
use super::picture;
use crate::grid::{Grid, Sample};
use crate::{
    Axes, Calibration, CanvasPlace, Frustum, Map, Mapping, PointOrigin, Projector, Region, Texels,
    pfm,
};

/// Why a calibration was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// There is nothing to write.
    #[error("the calibration has no region. Read or make one first.")]
    NoRegion,
    /// Regions of different kinds; an archive has one profile.
    #[error(
        "region \"{region}\" is mapped in another way than the first one. Write it to an archive of its own."
    )]
    MixedProfiles {
        /// The region.
        region: String,
    },
    /// Without a plain name, or with that of another region.
    #[error(
        "a region is named \"{region}\", which is empty, taken, or has blanks at its ends or control characters. \
         Give each region a plain name of its own."
    )]
    BadName {
        /// The name.
        region: String,
    },
    /// A size out of range, or a grid or map that does not fill its size.
    #[error(
        "region \"{region}\": its size, or that of its {what}, is none. Sizes are 1…16384, and grids are full."
    )]
    BadSize {
        /// The region.
        region: String,
        /// What has no size.
        what: &'static str,
    },
    /// A map of light of another size than the region.
    #[error("region \"{region}\": its {what} is not of its size. Resample the map first.")]
    WrongSize {
        /// The region.
        region: String,
        /// The map.
        what: &'static str,
    },
    /// A number that is none where one is due, or one out of range.
    #[error("region \"{region}\": {what} is not a number in range. Only geometry may have holes.")]
    NotANumber {
        /// The region.
        region: String,
        /// What it is.
        what: &'static str,
    },
    /// Geometry of holes only.
    #[error("region \"{region}\": no pixel of it shows anything. Calibrate it first.")]
    NothingMapped {
        /// The region.
        region: String,
    },
    /// The black level is applied in a way that the format cannot tell.
    #[error(
        "region \"{region}\": MPCDI only knows an uplift of dark 1 and bright 1. Change the beta map to it."
    )]
    Uplift {
        /// The region.
        region: String,
    },
    /// The profile `sl` without its distortion map.
    #[error(
        "region \"{region}\": with a projector, a distortion map is due. Give it one, an even one if need be."
    )]
    NoDistortion {
        /// The region.
        region: String,
    },
    /// The archive or a picture could not be packed.
    #[error("the archive cannot be packed: {reason}. Try again with less.")]
    Packing {
        /// Why.
        reason: String,
    },
}

/// Writes an MPCDI archive, version 1.0, which all readers know.
///
/// The profile follows from the mappings: `2d` for [`Mapping::Canvas`] and [`Mapping::Identity`] (which becomes the
/// places of the pixels themselves), `3d` for [`Mapping::Frustum`], `a3` for [`Mapping::Points`], `sl` for those with
/// a projector. Points are written in metres. Grids with samples on the output's corners are resampled at its pixel
/// centres, for an archive's samples lie at centres. Maps have 16 bits; a region without alpha map gets a white one,
/// for other readers want one. Regions without a place fill the canvas. `notes` are not written; an empty date becomes
/// 1970-01-01. The level is 1, one more with a beta map, two more with a distortion map or with geometry finer than
/// a tenth of the output (`mpcdiCreateProfile.cpp`).
///
/// # Errors
/// What of the calibration an archive cannot hold, and the remedy.
pub fn write(calibration: &Calibration) -> Result<Vec<u8>, WriteError> {
    let first = calibration.regions.first().ok_or(WriteError::NoRegion)?;
    let profile = profile_of(&first.mapping);
    let mut archive = Pack {
        zip: ZipWriter::new(Cursor::new(Vec::new())),
    };
    let mut buffers: Vec<(CanvasPlace, String)> = Vec::new();
    let mut filesets = String::new();
    let mut levels = [false; 2];
    for (index, region) in calibration.regions.iter().enumerate() {
        check::check(
            region,
            profile,
            calibration.regions.get(..index).unwrap_or_default(),
        )?;
        let place = region.canvas.clone().unwrap_or_else(whole_canvas);
        let text = region_text(region, &place);
        match buffers
            .iter_mut()
            .find(|(known, _)| known.buffer == place.buffer)
        {
            Some((_, regions)) => regions.push_str(&text),
            None => buffers.push((place, text)),
        }
        levels[0] |= region.beta.is_some();
        levels[1] |= region.distortion.is_some() || is_fine(region);
        filesets.push_str(&archive.files(region, index)?);
    }
    let mut xml = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let date = if calibration.date.is_empty() {
        "1970-01-01 00:00:00"
    } else {
        &calibration.date
    };
    let name = match profile {
        Profile::TwoD => "2d",
        Profile::ThreeD => "3d",
        Profile::AdvancedThreeD => "a3",
        Profile::ShaderLamp => "sl",
    };
    let date = escaped(date);
    let level = match levels {
        [false, false] => 1,
        [true, false] => 2,
        [false, true] => 3,
        [true, true] => 4,
    };
    line(
        &mut xml,
        &format!("<MPCDI profile=\"{name}\" level=\"{level}\" date=\"{date}\" version=\"1.0\">"),
    );
    line(&mut xml, "  <display>");
    for (place, regions) in &buffers {
        let size = place.size_px.map_or_else(String::new, |[width, height]| {
            format!(" Xresolution=\"{width}\" Yresolution=\"{height}\"")
        });
        line(
            &mut xml,
            &format!("    <buffer id=\"{}\"{size}>", escaped(&place.buffer)),
        );
        xml.push_str(regions);
        line(&mut xml, "    </buffer>");
    }
    line(&mut xml, "  </display>\n  <files>");
    xml.push_str(&filesets);
    line(&mut xml, "  </files>\n</MPCDI>");
    archive.add("mpcdi.xml", xml.as_bytes())?;
    archive.finish()
}

struct Pack {
    zip: ZipWriter<Cursor<Vec<u8>>>,
}

impl Pack {
    fn add(&mut self, name: &str, bytes: &[u8]) -> Result<(), WriteError> {
        // Without a time, the same calibration makes the same bytes.
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .last_modified_time(zip::DateTime::default());
        self.zip.start_file(name, options).map_err(packing)?;
        self.zip.write_all(bytes).map_err(packing)
    }

    fn finish(self) -> Result<Vec<u8>, WriteError> {
        Ok(self.zip.finish().map_err(packing)?.into_inner())
    }

    /// Packs the parts of a region and describes them.
    fn files(&mut self, region: &Region, index: usize) -> Result<String, WriteError> {
        let mut xml = String::new();
        line(
            &mut xml,
            &format!("    <fileset region=\"{}\">", escaped(&region.name)),
        );
        let (grid, origin) = geometry(region)?;
        let path = format!("geometry-{index}.pfm");
        self.add(&path, &pfm::write(grid.width, grid.height, &grid.values))?;
        line(&mut xml, "      <geometryWarpFile>");
        line(&mut xml, &format!("        <path>{path}</path>"));
        line(&mut xml, "        <geometricUnit>m</geometricUnit>");
        line(&mut xml, "        <interpolation>linear</interpolation>");
        line(
            &mut xml,
            &format!("        <originOf3DData>{origin}</originOf3DData>"),
        );
        line(&mut xml, "      </geometryWarpFile>");
        let [width, height] = region.size_px;
        let white = || Map {
            width,
            height,
            texels: Texels::Grey(vec![1.0; width as usize * height as usize]),
        };
        let alpha = region.alpha.clone().unwrap_or_else(white);
        self.light(
            &mut xml,
            "alphaMap",
            &format!("alpha-{index}.png"),
            &alpha,
            region.gamma.alpha,
        )?;
        if let Some(beta) = &region.beta {
            self.light(
                &mut xml,
                "betaMap",
                &format!("beta-{index}.png"),
                beta,
                region.gamma.beta,
            )?;
        }
        if let Some(distortion) = &region.distortion {
            let path = format!("distortion-{index}.pfm");
            let grid = at_centres(distortion, region, "distortion map")?.map(upwards);
            self.add(&path, &pfm::write(grid.width, grid.height, &grid.values))?;
            line(
                &mut xml,
                &format!(
                    "      <distortionMap>\n        <path>{path}</path>\n      </distortionMap>"
                ),
            );
        }
        line(&mut xml, "    </fileset>");
        Ok(xml)
    }

    fn light(
        &mut self,
        xml: &mut String,
        element: &str,
        path: &str,
        map: &Map,
        gamma: f32,
    ) -> Result<(), WriteError> {
        self.add(path, &picture::write(map).map_err(packing)?)?;
        let channels = match map.texels {
            Texels::Grey(_) => 1,
            Texels::Colour(_) => 3,
        };
        line(
            xml,
            &format!("      <{element}>\n        <path>{path}</path>"),
        );
        line(
            xml,
            &format!(
                "        <componentDepth>{channels}</componentDepth>\n        <bitDepth>16</bitDepth>"
            ),
        );
        line(
            xml,
            &format!("        <gammaEmbedded>{gamma}</gammaEmbedded>\n      </{element}>"),
        );
        Ok(())
    }
}

fn packing(error: impl std::fmt::Display) -> WriteError {
    WriteError::Packing {
        reason: error.to_string(),
    }
}

fn profile_of(mapping: &Mapping) -> Profile {
    match mapping {
        Mapping::Canvas(_) | Mapping::Identity => Profile::TwoD,
        Mapping::Frustum { .. } => Profile::ThreeD,
        Mapping::Points {
            projector: None, ..
        } => Profile::AdvancedThreeD,
        Mapping::Points {
            projector: Some(_), ..
        } => Profile::ShaderLamp,
    }
}

/// Whether the geometry counts as one for each pixel.
fn is_fine(region: &Region) -> bool {
    let [width, height] = match &region.mapping {
        Mapping::Canvas(uv) | Mapping::Frustum { uv, .. } => [uv.width, uv.height],
        Mapping::Points { points_m, .. } => [points_m.width, points_m.height],
        Mapping::Identity => region.size_px,
    };
    width > region.size_px[0] / 10 || height > region.size_px[1] / 10
}

fn whole_canvas() -> CanvasPlace {
    CanvasPlace {
        x: 0.0,
        y: 0.0,
        width: 1.0,
        height: 1.0,
        buffer: "canvas".to_owned(),
        size_px: None,
    }
}

/// Between a place from the upper corner and one from the lower; the third channel is not used.
fn upwards([u, v]: [f32; 2]) -> [f32; 3] {
    if u.is_finite() && v.is_finite() {
        [u, 1.0 - v, 0.0]
    } else {
        [f32::NAN; 3]
    }
}

fn geometry(region: &Region) -> Result<(Grid<[f32; 3]>, &'static str), WriteError> {
    const WHAT: &str = "geometry";
    Ok(match &region.mapping {
        Mapping::Canvas(uv) | Mapping::Frustum { uv, .. } => {
            (at_centres(uv, region, WHAT)?.map(upwards), "idealEyePoint")
        }
        Mapping::Identity => {
            let corners = vec![
                [0.0, 1.0, 0.0],
                [1.0, 1.0, 0.0],
                [0.0, 0.0, 0.0],
                [1.0, 0.0, 0.0],
            ];
            let even = Grid {
                width: 2,
                height: 2,
                placement: crate::Placement::Corners,
                values: corners,
            };
            (at_centres(&even, region, WHAT)?, "idealEyePoint")
        }
        Mapping::Points {
            points_m,
            origin,
            projector,
        } => {
            let axes = projector
                .as_ref()
                .map_or(Axes::ROOM, |projector| projector.axes);
            let turned = at_centres(points_m, region, WHAT)?.map(|point| {
                axes.from_room(point.map(f64::from))
                    .map(|value| value as f32)
            });
            (turned, origin_name(*origin))
        }
    })
}

fn origin_name(origin: PointOrigin) -> &'static str {
    match origin {
        PointOrigin::CentreOfMass => "centerOfMass",
        PointOrigin::IdealEyePoint => "idealEyePoint",
        PointOrigin::FloorCentre => "floorCenter",
        // As the reference code spells it.
        PointOrigin::Unknown => "unkown",
    }
}

fn at_centres<T: Sample>(
    grid: &Grid<T>,
    region: &Region,
    what: &'static str,
) -> Result<Grid<T>, WriteError> {
    let bad = || WriteError::BadSize {
        region: region.name.clone(),
        what,
    };
    if grid.placement == crate::Placement::Centres {
        return Grid::new(grid.width, grid.height, grid.placement, grid.values.clone())
            .ok_or_else(bad);
    }
    let [width, height] = region.size_px;
    grid.resampled(width, height).ok_or_else(bad)
}

fn region_text(region: &Region, place: &CanvasPlace) -> String {
    let mut xml = String::new();
    let [width, height] = region.size_px;
    let name = escaped(&region.name);
    let (x, y, xsize, ysize) = (
        place.x,
        1.0 - (place.y + place.height),
        place.width,
        place.height,
    );
    line(
        &mut xml,
        &format!(
            "      <region id=\"{name}\" Xresolution=\"{width}\" Yresolution=\"{height}\" x=\"{x}\" y=\"{y}\" xsize=\"{xsize}\" ysize=\"{ysize}\">"
        ),
    );
    match &region.mapping {
        Mapping::Frustum { frustum, .. } => frustum_text(&mut xml, frustum),
        Mapping::Points {
            projector: Some(projector),
            ..
        } => projector_text(&mut xml, projector),
        _ => {}
    }
    line(&mut xml, "      </region>");
    xml
}

fn frustum_values(frustum: &Frustum) -> [(&'static str, f64); 7] {
    [
        ("yaw", frustum.yaw_deg),
        ("pitch", frustum.pitch_deg),
        ("roll", frustum.roll_deg),
        ("rightAngle", frustum.right_deg),
        ("leftAngle", frustum.left_deg),
        ("upAngle", frustum.up_deg),
        ("downAngle", frustum.down_deg),
    ]
}

fn frustum_text(xml: &mut String, frustum: &Frustum) {
    line(xml, "        <frustum>");
    for (key, value) in frustum_values(frustum) {
        line(xml, &format!("          <{key}>{value}</{key}>"));
    }
    line(xml, "        </frustum>");
}

fn projector_text(xml: &mut String, projector: &Projector) {
    frustum_text(xml, &projector.frustum);
    line(xml, "        <coordinateFrame>");
    let Axes { yaw, pitch, roll } = projector.axes;
    let position = projector.axes.from_room(projector.position_m);
    for (name, vector) in [
        ("pos", position),
        ("yaw", yaw),
        ("pitch", pitch),
        ("roll", roll),
    ] {
        for (axis, value) in ["x", "y", "z"].iter().zip(vector) {
            line(
                xml,
                &format!("          <{name}{axis}>{value}</{name}{axis}>"),
            );
        }
    }
    line(xml, "        </coordinateFrame>");
}

fn line(xml: &mut String, text: &str) {
    xml.push_str(text);
    xml.push('\n');
}

/// Text as the value of an attribute. What XML cannot hold is replaced.
fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            control if control.is_control() => safe.push('\u{FFFD}'),
            other => safe.push(other),
        }
    }
    safe
}
