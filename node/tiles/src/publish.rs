//! Atomic publication of files: whoever reads sees the old file, the new file or none, never half of one.
//!
//! In: a path and bytes. Out: a file, or an error and no trace. Written aside in a `.parts` directory on the
//! same file system, then renamed. A writer that was killed leaves its part there; [`sweep`] removes old ones.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use thiserror::Error;

/// The directory of unfinished files, under a repository's or a cache's root.
pub(crate) const PARTS: &str = ".parts";
/// No writer takes this long for one file.
const ABANDONED_AFTER: Duration = Duration::from_secs(15 * 60);

/// Why a file could not be written. Nothing of it is left.
#[derive(Debug, Error)]
pub enum PublishError {
    /// No space or quota is left.
    #[error("cannot write {path}: the disk is full ({bytes} bytes were needed); free some space and run again, nothing half-written was left", path = path.display())]
    Full {
        /// The file.
        path: PathBuf,
        /// Its size in bytes.
        bytes: usize,
    },
    /// Anything else the system says.
    #[error("cannot write {path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

/// Whether a file must survive a power cut once it is named.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Durability {
    /// Flushed to the device before it is named: small files that others depend on.
    Synced,
    /// Left to the system: tiles, which carry a checksum and can be made again.
    Lazy,
}

impl PublishError {
    fn new(path: &Path, bytes: usize, source: io::Error) -> Self {
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::Full {
                path: path.to_owned(),
                bytes,
            },
            _ => Self::Io {
                path: path.to_owned(),
                source,
            },
        }
    }
}

/// Writes `bytes` to `path`, which lies under `root`; makes its directories.
pub(crate) fn publish(
    root: &Path,
    path: &Path,
    bytes: &[u8],
    durability: Durability,
) -> Result<(), PublishError> {
    publish_by(root, path, bytes.len(), |file| {
        file.write_all(bytes)?;
        if durability == Durability::Synced {
            file.sync_all()
        } else {
            Ok(())
        }
    })?;
    if durability == Durability::Synced
        && let Some(directory) = path.parent().and_then(|parent| File::open(parent).ok())
    {
        // Some network file systems refuse to sync a directory; the file itself is safe by then.
        let _ = directory.sync_all();
    }
    Ok(())
}

fn publish_by(
    root: &Path,
    path: &Path,
    bytes: usize,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> Result<(), PublishError> {
    let failed = |source| PublishError::new(path, bytes, source);
    let part = part_path(root);
    let written = create(&part)
        .and_then(|mut file| write(&mut file))
        .and_then(|()| match fs::rename(&part, path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                if let Some(directory) = path.parent() {
                    fs::create_dir_all(directory)?;
                }
                fs::rename(&part, path)
            }
            other => other,
        });
    written.map_err(|source| {
        let _ = fs::remove_file(&part);
        failed(source)
    })
}

fn create(part: &Path) -> io::Result<File> {
    match File::create_new(part) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            if let Some(directory) = part.parent() {
                fs::create_dir_all(directory)?;
            }
            File::create_new(part)
        }
        other => other,
    }
}

/// A name that no other thread, process or host uses.
fn part_path(root: &Path) -> PathBuf {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let process = std::process::id();
    // Hosts that share a file system may have equal process numbers; a random part keeps them apart.
    root.join(PARTS)
        .join(format!("{process}-{number}-{:016x}", random_u64()))
}

/// 64 bits from the system's source of randomness, by way of the standard library's hash keys.
pub(crate) fn random_u64() -> u64 {
    use std::hash::{BuildHasher, RandomState};
    let since = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .unwrap_or_default();
    RandomState::new().hash_one((since.as_nanos(), std::process::id()))
}

/// Removes parts that a killed writer left behind, once they are old enough that nobody writes them.
pub(crate) fn sweep(root: &Path) {
    let Ok(entries) = fs::read_dir(root.join(PARTS)) else {
        return;
    };
    for entry in entries.flatten() {
        let age = entry
            .metadata()
            .and_then(|data| data.modified())
            .map(|then| then.elapsed());
        if matches!(age, Ok(Ok(age)) if age > ABANDONED_AFTER) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    #[test]
    fn a_full_disk_is_named_and_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("3/0ff.tile");
        let error = publish_by(root.path(), &path, 7, |file| {
            file.write_all(b"half")?;
            Err(io::ErrorKind::StorageFull.into())
        })
        .unwrap_err();
        assert!(matches!(error, PublishError::Full { bytes: 7, .. }));
        assert!(error.to_string().contains("the disk is full"));
        assert!(!path.exists());
        assert_eq!(fs::read_dir(root.path().join(PARTS)).unwrap().count(), 0);
    }

    #[test]
    fn replaces_and_makes_directories() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a/b/c");
        publish(root.path(), &path, b"one", Durability::Lazy).unwrap();
        publish(root.path(), &path, b"two", Durability::Synced).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
    }

    #[test]
    fn only_old_parts_are_swept() {
        let root = tempfile::tempdir().unwrap();
        let parts = root.path().join(PARTS);
        fs::create_dir(&parts).unwrap();
        fs::write(parts.join("live"), b"x").unwrap();
        let dead = File::create(parts.join("dead")).unwrap();
        dead.set_modified(SystemTime::now() - 2 * ABANDONED_AFTER)
            .unwrap();
        sweep(root.path());
        assert!(parts.join("live").exists() && !parts.join("dead").exists());
    }
}
