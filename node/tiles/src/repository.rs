//! A repository on a file system: one file a tile, an index, a description.
//!
//! In: tiles to write, tiles to read. Out: whole files, or none. A tile's path is the seed's scheme: the level
//! as a directory, then the tile's index within the level (three bits of face, then x and y interleaved) in
//! blocks of 12 bits as hexadecimal, so that no directory has more than 4096 entries (Lambers, "Realistic and
//! Interactive High-Resolution 4D Environments", §1.2.4). Interleaving keeps neighbours in one directory.

use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use geodesy::Tile;
use thiserror::Error;

use crate::dataset::{Dataset, DatasetError};
use crate::index::{INDEX_FILE, Index, IndexError};
use crate::publish::{Durability, PublishError, publish, sweep};

/// The ending of a tile file's name.
const ENDING: &str = ".tile";
/// Bits of the index in one path element.
const BLOCK_BITS: u32 = 12;

/// Where compressed tiles come from: a file system here, HTTP or an object store elsewhere.
pub trait Source: Send + Sync {
    /// The bytes of a tile file; `None` where the tile does not exist. May block.
    fn fetch(&self, tile: Tile) -> Result<Option<Vec<u8>>, SourceError>;

    /// Whether a fetch would fail at once since nothing can be reached. Never blocks.
    fn is_away(&self) -> bool {
        false
    }
}

/// Why a tile could not be fetched. Worth trying again.
#[derive(Debug, Error)]
#[error("cannot read {place}: {source}")]
pub struct SourceError {
    /// The path or address of the tile.
    pub place: String,
    /// What the system says.
    pub source: io::Error,
}

impl SourceError {
    /// Whether the place cannot be reached at all, whatever is asked for: nothing is wrong with the tile.
    #[must_use]
    pub fn is_unreachable(&self) -> bool {
        use io::ErrorKind as Kind;
        matches!(
            self.source.kind(),
            Kind::ConnectionRefused
                | Kind::HostUnreachable
                | Kind::NetworkDown
                | Kind::NetworkUnreachable
                | Kind::NotConnected
                | Kind::TimedOut
        )
    }
}

/// A repository directory.
#[derive(Clone, Debug)]
pub struct Repository {
    root: PathBuf,
    dataset: Dataset,
}

/// Why a repository could not be made, opened or changed.
#[derive(Debug, Error)]
pub enum RepositoryError {
    /// Something of another kind is there already.
    #[error("{path} holds a repository already (\"{name}\"): import into it, or choose another directory", path = path.display())]
    Exists {
        /// The directory.
        path: PathBuf,
        /// The name of its data set.
        name: String,
    },
    /// The description was refused.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The index was refused.
    #[error("{path}: {source}", path = path.display())]
    Index {
        /// The index file.
        path: PathBuf,
        /// Why.
        source: IndexError,
    },
    /// There is no index.
    #[error("{path} has no {INDEX_FILE}: its import was interrupted; run the same `terrawall import` again to finish it", path = path.display())]
    NoIndex {
        /// The repository.
        path: PathBuf,
    },
    /// A file could not be written.
    #[error(transparent)]
    Write(#[from] PublishError),
    /// The file system refused something else.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

impl Repository {
    /// Makes an empty repository; its directories are made as needed. Fails where there is one already.
    pub fn create(root: &Path, dataset: Dataset) -> Result<Self, RepositoryError> {
        match Dataset::load(root) {
            Err(DatasetError::NoRepository { .. }) => {}
            Ok(other) => {
                return Err(RepositoryError::Exists {
                    path: root.to_owned(),
                    name: other.name,
                });
            }
            Err(error) => return Err(error.into()),
        }
        fs::create_dir_all(root).map_err(|source| RepositoryError::Io {
            path: root.to_owned(),
            source,
        })?;
        dataset.store(root)?;
        Ok(Self {
            root: root.to_owned(),
            dataset,
        })
    }

    /// Opens a repository.
    pub fn open(root: &Path) -> Result<Self, RepositoryError> {
        Ok(Self {
            root: root.to_owned(),
            dataset: Dataset::load(root)?,
        })
    }

    /// Its directory.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Its description.
    #[must_use]
    pub const fn dataset(&self) -> &Dataset {
        &self.dataset
    }

    /// Changes the description and counts its revision up, so that no cache mixes tiles from before and after.
    /// Written atomically and flushed. To be called once an import has written its tiles and index.
    pub fn update(&mut self, change: impl FnOnce(&mut Dataset)) -> Result<(), RepositoryError> {
        let mut dataset = self.dataset.clone();
        change(&mut dataset);
        dataset.revision = self.dataset.revision.wrapping_add(1);
        dataset.store(&self.root)?;
        self.dataset = dataset;
        Ok(())
    }

    /// Removes what killed writers left behind. Files that may still be in the making are kept.
    pub fn sweep(&self) {
        sweep(&self.root);
    }

    /// The path of a tile's file, whether it exists or not.
    #[must_use]
    pub fn path_of(&self, tile: Tile) -> PathBuf {
        self.root.join(relative_path(tile))
    }

    /// The path of a tile's file under the root of any repository, for example `5/001/7ff.tile`. It is ASCII.
    #[must_use]
    pub fn relative_path_of(tile: Tile) -> PathBuf {
        relative_path(tile)
    }

    /// Whether a tile's file exists.
    #[must_use]
    pub fn contains(&self, tile: Tile) -> bool {
        self.path_of(tile).is_file()
    }

    /// The bytes of a tile's file; `None` where there is none.
    pub fn read(&self, tile: Tile) -> Result<Option<Vec<u8>>, RepositoryError> {
        let path = self.path_of(tile);
        match fs::read(&path) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(source) => Err(RepositoryError::Io { path, source }),
        }
    }

    /// Writes or replaces a tile's file. Readers see the old one or the new one.
    pub fn write_atomic(&self, tile: Tile, bytes: &[u8]) -> Result<(), RepositoryError> {
        Ok(publish(
            &self.root,
            &self.path_of(tile),
            bytes,
            Durability::Lazy,
        )?)
    }

    /// Removes a tile's file; false where there was none.
    pub fn remove(&self, tile: Tile) -> Result<bool, RepositoryError> {
        let path = self.path_of(tile);
        match fs::remove_file(&path) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
            Err(source) => Err(RepositoryError::Io { path, source }),
        }
    }

