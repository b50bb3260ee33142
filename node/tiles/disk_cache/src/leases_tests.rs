//! Tests of leases as files: two caches on one directory, the dead made by hand.
//! In: a temporary directory. Out: who holds what. They must not depend on any file's time.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::time::SystemTime;

use super::*;

const LEASE: Duration = Duration::from_millis(200);

fn leases(root: &Path, lease: Duration) -> Arc<Leases> {
    let layout = Arc::new(Layout::new(root));
    layout.make().unwrap();
    Leases::new(layout, lease)
}

fn held(asked: Asked) -> Guard {
    match asked {
        Asked::Held(guard) => guard,
        Asked::Busy { .. } => panic!("somebody has it"),
    }
}

fn is_busy(asked: &Asked) -> bool {
    matches!(asked, Asked::Busy { .. })
}

/// A lease whose holder was killed: it neither beats nor is given back.
fn dead(leases: &Arc<Leases>, key: &str) {
    let guard = held(leases.ask(key).unwrap());
    leases.held.lock().remove(&guard.number);
    drop(guard);
}

#[test]
fn one_holds_and_the_next_comes_when_it_is_given_back() {
    let root = tempfile::tempdir().unwrap();
    let (one, two) = (leases(root.path(), LEASE), leases(root.path(), LEASE));
    let guard = held(one.ask("janitor").unwrap());
    assert!(is_busy(&two.ask("janitor").unwrap()) && is_busy(&one.ask("janitor").unwrap()));
    drop(guard);
    drop(held(two.ask("janitor").unwrap()));
    assert_eq!(
        fs::read_dir(root.path().join(".leases")).unwrap().count(),
        0
    );
    assert_eq!(fs::read_dir(root.path().join(".parts")).unwrap().count(), 0);
}

