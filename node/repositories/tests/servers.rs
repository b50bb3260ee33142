//! The client of repositories against servers that others made: nginx, and moto's S3 server, both behind a network
//! with 50 ms latency, 2 % of the requests failing, and an outage (3 s; `TERRAWALL_OUTAGE_SECONDS` sets another).
//!
//! Where a server is not installed its test says so on standard error and passes, unless `TERRAWALL_REQUIRE_NGINX=1`
//! or `TERRAWALL_REQUIRE_MOTO=1` is set.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod common;

use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::PermissionsExt as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use common::front::{Action, Front};
use common::servers::{front, moto, nginx, outage, put, upload};
use common::{place, pyramid, quick, tile_data, write_repository};
use geodesy::Tile;
use repositories::{Address, Options, Repositories};
use tiles::{DATASET_FILE, OpenDataset, ReadError};

/// Requests in flight.
const LIMIT: usize = 8;
/// No thread that wants a tile may be held up for longer: an attempt that is given up and its pauses.
const LONGEST_FETCH: Duration = Duration::from_secs(6);
/// The return of a server must be noticed within this.
const RECOVERY: Duration = Duration::from_secs(4);

/// Reads one tile until it is there, as a cache does; notes how long the longest call took.
fn insist(open: &OpenDataset, tile: Tile, longest: &Mutex<Duration>) {
    loop {
        let begin = Instant::now();
        let read = open.read_now(tile);
        let mut longest = longest.lock().unwrap();
        *longest = begin.elapsed().max(*longest);
        drop(longest);
        match read {
            Ok(read) => return assert_eq!(read.unwrap(), tile_data(tile)),
            Err(ReadError::Source(error)) => {
                let due = matches!(
                    error.source.kind(),
                    ErrorKind::NotConnected
                        | ErrorKind::TimedOut
                        | ErrorKind::ConnectionReset
                        | ErrorKind::ConnectionRefused
                        | ErrorKind::Other
                );
                assert!(due, "{error}");
            }
            Err(error) => panic!("{error}"),
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A flight: all tiles, by more threads than may ask, with an outage in the middle.
fn fly(repositories: &Repositories, open: &OpenDataset, front: &Front, down: &AtomicBool) {
    let tiles = pyramid(3);
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let longest = Mutex::new(Duration::ZERO);
    let during = AtomicU64::new(0);
    let recovery = Mutex::new(Duration::ZERO);
    std::thread::scope(|scope| {
        for _ in 0..2 * LIMIT {
            scope.spawn(|| {
                while let Some(tile) = tiles.get(next.fetch_add(1, Ordering::SeqCst)) {
                    insist(open, *tile, &longest);
                    done.fetch_add(1, Ordering::SeqCst);
                }
            });
        }
        while done.load(Ordering::SeqCst) < tiles.len() / 3 {
            std::thread::sleep(Duration::from_millis(5));
        }
        let before = front.requests();
        down.store(true, Ordering::SeqCst);
        std::thread::sleep(outage());
        during.store(front.requests() - before, Ordering::SeqCst);
        assert!(!repositories.states()[0].reachable);
        down.store(false, Ordering::SeqCst);
        let (begin, at_end) = (Instant::now(), done.load(Ordering::SeqCst));
        while done.load(Ordering::SeqCst) == at_end {
            std::thread::sleep(Duration::from_millis(5));
            assert!(begin.elapsed() < Duration::from_secs(30), "no recovery");
        }
        *recovery.lock().unwrap() = begin.elapsed();
    });
    let (longest, recovery) = (
        longest.into_inner().unwrap(),
        recovery.into_inner().unwrap(),
    );
    let during = during.into_inner();
    let state = &repositories.states()[0];
    eprintln!(
        "outage: {during} requests; longest call {longest:?}; recovery {recovery:?}; {state:?}"
    );
    assert!(state.reachable);
    assert!(longest < LONGEST_FETCH, "{longest:?}");
    assert!(recovery < RECOVERY, "{recovery:?}");
    // Probes, what was under way, and what followed it until the breaker opened: each may have been sent twice, since what
    // fails on a kept connection is sent again on a new one.
    let most = 8 * LIMIT as u64 + (outage().as_secs_f64() * 4.0) as u64;
    assert!(during < most, "{during} requests in the outage");
    assert!(front.most_in_flight() <= LIMIT as u64);
    assert!(state.failures > 0 && state.requests > tiles.len() as u64);
}

fn options() -> Options {
    Options {
        requests_in_flight: LIMIT,
        ..quick()
    }
}

#[test]
fn nginx_behind_a_bad_network() {
    static DOWN: AtomicBool = AtomicBool::new(false);
    let folder = tempfile::tempdir().unwrap();
    let mut repository = write_repository(&folder.path().join("www/earth"), 3);
    let Some(server) = nginx(folder.path()) else {
        return;
    };
    let front = front(server.address, &DOWN, || Action::Reset);
    let repositories = Repositories::new(&options()).unwrap();
    let address = place(&front, "/earth");
    let open = repositories.open(&address).unwrap();
    assert_eq!(open.dataset, *repository.dataset());
    fly(&repositories, &open, &front, &DOWN);
    let absent = Tile::ROOTS[0].children().unwrap()[0];
    repository.remove(absent).unwrap();
    assert!(open.read_now(absent).unwrap().is_none());
    assert!(repositories.revalidate(&address).unwrap().is_none());
    repository.update(|_| {}).unwrap();
    let again = repositories.revalidate(&address).unwrap().unwrap();
    assert_eq!(again.dataset, *repository.dataset());
    let none = place(&front, "/mars");
    let error = repositories.open(&none).err().unwrap();
    assert!(error.to_string().contains("is no repository"), "{error}");
}

#[test]
fn an_s3_server_behind_a_bad_network() {
    static DOWN: AtomicBool = AtomicBool::new(false);
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("earth");
    let mut repository = write_repository(&root, 3);
    let Some(server) = moto() else {
        return;
    };
    put(server.address, "/globe", b"");
    upload(server.address, &root, &root, "/globe/maps/earth");
    let front = front(server.address, &DOWN, || Action::Silence);
    let file = folder.path().join("keys.toml");
    let keys = format!(
        "access_key_id = \"test\"\nsecret_access_key = \"hush\"\nregion = \"us-east-1\"\n\
         endpoint_url = \"http://{}\"\nallow_http = true\n",
        front.address
    );
    fs::write(&file, keys).unwrap();
    fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
    let repositories = Repositories::new(&Options {
        credentials_file: Some(file),
        ..options()
    })
    .unwrap();
    let address: Address = "s3://globe/maps/earth".parse().unwrap();
    let open = repositories.open(&address).unwrap();
    assert_eq!(open.dataset, *repository.dataset());
    fly(&repositories, &open, &front, &DOWN);
    // One that the repository never had.
    let absent = pyramid(3).last().unwrap().children().unwrap()[0];
    assert!(open.read_now(absent).unwrap().is_none());
    assert!(repositories.revalidate(&address).unwrap().is_none());
    repository.update(|_| {}).unwrap();
    let description = fs::read(root.join(DATASET_FILE)).unwrap();
    let key = format!("/globe/maps/earth/{DATASET_FILE}");
    put(server.address, &key, &description);
    let again = repositories.revalidate(&address).unwrap().unwrap();
    assert_eq!(again.dataset, *repository.dataset());
    let none: Address = "s3://nobody/maps".parse().unwrap();
    let error = repositories.open(&none).err().unwrap();
    assert!(error.to_string().contains("is no repository"), "{error}");
    assert!(!format!("{:?}", repositories.states()).contains("hush"));
}
