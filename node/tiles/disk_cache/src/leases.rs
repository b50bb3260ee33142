//! Leases as files: who may fetch a name, or be the janitor, while all others wait or do something else.
//!
//! In: a key. Out: a lease that a heartbeat keeps alive, or how long to wait before asking again. A lease whose holder
//! died is broken by exactly one process once its content has not changed for as long as it lasts. Nobody waits here,
//! and no wall clock is read.
//!
//! A lease is the file `.leases/KEY`. It is made whole by a link and says who holds it, as which of the holder's
//! leases, how long it lasts without a beat, and the beats so far. All lines have a fixed width, so that a beat
//! overwrites the file in place: whoever reads amid a beat reads something new, which is all that matters.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use parking_lot::Mutex;

use crate::layout::{Layout, is_missing, read_record};
use crate::name::fnv1a_128;
use crate::watch::{Verdict, Watch};

/// Longest lease that is believed: a file's content must not be able to block a name for days.
pub(crate) const MAX_LEASE: Duration = Duration::from_secs(600);
/// Shortest lease: four beats in it must survive a busy machine.
pub(crate) const MIN_LEASE: Duration = Duration::from_millis(100);

/// All leases of one open cache.
#[derive(Debug)]
pub(crate) struct Leases {
    layout: Arc<Layout>,
    lease: Duration,
    origin: Instant,
    next: AtomicU64,
    held: Mutex<HashMap<u64, Held>>,
    watch: Mutex<Watch<String>>,
    broken: AtomicU64,
}

#[derive(Clone, Debug)]
struct Held {
    path: PathBuf,
    identity: String,
    beats: u64,
    lost: Arc<AtomicBool>,
}

/// What asking for a lease came to.
#[derive(Debug)]
pub(crate) enum Asked {
    /// It is ours until the guard is dropped.
    Held(Guard),
    /// Somebody has it.
    Busy {
        /// When asking again makes sense.
        retry_after: Duration,
    },
}

/// A lease that is held; dropping it gives it back.
#[derive(Debug)]
pub(crate) struct Guard {
    leases: Arc<Leases>,
    number: u64,
    lost: Arc<AtomicBool>,
}

impl Guard {
    /// Whether somebody took the lease for dead because this process stood still for too long.
    pub(crate) fn is_lost(&self) -> bool {
        self.lost.load(Ordering::Relaxed)
    }

    /// Beats at once, beside the heartbeat.
    pub(crate) fn renew(&self) {
        self.leases.beat(self.number);
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        self.leases.release(self.number);
    }
}

impl Leases {
    pub(crate) fn new(layout: Arc<Layout>, lease: Duration) -> Arc<Self> {
        Arc::new(Self {
            layout,
            lease,
            origin: Instant::now(),
            next: AtomicU64::new(0),
            held: Mutex::default(),
            watch: Mutex::default(),
            broken: AtomicU64::new(0),
        })
    }

    /// Leases of others that were found dead and broken.
    pub(crate) fn broken(&self) -> u64 {
        self.broken.load(Ordering::Relaxed)
    }

    /// How long a lease lasts without a beat.
    pub(crate) const fn duration(&self) -> Duration {
        self.lease
    }

    /// The time on this process's own monotonic clock.
    pub(crate) fn now(&self) -> Duration {
        self.origin.elapsed()
    }

    /// When to ask again for what somebody has.
    fn poll(&self) -> Duration {
        (self.lease / 50).clamp(Duration::from_millis(5), Duration::from_millis(100))
    }

