//! What the tests with several processes share: names, payloads, children, and looks at the tree.
//!
//! In: a root. Out: children that claim, fetch and publish, and what they left. A payload is a function of its name,
//! so that every reader can tell a wrong one.
#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "a test that panics has failed; not every test needs everything"
)]

use std::collections::HashMap;
use std::fs;
use std::io::Write;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use disk_cache::{Claim, Config, DiskCache, Name, PublishError};

/// Largest file that [`payload`] makes, its header included, in bytes.
pub(crate) const MAX_FILE_BYTES: u64 = 6_064;

pub(crate) fn name(n: usize) -> Name {
    Name::new("test-1", Path::new(&format!("{:02x}/{n}", n % 7))).unwrap()
}

/// 2000…5999 bytes that belong to `n` alone.
pub(crate) fn payload(n: usize) -> Vec<u8> {
    let mut state = (n as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (0..2000 + n * 7919 % 4000)
        .map(|_| (next(&mut state) >> 32) as u8)
        .collect()
}

/// Xorshift (Marsaglia 2003, "Xorshift RNGs").
pub(crate) fn next(state: &mut u64) -> u64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state
}

pub(crate) fn order(count: usize, seed: u64) -> Vec<usize> {
    let mut state = seed.wrapping_mul(0x2545_f491_4f6c_dd1d) | 1;
    let mut order: Vec<usize> = (0..count).collect();
    for at in (1..count).rev() {
        order.swap(at, next(&mut state) as usize % (at + 1));
    }
    order
}

/// What a child does.
#[derive(Clone)]
pub(crate) struct Work {
    pub(crate) root: PathBuf,
    pub(crate) budget_bytes: u64,
    pub(crate) lease: Duration,
    pub(crate) names: usize,
    pub(crate) threads: usize,
    /// How often it goes through all names; 0: until it is killed.
    pub(crate) rounds: usize,
    pub(crate) seed: u64,
}

const VARIABLES: [&str; 7] = [
    "CACHE_TEST_ROOT",
    "CACHE_TEST_BUDGET",
    "CACHE_TEST_LEASE_MS",
    "CACHE_TEST_NAMES",
    "CACHE_TEST_THREADS",
    "CACHE_TEST_ROUNDS",
    "CACHE_TEST_SEED",
];

impl Work {
    pub(crate) fn config(&self) -> Config {
        Config {
            lease: self.lease,
            ..Config::new(&self.root.join("cache"), self.budget_bytes)
        }
    }

    pub(crate) fn spawn(&self, seed: u64) -> Child {
        let numbers = [
            self.budget_bytes,
            self.lease.as_millis() as u64,
            self.names as u64,
            self.threads as u64,
            self.rounds as u64,
            seed,
        ];
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--ignored", "--exact", "child"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .env(VARIABLES[0], &self.root);
        for (variable, number) in VARIABLES[1..].iter().zip(numbers) {
            command.env(variable, number.to_string());
        }
        command.spawn().unwrap()
    }

    /// Appends a line to a file of the test's own, beside the cache; whole lines never mix.
    pub(crate) fn log(&self, file: &str, line: &str) {
        let mut log = fs::OpenOptions::new()
            .append(true)
            .create(true)
            .open(self.root.join(file))
            .unwrap();
        log.write_all(format!("{line}\n").as_bytes()).unwrap();
    }

    pub(crate) fn lines(&self, file: &str) -> Vec<String> {
        let text = fs::read_to_string(self.root.join(file)).unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    }
}

/// What the test `child` of each file does: nothing, unless it was spawned by [`Work::spawn`].
pub(crate) fn child() {
    let Some(root) = std::env::var_os(VARIABLES[0]) else {
        return;
    };
    let number = |at: usize| -> u64 { std::env::var(VARIABLES[at]).unwrap().parse().unwrap() };
    let work = Work {
        root: PathBuf::from(root),
        budget_bytes: number(1),
        lease: Duration::from_millis(number(2)),
        names: number(3) as usize,
        threads: number(4) as usize,
        rounds: number(5) as usize,
        seed: number(6),
    };
    let cache = DiskCache::open(&work.config()).unwrap();
    std::thread::scope(|scope| {
        for thread in 0..work.threads {
            let (cache, work) = (&cache, &work);
            scope.spawn(move || {
                let mut round = 0;
                while work.rounds == 0 || round < work.rounds {
                    let seed = work.seed * 1000 + (thread * 100 + round) as u64;
                    for n in order(work.names, seed) {
                        have(cache, work, n);
                    }
                    round += 1;
                }
            });
        }
    });
}

/// Claims a name until it was had; a wrong payload is logged, since a panic is lost with a child that is killed.
pub(crate) fn have(cache: &DiskCache, work: &Work, n: usize) {
    loop {
        match cache.claim(&name(n)) {
            Claim::Hit(stored) => {
                if stored.bytes() != payload(n) {
                    work.log("wrong", &format!("{n}"));
                }
                return;
            }
            Claim::Fetch(lease) => {
                work.log("fetched", &format!("{n}"));
                std::thread::sleep(Duration::from_micros(n as u64 * 37 % 2000));
                match lease.publish(&payload(n)) {
                    Ok(()) | Err(PublishError::NoRoom { .. }) => {}
                    Err(error) => work.log("wrong", &error.to_string()),
                }
                return;
            }
            Claim::Busy { retry_after } => std::thread::sleep(retry_after),
            Claim::Without(reason) => {
                work.log("wrong", &reason.to_string());
                return;
            }
        }
    }
}

/// Published files with what tells one from its successor of the same name.
pub(crate) fn tree(root: &Path) -> HashMap<(PathBuf, u64), u64> {
    let mut found = HashMap::new();
    let mut waiting = vec![root.to_owned()];
    while let Some(directory) = waiting.pop() {
        for entry in fs::read_dir(directory).into_iter().flatten().flatten() {
            let (path, Ok(metadata)) = (entry.path(), entry.metadata()) else {
                continue;
            };
            if metadata.is_dir() {
                if !entry.file_name().to_string_lossy().starts_with('.') {
                    waiting.push(path);
                }
            } else if path.extension().is_some_and(|ending| ending == "cached") {
                found.insert((path, metadata.ino()), metadata.len());
            }
        }
    }
    found
}

/// Bytes of files that were in both looks, and therefore there at once at a moment between them. A plain sum would
/// count files that were evicted during the walk beside those that took their place.
pub(crate) fn bytes_at_once<K: Eq + std::hash::Hash>(
    one: &HashMap<K, u64>,
    two: &HashMap<K, u64>,
) -> u64 {
    one.iter()
        .filter(|(file, _)| two.contains_key(file))
        .map(|(_, bytes)| bytes)
        .sum()
}
