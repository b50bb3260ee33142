//! Where things lie in a cache directory, and files that appear there whole.
//!
//! In: the root. Out: paths, and parts that are renamed or linked to their places. A part that is dropped is removed;
//! one whose process was killed stays in `.parts` until a janitor sweeps it. It must not know what is in the files.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::SystemTime;

/// The ending of published files, and of no others: only such files are ever read or removed in a group's directory.
pub(crate) const SUFFIX: &str = "cached";
/// Largest lease, ledger or baseline in bytes. A baseline has a line of about 80 bytes for each process.
const MAX_RECORD_BYTES: u64 = 1 << 20;

/// The directories of a cache, and what names this process in it.
#[derive(Debug)]
pub(crate) struct Layout {
    pub(crate) root: PathBuf,
    pub(crate) parts: PathBuf,
    pub(crate) leases: PathBuf,
    pub(crate) ledgers: PathBuf,
    /// HOST-PID-RANDOM: no other process on any host has it.
    pub(crate) holder: String,
    /// Whether another host may remove files under our feet.
    pub(crate) network: bool,
    next: AtomicU64,
}

impl Layout {
    /// Looks at what kind of file system `root` lies on; makes nothing.
    pub(crate) fn new(root: &Path) -> Self {
        Self {
            root: root.to_owned(),
            parts: root.join(".parts"),
            leases: root.join(".leases"),
            ledgers: root.join(".ledger"),
            holder: holder(),
            network: !is_local(root),
            next: AtomicU64::new(0),
        }
    }

    /// Makes the directories, which may have been removed since they were made last.
    pub(crate) fn make(&self) -> io::Result<()> {
        for directory in [&self.parts, &self.leases, &self.ledgers] {
            fs::create_dir_all(directory)?;
        }
        Ok(())
    }

    /// A path in `.parts` that nobody else uses; it begins with the process's name.
    pub(crate) fn aside(&self) -> PathBuf {
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        self.parts.join(format!("{}-{number}", self.holder))
    }

    /// Writes `pieces`, one after the other, to a file in `.parts`.
    pub(crate) fn part(&self, pieces: &[&[u8]]) -> io::Result<Part> {
        let path = self.aside();
        let mut file = match File::create_new(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                self.make()?;
                File::create_new(&path)?
            }
            other => other?,
        };
        let part = Part { path: Some(path) };
        for piece in pieces {
            file.write_all(piece)?;
        }
        if self.network {
            // NFS tells of a full disk when data is flushed; `close`, which flushes it too, has no way to say so here.
            file.sync_data()?;
        }
        Ok(part)
    }
}

/// A file in `.parts` that is removed unless it is put into its place.
#[derive(Debug)]
pub(crate) struct Part {
    path: Option<PathBuf>,
}

impl Part {
    /// Puts the file at `path` whether or not something is there, and makes the directories above.
    pub(crate) fn rename(mut self, path: &Path) -> io::Result<()> {
        let Some(part) = &self.path else {
            return Ok(());
        };
        // A janitor may remove a directory that it emptied between our two steps, hence more than one attempt.
        let mut renamed = fs::rename(part, path);
        for _ in 0..4 {
            if !matches!(&renamed, Err(error) if error.kind() == io::ErrorKind::NotFound) {
                break;
            }
            if let Some(directory) = path.parent() {
                fs::create_dir_all(directory)?;
            }
            renamed = fs::rename(part, path);
        }
        renamed?;
        self.path = None;
        Ok(())
    }

    /// Puts the file at `path` only if nothing is there; otherwise the error is of the kind `AlreadyExists`.
    /// A link is exclusive on NFS of every version and shows the file with all its content at once.
    pub(crate) fn link(self, path: &Path) -> io::Result<()> {
        match &self.path {
            Some(part) => fs::hard_link(part, path),
            None => Ok(()),
        }
    }

