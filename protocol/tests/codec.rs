//! The bytes of messages: golden bytes laid out by hand, sizes, and peers that send anything.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

#[path = "codec/changes.rs"]
mod changes;
#[path = "codec/errors.rs"]
mod errors;

use proptest::prelude::*;
use protocol::capture::CaptureRows;
use protocol::codec::{
    DecodeError, MAX_CONTROL_BYTES, MAX_LARGE_BYTES, MAX_VIEW_BYTES, decode_to_master,
    decode_to_node, decode_view, encode_to_master, encode_to_node, encode_view,
};
use protocol::message::{
    CacheLevel, Drawable, ErrorMeasured, HeldKeys, Hello, MoveLens, PROTOCOL_VERSION, Presented,
    Steer, Swap, TileCounters, TileNews, ToMaster, ToNode, View,
};
use protocol::wall::{Head, Viewers};
use protocol::{Pose, Scene, Wall};

const WALL: &str = include_str!("../../configs/walls/powerwall-3x2-bezels.toml");
const SCENE: &str = include_str!("../../configs/scenes/demo.toml");

fn pose() -> Pose {
    Pose {
        position_m: [6_400_000.5, -2.0, 0.25],
        right: [0.0, 1.0, 0.0],
        up: [0.0, 0.0, 1.0],
        back: [1.0, 0.0, 0.0],
    }
}

fn view(heads: usize) -> View {
    View {
        epoch: 3,
        frame: 1000,
        scene_revision: 1,
        wall_revision: 2,
        sent_us: -5,
        pose: pose(),
        viewers: Viewers {
            heads: vec![Head::upright([0.0, 1.7, 3.0]); heads],
            pixels_per_radian: 1500.0,
        },
        settle: true,
        previous_swap: Some(Swap {
            epoch: 2,
            frame: 999,
            present_at_us: 70_000,
        }),
    }
}

#[test]
fn a_view_has_these_bytes() {
    // Laid out by hand: version; unsigned integers below 251 as one byte, else 251 and 16 bits, 252 and
    // 32 bits or 253 and 64 bits; signed ones as 2n or −2n−1; floats as 64 bits, those of a direction as 32; little endian.
    let mut golden = vec![5, 3, 251];
    golden.extend(1000_u16.to_le_bytes());
    golden.extend([1, 2, 9]);
    let components = [
        6_400_000.5,
        -2.0,
        0.25,
        0.0,
        1.0,
        0.0,
        0.0,
        0.0,
        1.0,
        1.0,
        0.0,
        0.0_f64,
    ];
    golden.extend(
        components
            .iter()
            .flat_map(|component| component.to_le_bytes()),
    );
    golden.push(1);
    golden.extend(
        [0.0, 1.7, 3.0_f64]
            .iter()
            .flat_map(|component| component.to_le_bytes()),
    );
    let right = [1.0, 0.0, 0.0_f32];
    golden.extend(right.iter().flat_map(|component| component.to_le_bytes()));
    golden.extend(1500.0_f64.to_le_bytes());
    golden.extend([1, 1, 2, 251]);
    golden.extend(999_u16.to_le_bytes());
    golden.push(252);
    golden.extend(140_000_u32.to_le_bytes());
    assert_eq!(encode_view(&view(1)).unwrap(), golden);
    assert_eq!(decode_view(&golden).unwrap(), view(1));
}

#[test]
fn control_messages_have_these_bytes() {
    let swap = ToNode::Swap(Swap {
        epoch: 1,
        frame: 2,
        present_at_us: 3,
    });
    assert_eq!(encode_to_node(&swap).unwrap(), [5, 4, 1, 2, 6]);
    let ready = ToMaster::Ready {
        epoch: 1,
        frame: 300,
        converged: true,
        pending_tiles: 7,
    };
    assert_eq!(
        encode_to_master(&ready).unwrap(),
        [5, 2, 1, 251, 44, 1, 1, 7]
    );
    let ping = ToMaster::ClockPing {
        sequence: 9,
        node_sent_us: -1,
    };
    assert_eq!(encode_to_master(&ping).unwrap(), [5, 1, 9, 1]);
}

