//! Eight processes with several threads each want the same files: each file is fetched once in the whole cluster.
//!
//! In: real processes on one directory. Out: the log of fetches. It must not count on any order among them.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod common;

use std::collections::HashSet;
use std::time::Duration;

use common::{MAX_FILE_BYTES, Work, tree};
use disk_cache::DiskCache;

#[test]
#[ignore = "run by the test below as a process of its own"]
fn child() {
    common::child();
}

#[test]
fn each_name_is_fetched_exactly_once_and_then_never() {
    let root = tempfile::tempdir().unwrap();
    let work = Work {
        root: root.path().to_owned(),
        budget_bytes: 600 * MAX_FILE_BYTES,
        lease: Duration::from_secs(5),
        names: 500,
        threads: 3,
        rounds: 1,
        seed: 0,
    };
    for run in 0..2 {
        let children: Vec<_> = (0..8).map(|seed| work.spawn(run * 8 + seed + 1)).collect();
        for mut child in children {
            assert!(child.wait().unwrap().success());
        }
        assert_eq!(work.lines("wrong"), Vec::<String>::new());
        let fetched = work.lines("fetched");
        assert_eq!(fetched.len(), 500, "after run {run}");
        assert_eq!(fetched.iter().collect::<HashSet<_>>().len(), 500);
    }
    let cache = root.path().join("cache");
    assert_eq!(tree(&cache).len(), 500);
    let statistics = DiskCache::statistics(&cache).unwrap();
    assert_eq!(
        (
            statistics.all.files,
            statistics.leases,
            statistics.processes
        ),
        (500, 0, 0)
    );
    assert_eq!((statistics.parts.files, statistics.foreign), (0, 0));
    let verification = DiskCache::verify(&cache, false, |_, _| true).unwrap();
    assert_eq!(verification.good, statistics.all);
}
