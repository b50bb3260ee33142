//! Walks the tree of published files, and removes some of them.
//!
//! In: the root. Out: every file of the cache with its size and last use. Foreign files, links and hidden directories
//! are passed by and never removed. It must not follow symbolic links, nor go deeper than names may.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::layout::is_missing;
use crate::name::{MAX_COMPONENTS, Name, plain};

/// One published file.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) name: Name,
    pub(crate) bytes: u64,
    /// By the clock of the server that keeps it.
    pub(crate) used: SystemTime,
}

/// What a walk found.
#[derive(Debug, Default)]
pub(crate) struct Scan {
    pub(crate) entries: Vec<Entry>,
    /// Files in the cache's directories that are not the cache's.
    pub(crate) foreign: u64,
}

impl Scan {
    /// Bytes of all files, headers included.
    pub(crate) fn total(&self) -> u64 {
        self.entries
            .iter()
            .fold(0, |sum, entry| sum.saturating_add(entry.bytes))
    }
}

/// Walks the tree below `root`; `go_on` is asked for every directory and may end the walk with an error.
pub(crate) fn scan(root: &Path, mut go_on: impl FnMut() -> bool) -> io::Result<Scan> {
    let mut scan = Scan::default();
    // Paths below the root, and how deep they are.
    let mut waiting = vec![(PathBuf::new(), 0_usize)];
    while let Some((directory, depth)) = waiting.pop() {
        if !go_on() {
            return Err(io::Error::new(
                io::ErrorKind::Interrupted,
                "another process has become the janitor",
            ));
        }
        let listing = match fs::read_dir(root.join(&directory)) {
            // Files and directories vanish while other processes evict.
            Err(error) if is_missing(&error) => continue,
            other => other?,
        };
        for entry in listing {
            let entry = match entry {
                Err(error) if is_missing(&error) => continue,
                other => other?,
            };
            // Of a link itself, not of what it points at.
            let metadata = match entry.metadata() {
                Err(error) if is_missing(&error) => continue,
                other => other?,
            };
            let file_name = entry.file_name();
            let path = directory.join(&file_name);
            if metadata.is_dir() {
                let ours = file_name.to_str().is_some_and(plain);
                if ours && depth <= MAX_COMPONENTS {
                    waiting.push((path, depth + 1));
                } else if !file_name.to_string_lossy().starts_with('.') {
                    scan.foreign += 1;
                }
                continue;
            }
            match Name::of_file(&path).filter(|_| metadata.is_file()) {
                Some(name) => scan.entries.push(Entry {
                    name,
                    bytes: metadata.len(),
                    used: metadata.modified()?,
                }),
                None => scan.foreign += 1,
            }
        }
    }
    Ok(scan)
}

/// Removes the file of `name`, and the directories above it that are empty then. Says whether it is gone.
pub(crate) fn remove(root: &Path, name: &Name) -> bool {
    let path = root.join(name.file());
    match fs::remove_file(&path) {
        Err(error) if !is_missing(&error) => return false,
        _ => {}
    }
    for directory in path.ancestors().skip(1) {
        // The root stays, and so does what is not empty.
        if directory == root || fs::remove_dir(directory).is_err() {
            break;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    #[test]
    fn only_the_caches_files_are_found_and_removed() {
        let root = tempfile::tempdir().unwrap();
        let put = |path: &str| {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, b"12345").unwrap();
        };
        for path in [
            "g/a/b.cached",
            "g/notes.txt",
            ".parts/x.cached",
            "loose.cached",
            "bad name/x.cached",
        ] {
            put(path);
        }
        std::os::unix::fs::symlink("/", root.path().join("g/away")).unwrap();
        std::os::unix::fs::symlink(
            root.path().join("g/a/b.cached"),
            root.path().join("g/link.cached"),
        )
        .unwrap();
        let found = scan(root.path(), || true).unwrap();
        assert_eq!(
            (found.entries.len(), found.total(), found.foreign),
            (1, 5, 5)
        );
        assert!(remove(root.path(), &found.entries[0].name));
        assert!(!root.path().join("g/a").exists() && root.path().join("g/notes.txt").exists());
        assert!(remove(root.path(), &found.entries[0].name), "gone is gone");
        assert!(scan(root.path(), || false).is_err());
        assert_eq!(scan(&root.path().join("none"), || true).unwrap().foreign, 0);
    }
}
