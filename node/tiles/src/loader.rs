//! The way of a tile: from the repository over the disk to RAM, in threads, by priority.
//!
//! In: data sets, and wishes for tiles that are replaced at any time. Out: tiles that are in RAM now, never a
//! wait. Each tile is loaded once however often it is wished for, and where processes share a disk cache, by one of
//! them. What fails is tried again, soon at first, then rarely. All reading and decompression happens in the threads
//! of this file. It decides nothing about which tiles are worth having.

mod ahead;
mod gate;
mod queue;
mod wishes;
mod work;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use geodesy::Tile;
use parking_lot::{Condvar, Mutex, RwLock};
use serde::Serialize;
use thiserror::Error;

use crate::dataset::DatasetId;
use crate::format::TileData;
use crate::opener::{Directories, OpenDataset, Opener};
use crate::ram::{Level, RamCache};
use ahead::Ahead;
use disk_cache::DiskCache;
use gate::Gate;
use queue::Queue;

pub use wishes::Wishes;

/// How much a cache may use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CacheConfig {
    /// Bytes of decoded tiles in RAM, beside the roots, which always stay.
    pub ram_bytes: u64,
    /// Bytes of plain tiles on disk; 0 for no disk cache.
    pub disk_bytes: u64,
    /// Where they lie; processes may share it. `None` for no disk cache.
    pub disk_directory: Option<PathBuf>,
    /// How long another process's claim to a tile holds that gives no sign of life.
    pub lease: Duration,
    /// Threads that read, at least 1: so many requests are under way at most.
    pub requests: usize,
    /// How many of them decode at the same time, at least 1.
    pub decoders: usize,
}

/// Why a cache could not be set up.
#[derive(Debug, Error)]
pub enum CacheError {
    /// The disk cache's directory cannot be used.
    #[error(transparent)]
    Disk(#[from] disk_cache::OpenError),
    /// The system gives no threads.
    #[error("cannot start a loader thread: {0}")]
    Threads(std::io::Error),
}

/// Where a tile is.
#[derive(Clone, Debug)]
pub enum Lookup {
    /// Here.
    Ready(Arc<TileData>),
    /// Nowhere: the data set has no such tile, or is itself unknown.
    Absent,
    /// Not in RAM: wish for it.
    Pending,
    /// Not in RAM, and its repository cannot be reached: wish for it, and go without until it comes.
    Away(Arc<str>),
    /// It could not be loaded several times over; tried again now and then while it is wished for.
    Failed(Arc<str>),
}

/// Figures since the cache was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counters {
    /// Different tiles that came into RAM.
    pub distinct: u64,
    /// Tiles read from a repository.
    pub repository_reads: u64,
    /// Tiles read from the disk cache.
    pub disk_hits: u64,
    /// Tiles handed out from RAM without having been loaded for that.
    pub ram_hits: u64,
    /// Files, in the repository or on disk, that were broken.
    pub corrupt: u64,
    /// Tiles that are given up for the time being.
    pub failed: u64,
    /// Bytes of tiles in RAM that were loaded before anybody wanted them.
    pub early_bytes: u64,
    /// Of these, the bytes of tiles that nobody has wanted since.
    pub vain_bytes: u64,
    /// Compressed bytes read from repositories.
    pub repository_bytes: u64,
    /// Bytes of tiles in RAM now.
    pub ram_bytes: u64,
    /// Bytes of tiles in the disk cache now, as far as this process knows.
    pub disk_bytes: u64,
}

/// The cache. Dropping it stops its threads.
pub struct TileCache {
    shared: Arc<Shared>,
    default_wishes: Wishes,
    workers: Vec<JoinHandle<()>>,
}

/// A wish: the larger the priority, the sooner; NaN comes last.
pub type Wish = (DatasetId, Tile, f32);

struct Shared {
    opener: Arc<dyn Opener>,
    datasets: RwLock<HashMap<DatasetId, Arc<OpenDataset>>>,
    /// The same by the places where they were found.
    places: Mutex<HashMap<PathBuf, Arc<OpenDataset>>>,
    disk: Option<DiskCache>,
    decoding: Gate,
    /// So many tiles may be loaded at a time because they may be wanted soon: what is wanted now must not wait for them.
    most_ahead: usize,
    state: Mutex<State>,
    /// Workers wait here for work, and for the time to try again.
    work: Condvar,
    /// Callers wait here for arrivals and for rest.
    news: Condvar,
    generation: AtomicU64,
    callers: AtomicU64,
    tally: Tally,
}

struct State {
    ram: RamCache,
    queue: Queue,
    ahead: Ahead,
    /// Numbers of tiles that came for the first time, until they are told.
    loaded: Vec<u64>,
    /// No wishes are taken any more.
    is_finished: bool,
    stopping: bool,
}

