//! Bad surroundings: broken files, a directory that may not be written, a full disk, a root that vanishes.
//!
//! In: directories made bad by hand; children without permission and without disk. Out: named reasons, hits where they
//! can be had, and no harm to foreign files. It must not need to be root, and says loudly what it had to skip.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
#![allow(
    clippy::print_stdout,
    reason = "what was seen, for whoever runs it by hand"
)]

mod common;

use std::fs::{self, File};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::{Duration, SystemTime};

use common::{name, payload};
use disk_cache::{Claim, Config, DiskCache, Name, OpenError, PublishError, Reason};

const CHILD: &str = "CACHE_TEST_SURROUNDINGS";

fn put(cache: &DiskCache, n: usize) {
    match cache.claim(&name(n)) {
        Claim::Fetch(lease) => lease.publish(&payload(n)).unwrap(),
        other => panic!("{other:?}"),
    }
}

fn is_hit(cache: &DiskCache, n: usize) -> bool {
    cache
        .look(&name(n))
        .is_some_and(|stored| stored.bytes() == payload(n))
}

fn file(root: &Path, n: usize) -> PathBuf {
    root.join(format!("test-1/{:02x}/{n}.cached", n % 7))
}

fn open(root: &Path, budget_bytes: u64) -> DiskCache {
    DiskCache::open(&Config::new(root, budget_bytes)).unwrap()
}

#[test]
fn broken_files_are_told_apart_removed_and_fetched_again() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let cache = open(root, 1 << 20);
    for n in 0..8 {
        put(&cache, n);
    }
    let change = |n: usize, change: fn(&mut Vec<u8>)| {
        // As a broken disk would: another file, since nobody writes into one that others have mapped.
        let mut bytes = fs::read(file(root, n)).unwrap();
        change(&mut bytes);
        fs::write(root.join("new"), bytes).unwrap();
        fs::rename(root.join("new"), file(root, n)).unwrap();
    };
    change(0, |bytes| bytes.truncate(bytes.len() / 2));
    change(1, |bytes| bytes[1000] ^= 1);
    change(2, |bytes| bytes.push(0));
    change(3, |bytes| bytes[8] = 9);
    change(4, Vec::clear);
    fs::copy(file(root, 6), file(root, 5)).unwrap();
    change(6, |bytes| bytes[0] = b'x');
    let found = DiskCache::verify(root, false, |_, _| true).unwrap();
    let mut kinds: Vec<_> = found
        .broken
        .iter()
        .map(|(_, broken)| broken.kind())
        .collect();
    kinds.sort_unstable();
    let expected = [
        "damaged payload",
        "not a cached file",
        "oversized",
        "truncated",
        "truncated",
        "wrong name",
        "wrong version",
    ];
    assert_eq!((kinds, found.good.files), (expected.to_vec(), 1));
    for n in 0..7 {
        put(&cache, n);
        assert!(is_hit(&cache, n));
    }
    assert_eq!(cache.counters().broken, 7);
    cache.discard(&name(7), &"its reader cannot decode it");
    assert!(!file(root, 7).exists() && cache.counters().broken == 8);
    put(&cache, 7);
}

#[test]
fn foreign_files_stay_whatever_happens() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    fs::create_dir(root.join("mine")).unwrap();
    for foreign in ["notes.txt", "mine/photo.jpg", "mine/x.tile"] {
        fs::write(root.join(foreign), [7; 5000]).unwrap();
    }
    let cache = open(root, 30_000);
    for n in 0..40 {
        put(&cache, n);
    }
    fs::write(root.join("test-1/readme"), b"mine, too").unwrap();
    let cleared = DiskCache::clear(root).unwrap();
    assert!(cleared.files > 0 && cleared.bytes <= 30_000);
    let statistics = DiskCache::statistics(root).unwrap();
    assert_eq!((statistics.all.files, statistics.foreign), (0, 4));
    assert!(root.join("mine/photo.jpg").exists() && root.join("test-1/readme").exists());
    put(&cache, 1);
    assert!(is_hit(&cache, 1));
}

