//! What the threads of one open cache share, and the two threads beside the callers': heartbeat and janitor.
//!
//! In: requests for room. Out: beats and rounds. Both threads end soon after the cache was dropped. They must never
//! hold a lock while they wait for a file system, but for the account's own.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use parking_lot::{Condvar, Mutex};

use crate::account::Account;
use crate::layout::Layout;
use crate::leases::{Asked, JANITOR, Leases};
use crate::usage::Usage;
use crate::watch::Watch;

/// Counts since the cache was opened in this process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Files that were there and good.
    pub hits: u64,
    /// Names that were claimed and given out to be fetched.
    pub fetches: u64,
    /// Files that were published.
    pub published: u64,
    /// Files that were not kept: no room, too large, or the directory refused them.
    pub not_kept: u64,
    /// Files that were found broken.
    pub broken: u64,
    /// Leases of the dead that this process broke.
    pub leases_broken: u64,
    /// Files that this process's janitor removed.
    pub evicted: u64,
    /// Their bytes.
    pub evicted_bytes: u64,
}

#[derive(Debug, Default)]
pub(crate) struct Counting {
    pub(crate) hits: AtomicU64,
    pub(crate) fetches: AtomicU64,
    pub(crate) published: AtomicU64,
    pub(crate) not_kept: AtomicU64,
    pub(crate) broken: AtomicU64,
    evicted: AtomicU64,
    evicted_bytes: AtomicU64,
}

impl Counting {
    pub(crate) fn evicted(&self, bytes: u64) {
        self.evicted.fetch_add(1, Ordering::Relaxed);
        self.evicted_bytes.fetch_add(bytes, Ordering::Relaxed);
    }
}

/// One more.
pub(crate) fn count(counter: &AtomicU64) -> u64 {
    counter.fetch_add(1, Ordering::Relaxed)
}

#[derive(Debug, Default)]
struct Request {
    wanted: bool,
    need: u64,
    stop: bool,
}

/// The inside of an open cache.
#[derive(Debug)]
pub(crate) struct Shared {
    pub(crate) layout: Arc<Layout>,
    pub(crate) leases: Arc<Leases>,
    pub(crate) account: Account,
    pub(crate) usage: Usage,
    pub(crate) counters: Counting,
    pub(crate) ledger_watch: Mutex<Watch<String>>,
    pub(crate) budget: u64,
    request: Mutex<Request>,
    asked: Condvar,
    answered: Condvar,
}

impl Shared {
    pub(crate) fn new(layout: Layout, budget: u64, lease: Duration) -> Arc<Self> {
        let layout = Arc::new(layout);
        Arc::new(Self {
            leases: Leases::new(layout.clone(), lease),
            account: Account::new(layout.clone(), budget),
            layout,
            usage: Usage::default(),
            counters: Counting::default(),
            ledger_watch: Mutex::default(),
            budget,
            request: Mutex::default(),
            asked: Condvar::new(),
            answered: Condvar::new(),
        })
    }

    /// Starts the heartbeat and the janitor.
    pub(crate) fn start(self: &Arc<Self>) -> io::Result<()> {
        for (name, run) in [
            ("cache-beat", Self::run_heartbeat as fn(&Self)),
            ("cache-janitor", Self::run_janitor),
        ] {
            let shared = self.clone();
            std::thread::Builder::new()
                .name(name.to_owned())
                .spawn(move || run(&shared))
                .inspect_err(|_| self.stop())?;
        }
        Ok(())
    }

    pub(crate) fn stop(&self) {
        self.request.lock().stop = true;
        self.asked.notify_all();
        self.answered.notify_all();
    }

    pub(crate) fn is_stopping(&self) -> bool {
        self.request.lock().stop
    }

    pub(crate) fn counts(&self) -> Counters {
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        let counters = &self.counters;
        Counters {
            hits: read(&counters.hits),
            fetches: read(&counters.fetches),
            published: read(&counters.published),
            not_kept: read(&counters.not_kept),
            broken: read(&counters.broken),
            leases_broken: self.leases.broken(),
            evicted: read(&counters.evicted),
            evicted_bytes: read(&counters.evicted_bytes),
        }
    }

    /// Asks the janitor for room for a file of `need` bytes.
    pub(crate) fn request_room(&self, need: u64) {
        let mut request = self.request.lock();
        request.wanted = true;
        request.need = request.need.max(need);
        self.asked.notify_all();
    }

    /// Waits until the janitor has answered or `limit` has passed.
    pub(crate) fn await_room(&self, limit: Duration) {
        let mut request = self.request.lock();
        if request.wanted && !request.stop {
            self.answered.wait_for(&mut request, limit);
        }
    }

    /// Waits for `time`, or until the cache is dropped; says whether to go on.
    fn pause(&self, time: Duration) -> bool {
        let until = Instant::now() + time;
        let mut request = self.request.lock();
        while !request.stop && !self.asked.wait_until(&mut request, until).timed_out() {}
        !request.stop
    }

    fn run_heartbeat(&self) {
        // Four beats in a lease: one may be late, and one may be lost.
        while self.pause(self.leases.duration() / 4) {
            self.leases.beat_all();
            self.account.beat();
        }
    }

    fn run_janitor(&self) {
        loop {
            let need = {
                let mut request = self.request.lock();
                while !request.wanted && !request.stop {
                    self.asked.wait(&mut request);
                }
                if request.stop {
                    return;
                }
                request.need
            };
            let began = Instant::now();
            let pause = match self.try_round(need) {
                // Somebody else is the janitor.
                Ok(Some(retry_after)) => retry_after,
                Ok(None) => {
                    self.answer();
                    // Where no room can be made, at most half of the time goes into trying.
                    began.elapsed().max(Duration::from_millis(5))
                }
                Err(error) => {
                    tracing::debug!("disk cache: the janitor gave up a round: {error}");
                    self.answer();
                    Duration::from_millis(100)
                }
            };
            if !self.pause(pause) {
                return;
            }
        }
    }

    fn answer(&self) {
        let mut request = self.request.lock();
        request.wanted = false;
        request.need = 0;
        self.answered.notify_all();
    }

    /// Makes a round if one is needed. Some time where another process is at it.
    fn try_round(&self, need: u64) -> io::Result<Option<Duration>> {
        if !self.needs_round(need)? {
            return Ok(None);
        }
        match self.leases.ask(JANITOR)? {
            Asked::Busy { retry_after } => Ok(Some(retry_after)),
            Asked::Held(guard) => {
                // Whoever was the janitor until now may have made the room.
                if self.needs_round(need)? {
                    self.round(&guard, need)?;
                }
                Ok(None)
            }
        }
    }
}
