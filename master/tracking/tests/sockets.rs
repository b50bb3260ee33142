//! Trackers over real sockets: they send, stop, jump, hang up, send rubbish; the last good pose is kept, the report
//! names what happened, and everything comes back by itself.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

#[path = "sockets/dtrack.rs"]
mod dtrack_packets;
#[path = "sockets/vrpn.rs"]
mod vrpn_servers;

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use tokio::runtime::Runtime;
use tracking::sim::{SimBody, SimFlystick, VrpnServer, dtrack_packet};
use tracking::{
    Axes, Body, ConfigError, HeadEvent, HeadState, LOST_AFTER_US, Smoothing, Snapshot, Source,
    TrackerConfig, Tracking, What,
};

const AT_REST: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
const PACE: Duration = Duration::from_millis(5);
/// Longest that anything may take.
const PATIENCE: Duration = Duration::from_secs(6);

static START: LazyLock<Instant> = LazyLock::new(Instant::now);

fn now_us() -> i64 {
    i64::try_from(START.elapsed().as_micros()).unwrap()
}

fn runtime() -> Runtime {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .unwrap()
}

fn tracker(name: &str, source: Source, body: u32, unit_m: f64) -> TrackerConfig {
    TrackerConfig {
        name: name.to_owned(),
        source,
        body,
        to_room: Axes::default(),
        unit_m,
        to_head: Body::default(),
        smoothing: Smoothing::default(),
        latency_ms: 0.0,
    }
}

fn vrpn(name: &str, address: SocketAddr, body: u32) -> TrackerConfig {
    let source = Source::Vrpn {
        device: "DTrack".to_owned(),
        host: address.ip().to_string(),
        port: address.port(),
    };
    tracker(name, source, body, 1.0)
}

fn dtrack(name: &str, address: SocketAddr, body: u32) -> TrackerConfig {
    let source = Source::Dtrack {
        listen: address.to_string(),
    };
    tracker(name, source, body, 0.001)
}

/// A UDP port that is free at the moment.
fn free_port() -> SocketAddr {
    UdpSocket::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
}

/// Does `act` until the snapshot is as wanted.
#[track_caller]
fn until(
    tracking: &Tracking,
    what: &str,
    mut act: impl FnMut(),
    wanted: impl Fn(&Snapshot) -> bool,
) {
    let begun = Instant::now();
    loop {
        let snapshot = tracking.snapshot();
        if wanted(&snapshot) {
            return;
        }
        assert!(begun.elapsed() < PATIENCE, "{what}: {snapshot:#?}");
        act();
        std::thread::sleep(PACE);
    }
}

fn state(snapshot: &Snapshot, tracker: &str) -> HeadState {
    snapshot.head(tracker).unwrap().state
}

fn x_m(snapshot: &Snapshot, tracker: &str) -> f64 {
    let motion = snapshot.head(tracker).unwrap().motion.unwrap();
    motion.position_m.x
}

fn happened(snapshot: &Snapshot, wanted: impl Fn(&What) -> bool) -> bool {
    snapshot.events.iter().any(|event| wanted(&event.what))
}

fn told(snapshot: &Snapshot, text: &str) -> bool {
    snapshot
        .events
        .iter()
        .any(|event| event.to_string().contains(text))
}

#[test]
fn a_flood_of_one_source_keeps_the_other_going() {
    let runtime = runtime();
    let flooded = free_port();
    let server = VrpnServer::start("127.0.0.1:0", "DTrack").unwrap();
    let trackers = [
        dtrack("flooded", flooded, 0),
        vrpn("glasses", server.address(), 0),
    ];
    let tracking = Tracking::start(&trackers, now_us, runtime.handle()).unwrap();
    let end = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            while !end.load(std::sync::atomic::Ordering::Relaxed) {
                let _ = socket.send_to(&[b'x'; 1_400], flooded);
            }
        });
        let measurements = |snapshot: &Snapshot| snapshot.head("glasses").unwrap().measurements;
        until(
            &tracking,
            "the other is measured",
            || server.send_pose(0, [0.0, 1.7, 0.0], AT_REST),
            |snapshot| measurements(snapshot) >= 40 && told(snapshot, "no frame counter"),
        );
        // A reader waits for nobody.
        let begun = Instant::now();
        for _ in 0..1_000 {
            assert_eq!(tracking.heads_at(now_us()).len(), 2);
        }
        let took = begun.elapsed();
        end.store(true, std::sync::atomic::Ordering::Relaxed);
        assert!(took < Duration::from_millis(500), "{took:?}");
    });
    // A flood leaves few events, with a count.
    let snapshot = tracking.snapshot();
    let refused = snapshot
        .events
        .iter()
        .filter(|event| matches!(event.what, What::Refused { .. }));
    assert!(refused.count() <= 10);
}

#[test]
fn wrong_configurations_are_refused() {
    let runtime = runtime();
    let address = free_port();
    let refuse = |trackers: &[TrackerConfig]| {
        Tracking::start(trackers, now_us, runtime.handle()).unwrap_err()
    };
    let good = dtrack("glasses", address, 0);
    assert!(matches!(
        refuse(&[good.clone(), good.clone()]),
        ConfigError::Duplicate(_)
    ));
    let mut bad = good.clone();
    bad.source = Source::Dtrack {
        listen: "here".to_owned(),
    };
    assert!(matches!(refuse(&[bad]), ConfigError::Listen { .. }));
    let mut bad = good.clone();
    bad.source = Source::Vrpn {
        device: String::new(),
        host: "tracker".to_owned(),
        port: 3883,
    };
    assert!(matches!(refuse(&[bad]), ConfigError::Device { .. }));
    let mut bad = good.clone();
    bad.to_room.x = [-1.0, 0.0, 0.0];
    let error = refuse(&[bad]);
    assert!(
        error
            .to_string()
            .starts_with("tracker `glasses`: the axes of `to_room` are left-handed")
    );
    for (cutoff_hz, coefficient, latency_ms) in
        [(0.0, 0.5, 0.0), (1.0, -0.5, 0.0), (1.0, 0.5, f64::NAN)]
    {
        let mut bad = good.clone();
        bad.smoothing.minimum_cutoff_hz = cutoff_hz;
        bad.smoothing.speed_coefficient = coefficient;
        bad.latency_ms = latency_ms;
        assert!(matches!(
            refuse(&[bad]),
            ConfigError::Smoothing { .. } | ConfigError::Latency { .. }
        ));
    }
}
