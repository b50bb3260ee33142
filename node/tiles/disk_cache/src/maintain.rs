//! Looking through a cache directory from outside: statistics, verification, clearing.
//!
//! In: the root. Out: counts, and what is broken. Works beside processes that use the cache; needs no lease.
//! It must not remove anything that is not the cache's.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

use crate::books::{Books, remove_baselines};
use crate::cache::DiskCache;
use crate::error::MaintenanceError;
use crate::header::Broken;
use crate::janitor::parts;
use crate::layout::Layout;
use crate::leases::{is_key, is_marker};
use crate::name::Name;
use crate::scan::{Scan, remove, scan};
use crate::stored::{Reading, read, remove_broken};

/// Files of a group or of the whole cache.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Files {
    /// How many.
    pub files: u64,
    /// Their bytes, headers included.
    pub bytes: u64,
}

/// What a cache directory holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Published files.
    pub all: Files,
    /// The same by group.
    pub groups: BTreeMap<String, Files>,
    /// Unfinished files, of the living and the dead.
    pub parts: Files,
    /// Names that are being fetched.
    pub leases: u64,
    /// Processes that have written and not ended in order.
    pub processes: u64,
    /// The smallest budget of those processes in bytes.
    pub budget_bytes: Option<u64>,
    /// Files beside the cache's own; nobody touches them.
    pub foreign: u64,
}

/// What verifying came to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Verification {
    /// Files that are good.
    pub good: Files,
    /// Files that are broken, and why.
    pub broken: Vec<(Name, Broken)>,
    /// Files that could not be read, and what the system says.
    pub unreadable: Vec<(Name, String)>,
}

fn walk(root: &Path) -> Result<Scan, MaintenanceError> {
    // A missing root would look like an empty cache.
    fs::read_dir(root)
        .and_then(|_| scan(root, || true))
        .map_err(|source| failed(root, source))
}

fn failed(root: &Path, source: io::Error) -> MaintenanceError {
    MaintenanceError {
        path: root.to_owned(),
        source,
    }
}

impl DiskCache {
    /// Counts what the directory holds.
    ///
    /// # Errors
    /// [`MaintenanceError`] where it cannot be read.
    pub fn statistics(root: &Path) -> Result<Statistics, MaintenanceError> {
        let tree = walk(root)?;
        let layout = Layout::new(root);
        let books = Books::read(&layout).map_err(|source| failed(root, source))?;
        let mut statistics = Statistics {
            foreign: tree.foreign,
            processes: books.living().count() as u64,
            budget_bytes: books.living().map(|ledger| ledger.budget).min(),
            ..Statistics::default()
        };
        for entry in tree.entries {
            let group = statistics
                .groups
                .entry(entry.name.group().to_owned())
                .or_default();
            for files in [group, &mut statistics.all] {
                files.files += 1;
                files.bytes = files.bytes.saturating_add(entry.bytes);
            }
        }
        (statistics.parts.files, statistics.parts.bytes) = parts(&layout);
        statistics.leases =
            own_files(&layout.leases, |name| name.len() == 32 && is_key(name)).len() as u64;
        Ok(statistics)
    }

    /// Reads and checks every file; removes what is broken if `remove_bad`. `go_on` is told the files and bytes that
    /// were read so far, and how many there are; where it says no, what was found so far is all.
    ///
    /// # Errors
    /// [`MaintenanceError`] where the directory cannot be read.
    pub fn verify(
        root: &Path,
        remove_bad: bool,
        mut go_on: impl FnMut(Files, Files) -> bool,
    ) -> Result<Verification, MaintenanceError> {
        let tree = walk(root)?;
        let all = Files {
            files: tree.entries.len() as u64,
            bytes: tree.total(),
        };
        let mut verification = Verification::default();
        let mut done = Files::default();
        for entry in tree.entries {
            let path = root.join(entry.name.file());
            // Read plainly: the disk is looked at, and errors of the disk come back as errors.
            match read(&path, &entry.name, true) {
                Ok(Reading::Good(..)) => {
                    verification.good.files += 1;
                    verification.good.bytes = verification.good.bytes.saturating_add(entry.bytes);
                }
                Ok(Reading::Missing) => {}
                Ok(Reading::Broken(broken, identity)) => {
                    if remove_bad && let Err(error) = remove_broken(&path, identity) {
                        verification
                            .unreadable
                            .push((entry.name.clone(), error.to_string()));
                    }
                    verification.broken.push((entry.name, broken));
                }
                Err(error) => verification
                    .unreadable
                    .push((entry.name, error.to_string())),
            }
            done.files += 1;
            done.bytes = done.bytes.saturating_add(entry.bytes);
            if !go_on(done, all) {
                break;
            }
        }
        Ok(verification)
    }

    /// Removes all published files, and says what was removed. Foreign files stay, and so do leases and ledgers of
    /// processes that may be alive; their janitor counts anew.
    ///
    /// # Errors
    /// [`MaintenanceError`] where the directory cannot be read, or a file not be removed.
    pub fn clear(root: &Path) -> Result<Files, MaintenanceError> {
        let mut removed = Files::default();
        let mut stays = None;
        for entry in walk(root)?.entries {
            if remove(root, &entry.name) {
                removed.files += 1;
                removed.bytes = removed.bytes.saturating_add(entry.bytes);
            } else {
                stays = Some(entry.name);
            }
        }
        let layout = Layout::new(root);
        // Without a baseline nobody publishes until a janitor has counted what is left.
        remove_baselines(&layout, u64::MAX);
        for marker in own_files(&layout.leases, is_marker) {
            let _ = fs::remove_file(layout.leases.join(marker));
        }
        match stays {
            None => Ok(removed),
            Some(name) => Err(failed(
                &root.join(name.file()),
                io::ErrorKind::PermissionDenied.into(),
            )),
        }
    }
}

fn own_files(directory: &Path, ours: impl Fn(&str) -> bool) -> Vec<String> {
    fs::read_dir(directory)
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| entry.file_name().into_string().ok())
        .filter(|name| ours(name))
        .collect()
}