    /// Asks for the lease `key`, a plain file name. Never waits.
    pub(crate) fn ask(self: &Arc<Self>, key: &str) -> io::Result<Asked> {
        let path = self.layout.leases.join(key);
        for _ in 0..3 {
            if let Some(busy) = self.look(key, &path)? {
                return Ok(busy);
            }
            let number = self.next.fetch_add(1, Ordering::Relaxed);
            let identity = format!(
                "terrawall lease 1\nholder {}\nnumber {number:020}\n",
                self.layout.holder
            );
            let content = content(&identity, self.lease, 0);
            let part = self.layout.part(&[content.as_bytes()])?;
            let made = part.link(&path);
            let made = match made {
                // An NFS server that answered twice says "exists" to its own success.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                    read_record(&path)?.is_some_and(|found| found.starts_with(identity.as_bytes()))
                }
                // The directory was removed under us; making the next part makes it again.
                Err(error) if is_missing(&error) => {
                    self.layout.make()?;
                    false
                }
                other => other.map(|()| true)?,
            };
            if made {
                let lost = Arc::new(AtomicBool::new(false));
                let held = Held {
                    path,
                    identity,
                    beats: 0,
                    lost: lost.clone(),
                };
                self.held.lock().insert(number, held);
                self.watch.lock().forget(key);
                return Ok(Asked::Held(Guard {
                    leases: self.clone(),
                    number,
                    lost,
                }));
            }
        }
        Ok(Asked::Busy {
            retry_after: self.poll(),
        })
    }

    /// Looks whether somebody has the lease; breaks it where its holder is dead. None where it may be had.
    fn look(&self, key: &str, path: &Path) -> io::Result<Option<Asked>> {
        let began = self.now();
        let Some(found) = read_record(path)? else {
            return Ok(None);
        };
        // Clusters may differ in their leases; the longer one holds.
        let lease = stated(&found).map_or(self.lease, |lease| lease.clamp(self.lease, MAX_LEASE));
        let verdict = self
            .watch
            .lock()
            .observe(key.to_owned(), &found, (began, self.now()), lease);
        let retry_after = match verdict {
            Verdict::Alive { remaining } => remaining.min(self.poll()),
            Verdict::Dead { attempt } => {
                if self.take_from_the_dead(path, &found, attempt)? {
                    return Ok(None);
                }
                self.poll()
            }
        };
        Ok(Some(Asked::Busy { retry_after }))
    }

    /// Breaks the lease with the content `dead`; says whether the place is free.
    ///
    /// Of all processes that found this content dead, the one that makes the marker named after it may remove it.
    /// Whoever comes late makes the marker again, but then finds another content, since none ever comes back. A
    /// breaker that dies leaves its marker, and one more lease later the next marker may be made.
    fn take_from_the_dead(&self, path: &Path, dead: &[u8], attempt: u32) -> io::Result<bool> {
        let stem = format!("dead-{:032x}", fnv1a_128(dead));
        let mut marker = None;
        for attempt in 0..=attempt.min(16) {
            let candidate = self.layout.leases.join(format!("{stem}-{attempt}"));
            match File::create_new(&candidate) {
                Ok(_) => {
                    marker = Some(candidate);
                    break;
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        let Some(marker) = marker else {
            return Ok(false);
        };
        // Making the marker has also refreshed what an NFS client remembers of the directory.
        let taken = match read_record(path) {
            Ok(Some(found)) if found == dead => {
                let taken = self.take(path, |found| found == dead);
                if matches!(taken, Ok(true)) {
                    self.broken.fetch_add(1, Ordering::Relaxed);
                }
                taken
            }
            other => other.map(|found| found.is_none()),
        };
        let _ = fs::remove_file(marker);
        taken
    }

    /// Removes the lease at `path` if it is the right one, which is looked at where nobody else can change it; a
    /// wrong one is put back. Says whether the place is free.
    fn take(&self, path: &Path, right: impl Fn(&[u8]) -> bool) -> io::Result<bool> {
        let aside = self.layout.aside();
        match fs::rename(path, &aside) {
            Err(error) if is_missing(&error) => return Ok(true),
            other => other?,
        }
        let free = match read_record(&aside) {
            Ok(Some(found)) if !right(&found) => {
                // A holder that still lives, after all. Where a new lease was made meanwhile, that one stays.
                let _ = fs::hard_link(&aside, path);
                false
            }
            _ => true,
        };
        let _ = fs::remove_file(aside);
        Ok(free)
    }

    /// Beats for all leases that are held.
    pub(crate) fn beat_all(&self) {
        let numbers: Vec<u64> = self.held.lock().keys().copied().collect();
        for number in numbers {
            self.beat(number);
        }
    }

    fn beat(&self, number: u64) {
        let held = {
            let mut all = self.held.lock();
            let Some(held) = all.get_mut(&number) else {
                return;
            };
            held.beats += 1;
            held.clone()
        };
        let Held {
            path,
            identity,
            beats,
            lost,
        } = held;
        let beaten = File::options()
            .read(true)
            .write(true)
            .open(path)
            .and_then(|file| {
                let mut found = vec![0; identity.len()];
                // The open file is looked at, not its name: another holder's lease is never overwritten.
                file.read_exact_at(&mut found, 0)?;
                if found != identity.as_bytes() {
                    return Ok(false);
                }
                file.write_all_at(content(&identity, self.lease, beats).as_bytes(), 0)?;
                Ok(true)
            });
        match beaten {
            Ok(true) => {}
            Ok(false) => lost.store(true, Ordering::Relaxed),
            Err(error) if is_missing(&error) => lost.store(true, Ordering::Relaxed),
            // What hinders may pass before the lease ends; if not, others find it dead.
            Err(error) => tracing::debug!("disk cache: a lease was not renewed: {error}"),
        }
    }

    fn release(&self, number: u64) {
        let Some(held) = self.held.lock().remove(&number) else {
            return;
        };
        let own = |found: &[u8]| found.starts_with(held.identity.as_bytes());
        if let Err(error) = self.take(&held.path, own) {
            // Without beats it dies by itself.
            tracing::debug!("disk cache: a lease was not given back: {error}");
        }
    }

    /// Breaks leases of the dead that nobody asks for any more. Only what this process has watched for long enough.
    pub(crate) fn sweep(&self) {
        let Ok(entries) = fs::read_dir(&self.layout.leases) else {
            return;
        };
        for entry in entries.flatten() {
            let name = entry.file_name();
            if let Some(key) = name.to_str().filter(|name| is_key(name)) {
                // The janitor's own lease beats.
                let _ = self.look(key, &entry.path());
            }
        }
    }
}

/// Whether a file in `.leases` is one of ours.
pub(crate) fn is_key(name: &str) -> bool {
    name == JANITOR || (name.len() == 32 && name.bytes().all(|byte| byte.is_ascii_hexdigit()))
}

/// Whether a file in `.leases` is a mark of a breaker.
pub(crate) fn is_marker(name: &str) -> bool {
    name.strip_prefix("dead-")
        .is_some_and(|rest| rest.get(..32).is_some_and(is_key))
}

/// The key of the janitor's lease; those of names have 32 hexadecimal digits.
pub(crate) const JANITOR: &str = "janitor";

fn content(identity: &str, lease: Duration, beats: u64) -> String {
    format!(
        "{identity}lease_ms {:010}\nbeat {beats:020}\n",
        lease.as_millis()
    )
}

/// How long a lease lasts, as it says itself.
fn stated(content: &[u8]) -> Option<Duration> {
    let text = std::str::from_utf8(content).ok()?;
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix("lease_ms "))?;
    Some(Duration::from_millis(line.parse().ok()?))
}

#[cfg(test)]
#[path = "leases_tests.rs"]
mod tests;
