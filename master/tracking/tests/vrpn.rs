//! The VRPN client, byte by byte: what it sends, what it understands, what it refuses. Bytes are written out
//! here, not made by the crate.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::sync::Arc;

use proptest::prelude::*;
use tracking::RawPose;
use tracking::vrpn::{
    Client, ClientError, Malformed, Message, PING_AFTER_US, SILENT_AFTER_US, cookie,
};

/// As version 07.35 sends it.
const COOKIE: &[u8; 24] = b"vrpn: ver. 07.35  0\0\0\0\0\0";

/// Sender 3 is called "DTrack": 24 bytes of words, a body of 4 + 7 bytes, 5 bytes of zeroes.
const SENDER: &[u8] = &[
    0, 0, 0, 35, 0x65, 0x4c, 0x2a, 0x10, 0, 0, 0, 5, 0, 0, 0, 3, 0xff, 0xff, 0xff, 0xff, 0, 0, 0,
    0, //
    0, 0, 0, 7, b'D', b'T', b'r', b'a', b'c', b'k', 0, 0, 0, 0, 0, 0,
];

/// Type 9 is called "vrpn_Tracker Pos_Quat": a body of 4 + 22 bytes, 6 bytes of zeroes.
const TYPE: &[u8] = &[
    0, 0, 0, 50, 0x65, 0x4c, 0x2a, 0x10, 0, 0, 0, 5, 0, 0, 0, 9, 0xff, 0xff, 0xff, 0xfe, 0, 0, 0,
    1, //
    0, 0, 0, 22, b'v', b'r', b'p', b'n', b'_', b'T', b'r', b'a', b'c', b'k', b'e', b'r', b' ',
    b'P', b'o', b's', b'_', b'Q', b'u', b'a', b't', 0, 0, 0, 0, 0, 0, 0,
];

/// Sensor 2 at (1, −2, 0.5), turned by 90° about z: (0, 0, √½, √½). 1,699,490,320.000,250 s.
const POSE: &[u8] = &[
    0, 0, 0, 88, 0x65, 0x4c, 0x2a, 0x10, 0, 0, 0, 250, 0, 0, 0, 3, 0, 0, 0, 9, 0, 0, 0, 2, //
    0, 0, 0, 2, 0, 0, 0, 2, //
    0x3f, 0xf0, 0, 0, 0, 0, 0, 0, //
    0xc0, 0x00, 0, 0, 0, 0, 0, 0, //
    0x3f, 0xe0, 0, 0, 0, 0, 0, 0, //
    0, 0, 0, 0, 0, 0, 0, 0, //
    0, 0, 0, 0, 0, 0, 0, 0, //
    0x3f, 0xe6, 0xa0, 0x9e, 0x66, 0x7f, 0x3b, 0xcd, //
    0x3f, 0xe6, 0xa0, 0x9e, 0x66, 0x7f, 0x3b, 0xcd,
];

fn client() -> Client {
    Client::new(&[Arc::from("DTrack")], 0)
}

