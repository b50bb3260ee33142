//! MPCDI: Multiple Projection Common Data Interchange.
//! Layout: VESA's "MPCDI Standard" 1.0 and 2.0 as its reference code reads and writes it (scaredyfish/MPCDI, BSD, Scalable
//! Display Technologies: `src/IO/mpcdiReaderIntern.cpp`, `mpcdiWriterIntern.cpp`, `mpcdiXMLStrings.h`, `mpcdiPfmIO.cpp`;
//! also drwrose/PyMPCDI and tvaneerd/mpcdi, `MPCDI_explained.md`). In: an archive. Out: regions, or the reverse. What it
//! cannot carry over, it lists.

mod archive;
mod document;
mod fileset;
mod picture;
mod write;
mod xml;

use self::archive::Archive;
use self::document::{Document, Profile, RegionEntry};
use self::fileset::{FileSet, LightEntry};
use crate::grid::Grid;
use crate::options::Options;
use crate::read::{check_choice, check_mapping};
use crate::{Axes, Calibration, Gamma, Map, Mapping, Projector, ReadError, Region, Uplift, pfm};

pub use write::{WriteError, write};

/// Names of the description. The standard says the first; the reference code also reads the second.
const DESCRIPTIONS: [&str; 2] = ["mpcdi.xml", "mpacs.xml"];

/// Reads an archive.
///
/// The picture's coordinates in an archive count from the **lower** left corner, upwards, and so does the place of
/// a region in its buffer (drwrose/PyMPCDI, `MpacsWarp2DShader.py`: the values are scaled by the region's size and
/// place, then flipped for a picture whose rows come from the top); they are turned here to count from the upper
/// one. Geometry values are places in the region's picture. A PFM starts with its bottom row (`mpcdiPfmIO.cpp`); for
/// writers that start with the top row there is [`RowOrder`](crate::RowOrder).
///
/// In the profile `sl`, points and the projector's place are turned from the coordinate frame's axes to x right, y
/// up, z towards the viewers: the pitch axis points to the right, the yaw axis down and the roll axis ahead
/// (tvaneerd/mpcdi, `MPCDI_explained.md`).
///
/// # Errors
/// What is wrong, in which part, and the remedy.
pub(crate) fn read(bytes: &[u8], file: &str, options: &Options) -> Result<Calibration, ReadError> {
    let mut archive = Archive::open(bytes, file, options.limits)?;
    let (name, text) = archive.description(&DESCRIPTIONS)?;
    let label = format!("{file}/{name}");
    let document = Document::parse(&text, &label, options.limits.regions)?;
    drop(text);
    let names: Vec<&str> = document
        .regions
        .iter()
        .map(|region| region.name.as_str())
        .collect();
    let chosen = check_choice(file, options, &names)?;
    let mut notes = document.notes.clone();
    let mut regions = Vec::new();
    for (index, entry) in document.regions.iter().enumerate() {
        if chosen.is_none_or(|chosen| chosen == index) {
            notes.extend(entry.notes.iter().cloned());
            let mut reading = Reading {
                archive: &mut archive,
                file,
                options,
                notes: &mut notes,
            };
            regions.push(reading.region(entry, document.profile)?);
        }
    }
    Ok(Calibration {
        regions,
        date: document.date,
        notes,
    })
}

struct Reading<'a, 'b> {
    archive: &'a mut Archive<'b>,
    file: &'a str,
    options: &'a Options,
    notes: &'a mut Vec<String>,
}

impl Reading<'_, '_> {
    fn region(&mut self, entry: &RegionEntry, profile: Profile) -> Result<Region, ReadError> {
        let files = &entry.files;
        let label = format!("{}/{}", self.file, files.geometry.path);
        let geometry = self.float_map(&files.geometry.path)?;
        let upwards = |[u, v, _]: [f32; 3]| [u, 1.0 - v];
        let mapping = match profile {
            Profile::TwoD => Mapping::Canvas(pfm::channels(geometry, upwards)),
            Profile::ThreeD => Mapping::Frustum {
                frustum: entry.frustum.unwrap_or_default(),
                uv: pfm::channels(geometry, upwards),
            },
            Profile::AdvancedThreeD => Mapping::Points {
                points_m: self.points(geometry, files, &Axes::ROOM),
                origin: files.geometry.origin,
                projector: None,
            },
            Profile::ShaderLamp => {
                let frame = entry.frame.clone().unwrap_or_default();
                let position_m = frame
                    .axes
                    .to_room(frame.position.map(|value| value * files.geometry.unit_m));
                Mapping::Points {
                    points_m: self.points(geometry, files, &frame.axes),
                    origin: files.geometry.origin,
                    projector: Some(Box::new(Projector {
                        position_m,
                        frustum: entry.frustum.unwrap_or_default(),
                        axes: frame.axes,
                    })),
                }
            }
        };
        check_mapping(&label, &mapping)?;
        let alpha = self.light(files.alpha.as_ref(), entry)?;
        let beta = self.light(files.beta.as_ref(), entry)?;
        let distortion = match &files.distortion {
            Some(path) => Some(pfm::channels(self.float_map(path)?, upwards)),
            None => None,
        };
        let gamma = |light: &Option<LightEntry>| light.as_ref().map_or(1.0, |light| light.gamma);
        Ok(Region {
            name: entry.name.clone(),
            size_px: entry.size_px,
            mapping,
            alpha,
            beta,
            gamma: Gamma {
                alpha: gamma(&files.alpha),
                beta: gamma(&files.beta),
            },
            uplift: Uplift::default(),
            canvas: Some(entry.canvas.clone()),
            distortion,
        })
    }

    fn points(&self, geometry: Grid<[f32; 3]>, files: &FileSet, axes: &Axes) -> Grid<[f32; 3]> {
        let unit_m = files.geometry.unit_m;
        let turned = pfm::channels(geometry, |point| point).map(|point| {
            axes.to_room(point.map(|value| f64::from(value) * unit_m))
                .map(|value| value as f32)
        });
        // A scale may take a number out of range: that is a hole as well.
        pfm::channels(turned, |point| point)
    }

    fn float_map(&mut self, path: &str) -> Result<Grid<[f32; 3]>, ReadError> {
        let label = format!("{}/{path}", self.file);
        let (rows, limit) = (self.options.pfm_rows, self.options.limits.part_bytes);
        self.archive
            .read(path, |reader| pfm::read(reader, &label, rows, limit))
    }

    fn light(
        &mut self,
        light: Option<&LightEntry>,
        entry: &RegionEntry,
    ) -> Result<Option<Map>, ReadError> {
        let Some(light) = light else {
            return Ok(None);
        };
        let label = format!("{}/{}", self.file, light.path);
        let packed = self.archive.bytes(&light.path)?;
        let (map, depth) = picture::read(&packed, &label, entry.size_px)?;
        let channels = match map.texels {
            crate::Texels::Grey(_) => 1,
            crate::Texels::Colour(_) => 3,
        };
        if light.channels.is_some_and(|told| told != channels)
            || light.depth.is_some_and(|told| told != depth)
        {
            self.notes.push(format!(
                "{label}: the picture has {channels} channels of {depth} bits, other than the description says"
            ));
        }
        Ok(Some(map))
    }
}
