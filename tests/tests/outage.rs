//! Whole walls over data behind bad networks: 50 ms latency, 2 % of the requests failing, and an outage in mid-flight.
//!
//! In: nginx, moto's S3 server and `terrawall serve`, each behind a front that spoils connections. Out: verdicts on frames
//! and pixels, beside the same flight over a directory. The outage lasts 2 s; `TERRAWALL_OUTAGE_SECONDS=60` makes it a
//! minute. Where nginx or moto is not installed a test says so and passes, unless `TERRAWALL_REQUIRE_NGINX=1` or
//! `TERRAWALL_REQUIRE_MOTO=1` is set.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

#[path = "../../node/repositories/tests/common/front.rs"]
mod front;
#[path = "../../node/repositories/tests/common/servers.rs"]
mod servers;

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use front::{Action, Front};
use tests::command::{self, Running};
use tests::flights::{self, Flight, Flown, above_the_alps};
use tests::{data, pictures};

const FPS: f64 = 5.0;
/// Seconds of flight before and after the outage, more or less.
const BESIDE_S: f64 = 6.0;
/// Of the deadlines of all nodes, so many more may be missed than without a network: the machine has other work, too.
const SHARE_MISSED: f64 = 0.02;
/// The same in a short flight: where a level of detail changes, making leaves on the processor takes about as long as a
/// frame has, and chance decides which flight is late. One that stalled with the network would miss 20 at least.
const FEW_MISSED: f64 = 8.0;
/// One of so many flights must be in time: machines have busy minutes.
const FLIGHTS: usize = 3;
/// Requests after which the network goes away: nodes are on their way then.
const BEFORE_OUTAGE: u64 = 30;

/// A server that is silent for less is only slow: attempts wait for it.
const PATIENCE: Duration = Duration::from_secs(40);

/// The default of `servers` is for its own tests.
fn outage() -> Duration {
    match std::env::var("TERRAWALL_OUTAGE_SECONDS") {
        Ok(_) => servers::outage(),
        Err(_) => Duration::from_secs(2),
    }
}

fn flight(folder: &std::path::Path) -> Flight {
    let seconds = outage().as_secs_f64() + 2.0 * BESIDE_S;
    Flight {
        fps: FPS,
        frames: (seconds * FPS) as u64,
        path: vec![
            (0.0, above_the_alps(1.2e7)),
            (seconds - 1.0, above_the_alps(6e4)),
        ],
        ..Flight::here(&folder.join("cache"))
    }
}

/// The flight over a directory: what the others are held against.
fn reference() -> &'static Flown {
    static REFERENCE: OnceLock<Flown> = OnceLock::new();
    REFERENCE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let flown = flight(folder.path()).fly();
        assert!(pictures::colours(&flown.picture) > 100);
        flown
    })
}

/// Flies, with an outage while the nodes load, and holds the flight against the one over a directory.
/// `is_told`: whether the operator must have heard of the outage.
fn fly(flight: &Flight, front: &Front, down: &AtomicBool, is_told: bool) {
    let missed = |flown: &Flown| flown.number("/missed_deadlines");
    let deadlines = flight.frames * u64::from(flight.nodes);
    let more = (SHARE_MISSED * deadlines as f64).max(FEW_MISSED);
    let mut late = Vec::new();
    while late.len() < FLIGHTS {
        let expected = reference();
        let flown = fly_through(flight, front, down);
        eprintln!(
            "{} requests; {} of {deadlines} deadlines missed, {} over a directory; {} tiles; {}",
            front.requests(),
            missed(&flown),
            missed(expected),
            flown.report["tiles"],
            flown.report["errors"]
        );
        assert_eq!(flown.number("/frames") as u64, flight.frames);
        // Both nodes together read each tile once, however often requests failed.
        assert_eq!(flown.tiles("repository_reads"), flown.tiles("distinct"));
        assert_eq!(flown.report["converged"], true);
        let differing = pictures::differing(&flown.picture, &expected.picture);
        assert_eq!(differing, 0, "the picture is another one afterwards");
        // The outage was noticed, and told.
        if is_told {
            assert!(flown.words.contains("cannot be reached"), "{}", flown.words);
            assert!(flown.words.contains("answers again"), "{}", flown.words);
        }
        if missed(&flown) <= missed(expected) + more {
            return;
        }
        late.push(missed(&flown));
    }
    panic!(
        "{late:?} of {deadlines} deadlines were missed, at most {more} more may be than over a directory"
    );
}

