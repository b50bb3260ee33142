//! DTrack's packets over UDP: good ones, rubbish, and a port that is taken.

use super::*;

#[test]
fn dtrack_packets_move_heads_and_rubbish_between_them_does_not() {
    let runtime = runtime();
    let address = free_port();
    let trackers = [dtrack("glasses", address, 0), dtrack("second", address, 1)];
    let tracking = Tracking::start(&trackers, now_us, runtime.handle()).unwrap();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let send = |bytes: &[u8]| {
        // Before the port is bound the packet is refused.
        let _ = socket.send_to(bytes, address);
    };
    let frame = |x_mm: f64| {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let body = SimBody {
            id: 0,
            position_mm: [x_mm, 1_700.0, 250.0],
            orientation: [0.0, half, 0.0, half],
        };
        let flystick = SimFlystick {
            body: None,
            id: 0,
            buttons: vec![false, true, false, false, false, false],
            controllers: vec![0.5, -1.0],
        };
        dtrack_packet(1, now_us() as f64 * 1e-6, &[body], &[flystick])
    };
    let is_tracked = |snapshot: &Snapshot| state(snapshot, "glasses") == HeadState::Tracked;
    until(
        &tracking,
        "it is tracked",
        || send(frame(500.0).as_bytes()),
        is_tracked,
    );
    let pose = tracking.heads_at(now_us())[0].pose.unwrap();
    assert_eq!(pose.position_m, [0.5, 1.7, 0.25]);
    assert!((pose.back[0] - 1.0).abs() < 1e-6, "{pose:?}");
    let device = tracking.snapshot().devices[format!("flystick0@{address}").as_str()].clone();
    assert_eq!(device.buttons, [false, true, false, false, false, false]);
    assert_eq!(device.analogs, [0.5, -1.0]);
    // The same port, another body: nothing yet.
    assert_eq!(state(&tracking.snapshot(), "second"), HeadState::Waiting);
    until(
        &tracking,
        "rubbish is named",
        || {
            send(b"not a packet");
            send(&[0xff; 9_000]);
            send(b"fr 1\r\n6d 1 [0 1.0][0 0 0 0 0 0][1 0 0 0 1 0 0 0 -1]\r\n");
        },
        |snapshot| told(snapshot, "this is no DTrack packet"),
    );
    assert_eq!(x_m(&tracking.snapshot(), "glasses"), 0.5);
    // Its body is hidden, while packets go on.
    until(
        &tracking,
        "it is lost",
        || send(b"fr 2\r\n6d 0\r\n"),
        |snapshot| matches!(state(snapshot, "glasses"), HeadState::Lost { .. }),
    );
    assert_eq!(
        tracking.heads_at(now_us())[0].pose.unwrap().position_m,
        [0.5, 1.7, 0.25]
    );
    until(
        &tracking,
        "it is found",
        || send(frame(600.0).as_bytes()),
        is_tracked,
    );
    assert_eq!(x_m(&tracking.snapshot(), "glasses"), 0.6);
}

#[test]
fn a_port_that_is_taken_is_named_and_taken_when_free() {
    let runtime = runtime();
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap();
    let tracking =
        Tracking::start(&[dtrack("glasses", address, 0)], now_us, runtime.handle()).unwrap();
    until(
        &tracking,
        "it is named",
        || {},
        |snapshot| told(snapshot, "cannot listen on 127.0.0.1"),
    );
    drop(taken);
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    until(
        &tracking,
        "it is tracked",
        || {
            let _ = socket.send_to(
                b"fr 1\n6d 1 [0 1.0][0 0 0 0 0 0][1 0 0 0 1 0 0 0 1]\n",
                address,
            );
        },
        |snapshot| state(snapshot, "glasses") == HeadState::Tracked,
    );
}
