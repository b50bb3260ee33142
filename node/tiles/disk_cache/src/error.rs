//! Why a cache could not be opened, a file not be kept, or a tree not be looked through.
//!
//! In: what the system says. Out: errors that name the path and the remedy. It must not decide what follows from them.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use thiserror::Error;

use crate::name::Name;

/// Why a cache could not be opened.
#[derive(Debug, Error)]
pub enum OpenError {
    /// The lease is too short for a busy machine, or too long for anybody.
    #[error(
        "disk cache: a lease of {lease:?} is out of range; use 0.1 s to 600 s (5 s suits most clusters)"
    )]
    Lease {
        /// The lease that was asked for.
        lease: Duration,
    },
    /// The directory cannot be had.
    #[error("disk cache: cannot use {path} as a directory: {source}; name another directory, or make this one with permission to write", path = path.display())]
    Root {
        /// The directory.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// No thread for the heartbeat.
    #[error(
        "disk cache: cannot start a thread: {source}; raise the limit on processes (ulimit -u)"
    )]
    Thread {
        /// What the system says.
        source: io::Error,
    },
}

/// Why a cache directory keeps nothing at present.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Reason {
    /// Its budget is nought.
    #[error(
        "the disk cache has a budget of 0 bytes and keeps nothing; give it a larger one to use it"
    )]
    NoBudget,
    /// This process may not write there.
    #[error("{path} may not be written ({problem}), so that nothing new is kept there; give this user permission to write, or name another directory", path = path.display())]
    NotWritable {
        /// The cache's directory.
        path: PathBuf,
        /// What the system says.
        problem: String,
    },
    /// No space or quota is left.
    #[error("the disk of {path} is full, so that nothing new is kept there; free some space or lower the budget", path = path.display())]
    Full {
        /// The cache's directory.
        path: PathBuf,
    },
    /// Anything else the system says.
    #[error("{path} cannot be used ({problem}), so that nothing new is kept there; check the file system", path = path.display())]
    Unusable {
        /// The cache's directory.
        path: PathBuf,
        /// What the system says.
        problem: String,
    },
}

fn is_full(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge
    )
}

impl Reason {
    pub(crate) fn new(root: &Path, error: &io::Error) -> Self {
        let (path, problem) = (root.to_owned(), error.to_string());
        match error.kind() {
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                Self::NotWritable { path, problem }
            }
            _ if is_full(error) => Self::Full { path },
            _ => Self::Unusable { path, problem },
        }
    }
}

/// Why a file was not kept. Nothing of it is left.
#[derive(Debug, Error)]
pub enum PublishError {
    /// Larger than a file, or the budget, may be.
    #[error(
        "disk cache: {name} has {bytes} bytes and is not kept; at most {most} are: raise the smallest budget of the processes that share the directory"
    )]
    TooLarge {
        /// The file.
        name: Name,
        /// Its payload in bytes.
        bytes: u64,
        /// The most that would be kept.
        most: u64,
    },
    /// No room could be made in time.
    #[error(
        "disk cache: no room for {name} ({bytes} bytes) in a budget of {budget} bytes, and none was made in time; raise the budget"
    )]
    NoRoom {
        /// The file.
        name: Name,
        /// Its size in bytes.
        bytes: u64,
        /// This process's budget in bytes.
        budget: u64,
    },
    /// No space or quota is left on the disk.
    #[error("disk cache: cannot write {path}: the disk is full ({bytes} bytes were needed: {source}); free some space or lower the budget", path = path.display())]
    Full {
        /// The file.
        path: PathBuf,
        /// Its payload in bytes.
        bytes: u64,
        /// What the system says.
        source: io::Error,
    },
    /// Anything else the system says.
    #[error("disk cache: cannot write {path}: {source}; check the directory's permissions", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

impl PublishError {
    pub(crate) fn new(path: &Path, bytes: u64, source: io::Error) -> Self {
        let path = path.to_owned();
        if is_full(&source) {
            Self::Full {
                path,
                bytes,
                source,
            }
        } else {
            Self::Write { path, source }
        }
    }
}

/// Why a cache directory could not be looked through or cleared.
#[derive(Debug, Error)]
#[error("disk cache: cannot look through {path}: {source}; check that it is a cache directory that this user may use", path = path.display())]
pub struct MaintenanceError {
    /// The cache's directory.
    pub path: PathBuf,
    /// What the system says.
    pub source: io::Error,
}
