//! Reading any calibration.
//! In: bytes, the name they go by, and options. Out: a [`Calibration`]. The convenience [`load`] alone opens a file.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::options::{Format, Options, PfmMeaning};
use crate::{
    Calibration, Gamma, Map, Mapping, PointOrigin, ReadError, Region, Uplift, bourke, detect,
    domeprojection, mpcdi, obj, pfm, vwf,
};

/// Reads a calibration from memory. `file` names the bytes in errors, usually their path; its extension tells the
/// format where neither the options nor the contents do.
///
/// # Errors
/// What is wrong, in which part, and the remedy.
pub fn read(bytes: &[u8], file: &str, options: &Options) -> Result<Calibration, ReadError> {
    let format = options.format.or_else(|| detect(bytes, file));
    let Some(format) = format else {
        return Err(match bytes.trim_ascii_start() {
            [b'<', ..] => ReadError::Unsupported {
                file: file.to_owned(),
                what: "a description without its archive".to_owned(),
                remedy: "Give the .mpcdi archive that holds the description and its maps.",
            },
            _ => ReadError::UnknownFormat {
                file: file.to_owned(),
            },
        });
    };
    match format {
        Format::Mpcdi => mpcdi::read(bytes, file, options),
        Format::Vwf => vwf::read(bytes, file, options),
        Format::Pfm => read_pfm(bytes, file, options),
        Format::Obj => {
            let size_px = needed_size(file, options)?;
            single(
                file,
                options,
                size_px,
                obj::read(bytes, file, options, size_px)?,
                None,
            )
        }
        Format::Domeprojection => {
            let size_px = needed_size(file, options)?;
            single(
                file,
                options,
                size_px,
                domeprojection::read(bytes, file, size_px)?,
                None,
            )
        }
        Format::Bourke => {
            let size_px = needed_size(file, options)?;
            let (mapping, alpha) = bourke::read(bytes, file, size_px)?;
            single(file, options, size_px, mapping, alpha)
        }
    }
}

/// Reads a calibration from a file of at most `limits.total_bytes`.
///
/// # Errors
/// As [`read`], or the file cannot be read.
pub fn load(path: &Path, options: &Options) -> Result<Calibration, ReadError> {
    let file = path.to_string_lossy();
    let unreadable = |source| ReadError::Unreadable {
        file: file.clone().into_owned(),
        source,
    };
    let limit_bytes = options.limits.total_bytes;
    let mut bytes = Vec::new();
    File::open(path)
        .map_err(unreadable)?
        .take(limit_bytes.saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    if bytes.len() as u64 > limit_bytes {
        return Err(ReadError::TooLarge {
            file: file.into_owned(),
            limit_bytes,
        });
    }
    read(&bytes, &file, options)
}

fn needed_size(file: &str, options: &Options) -> Result<[u32; 2], ReadError> {
    let [width, height] = options.size_px.ok_or_else(|| ReadError::SizeNeeded {
        file: file.to_owned(),
    })?;
    check_size(file, u64::from(width), u64::from(height))
}

/// A size of 1…16384.
pub(crate) fn check_size(file: &str, width: u64, height: u64) -> Result<[u32; 2], ReadError> {
    let range = 1..=u64::from(crate::MAX_SIZE_PX);
    if !range.contains(&width) || !range.contains(&height) {
        return Err(ReadError::BadSize {
            file: file.to_owned(),
            width,
            height,
        });
    }
    Ok([width as u32, height as u32])
}

fn read_pfm(bytes: &[u8], file: &str, options: &Options) -> Result<Calibration, ReadError> {
    let mut reader = bytes;
    let grid = pfm::read(
        &mut reader,
        file,
        options.pfm_rows,
        options.limits.part_bytes,
    )?;
    let size_px = match options.size_px {
        Some(_) => needed_size(file, options)?,
        None => [grid.width, grid.height],
    };
    let mapping = match options.pfm {
        PfmMeaning::Canvas => Mapping::Canvas(pfm::channels(grid, |[u, v, _]| [u, 1.0 - v])),
        PfmMeaning::Points => {
            let unit_m = options.unit_m;
            Mapping::Points {
                points_m: pfm::channels(grid, |point| point)
                    .map(|point| point.map(|value| value * unit_m)),
                origin: PointOrigin::Unknown,
                projector: None,
            }
        }
    };
    single(file, options, size_px, mapping, None)
}

/// The one region of a format that has only one.
fn single(
    file: &str,
    options: &Options,
    size_px: [u32; 2],
    mapping: Mapping,
    alpha: Option<Map>,
) -> Result<Calibration, ReadError> {
    check_choice(file, options, &[""])?;
    check_mapping(file, &mapping)?;
    let region = Region {
        name: String::new(),
        size_px,
        mapping,
        alpha,
        beta: None,
        gamma: Gamma::default(),
        uplift: Uplift::default(),
        canvas: None,
        distortion: None,
    };
    Ok(Calibration {
        regions: vec![region],
        ..Calibration::default()
    })
}

/// The place of the chosen region among these names; `None`: all are wanted.
pub(crate) fn check_choice(
    file: &str,
    options: &Options,
    names: &[&str],
) -> Result<Option<usize>, ReadError> {
    let Some(choice) = &options.region else {
        return Ok(None);
    };
    let place = choice.among(names).ok_or_else(|| ReadError::NoRegion {
        file: file.to_owned(),
        wanted: choice.to_string(),
        known: if names == [""] {
            "one without a name, number 0".to_owned()
        } else {
            names.join(", ")
        },
    })?;
    Ok(Some(place))
}

/// Geometry must show something somewhere.
pub(crate) fn check_mapping(file: &str, mapping: &Mapping) -> Result<(), ReadError> {
    let shows_nothing = match mapping {
        Mapping::Canvas(uv) | Mapping::Frustum { uv, .. } => uv.shows_nothing(),
        Mapping::Points { points_m, .. } => points_m.is_empty(),
        Mapping::Identity => false,
    };
    if shows_nothing {
        return Err(ReadError::NothingMapped {
            file: file.to_owned(),
        });
    }
    Ok(())
}

/// Light must be known everywhere.
pub(crate) fn check_light(file: &str, what: &'static str, map: &Map) -> Result<(), ReadError> {
    match map.first_not_a_number() {
        None => Ok(()),
        Some((column, row)) => Err(ReadError::NotANumber {
            file: file.to_owned(),
            what,
            column,
            row,
        }),
    }
}
