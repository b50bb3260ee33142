//! The disk cache: plain tiles in a directory that several processes may share.
//!
//! In: tiles from a repository. Out: the same tiles without decompression, or a miss. Files appear and vanish
//! whole; every read verifies the checksum, and a broken file is removed and counted as a miss. Each process
//! keeps its own account and looks at the directory again before it evicts, so that the budget holds whoever
//! writes. Failing to write is no failure: the tile is then read from the repository again.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use parking_lot::Mutex;

use crate::dataset::Dataset;
use crate::format::{DecodeError, EncodeError, TileData};
use crate::publish::{Durability, PARTS, PublishError, publish, sweep};
use crate::repository::relative_path;

/// A file's time of modification tells other processes of its use, no finer than this.
const TOUCH_AFTER: Duration = Duration::from_secs(60);

/// What a disk cache answered.
#[derive(Debug)]
pub(crate) enum Stored {
    /// The tile.
    Hit(Box<TileData>),
    /// It is not there.
    Miss,
    /// It was there but broken, and has been removed.
    Corrupt(DecodeError),
}

/// A cache directory.
#[derive(Debug)]
pub(crate) struct DiskCache {
    root: PathBuf,
    budget: u64,
    /// When this process last used a file.
    used: Mutex<HashMap<PathBuf, SystemTime>>,
    /// Bytes in the directory when it was last looked at, and written by this process since.
    bytes: AtomicU64,
    written: AtomicU64,
    looked: AtomicBool,
    looking: Mutex<()>,
    warned: AtomicBool,
}

struct Entry {
    path: PathBuf,
    bytes: u64,
    used: SystemTime,
}

impl DiskCache {
    /// A cache of at most `budget` bytes in `root`, which is made where it is missing.
    pub(crate) fn open(root: &Path, budget: u64) -> Result<Self, PublishError> {
        let failed = |source| PublishError::Io {
            path: root.to_owned(),
            source,
        };
        fs::create_dir_all(root.join(PARTS)).map_err(failed)?;
        sweep(root);
        Ok(Self {
            root: root.to_owned(),
            budget,
            used: Mutex::default(),
            bytes: AtomicU64::new(0),
            written: AtomicU64::new(0),
            looked: AtomicBool::new(false),
            looking: Mutex::new(()),
            warned: AtomicBool::new(false),
        })
    }

