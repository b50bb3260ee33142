//! Messages about changes of the scene: golden bytes laid out by hand, and the caps of what they carry.
//! In: messages. Out: failed tests. Messages of other kinds are the file above's.

use protocol::codec::{DecodeError, MAX_CONTROL_BYTES, decode_to_master, encode_to_master};
use protocol::message::{MAX_REASON_BYTES, MoveLens, ToMaster};

#[test]
fn messages_about_changes_have_these_bytes() {
    let prepared = ToMaster::Prepared { revision: 300 };
    let golden = [5, 11, 251, 44, 1];
    assert_eq!(encode_to_master(&prepared).unwrap(), golden);
    assert_eq!(decode_to_master(&golden).unwrap(), prepared);

    let cannot = ToMaster::CannotPrepare {
        revision: 5,
        reason: "né".into(),
    };
    let golden = [5, 12, 5, 3, b'n', 0xC3, 0xA9];
    assert_eq!(encode_to_master(&cannot).unwrap(), golden);
    assert_eq!(decode_to_master(&golden).unwrap(), cannot);

    let moved = ToMaster::MoveLens(MoveLens {
        latitude_deg: 46.5,
        longitude_deg: -0.25,
        grab: true,
    });
    // 46.5 = 1.453125 · 2^5 and −0.25 = −1 · 2^−2, as IEEE 754 doubles, little endian.
    let golden = [
        5, 13, 0, 0, 0, 0, 0, 0x40, 0x47, 0x40, 0, 0, 0, 0, 0, 0, 0xD0, 0xBF, 1,
    ];
    assert_eq!(encode_to_master(&moved).unwrap(), golden);
    assert_eq!(decode_to_master(&golden).unwrap(), moved);
}

#[test]
fn reasons_are_short_and_lenses_stay_on_the_planet() {
    let longest = ToMaster::CannotPrepare {
        revision: u64::MAX,
        reason: "x".repeat(MAX_REASON_BYTES),
    };
    let bytes = encode_to_master(&longest).unwrap();
    assert_eq!(decode_to_master(&bytes).unwrap(), longest);
    let too_long = ToMaster::CannotPrepare {
        revision: u64::MAX,
        reason: "x".repeat(MAX_REASON_BYTES + 1),
    };
    let error = decode_to_master(&encode_to_master(&too_long).unwrap()).unwrap_err();
    assert!(matches!(error, DecodeError::Senseless(_)), "{error}");
    assert!(error.to_string().contains("2048"), "{error}");
    let huge = ToMaster::CannotPrepare {
        revision: 1,
        reason: "x".repeat(MAX_CONTROL_BYTES),
    };
    assert!(encode_to_master(&huge).is_err());

    for (latitude_deg, longitude_deg) in [
        (90.1, 0.0),
        (-90.1, 0.0),
        (0.0, 180.1),
        (0.0, -180.1),
        (f64::NAN, 0.0),
        (0.0, f64::NAN),
        (f64::INFINITY, 0.0),
        (0.0, f64::NEG_INFINITY),
    ] {
        let moved = ToMaster::MoveLens(MoveLens {
            latitude_deg,
            longitude_deg,
            grab: false,
        });
        let bytes = encode_to_master(&moved).unwrap();
        assert!(
            matches!(decode_to_master(&bytes), Err(DecodeError::Senseless(_))),
            "{moved:?}"
        );
    }
}

#[test]
fn a_node_can_always_say_why_it_cannot_prepare() {
    // Characters of one to four bytes, and lengths around the cap: the reason is cut between characters.
    for character in ["x", "é", "€", "𝄞"] {
        for length in MAX_REASON_BYTES - 8..MAX_REASON_BYTES + 8 {
            let mut reason = "y".repeat(length % 4);
            reason.push_str(&character.repeat(length / character.len()));
            let message = ToMaster::cannot_prepare(9, &reason);
            let bytes = encode_to_master(&message).unwrap();
            assert_eq!(decode_to_master(&bytes).unwrap(), message);
            let ToMaster::CannotPrepare {
                revision: 9,
                reason: said,
            } = message
            else {
                panic!("{message:?}");
            };
            if reason.len() <= MAX_REASON_BYTES {
                assert_eq!(said, reason);
            } else {
                let kept = said.strip_suffix('…').unwrap();
                assert!(reason.starts_with(kept), "{kept}");
                // No more is cut than has to be: another character would not fit.
                assert!(said.len() + character.len() > MAX_REASON_BYTES);
            }
        }
    }
    let short = ToMaster::cannot_prepare(1, "");
    assert!(matches!(short, ToMaster::CannotPrepare { reason, .. } if reason.is_empty()));
}
