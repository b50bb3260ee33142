//! How fast a warm cache is, beside plain sequential reads of the same files.
//!
//! In: 1000 files of 300 KB on the disk of the temporary directory. Out: the ratio of the two times, printed. Run by
//! hand: `cargo test --release -p disk_cache --test speed -- --ignored --nocapture`. It must not measure the page cache.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
#![allow(
    clippy::print_stdout,
    reason = "the measurement is what this test is for"
)]

use std::fs::{self, File};
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use disk_cache::{Claim, Config, DiskCache, Name};
use rustix::fs::{Advice, fadvise};

const FILES: usize = 1000;
const BYTES: usize = 300_000;

fn name(n: usize) -> Name {
    Name::new("speed-1", Path::new(&format!("{:02}/{n}", n % 32))).unwrap()
}

fn path(root: &Path, n: usize) -> PathBuf {
    root.join(format!("speed-1/{:02}/{n}.cached", n % 32))
}

/// Drops a file from the page cache. It must have been written back by then.
fn forget(path: &Path) {
    fadvise(File::open(path).unwrap(), 0, None, Advice::DontNeed).unwrap();
}

fn median(mut ratios: Vec<f64>) -> f64 {
    ratios.sort_by(f64::total_cmp);
    ratios[ratios.len() / 2]
}

#[test]
#[ignore = "a measurement, run by hand on a quiet machine"]
fn warm_reads_beside_plain_reads() {
    let root = tempfile::tempdir().unwrap();
    let cache = DiskCache::open(&Config::new(root.path(), 1 << 30)).unwrap();
    for n in 0..FILES {
        let Claim::Fetch(lease) = cache.claim(&name(n)) else {
            panic!("no lease");
        };
        let noise: Vec<u8> = (0..BYTES).map(|at| (at * (n + 7) % 253) as u8).collect();
        lease.publish(&noise).unwrap();
        File::open(path(root.path(), n))
            .unwrap()
            .sync_all()
            .unwrap();
    }
    let by_cache = |n: usize| {
        let Claim::Hit(stored) = cache.claim(&name(n)) else {
            panic!("no hit");
        };
        black_box(stored.bytes().to_vec());
    };
    let plainly = |n: usize| {
        black_box(fs::read(path(root.path(), n)).unwrap());
    };
    for cold in [true, false] {
        let mut ratios = Vec::new();
        let mut times = (Duration::ZERO, Duration::ZERO);
        for round in 0..5 {
            let timed = |by: &dyn Fn(usize)| {
                let mut time = Duration::ZERO;
                for n in 0..FILES {
                    if cold {
                        forget(&path(root.path(), n));
                    }
                    let start = Instant::now();
                    by(n);
                    time += start.elapsed();
                }
                time
            };
            // Paired, and each goes first in turn.
            let (ours, plain) = if round % 2 == 0 {
                let ours = timed(&by_cache);
                (ours, timed(&plainly))
            } else {
                let plain = timed(&plainly);
                (timed(&by_cache), plain)
            };
            times = (times.0 + ours, times.1 + plain);
            ratios.push(plain.as_secs_f64() / ours.as_secs_f64());
        }
        let rate = |time: Duration| (5 * FILES * BYTES) as f64 / time.as_secs_f64() / 1e6;
        println!(
            "{}: {:.0} MB/s by the cache, {:.0} MB/s plainly, {:.0} % (median of 5 pairs)",
            if cold {
                "from the disk"
            } else {
                "from the page cache"
            },
            rate(times.0),
            rate(times.1),
            100.0 * median(ratios)
        );
    }
}
