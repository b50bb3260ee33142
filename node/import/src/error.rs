//! Why a source was refused and why an import stopped.
//! In: what went wrong, where. Out: one paragraph each that names the thing, says what is wrong with it and what to
//! do. It decides nothing.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use thiserror::Error;
use tiles::{DatasetError, PublishError, RepositoryError};

/// Why a source raster cannot be imported.
#[derive(Debug, Error)]
pub enum SourceError {
    /// The file system said no.
    #[error("{file}: cannot be read: {source}. Check the path and the permissions.")]
    Unreadable {
        /// The file.
        file: String,
        /// What the system said.
        source: io::Error,
    },
    /// The file is not what it claims to be: cut off, overwritten, inconsistent.
    #[error("{file}: damaged: {problem}. Fetch or write the file again.")]
    Damaged {
        /// The file.
        file: String,
        /// What does not fit.
        problem: String,
    },
    /// The file may be in order, but this program would not import it right.
    #[error("{file}: {problem}. {remedy}")]
    Refused {
        /// The file.
        file: String,
        /// What stands in the way.
        problem: String,
        /// What to do, a whole sentence.
        remedy: String,
    },
}

/// Why an import stopped. Unless it says otherwise, running the same command again continues it.
#[derive(Debug, Error)]
pub enum ImportError {
    /// A source was refused; nothing was written.
    #[error(transparent)]
    Source(Arc<SourceError>),
    /// The options contradict each other or the sources.
    #[error("{0}")]
    Options(String),
    /// The directory holds a data set that does not go with this import.
    #[error("{}: {problem}", directory.display())]
    Repository {
        /// The repository's directory.
        directory: PathBuf,
        /// What does not fit, and what to do.
        problem: String,
    },
    /// Another import works on the directory.
    #[error("{}: another import (process {holder}) is writing to this repository. Wait for it to end, or stop it; what it has finished is kept.", directory.display())]
    Locked {
        /// The repository's directory.
        directory: PathBuf,
        /// The process that holds the lock, as far as it is known.
        holder: String,
    },
    /// No space is left.
    #[error("{}: the disk is full. Free some space and run the same command again: the import continues where it stopped, and the repository still shows its earlier state.", path.display())]
    DiskFull {
        /// What was being written.
        path: PathBuf,
    },
    /// The file system said no.
    #[error("{}: cannot {action}: {source}. Check the path and the permissions, then run the same command again: the import continues where it stopped.", path.display())]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// What was attempted, as a verb.
        action: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// A tile of the repository cannot be used.
    #[error("{}: tile {tile}: {problem}", directory.display())]
    Tile {
        /// The repository's directory.
        directory: PathBuf,
        /// The tile.
        tile: geodesy::Tile,
        /// What is wrong with it, and what to do.
        problem: String,
    },
    /// The caller asked to stop.
    #[error("import stopped on request. Run the same command again to continue where it stopped.")]
    Cancelled,
}

impl SourceError {
    pub(crate) fn unreadable(file: &str, source: io::Error) -> Self {
        Self::Unreadable {
            file: file.to_owned(),
            source,
        }
    }

    pub(crate) fn damaged(file: &str, problem: impl Into<String>) -> Self {
        Self::Damaged {
            file: file.to_owned(),
            problem: problem.into(),
        }
    }

    pub(crate) fn refused(
        file: &str,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::Refused {
            file: file.to_owned(),
            problem: problem.into(),
            remedy: remedy.into(),
        }
    }
}

impl From<SourceError> for ImportError {
    fn from(error: SourceError) -> Self {
        Self::Source(Arc::new(error))
    }
}

impl From<Arc<SourceError>> for ImportError {
    fn from(error: Arc<SourceError>) -> Self {
        Self::Source(error)
    }
}

impl ImportError {
    /// The error for a failed operation on a repository.
    pub(crate) fn repository(directory: &Path, error: &RepositoryError) -> Self {
        let full = match error {
            RepositoryError::Write(PublishError::Full { path, .. }) => Some(path),
            RepositoryError::Dataset(DatasetError::Write(PublishError::Full { path, .. })) => {
                Some(path)
            }
            _ => None,
        };
        match full {
            Some(path) => Self::DiskFull { path: path.clone() },
            None => Self::Repository {
                directory: directory.to_owned(),
                problem: error.to_string(),
            },
        }
    }

    /// The error for a failed file operation: a full disk has its own.
    pub(crate) fn io(path: &Path, action: &'static str, source: io::Error) -> Self {
        let path = path.to_owned();
        if source.kind() == io::ErrorKind::StorageFull {
            Self::DiskFull { path }
        } else {
            Self::Io {
                path,
                action,
                source,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_named_and_can_be_continued() {
        let full = io::Error::from(io::ErrorKind::StorageFull);
        let message = ImportError::io(Path::new("out/tile"), "write", full).to_string();
        assert!(
            message.contains("out/tile: the disk is full") && message.contains("continues"),
            "{message}"
        );
        let full = PublishError::Full {
            path: "out/index.bin".into(),
            bytes: 1,
        };
        let message = ImportError::repository(Path::new("out"), &full.into()).to_string();
        assert!(message.contains("index.bin: the disk is full"), "{message}");
    }
}
