//! The cache as a renderer sees it: single flight, priority, cancellation, budgets, damage, failure.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod common;

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use common::{dataset, index_of, pyramid, tile_bytes, tile_data, write_repository};
use geodesy::Tile;
use parking_lot::{Condvar, Mutex};
use tiles::{
    CacheConfig, Counters, DatasetId, Lookup, OpenDataset, Source, SourceError, TileCache, Wish,
};

const SOON: Duration = Duration::from_secs(20);

fn config(threads: usize) -> CacheConfig {
    CacheConfig {
        ram_bytes: 1 << 30,
        disk_bytes: 0,
        disk_directory: None,
        lease: Duration::from_secs(5),
        requests: threads,
        decoders: threads,
    }
}

/// A source that can be held shut, counts, and fails on demand.
#[derive(Default)]
struct Probe {
    shut: Mutex<bool>,
    moved: Condvar,
    order: Mutex<Vec<Tile>>,
    failing: AtomicBool,
    away: AtomicBool,
    broken: AtomicBool,
}

struct ProbeSource(Arc<Probe>);

impl Probe {
    fn open(&self, open: bool) {
        *self.shut.lock() = !open;
        self.moved.notify_all();
    }

    fn reads(&self) -> HashMap<Tile, usize> {
        let mut reads = HashMap::new();
        self.order
            .lock()
            .iter()
            .for_each(|tile| *reads.entry(*tile).or_default() += 1);
        reads
    }