#[test]
fn the_least_recently_used_go_first_and_clocks_may_jump() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let writer = open(root, 1 << 20);
    let century = Duration::from_secs(100 * 365 * 86_400);
    for n in 0..30 {
        put(&writer, n);
        let now = SystemTime::now();
        let time = match n {
            3 => now + century,
            4 => SystemTime::UNIX_EPOCH,
            _ => now - Duration::from_secs(1000 - n as u64),
        };
        File::open(file(root, n))
            .unwrap()
            .set_modified(time)
            .unwrap();
    }
    drop(writer);
    let cache = open(root, 60_000);
    // A use by this process saves a file from the far past.
    assert!(is_hit(&cache, 4));
    for n in 30..40 {
        put(&cache, n);
        assert!(is_hit(&cache, n) && is_hit(&cache, 4));
    }
    assert!(is_hit(&cache, 3) && !is_hit(&cache, 0) && !is_hit(&cache, 5));
    assert!(DiskCache::statistics(root).unwrap().all.bytes <= 60_000);
    assert!(cache.bytes() <= 60_000 && cache.counters().evicted > 0);
}

#[test]
fn what_is_larger_than_the_budget_is_not_kept() {
    let root = tempfile::tempdir().unwrap();
    let cache = open(root.path(), 10_000);
    put(&cache, 1);
    let large = Name::new("test-1", Path::new("large")).unwrap();
    let Claim::Fetch(lease) = cache.claim(&large) else {
        panic!("no lease");
    };
    let kept = lease.publish(&[0; 10_000]);
    assert!(matches!(
        kept,
        Err(PublishError::TooLarge { most: 10_000, .. })
    ));
    assert!(is_hit(&cache, 1), "nothing was evicted for it");
    let none = open(root.path(), 0);
    assert!(matches!(
        none.claim(&large),
        Claim::Without(Reason::NoBudget)
    ));
    assert!(is_hit(&none, 1));
}

#[test]
fn a_root_that_vanishes_is_made_again_and_one_below_a_file_refused() {
    let root = tempfile::tempdir().unwrap();
    let inner = root.path().join("cache");
    let cache = open(&inner, 1 << 20);
    put(&cache, 1);
    let Claim::Fetch(lease) = cache.claim(&name(3)) else {
        panic!("no lease");
    };
    fs::remove_dir_all(&inner).unwrap();
    lease.publish(&payload(3)).unwrap();
    put(&cache, 1);
    put(&cache, 2);
    assert!(is_hit(&cache, 1) && is_hit(&cache, 2) && is_hit(&cache, 3));
    // In its place a file: nothing is kept, nothing ends.
    fs::remove_dir_all(&inner).unwrap();
    fs::write(&inner, b"a file").unwrap();
    assert!(matches!(
        cache.claim(&name(1)),
        Claim::Without(Reason::Unusable { .. })
    ));
    let refused = DiskCache::open(&Config::new(&inner, 1 << 20));
    assert!(matches!(refused, Err(OpenError::Root { .. })));
    assert!(DiskCache::statistics(&inner).is_err());
    let hasty = Config {
        lease: Duration::from_millis(1),
        ..Config::new(root.path(), 1)
    };
    assert!(matches!(
        DiskCache::open(&hasty),
        Err(OpenError::Lease { .. })
    ));
}

#[test]
#[ignore = "run by the tests below as a process of its own"]
fn child() {
    let Some(what) = std::env::var_os(CHILD) else {
        return;
    };
    let (what, root) = what.to_str().unwrap().split_once(':').unwrap();
    let cache = open(Path::new(root), 1 << 20);
    match what {
        "read-only" => {
            assert!(is_hit(&cache, 1), "read-only use gives hits");
            assert!(matches!(cache.claim(&name(1)), Claim::Hit(_)));
            let refused = cache.claim(&name(2));
            assert!(
                matches!(refused, Claim::Without(Reason::NotWritable { .. })),
                "{refused:?}"
            );
        }
        // The largest file that this process may write has 4096 bytes.
        _ => {
            let (mut small, mut full) = (0, 0);
            for n in (0..40).map(|n| n * 13) {
                let Claim::Fetch(lease) = cache.claim(&name(n)) else {
                    panic!("no lease for {n}");
                };
                match lease.publish(&payload(n)) {
                    Ok(()) => small += 1,
                    Err(PublishError::Full { .. }) => full += 1,
                    Err(other) => panic!("{other}"),
                }
            }
            assert!(small > 3 && full > 3, "{small} were kept, {full} were not");
            assert_eq!(
                fs::read_dir(Path::new(root).join(".parts"))
                    .unwrap()
                    .count(),
                0
            );
        }
    }
}

