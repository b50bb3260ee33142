//! Reading one cached file: mapped or read, checked from the first byte to the last, and kept alive by its holder.
//!
//! In: a path and the name that belongs there. Out: the payload, a miss, or what is wrong with the file. A broken file
//! is removed by [`remove_broken`], unless another stands there by then. It must not follow a file's own promises of
//! size before they are bounded.

use std::fs::{self, File};
use std::io::{self, Read};
use std::ops::Range;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use memmap2::{Mmap, MmapOptions};
use rustix::fs::{Timespec, Timestamps, UTIME_NOW, futimens};

use crate::header::{Broken, MAX_HEADER_BYTES, MAX_PAYLOAD_BYTES, check};
use crate::layout::is_missing;
use crate::name::Name;

/// A file of the cache whose checksum was verified. It stays readable after others have removed it.
#[derive(Debug)]
pub struct Stored {
    content: Content,
    payload: Range<usize>,
}

#[derive(Debug)]
enum Content {
    Mapped(Mmap),
    Read(Vec<u8>),
}

impl Stored {
    /// The payload as it was published, at most [`MAX_PAYLOAD_BYTES`].
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        let whole: &[u8] = match &self.content {
            Content::Mapped(map) => map,
            Content::Read(bytes) => bytes,
        };
        whole.get(self.payload.clone()).unwrap_or_default()
    }

    /// Whether the payload lies in the system's page cache (a memory map) rather than in memory of its own.
    #[must_use]
    pub const fn is_mapped(&self) -> bool {
        matches!(self.content, Content::Mapped(_))
    }
}

impl AsRef<[u8]> for Stored {
    fn as_ref(&self) -> &[u8] {
        self.bytes()
    }
}

/// Which file was looked at: device and inode.
pub(crate) type Identity = (u64, u64);

/// What reading a file came to.
#[derive(Debug)]
pub(crate) enum Reading {
    /// The file is good.
    Good(Stored, File),
    /// There is none.
    Missing,
    /// It is broken.
    Broken(Broken, Identity),
}

/// Reads and checks the file at `path`. `network` says whether other hosts can change its file system.
pub(crate) fn read(path: &Path, name: &Name, network: bool) -> io::Result<Reading> {
    match read_file(path, name, network) {
        Err(error) if is_missing(&error) => Ok(Reading::Missing),
        other => other,
    }
}

fn read_file(path: &Path, name: &Name, network: bool) -> io::Result<Reading> {
    let mut file = File::open(path)?;
    let metadata = file.metadata()?;
    if !metadata.is_file() {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "this is not a regular file; remove it by hand",
        ));
    }
    let identity = (metadata.dev(), metadata.ino());
    let length = metadata.len();
    let most = MAX_HEADER_BYTES + MAX_PAYLOAD_BYTES;
    if length > most {
        let broken = Broken::Oversized {
            found: length,
            expected: most,
        };
        return Ok(Reading::Broken(broken, identity));
    }
    // A mapped page of a file that another host has removed cannot be fetched any more: an NFS server answers
    // "stale handle", and the system turns that into SIGBUS, which ends the process. A plain read gets an error
    // instead, which is a miss. On a local file system a removed file lives as long as its map.
    let content = if network || length == 0 {
        let mut bytes = Vec::with_capacity(length as usize);
        // One byte more than was announced tells a growing file.
        (&mut file).take(length + 1).read_to_end(&mut bytes)?;
        Content::Read(bytes)
    } else {
        Content::Mapped(map(&file, length as usize)?)
    };
    let whole: &[u8] = match &content {
        Content::Mapped(map) => map,
        Content::Read(bytes) => bytes,
    };
    match check(whole, name) {
        Ok(payload) => Ok(Reading::Good(Stored { content, payload }, file)),
        Err(broken) => Ok(Reading::Broken(broken, identity)),
    }
}

#[allow(unsafe_code, reason = "memory maps are what a mapped cache is for")]
fn map(file: &File, length: usize) -> io::Result<Mmap> {
    // Populated: the checksum reads all of it at once, and a fault for every page would cost more than the reading.
    let mut options = MmapOptions::new();
    options.len(length).populate();
    // SAFETY: the map is read-only and of a file that no process of this cache ever changes or truncates: files are
    // written aside, renamed to their place and only ever unlinked, and an unlinked file lives as long as its map.
    // Removal by other hosts is excluded, since network file systems are not mapped. A foreign program that
    // writes into the cache breaks what the directory's owner allowed it to break.
    unsafe { options.map(file) }
}

/// Removes a file that was found broken, unless another process has put a new one there meanwhile.
pub(crate) fn remove_broken(path: &Path, identity: Identity) -> io::Result<()> {
    let removed = fs::symlink_metadata(path).and_then(|metadata| {
        if (metadata.dev(), metadata.ino()) == identity {
            fs::remove_file(path)
        } else {
            Ok(())
        }
    });
    match removed {
        Err(error) if is_missing(&error) => Ok(()),
        other => other,
    }
}

/// Tells other processes that a file is in use, by the clock of the server that keeps it.
pub(crate) fn touch(file: &File) {
    let now = Timespec {
        tv_sec: 0,
        tv_nsec: UTIME_NOW,
    };
    // A file of another user, or on a read-only mount, keeps its time; only its place in the queue is at stake.
    let _ = futimens(
        file,
        &Timestamps {
            last_access: now,
            last_modification: now,
        },
    );
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use crate::header::encode;

    #[test]
    fn mapped_and_plain_reads_agree_and_outlive_the_file() {
        let root = tempfile::tempdir().unwrap();
        let name = Name::new("g", Path::new("x")).unwrap();
        let path = root.path().join("x.cached");
        let payload: Vec<u8> = (0..100_000_u32).map(|n| (n % 251) as u8).collect();
        fs::write(&path, [encode(&name, &payload), payload.clone()].concat()).unwrap();
        let stored: Vec<Stored> = [false, true]
            .into_iter()
            .map(|network| match read(&path, &name, network).unwrap() {
                Reading::Good(stored, _) => stored,
                other => panic!("{other:?}"),
            })
            .collect();
        assert!(stored[0].is_mapped() && !stored[1].is_mapped());
        fs::remove_file(&path).unwrap();
        assert!(stored.iter().all(|stored| stored.bytes() == payload));
        assert!(matches!(
            read(&path, &name, false).unwrap(),
            Reading::Missing
        ));
    }

    #[test]
    fn a_sparse_giant_is_neither_read_nor_mapped() {
        let root = tempfile::tempdir().unwrap();
        let name = Name::new("g", Path::new("x")).unwrap();
        let path = root.path().join("x.cached");
        File::create(&path).unwrap().set_len(1 << 40).unwrap();
        let Reading::Broken(Broken::Oversized { found, .. }, identity) =
            read(&path, &name, true).unwrap()
        else {
            panic!("a giant was accepted");
        };
        assert_eq!(found, 1 << 40);
        // Another file in its place stays.
        fs::write(root.path().join("new"), b"new").unwrap();
        fs::rename(root.path().join("new"), &path).unwrap();
        remove_broken(&path, identity).unwrap();
        assert!(path.exists());
        fs::remove_file(&path).unwrap();
        assert!(remove_broken(&path, identity).is_ok());
        fs::create_dir(&path).unwrap();
        assert!(read(&path, &name, false).is_err());
    }
}
