//! Data sets that tiles can be loaded from, and how they are found by their places.
//!
//! In: places as scenes name them, a source of tile files. Out: a description, an index, single tiles past any cache.
//! It keeps nothing.

use std::path::Path;

use geodesy::Tile;
use thiserror::Error;

use crate::dataset::Dataset;
use crate::format::{DecodeError, TileData};
use crate::index::Index;
use crate::repository::{Repository, RepositoryError, Source, SourceError};

/// Why a tile could not be read beside the cache.
#[derive(Debug, Error)]
pub enum ReadError {
    /// Its bytes could not be had.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// Its bytes are no such tile.
    #[error("tile {tile}: {source}")]
    Decode {
        /// The tile.
        tile: Tile,
        /// What is wrong with it.
        source: DecodeError,
    },
}

/// Opens repositories, wherever they are: directories here, addresses elsewhere.
pub trait Opener: Send + Sync {
    /// Opens the repository at a place as scenes name it, and reads its index. May block.
    fn open(&self, place: &Path) -> Result<OpenDataset, Box<dyn std::error::Error + Send + Sync>>;

    /// Opens a repository that was opened before if it may have changed since; `None` if it has not, or if nobody can
    /// tell at present. May block.
    fn reopen(
        &self,
        place: &Path,
    ) -> Result<Option<OpenDataset>, Box<dyn std::error::Error + Send + Sync>> {
        self.open(place).map(Some)
    }
}

/// Opens directories.
#[derive(Clone, Copy, Debug, Default)]
pub struct Directories;

/// A data set that tiles can be loaded from.
pub struct OpenDataset {
    /// Its description.
    pub dataset: Dataset,
    /// Which tiles it has.
    pub index: Index,
    pub(crate) source: Box<dyn Source>,
}

impl OpenDataset {
    /// A data set of which tiles come from `source`.
    #[must_use]
    pub fn new(dataset: Dataset, index: Index, source: Box<dyn Source>) -> Self {
        Self {
            dataset,
            index,
            source,
        }
    }

    /// Reads one tile past the cache, while the caller waits: for figures of the data set that must be known
    /// before anything is shown. `None` where there is no such tile.
    pub fn read_now(&self, tile: Tile) -> Result<Option<TileData>, ReadError> {
        let Some(bytes) = self.source.fetch(tile)? else {
            return Ok(None);
        };
        let decoded = TileData::decode_tile(&bytes, tile);
        decoded
            .map(Some)
            .map_err(|source| ReadError::Decode { tile, source })
    }

    /// Opens the repository in a directory and reads its index.
    pub fn of_repository(path: &Path) -> Result<Self, RepositoryError> {
        let repository = Repository::open(path)?;
        let index = repository.load_index()?;
        Ok(Self::new(
            repository.dataset().clone(),
            index,
            Box::new(repository),
        ))
    }
}

impl Opener for Directories {
    fn open(&self, place: &Path) -> Result<OpenDataset, Box<dyn std::error::Error + Send + Sync>> {
        Ok(OpenDataset::of_repository(place)?)
    }
}