/// Runs `child` by a shell that first does what `shell` says.
fn run(shell: &str, what: &str, root: &Path) -> Output {
    let program = std::env::current_exe().unwrap();
    Command::new("sh")
        .args([
            "-c",
            &format!("{shell} \"$0\" --ignored --exact child --nocapture"),
        ])
        .arg(program)
        .env(CHILD, format!("{what}:{}", root.display()))
        .output()
        .unwrap()
}

fn assert_ran(output: &Output) {
    let said = String::from_utf8_lossy(&output.stdout);
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && said.contains("1 passed"),
        "{said}{complaint}"
    );
}

#[test]
fn a_directory_without_permission_still_gives_hits() {
    let root = tempfile::tempdir().unwrap();
    let cache = open(root.path(), 1 << 20);
    put(&cache, 1);
    drop(cache);
    let mut directories = vec![root.path().to_owned()];
    for below in [".parts", ".leases", ".ledger"] {
        directories.push(root.path().join(below));
    }
    let set = |mode| {
        for directory in &directories {
            fs::set_permissions(directory, fs::Permissions::from_mode(mode)).unwrap();
        }
    };
    set(0o555);
    // Permissions do not bind root, so that the child becomes somebody else first.
    let is_root = fs::write(root.path().join("probe"), b"").is_ok();
    let shell = if is_root {
        "exec setpriv --reuid=65534 --regid=65534 --clear-groups"
    } else {
        "exec"
    };
    let output = run(shell, "read-only", root.path());
    set(0o755);
    assert_ran(&output);
}

#[test]
fn a_file_size_limit_is_a_full_disk() {
    let root = tempfile::tempdir().unwrap();
    // Blocks of 512 bytes; signal 25 is SIGXFSZ, which would end the process instead of failing its write.
    let output = run("trap '' 25; ulimit -f 8; exec", "limited", root.path());
    assert_ran(&output);
}

#[test]
fn a_full_disk_keeps_what_fits_and_goes_on_when_there_is_room() {
    let root = tempfile::tempdir().unwrap();
    let mount = Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=128k", "tmpfs"])
        .arg(root.path())
        .output();
    if !mount.is_ok_and(|mount| mount.status.success()) {
        println!(
            "SKIPPED: this user may not mount a file system of 128 KiB; the limit on file sizes stands in"
        );
        return;
    }
    let cache = open(root.path(), 1 << 20);
    let mut full = 0;
    for n in 0..60 {
        match cache.claim(&name(n)) {
            Claim::Fetch(lease) => match lease.publish(&payload(n)) {
                Ok(()) => {}
                Err(PublishError::Full { .. }) => full += 1,
                Err(other) => panic!("{other}"),
            },
            Claim::Without(Reason::Full { .. }) => full += 1,
            other => panic!("{other:?}"),
        }
    }
    let parts = fs::read_dir(root.path().join(".parts")).unwrap().count();
    let kept = (0..60).filter(|n| is_hit(&cache, *n)).count();
    fs::write(root.path().join(".parts/probe"), b"").unwrap();
    DiskCache::clear(root.path()).unwrap();
    std::thread::sleep(Duration::from_millis(1100));
    put(&cache, 70);
    let again = is_hit(&cache, 70);
    drop(cache);
    let unmounted = Command::new("umount").arg("-l").arg(root.path()).status();
    assert!(unmounted.unwrap().success());
    assert!(
        full > 0 && kept > 5 && again && parts == 0,
        "{full} {kept} {again} {parts}"
    );
}
