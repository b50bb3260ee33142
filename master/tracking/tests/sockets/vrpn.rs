//! VRPN servers that send, stop, jump, hang up, call back, and are none.

use super::*;

#[test]
fn poses_buttons_and_analog_values_come_from_a_vrpn_server() {
    let runtime = runtime();
    let server = VrpnServer::start("127.0.0.1:0", "DTrack").unwrap();
    let address = server.address();
    let trackers = [
        vrpn("glasses", address, 0),
        vrpn("wand", address, 1),
        vrpn("nobody", address, 2),
    ];
    let tracking = Tracking::start(&trackers, now_us, runtime.handle()).unwrap();
    let waiting = tracking.heads_at(now_us());
    assert_eq!(waiting.len(), 3);
    assert!(
        waiting
            .iter()
            .all(|head| head.pose.is_none() && head.state == HeadState::Waiting)
    );
    until(
        &tracking,
        "both are tracked",
        || {
            server.send_pose(0, [0.1, 1.7, 0.2], AT_REST);
            server.send_pose(1, [0.4, 1.0, 0.3], AT_REST);
            server.send_buttons(&[false, true, false]);
            server.send_button(4, true);
            server.send_analog(&[-0.5, 0.25]);
        },
        |snapshot| {
            state(snapshot, "glasses") == HeadState::Tracked
                && state(snapshot, "wand") == HeadState::Tracked
                && !snapshot.devices.is_empty()
        },
    );
    let name = format!("DTrack@{address}");
    until(
        &tracking,
        "buttons",
        || {},
        |snapshot| {
            snapshot.devices.get(name.as_str()).is_some_and(|device| {
                device.buttons == [false, true, false, false, true]
                    && device.analogs == [-0.5, 0.25]
            })
        },
    );
    // One connection for all three.
    assert_eq!(server.clients(), 1);
    let heads = tracking.heads_at(now_us());
    assert_eq!(heads[0].pose.unwrap().position_m, [0.1, 1.7, 0.2]);
    assert_eq!(heads[1].pose.unwrap().position_m, [0.4, 1.0, 0.3]);
    assert_eq!((heads[2].state, heads[2].pose), (HeadState::Waiting, None));
    let snapshot = tracking.snapshot();
    assert!(told(&snapshot, "connected by TCP"), "{:?}", snapshot.events);
    assert!(told(&snapshot, "glasses: is tracked"));
    until(&tracking, "a ping", || {}, |_| server.pings() > 0);
}

#[test]
fn an_old_vrpn_server_calls_back() {
    let runtime = runtime();
    let server = VrpnServer::start_udp_only("127.0.0.1:0", "DTrack").unwrap();
    let trackers = [vrpn("glasses", server.address(), 0)];
    let tracking = Tracking::start(&trackers, now_us, runtime.handle()).unwrap();
    until(
        &tracking,
        "it is tracked",
        || server.send_pose(0, [0.1, 1.7, 0.2], AT_REST),
        |snapshot| state(snapshot, "glasses") == HeadState::Tracked,
    );
    assert!(told(
        &tracking.snapshot(),
        "connected by a call back from 127.0.0.1"
    ));
}

