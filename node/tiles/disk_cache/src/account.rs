//! This process's own ledger: bytes are reserved in it before a file appears.
//!
//! In: how many bytes a file has. Out: a reservation, or that there is no room by now. Reservations are made in larger
//! pieces than a file where the budget is large, so that most files need no look at the other ledgers.
//! It must not make room; that is the janitor's.

use std::fs;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use parking_lot::Mutex;

use crate::books::{Books, Ledger, ledger_name};
use crate::layout::Layout;

/// Most bytes that a process reserves ahead.
const MAX_AHEAD_BYTES: u64 = 32 << 20;

/// The account of one open cache.
#[derive(Debug)]
pub(crate) struct Account {
    layout: Arc<Layout>,
    budget: u64,
    state: Mutex<State>,
    used: AtomicU64,
}

#[derive(Debug, Default)]
struct State {
    /// Whether the ledger was ever written.
    begun: bool,
    closed: bool,
    beat: u64,
    /// As in the ledger.
    published: u64,
    reserved: u64,
    /// Bytes of files that appeared since the ledger was written; they are in `reserved` there.
    done: u64,
    /// Bytes of files that are being written.
    flying: u64,
    /// Whether anything was published since the last beat.
    busy: bool,
}

impl State {
    fn free(&self) -> u64 {
        self.reserved
            .saturating_sub(self.done)
            .saturating_sub(self.flying)
    }
}

/// What asking for room came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Room {
    /// The bytes are reserved; [`Account::settle`] must follow.
    Reserved {
        /// Whether the budget is nearly used up: a janitor should look before somebody must wait.
        scarce: bool,
    },
    /// There is none, or nobody knows.
    None,
    /// There never will be: the file is larger than the smallest budget of all processes, given here in bytes.
    Never(u64),
}

impl Account {
    pub(crate) fn new(layout: Arc<Layout>, budget: u64) -> Self {
        Self {
            layout,
            budget,
            state: Mutex::default(),
            used: AtomicU64::new(0),
        }
    }

    /// About how many bytes the cache holds, as of the last look.
    pub(crate) fn used(&self) -> u64 {
        self.used.load(Ordering::Relaxed)
    }

    /// Notes what was found in all books.
    pub(crate) fn note(&self, books: &Books) {
        if let Some(used) = books.used() {
            let used = used.saturating_sub(books.reserved());
            self.used.store(used, Ordering::Relaxed);
        }
    }

    /// Reserves `bytes`.
    pub(crate) fn reserve(&self, bytes: u64) -> io::Result<Room> {
        if bytes > self.budget {
            return Ok(Room::Never(self.budget));
        }
        let mut state = self.state.lock();
        if state.free() >= bytes {
            state.flying += bytes;
            return Ok(Room::Reserved { scarce: false });
        }
        let ahead = (self.budget / 256).min(MAX_AHEAD_BYTES).max(bytes);
        for more in [ahead, bytes] {
            let before = state.reserved.saturating_sub(state.done);
            self.write(&mut state, before.saturating_add(more), false)?;
            // Written first, read then: of two processes that reserve at once, at least one sees the other's.
            let books = Books::read(&self.layout);
            let granted = books.as_ref().is_ok_and(|books| {
                let budget = books.budget(self.budget);
                // A janitor that took this process for dead has removed the ledger: it must be written again.
                books
                    .ledgers
                    .contains_key(&ledger_name(&self.layout.holder))
                    && books.used().is_some_and(|used| used <= budget)
            });
            if granted {
                let books = books?;
                self.note(&books);
                state.flying += bytes;
                let budget = books.budget(self.budget);
                let scarce = books.used().is_none_or(|used| used > soft_limit(budget));
                return Ok(Room::Reserved { scarce });
            }
            if let Err(error) = self.write(&mut state, before, false) {
                // The disk says more than is meant: too much is safe, and the next writing mends it.
                state.reserved = before;
                return Err(error);
            }
            let least = books?.budget(self.budget);
            if bytes > least {
                return Ok(Room::Never(least));
            }
            if more == bytes {
                break;
            }
        }
        Ok(Room::None)
    }

    /// Ends a reservation; `published` says whether the file has appeared.
    pub(crate) fn settle(&self, bytes: u64, published: bool) {
        let mut state = self.state.lock();
        state.flying = state.flying.saturating_sub(bytes);
        if published {
            state.done = state.done.saturating_add(bytes);
            state.busy = true;
            self.used.fetch_add(bytes, Ordering::Relaxed);
        }
    }