#[test]
fn the_largest_view_fits_the_smallest_datagram() {
    let mut largest = view(16);
    largest.epoch = u32::MAX;
    largest.frame = u64::MAX;
    largest.scene_revision = u64::MAX;
    largest.wall_revision = u32::MAX;
    largest.sent_us = i64::MIN;
    largest.previous_swap = Some(Swap {
        epoch: u32::MAX,
        frame: u64::MAX,
        present_at_us: i64::MIN,
    });
    let bytes = encode_view(&largest).unwrap();
    // 1 version, 5 epoch, 3·9 + 5 integers, 96 pose, 1 + 16·36 heads, 8 density, 1 settle, 1 + 5 + 9 + 9 swap.
    assert_eq!(bytes.len(), 1 + 5 + 27 + 5 + 96 + 577 + 8 + 1 + 24);
    assert!(bytes.len() <= MAX_VIEW_BYTES && MAX_VIEW_BYTES == 1100);
    assert_eq!(decode_view(&bytes).unwrap(), largest);
    assert!(matches!(
        decode_view(&encode_view(&view(17)).unwrap()),
        Err(DecodeError::Senseless(_))
    ));
}

#[test]
fn views_that_make_no_sense_are_refused() {
    for spoil in [
        |view: &mut View| view.pose.position_m[1] = f64::NAN,
        |view: &mut View| view.pose.right = [0.0; 3],
        |view: &mut View| view.pose.up = [0.0, 1.0, 0.0],
        |view: &mut View| view.pose.back = [-1.0, 0.0, 0.0],
        |view: &mut View| view.viewers.heads[0].position_m[2] = f64::INFINITY,
        |view: &mut View| view.viewers.heads[1].right = [0.0; 3],
        |view: &mut View| view.viewers.pixels_per_radian = 0.0,
        |view: &mut View| view.viewers.pixels_per_radian = f64::NAN,
    ] {
        let mut view = view(2);
        spoil(&mut view);
        let bytes = encode_view(&view).unwrap();
        assert!(matches!(
            decode_view(&bytes),
            Err(DecodeError::Senseless(_))
        ));
    }
}

fn messages_to_node() -> Vec<ToNode> {
    let wall = Wall::parse(WALL, "wall").unwrap();
    let scene = Scene::parse(SCENE, "scene").unwrap();
    vec![
        ToNode::Challenge {
            protocol_version: PROTOCOL_VERSION,
            program_version: "0.1".into(),
            session: 5,
        },
        ToNode::Welcome {
            host: 2,
            wall: Box::new(wall),
        },
        ToNode::Refused {
            reason: "no such host".into(),
            retry_after_ms: Some(500),
        },
        ToNode::Scene {
            revision: 1,
            scene: Box::new(scene),
        },
        ToNode::Swap(Swap {
            epoch: 1,
            frame: 2,
            present_at_us: 3,
        }),
        ToNode::ClockPong {
            sequence: 1,
            node_sent_us: 2,
            master_received_us: 3,
            master_sent_us: 4,
        },
        ToNode::Capture { id: 1 },
        ToNode::Shutdown,
        ToNode::MeasureError,
    ]
}

