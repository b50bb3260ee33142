//! Messages about the error of pictures: golden bytes laid out by hand, and the numbers that are refused.
//! In: messages. Out: failed tests. Messages of other kinds are the files beside this one.

use protocol::codec::{
    DecodeError, decode_to_master, decode_to_node, encode_to_master, encode_to_node,
};
use protocol::message::{ErrorMeasured, MAX_REASON_BYTES, Presented, ToMaster, ToNode};

const MEASURED: ErrorMeasured = ErrorMeasured {
    max_px: 0.75,
    samples: 66_049,
    uncovered: 2,
    tau_px: 2.0,
};

#[test]
fn messages_about_errors_have_these_bytes() {
    assert_eq!(encode_to_node(&ToNode::MeasureError).unwrap(), [5, 8]);
    assert_eq!(decode_to_node(&[5, 8]).unwrap(), ToNode::MeasureError);

    // 0.75 = 1.5 · 2^−1 and 2 = 1 · 2^1, as IEEE 754 doubles; 66,049 = 0x010201: all little endian.
    let golden = [
        5, 14, 0, 0, 0, 0, 0, 0, 0xE8, 0x3F, 252, 1, 2, 1, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0x40,
    ];
    let measured = ToMaster::ErrorMeasured(MEASURED);
    assert_eq!(encode_to_master(&measured).unwrap(), golden);
    assert_eq!(decode_to_master(&golden).unwrap(), measured);

    let cannot = ToMaster::cannot_measure("né");
    let golden = [5, 15, 3, b'n', 0xC3, 0xA9];
    assert_eq!(encode_to_master(&cannot).unwrap(), golden);
    assert_eq!(decode_to_master(&golden).unwrap(), cannot);
}

#[test]
fn errors_that_are_no_distances_are_refused() {
    let presented = |achieved_tau_px| {
        ToMaster::Presented(Presented {
            epoch: 1,
            frame: 2,
            presented_us: 3,
            clock_error_us: 4,
            view_latency_us: 5,
            view_to_present_us: 6,
            swap_slack_us: 7,
            draw_us: 8,
            redrawn: true,
            triangles: 9,
            converged: true,
            refined_leaves: 10,
            achieved_tau_px,
            achieved_tile_px: achieved_tau_px,
        })
    };
    for good in [0.0, 0.05, f64::MAX] {
        let bytes = encode_to_master(&presented(good)).unwrap();
        assert_eq!(decode_to_master(&bytes).unwrap(), presented(good));
    }
    for bad in [f64::NAN, f64::INFINITY, -0.5] {
        for message in [
            ToMaster::ErrorMeasured(ErrorMeasured {
                max_px: bad,
                ..MEASURED
            }),
            ToMaster::ErrorMeasured(ErrorMeasured {
                tau_px: bad,
                ..MEASURED
            }),
            presented(bad),
        ] {
            let bytes = encode_to_master(&message).unwrap();
            assert!(
                matches!(decode_to_master(&bytes), Err(DecodeError::Senseless(_))),
                "{message:?}"
            );
        }
    }
    let long = ToMaster::CannotMeasure {
        reason: "x".repeat(MAX_REASON_BYTES + 1),
    };
    let bytes = encode_to_master(&long).unwrap();
    assert!(matches!(
        decode_to_master(&bytes),
        Err(DecodeError::Senseless(_))
    ));
    let cut = ToMaster::cannot_measure(&"é".repeat(MAX_REASON_BYTES));
    let bytes = encode_to_master(&cut).unwrap();
    assert_eq!(decode_to_master(&bytes).unwrap(), cut);
}