#[test]
fn beats_keep_it_alive_and_the_dead_are_broken_whatever_the_clocks_say() {
    let root = tempfile::tempdir().unwrap();
    let (one, two) = (leases(root.path(), LEASE), leases(root.path(), LEASE));
    let guard = held(one.ask("janitor").unwrap());
    let set = |time: SystemTime| {
        let file = File::options()
            .write(true)
            .open(root.path().join(".leases/janitor"));
        file.unwrap().set_modified(time).unwrap();
    };
    let century = Duration::from_secs(100 * 365 * 86_400);
    for round in 0..20 {
        let now = SystemTime::now();
        set(if round % 2 == 0 {
            now + century
        } else {
            SystemTime::UNIX_EPOCH
        });
        assert!(is_busy(&two.ask("janitor").unwrap()));
        std::thread::sleep(LEASE / 8);
        guard.renew();
    }
    assert!(!guard.is_lost());
    one.held.lock().remove(&guard.number);
    set(SystemTime::now() + century);
    let start = Instant::now();
    while is_busy(&two.ask("janitor").unwrap()) {
        assert!(
            start.elapsed() < 3 * LEASE,
            "a far future keeps the dead alive"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(start.elapsed() + LEASE / 8 >= LEASE);
    assert_eq!(two.broken(), 1);
}

#[test]
fn of_many_breakers_one_wins() {
    let root = tempfile::tempdir().unwrap();
    for round in 0..10 {
        let key = format!("{round:032x}");
        dead(&leases(root.path(), LEASE), &key);
        let all: Vec<_> = (0..6).map(|_| leases(root.path(), LEASE)).collect();
        for one in &all {
            assert!(is_busy(&one.ask(&key).unwrap()));
        }
        std::thread::sleep(LEASE + Duration::from_millis(5));
        let barrier = std::sync::Barrier::new(all.len());
        let guards: Vec<Guard> = std::thread::scope(|scope| {
            let asking: Vec<_> = all
                .iter()
                .map(|one| {
                    scope.spawn(|| {
                        barrier.wait();
                        // Those that lose must lose against the winner, too, however often they ask.
                        (0..20).find_map(|_| match one.ask(&key).unwrap() {
                            Asked::Held(guard) => Some(guard),
                            Asked::Busy { .. } => None,
                        })
                    })
                })
                .collect();
            asking
                .into_iter()
                .filter_map(|asking| asking.join().unwrap())
                .collect()
        });
        assert_eq!(guards.len(), 1);
        assert_eq!(all.iter().map(|one| one.broken()).sum::<u64>(), 1);
        guards[0].renew();
        assert!(!guards[0].is_lost());
    }
}

#[test]
fn a_breaker_that_died_delays_by_one_more_lease() {
    let root = tempfile::tempdir().unwrap();
    let two = leases(root.path(), LEASE);
    dead(&leases(root.path(), LEASE), "janitor");
    let content = fs::read(root.path().join(".leases/janitor")).unwrap();
    let marker = format!(".leases/dead-{:032x}-0", fnv1a_128(&content));
    fs::write(root.path().join(marker), b"").unwrap();
    assert!(is_busy(&two.ask("janitor").unwrap()));
    std::thread::sleep(LEASE + LEASE / 4);
    assert!(is_busy(&two.ask("janitor").unwrap()));
    std::thread::sleep(LEASE);
    drop(held(two.ask("janitor").unwrap()));
}

#[test]
fn a_living_lease_that_was_caught_is_put_back() {
    let root = tempfile::tempdir().unwrap();
    let one = leases(root.path(), LEASE);
    let guard = held(one.ask("janitor").unwrap());
    let path = root.path().join(".leases/janitor");
    assert!(!one.take(&path, |_| false).unwrap());
    guard.renew();
    assert!(!guard.is_lost() && path.exists());
}

#[test]
fn a_lost_lease_is_noticed_and_the_new_holders_stays() {
    let root = tempfile::tempdir().unwrap();
    let (one, two) = (leases(root.path(), LEASE), leases(root.path(), LEASE));
    let guard = held(one.ask("janitor").unwrap());
    fs::remove_file(root.path().join(".leases/janitor")).unwrap();
    let other = held(two.ask("janitor").unwrap());
    guard.renew();
    assert!(guard.is_lost());
    drop(guard);
    other.renew();
    assert!(!other.is_lost());
}

#[test]
fn the_longer_of_two_leases_holds() {
    let root = tempfile::tempdir().unwrap();
    let (long, short) = (
        leases(root.path(), Duration::from_secs(60)),
        leases(root.path(), MIN_LEASE),
    );
    let _guard = held(long.ask("janitor").unwrap());
    assert!(is_busy(&short.ask("janitor").unwrap()));
    std::thread::sleep(3 * MIN_LEASE);
    assert!(is_busy(&short.ask("janitor").unwrap()));
    assert_eq!(stated(b"lease_ms 99999999999999999999999"), None);
}

#[test]
fn empty_and_foreign_contents_end_as_the_dead_do() {
    let root = tempfile::tempdir().unwrap();
    let one = leases(root.path(), MIN_LEASE);
    for content in [&b""[..], b"\xff\xfe lease_ms x", &[0; 5000]] {
        fs::write(root.path().join(".leases/janitor"), content).unwrap();
        assert!(is_busy(&one.ask("janitor").unwrap()));
        std::thread::sleep(MIN_LEASE + Duration::from_millis(5));
        drop(held(one.ask("janitor").unwrap()));
    }
}

#[test]
fn the_sweeper_removes_only_the_dead() {
    let root = tempfile::tempdir().unwrap();
    let (one, two) = (leases(root.path(), LEASE), leases(root.path(), LEASE));
    let living = held(one.ask(&"a".repeat(32)).unwrap());
    dead(&one, &"b".repeat(32));
    fs::write(root.path().join(".leases/notes.txt"), b"x").unwrap();
    two.sweep();
    std::thread::sleep(LEASE);
    living.renew();
    two.sweep();
    let left = fs::read_dir(root.path().join(".leases")).unwrap();
    let mut left: Vec<_> = left
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    left.sort();
    assert_eq!(left, ["a".repeat(32), "notes.txt".to_owned()]);
}
