//! The client of repositories against a server of this house behind a bad network: every tile comes right in the
//! end, nobody waits for who does not answer, and nothing is asked for more often than it must be.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod common;

use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use common::front::{Action, Front, reply, unlucky};
use common::{place, pyramid, quick, tile_data, write_repository};
use geodesy::Tile;
use repositories::{Address, Failure, OpenError, Options, Repositories};
use tiles::{OpenDataset, ReadError};

fn serve(directory: &Path) -> serve::Server {
    let listen = "127.0.0.1:0".parse().unwrap();
    serve::Server::start(&serve::Config::new(directory, listen)).unwrap()
}

/// Reads tiles with many threads; panics unless each is right.
fn read_all(open: &OpenDataset, tiles: &[Tile], threads: usize) {
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(tile) = tiles.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let read = open.read_now(*tile).unwrap().unwrap();
                    assert_eq!(read, tile_data(*tile));
                }
            });
        }
    });
}

fn kind(result: Result<Option<tiles::TileData>, ReadError>) -> ErrorKind {
    match result {
        Err(ReadError::Source(error)) => error.source.kind(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn all_tiles_come_right_over_a_bad_network() {
    let folder = tempfile::tempdir().unwrap();
    write_repository(folder.path(), 2);
    let server = serve(folder.path());
    let faults = Arc::new(AtomicU64::new(0));
    let counted = Arc::clone(&faults);
    let front = Front::new(Some(server.address()), move |head| {
        std::thread::sleep(Duration::from_millis(50));
        let action = if unlucky(head.number, 1, 4) {
            reply("503 Service Unavailable", "", b"later")
        } else if unlucky(head.number, 2, 4) {
            Action::Reset
        } else if head.path.ends_with(".tile") && unlucky(head.number, 3, 4) {
            Action::ForwardPart(1_500)
        } else if unlucky(head.number, 4, 4) {
            // Slow but whole is no fault.
            return Action::ForwardSlowly(1_000, Duration::from_millis(5));
        } else {
            return Action::Forward;
        };
        counted.fetch_add(1, Ordering::SeqCst);
        action
    });
    let options = Options {
        requests_in_flight: 8,
        attempts: 8,
        ..quick()
    };
    let repositories = Repositories::new(&options).unwrap();
    let open = repositories.open(&place(&front, "")).unwrap();
    let tiles = pyramid(2);
    assert_eq!(open.index.tiles().len(), tiles.len());
    read_all(&open, &tiles, 24);
    let (faults, [state]) = (
        faults.load(Ordering::SeqCst),
        repositories.states().try_into().unwrap(),
    );
    assert!(faults >= 5, "only {faults} faults");
    assert!(state.reachable);
    assert_eq!(state.requests, front.requests());
    // Description, index, description again, every tile once, and once more for every fault.
    assert_eq!(state.requests, 3 + tiles.len() as u64 + faults);
    assert_eq!((state.failures, state.retries), (faults, faults));
    assert!(
        (2..=8).contains(&front.most_in_flight()),
        "{}",
        front.most_in_flight()
    );
    // Broken connections are made anew, others are used again.
    assert!(
        front.connections() <= 8 + faults,
        "{} connections",
        front.connections()
    );
}

#[test]
fn one_connection_serves_many_requests() {
    let folder = tempfile::tempdir().unwrap();
    write_repository(folder.path(), 1);
    let server = serve(folder.path());
    let front = Front::new(Some(server.address()), |_| Action::Forward);
    let repositories = Repositories::new(&quick()).unwrap();
    let open = repositories.open(&place(&front, "")).unwrap();
    read_all(&open, &pyramid(1), 1);
    assert_eq!((front.requests(), front.connections()), (33, 1));
}

#[test]
fn an_outage_costs_no_waiting_and_ends_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    write_repository(folder.path(), 1);
    let server = serve(folder.path());
    let down = Arc::new(AtomicBool::new(false));
    let switch = Arc::clone(&down);
    let front = Front::new(Some(server.address()), move |_| {
        if switch.load(Ordering::SeqCst) {
            Action::Silence
        } else {
            Action::Forward
        }
    });
    let options = Options {
        attempt_timeout: Duration::from_millis(300),
        give_up_after: 4,
        ..quick()
    };
    let repositories = Repositories::new(&options).unwrap();
    let open = repositories.open(&place(&front, "")).unwrap();
    down.store(true, Ordering::SeqCst);
    let begin = Instant::now();
    std::thread::scope(|scope| {
        for tile in Tile::ROOTS {
            let open = &open;
            scope.spawn(move || {
                let kind = kind(open.read_now(tile));
                assert!(
                    matches!(kind, ErrorKind::TimedOut | ErrorKind::NotConnected),
                    "{kind:?}"
                );
            });
        }
    });
    // One attempt each, not four, which would take 1.2 s at least.
    assert!(
        begin.elapsed() < Duration::from_millis(1_100),
        "{:?}",
        begin.elapsed()
    );
    assert!(!repositories.states()[0].reachable);
    let sent = front.requests();
    let begin = Instant::now();
    let mut refused = 0_u64;
    while begin.elapsed() < Duration::from_secs(3) {
        assert_eq!(kind(open.read_now(Tile::ROOTS[0])), ErrorKind::NotConnected);
        refused += 1;
        std::thread::sleep(Duration::from_millis(2));
    }
    // Only probes were sent: one at a time, each with its time limit, ever more rarely.
    let probes = front.requests() - sent;
    assert!((2..=8).contains(&probes), "{probes} probes");
    // Attempts that wait would be ten.
    assert!(refused > 100, "{refused}");
    let error = repositories.revalidate(&place(&front, "")).err().unwrap();
    assert!(error.may_pass(), "{error}");
    down.store(false, Ordering::SeqCst);
    // Nobody asks for anything now.
    let begin = Instant::now();
    while !repositories.states()[0].reachable {
        assert!(begin.elapsed() < Duration::from_secs(3), "not noticed");
        std::thread::sleep(Duration::from_millis(10));
    }
    read_all(&open, &pyramid(1), 4);
}

#[test]
fn a_server_that_refuses_connections_counts_as_away() {
    let address: Address = {
        let gone = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        format!("http://{}/x", gone.local_addr().unwrap())
            .parse()
            .unwrap()
    };
    let repositories = Repositories::new(&quick()).unwrap();
    for _ in 0..3 {
        let error = repositories.open(&address).err().unwrap();
        assert!(error.may_pass(), "{error}");
        assert!(error.to_string().contains(&address.to_string()), "{error}");
    }
    let state = &repositories.states()[0];
    assert!(!state.reachable);
    assert!(
        state
            .last_failure
            .as_ref()
            .unwrap()
            .contains("no connection")
    );
}

#[test]
fn an_unchanged_repository_costs_one_request_and_a_changed_one_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let mut repository = write_repository(folder.path(), 0);
    let server = serve(folder.path());
    let front = Front::new(Some(server.address()), |_| Action::Forward);
    let repositories = Repositories::new(&quick()).unwrap();
    let address = place(&front, "");
    let first = repositories.open(&address).unwrap();
    assert_eq!(first.dataset.revision, 1);
    let before = (front.requests(), server.counters().not_modified);
    assert!(repositories.revalidate(&address).unwrap().is_none());
    let after = (front.requests(), server.counters().not_modified);
    assert_eq!(after, (before.0 + 1, before.1 + 1));
    // An import: tiles, index, description.
    let mut index = repository.load_index().unwrap();
    let child = Tile::ROOTS[0].children().unwrap()[0];
    let data = tile_data(child);
    repository
        .write_atomic(child, &data.encode().unwrap())
        .unwrap();
    index.insert_tile(&data);
    repository.store_index(&index).unwrap();
    // As long as the description stands, the old import does.
    assert!(repositories.revalidate(&address).unwrap().is_none());
    repository
        .update(|dataset| dataset.deepest_level = 1)
        .unwrap();
    let second = repositories.revalidate(&address).unwrap().unwrap();
    assert_eq!(second.dataset, *repository.dataset());
    assert!(second.index.contains(child) && !first.index.contains(child));
    assert_eq!(second.read_now(child).unwrap().unwrap(), data);
    assert!(repositories.revalidate(&address).unwrap().is_none());
    // Touched, but the same.
    repository.dataset().store(folder.path()).unwrap();
    assert!(repositories.revalidate(&address).unwrap().is_none());
    // Directories have it too.
    let directory = Address::of_directory(folder.path());
    assert!(repositories.revalidate(&directory).unwrap().is_some());
    assert!(repositories.revalidate(&directory).unwrap().is_none());
    repository.update(|_| {}).unwrap();
    assert!(repositories.revalidate(&directory).unwrap().is_some());
}

#[test]
fn an_import_that_ends_while_it_is_opened_is_read_whole() {
    let folder = tempfile::tempdir().unwrap();
    let repository = write_repository(folder.path(), 0);
    let server = serve(folder.path());
    let rounds = Arc::new(AtomicU64::new(1));
    let (left, root) = (Arc::clone(&rounds), folder.path().to_owned());
    let front = Front::new(Some(server.address()), move |head| {
        let more = |left: u64| left.checked_sub(1);
        if head.path.ends_with("index.bin")
            && left
                .fetch_update(Ordering::SeqCst, Ordering::SeqCst, more)
                .is_ok()
        {
            let mut repository = tiles::Repository::open(&root).unwrap();
            repository.update(|_| {}).unwrap();
        }
        Action::Forward
    });
    let repositories = Repositories::new(&quick()).unwrap();
    let open = repositories.open(&place(&front, "")).unwrap();
    assert_eq!(open.dataset.revision, repository.dataset().revision + 1);
    // Description, index, description (changed), index, description (the same).
    assert_eq!(front.requests(), 5);
    rounds.store(u64::MAX, Ordering::SeqCst);
    let again = Repositories::new(&quick()).unwrap();
    let error = again.open(&place(&front, "")).err().unwrap();
    assert!(matches!(error, OpenError::Restless { .. }), "{error}");
    assert!(error.may_pass());
}

/// A repository whose tiles the script answers for.
fn scripted(
    folder: &Path,
    options: &Options,
    script: impl Fn(&common::front::Head) -> Action + Send + Sync + 'static,
) -> (serve::Server, Front, Repositories, OpenDataset) {
    write_repository(folder, 0);
    let server = serve(folder);
    let front = Front::new(Some(server.address()), move |head| {
        if head.path.ends_with(".tile") {
            script(head)
        } else {
            Action::Forward
        }
    });
    let repositories = Repositories::new(options).unwrap();
    let open = repositories.open(&place(&front, "/")).unwrap();
    (server, front, repositories, open)
}

#[test]
fn what_will_not_pass_is_asked_for_once() {
    let folder = tempfile::tempdir().unwrap();
    let (_server, front, repositories, open) =
        scripted(folder.path(), &quick(), |head| match head.path.as_str() {
            "/0/000.tile" => reply("404 Not Found", "", b"no"),
            "/0/001.tile" => reply("401 Unauthorized", "WWW-Authenticate: Basic\r\n", b""),
            "/0/002.tile" => reply("403 Forbidden", "", b"<Code>AccessDenied</Code> hush"),
            "/0/003.tile" => reply("206 Partial Content", "", b"?"),
            // Announces more than a tile can have, and would send it.
            "/0/004.tile" => Action::Reply(
                b"HTTP/1.1 200 OK\r\nContent-Length: 1000000000\r\n\r\nfirst bytes".to_vec(),
            ),
            _ => Action::Reply(
                b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n1\r\nx\r\n0\r\n\r\n"
                    .to_vec(),
            ),
        });
    let mut sent = front.requests();
    let mut one = || {
        sent += 1;
        assert_eq!(front.requests(), sent);
    };
    assert!(open.read_now(Tile::ROOTS[0]).unwrap().is_none());
    one();
    let kinds = [
        ErrorKind::PermissionDenied,
        ErrorKind::PermissionDenied,
        ErrorKind::Other,
        ErrorKind::InvalidData,
        ErrorKind::InvalidData,
    ];
    for (tile, due) in Tile::ROOTS[1..].iter().zip(kinds) {
        let begin = Instant::now();
        let error = open.read_now(*tile).unwrap_err();
        assert!(!error.to_string().contains("hush"), "{error}");
        assert!(error.to_string().contains(&front.url("")));
        assert_eq!(kind(Err(error)), due, "{tile}");
        assert!(begin.elapsed() < Duration::from_secs(1));
        one();
    }
    let state = &repositories.states()[0];
    assert_eq!((state.reachable, state.failures), (true, 0));
}

#[test]
fn a_cut_body_is_never_taken_for_a_tile() {
    let folder = tempfile::tempdir().unwrap();
    let options = Options {
        attempts: 3,
        ..quick()
    };
    let (_server, front, _repositories, open) =
        scripted(folder.path(), &options, |_| Action::ForwardPart(2_000));
    let sent = front.requests();
    assert_eq!(
        kind(open.read_now(Tile::ROOTS[0])),
        ErrorKind::ConnectionReset
    );
    assert_eq!(front.requests(), sent + 3);
}

#[test]
fn a_server_may_say_when_to_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let first = AtomicBool::new(true);
    let (_server, front, repositories, open) = scripted(folder.path(), &quick(), move |head| {
        match head.path.as_str() {
            "/0/000.tile" if first.swap(false, Ordering::SeqCst) => {
                reply("429 Too Many Requests", "Retry-After: 1\r\n", b"")
            }
            "/0/001.tile" => reply("503 Service Unavailable", "Retry-After: 100\r\n", b""),
            _ => Action::Forward,
        }
    });
    let begin = Instant::now();
    assert!(open.read_now(Tile::ROOTS[0]).unwrap().is_some());
    let waited = begin.elapsed();
    assert!(waited >= Duration::from_secs(1), "{waited:?}");
    assert!(waited < Duration::from_secs(5), "{waited:?}");
    // Longer than anybody should wait: nobody does, and nobody else asks either.
    let sent = front.requests();
    let begin = Instant::now();
    assert_eq!(kind(open.read_now(Tile::ROOTS[1])), ErrorKind::Other);
    assert_eq!(kind(open.read_now(Tile::ROOTS[2])), ErrorKind::NotConnected);
    assert!(begin.elapsed() < Duration::from_secs(10));
    assert_eq!(front.requests(), sent + 1);
    assert!(!repositories.states()[0].reachable);
}