fn messages_to_master() -> Vec<ToMaster> {
    vec![
        ToMaster::Hello(Hello {
            protocol_version: PROTOCOL_VERSION,
            program_version: "0.1".into(),
            session: 5,
            node: "left".into(),
            adapter: "llvmpipe".into(),
            process_id: 77,
        }),
        ToMaster::ClockPing {
            sequence: 1,
            node_sent_us: 2,
        },
        ToMaster::Ready {
            epoch: 1,
            frame: 2,
            converged: false,
            pending_tiles: 3,
        },
        ToMaster::Presented(Presented {
            epoch: 1,
            frame: 2,
            presented_us: 3,
            clock_error_us: 4,
            view_latency_us: -5,
            view_to_present_us: 6,
            swap_slack_us: -7,
            draw_us: 8,
            redrawn: true,
            triangles: 9,
            converged: true,
            refined_leaves: 10,
            achieved_tau_px: 0.5,
            achieved_tile_px: 257.0,
        }),
        ToMaster::CaptureRows(CaptureRows {
            id: 1,
            output: 0,
            first_row: 3,
            rgba: vec![9; 400],
        }),
        ToMaster::CaptureDone { id: 1, outputs: 2 },
        ToMaster::CaptureFailed {
            id: 1,
            reason: "the device was lost".into(),
        },
        ToMaster::Counters {
            tiles: TileCounters::default(),
            news: TileNews {
                loaded: (0..300).collect(),
                used: vec![7],
                drawable: vec![Drawable {
                    level: CacheLevel::Disk,
                    after_us: 16_000,
                }],
            },
        },
        ToMaster::Fault {
            message: "a corrupt tile".into(),
        },
        ToMaster::Trouble {
            message: "http://host/earth cannot be reached".into(),
        },
        ToMaster::Steer(Steer {
            zoom: 1.0,
            held: HeldKeys::FORWARD,
            ..Steer::default()
        }),
        ToMaster::Bye {
            reason: "the window was closed".into(),
        },
        ToMaster::Prepared { revision: 7 },
        ToMaster::CannotPrepare {
            revision: 8,
            reason: "layer \"relief\": no repository at /data/relief".into(),
        },
        ToMaster::MoveLens(MoveLens {
            latitude_deg: -90.0,
            longitude_deg: 180.0,
            grab: true,
        }),
        ToMaster::ErrorMeasured(ErrorMeasured {
            max_px: 0.75,
            samples: 1 << 40,
            uncovered: 0,
            tau_px: 1.0,
        }),
        ToMaster::CannotMeasure {
            reason: "the elevation has left memory".into(),
        },
    ]
}

#[test]
fn every_message_survives_the_wire() {
    for message in messages_to_node() {
        assert_eq!(
            decode_to_node(&encode_to_node(&message).unwrap()).unwrap(),
            message
        );
    }
    for message in messages_to_master() {
        assert_eq!(
            decode_to_master(&encode_to_master(&message).unwrap()).unwrap(),
            message
        );
    }
}

#[test]
fn caps_hold_both_ways() {
    let fault = ToMaster::Fault {
        message: "x".repeat(MAX_CONTROL_BYTES),
    };
    assert!(encode_to_master(&fault).is_err());
    let rows = CaptureRows {
        id: 0,
        output: 0,
        first_row: 0,
        rgba: vec![0; MAX_LARGE_BYTES],
    };
    assert!(encode_to_master(&ToMaster::CaptureRows(rows)).is_err());
    assert!(matches!(
        decode_to_master(&vec![5; MAX_LARGE_BYTES + 1]),
        Err(DecodeError::TooLarge { .. })
    ));
    assert!(matches!(
        decode_view(&[5; MAX_VIEW_BYTES + 1]),
        Err(DecodeError::TooLarge { .. })
    ));
    // A small message may not be padded to a large one by a long text.
    let mut long = vec![5, 8, 252];
    long.extend(100_000_u32.to_le_bytes());
    long.extend(std::iter::repeat_n(b'x', 100_000));
    assert!(matches!(
        decode_to_master(&long),
        Err(DecodeError::TooLarge {
            limit: MAX_CONTROL_BYTES,
            ..
        })
    ));
    let many = ToMaster::Counters {
        tiles: TileCounters::default(),
        news: TileNews {
            loaded: vec![0; 2049],
            ..TileNews::default()
        },
    };
    let bytes = encode_to_master(&many).unwrap();
    assert!(matches!(
        decode_to_master(&bytes),
        Err(DecodeError::Senseless(_))
    ));
}

#[test]
fn other_versions_and_extra_bytes_are_told_apart() {
    assert!(matches!(decode_view(&[]), Err(DecodeError::Empty)));
    let mut bytes = encode_view(&view(1)).unwrap();
    bytes.push(0);
    assert!(matches!(decode_view(&bytes), Err(DecodeError::Trailing(1))));
    bytes.pop();
    bytes[0] = 1;
    let error = decode_view(&bytes).unwrap_err();
    assert!(matches!(
        error,
        DecodeError::Version {
            found: 1,
            expected: 5
        }
    ));
    assert!(error.to_string().contains("same version"));
}

