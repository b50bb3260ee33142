//! The cache as its users see it: claim a name, get the file or the right to fetch it, publish what was fetched.
//!
//! In: names and payloads. Out: payloads, exactly as published, or a reason. Nothing here fails a caller: where the
//! directory is no use, files are fetched and not kept. It must not wait, but for room when publishing (≤ 1 s).

use std::fmt::Display;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use parking_lot::Mutex;

use crate::account::Room;
use crate::error::{OpenError, PublishError, Reason};
use crate::header::{Broken, MAX_PAYLOAD_BYTES, encode};
use crate::layout::Layout;
use crate::leases::{Asked, Guard, MAX_LEASE, MIN_LEASE};
use crate::name::Name;
use crate::shared::{Counters, Shared, count};
use crate::stored::{Reading, Stored, read, remove_broken, touch};

/// A directory that refused a lease is left alone for this long.
const PAUSE: Duration = Duration::from_secs(1);
/// Nobody waits longer than this for room.
const MAX_WAIT: Duration = Duration::from_secs(1);

/// Where a cache lies and how large it may get.
#[derive(Clone, Debug)]
pub struct Config {
    /// The directory; made where it is missing.
    pub root: PathBuf,
    /// Bytes of all published files together, headers included. Where processes differ, the smallest holds.
    pub budget_bytes: u64,
    /// How long a lease outlives its holder, 0.1…600 s. Where processes differ, the longer of two holds.
    pub lease: Duration,
}

impl Config {
    /// A cache in `root` of at most `budget_bytes`, with a lease of 5 s.
    #[must_use]
    pub fn new(root: &Path, budget_bytes: u64) -> Self {
        Self {
            root: root.to_owned(),
            budget_bytes,
            lease: Duration::from_secs(5),
        }
    }
}

/// An open cache. Clones share it; any thread may use it.
#[derive(Clone, Debug)]
pub struct DiskCache(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    shared: Arc<Shared>,
    unusable: Mutex<Option<(Instant, Reason)>>,
    said: Said,
}

/// What was said once and is not said again.
#[derive(Debug, Default)]
struct Said {
    unreadable: AtomicBool,
    unwritable: AtomicBool,
    full: AtomicBool,
    no_room: AtomicBool,
}

fn say(said: &AtomicBool, what: &dyn Display) {
    if !said.swap(true, Ordering::Relaxed) {
        tracing::warn!("disk cache: {what} (said once)");
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        self.shared.stop();
        self.shared.account.close();
    }
}

/// What claiming a name came to.
#[derive(Debug)]
#[must_use]
pub enum Claim {
    /// The file.
    Hit(Stored),
    /// Nobody has it: the caller fetches it and publishes it with the lease, or drops the lease.
    Fetch(Lease),
    /// Somebody fetches it.
    Busy {
        /// When claiming again makes sense.
        retry_after: Duration,
    },
    /// The directory is no use at present: the caller fetches it, and nobody keeps it.
    Without(Reason),
}

/// The right to fetch one name, kept alive by a heartbeat for as long as this value and its process live.
#[derive(Debug)]
pub struct Lease {
    cache: DiskCache,
    name: Name,
    guard: Guard,
}

impl DiskCache {
    /// Opens the cache, or makes it. A directory that may only be read still gives hits.
    ///
    /// # Errors
    /// [`OpenError`] where `root` is something else than a directory or cannot be made, or the lease is out of range.
    pub fn open(config: &Config) -> Result<Self, OpenError> {
        let Config {
            root,
            budget_bytes,
            lease,
        } = config;
        if *lease < MIN_LEASE || *lease > MAX_LEASE {
            return Err(OpenError::Lease { lease: *lease });
        }
        if let Err(source) = fs::create_dir_all(root)
            && !root.is_dir()
        {
            return Err(OpenError::Root {
                path: root.clone(),
                source,
            });
        }
        let layout = Layout::new(root);
        let said = Said::default();
        if *budget_bytes > 0
            && let Err(error) = layout.make()
        {
            say(&said.unwritable, &Reason::new(root, &error));
        }
        let shared = Shared::new(layout, *budget_bytes, *lease);
        shared
            .start()
            .map_err(|source| OpenError::Thread { source })?;
        Ok(Self(Arc::new(Inner {
            shared,
            unusable: Mutex::default(),
            said,
        })))
    }

