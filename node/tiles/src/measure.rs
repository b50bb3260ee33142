//! How fast the disk cache gives tiles, beside plain reads of the same files.
//!
//! In: a cache directory that earlier runs have filled, their repositories. Out: two rates of one disk, measured in
//! turns, each time with what the system remembers of the files dropped. A bench's room; nothing at work uses it.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rustix::fs::Advice;
use serde::Serialize;

use crate::loader::{CacheConfig, TileCache, Wish};

/// Turns; the best of each sort counts, since others use the machine too.
const TURNS: usize = 5;
/// No disk that a wall can be driven from is slower.
const PATIENCE: Duration = Duration::from_secs(600);

/// Both rates.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct DiskRate {
    /// Tiles that the cache held.
    pub tiles: u64,
    /// Bytes of their files.
    pub bytes: u64,
    /// Megabytes (10^6 bytes) a second from the first wish to the last decoded tile.
    pub loaded_mb_per_s: f64,
    /// Megabytes a second that one reader gets of the same files, one after the other.
    pub plain_mb_per_s: f64,
}

/// Measures a cache directory. Nobody may use it meanwhile.
///
/// # Errors
/// A cache that cannot be opened or read, or holds nothing of these repositories.
pub fn measure_disk(cache: &Path, repositories: &[PathBuf]) -> io::Result<DiskRate> {
    let mut files = Vec::new();
    list(cache, &mut files)?;
    files.sort();
    let bytes: u64 = files.iter().map(|(_, bytes)| bytes).sum();
    let mut best = [f64::INFINITY; 2];
    let mut tiles = 0;
    for _ in 0..TURNS {
        forget(&files)?;
        let begin = Instant::now();
        for (path, _) in &files {
            std::hint::black_box(fs::read(path)?);
        }
        best[0] = best[0].min(begin.elapsed().as_secs_f64());
        forget(&files)?;
        let (loaded, took) = load(cache, bytes, repositories)?;
        tiles = loaded;
        best[1] = best[1].min(took.as_secs_f64());
    }
    if tiles != files.len() as u64 {
        return Err(io::Error::other(format!(
            "{} holds {} files, but {tiles} tiles of these repositories came from it",
            cache.display(),
            files.len()
        )));
    }
    let rate = |seconds: f64| bytes as f64 / 1e6 / seconds;
    Ok(DiskRate {
        tiles,
        bytes,
        loaded_mb_per_s: rate(best[1]),
        plain_mb_per_s: rate(best[0]),
    })
}

/// How many tiles a cache directory holds.
///
/// # Errors
/// A directory that cannot be read.
pub fn count_on_disk(cache: &Path) -> io::Result<u64> {
    let mut files = Vec::new();
    list(cache, &mut files)?;
    Ok(files.len() as u64)
}

/// Loads every tile that the disk holds; how many there were, and how long that took.
fn load(cache: &Path, bytes: u64, repositories: &[PathBuf]) -> io::Result<(u64, Duration)> {
    let threads = std::thread::available_parallelism().map_or(2, usize::from);
    let cache = TileCache::open(&CacheConfig {
        ram_bytes: 2 * bytes,
        // Nothing is to be evicted for this.
        disk_bytes: u64::MAX / 2,
        disk_directory: Some(cache.to_owned()),
        lease: Duration::from_secs(5),
        requests: threads,
        decoders: threads,
    })
    .map_err(io::Error::other)?;
    let mut wishes: Vec<Wish> = Vec::new();
    for repository in repositories {
        let id = cache.add_dataset(repository).map_err(io::Error::other)?;
        let tiles = cache.on_disk(id);
        wishes.extend(tiles.into_iter().map(|tile| (id, tile, 0.0)));
    }
    let begin = Instant::now();
    cache.request(&wishes);
    if !cache.wait_idle(PATIENCE) {
        return Err(io::Error::other(
            "the tiles did not come within ten minutes",
        ));
    }
    let took = begin.elapsed();
    Ok((cache.counters().disk_hits, took))
}

/// Files of tiles and their sizes; what has a dot in front is bookkeeping.
fn list(directory: &Path, files: &mut Vec<(PathBuf, u64)>) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().starts_with('.') {
            continue;
        }
        let metadata = entry.metadata()?;
        if metadata.is_dir() {
            list(&entry.path(), files)?;
        } else {
            files.push((entry.path(), metadata.len()));
        }
    }
    Ok(())
}

/// Makes the system drop what it holds of these files, so that they come from the disk.
fn forget(files: &[(PathBuf, u64)]) -> io::Result<()> {
    for (path, _) in files {
        let file = File::open(path)?;
        // Only what is on the disk can be dropped.
        file.sync_all()?;
        rustix::fs::fadvise(&file, 0, None, Advice::DontNeed)?;
    }
    Ok(())
}