#[test]
fn lengths_that_lie_take_no_memory() {
    // A list of heads, a text, tiles and pixels that claim to be 2^62 long.
    let huge = |start: &[u8]| {
        let mut bytes = start.to_vec();
        bytes.push(253);
        bytes.extend((1_u64 << 62).to_le_bytes());
        bytes
    };
    let view_start = &encode_view(&view(0)).unwrap()[..1 + 1 + 3 + 1 + 1 + 96];
    assert!(decode_view(&huge(view_start)).is_err());
    assert!(decode_to_master(&huge(&[5, 8])).is_err());
    assert!(decode_to_master(&huge(&[5, 7, 0, 0, 0, 0, 0])).is_err());
    assert!(decode_to_master(&huge(&[5, 4, 0, 0, 0])).is_err());
    assert!(decode_to_master(&huge(&[5, 12, 5])).is_err());
    assert!(decode_to_node(&huge(&[5, 1, 0])).is_err());
}

#[test]
fn walls_and_scenes_from_the_wire_are_checked() {
    let mut wall = Wall::parse(WALL, "wall").unwrap();
    wall.hosts[0].outputs[0].channels[0].screen = 99;
    let bytes = encode_to_node(&ToNode::Welcome {
        host: 0,
        wall: Box::new(wall.clone()),
    })
    .unwrap();
    assert!(matches!(
        decode_to_node(&bytes),
        Err(DecodeError::Invalid(_))
    ));
    wall.hosts[0].outputs[0].channels[0].screen = 0;
    let bytes = encode_to_node(&ToNode::Welcome {
        host: 3,
        wall: Box::new(wall),
    })
    .unwrap();
    assert!(matches!(
        decode_to_node(&bytes),
        Err(DecodeError::Senseless(_))
    ));
    let mut scene = Scene::parse(SCENE, "scene").unwrap();
    let mut scenes = vec![scene.clone()];
    scenes[0].planet.semi_minor_m = f64::NAN;
    for tau in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 101.0] {
        scene.mesh.tau = tau;
        let error = scene.validate().unwrap_err().to_string();
        assert!(
            error.contains("mesh.tau") && error.contains("0.05…100"),
            "{error}"
        );
        scenes.push(scene.clone());
    }
    for scene in scenes {
        let bytes = encode_to_node(&ToNode::Scene {
            revision: 1,
            scene: Box::new(scene),
        })
        .unwrap();
        assert!(matches!(
            decode_to_node(&bytes),
            Err(DecodeError::Invalid(_))
        ));
    }
}

/// Decoding as everything: none of it may panic.
fn decode_all(bytes: &[u8]) {
    let _ = decode_view(bytes);
    let _ = decode_to_node(bytes);
    let _ = decode_to_master(bytes);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn random_bytes_never_panic(mut bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        decode_all(&bytes);
        if let Some(version) = bytes.first_mut() {
            *version = 3;
        }
        decode_all(&bytes);
    }

    #[test]
    fn damaged_messages_never_panic(
        choice in any::<prop::sample::Index>(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        cut in any::<prop::sample::Index>(),
    ) {
        let mut all: Vec<Vec<u8>> = messages_to_node().iter().map(|m| encode_to_node(m).unwrap()).collect();
        all.extend(messages_to_master().iter().map(|m| encode_to_master(m).unwrap()));
        all.push(encode_view(&view(3)).unwrap());
        let bytes = choice.get(&all);
        let mut damaged = bytes.clone();
        for (place, value) in damage {
            let index = place.index(damaged.len());
            damaged[index] = value;
        }
        decode_all(&damaged);
        damaged.truncate(cut.index(damaged.len() + 1));
        decode_all(&damaged);
        // A message that was cut is not taken for a whole one.
        let mut short = bytes.clone();
        short.pop();
        prop_assert!(decode_to_node(&short).is_err() || decode_to_master(&short).is_err());
    }
}