    /// Reads the index.
    pub fn load_index(&self) -> Result<Index, RepositoryError> {
        let path = self.root.join(INDEX_FILE);
        match fs::read(&path) {
            Ok(bytes) => {
                Index::decode(&bytes).map_err(|source| RepositoryError::Index { path, source })
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                Err(RepositoryError::NoIndex {
                    path: self.root.clone(),
                })
            }
            Err(source) => Err(RepositoryError::Io { path, source }),
        }
    }

    /// Writes the index, atomically and flushed.
    pub fn store_index(&self, index: &Index) -> Result<(), RepositoryError> {
        let path = self.root.join(INDEX_FILE);
        let bytes = index.encode().map_err(|source| RepositoryError::Index {
            path: path.clone(),
            source,
        })?;
        Ok(publish(&self.root, &path, &bytes, Durability::Synced)?)
    }

    /// All tiles whose files exist, with their sizes in bytes, by level and along the quadtree's curve. Walks
    /// the directories; files of other names are passed over.
    pub fn tiles(&self) -> Result<Vec<(Tile, u64)>, RepositoryError> {
        let mut found = Vec::new();
        for level in 0..=geodesy::MAX_LEVEL {
            let directory = self.root.join(level.to_string());
            if directory.is_dir() {
                walk(&directory, level, 0, &mut found).map_err(|source| RepositoryError::Io {
                    path: directory,
                    source,
                })?;
            }
        }
        found.sort_unstable_by_key(|(tile, _)| tile.id());
        Ok(found)
    }
}

impl Source for Repository {
    fn fetch(&self, tile: Tile) -> Result<Option<Vec<u8>>, SourceError> {
        let path = self.path_of(tile);
        match fs::read(&path) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(source) => Err(SourceError {
                place: path.display().to_string(),
                source,
            }),
        }
    }
}

/// The path of a tile under a repository's or a cache's root.
pub(crate) fn relative_path(tile: Tile) -> PathBuf {
    let level = u32::from(tile.level());
    let bits = 3 + 2 * level;
    let index = tile.id() - (8 << (2 * level));
    let mut path = level.to_string();
    for block in (0..bits.div_ceil(BLOCK_BITS)).rev() {
        // Writing to a string cannot fail.
        let _ = write!(
            path,
            "/{:03x}",
            index >> (block * BLOCK_BITS) & ((1 << BLOCK_BITS) - 1)
        );
    }
    path.push_str(ENDING);
    PathBuf::from(path)
}