#[derive(Default)]
struct Tally {
    distinct: AtomicU64,
    repository_reads: AtomicU64,
    repository_bytes: AtomicU64,
    disk_hits: AtomicU64,
    ram_hits: AtomicU64,
    corrupt: AtomicU64,
}

impl TileCache {
    /// Sets up the caches and starts the threads. Data sets come from directories.
    pub fn open(config: &CacheConfig) -> Result<Self, CacheError> {
        Self::open_with(config, Arc::new(Directories))
    }

    /// The same with data sets from wherever `opener` finds them.
    pub fn open_with(config: &CacheConfig, opener: Arc<dyn Opener>) -> Result<Self, CacheError> {
        let disk = match &config.disk_directory {
            Some(root) if config.disk_bytes > 0 => Some(DiskCache::open(&disk_cache::Config {
                root: root.clone(),
                budget_bytes: config.disk_bytes,
                lease: config.lease,
            })?),
            _ => None,
        };
        let ram = RamCache::new(config.ram_bytes);
        let shared = Arc::new(Shared {
            opener,
            datasets: RwLock::default(),
            places: Mutex::default(),
            disk,
            decoding: Gate::new(config.decoders),
            most_ahead: (config.requests / 4).max(1),
            state: Mutex::new(State {
                ram,
                queue: Queue::default(),
                ahead: Ahead::default(),
                loaded: Vec::new(),
                is_finished: false,
                stopping: false,
            }),
            work: Condvar::new(),
            news: Condvar::new(),
            generation: AtomicU64::new(0),
            callers: AtomicU64::new(0),
            tally: Tally::default(),
        });
        let default_wishes = Wishes::new(&shared);
        let mut cache = Self {
            shared,
            default_wishes,
            workers: Vec::new(),
        };
        for number in 0..config.requests.max(1) {
            let shared = Arc::clone(&cache.shared);
            let worker = std::thread::Builder::new()
                .name(format!("tiles-{number}"))
                .spawn(move || shared.work())
                .map_err(CacheError::Threads)?;
            cache.workers.push(worker);
        }
        Ok(cache)
    }

    /// Opens a repository and reads its index, while the caller waits. A repository that is known already is
    /// asked again; where an import has changed it since, its tiles leave RAM.
    pub fn add_dataset(
        &self,
        place: &Path,
    ) -> Result<DatasetId, Box<dyn std::error::Error + Send + Sync>> {
        let known = self.shared.places.lock().get(place).map(Arc::clone);
        let opener = &self.shared.opener;
        let open = match known {
            None => Arc::new(opener.open(place)?),
            Some(known) => opener.reopen(place)?.map_or(known, Arc::new),
        };
        let mut places = self.shared.places.lock();
        places.insert(place.to_owned(), Arc::clone(&open));
        drop(places);
        Ok(self.add(open))
    }

    /// Adds a data set that is no repository directory.
    pub fn add_source(&self, added: OpenDataset) -> DatasetId {
        self.add(Arc::new(added))
    }

    fn add(&self, added: Arc<OpenDataset>) -> DatasetId {
        let (id, revision) = (added.dataset.id, added.dataset.revision);
        let tile_bytes = TileData::full_size(added.dataset.sample_type, added.dataset.channels);
        let known = self.shared.datasets.write().insert(id, added);
        let mut state = self.shared.state.lock();
        state.ram.expect(tile_bytes as u64);
        if known.is_some_and(|known| known.dataset.revision != revision) {
            state.ram.purge(id);
            state.ahead.forget(id);
            state.queue.forget(id);
        }
        id
    }

    /// The description and index of a data set.
    #[must_use]
    pub fn dataset(&self, id: DatasetId) -> Option<Arc<OpenDataset>> {
        self.shared.datasets.read().get(&id).map(Arc::clone)
    }

    /// Where a tile is; counts as use. Never waits for anything but other threads' bookkeeping.
    #[must_use]
    pub fn get(&self, id: DatasetId, tile: Tile) -> Lookup {
        let mut state = self.shared.state.lock();
        if let Some(found) = state.ram.get(&(id, tile)) {
            state.ahead.taken(&(id, tile));
            drop(state);
            if found.again {
                self.shared.tally.ram_hits.fetch_add(1, Ordering::Relaxed);
            } else {
                // A tile that was taken makes room for the next one.
                self.shared.work.notify_all();
            }
            return Lookup::Ready(found.data);
        }
        if let Some(reason) = state.queue.failure(&(id, tile)) {
            return Lookup::Failed(reason);
        }
        if let Some(reason) = state.queue.away(&(id, tile)) {
            return Lookup::Away(reason);
        }
        drop(state);
        let datasets = self.shared.datasets.read();
        match datasets.get(&id) {
            Some(dataset) if dataset.index.contains(tile) => Lookup::Pending,
            _ => Lookup::Absent,
        }
    }

