//! Looking after a directory of cached tiles from outside: what is in it, whether it is whole, emptying it.
//!
//! In: the directory. Out: counts and reasons, in the words of the disk cache, and which of its names are whose. It
//! decodes no tile: the checksums of the files say whether each is as it was written.

use std::path::{Path, PathBuf};

use disk_cache::{DiskCache, Name, NameError};
use geodesy::Tile;

pub use disk_cache::{Broken, Files, MaintenanceError, Statistics, Verification};

use crate::dataset::Dataset;
use crate::repository::relative_path;

/// Counts what a cache directory holds. Works beside processes that use it.
///
/// # Errors
/// [`MaintenanceError`] where it cannot be read.
pub fn statistics(root: &Path) -> Result<Statistics, MaintenanceError> {
    DiskCache::statistics(root)
}

/// Reads every file of a cache directory and holds it against its checksums; removes what is broken if `remove_bad`.
/// `go_on` is told the files and bytes that were read so far, and how many there are; where it says no, what was found
/// so far is all.
///
/// # Errors
/// [`MaintenanceError`] where the directory cannot be read.
pub fn verify(
    root: &Path,
    remove_bad: bool,
    go_on: impl FnMut(Files, Files) -> bool,
) -> Result<Verification, MaintenanceError> {
    DiskCache::verify(root, remove_bad, go_on)
}

/// Removes all cached files of a directory, and nothing else; says what was removed.
///
/// # Errors
/// [`MaintenanceError`] where the directory cannot be read, or a file not be removed.
pub fn clear(root: &Path) -> Result<Files, MaintenanceError> {
    DiskCache::clear(root)
}

/// The group of a data set's tiles: its id, a hyphen, its revision. Another import makes another group.
#[must_use]
pub fn group_of(dataset: &Dataset) -> String {
    format!("{}-{}", dataset.id, dataset.revision)
}

/// The path of a tile's file below the root of a cache directory.
///
/// # Errors
/// A name that no file may have: a defect of the program.
pub fn file_of(dataset: &Dataset, tile: Tile) -> Result<PathBuf, NameError> {
    Ok(Name::new(&group_of(dataset), &relative_path(tile))?.file())
}
