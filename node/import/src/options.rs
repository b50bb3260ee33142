//! What an import is asked to do.
//! In: nothing. Out: the option types that the command line fills in. No defaults that depend on a source.

use std::path::PathBuf;

use geodesy::Ellipsoid;
use serde::{Deserialize, Serialize};
use tiles::Kind;

/// One import: sources into a repository.
#[derive(Clone, Debug)]
pub struct ImportOptions {
    /// Source files, at least one. Where they overlap at one level, later ones win.
    pub sources: Vec<PathBuf>,
    /// The repository's directory; made where it does not exist.
    pub into: PathBuf,
    /// What the samples mean.
    pub kind: Kind,
    /// Where a source without georeference lies.
    pub extent: Option<Extent>,
    /// The coordinate system in place of the sources' own: `EPSG:number` or a PROJ string.
    pub crs: Option<String>,
    /// True where the outermost samples lie on the edges of the extent (grid lines), false where they are
    /// the middles of cells; in place of what the sources say.
    pub node_registered: Option<bool>,
    /// The layout of headerless grids; every source is then read as one.
    pub raw: Option<RawLayout>,
    /// The sample that means "no data", in place of what the sources say.
    pub nodata: Option<f64>,
    /// The level to import at, 0…22, in place of the next finer one.
    pub level: Option<u8>,
    /// The planet, for a new repository.
    pub planet: Ellipsoid,
    /// Elevation quantum in metres, a power of two, for a new repository.
    pub quantum_m: Option<f64>,
    /// The data set's name, for a new repository.
    pub name: Option<String>,
    /// Source bands to use, counted from 1: one, or up to 16 for imagery, which otherwise takes all.
    pub bands: Option<Vec<usize>>,
    /// Source samples that become 0 and 255: imagery is then stored in bytes. Otherwise samples wider than a byte stay
    /// as they are.
    pub range: Option<[f64; 2]>,
    /// Threads; all cores where not given.
    pub threads: Option<usize>,
    /// Bytes for decoded source chunks and tiles together, at least 64 MiB.
    pub memory_bytes: u64,
}

/// A rectangle in degrees. West may be greater than east: it then crosses the antimeridian.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Extent {
    /// Longitude of the left edge.
    pub west: f64,
    /// Latitude of the lower edge.
    pub south: f64,
    /// Longitude of the right edge.
    pub east: f64,
    /// Latitude of the upper edge.
    pub north: f64,
}

/// A headerless grid of numbers: rows from north to south, samples from west to east.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RawLayout {
    /// Samples a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The number type.
    pub sample: RawSample,
    /// The byte order of numbers wider than a byte.
    pub endianness: Endianness,
    /// Bytes before the first sample.
    pub header_bytes: u64,
    /// Bands, interleaved by pixel; 1 for elevation. Three or four begin with red, green and blue.
    pub bands: usize,
}

/// The number type of a headerless grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RawSample {
    /// Unsigned byte.
    U8,
    /// Signed byte.
    I8,
    /// Unsigned 16 bits.
    U16,
    /// Signed 16 bits.
    I16,
    /// Unsigned 32 bits.
    U32,
    /// Signed 32 bits.
    I32,
    /// 32-bit floating point.
    F32,
    /// 64-bit floating point.
    F64,
}

/// The order of the bytes of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Endianness {
    /// Lowest byte first.
    Little,
    /// Highest byte first.
    Big,
}

impl RawSample {
    /// Bytes of one sample.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}
