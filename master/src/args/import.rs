//! The arguments of `terrawall import`.

use std::path::PathBuf;

use clap::{Args as ArgumentGroup, ValueEnum};

use super::values::{Extent, Range, RawSize};

/// Kind of data, as `--kind` names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DataKind {
    /// Heights in metres: relief
    Elevation,
    /// Colours, grey values, or up to 16 bands as a sensor delivered them
    Imagery,
    /// Radar amplitude or backscatter
    Sar,
}

/// Where the outermost samples of a grid lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Registration {
    /// On the edges of the extent
    Node,
    /// Half a cell inside the edges
    Area,
}

/// Bodies with known ellipsoids.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Planet {
    /// WGS84
    Earth,
    /// IAU sphere of the Moon
    Moon,
    /// IAU ellipsoid of Mars
    Mars,
}

/// Number types of headerless grids.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names say it")]
pub(crate) enum RawType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    F32,
    F64,
}

/// Byte orders of headerless grids.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ByteOrder {
    /// Lowest byte first
    Little,
    /// Highest byte first
    Big,
}

/// `terrawall import`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct Import {
    /// GeoTIFF, COG, SRTM .hgt (also zipped), NetCDF grid, PNG, JPEG or raw grid
    #[arg(required = true, value_name = "SRC")]
    pub(crate) sources: Vec<PathBuf>,
    /// Repository to build or to extend
    #[arg(long, value_name = "DIR")]
    pub(crate) into: PathBuf,
    /// What the samples are
    #[arg(long, value_enum)]
    pub(crate) kind: DataKind,
    /// Bounds in degrees of a source that does not carry its own: west,south,east,north
    #[arg(long, value_name = "W,S,E,N", allow_hyphen_values = true)]
    pub(crate) extent: Option<Extent>,
    /// Coordinate system in place of the source's own: EPSG:number or a PROJ string
    #[arg(long, value_name = "CRS")]
    pub(crate) crs: Option<String>,
    /// Where the outermost samples lie, in place of what the source says
    #[arg(long, value_enum, value_name = "WHERE")]
    pub(crate) registration: Option<Registration>,
    /// Sample that means "no data", in place of what the source says
    #[arg(long, value_name = "V", allow_hyphen_values = true)]
    pub(crate) nodata: Option<f64>,
    /// Bands to use, counted from 1: one, or up to 16 for imagery [default for imagery: all]
    #[arg(long, value_name = "B,B,B", value_delimiter = ',')]
    pub(crate) bands: Option<Vec<usize>>,
    /// Store imagery in 8 bits a channel, with these source samples as black and as white [default: 8-bit, 16-bit and
    /// floating-point samples stay as they are, to be adjusted while the wall runs]
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true)]
    pub(crate) range: Option<Range>,
    /// Level of the pyramid to import at [default: the next finer one than the source]
    #[arg(long, value_name = "L", value_parser = clap::value_parser!(u8).range(0..=22))]
    pub(crate) level: Option<u8>,
    /// Body of a new repository
    #[arg(long, value_enum, default_value_t = Planet::Earth)]
    pub(crate) planet: Planet,
    /// Elevation step of a new repository in metres, a power of two [default: 1/16 of the source's]
    #[arg(long, value_name = "M")]
    pub(crate) quantum: Option<f64>,
    /// Name of a new repository [default: its directory's]
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Read the sources as headerless grids of this size, rows from north to south
    #[arg(long, value_name = "WIDTHxHEIGHT", requires = "raw_type")]
    pub(crate) raw_size: Option<RawSize>,
    /// Number type of headerless grids
    #[arg(long, value_enum, value_name = "TYPE", requires = "raw_size")]
    pub(crate) raw_type: Option<RawType>,
    /// Byte order of headerless grids
    #[arg(long, value_enum, default_value_t = ByteOrder::Little, value_name = "ORDER")]
    pub(crate) raw_order: ByteOrder,
    /// Bytes before the first sample of headerless grids
    #[arg(long, value_name = "BYTES", default_value_t = 0)]
    pub(crate) raw_header: u64,
    /// Bands of headerless grids, interleaved by pixel
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=16))]
    pub(crate) raw_bands: u32,
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) threads: Option<u32>,
    /// Memory for decoded sources and tiles
    #[arg(long, value_name = "MIB", default_value_t = 512, value_parser = clap::value_parser!(u64).range(64..))]
    pub(crate) memory: u64,
    /// Print a summary as JSON on standard output
    #[arg(long)]
    pub(crate) json: bool,
    /// Write the summary as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
}