/// A message of the type with number `kind` from sender 3.
fn message(sender: i32, kind: i32, body: &[u8]) -> Vec<u8> {
    let mut bytes = (24 + body.len() as u32).to_be_bytes().to_vec();
    bytes.extend([0; 8]);
    bytes.extend(sender.to_be_bytes());
    bytes.extend(kind.to_be_bytes());
    bytes.extend([0; 4]);
    bytes.extend(body);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

fn named(kind: i32, number: i32, name: &str) -> Vec<u8> {
    let mut body = (name.len() as u32 + 1).to_be_bytes().to_vec();
    body.extend(name.as_bytes());
    body.push(0);
    message(number, kind, &body)
}

/// A client that knows sender 3 and types 9 (pose), 10 (button), 11 (buttons), 12 (analog), 13 (ping).
fn acquainted() -> Client {
    let mut client = client();
    let mut bytes = [COOKIE.as_slice(), SENDER, TYPE].concat();
    bytes.extend(named(-2, 10, "vrpn_Button Change"));
    bytes.extend(named(-2, 11, "vrpn_Button States"));
    bytes.extend(named(-2, 12, "vrpn_Analog Channel"));
    bytes.extend(named(-2, 13, "vrpn_Base ping_message"));
    let mut messages = Vec::new();
    client.receive(&bytes, 0, &mut messages).unwrap();
    assert_eq!(messages.len(), 1);
    let _greeting = client.take_outgoing();
    client
}

fn told(client: &mut Client, bytes: &[u8]) -> Vec<Message> {
    let mut messages = Vec::new();
    client.receive(bytes, 0, &mut messages).unwrap();
    messages
}

fn big_endian(numbers: &[f64]) -> Vec<u8> {
    numbers
        .iter()
        .flat_map(|number| number.to_be_bytes())
        .collect()
}

fn words(numbers: &[i32]) -> Vec<u8> {
    numbers
        .iter()
        .flat_map(|number| number.to_be_bytes())
        .collect()
}

#[test]
fn the_cookie_goes_first_then_names_then_a_ping() {
    let mut client = client();
    assert_eq!(&cookie(), COOKIE);
    assert_eq!(client.take_outgoing(), COOKIE);
    let mut messages = Vec::new();
    client.receive(COOKIE, 7_000_003, &mut messages).unwrap();
    assert_eq!(
        messages,
        [Message::Greeted {
            version: "vrpn: ver. 07.35".to_owned()
        }]
    );
    let sent = client.take_outgoing();
    let sender = [
        0, 0, 0, 35, 0, 0, 0, 7, 0, 0, 0, 3, 0, 0, 0, 0, 0xff, 0xff, 0xff, 0xff, 0, 0, 0,
        0, //
        0, 0, 0, 7, b'D', b'T', b'r', b'a', b'c', b'k', 0, 0, 0, 0, 0, 0,
    ];
    assert_eq!(&sent[..40], sender);
    let ping_type = [
        0, 0, 0, 51, 0, 0, 0, 7, 0, 0, 0, 3, 0, 0, 0, 0, 0xff, 0xff, 0xff, 0xfe, 0, 0, 0,
        1, //
        0, 0, 0, 23,
    ];
    assert_eq!(&sent[40..68], ping_type);
    assert_eq!(&sent[68..91], b"vrpn_Base ping_message\0");
    let ping = [
        0, 0, 0, 24, 0, 0, 0, 7, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 7,
    ];
    assert_eq!(&sent[sent.len() - 24..], ping);
    assert_eq!(sent.len() % 8, 0);
}

#[test]
fn a_pose_is_understood_however_the_bytes_are_cut() {
    let bytes = [COOKIE.as_slice(), SENDER, TYPE, POSE, POSE].concat();
    let expected = Message::Pose {
        sender: Arc::from("DTrack"),
        sensor: 2,
        stamp_us: Some(1_699_490_320_000_250),
        pose: RawPose {
            position: [1.0, -2.0, 0.5],
            orientation: [
                0.0,
                0.0,
                std::f64::consts::FRAC_1_SQRT_2,
                std::f64::consts::FRAC_1_SQRT_2,
            ],
        },
    };
    for length in [1, 7, 24, 25, 100, bytes.len()] {
        let mut client = client();
        let mut messages = Vec::new();
        for part in bytes.chunks(length) {
            client.receive(part, 0, &mut messages).unwrap();
        }
        assert!(matches!(messages[0], Message::Greeted { .. }));
        assert_eq!(
            messages[1..],
            [expected.clone(), expected.clone()],
            "{length}"
        );
    }
}

#[test]
fn buttons_and_analog_values_are_understood() {
    let mut client = acquainted();
    let sender: Arc<str> = Arc::from("DTrack");
    assert_eq!(
        told(&mut client, &message(3, 10, &words(&[4, 1]))),
        [Message::Button {
            sender: Arc::clone(&sender),
            button: 4,
            pressed: true
        }]
    );
    assert_eq!(
        told(&mut client, &message(3, 11, &words(&[3, 1, 0, 1]))),
        [Message::Buttons {
            sender: Arc::clone(&sender),
            pressed: vec![true, false, true]
        }]
    );
    assert_eq!(
        told(
            &mut client,
            &message(3, 12, &big_endian(&[2.0, -0.25, 1.0]))
        ),
        [Message::Analog {
            sender,
            values: vec![-0.25, 1.0]
        }]
    );
}

#[test]
fn what_is_not_known_is_left_alone() {
    let mut client = acquainted();
    // An unknown type, an unknown sender, the system's other messages, a type whose number is given anew.
    for bytes in [
        message(3, 77, &[1, 2, 3]),
        message(99, 9, &POSE[24..]),
        message(5_000, -3, b"10.0.0.1\0"),
        message(0, -4, &[0; 10]),
        message(0, -5, &[]),
        named(-2, 9, "vrpn_Text"),
        POSE.to_vec(),
    ] {
        assert_eq!(told(&mut client, &bytes), []);
    }
}

#[test]
fn malformed_messages_are_named_and_the_next_is_read() {
    let mut client = acquainted();
    for (bytes, malformed) in [
        (message(3, 9, &[0; 63]), Malformed::Pose(63)),
        (message(3, 9, &[0; 72]), Malformed::Pose(72)),
        (message(3, 9, &[]), Malformed::Pose(0)),
        (message(3, 10, &words(&[256, 1])), Malformed::Button(8)),
        (message(3, 10, &words(&[-1, 1])), Malformed::Button(8)),
        (message(3, 10, &words(&[1])), Malformed::Button(4)),
        (message(3, 11, &words(&[3, 1, 0])), Malformed::Buttons(12)),
        (message(3, 11, &words(&[i32::MAX])), Malformed::Buttons(4)),
        (message(3, 11, &words(&[-1])), Malformed::Buttons(4)),
        (
            message(3, 12, &big_endian(&[2.0, 1.0])),
            Malformed::Analog(16),
        ),
        (message(3, 12, &big_endian(&[1e18])), Malformed::Analog(8)),
        (
            message(3, 12, &big_endian(&[f64::NAN])),
            Malformed::Analog(8),
        ),
        (
            message(3, 12, &big_endian(&[1.0, f64::INFINITY])),
            Malformed::Analog(16),
        ),
        (message(-1, -1, &[0, 0, 0, 2, b'a', 0]), Malformed::Name(-1)),
        (
            message(2_000, -2, &[0, 0, 0, 2, b'a', 0]),
            Malformed::Name(2_000),
        ),
        (message(5, -2, &[0, 0, 0, 9, b'a', 0]), Malformed::Name(5)),
        (message(5, -2, &[0xff; 120]), Malformed::Name(5)),
        (message(5, -1, &[]), Malformed::Name(5)),
    ] {
        let both = [bytes, POSE.to_vec()].concat();
        let messages = told(&mut client, &both);
        assert_eq!(messages[0], Message::Malformed(malformed));
        assert!(matches!(messages[1], Message::Pose { sensor: 2, .. }));
    }
}

#[test]
fn what_is_no_vrpn_ends_the_connection() {
    let refused = |bytes: &[u8]| client().receive(bytes, 0, &mut Vec::new()).unwrap_err();
    let error = refused(b"HTTP/1.1 400 Bad Request");
    assert!(error.to_string().contains("HTTP/1.1"), "{error}");
    // Fewer bytes than a cookie are enough to tell.
    assert!(matches!(refused(b"SSH-2.0"), ClientError::Cookie(_)));
    assert!(matches!(
        refused(b"vrpn: ver. 06.01  0\0\0\0\0\0"),
        ClientError::Cookie(_)
    ));
    // Another minor version is fine.
    let mut messages = Vec::new();
    client()
        .receive(b"vrpn: ver. 07.28  0\0\0\0\0\0", 0, &mut messages)
        .unwrap();
    assert_eq!(messages.len(), 1);
    for length in [0_u32, 23, 24 + 64_001, u32::MAX] {
        let mut bytes = length.to_be_bytes().to_vec();
        bytes.extend([0; 20]);
        let error = acquainted()
            .receive(&bytes, 0, &mut Vec::new())
            .unwrap_err();
        assert_eq!(error, ClientError::Length(length));
    }
}

#[test]
fn a_silent_server_is_asked_and_given_up() {
    let mut client = client();
    assert_eq!(client.advance(2_999_999), Ok(()));
    assert_eq!(client.advance(3_000_000), Err(ClientError::NoCookie));
    let mut client = acquainted();
    assert_eq!(client.advance(PING_AFTER_US - 1), Ok(()));
    assert_eq!(client.take_outgoing(), []);
    for second in 1..10 {
        assert_eq!(client.advance(second * PING_AFTER_US), Ok(()));
        assert_eq!(client.advance(second * PING_AFTER_US + 500_000), Ok(()));
        assert_eq!(client.take_outgoing().len(), 24);
    }
    assert_eq!(client.advance(SILENT_AFTER_US), Err(ClientError::Silent));
    client
        .receive(POSE, SILENT_AFTER_US, &mut Vec::new())
        .unwrap();
    assert_eq!(client.advance(SILENT_AFTER_US), Ok(()));
}

#[test]
fn pings_are_answered_once_until_the_answer_is_sent() {
    let mut client = acquainted();
    assert_eq!(told(&mut client, &message(3, 13, &[]).repeat(1_000)), []);
    let pong = client.take_outgoing();
    assert_eq!(pong.len(), 24);
    assert_eq!(pong[12..20], [0, 0, 0, 0, 0, 0, 0, 1]);
}

proptest! {
    #[test]
    fn no_bytes_stop_it(bytes in prop::collection::vec(any::<u8>(), 0..600), cut in 1_usize..80) {
        for mut client in [client(), acquainted()] {
            let mut messages = Vec::new();
            for part in bytes.chunks(cut) {
                if client.receive(part, 0, &mut messages).is_err() {
                    break;
                }
            }
            prop_assert!(messages.len() <= 1 + bytes.len() / 24);
        }
    }

    #[test]
    fn no_body_of_a_known_type_stops_it(
        kind in prop::sample::select(vec![-5_i32, -4, -3, -2, -1, 9, 10, 11, 12, 13]),
        sender in prop::sample::select(vec![-1_i32, 0, 3, 1_999, i32::MAX, i32::MIN]),
        body in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        let mut client = acquainted();
        let messages = told(&mut client, &message(sender, kind, &body));
        prop_assert!(messages.len() <= 1);
        let finite = messages.iter().all(|message| match message {
            Message::Analog { values, .. } => values.iter().all(|value| value.is_finite()),
            _ => true,
        });
        prop_assert!(finite);
    }
}
