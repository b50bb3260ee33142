//! The janitor: counts the tree, makes room, and writes the next baseline. Whoever holds the lease `janitor` is it.
//!
//! In: how many bytes somebody needs. Out: a tree within the budget, and books that say so. It may die at any step, and
//! there may be two of it for a moment: removing only makes room, the next baseline is made by one of them alone, and
//! ledgers go only after a baseline includes them. It must not remove what is not the cache's.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::Path;
use std::time::{Duration, SystemTime};

use crate::account::soft_limit;
use crate::books::{Baseline, Books, baseline_path, holder_of, ledger_name, remove_baselines};
use crate::layout::{Layout, read_record};
use crate::leases::{Guard, is_marker};
use crate::scan::{Entry, remove, scan};
use crate::shared::Shared;
use crate::watch::Verdict;

/// No process writes one file for this long; what is older than this in `.parts` was left by the dead.
const ABANDONED_AFTER: Duration = Duration::from_secs(15 * 60);
/// A ledger that did not change for this many leases is a dead process's.
const GRACE_LEASES: u32 = 4;

impl Shared {
    /// Whether a round would do anybody any good.
    pub(crate) fn needs_round(&self, need: u64) -> io::Result<bool> {
        let books = Books::read(&self.layout)?;
        self.account.note(&books);
        let limit = soft_limit(books.budget(self.budget));
        Ok(books
            .used()
            .is_none_or(|used| used.saturating_add(need) > limit))
    }

    /// One round. `need` is the size in bytes of the largest file that waits for room in this process.
    pub(crate) fn round(&self, guard: &Guard, need: u64) -> io::Result<()> {
        // Any file's time is compared with the time of this one: both are the server's.
        let server_now = self.layout.part(&[])?.modified()?;
        let books = Books::read(&self.layout)?;
        let dead = self.dead_ledgers(&books);
        // The ledgers were read before the tree is walked: what they call published is seen or was evicted.
        let tree = scan(&self.layout.root, || {
            !guard.is_lost() && !self.is_stopping()
        })?;
        let mut total = tree.total();
        let budget = books.budget(self.budget);
        let living = books.living().count().max(1) as u64;
        let reserved = books.reserved();
        let wanted = reserved.saturating_add(need.saturating_mul(living));
        if total.saturating_add(wanted) > soft_limit(budget) {
            // Room for every process's next file, but never at the cost of more than half of what is there, unless
            // the one file that waits is that large.
            let goal = (budget - budget / 16)
                .saturating_sub(wanted)
                .max(budget / 2)
                .min(budget.saturating_sub(reserved.saturating_add(need)));
            total = self.evict(tree.entries, total, goal, server_now);
        }
        let baseline = Baseline {
            total,
            included: books
                .ledgers
                .iter()
                .filter_map(|(name, (_, ledger))| Some((name.clone(), (*ledger)?.published)))
                .collect(),
        };
        let path = baseline_path(&self.layout, books.number.saturating_add(1));
        match self.layout.part(&[&baseline.encode()])?.link(&path) {
            // Another janitor was faster; its baseline is as good, and ours is void.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Ok(()),
            other => other?,
        }
        // The one before stays: somebody may be about to read it.
        remove_baselines(&self.layout, books.number);
        for name in &dead {
            self.bury(name, &books);
        }
        sweep(&self.layout.parts, server_now, |_| true);
        sweep(&self.layout.leases, server_now, is_marker);
        self.leases.sweep();
        self.account.note(&Books::read(&self.layout)?);
        Ok(())
    }

    /// Ledgers of processes that ended or died, as far as this process has watched them for long enough.
    fn dead_ledgers(&self, books: &Books) -> BTreeSet<String> {
        let own = ledger_name(&self.layout.holder);
        let grace = self.leases.duration() * GRACE_LEASES;
        let now = self.leases.now();
        let mut watch = self.ledger_watch.lock();
        let dead = books.ledgers.iter().filter(|(name, (content, ledger))| {
            // A living process's ledger is never torn, since it is replaced whole.
            let ended = ledger.is_none_or(|ledger| ledger.closed);
            let verdict = watch.observe((*name).clone(), content, (now, self.leases.now()), grace);
            **name != own && (ended || matches!(verdict, Verdict::Dead { .. }))
        });
        dead.map(|(name, _)| name.clone()).collect()
    }

    /// Removes a ledger that the newest baseline includes, and the parts its process left.
    fn bury(&self, name: &str, books: &Books) {
        let path = self.layout.ledgers.join(name);
        let before = books.ledgers.get(name).map(|(content, _)| content);
        match read_record(&path) {
            // Whoever rose from the dead keeps the ledger.
            Ok(now) if now.as_ref() != before => return,
            _ => {
                let _ = fs::remove_file(&path);
            }
        }
        self.ledger_watch.lock().forget(name);
        if let (Some(holder), Ok(entries)) = (holder_of(name), fs::read_dir(&self.layout.parts)) {
            for entry in entries.flatten() {
                let part = entry.file_name();
                let left = part.to_str().and_then(|part| part.strip_prefix(holder));
                if left.is_some_and(|rest| rest.starts_with('-')) {
                    let _ = fs::remove_file(entry.path());
                }
            }
        }
    }

    /// Removes the least recently used files until at most `goal` bytes are left; gives what is left.
    fn evict(&self, entries: Vec<Entry>, mut total: u64, goal: u64, server_now: SystemTime) -> u64 {
        let now = self.leases.now();
        let mut queue: Vec<(SystemTime, Entry)> = entries
            .into_iter()
            .map(|entry| {
                let own = self
                    .usage
                    .idle(entry.name.key(), now)
                    .and_then(|idle| server_now.checked_sub(idle));
                (own.map_or(entry.used, |own| own.max(entry.used)), entry)
            })
            .collect();
        queue.sort_unstable_by(|a, b| (a.0, &a.1.name).cmp(&(b.0, &b.1.name)));
        for (_, entry) in queue {
            if total <= goal {
                break;
            }
            // Whose file cannot be removed (another user's) goes on counting.
            if remove(&self.layout.root, &entry.name) {
                total = total.saturating_sub(entry.bytes);
                self.usage.forget(entry.name.key());
                self.counters.evicted(entry.bytes);
            }
        }
        total
    }
}

/// Removes files that have stood in `directory` for too long, by the server's clock. Far in the future is no better
/// than long ago: the clock has jumped, and no part lives for long.
fn sweep(directory: &Path, server_now: SystemTime, ours: impl Fn(&str) -> bool) {
    let Ok(entries) = fs::read_dir(directory) else {
        return;
    };
    for entry in entries.flatten() {
        let modified = entry.metadata().and_then(|metadata| metadata.modified());
        let age = modified.map(|then| match server_now.duration_since(then) {
            Ok(age) => age,
            Err(ahead) => ahead.duration(),
        });
        let name = entry.file_name();
        if age.is_ok_and(|age| age > ABANDONED_AFTER) && name.to_str().is_some_and(&ours) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// What `.parts` holds, in bytes; for statistics.
pub(crate) fn parts(layout: &Layout) -> (u64, u64) {
    let Ok(entries) = fs::read_dir(&layout.parts) else {
        return (0, 0);
    };
    let sizes = entries.flatten().filter_map(|entry| entry.metadata().ok());
    sizes.fold((0, 0), |(files, bytes), metadata| {
        (files + 1, metadata.len().saturating_add(bytes))
    })
}
