//! Source rasters to a tile repository.
//!
//! In: GeoTIFF, SRTM cells, pictures, headerless and NetCDF grids, each with its place on the planet. Out: tiles of one
//! level and of all coarser ones, in a repository that is new or already holds others. Every node of the lattice has one
//! value, whichever tiles share it. Memory is bounded, all cores work, a killed import goes on where it stopped.
//!
//! The way of a sample: [`import`] opens the sources (`source`), chooses a level (`level`), places the lattice in each
//! source (`placing`), reads between its samples (`sampler`, `resample`), puts tiles together (`pass`), filters the
//! coarser levels (`filter`) and publishes (`staging`).

mod crs;
mod describe;
mod error;
mod filter;
mod geokeys;
mod grid;
mod level;
mod lock;
mod lru;
mod nodes;
mod options;
mod pass;
mod pipeline;
mod placing;
mod progress;
mod report;
mod resample;
mod sampler;
mod source;
mod staging;

pub use error::{ImportError, SourceError};
pub use options::{Endianness, Extent, ImportOptions, RawLayout, RawSample};
pub use pipeline::import;
pub use progress::{Bar, Progress, Silent};
pub use report::ImportReport;

/// What is in a repository. The command that imports also inspects, and must not know more crates than this one.
pub mod inspect {
    pub use tiles::{
        InspectError, Summary, TileSummary, ValueAt, inspect_repository, inspect_tile, value_at,
    };
}

pub use geodesy::Ellipsoid;
pub use tiles::{Dataset, Kind};