    /// Claims a name: the file, or the right to fetch it, which one claimant in the whole cluster has at a time.
    /// Never waits for others.
    pub fn claim(&self, name: &Name) -> Claim {
        if let Some(stored) = self.look(name) {
            return Claim::Hit(stored);
        }
        let shared = &self.0.shared;
        if shared.budget == 0 {
            return Claim::Without(Reason::NoBudget);
        }
        if let Some((until, reason)) = self.0.unusable.lock().as_ref()
            && Instant::now() < *until
        {
            return Claim::Without(reason.clone());
        }
        match shared.leases.ask(&format!("{:032x}", name.key())) {
            Ok(Asked::Busy { retry_after }) => Claim::Busy { retry_after },
            Ok(Asked::Held(guard)) => {
                // Published between our look and our lease? This is what makes a fetch happen once.
                self.refresh(name);
                if let Some(stored) = self.look(name) {
                    return Claim::Hit(stored);
                }
                count(&shared.counters.fetches);
                Claim::Fetch(Lease {
                    cache: self.clone(),
                    name: name.clone(),
                    guard,
                })
            }
            Err(error) => {
                let reason = Reason::new(&shared.layout.root, &error);
                let said = match reason {
                    Reason::Full { .. } => &self.0.said.full,
                    _ => &self.0.said.unwritable,
                };
                say(said, &reason);
                *self.0.unusable.lock() = Some((Instant::now() + PAUSE, reason.clone()));
                Claim::Without(reason)
            }
        }
    }

    /// Whether there is a file of this name, good or not. Nothing of it is read.
    #[must_use]
    pub fn holds(&self, name: &Name) -> bool {
        self.path(name).is_file()
    }

    /// The file, if it is there and good; no lease is asked for.
    #[must_use]
    pub fn look(&self, name: &Name) -> Option<Stored> {
        let shared = &self.0.shared;
        let path = self.path(name);
        match read(&path, name, shared.layout.network) {
            Ok(Reading::Good(stored, file)) => {
                count(&shared.counters.hits);
                if shared.usage.note(name.key(), shared.leases.now()) {
                    touch(&file);
                }
                Some(stored)
            }
            Ok(Reading::Missing) => None,
            Ok(Reading::Broken(broken, identity)) => {
                self.remove(name, &broken, || remove_broken(&path, identity));
                None
            }
            Err(error) => {
                let what = format!(
                    "cannot read {}: {error}; such files are fetched again: check the directory's owner and permissions",
                    path.display()
                );
                say(&self.0.said.unreadable, &what);
                None
            }
        }
    }

    /// Removes a file that its reader found broken at its own level, though every byte is as published.
    pub fn discard(&self, name: &Name, reason: &dyn Display) {
        let broken = Broken::Reader {
            reason: reason.to_string(),
        };
        let path = self.path(name);
        self.remove(name, &broken, || match fs::remove_file(&path) {
            Err(error) if crate::layout::is_missing(&error) => Ok(()),
            other => other,
        });
    }

    fn remove(&self, name: &Name, broken: &Broken, remove: impl FnOnce() -> io::Result<()>) {
        let shared = &self.0.shared;
        count(&shared.counters.broken);
        shared.usage.forget(name.key());
        match remove() {
            Ok(()) => {
                tracing::warn!("disk cache: {name} was broken and has been removed: {broken}");
            }
            Err(error) => say(
                &self.0.said.unwritable,
                &format!(
                    "{name} is broken ({broken}) and cannot be removed: {error}; remove it by hand"
                ),
            ),
        }
    }

