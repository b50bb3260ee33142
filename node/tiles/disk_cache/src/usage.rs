//! Which files this process has used lately, so that it tells others no more often than needed.
//!
//! In: a file's key and the process's own clock. Out: whether the file's time must be touched, and its last use for
//! the janitor. Bounded: what was used longer ago than the touch interval is known from the file itself.

use std::collections::HashMap;
use std::time::Duration;

use parking_lot::Mutex;

/// A file's time of modification tells other processes of its use, no finer than this.
pub(crate) const TOUCH_AFTER: Duration = Duration::from_secs(60);
/// Above twice this many files, those are forgotten whose own time is as good as our memory.
const CROWDED: usize = 65_536;

#[derive(Clone, Copy, Debug)]
struct Use {
    touched: Duration,
    last: Duration,
}

/// Memory of use; times are on a monotonic clock of the process.
#[derive(Debug, Default)]
pub(crate) struct Usage {
    used: Mutex<HashMap<u128, Use>>,
}

impl Usage {
    /// Notes a use at `now`; says whether the file must be touched.
    pub(crate) fn note(&self, key: u128, now: Duration) -> bool {
        let mut used = self.used.lock();
        if used.len() > 2 * CROWDED {
            used.retain(|_, entry| now.saturating_sub(entry.last) <= TOUCH_AFTER);
            if used.len() > CROWDED {
                // All used within a minute: their own times are hardly older.
                used.clear();
            }
        }
        if let Some(entry) = used.get_mut(&key) {
            entry.last = now;
            let due = now.saturating_sub(entry.touched) > TOUCH_AFTER;
            if due {
                entry.touched = now;
            }
            return due;
        }
        used.insert(
            key,
            Use {
                touched: now,
                last: now,
            },
        );
        true
    }

    /// How long ago this process used a file; none where it did not, or long ago.
    pub(crate) fn idle(&self, key: u128, now: Duration) -> Option<Duration> {
        let used = self.used.lock();
        used.get(&key).map(|entry| now.saturating_sub(entry.last))
    }

    /// Forgets a file that is gone.
    pub(crate) fn forget(&self, key: u128) {
        self.used.lock().remove(&key);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touches_once_a_minute() {
        let usage = Usage::default();
        let at = Duration::from_secs;
        assert!(usage.note(1, at(0)));
        assert!(!usage.note(1, at(59)));
        assert!(usage.note(1, at(61)) && !usage.note(1, at(120)));
        assert_eq!(usage.idle(1, at(125)), Some(at(5)));
        usage.forget(1);
        assert_eq!(usage.idle(1, at(125)), None);
    }

    #[test]
    fn memory_is_bounded() {
        let usage = Usage::default();
        for key in 0..400_000_u64 {
            usage.note(u128::from(key), Duration::from_micros(key));
        }
        assert!(usage.used.lock().len() <= 2 * CROWDED + 1);
    }
}
