//! Six processes write ten times the budget: the tree never holds more than the budget.
//!
//! In: real processes on one directory, and an observer that looks at the tree all the time. Out: the most it saw.
//! It must not call a walk's plain sum the tree's size, which changes during the walk.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
#![allow(
    clippy::print_stdout,
    reason = "what was seen, for whoever runs it by hand"
)]

mod common;

use std::process::Child;
use std::time::Duration;

use common::{MAX_FILE_BYTES, Work, bytes_at_once, tree};

#[test]
#[ignore = "run by the test below as a process of its own"]
fn child() {
    common::child();
}

#[test]
fn the_tree_stays_within_the_budget_at_every_moment() {
    let root = tempfile::tempdir().unwrap();
    let work = Work {
        root: root.path().to_owned(),
        budget_bytes: 100 * MAX_FILE_BYTES,
        lease: Duration::from_secs(1),
        names: 1000,
        threads: 2,
        rounds: 1,
        seed: 0,
    };
    let mut children: Vec<Child> = (1..=6).map(|seed| work.spawn(seed)).collect();
    let cache = root.path().join("cache");
    let (mut most, mut looks, mut before) = (0, 0, tree(&cache));
    let running = |child: &mut Child| child.try_wait().unwrap().is_none();
    while children.iter_mut().any(running) {
        let now = tree(&cache);
        most = most.max(bytes_at_once(&before, &now));
        before = now;
        looks += 1;
    }
    for mut child in children {
        assert!(child.wait().unwrap().success());
    }
    assert_eq!(work.lines("wrong"), Vec::<String>::new());
    let budget = work.budget_bytes;
    println!(
        "{looks} looks, at most {most} of {budget} bytes, {} fetches",
        work.lines("fetched").len()
    );
    assert!(looks > 100);
    assert!(
        most <= budget + 6 * MAX_FILE_BYTES,
        "{most} of {budget} bytes"
    );
    // The cache is used, too: full but for the last eviction's room and what six processes had reserved.
    assert!(most >= budget * 3 / 4, "only {most} of {budget} bytes");
}