    /// Where a tile was found that is in RAM now; does not count as use.
    #[must_use]
    pub fn level(&self, id: DatasetId, tile: Tile) -> Option<Level> {
        self.shared.state.lock().ram.level(&(id, tile))
    }

    /// Replaces the wishes made through this function. What is no longer wished for, here or through
    /// [`TileCache::wishes`], and has not been started, is not loaded.
    pub fn request(&self, wants: &[Wish]) {
        self.default_wishes.request(wants);
    }

    /// Replaces what is not wanted yet, but may be wanted soon. It is loaded when nothing else is to be, and only as
    /// long as not too much of it was loaded in vain.
    pub fn request_ahead(&self, wants: &[Wish]) {
        self.default_wishes.request_ahead(wants);
    }

    /// A wish list of its own for another caller, as each GPU of a host is.
    #[must_use]
    pub fn wishes(&self) -> Wishes {
        Wishes::new(&self.shared)
    }

    /// Figures since the cache was opened.
    #[must_use]
    pub fn counters(&self) -> Counters {
        let (ram_bytes, failed, (early_bytes, vain_bytes)) = {
            let state = self.shared.state.lock();
            let failed = state.queue.failures() as u64;
            (state.ram.bytes(), failed, state.ahead.bytes())
        };
        let (tally, disk) = (&self.shared.tally, self.shared.disk.as_ref());
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Counters {
            distinct: read(&tally.distinct),
            repository_reads: read(&tally.repository_reads),
            disk_hits: read(&tally.disk_hits),
            ram_hits: read(&tally.ram_hits),
            corrupt: read(&tally.corrupt) + disk.map_or(0, |disk| disk.counters().broken),
            failed,
            early_bytes,
            vain_bytes,
            repository_bytes: read(&tally.repository_bytes),
            ram_bytes,
            disk_bytes: disk.map_or(0, DiskCache::bytes),
        }
    }

    /// The tiles of a data set that the disk cache holds. Looks for each of them, while the caller waits.
    #[must_use]
    pub fn on_disk(&self, id: DatasetId) -> Vec<Tile> {
        let (Some(data), Some(disk)) = (self.dataset(id), &self.shared.disk) else {
            return Vec::new();
        };
        let mut tiles = data.index.tiles();
        tiles.retain(|tile| work::is_on(disk, &data.dataset, *tile));
        tiles
    }

    /// Numbers ([`DatasetId::number`]) of tiles that came into RAM for the first time and were not told yet, at most
    /// `most`.
    #[must_use]
    pub fn take_loaded(&self, most: usize) -> Vec<u64> {
        let loaded = &mut self.shared.state.lock().loaded;
        let rest = loaded.split_off(most.min(loaded.len()));
        std::mem::replace(loaded, rest)
    }

    /// Counts up whenever a tile has arrived or failed.
    #[must_use]
    pub fn generation(&self) -> u64 {
        self.shared.generation.load(Ordering::Acquire)
    }

    /// Waits until the generation is past `seen`, at most for `timeout`; returns the generation.
    #[must_use]
    pub fn wait_news(&self, seen: u64, timeout: Duration) -> u64 {
        let mut state = self.shared.state.lock();
        let is_waiting = |_: &mut State| self.generation() <= seen;
        self.shared
            .news
            .wait_while_for(&mut state, is_waiting, timeout);
        self.generation()
    }

    /// Withdraws all wishes for good, and waits until nothing is being loaded, at most for `timeout`: figures change no more
    /// then. False where something still is.
    #[must_use]
    pub fn finish(&self, timeout: Duration) -> bool {
        let mut state = self.shared.state.lock();
        state.is_finished = true;
        state.queue.withdraw();
        let is_waiting = |state: &mut State| state.queue.in_flight() > 0;
        self.shared
            .news
            .wait_while_for(&mut state, is_waiting, timeout);
        !is_waiting(&mut state)
    }

    /// Waits until everything wished for has arrived or failed; false where `timeout` passed first.
    #[must_use]
    pub fn wait_idle(&self, timeout: Duration) -> bool {
        let mut state = self.shared.state.lock();
        let is_waiting = |state: &mut State| !state.queue.is_idle();
        self.shared
            .news
            .wait_while_for(&mut state, is_waiting, timeout);
        !is_waiting(&mut state)
    }
}

impl Drop for TileCache {
    fn drop(&mut self) {
        self.shared.state.lock().stopping = true;
        self.shared.work.notify_all();
        for worker in self.workers.drain(..) {
            // A worker that panicked has nothing left to tell.
            let _ = worker.join();
        }
    }
}
