//! What a loader thread does: take the next tile, find it, hand it over, keep a plain copy on disk.
//! In: the shared state. Out: tiles in RAM. The only place of the loader that reads and decodes.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use super::queue::{ATTEMPTS, Next};
use super::{OpenDataset, Shared};
use crate::disk::Stored;
use crate::format::TileData;
use crate::ram::Key;

/// A tile and where it came from.
struct Loaded {
    data: Arc<TileData>,
    from_disk: bool,
}

impl Shared {
    /// Works until the cache is dropped.
    pub(super) fn work(&self) {
        if let Some(disk) = &self.disk {
            // What an earlier run with a larger budget left.
            disk.trim();
        }
        while let Some(key) = self.next() {
            let dataset = self.datasets.read().get(&key.0).map(Arc::clone);
            let loaded = match &dataset {
                Some(dataset) => self.load(dataset, key),
                None => Err("its data set is gone".to_owned()),
            };
            let fetched = self.hand_over(key, dataset.as_ref(), loaded);
            if let (Some(disk), Some(dataset), Some(data)) = (&self.disk, &dataset, fetched)
                && let Err(problem) = disk.put(&dataset.dataset, &data)
            {
                tracing::error!("disk cache: {problem}");
            }
        }
    }

    fn next(&self) -> Option<Key> {
        let mut state = self.state.lock();
        loop {
            if state.stopping {
                return None;
            }
            if !state.ram.has_room(state.queue.in_flight()) {
                self.work.wait(&mut state);
                continue;
            }
            match state.queue.next(Instant::now()) {
                Next::Load(key) => return Some(key),
                Next::Wait(None) => self.work.wait(&mut state),
                Next::Wait(Some(until)) => {
                    self.work.wait_until(&mut state, until);
                }
            }
        }
    }

    fn load(&self, dataset: &OpenDataset, (_, tile): Key) -> Result<Loaded, String> {
        if let Some(disk) = &self.disk {
            match disk.get(&dataset.dataset, tile) {
                Stored::Hit(data) if fits(dataset, &data) => {
                    self.tally.disk_hits.fetch_add(1, Ordering::Relaxed);
                    return Ok(Loaded {
                        data: Arc::from(data),
                        from_disk: true,
                    });
                }
                Stored::Hit(_) | Stored::Miss => {}
                Stored::Corrupt(problem) => {
                    self.tally.corrupt.fetch_add(1, Ordering::Relaxed);
                    tracing::warn!(
                        "disk cache: tile {tile} was broken and is fetched again: {problem}"
                    );
                }
            }
        }
        let bytes = dataset
            .source
            .fetch(tile)
            .map_err(|error| error.to_string())?;
        let bytes =
            bytes.ok_or_else(|| "it is in the index, but its file is missing".to_owned())?;
        self.tally.repository_reads.fetch_add(1, Ordering::Relaxed);
        self.tally
            .repository_bytes
            .fetch_add(bytes.len() as u64, Ordering::Relaxed);
        let data = TileData::decode_tile(&bytes, tile).map_err(|problem| {
            self.tally.corrupt.fetch_add(1, Ordering::Relaxed);
            problem.to_string()
        })?;
        if fits(dataset, &data) {
            Ok(Loaded {
                data: Arc::new(data),
                from_disk: false,
            })
        } else {
            Err("its kind, channels or sample type are not those of its data set".to_owned())
        }
    }

    /// Puts a tile into RAM or notes its failure. Returns what is worth keeping on disk.
    fn hand_over(
        &self,
        key: Key,
        dataset: Option<&Arc<OpenDataset>>,
        loaded: Result<Loaded, String>,
    ) -> Option<Arc<TileData>> {
        // The lock order is data sets, then state, everywhere.
        let datasets = self.datasets.read();
        let current = datasets.get(&key.0).map(|current| current.dataset.revision);
        let mut state = self.state.lock();
        let fetched = match loaded {
            Ok(loaded) if current == dataset.map(|dataset| dataset.dataset.revision) => {
                if state.queue.done(key) {
                    self.tally.distinct.fetch_add(1, Ordering::Relaxed);
                }
                state.ram.insert(key, Arc::clone(&loaded.data));
                if !state.queue.is_wished(&key) {
                    state.ram.demote(|other| *other != key);
                }
                (!loaded.from_disk).then_some(loaded.data)
            }
            Ok(_) => {
                state.queue.outdated(key);
                None
            }
            Err(reason) => {
                let reason: Arc<str> = reason.into();
                if state.queue.failed(key, Arc::clone(&reason), Instant::now()) == ATTEMPTS {
                    let (id, tile) = key;
                    tracing::error!("tile {tile} of data set {id} cannot be loaded: {reason}");
                }
                None
            }
        };
        self.generation.fetch_add(1, Ordering::Release);
        self.news.notify_all();
        // What rests after a failure, or was outdated, may be due before anything that others wait for.
        self.work.notify_one();
        fetched
    }
}

/// Whether a tile is one of this data set.
fn fits(dataset: &OpenDataset, data: &TileData) -> bool {
    let described = &dataset.dataset;
    data.kind == described.kind
        && data.channels == described.channels
        && data.samples.sample_type() == described.sample_type
}
