//! Files beneath a directory, opened without following links, for `tower-http`'s `ServeDir`.
//!
//! In: relative paths that [`crate::paths`] let pass. Out: open files with what their headers need, both from the
//! same file even while an import replaces it. It must not leave the directory.

use std::future::{Ready, ready};
use std::io::{self, SeekFrom};
use std::os::fd::OwnedFd;
use std::path::{Component, Path, PathBuf};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::{Duration, SystemTime};

use rustix::fs::{Mode, OFlags, open, openat};
use rustix::io::Errno;
use tokio::io::{AsyncRead, AsyncSeek, ReadBuf};
use tower_http::services::fs::{Backend, File, Metadata};

/// Opens files beneath one directory.
#[derive(Clone, Debug)]
pub(crate) struct Beneath {
    root: Arc<Path>,
}

/// A file and what was known of it when it was opened.
pub(crate) struct OpenFile {
    file: tokio::fs::File,
    facts: Facts,
}

/// Size and moment of an open file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facts {
    bytes: u64,
    modified: SystemTime,
}

impl Beneath {
    pub(crate) fn new(root: &Path) -> Self {
        Self { root: root.into() }
    }
}

type Opening<T> = Pin<Box<dyn Future<Output = io::Result<T>> + Send>>;

impl Backend for Beneath {
    type File = OpenFile;
    type Metadata = Facts;
    type OpenFuture = Opening<OpenFile>;
    type MetadataFuture = Opening<Facts>;

    fn open(&self, path: PathBuf) -> Self::OpenFuture {
        let root = Arc::clone(&self.root);
        Box::pin(async move {
            let opened = tokio::task::spawn_blocking(move || open_beneath(&root, &path));
            let (file, facts) = opened.await.map_err(io::Error::other)??;
            Ok(OpenFile {
                file: tokio::fs::File::from_std(file),
                facts,
            })
        })
    }

    fn metadata(&self, path: PathBuf) -> Self::MetadataFuture {
        let opening = self.open(path);
        Box::pin(async move { Ok(opening.await?.facts) })
    }
}

/// Element by element, because only the last one is guarded by `O_NOFOLLOW`.
fn open_beneath(root: &Path, path: &Path) -> io::Result<(std::fs::File, Facts)> {
    let directory = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC;
    let mut place: OwnedFd = open(root, directory, Mode::empty())?;
    // `ServeDir` puts a dot before every path.
    let path = path.strip_prefix(Component::CurDir).unwrap_or(path);
    let mut elements = path.components().peekable();
    while let Some(element) = elements.next() {
        let Component::Normal(name) = element else {
            return Err(io::ErrorKind::NotFound.into());
        };
        // A pipe or a device must not make anybody wait.
        let flags = if elements.peek().is_some() {
            directory | OFlags::NOFOLLOW
        } else {
            OFlags::RDONLY | OFlags::CLOEXEC | OFlags::NOFOLLOW | OFlags::NONBLOCK
        };
        place = match openat(&place, name, flags, Mode::empty()) {
            Err(Errno::LOOP) => {
                let error = "it is a link, and links are not followed";
                return Err(io::Error::new(io::ErrorKind::Unsupported, error));
            }
            opened => opened?,
        };
    }
    let file = std::fs::File::from(place);
    let metadata = file.metadata()?;
    if !metadata.is_file() {
        return Err(io::ErrorKind::NotFound.into());
    }
    let facts = Facts {
        bytes: metadata.len(),
        modified: distinct(
            metadata.modified()?,
            std::os::unix::fs::MetadataExt::ino(&metadata),
        ),
    };
    Ok((file, facts))
}

/// The moment with the inode mixed into its fraction of a second. `ServeDir` makes the entity tag from size and
/// moment; but a file's time may tick in milliseconds, in which an import can replace a file by another of the
/// same size. Both then have inodes of their own. Whole seconds, which `Last-Modified` shows, stay as they are.
fn distinct(modified: SystemTime, inode: u64) -> SystemTime {
    let Ok(since) = modified.duration_since(SystemTime::UNIX_EPOCH) else {
        return modified;
    };
    let spread = (inode.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) % 1_000_000_000;
    let fraction = (u64::from(since.subsec_nanos()) + spread) % 1_000_000_000;
    SystemTime::UNIX_EPOCH + Duration::from_secs(since.as_secs()) + Duration::from_nanos(fraction)
}

impl Metadata for Facts {
    fn is_dir(&self) -> bool {
        false
    }

    fn modified(&self) -> io::Result<SystemTime> {
        Ok(self.modified)
    }

    fn len(&self) -> u64 {
        self.bytes
    }
}

impl File for OpenFile {
    type Metadata = Facts;
    type MetadataFuture<'a> = Ready<io::Result<Facts>>;

    fn metadata(&self) -> Self::MetadataFuture<'_> {
        ready(Ok(self.facts))
    }
}

impl AsyncRead for OpenFile {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.file).poll_read(context, buffer)
    }
}

impl AsyncSeek for OpenFile {
    fn start_seek(mut self: Pin<&mut Self>, position: SeekFrom) -> io::Result<()> {
        Pin::new(&mut self.file).start_seek(position)
    }

    fn poll_complete(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<u64>> {
        Pin::new(&mut self.file).poll_complete(context)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use std::fs;

    #[test]
    fn links_and_strangers_are_not_opened() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("root");
        fs::create_dir_all(root.join("sub")).unwrap();
        fs::write(root.join("sub/file"), b"here").unwrap();
        fs::write(folder.path().join("secret"), b"hush").unwrap();
        std::os::unix::fs::symlink("../../secret", root.join("sub/link")).unwrap();
        std::os::unix::fs::symlink("file", root.join("sub/inner")).unwrap();
        std::os::unix::fs::symlink("..", root.join("up")).unwrap();
        let pipe = root.join("pipe");
        rustix::fs::mknodat(
            rustix::fs::CWD,
            &pipe,
            rustix::fs::FileType::Fifo,
            Mode::from_raw_mode(0o600),
            0,
        )
        .unwrap();
        let open = |path: &str| open_beneath(&root, Path::new(path)).map(|(_, facts)| facts.bytes);
        assert_eq!(open("sub/file").unwrap(), 4);
        for path in [
            "sub/link",
            "sub/inner",
            "up/secret",
            "../secret",
            "sub/../sub/file",
            "sub",
            "",
            "pipe",
            "none",
            "sub/file/x",
        ] {
            assert!(open(path).is_err(), "{path}");
        }
        let absolute = folder.path().join("secret").display().to_string();
        assert!(open(&absolute).is_err());
    }

    #[test]
    fn files_of_one_moment_differ_by_their_inode() {
        let moment = SystemTime::UNIX_EPOCH + Duration::new(1_700_000_000, 123_000_000);
        let (first, second) = (distinct(moment, 41), distinct(moment, 42));
        assert_ne!(first, second);
        assert_eq!(first, distinct(moment, 41));
        let seconds = |moment: SystemTime| {
            moment
                .duration_since(SystemTime::UNIX_EPOCH)
                .unwrap()
                .as_secs()
        };
        assert_eq!(
            (seconds(first), seconds(second)),
            (1_700_000_000, 1_700_000_000)
        );
    }
}