#[test]
fn closing_ends_all_waiting() {
    let folder = tempfile::tempdir().unwrap();
    let options = Options {
        attempt_timeout: Duration::from_secs(60),
        requests_in_flight: 2,
        ..quick()
    };
    let (_server, front, repositories, open) =
        scripted(folder.path(), &options, |_| Action::Silence);
    let sent = front.requests();
    std::thread::scope(|scope| {
        // Two are under way, the others wait for their turn.
        for tile in Tile::ROOTS {
            let open = &open;
            scope.spawn(move || assert_eq!(kind(open.read_now(tile)), ErrorKind::Interrupted));
        }
        while front.requests() < sent + 2 {
            std::thread::sleep(Duration::from_millis(5));
        }
        let begin = Instant::now();
        drop(repositories);
        assert!(begin.elapsed() < Duration::from_secs(1));
    });
    let begin = Instant::now();
    assert_eq!(kind(open.read_now(Tile::ROOTS[0])), ErrorKind::Interrupted);
    assert!(begin.elapsed() < Duration::from_secs(1));
    assert_eq!(front.requests(), sent + 2);
}

#[test]
fn what_is_no_repository_is_named_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    write_repository(&folder.path().join("whole"), 0);
    write_repository(&folder.path().join("cut"), 0);
    std::fs::remove_file(folder.path().join("cut/index.bin")).unwrap();
    write_repository(&folder.path().join("broken"), 0);
    std::fs::write(folder.path().join("broken/index.bin"), "nonsense").unwrap();
    write_repository(&folder.path().join("novel"), 0);
    std::fs::write(
        folder.path().join("novel/dataset.toml"),
        "format_version = 9",
    )
    .unwrap();
    let server = serve(folder.path());
    let repositories = Repositories::new(&quick()).unwrap();
    let message = |name: &str| {
        let address = format!("http://{}/{name}", server.address());
        let error = repositories.open(&address.parse().unwrap()).err().unwrap();
        assert!(!error.may_pass(), "{error}");
        let message = error.to_string();
        assert!(message.contains(&address), "{message}");
        message
    };
    assert!(message("none").contains("terrawall import"));
    assert!(message("cut").contains("no index.bin"));
    assert!(message("broken").contains("TWINDX"));
    assert!(message("novel").contains("format_version is 9"));
    // Their addresses are of one server; the repositories are apart.
    let whole = format!("http://{}/whole/", server.address());
    assert!(repositories.open(&whole.parse().unwrap()).is_ok());
    assert_eq!(repositories.states().len(), 5);
    let closing = Failure::Closing.to_string();
    assert!(closing.contains("closed"), "{closing}");
}
