//! NetCDF grids: a variable over latitude and longitude, or over y and x with a stated system.
//! In: a classic or NetCDF-4 file. Out: a source read in bands of rows, with the fill value, scale and offset of the
//! CF conventions (version 1.8, §2.5.1 and §8.1). Grids that are not evenly spaced are refused.

use std::path::Path;
use std::sync::Arc;

use netcdf_reader::{NcFile, NcSliceInfo, NcSliceInfoElem, NcType, NcVariable};
use tiles::Kind;

use super::pixels::{Bands, Colour, Number, RawSamples};
use super::reading::Reading;
use super::{Description, Pixels, Raster, Source, badly_placed};
use crate::crs::Crs;
use crate::error::SourceError;
use crate::grid::{Affine, Grid};
use crate::options::ImportOptions;

/// Bytes of a band of rows, about.
const BAND_BYTES: u64 = 4 << 20;

/// Opens the one grid of a file.
pub(super) fn open(
    path: &Path,
    file: &str,
    options: &ImportOptions,
) -> Result<Source, SourceError> {
    let broken = |error: netcdf_reader::Error| broken(file, &error);
    let refuse = |problem: String, remedy: &str| Err(SourceError::refused(file, problem, remedy));
    let opened = NcFile::open(path).map_err(broken)?;
    let variables = opened.variables().map_err(broken)?;
    let names: Vec<&str> = variables
        .iter()
        .filter(|v| is_grid(v))
        .map(NcVariable::name)
        .collect();
    let [name] = names[..] else {
        return refuse(
            format!(
                "it holds {} grids ({}), and one is needed",
                names.len(),
                names.join(", ")
            ),
            "Take one out first, for example with gdal_translate NETCDF:FILE:VARIABLE OUT.",
        );
    };
    let variable = opened.variable(name).map_err(broken)?;
    let shape = variable.shape();
    let leading = shape.len() - 2;
    let (Some(height), Some(width)) = (shape.get(leading), shape.get(leading + 1)) else {
        return refuse(
            "its grid has no two dimensions".to_owned(),
            "Write it as a plain grid.",
        );
    };
    let (Ok(width), Ok(height)) = (u32::try_from(*width), u32::try_from(*height)) else {
        return refuse(
            format!("its grid of {width}×{height} is too large"),
            "Split it.",
        );
    };
    let axis = |dimension: usize| -> Result<Axis, SourceError> {
        let name = variable
            .dimensions()
            .get(dimension)
            .map_or("", |d| d.name.as_str());
        let Ok(coordinates) = opened.variable(name) else {
            return Err(SourceError::refused(
                file,
                format!("its dimension {name} has no coordinates"),
                "Write the coordinates of rows and columns as variables of the same names.",
            ));
        };
        let numbers = opened.read_variable_as_f64(name).map_err(broken)?;
        Axis::of(file, coordinates, numbers.iter().copied().collect())
    };
    let (y, x) = (axis(leading)?, axis(leading + 1)?);
    let crs = match &options.crs {
        Some(text) => Crs::parse(text, &options.planet),
        None if x.degrees && y.degrees => Ok(Crs::degrees()),
        None => {
            return refuse(
                "its coordinates are not degrees of longitude and latitude".to_owned(),
                "State their system with --crs EPSG:number or a PROJ string.",
            );
        }
    };
    let crs = crs.map_err(|problem| SourceError::refused(file, problem.0, "Correct --crs."))?;
    let to_crs = Affine {
        x0: x.first,
        dx_column: x.step,
        dx_row: 0.0,
        y0: y.first,
        dy_column: 0.0,
        dy_row: y.step,
    };
    // GMT marks grids of cells; coordinates are the middles of the cells even so.
    let cells = opened
        .global_attribute("node_offset")
        .ok()
        .and_then(|attribute| attribute.value.as_f64())
        .is_some_and(|offset| offset == 1.0);
    let registered = options.node_registered.unwrap_or(!cells);
    let grid = Grid::new(width, height, Arc::new(crs), to_crs, registered)
        .map_err(|clause| badly_placed(file, clause))?;
    let attribute = |name| variable.attribute(name).and_then(|a| a.value.as_f64());
    let nodata = attribute("_FillValue").or_else(|| attribute("missing_value"));
    let (number, integer) = match variable.dtype() {
        NcType::Float => (Number::F32, false),
        NcType::Double => (Number::F64, false),
        _ => (Number::F64, true),
    };
    let bands = Bands {
        count: 1,
        number,
        colour: Colour::Plain,
        alpha: None,
        nodata,
    };
    if options.kind == Kind::Imagery {
        return refuse(
            "a NetCDF grid is one band of numbers, not imagery".to_owned(),
            "Import it with --kind elevation or sar.",
        );
    }
    let reading = Reading::choose(file, bands, options)?;
    let band_rows = (BAND_BYTES / (u64::from(width) * 8)).clamp(1, u64::from(height)) as u32;
    let elevation = options.kind == Kind::Elevation;
    let scaled = |name, neutral: f64| attribute(name).filter(|_| elevation).unwrap_or(neutral);
    let description = Description {
        file: file.to_owned(),
        grid,
        channels: 1,
        integer,
        sample_type: reading.sample_type(),
        scale: scaled("scale_factor", 1.0),
        offset: scaled("add_offset", 0.0),
        chunk: (width, band_rows),
        chunk_bytes: u64::from(width) * u64::from(band_rows) * reading.bytes_a_pixel() as u64,
    };
    let raster = NetCdf {
        file: file.to_owned(),
        name: name.to_owned(),
        leading,
        height,
        width,
        band_rows,
        reading,
        opened,
    };
    Ok(Source::new(description, Box::new(raster)))
}