#[test]
fn a_vrpn_server_that_stops_jumps_and_sends_rubbish_loses_no_pose() {
    let runtime = runtime();
    let server = VrpnServer::start("127.0.0.1:0", "DTrack").unwrap();
    let trackers = [vrpn("glasses", server.address(), 0)];
    let tracking = Tracking::start(&trackers, now_us, runtime.handle()).unwrap();
    let at = |x_m: f64| server.send_pose(0, [x_m, 1.7, 0.0], AT_REST);
    let is_tracked = |snapshot: &Snapshot| state(snapshot, "glasses") == HeadState::Tracked;
    until(&tracking, "it is tracked", || at(0.0), is_tracked);
    // It jumps, and stays there.
    until(
        &tracking,
        "the jump is refused",
        || at(3.0),
        |snapshot| {
            happened(snapshot, |what| {
                matches!(what, What::Head(HeadEvent::JumpRefused { .. }))
            })
        },
    );
    assert_eq!(x_m(&tracking.snapshot(), "glasses"), 0.0);
    until(
        &tracking,
        "the jump is accepted",
        || at(3.0),
        |snapshot| {
            happened(snapshot, |what| {
                matches!(what, What::Head(HeadEvent::JumpAccepted { .. }))
            })
        },
    );
    assert_eq!(x_m(&tracking.snapshot(), "glasses"), 3.0);
    // It sends numbers that are none, and bodies that are no poses.
    until(
        &tracking,
        "rubbish is named",
        || {
            server.send_pose(0, [f64::NAN, 1.7, 0.0], AT_REST);
            server.send_pose(0, [3.0, 1.7, 0.0], [0.0; 4]);
            server.send_broken_pose(&[1, 2, 3]);
        },
        |snapshot| told(snapshot, "not finite") && told(snapshot, "a pose of 3 bytes"),
    );
    assert_eq!(x_m(&tracking.snapshot(), "glasses"), 3.0);
    // It stops.
    let stopped_us = now_us();
    until(
        &tracking,
        "it is lost",
        || {},
        |snapshot| matches!(state(snapshot, "glasses"), HeadState::Lost { since_us } if since_us <= stopped_us),
    );
    assert!(now_us() - stopped_us < 2 * LOST_AFTER_US);
    let lost = tracking.heads_at(now_us() + 10_000_000);
    assert_eq!(lost[0].pose.unwrap().position_m, [3.0, 1.7, 0.0]);
    until(&tracking, "it is found again", || at(3.1), is_tracked);
    // It sends bytes that are no messages: the connection ends, and is made again.
    server.send_raw(&[0xff; 64]);
    until(
        &tracking,
        "it says why and comes back",
        || at(3.1),
        |snapshot| {
            told(snapshot, "disconnected: a message of 4294967295 bytes") && server.clients() == 1
        },
    );
    let measured_us = |snapshot: &Snapshot| {
        snapshot
            .head("glasses")
            .unwrap()
            .motion
            .unwrap()
            .measured_us
    };
    let before_us = now_us();
    until(
        &tracking,
        "it is measured again",
        || at(3.1),
        |snapshot| measured_us(snapshot) > before_us,
    );
    // It hangs up.
    server.drop_clients();
    let before_us = now_us();
    until(
        &tracking,
        "it is measured again",
        || at(3.1),
        |snapshot| measured_us(snapshot) > before_us,
    );
    assert!((x_m(&tracking.snapshot(), "glasses") - 3.1).abs() < 0.11);
}

#[test]
fn a_server_that_is_not_there_yet_is_found_when_it_comes() {
    let runtime = runtime();
    let address = free_port();
    let tracking =
        Tracking::start(&[vrpn("glasses", address, 0)], now_us, runtime.handle()).unwrap();
    until(
        &tracking,
        "it says so",
        || {},
        |snapshot| told(snapshot, "cannot be reached: no TCP connection"),
    );
    let server = VrpnServer::start(&address.to_string(), "DTrack").unwrap();
    until(
        &tracking,
        "it is tracked",
        || server.send_pose(0, [0.0; 3], AT_REST),
        |snapshot| state(snapshot, "glasses") == HeadState::Tracked,
    );
}

#[test]
fn a_peer_that_is_no_vrpn_server_is_named() {
    let runtime = runtime();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let peer = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut cookie = [0; 24];
        stream.read_exact(&mut cookie).unwrap();
        stream
            .write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n")
            .unwrap();
        cookie
    });
    let tracking =
        Tracking::start(&[vrpn("glasses", address, 0)], now_us, runtime.handle()).unwrap();
    until(
        &tracking,
        "it is named",
        || {},
        |snapshot| {
            told(
                snapshot,
                "no VRPN server of version 07: it begins with \"HTTP/1.1",
            )
        },
    );
    assert_eq!(&peer.join().unwrap(), b"vrpn: ver. 07.35  0\0\0\0\0\0");
}
