//! Who wants which tiles, now and soon.
//!
//! In: lists that replace each other, one caller's apart from another's. Out: the same in the queue. It loads nothing.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::{Shared, State, Wish};

/// One caller's wish list; others' lists stay untouched. Dropping it withdraws the wishes.
pub struct Wishes {
    shared: Arc<Shared>,
    caller: u64,
}

impl Wishes {
    pub(super) fn new(shared: &Arc<Shared>) -> Self {
        let caller = shared.callers.fetch_add(1, Ordering::Relaxed);
        Self {
            shared: Arc::clone(shared),
            caller,
        }
    }

    /// Replaces this list. Tiles that do not exist are passed over.
    pub fn request(&self, wants: &[Wish]) {
        self.replace(wants, false);
    }

    /// Replaces the list of what this caller may want soon, as [`TileCache::request_ahead`].
    pub fn request_ahead(&self, wants: &[Wish]) {
        self.replace(wants, true);
    }

    fn replace(&self, wants: &[Wish], soon: bool) {
        let datasets = self.shared.datasets.read();
        let exists = |wish: &&Wish| {
            datasets
                .get(&wish.0)
                .is_some_and(|d| d.index.contains(wish.1))
        };
        let wants = wants
            .iter()
            .filter(exists)
            .map(|(id, tile, priority)| ((*id, *tile), *priority));
        let mut state = self.shared.state.lock();
        if state.is_finished {
            return;
        }
        let State { ram, queue, .. } = &mut *state;
        queue.replace((self.caller, soon), wants, |key| ram.contains(key));
        ram.demote(|key| queue.is_wished(key));
        self.shared.work.notify_all();
        self.shared.news.notify_all();
    }
}

impl Drop for Wishes {
    fn drop(&mut self) {
        self.request(&[]);
        self.request_ahead(&[]);
    }
}