fn broken(file: &str, error: &netcdf_reader::Error) -> SourceError {
    SourceError::damaged(file, format!("the NetCDF file cannot be read ({error})"))
}

/// Two dimensions with more than one value each, any others with exactly one.
fn is_grid(variable: &NcVariable) -> bool {
    let shape = variable.shape();
    let numeric = matches!(
        variable.dtype(),
        NcType::Byte
            | NcType::UByte
            | NcType::Short
            | NcType::UShort
            | NcType::Int
            | NcType::UInt
            | NcType::Int64
            | NcType::UInt64
            | NcType::Float
            | NcType::Double
    );
    let Some((grid, leading)) = shape
        .len()
        .checked_sub(2)
        .map(|at| (&shape[at..], &shape[..at]))
    else {
        return false;
    };
    numeric && grid.iter().all(|n| *n > 1) && leading.iter().all(|n| *n == 1)
}

/// Evenly spaced coordinates.
struct Axis {
    first: f64,
    step: f64,
    degrees: bool,
}

impl Axis {
    fn of(file: &str, variable: &NcVariable, values: Vec<f64>) -> Result<Self, SourceError> {
        let (Some(first), Some(last)) = (values.first(), values.last()) else {
            return Err(SourceError::damaged(file, "a coordinate variable is empty"));
        };
        let step = (last - first) / (values.len() - 1).max(1) as f64;
        let even = step != 0.0
            && values.iter().enumerate().all(|(index, value)| {
                // Coordinates are often rounded to 32 bits.
                let due = first + step * index as f64;
                (value - due).abs() <= 0.01 * step.abs() + 1e-6 * due.abs()
            });
        if !even {
            return Err(SourceError::refused(
                file,
                format!("its coordinates {} are not evenly spaced", variable.name()),
                "Resample it to an even grid, for example with gdalwarp.",
            ));
        }
        let text = |name| variable.attribute(name).and_then(|a| a.value.as_string());
        let units = text("units").unwrap_or_default().to_ascii_lowercase();
        let name = variable.name().to_ascii_lowercase();
        let degrees = units.starts_with("degree")
            || (units.is_empty()
                && ["lat", "latitude", "lon", "longitude"].contains(&name.as_str()));
        Ok(Self {
            first: *first,
            step,
            degrees,
        })
    }
}

struct NetCdf {
    file: String,
    name: String,
    leading: usize,
    height: u32,
    width: u32,
    band_rows: u32,
    reading: Reading,
    opened: NcFile,
}

impl Raster for NetCdf {
    fn read(&self, _column: u32, row: u32) -> Result<Pixels, SourceError> {
        let first = row * self.band_rows;
        let rows = self.band_rows.min(self.height.saturating_sub(first));
        let mut selections = vec![NcSliceInfoElem::Index(0); self.leading];
        let (start, end) = (u64::from(first), u64::from(first + rows));
        selections.push(NcSliceInfoElem::Slice {
            start,
            end,
            step: 1,
        });
        selections.push(NcSliceInfoElem::Slice {
            start: 0,
            end: u64::from(self.width),
            step: 1,
        });
        let numbers = self
            .opened
            .read_variable_slice_as_f64(&self.name, &NcSliceInfo { selections })
            .map_err(|error| broken(&self.file, &error))?;
        if numbers.len() != rows as usize * self.width as usize {
            return Err(SourceError::damaged(&self.file, "the grid is cut off"));
        }
        let raw = match self.reading.number() {
            Number::F32 => RawSamples::F32(numbers.iter().map(|n| *n as f32).collect()),
            _ => RawSamples::F64(numbers.iter().copied().collect()),
        };
        Ok(self.reading.pixels(self.width, rows, raw, None))
    }
}
