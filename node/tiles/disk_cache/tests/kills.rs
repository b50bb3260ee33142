//! Processes are killed at random moments: as writers, as holders of leases, as the janitor.
//!
//! In: real processes on one directory. Out: no wrong byte, no name lost for longer than a lease, the budget kept.
//! By default 20 kills; the long form is 200, with the environment variable `TERRAWALL_CACHE_KILLS=200`.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]
#![allow(
    clippy::print_stdout,
    reason = "what was seen, for whoever runs it by hand"
)]

mod common;

use std::process::Child;
use std::time::{Duration, Instant};

use common::{MAX_FILE_BYTES, Work, bytes_at_once, name, next, payload, tree};
use disk_cache::{Claim, DiskCache};

const PROCESSES: usize = 4;
/// What a machine that does other things may add to a lease.
const SLACK: Duration = Duration::from_millis(1500);

#[test]
#[ignore = "run by the tests below as a process of its own"]
fn child() {
    common::child();
}

fn work(root: &std::path::Path, lease: Duration) -> Work {
    Work {
        root: root.to_owned(),
        budget_bytes: 60 * MAX_FILE_BYTES,
        lease,
        names: 150,
        threads: 2,
        rounds: 0,
        seed: 0,
    }
}

fn kill(child: &mut Child) {
    child.kill().unwrap();
    child.wait().unwrap();
}

/// Everybody's names can be had, within a lease and some slack from now on. Says how long the last one took.
fn all_can_be_had(cache: &DiskCache, work: &Work) -> Duration {
    let start = Instant::now();
    let mut waiting: Vec<usize> = (0..work.names).collect();
    while !waiting.is_empty() {
        waiting.retain(|n| match cache.claim(&name(*n)) {
            Claim::Hit(stored) => {
                assert_eq!(stored.bytes(), payload(*n), "a wrong payload of {n}");
                false
            }
            // Given back at once: to have it is what counts.
            Claim::Fetch(_) => false,
            Claim::Busy { .. } => true,
            Claim::Without(reason) => panic!("{reason}"),
        });
        assert!(
            start.elapsed() < work.lease + SLACK,
            "{waiting:?} cannot be had"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    start.elapsed()
}

fn assert_whole(cache: &std::path::Path, work: &Work) {
    let bytes = bytes_at_once(&tree(cache), &tree(cache));
    let most = work.budget_bytes + PROCESSES as u64 * MAX_FILE_BYTES;
    assert!(bytes <= most, "{bytes} bytes, and {most} are allowed");
    assert_eq!(work.lines("wrong"), Vec::<String>::new());
}

#[test]
fn whoever_is_killed_when_nothing_breaks() {
    let kills: u64 = std::env::var("TERRAWALL_CACHE_KILLS").map_or(20, |kills| {
        kills
            .parse()
            .expect("TERRAWALL_CACHE_KILLS is a number of kills")
    });
    let root = tempfile::tempdir().unwrap();
    let work = work(root.path(), Duration::from_millis(300));
    let cache = DiskCache::open(&work.config()).unwrap();
    let mut state = u64::from(std::process::id()) | 1;
    let mut seed = 0;
    let mut spawn = || {
        seed += 1;
        work.spawn(seed)
    };
    let mut children: Vec<Child> = (0..PROCESSES).map(|_| spawn()).collect();
    let mut slowest = Duration::ZERO;
    let mut killed = 0;
    while killed < kills {
        std::thread::sleep(Duration::from_micros(20_000 + next(&mut state) % 150_000));
        // Now and then all die at once.
        let last = if next(&mut state).is_multiple_of(5) {
            PROCESSES
        } else {
            1
        };
        for _ in 0..last {
            let at = next(&mut state) as usize % children.len();
            kill(&mut children.swap_remove(at));
            killed += 1;
        }
        slowest = slowest.max(all_can_be_had(&cache, &work));
        assert_whole(&work.config().root, &work);
        while children.len() < PROCESSES {
            children.push(spawn());
        }
    }
    children.iter_mut().for_each(kill);
    slowest = slowest.max(all_can_be_had(&cache, &work));
    assert_whole(&work.config().root, &work);
    let verification = DiskCache::verify(&work.config().root, false, |_, _| true).unwrap();
    assert_eq!(
        (verification.broken, verification.unreadable),
        (vec![], vec![])
    );
    let fetches = work.lines("fetched").len();
    assert!(fetches > work.names, "the children did nothing");
    println!(
        "{killed} kills, {fetches} fetches, slowest name after {slowest:?}, {:?}",
        cache.counters()
    );
    // What the dead had reserved is given back: after some rounds everything fits again.
    let start = Instant::now();
    for n in 0..40 {
        while let Claim::Fetch(lease) = cache.claim(&name(10_000 + n)) {
            assert!(
                start.elapsed() < 20 * work.lease + SLACK,
                "no room comes back"
            );
            if lease.publish(&payload(10_000 + n)).is_ok() {
                break;
            }
        }
    }
    assert_whole(&work.config().root, &work);
}

#[test]
fn with_the_default_lease_a_name_is_lost_for_five_seconds_at_most() {
    let root = tempfile::tempdir().unwrap();
    let work = work(root.path(), Duration::from_secs(5));
    let cache = DiskCache::open(&work.config()).unwrap();
    let mut children: Vec<Child> = (1..=PROCESSES as u64)
        .map(|seed| work.spawn(seed))
        .collect();
    let start = Instant::now();
    while work.lines("fetched").len() < 300 {
        assert!(
            start.elapsed() < Duration::from_secs(30),
            "the children do nothing"
        );
        std::thread::sleep(Duration::from_millis(2));
    }
    children.iter_mut().for_each(kill);
    let slowest = all_can_be_had(&cache, &work);
    println!("slowest name after {slowest:?}, {:?}", cache.counters());
    assert_whole(&work.config().root, &work);
}