    /// Shows that the process lives, and gives back what it reserved and does not need.
    pub(crate) fn beat(&self) {
        let mut state = self.state.lock();
        if state.begun && !state.closed {
            let keep = if state.busy { state.free() } else { 0 };
            state.busy = false;
            let reserved = state.flying.saturating_add(keep);
            // A beat that fails is made up for by the next; until then others count too much, never too little.
            let _ = self.write(&mut state, reserved, false);
        }
    }

    /// Says that nothing more will come.
    pub(crate) fn close(&self) {
        let mut state = self.state.lock();
        state.closed = true;
        if !state.begun {
            return;
        }
        let _ = self.write(&mut state, 0, true);
        if state.published == 0 {
            let name = ledger_name(&self.layout.holder);
            let _ = fs::remove_file(self.layout.ledgers.join(name));
        }
    }

    /// Writes the ledger whole. What is done moves from the reserved to the published.
    fn write(&self, state: &mut State, reserved: u64, closed: bool) -> io::Result<()> {
        state.beat += 1;
        let ledger = Ledger {
            budget: self.budget,
            published: state.published.saturating_add(state.done),
            reserved,
            beat: state.beat,
            closed,
        };
        let path = self.layout.ledgers.join(ledger_name(&self.layout.holder));
        self.layout.part(&[&ledger.encode()])?.rename(&path)?;
        state.begun = true;
        state.published = ledger.published;
        state.reserved = reserved;
        state.done = 0;
        Ok(())
    }
}

/// Above this many bytes a janitor goes to work.
pub(crate) const fn soft_limit(budget: u64) -> u64 {
    budget - budget / 32
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use crate::books::{Baseline, baseline_path};

    fn account(root: &std::path::Path, budget: u64) -> Account {
        let layout = Arc::new(Layout::new(root));
        layout.make().unwrap();
        fs::write(baseline_path(&layout, 1), Baseline::default().encode()).unwrap();
        Account::new(layout, budget)
    }

    fn used(account: &Account) -> u64 {
        Books::read(&account.layout).unwrap().used().unwrap()
    }

    #[test]
    fn accounts_share_the_budget() {
        let root = tempfile::tempdir().unwrap();
        let (one, two) = (account(root.path(), 100), account(root.path(), 100));
        assert!(matches!(one.reserve(60).unwrap(), Room::Reserved { .. }));
        assert_eq!(two.reserve(60).unwrap(), Room::None);
        assert!(matches!(
            two.reserve(40).unwrap(),
            Room::Reserved { scarce: true }
        ));
        one.settle(60, false);
        one.beat();
        two.settle(40, true);
        assert!(matches!(two.reserve(60).unwrap(), Room::Reserved { .. }));
        assert_eq!(two.reserve(101).unwrap(), Room::Never(100));
        assert_eq!(used(&one), 100);
    }

    #[test]
    fn the_smallest_budget_holds() {
        let root = tempfile::tempdir().unwrap();
        let (small, large) = (account(root.path(), 50), account(root.path(), 1 << 30));
        assert!(matches!(small.reserve(10).unwrap(), Room::Reserved { .. }));
        assert_eq!(large.reserve(60).unwrap(), Room::Never(50));
        small.settle(10, false);
        small.close();
        assert!(matches!(large.reserve(60).unwrap(), Room::Reserved { .. }));
    }

    #[test]
    fn large_budgets_are_reserved_ahead_and_given_back_when_idle() {
        let root = tempfile::tempdir().unwrap();
        let one = account(root.path(), 256 * 1000);
        for _ in 0..10 {
            assert!(matches!(one.reserve(100).unwrap(), Room::Reserved { .. }));
            one.settle(100, true);
        }
        assert_eq!(used(&one), 1000);
        assert_eq!(one.state.lock().beat, 1, "one look for ten files");
        one.reserve(100).unwrap();
        one.settle(100, true);
        one.beat();
        assert_eq!(used(&one), 2000);
        one.beat();
        assert_eq!(used(&one), 1100);
    }

    #[test]
    fn without_a_baseline_nothing_is_granted() {
        let root = tempfile::tempdir().unwrap();
        let one = account(root.path(), 1000);
        fs::remove_file(baseline_path(&one.layout, 1)).unwrap();
        assert_eq!(one.reserve(1).unwrap(), Room::None);
        one.close();
        assert_eq!(fs::read_dir(&one.layout.ledgers).unwrap().count(), 0);
    }
}