fn walk(directory: &Path, level: u8, index: u64, found: &mut Vec<(Tile, u64)>) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        let (block, is_tile) = match name.strip_suffix(ENDING) {
            Some(block) => (block, true),
            None => (name, false),
        };
        let Ok(block) = u64::from_str_radix(block, 16) else {
            continue;
        };
        if index >> 52 != 0 || block >> BLOCK_BITS != 0 {
            continue;
        }
        let index = index << BLOCK_BITS | block;
        if !is_tile {
            if entry.file_type()?.is_dir() {
                walk(&entry.path(), level, index, found)?;
            }
            continue;
        }
        let tile = Tile::from_id(index.saturating_add(8 << (2 * level)));
        if let Some(tile) = tile.filter(|tile| tile.level() == level)
            && entry.path().ends_with(relative_path(tile))
        {
            match entry.metadata() {
                Ok(metadata) => found.push((tile, metadata.len())),
                // Removed since the directory was listed.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use crate::format::{Kind, SampleType};
    use proptest::prelude::*;

    fn repository(root: &Path) -> Repository {
        let dataset = Dataset::new("test", Kind::Elevation, SampleType::I32, 1);
        Repository::create(root, dataset).unwrap()
    }

    #[test]
    fn paths_follow_the_scheme() {
        let path = |face, level, x, y| {
            relative_path(Tile::new(face, level, x, y).unwrap())
                .display()
                .to_string()
        };
        assert_eq!(path(5, 0, 0, 0), "0/005.tile");
        assert_eq!(path(1, 1, 1, 0), "1/005.tile");
        // Level 4: 3 + 8 bits, one block. Level 5: 13 bits, two.
        assert_eq!(path(5, 4, 15, 15), "4/5ff.tile");
        assert_eq!(path(5, 5, 31, 31), "5/001/7ff.tile");
        assert_eq!(path(3, 22, (1 << 22) - 1, 0), "22/355/555/555/555.tile");
    }

    proptest! {
        #[test]
        fn every_tile_has_its_own_path_and_is_found(face in 0_u8..6, level in 0_u8..=22, x: u32, y: u32) {
            let mask = (1_u32 << level) - 1;
            let tile = Tile::new(face, level, x & mask, y & mask).unwrap();
            let root = tempfile::tempdir().unwrap();
            let repository = repository(root.path());
            repository.write_atomic(tile, b"bytes").unwrap();
            prop_assert_eq!(repository.tiles().unwrap(), vec![(tile, 5)]);
            prop_assert_eq!(repository.fetch(tile).unwrap().unwrap(), b"bytes");
            prop_assert!(repository.remove(tile).unwrap());
            prop_assert!(!repository.remove(tile).unwrap());
            prop_assert!(repository.read(tile).unwrap().is_none());
        }
    }

    #[test]
    fn strangers_are_passed_over() {
        let root = tempfile::tempdir().unwrap();
        let repository = repository(root.path());
        for stranger in [
            "2/zz.tile",
            "2/0ff.txt",
            "2/fff.tile",
            "5/7ff.tile",
            "2/1ff/000.tile",
            "2/0000f.tile",
        ] {
            let path = root.path().join(stranger);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, b"?").unwrap();
        }
        assert_eq!(repository.tiles().unwrap(), vec![]);
    }

    #[test]
    fn creation_respects_what_is_there() {
        let root = tempfile::tempdir().unwrap();
        let first = repository(root.path());
        let second = Dataset::new("second", Kind::Imagery, SampleType::U8, 3);
        let error = Repository::create(root.path(), second).unwrap_err();
        assert!(error.to_string().contains("\"test\""), "{error}");
        assert_eq!(
            Repository::open(root.path()).unwrap().dataset(),
            first.dataset()
        );
        assert!(
            first
                .load_index()
                .unwrap_err()
                .to_string()
                .contains("import")
        );
    }

    #[test]
    fn updates_count_the_revision() {
        let root = tempfile::tempdir().unwrap();
        let mut repository = repository(root.path());
        repository
            .update(|dataset| dataset.deepest_level = 4)
            .unwrap();
        let again = Repository::open(root.path()).unwrap();
        assert_eq!(
            (again.dataset().deepest_level, again.dataset().revision),
            (4, 1)
        );
    }

    #[test]
    fn readers_never_see_half_a_tile() {
        let root = tempfile::tempdir().unwrap();
        let repository = repository(root.path());
        let tile = Tile::new(2, 6, 33, 12).unwrap();
        repository.write_atomic(tile, &vec![0; 100_000]).unwrap();
        std::thread::scope(|scope| {
            for writer in 0..2_u8 {
                let repository = &repository;
                scope.spawn(move || {
                    for round in 0..60_u8 {
                        let bytes = vec![round; 100_000 + usize::from(writer)];
                        repository.write_atomic(tile, &bytes).unwrap();
                    }
                });
            }
            for _ in 0..300 {
                let bytes = repository.read(tile).unwrap().unwrap();
                assert!(bytes.len() >= 100_000 && bytes.iter().all(|byte| *byte == bytes[0]));
            }
        });
    }
}