    /// The server's idea of the time now: when the file was written.
    pub(crate) fn modified(&self) -> io::Result<SystemTime> {
        match &self.path {
            Some(part) => fs::metadata(part)?.modified(),
            None => Err(io::ErrorKind::NotFound.into()),
        }
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        if let Some(part) = &self.path {
            // A part that cannot be removed is swept later.
            let _ = fs::remove_file(part);
        }
    }
}

/// Whether an error says that there is no such file. A file that another host removed is a stale handle on NFS.
pub(crate) fn is_missing(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::NotFound | io::ErrorKind::StaleNetworkFileHandle
    )
}

/// Reads a small file of the cache's own, bounded; none where it is missing.
pub(crate) fn read_record(path: &Path) -> io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    let read =
        File::open(path).and_then(|file| file.take(MAX_RECORD_BYTES).read_to_end(&mut bytes));
    match read {
        Ok(_) => Ok(Some(bytes)),
        Err(error) if is_missing(&error) => Ok(None),
        Err(error) => Err(error),
    }
}

/// 64 bits from the system's source of randomness, by way of the standard library's hash keys.
fn random_u64() -> u64 {
    use std::hash::{BuildHasher, RandomState};
    RandomState::new().hash_one(std::process::id())
}

fn holder() -> String {
    let uname = rustix::system::uname();
    let host: String = uname
        .nodename()
        .to_string_lossy()
        .chars()
        .filter(char::is_ascii_alphanumeric)
        .take(32)
        .collect();
    // Hosts may share a name, and a process may open a cache twice; the random part keeps them apart.
    format!("{host}-{}-{:016x}", std::process::id(), random_u64())
}

/// Whether `root` (or what is there of the path to it) lies on a file system that no other host can change. What is
/// not on the list counts as remote: a plain read is a little slower, but never wrong.
fn is_local(root: &Path) -> bool {
    // Linux, include/uapi/linux/magic.h; ZFS from its own sources, include/sys/zfs_vfsops.h.
    const LOCAL: [u64; 9] = [
        0xef53,      // ext2, ext3, ext4
        0x5846_5342, // XFS
        0x9123_683e, // btrfs
        0x0102_1994, // tmpfs
        0xf2f5_2010, // F2FS
        0x2fc1_2fc1, // ZFS
        0x794c_7630, // overlayfs
        0xca45_1a4e, // bcachefs
        0x3153_464a, // JFS
    ];
    root.ancestors()
        .map(|path| {
            if path.as_os_str().is_empty() {
                Path::new(".")
            } else {
                path
            }
        })
        .find_map(|path| rustix::fs::statfs(path).ok())
        // The field's width and sign differ between processors; all magics have 32 bits.
        .is_some_and(|found| LOCAL.contains(&(found.f_type as u64 & 0xffff_ffff)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    #[test]
    fn parts_become_files_or_vanish() {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(root.path());
        let place = root.path().join("a/b/c");
        layout.part(&[b"o", b"ne"]).unwrap().rename(&place).unwrap();
        layout.part(&[b"two"]).unwrap().rename(&place).unwrap();
        assert_eq!(fs::read(&place).unwrap(), b"two");
        let taken = layout.part(&[b"three"]).unwrap().link(&place).unwrap_err();
        assert_eq!(taken.kind(), io::ErrorKind::AlreadyExists);
        layout
            .part(&[b"four"])
            .unwrap()
            .link(&root.path().join("a/d"))
            .unwrap();
        assert_eq!(fs::read(root.path().join("a/d")).unwrap(), b"four");
        assert_eq!(fs::read_dir(&layout.parts).unwrap().count(), 0);
    }

    #[test]
    fn a_removed_root_is_made_again() {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(root.path());
        layout.make().unwrap();
        fs::remove_dir_all(root.path()).unwrap();
        let place = root.path().join("g/x");
        layout.part(&[b"x"]).unwrap().rename(&place).unwrap();
        assert!(place.exists());
    }

    #[test]
    fn kernel_file_systems_are_not_taken_for_disks() {
        assert!(!is_local(Path::new("/proc/self")));
    }

    #[test]
    fn no_two_caches_have_one_holder() {
        assert_ne!(holder(), holder());
    }
}
