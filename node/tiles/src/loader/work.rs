//! What a loader thread does: take the next tile, find it, hand it over, keep a plain copy on disk.
//! In: the shared state. Out: tiles in RAM. The only place of the loader that reads and decodes.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use disk_cache::{Claim, DiskCache, Lease, Name, NameError};

use super::Shared;
use super::queue::{ATTEMPTS, Next, Setback};
use crate::dataset::Dataset;
use crate::format::TileData;
use crate::opener::OpenDataset;
use crate::ram::{Key, Level};
use crate::repository::relative_path;
use crate::upkeep::group_of;

/// A broken tile is claimed once more; one that breaks again is read past the disk.
const CLAIMS: usize = 2;
/// Tiles that nobody has asked about.
const MOST_UNTOLD: usize = 1 << 20;

/// A tile and where it came from.
struct Loaded {
    data: Arc<TileData>,
    level: Level,
    /// The right and the duty to keep a copy for other processes.
    lease: Option<Lease>,
}

/// What the disk says of a tile.
enum OnDisk {
    Here(Box<TileData>),
    /// To be fetched, and kept under a lease where there is one.
    Fetch(Option<Lease>),
    Elsewhere(Setback),
}

impl Shared {
    /// Works until the cache is dropped.
    pub(super) fn work(&self) {
        while let Some(key) = self.next() {
            let dataset = self.datasets.read().get(&key.0).map(Arc::clone);
            let loaded = match &dataset {
                Some(dataset) => self.load(dataset, key),
                None => Err(Setback::Failed("its data set is gone".into())),
            };
            let kept = self.hand_over(key, dataset.as_ref(), loaded);
            if let Some((data, lease)) = kept {
                self.keep(&data, lease);
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
            let coming = state.queue.in_flight_soon();
            let may_look_ahead =
                coming < self.most_ahead && state.ahead.allows(state.ram.tile_bytes(), coming);
            match state.queue.next(may_look_ahead, Instant::now()) {
                Next::Load(key) => return Some(key),
                Next::Wait(None) => self.work.wait(&mut state),
                Next::Wait(Some(until)) => {
                    self.work.wait_until(&mut state, until);
                }
            }
        }
    }

    fn load(&self, dataset: &OpenDataset, (_, tile): Key) -> Result<Loaded, Setback> {
        // Where nothing can be fetched, a lease would be taken and given back in vain, by all nodes and for every tile.
        let is_away = dataset.source.is_away();
        let on_disk = match &self.disk {
            Some(disk) => self.look(disk, dataset, tile, is_away),
            None => OnDisk::Fetch(None),
        };
        let lease = match on_disk {
            OnDisk::Here(data) => {
                self.tally.disk_hits.fetch_add(1, Ordering::Relaxed);
                return Ok(Loaded {
                    data: Arc::from(data),
                    level: Level::Disk,
                    lease: None,
                });
            }
            OnDisk::Elsewhere(setback) => return Err(setback),
            OnDisk::Fetch(_) if is_away => {
                let reason = format!("tile {tile}: its repository does not answer");
                return Err(Setback::Unreachable(reason.into()));
            }
            OnDisk::Fetch(lease) => lease,
        };
        let bytes = dataset
            .source
            .fetch(tile)
            .map_err(|error| match error.is_unreachable() {
                true => Setback::Unreachable(error.to_string().into()),
                false => Setback::Failed(error.to_string().into()),
            })?;
        let failed = |reason: String| Setback::Failed(reason.into());
        let bytes = bytes
            .ok_or_else(|| failed("it is in the index, but its file is missing".to_owned()))?;
        self.tally.repository_reads.fetch_add(1, Ordering::Relaxed);
        self.tally
            .repository_bytes
            .fetch_add(bytes.len() as u64, Ordering::Relaxed);
        let decoded = {
            let _pass = self.decoding.pass();
            TileData::decode_tile(&bytes, tile)
        };
        let data = decoded.map_err(|problem| {
            self.tally.corrupt.fetch_add(1, Ordering::Relaxed);
            failed(problem.to_string())
        })?;
        if fits(dataset, &data) {
            Ok(Loaded {
                data: Arc::new(data),
                level: Level::Repository,
                lease,
            })
        } else {
            Err(failed(
                "its kind, channels or sample type are not those of its data set".to_owned(),
            ))
        }
    }

    /// Looks on the disk, and takes a lease on what is not there unless that `is_away`.
    fn look(
        &self,
        disk: &DiskCache,
        dataset: &OpenDataset,
        tile: geodesy::Tile,
        is_away: bool,
    ) -> OnDisk {
        let name = match name_of(&dataset.dataset, tile) {
            Ok(name) => name,
            Err(problem) => {
                tracing::error!("disk cache: {problem}");
                return OnDisk::Fetch(None);
            }
        };
        for _ in 0..CLAIMS {
            let claim = match is_away {
                true => disk.look(&name).map(Claim::Hit),
                false => Some(disk.claim(&name)),
            };
            let stored = match claim {
                None => return OnDisk::Fetch(None),
                Some(claim) => match claim {
                    Claim::Hit(stored) => stored,
                    Claim::Fetch(lease) => return OnDisk::Fetch(Some(lease)),
                    Claim::Busy { retry_after } => {
                        return OnDisk::Elsewhere(Setback::Elsewhere(retry_after));
                    }
                    Claim::Without(_) => return OnDisk::Fetch(None),
                },
            };
            let decoded = {
                let _pass = self.decoding.pass();
                TileData::decode_tile(stored.bytes(), tile)
            };
            let problem = match decoded {
                Ok(data) if fits(dataset, &data) => return OnDisk::Here(Box::new(data)),
                Ok(_) => "it is a tile of another data set".to_owned(),
                Err(problem) => problem.to_string(),
            };
            disk.discard(&name, &problem);
        }
        OnDisk::Fetch(None)
    }

    /// Puts a tile into RAM or notes its setback. Returns what is to be kept on disk.
    fn hand_over(
        &self,
        key: Key,
        dataset: Option<&Arc<OpenDataset>>,
        loaded: Result<Loaded, Setback>,
    ) -> Option<(Arc<TileData>, Lease)> {
        // The lock order is data sets, then state, everywhere.
        let datasets = self.datasets.read();
        let current = datasets.get(&key.0).map(|current| current.dataset.revision);
        let mut state = self.state.lock();
        let wished = state.queue.is_wished(&key);
        // What only takes longer changes no picture. What nobody wishes for may: a picture that is being made looked for the
        // tile in vain a moment ago, and will wish for it in a moment.
        let news = match &loaded {
            Err(Setback::Elsewhere(_)) => false,
            Err(Setback::Unreachable(_)) => state.queue.away(&key).is_none(),
            _ => true,
        };
        let kept = match loaded {
            Ok(loaded) if current == dataset.map(|dataset| dataset.dataset.revision) => {
                let (first, early) = state.queue.done(key);
                if first {
                    self.tally.distinct.fetch_add(1, Ordering::Relaxed);
                    // Where nobody listens, memory is not to be lost for it.
                    if state.loaded.len() < MOST_UNTOLD {
                        state.loaded.push(key.0.number(key.1));
                    }
                }
                let bytes = loaded.data.byte_size() as u64;
                state.ahead.arrived(key, bytes, early);
                state
                    .ram
                    .insert(key, Arc::clone(&loaded.data), loaded.level);
                if !wished {
                    state.ram.demote(|other| *other != key);
                }
                loaded.lease.map(|lease| (loaded.data, lease))
            }
            Ok(loaded) => {
                state.queue.outdated(key);
                loaded.lease.map(|lease| (loaded.data, lease))
            }
            Err(setback) => {
                let attempts = state.queue.set_back(key, setback.clone(), Instant::now());
                if let Setback::Failed(reason) = setback
                    && attempts == ATTEMPTS
                {
                    let (id, tile) = key;
                    tracing::error!("tile {tile} of data set {id} cannot be loaded: {reason}");
                }
                None
            }
        };
        self.generation
            .fetch_add(u64::from(news), Ordering::Release);
        self.news.notify_all();
        // What rests after a setback, or was outdated, may be due before anything that others wait for.
        self.work.notify_one();
        kept
    }

    /// Keeps a plain copy for the next time and for other processes.
    fn keep(&self, data: &TileData, lease: Lease) {
        let encoded = {
            let _pass = self.decoding.pass();
            data.encode_plain()
        };
        match encoded {
            // The disk cache says itself why it does not keep something.
            Ok(bytes) => drop(lease.publish(&bytes)),
            Err(problem) => tracing::error!("disk cache: {problem}"),
        }
    }
}

/// Whether the disk cache holds a tile.
pub(super) fn is_on(disk: &DiskCache, dataset: &Dataset, tile: geodesy::Tile) -> bool {
    name_of(dataset, tile).is_ok_and(|name| disk.holds(&name))
}

/// The name of a tile in the disk cache. A new revision of a data set is another group; the old one ages out.
fn name_of(dataset: &Dataset, tile: geodesy::Tile) -> Result<Name, NameError> {
    Name::new(&group_of(dataset), &relative_path(tile))
}

/// Whether a tile is one of this data set.
fn fits(dataset: &OpenDataset, data: &TileData) -> bool {
    let described = &dataset.dataset;
    data.kind == described.kind
        && data.channels == described.channels
        && data.samples.sample_type() == described.sample_type
}