    /// About how many bytes the directory holds.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed) + self.written.load(Ordering::Relaxed)
    }

    /// The path of a tile. A new revision of a data set is another directory; the old one ages out.
    fn path_of(&self, dataset: &Dataset, tile: geodesy::Tile) -> PathBuf {
        let Dataset { id, revision, .. } = dataset;
        self.root
            .join(format!("{id}-{revision}"))
            .join(relative_path(tile))
    }

    /// Reads a tile.
    pub(crate) fn get(&self, dataset: &Dataset, tile: geodesy::Tile) -> Stored {
        let path = self.path_of(dataset, tile);
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Stored::Miss,
            Err(error) => {
                self.warn("read", &path, &error);
                return Stored::Miss;
            }
        };
        match TileData::decode_tile(&bytes, tile) {
            Ok(data) => {
                self.touch(path);
                Stored::Hit(Box::new(data))
            }
            Err(problem) => {
                let _ = fs::remove_file(&path);
                self.used.lock().remove(&path);
                Stored::Corrupt(problem)
            }
        }
    }

    /// Writes a tile, then evicts where the budget is exceeded.
    pub(crate) fn put(&self, dataset: &Dataset, data: &TileData) -> Result<(), EncodeError> {
        if self.budget == 0 {
            return Ok(());
        }
        let bytes = data.encode_plain()?;
        let path = self.path_of(dataset, data.tile);
        if let Err(problem) = publish(&self.root, &path, &bytes, Durability::Lazy) {
            self.warn("write", &path, &problem);
            return Ok(());
        }
        self.used.lock().insert(path, SystemTime::now());
        self.written
            .fetch_add(bytes.len() as u64, Ordering::Relaxed);
        self.trim();
        Ok(())
    }

    /// Looks at the directory where it never did, or where this process has written a sixteenth of the budget
    /// since; then removes the least recently used files until a sixteenth of the budget is free.
    pub(crate) fn trim(&self) {
        let written = self.written.load(Ordering::Relaxed);
        let due = self.bytes() > self.budget || written > self.budget / 16;
        if self.looked.load(Ordering::Relaxed) && !due {
            return;
        }
        // One thread looks; the others go on.
        let Some(_looking) = self.looking.try_lock() else {
            return;
        };
        self.written.fetch_sub(written, Ordering::Relaxed);
        let mut entries = self.look();
        let mut total: u64 = entries.iter().map(|entry| entry.bytes).sum();
        if total > self.budget {
            entries.sort_unstable_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
            let goal = self.budget - self.budget / 16;
            for entry in entries {
                if total <= goal {
                    break;
                }
                // Another process may have been faster; its bytes are gone all the same.
                let _ = fs::remove_file(&entry.path);
                self.used.lock().remove(&entry.path);
                total -= entry.bytes;
            }
        }
        self.bytes.store(total, Ordering::Relaxed);
        self.looked.store(true, Ordering::Relaxed);
    }

    /// Every tile file with the time of its last use by anybody.
    fn look(&self) -> Vec<Entry> {
        let mut entries = Vec::new();
        let mut directories = vec![self.root.clone()];
        while let Some(directory) = directories.pop() {
            let Ok(listing) = fs::read_dir(&directory) else {
                continue;
            };
            for entry in listing.flatten() {
                // Files vanish while other processes evict.
                let Ok(metadata) = entry.metadata() else {
                    continue;
                };
                if metadata.is_dir() {
                    if entry.file_name() != PARTS {
                        directories.push(entry.path());
                    }
                } else if entry
                    .path()
                    .extension()
                    .is_some_and(|ending| ending == "tile")
                {
                    let used = metadata.modified().unwrap_or(SystemTime::UNIX_EPOCH);
                    entries.push(Entry {
                        path: entry.path(),
                        bytes: metadata.len(),
                        used,
                    });
                }
            }
        }
        let mut used = self.used.lock();
        for entry in &mut entries {
            if let Some(own) = used.get(&entry.path) {
                entry.used = entry.used.max(*own);
            }
        }
        // Files that others evicted need no memory of their use.
        if used.len() > 2 * entries.len() + 64 {
            let there: std::collections::HashSet<&PathBuf> =
                entries.iter().map(|entry| &entry.path).collect();
            used.retain(|path, _| there.contains(path));
        }
        entries
    }

    fn touch(&self, path: PathBuf) {
        let now = SystemTime::now();
        let stale = |then: SystemTime| now.duration_since(then).is_ok_and(|age| age > TOUCH_AFTER);
        let known = self.used.lock().insert(path.clone(), now);
        let worthwhile = match known {
            Some(then) => stale(then),
            None => fs::metadata(&path)
                .and_then(|data| data.modified())
                .is_ok_and(stale),
        };
        if worthwhile {
            // A file that vanished or belongs to another user keeps its time; only its age is at stake.
            let _ = File::open(&path).and_then(|file| file.set_modified(now));
        }
    }

    fn warn(&self, action: &str, path: &Path, problem: &dyn std::fmt::Display) {
        if !self.warned.swap(true, Ordering::Relaxed) {
            tracing::warn!(
                "disk cache: cannot {action} {}: {problem}; tiles now come from their repository \
                 (said once)",
                path.display()
            );
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use crate::format::{Kind, NODE_COUNT, SampleType, Samples, Validity};
    use geodesy::Tile;

    fn dataset() -> Dataset {
        Dataset::new("test", Kind::Sar, SampleType::U8, 1)
    }

    fn data(n: u32) -> TileData {
        let samples = Samples::U8(vec![n as u8; NODE_COUNT]);
        TileData::new(tile(n), Kind::Sar, 1, samples, Validity::All).unwrap()
    }

    fn tile(n: u32) -> Tile {
        Tile::new(0, 8, n, 0).unwrap()
    }

    fn size() -> u64 {
        data(0).encode_plain().unwrap().len() as u64
    }

    fn hit(cache: &DiskCache, dataset: &Dataset, n: u32) -> bool {
        matches!(cache.get(dataset, tile(n)), Stored::Hit(found) if *found == data(n))
    }

    #[test]
    fn keeps_tiles_for_the_next_process_but_not_for_the_next_revision() {
        let root = tempfile::tempdir().unwrap();
        let mut dataset = dataset();
        DiskCache::open(root.path(), 1 << 30)
            .unwrap()
            .put(&dataset, &data(1))
            .unwrap();
        let cache = DiskCache::open(root.path(), 1 << 30).unwrap();
        assert!(hit(&cache, &dataset, 1));
        dataset.revision += 1;
        assert!(matches!(cache.get(&dataset, tile(1)), Stored::Miss));
    }

    #[test]
    fn broken_files_are_removed() {
        let root = tempfile::tempdir().unwrap();
        let (dataset, cache) = (dataset(), DiskCache::open(root.path(), 1 << 30).unwrap());
        cache.put(&dataset, &data(1)).unwrap();
        let path = cache.path_of(&dataset, tile(1));
        let mut bytes = fs::read(&path).unwrap();
        bytes[5000] ^= 4;
        fs::write(&path, &bytes).unwrap();
        assert!(matches!(cache.get(&dataset, tile(1)), Stored::Corrupt(_)));
        assert!(!path.exists());
        // A good tile in the wrong place is broken, too.
        cache.put(&dataset, &data(2)).unwrap();
        fs::copy(cache.path_of(&dataset, tile(2)), &path).unwrap();
        assert!(matches!(cache.get(&dataset, tile(1)), Stored::Corrupt(_)));
    }

    #[test]
    fn the_budget_holds_and_the_recently_used_stay() {
        let root = tempfile::tempdir().unwrap();
        let (dataset, cache) = (
            dataset(),
            DiskCache::open(root.path(), 16 * size()).unwrap(),
        );
        for n in 0..60 {
            cache.put(&dataset, &data(n)).unwrap();
            assert!(
                hit(&cache, &dataset, 0),
                "the tile in use was evicted after {n}"
            );
        }
        let total: u64 = cache.look().iter().map(|entry| entry.bytes).sum();
        assert!(total <= 16 * size() && total >= 14 * size(), "{total}");
        assert!(hit(&cache, &dataset, 59) && !hit(&cache, &dataset, 1));
    }

    #[test]
    fn a_new_process_evicts_by_age() {
        let root = tempfile::tempdir().unwrap();
        let dataset = dataset();
        let first = DiskCache::open(root.path(), 1 << 30).unwrap();
        for n in 0..8 {
            first.put(&dataset, &data(n)).unwrap();
            let age = Duration::from_secs(u64::from(if n == 3 { 0 } else { 1000 - n }));
            let file = File::open(first.path_of(&dataset, tile(n))).unwrap();
            file.set_modified(SystemTime::now() - age).unwrap();
        }
        let second = DiskCache::open(root.path(), 3 * size()).unwrap();
        second.trim();
        assert!(
            hit(&second, &dataset, 3) && hit(&second, &dataset, 7) && !hit(&second, &dataset, 0)
        );
    }

    #[test]
    fn use_is_told_to_other_processes() {
        let root = tempfile::tempdir().unwrap();
        let (dataset, cache) = (dataset(), DiskCache::open(root.path(), 1 << 30).unwrap());
        cache.put(&dataset, &data(1)).unwrap();
        let path = cache.path_of(&dataset, tile(1));
        let old = SystemTime::now() - 10 * TOUCH_AFTER;
        File::open(&path).unwrap().set_modified(old).unwrap();
        let other = DiskCache::open(root.path(), 1 << 30).unwrap();
        assert!(hit(&other, &dataset, 1));
        assert!(fs::metadata(&path).unwrap().modified().unwrap() > old + 5 * TOUCH_AFTER);
    }

    #[test]
    fn processes_share_a_directory() {
        let root = tempfile::tempdir().unwrap();
        let dataset = dataset();
        // Each opens its own cache, as processes would.
        std::thread::scope(|scope| {
            for worker in 0..4_u32 {
                let (root, dataset) = (root.path(), &dataset);
                scope.spawn(move || {
                    let cache = DiskCache::open(root, 12 * size()).unwrap();
                    for round in 0..60 {
                        let n = (round * 7 + worker) % 30;
                        match cache.get(dataset, tile(n)) {
                            Stored::Hit(found) => assert_eq!(*found, data(n)),
                            Stored::Miss => cache.put(dataset, &data(n)).unwrap(),
                            Stored::Corrupt(problem) => panic!("{problem}"),
                        }
                    }
                });
            }
        });
        let last = DiskCache::open(root.path(), 12 * size()).unwrap();
        last.trim();
        let total: u64 = last.look().iter().map(|entry| entry.bytes).sum();
        assert!(total <= 12 * size());
    }

    #[test]
    fn an_unwritable_directory_costs_only_the_cache() {
        let root = tempfile::tempdir().unwrap();
        let (dataset, cache) = (dataset(), DiskCache::open(root.path(), 1 << 30).unwrap());
        fs::remove_dir_all(root.path()).unwrap();
        fs::write(root.path(), b"a file now").unwrap();
        cache.put(&dataset, &data(1)).unwrap();
        assert!(matches!(cache.get(&dataset, tile(1)), Stored::Miss));
        fs::remove_file(root.path()).unwrap();
        fs::create_dir(root.path()).unwrap();
    }
}
