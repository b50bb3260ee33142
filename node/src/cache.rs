//! The disk cache of this user and of walls, for those who look after it.
//!
//! In: walls, directories, places of repositories. Out: directories, what is in them, and whose it is. What nodes keep
//! there while they draw is the tile cache's business.

use std::path::{Path, PathBuf};

use protocol::Wall;
use render::Opener as _;

pub use render::upkeep::{
    Broken, Files, MaintenanceError, Statistics, Verification, clear, statistics, verify,
};

use crate::addresses::Addresses;
use crate::picture::PictureError;

/// A data set's place in a cache directory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// The data set's id, which is also how the names of all its groups begin.
    pub id: String,
    /// Its revision now.
    pub revision: u32,
    /// Its name, for people.
    pub name: String,
}

/// The wall's cache directory, else the user's; none where the user has no home.
#[must_use]
pub fn directory(wall: &Wall) -> Option<PathBuf> {
    let named = wall.cache.directory.as_ref().map(PathBuf::from);
    named.or_else(user_directory)
}

/// The cache directory of this user: `terrawall` in `$XDG_CACHE_HOME`, else in `$HOME/.cache` (XDG Base Directory
/// Specification, 0.8); none where neither is set.
#[must_use]
pub fn user_directory() -> Option<PathBuf> {
    let of_variable = |name: &str| {
        std::env::var_os(name)
            .filter(|value| !value.is_empty())
            .map(PathBuf::from)
    };
    let of_user = of_variable("XDG_CACHE_HOME")
        .or_else(|| of_variable("HOME").map(|home| home.join(".cache")));
    of_user.map(|caches| caches.join("terrawall"))
}

/// Whose the groups of a repository are. `place` is one as scenes name it, here or elsewhere; the caller waits for it.
///
/// # Errors
/// A repository that cannot be opened. The text names it.
pub fn group(place: &Path) -> Result<Group, PictureError> {
    let failed =
        |reason: String| PictureError::Scene(format!("cannot open {}: {reason}", place.display()));
    let repositories =
        crate::addresses::repositories().map_err(|error| failed(error.to_string()))?;
    let opener = Addresses(repositories);
    let opened = opener
        .open(place)
        .map_err(|error| failed(error.to_string()))?;
    let dataset = opened.dataset;
    Ok(Group {
        id: dataset.id.to_string(),
        revision: dataset.revision,
        name: dataset.name,
    })
}
