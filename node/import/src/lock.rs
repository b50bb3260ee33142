//! One import at a time on a directory.
//! In: a repository's directory. Out: a lock that the system takes back when the process ends, however it ends, so that
//! none goes stale. It protects imports from each other, not readers.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::error::ImportError;

const LOCK_FILE: &str = ".import.lock";

/// A held lock. Its file goes with it.
pub(crate) struct Lock {
    path: PathBuf,
    file: File,
}

impl Lock {
    /// Takes the lock of `directory`, which must exist.
    pub(crate) fn take(directory: &Path) -> Result<Self, ImportError> {
        let path = directory.join(LOCK_FILE);
        let failed = |error| ImportError::io(&path, "lock", error);
        loop {
            let mut file = OpenOptions::new()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                .open(&path)
                .map_err(failed)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let mut holder = String::new();
                    let _ = file.read_to_string(&mut holder);
                    let holder = match holder.trim() {
                        "" => "unknown".to_owned(),
                        number => number.to_owned(),
                    };
                    return Err(ImportError::Locked {
                        directory: directory.to_owned(),
                        holder,
                    });
                }
                Err(TryLockError::Error(error)) => return Err(failed(error)),
            }
            // Its last holder may have removed the file between our opening and locking it.
            if !same_file(&file, &path) {
                continue;
            }
            file.set_len(0).map_err(failed)?;
            file.seek(SeekFrom::Start(0)).map_err(failed)?;
            writeln!(file, "{}", std::process::id()).map_err(failed)?;
            return Ok(Self { path, file });
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
        let _ = self.file.unlock();
    }
}

#[cfg(unix)]
fn same_file(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), fs::metadata(path)) {
        (Ok(open), Ok(named)) => open.ino() == named.ino() && open.dev() == named.dev(),
        _ => false,
    }
}

#[cfg(not(unix))]
fn same_file(_file: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    #[test]
    fn the_second_is_told_who_holds_it() {
        let directory = tempfile::tempdir().unwrap();
        let first = Lock::take(directory.path()).unwrap();
        let Err(ImportError::Locked { holder, .. }) = Lock::take(directory.path()) else {
            panic!("locked twice");
        };
        assert_eq!(holder, std::process::id().to_string());
        drop(first);
        assert!(!directory.path().join(LOCK_FILE).exists());
        // What a killed import left behind stops nobody.
        fs::write(directory.path().join(LOCK_FILE), "1\n").unwrap();
        drop(Lock::take(directory.path()).unwrap());
    }
}