/// One flight with an empty cache, and an outage while the nodes load.
fn fly_through(flight: &Flight, front: &Front, down: &AtomicBool) -> Flown {
    let folder = tempfile::tempdir().unwrap();
    let flying = Flight {
        cache: flights::directory(folder.path()),
        ..flight.clone()
    }
    .start();
    let begin = Instant::now();
    let at_start = front.requests();
    while front.requests() - at_start < BEFORE_OUTAGE {
        assert!(begin.elapsed() < Duration::from_secs(60), "no requests");
        std::thread::sleep(Duration::from_millis(5));
    }
    down.store(true, Ordering::SeqCst);
    std::thread::sleep(outage());
    down.store(false, Ordering::SeqCst);
    flying.land()
}

/// The disturbances of one test. They must outlive the front's threads.
macro_rules! down {
    () => {{
        static DOWN: AtomicBool = AtomicBool::new(false);
        &DOWN
    }};
}

#[test]
fn nginx() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let www = folder.path().join("www");
    fs::create_dir(&www).unwrap();
    for name in ["elevation", "imagery"] {
        copy(&data::repositories().join(name), &www.join(name));
    }
    let Some(server) = servers::nginx(folder.path()) else {
        return;
    };
    let down = down!();
    let front = servers::front(server.address, down, || Action::Reset);
    let flight = Flight {
        repositories: ["/elevation", "/imagery"].map(|name| front.url(name)),
        ..flight(folder.path())
    };
    fly(&flight, &front, down, true);
}

#[test]
fn our_own_server() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let address = servers::free_address();
    let data = data::repositories().display().to_string();
    let line = format!("serve {data} --listen {address}");
    let _server: Running = command::start(line.split_whitespace());
    command::wait_until("the server listens", || {
        std::net::TcpStream::connect(address).is_ok()
    });
    let down = down!();
    let front = servers::front(address, down, || Action::Reset);
    let flight = Flight {
        repositories: ["/elevation", "/imagery"].map(|name| front.url(name)),
        ..flight(folder.path())
    };
    fly(&flight, &front, down, true);
}

#[test]
fn an_s3_server() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let Some(server) = servers::moto() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    servers::put(server.address, "/globe", b"");
    for name in ["elevation", "imagery"] {
        let root = data::repositories().join(name);
        servers::upload(server.address, &root, &root, &format!("/globe/{name}"));
    }
    let down = down!();
    // A server that is gone without a word, which takes the longest to notice.
    let front = servers::front(server.address, down, || Action::Silence);
    let keys = folder.path().join("keys.toml");
    let text = format!(
        "access_key_id = \"test\"\nsecret_access_key = \"hush\"\nregion = \"us-east-1\"\nendpoint_url = \"{}\"\n\
         allow_http = true\n",
        front.url("")
    );
    fs::write(&keys, text).unwrap();
    fs::set_permissions(&keys, fs::Permissions::from_mode(0o600)).unwrap();
    let flight = Flight {
        repositories: ["elevation", "imagery"].map(|name| format!("s3://globe/{name}")),
        environment: vec![(
            "TERRAWALL_CREDENTIALS".to_owned(),
            keys.display().to_string(),
        )],
        ..flight(folder.path())
    };
    fly(&flight, &front, down, outage() >= PATIENCE);
}

/// Copies a folder with all that is in it.
fn copy(from: &std::path::Path, to: &std::path::Path) {
    fs::create_dir(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &target);
        } else {
            fs::copy(&path, &target).unwrap();
        }
    }
}