    /// Bytes of published files by the shared books, as of this process's last look.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.0.shared.account.used()
    }

    /// Counts since the cache was opened.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.0.shared.counts()
    }

    fn path(&self, name: &Name) -> PathBuf {
        self.0.shared.layout.root.join(name.file())
    }

    /// Makes an NFS client forget that a file was missing. It remembers missing names for as long as it believes its
    /// memory of their directory (nfs(5), "Directory entry caching"), and opening a directory renews that memory.
    fn refresh(&self, name: &Name) {
        let layout = &self.0.shared.layout;
        if layout.network {
            let file = name.file();
            let mut above: Vec<&Path> = file.ancestors().skip(1).collect();
            above.reverse();
            for directory in above {
                if fs::read_dir(layout.root.join(directory)).is_err() {
                    break;
                }
            }
        }
    }

    fn publish(&self, name: &Name, payload: &[u8]) -> Result<(), PublishError> {
        let shared = &self.0.shared;
        let too_large = |most: u64| PublishError::TooLarge {
            name: name.clone(),
            bytes: payload.len() as u64,
            most,
        };
        if payload.len() as u64 > MAX_PAYLOAD_BYTES {
            return Err(too_large(MAX_PAYLOAD_BYTES));
        }
        let path = self.path(name);
        let failed = |source| PublishError::new(&path, payload.len() as u64, source);
        let header = encode(name, payload);
        let bytes = (header.len() + payload.len()) as u64;
        let began = Instant::now();
        let wait = shared.leases.duration().min(MAX_WAIT);
        loop {
            match shared.account.reserve(bytes).map_err(failed)? {
                Room::Reserved { scarce } => {
                    if scarce {
                        shared.request_room(0);
                    }
                    break;
                }
                Room::Never(most) => return Err(too_large(most)),
                Room::None => {
                    let left = wait.saturating_sub(began.elapsed());
                    shared.request_room(bytes);
                    if left.is_zero() {
                        return Err(PublishError::NoRoom {
                            name: name.clone(),
                            bytes,
                            budget: shared.budget,
                        });
                    }
                    shared.await_room(left.min(Duration::from_millis(50)));
                }
            }
        }
        let written = shared
            .layout
            .part(&[&header, payload])
            .and_then(|part| part.rename(&path));
        shared.account.settle(bytes, written.is_ok());
        written.map_err(failed)?;
        shared.usage.note(name.key(), shared.leases.now());
        Ok(())
    }
}

impl Lease {
    /// The name that is to be fetched.
    #[must_use]
    pub const fn name(&self) -> &Name {
        &self.name
    }

    /// Renews the lease at once. The heartbeat does so by itself; this is for a caller that is about to stand still.
    pub fn renew(&self) {
        self.guard.renew();
    }

    /// Whether this process stood still for so long that others took it for dead. What it fetched may still be
    /// published: contents of one name are all alike.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.guard.is_lost()
    }

    /// Publishes what was fetched, at most [`MAX_PAYLOAD_BYTES`], and gives the lease back. Waits up to 1 s for room.
    ///
    /// # Errors
    /// [`PublishError`] where the file is not kept; nothing of it is left, and the caller still has its bytes.
    pub fn publish(self, payload: &[u8]) -> Result<(), PublishError> {
        let Inner { shared, said, .. } = &*self.cache.0;
        let kept = self.cache.publish(&self.name, payload);
        match &kept {
            Ok(()) => {
                count(&shared.counters.published);
            }
            Err(error) => {
                count(&shared.counters.not_kept);
                let said = match error {
                    PublishError::Full { .. } => &said.full,
                    PublishError::Write { .. } => &said.unwritable,
                    PublishError::NoRoom { .. } | PublishError::TooLarge { .. } => &said.no_room,
                };
                say(said, error);
            }
        }
        kept
    }
}