    fn wait_reads(&self, count: usize) {
        let start = Instant::now();
        while self.order.lock().len() < count {
            assert!(start.elapsed() < SOON, "no read came");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Source for ProbeSource {
    fn fetch(&self, tile: Tile) -> Result<Option<Vec<u8>>, SourceError> {
        self.0.order.lock().push(tile);
        let mut shut = self.0.shut.lock();
        while *shut {
            self.0.moved.wait(&mut shut);
        }
        let kinds = [
            (&self.0.failing, std::io::ErrorKind::ConnectionReset),
            (&self.0.away, std::io::ErrorKind::ConnectionRefused),
        ];
        for (fails, kind) in kinds {
            if fails.load(Ordering::SeqCst) {
                return Err(SourceError {
                    place: tile.to_string(),
                    source: kind.into(),
                });
            }
        }
        let mut bytes = tile_data(tile).encode().unwrap();
        if self.0.broken.load(Ordering::SeqCst) {
            bytes[80] ^= 1;
        }
        Ok(Some(bytes))
    }
}

fn probed(config: &CacheConfig, deepest: u8) -> (TileCache, DatasetId, Arc<Probe>) {
    let (cache, probe) = (TileCache::open(config).unwrap(), Arc::new(Probe::default()));
    let source = Box::new(ProbeSource(Arc::clone(&probe)));
    let id = cache.add_source(OpenDataset::new(
        dataset(),
        index_of(&pyramid(deepest)),
        source,
    ));
    (cache, id, probe)
}

fn wishes(id: DatasetId, tiles: &[Tile]) -> Vec<Wish> {
    tiles.iter().map(|tile| (id, *tile, 1.0)).collect()
}

fn is_ready(cache: &TileCache, id: DatasetId, tile: Tile) -> bool {
    match cache.get(id, tile) {
        Lookup::Ready(data) => {
            assert_eq!(*data, tile_data(tile));
            true
        }
        _ => false,
    }
}

#[test]
fn loads_a_repository_through_disk_and_ram() {
    let (repository, disk) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    write_repository(repository.path(), 2);
    let tiles = pyramid(2);
    let disk_directory = Some(disk.path().to_owned());
    let config = CacheConfig {
        disk_bytes: 1 << 30,
        disk_directory,
        ..config(2)
    };
    for run in 0..2 {
        let cache = TileCache::open(&config).unwrap();
        let id = cache.add_dataset(repository.path()).unwrap();
        assert_eq!(cache.dataset(id).unwrap().index.len(), tiles.len());
        assert!(matches!(cache.get(id, tiles[7]), Lookup::Pending));
        cache.request(&wishes(id, &tiles));
        assert!(cache.wait_idle(SOON));
        assert!(tiles.iter().all(|tile| is_ready(&cache, id, *tile)));
        assert!(tiles.iter().all(|tile| is_ready(&cache, id, *tile)));
        let count = tiles.len() as u64;
        let Counters {
            distinct,
            repository_reads,
            disk_hits,
            ram_hits,
            ..
        } = cache.counters();
        let due = if run == 0 {
            (count, count, 0, count)
        } else {
            (count, 0, count, count)
        };
        assert_eq!((distinct, repository_reads, disk_hits, ram_hits), due);
    }
}

#[test]
fn what_does_not_exist_is_absent() {
    let (cache, id, probe) = probed(&config(1), 1);
    let deeper = Tile::new(0, 4, 3, 3).unwrap();
    assert!(matches!(cache.get(id, deeper), Lookup::Absent));
    assert!(matches!(
        cache.get(DatasetId::random(), Tile::ROOTS[0]),
        Lookup::Absent
    ));
    cache.request(&[
        (id, deeper, 1.0),
        (DatasetId::random(), Tile::ROOTS[0], 1.0),
    ]);
    assert!(cache.wait_idle(SOON));
    assert!(probe.reads().is_empty());
}

#[test]
fn each_tile_is_loaded_once_however_often_it_is_wished_for() {
    let (cache, id, probe) = probed(&config(3), 3);
    let tiles = pyramid(3);
    std::thread::scope(|scope| {
        for caller in 0..4_usize {
            let (cache, tiles) = (&cache, &tiles);
            scope.spawn(move || {
                let list = cache.wishes();
                for round in 0..40 {
                    let start = (round * 13 + caller * 7) % tiles.len();
                    let some: Vec<Tile> =
                        tiles.iter().cycle().skip(start).take(60).copied().collect();
                    list.request(&wishes(id, &some));
                    for tile in &some {
                        let _ = is_ready(cache, id, *tile);
                    }
                }
                list.request(&wishes(id, tiles));
                assert!(cache.wait_idle(SOON));
                assert!(tiles.iter().all(|tile| is_ready(cache, id, *tile)));
            });
        }
    });
    assert!(probe.reads().values().all(|reads| *reads == 1));
    assert_eq!(cache.counters().distinct, tiles.len() as u64);
}

#[test]
fn the_urgent_come_first_and_the_unwanted_never() {
    let (cache, id, probe) = probed(&config(1), 2);
    probe.open(false);
    let tiles = pyramid(2);
    cache.request(&[(id, tiles[0], 0.0)]);
    probe.wait_reads(1);
    // While the only worker is held up, the wishes change twice.
    cache.request(&wishes(id, &tiles[20..40]));
    let list: Vec<Wish> = (1..9_usize)
        .map(|n| (id, tiles[n], ((n * 5) % 11) as f32))
        .collect();
    cache.request(&list);
    assert!(!cache.wait_idle(Duration::from_millis(20)));
    probe.open(true);
    assert!(cache.wait_idle(SOON));
    let mut due = list;
    due.sort_by(|a, b| b.2.total_cmp(&a.2));
    let due: Vec<Tile> = std::iter::once(tiles[0])
        .chain(due.iter().map(|wish| wish.1))
        .collect();
    assert_eq!(*probe.order.lock(), due);
}

#[test]
fn a_dropped_list_withdraws_its_wishes_only() {
    let (cache, id, probe) = probed(&config(1), 2);
    probe.open(false);
    let tiles = pyramid(2);
    cache.request(&[(id, tiles[0], 9.0), (id, tiles[1], 1.0)]);
    probe.wait_reads(1);
    let other = cache.wishes();
    other.request(&wishes(id, &tiles[1..10]));
    drop(other);
    probe.open(true);
    assert!(cache.wait_idle(SOON));
    assert_eq!(*probe.order.lock(), tiles[..2]);
}

#[test]
fn a_small_budget_delivers_everything_in_turn_and_holds() {
    let budget = 3 * tile_bytes();
    let (cache, id, probe) = probed(
        &CacheConfig {
            ram_bytes: budget,
            ..config(2)
        },
        2,
    );
    let mut left: Vec<Tile> = pyramid(2);
    let roots = 6 * tile_bytes();
    let start = Instant::now();
    // As a renderer does: it wishes for what its own memory lacks, and takes what is there.
    while !left.is_empty() {
        assert!(start.elapsed() < SOON, "{} tiles never came", left.len());
        let seen = cache.generation();
        cache.request(&wishes(id, &left));
        left.retain(|tile| !is_ready(&cache, id, *tile));
        // Each worker may have one tile on its way when the budget fills.
        assert!(cache.counters().ram_bytes <= budget + roots + 2 * tile_bytes());
        if !left.is_empty() {
            let _ = cache.wait_news(seen, Duration::from_millis(100));
        }
    }
    assert!(
        probe.reads().values().all(|reads| *reads == 1),
        "the cache ran in circles"
    );
}

#[test]
fn tiles_nobody_takes_stop_the_loading_and_do_not_evict_each_other() {
    let budget = 3 * tile_bytes();
    let (cache, id, probe) = probed(
        &CacheConfig {
            ram_bytes: budget,
            ..config(1)
        },
        2,
    );
    let tiles = &pyramid(2)[6..];
    cache.request(&wishes(id, tiles));
    assert!(!cache.wait_idle(Duration::from_millis(200)));
    assert_eq!(probe.order.lock().len(), 3);
    // Other wishes make room.
    cache.request(&wishes(id, &tiles[50..52]));
    assert!(cache.wait_idle(SOON));
    assert!(is_ready(&cache, id, tiles[50]) && is_ready(&cache, id, tiles[51]));
}

#[test]
fn failures_are_tried_again_then_reported_and_forgiven() {
    let (cache, id, probe) = probed(&config(1), 1);
    probe.failing.store(true, Ordering::SeqCst);
    cache.request(&wishes(id, &Tile::ROOTS[..1]));
    assert!(cache.wait_idle(SOON));
    let Lookup::Failed(reason) = cache.get(id, Tile::ROOTS[0]) else {
        panic!("it must have failed")
    };
    assert!(reason.contains("0/0/0/0"), "{reason}");
    assert_eq!(probe.order.lock().len(), 4);
    assert_eq!(cache.counters().failed, 1);
    // Others are not held up, and a short failure is never seen.
    cache.request(&wishes(id, &Tile::ROOTS[..2]));
    probe.wait_reads(5);
    probe.failing.store(false, Ordering::SeqCst);
    let start = Instant::now();
    while !is_ready(&cache, id, Tile::ROOTS[1]) {
        assert!(start.elapsed() < SOON);
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_repository_that_is_away_is_waited_for_and_told_once() {
    let (cache, id, probe) = probed(&config(1), 0);
    probe.away.store(true, Ordering::SeqCst);
    cache.request(&wishes(id, &Tile::ROOTS[..1]));
    probe.wait_reads(2);
    let told = cache.generation();
    // More often than a tile may fail.
    probe.wait_reads(6);
    assert!(!cache.wait_idle(Duration::ZERO));
    let Lookup::Away(reason) = cache.get(id, Tile::ROOTS[0]) else {
        panic!("it cannot be reached")
    };
    assert!(reason.contains("0/0/0/0"), "{reason}");
    assert_eq!((cache.counters().failed, cache.generation()), (0, told));
    probe.away.store(false, Ordering::SeqCst);
    assert!(cache.wait_idle(SOON) && is_ready(&cache, id, Tile::ROOTS[0]));
}

#[test]
fn a_broken_file_in_the_repository_is_counted_and_never_shown() {
    let (cache, id, probe) = probed(&config(1), 1);
    probe.broken.store(true, Ordering::SeqCst);
    cache.request(&wishes(id, &Tile::ROOTS[..1]));
    probe.wait_reads(2);
    assert!(!is_ready(&cache, id, Tile::ROOTS[0]));
    probe.broken.store(false, Ordering::SeqCst);
    assert!(cache.wait_idle(SOON));
    assert!(is_ready(&cache, id, Tile::ROOTS[0]));
    assert!(cache.counters().corrupt >= 1);
}

#[test]
fn a_broken_file_on_disk_is_fetched_again() {
    let (repository, disk) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    write_repository(repository.path(), 0);
    let disk_directory = Some(disk.path().to_owned());
    let config = CacheConfig {
        disk_bytes: 1 << 30,
        disk_directory,
        ..config(1)
    };
    let load = || {
        let cache = TileCache::open(&config).unwrap();
        let id = cache.add_dataset(repository.path()).unwrap();
        cache.request(&wishes(id, &Tile::ROOTS));
        assert!(cache.wait_idle(SOON));
        assert!(Tile::ROOTS.iter().all(|tile| is_ready(&cache, id, *tile)));
        cache.counters()
    };
    load();
    let mut directories = vec![disk.path().to_owned()];
    while let Some(directory) = directories.pop() {
        for entry in std::fs::read_dir(directory).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                directories.push(path);
            } else if path.to_string_lossy().contains("002.tile") {
                std::fs::write(&path, b"TWTILE then nothing").unwrap();
            }
        }
    }
    let after = load();
    assert_eq!(
        (after.corrupt, after.repository_reads, after.disk_hits),
        (1, 1, 5)
    );
    assert_eq!(load().disk_hits, 6);
}

#[test]
fn a_new_revision_is_read_anew() {
    let root = tempfile::tempdir().unwrap();
    let mut repository = write_repository(root.path(), 0);
    let cache = TileCache::open(&config(1)).unwrap();
    let id = cache.add_dataset(root.path()).unwrap();
    cache.request(&wishes(id, &Tile::ROOTS));
    assert!(cache.wait_idle(SOON) && is_ready(&cache, id, Tile::ROOTS[0]));
    assert_eq!(cache.add_dataset(root.path()).unwrap(), id);
    assert!(
        is_ready(&cache, id, Tile::ROOTS[0]),
        "nothing changed, nothing is dropped"
    );
    repository.update(|_| {}).unwrap();
    cache.add_dataset(root.path()).unwrap();
    assert!(matches!(cache.get(id, Tile::ROOTS[0]), Lookup::Pending));
    cache.request(&wishes(id, &Tile::ROOTS));
    assert!(cache.wait_idle(SOON) && is_ready(&cache, id, Tile::ROOTS[0]));
}

#[test]
fn a_missing_file_is_a_failure_with_a_reason() {
    let root = tempfile::tempdir().unwrap();
    let repository = write_repository(root.path(), 0);
    repository.remove(Tile::ROOTS[4]).unwrap();
    let cache = TileCache::open(&config(1)).unwrap();
    let id = cache.add_dataset(root.path()).unwrap();
    cache.request(&wishes(id, &Tile::ROOTS));
    assert!(cache.wait_idle(SOON));
    let Lookup::Failed(reason) = cache.get(id, Tile::ROOTS[4]) else {
        panic!("it is not there")
    };
    assert!(reason.contains("missing"), "{reason}");
}

#[test]
fn what_comes_between_a_look_and_a_wish_is_news() {
    let (cache, id, probe) = probed(&config(4), 0);
    for away in [false, true] {
        let tile = Tile::ROOTS[usize::from(away)];
        probe.away.store(away, Ordering::SeqCst);
        probe.open(false);
        cache.request_ahead(&wishes(id, &[tile]));
        probe.wait_reads(1 + usize::from(away));
        // A picture is being made: it notes the generation, and looks in vain.
        let seen = cache.generation();
        assert!(matches!(cache.get(id, tile), Lookup::Pending));
        probe.open(true);
        let start = Instant::now();
        while matches!(cache.get(id, tile), Lookup::Pending) {
            assert!(start.elapsed() < SOON);
            std::thread::sleep(Duration::from_millis(1));
        }
        // Only then it wishes, and waits for news.
        cache.request(&wishes(id, &[tile]));
        assert!(cache.wait_news(seen, Duration::ZERO) > seen);
    }
}

#[test]
fn a_finished_cache_loads_no_more_and_its_figures_stand() {
    let (cache, id, probe) = probed(&config(2), 0);
    probe.open(false);
    cache.request(&wishes(id, &Tile::ROOTS));
    probe.wait_reads(2);
    assert!(!cache.finish(Duration::from_millis(20)));
    probe.open(true);
    assert!(cache.finish(SOON));
    let figures = cache.counters();
    assert_eq!((figures.repository_reads, figures.distinct), (2, 2));
    cache.request(&wishes(id, &Tile::ROOTS));
    assert!(cache.wait_idle(SOON));
    assert_eq!(cache.counters().repository_reads, 2);
}

#[test]
fn arrivals_wake_who_waits_and_a_drop_ends_the_threads() {
    let (cache, id, probe) = probed(&config(2), 0);
    let seen = cache.generation();
    assert_eq!(cache.wait_news(seen, Duration::from_millis(10)), seen);
    cache.request(&wishes(id, &Tile::ROOTS[..1]));
    assert!(cache.wait_news(seen, SOON) > seen);
    drop(cache);
    // The workers hold the last references to the source.
    assert_eq!(Arc::strong_count(&probe), 1);
}
