//! Heads: rotations and transforms by hand-made numbers; jumps, silence and rubbish in virtual time.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::f64::consts::FRAC_1_SQRT_2;

use tracking::{
    Axes, BadPose, Body, Head, HeadEvent, HeadPose, HeadState, JUMP_PERSISTS_US, LOST_AFTER_US,
    RawPose, RoomError, Smoothing, Stamps, ToRoom, dtrack,
};

const STEP_US: i64 = 16_667;
const AT_REST: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

fn head(to_room: &Axes, unit_m: f64, to_head: &Body) -> Head {
    Head::new(
        ToRoom::new(to_room, unit_m, to_head).unwrap(),
        Smoothing::default(),
    )
}

fn plain() -> Head {
    head(&Axes::default(), 1.0, &Body::default())
}

fn raw(position: [f64; 3], orientation: [f64; 4]) -> RawPose {
    RawPose {
        position,
        orientation,
    }
}

fn pose_of(mut head: Head, raw: &RawPose) -> HeadPose {
    assert_eq!(head.measure(0, raw), Some(HeadEvent::Found));
    head.motion().unwrap().at(0)
}

#[track_caller]
fn assert_close(one: [f64; 3], other: [f64; 3]) {
    let is_close = one
        .iter()
        .zip(other)
        .all(|(one, other)| (one - other).abs() < 1e-6);
    assert!(is_close, "{one:?} is not {other:?}");
}

#[test]
fn a_head_at_rest_looks_into_the_screen() {
    let pose = pose_of(plain(), &raw([0.1, 1.7, 0.4], AT_REST));
    assert_eq!(pose.position_m, [0.1, 1.7, 0.4]);
    assert_eq!(pose.right, [1.0, 0.0, 0.0]);
    assert_eq!(pose.up, [0.0, 1.0, 0.0]);
    assert_eq!(pose.back, [0.0, 0.0, 1.0]);
}

#[test]
fn a_quaternion_is_x_y_z_w() {
    // 90° about y: the head looks to the left, along −x; its back is +x, its right is −z.
    let about_y = [0.0, FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2];
    let pose = pose_of(plain(), &raw([0.0; 3], about_y));
    assert_close(pose.back, [1.0, 0.0, 0.0]);
    assert_close(pose.right, [0.0, 0.0, -1.0]);
    // 90° about x: it looks up.
    let about_x = [FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2];
    let pose = pose_of(plain(), &raw([0.0; 3], about_x));
    assert_close(pose.up, [0.0, 0.0, 1.0]);
    assert_close(pose.back, [0.0, -1.0, 0.0]);
}

#[test]
fn a_dtrack_matrix_is_read_column_by_column() {
    // 90° about z: the body's x axis is the room's y, its y axis is −x.
    let body = dtrack::Body {
        id: 0,
        tracked: true,
        position_mm: [1_000.0, -2_000.0, 1_500.0],
        rotation: [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    };
    let pose = pose_of(
        head(&Axes::default(), 0.001, &Body::default()),
        &body.pose().unwrap(),
    );
    assert_close(pose.position_m, [1.0, -2.0, 1.5]);
    assert_close(pose.right, [0.0, 1.0, 0.0]);
    assert_close(pose.up, [-1.0, 0.0, 0.0]);
    assert_close(pose.back, [0.0, 0.0, 1.0]);
    let mirrored = dtrack::Body {
        rotation: [-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        ..body
    };
    let refused = mirrored.pose().unwrap_err();
    assert!(refused.to_string().contains("no rotation"), "{refused}");
}

#[test]
fn a_tracker_with_z_up_in_millimetres_finds_its_place_in_the_room() {
    // The tracker's x is the room's x, its y points into the screen (−z), its z up.
    let axes = Axes {
        origin_m: [0.5, 0.1, -1.0],
        x: [1.0, 0.0, 0.0],
        y: [0.0, 0.0, -1.0],
        z: [0.0, 1.0, 0.0],
    };
    let pose = pose_of(
        head(&axes, 0.001, &Body::default()),
        &raw([200.0, -3_000.0, 1_700.0], AT_REST),
    );
    assert_close(pose.position_m, [0.7, 1.8, 2.0]);
    // The body's axes are the tracker's, so its z, the head's back, points up.
    assert_close(pose.back, [0.0, 1.0, 0.0]);
    assert_close(pose.up, [0.0, 0.0, -1.0]);
    // So that body looks down; a head mounted on it that looks ahead is pitched up by 90°.
    let mounted = Body {
        offset_m: [0.0, 0.0, 0.1],
        looks_deg: [0.0, 90.0, 0.0],
    };
    let pose = pose_of(head(&axes, 0.001, &mounted), &raw([0.0; 3], AT_REST));
    assert_close(pose.position_m, [0.5, 0.2, -1.0]);
    assert_close(pose.back, [0.0, 0.0, 1.0]);
    assert_close(pose.up, [0.0, 1.0, 0.0]);
}

#[test]
fn the_way_from_body_to_head_turns_with_the_body() {
    // The target sits on the right temple: the eyes are 8 cm to its left and 10 cm ahead.
    let to_head = Body {
        offset_m: [-0.08, 0.0, -0.1],
        looks_deg: [30.0, 0.0, 0.0],
    };
    let about_y = [0.0, FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2];
    let pose = pose_of(
        head(&Axes::default(), 1.0, &to_head),
        &raw([0.0, 1.7, 0.0], about_y),
    );
    // Turned to the left by 90°, what was left is ahead of where it looked: +z; ahead is −x.
    assert_close(pose.position_m, [-0.1, 1.7, 0.08]);
    // 120° to the left in all.
    assert_close(
        pose.back,
        [120_f64.to_radians().sin(), 0.0, 120_f64.to_radians().cos()],
    );
    // Yaw, then pitch about the turned x: it looks up to the left.
    let to_head = Body {
        offset_m: [0.0; 3],
        looks_deg: [90.0, 45.0, 0.0],
    };
    let pose = pose_of(
        head(&Axes::default(), 1.0, &to_head),
        &raw([0.0; 3], AT_REST),
    );
    assert_close(pose.back, [FRAC_1_SQRT_2, -FRAC_1_SQRT_2, 0.0]);
    // Roll is counter-clockwise for who sits behind: the right goes up.
    let to_head = Body {
        offset_m: [0.0; 3],
        looks_deg: [0.0, 0.0, 90.0],
    };
    let pose = pose_of(
        head(&Axes::default(), 1.0, &to_head),
        &raw([0.0; 3], AT_REST),
    );
    assert_close(pose.right, [0.0, 1.0, 0.0]);
}

#[test]
fn axes_that_are_no_rotation_are_refused_by_name() {
    let refuse =
        |axes: Axes, unit_m: f64| ToRoom::new(&axes, unit_m, &Body::default()).unwrap_err();
    let left_handed = Axes {
        z: [0.0, 0.0, -1.0],
        ..Axes::default()
    };
    let error = refuse(left_handed, 1.0);
    assert_eq!(error, RoomError::LeftHanded { determinant: -1.0 });
    assert!(error.to_string().contains("left-handed"), "{error}");
    let scaled = Axes {
        y: [0.0, 0.001, 0.0],
        ..Axes::default()
    };
    assert!(matches!(
        refuse(scaled, 1.0),
        RoomError::NotUnit { axis: "y", .. }
    ));
    let skewed = Axes {
        y: [0.6, 0.8, 0.0],
        ..Axes::default()
    };
    assert!(matches!(
        refuse(skewed, 1.0),
        RoomError::NotPerpendicular("x", "y", _)
    ));
    let endless = Axes {
        origin_m: [f64::NAN, 0.0, 0.0],
        ..Axes::default()
    };
    assert!(matches!(
        refuse(endless, 1.0),
        RoomError::OutOfRange {
            key: "to_room.origin_m",
            ..
        }
    ));
    for unit_m in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            refuse(Axes::default(), unit_m),
            RoomError::BadUnit(_)
        ));
    }
}

/// Measures a head that stands at `x_m`, from `from_us` on, for `steps`; gives the events and the next moment.
fn stand(head: &mut Head, from_us: i64, steps: i64, x_m: f64) -> (Vec<HeadEvent>, i64) {
    let events = (0..steps)
        .filter_map(|step| head.measure(from_us + step * STEP_US, &raw([x_m, 1.7, 0.0], AT_REST)))
        .collect();
    (events, from_us + steps * STEP_US)
}

fn x_m(head: &Head, at_us: i64) -> f64 {
    head.motion().unwrap().at(at_us).position_m[0]
}

#[test]
fn a_glitch_changes_nothing() {
    let mut head = plain();
    let (_, next_us) = stand(&mut head, 0, 60, 0.0);
    let (events, next_us) = stand(&mut head, next_us, 3, 2.0);
    assert!(
        matches!(events[..], [HeadEvent::JumpRefused { distance_m, speed_m_s }]
        if (distance_m - 2.0).abs() < 1e-9 && speed_m_s > 100.0)
    );
    assert_eq!(x_m(&head, next_us), 0.0);
    assert_eq!(head.state(), HeadState::Tracked);
    let (events, next_us) = stand(&mut head, next_us, 60, 0.0);
    assert_eq!(events, []);
    assert_eq!(x_m(&head, next_us), 0.0);
}

#[test]
fn a_jump_that_lasts_is_a_new_place_after_a_quarter_of_a_second() {
    for jump_m in [0.3, 1.0, 4.0] {
        let mut head = plain();
        let (_, jump_us) = stand(&mut head, 0, 60, 0.0);
        let mut accepted_us = None;
        for step in 0..60 {
            let at_us = jump_us + step * STEP_US;
            match head.measure(at_us, &raw([jump_m, 1.7, 0.0], AT_REST)) {
                Some(HeadEvent::JumpRefused { .. }) => assert_eq!(step, 0),
                Some(HeadEvent::JumpAccepted { distance_m }) => {
                    assert!((distance_m - jump_m).abs() < 1e-9);
                    accepted_us = Some(at_us - jump_us);
                }
                Some(other) => panic!("{other:?}"),
                None if accepted_us.is_none() => assert_eq!(x_m(&head, at_us), 0.0),
                None => {}
            }
            if accepted_us.is_some() {
                // At once, and without a velocity that would throw it farther.
                assert!((x_m(&head, at_us + 30_000) - jump_m).abs() < 1e-9);
            }
        }
        let accepted_us = accepted_us.unwrap();
        let expected_us = JUMP_PERSISTS_US..JUMP_PERSISTS_US + STEP_US;
        assert!(
            expected_us.contains(&accepted_us),
            "{jump_m}: {accepted_us}"
        );
    }
}

#[test]
fn fast_walking_is_no_jump() {
    let mut head = plain();
    for step in 0..120 {
        let x_m = 9.0 * step as f64 * STEP_US as f64 * 1e-6;
        let event = head.measure(step * STEP_US, &raw([x_m, 0.0, 0.0], AT_REST));
        assert_eq!(event, (step == 0).then_some(HeadEvent::Found));
    }
}

#[test]
fn positions_that_dance_are_never_believed() {
    let mut head = plain();
    let (_, next_us) = stand(&mut head, 0, 60, 0.0);
    for step in 0..600 {
        let x_m = if step % 2 == 0 { 1.0 } else { -1.0 };
        let event = head.measure(next_us + step * STEP_US, &raw([x_m, 1.7, 0.0], AT_REST));
        assert!(
            matches!(event, Some(HeadEvent::JumpRefused { .. })),
            "{event:?}"
        );
    }
    let now_us = next_us + 600 * STEP_US;
    assert_eq!(x_m(&head, now_us), 0.0);
    assert_eq!(head.advance(now_us), Some(HeadEvent::Lost));
    let (events, _) = stand(&mut head, now_us, 2, 0.0);
    assert_eq!(events, [HeadEvent::Found]);
}

#[test]
fn rubbish_is_named_and_never_believed() {
    let mut head = plain();
    let (_, next_us) = stand(&mut head, 0, 60, 0.5);
    let bad = |event: Option<HeadEvent>| match event {
        Some(HeadEvent::Bad(bad)) => bad,
        other => panic!("{other:?}"),
    };
    for step in 0..60 {
        let at_us = next_us + step * STEP_US;
        let event = head.measure(at_us, &raw([f64::NAN, 0.0, 0.0], AT_REST));
        assert!(matches!(bad(event), BadPose::NotFinite(_)));
        let event = head.measure(at_us, &raw([0.5, 1.7, 0.0], [0.0; 4]));
        assert_eq!(bad(event), BadPose::NotUnit(0.0));
        let event = head.measure(at_us, &raw([0.5, 1.7, 0.0], [f64::INFINITY, 0.0, 0.0, 1.0]));
        assert!(matches!(bad(event), BadPose::NotFinite(_)));
        let event = head.measure(at_us, &raw([1e300, 0.0, 0.0], AT_REST));
        assert!(matches!(bad(event), BadPose::TooFar(_)));
    }
    assert_eq!(x_m(&head, next_us + 60 * STEP_US), 0.5);
}

#[test]
fn a_silent_head_stays_where_it_was_and_comes_back_by_itself() {
    let mut head = plain();
    assert_eq!(head.state(), HeadState::Waiting);
    assert_eq!(head.advance(10_000_000), None);
    let (events, next_us) = stand(&mut head, 10_000_000, 30, 0.25);
    assert_eq!(events, [HeadEvent::Found]);
    let last_us = next_us - STEP_US;
    assert_eq!(head.advance(last_us + LOST_AFTER_US - 1), None);
    assert_eq!(head.advance(last_us + LOST_AFTER_US), Some(HeadEvent::Lost));
    assert_eq!(head.advance(last_us + LOST_AFTER_US + 1), None);
    assert_eq!(head.state(), HeadState::Lost { since_us: last_us });
    assert_eq!(x_m(&head, last_us + 3_600_000_000), 0.25);
    // It walked 2 m in the meantime: that is no jump, and the filter does not glide there.
    let (events, next_us) = stand(&mut head, last_us + 3_000_000, 1, 2.25);
    assert_eq!(events, [HeadEvent::Found]);
    assert_eq!(x_m(&head, next_us), 2.25);
}

#[test]
fn measurements_from_the_past_are_left_out() {
    let mut head = plain();
    let (_, next_us) = stand(&mut head, 0, 10, 0.0);
    let before = head.motion();
    assert_eq!(
        head.measure(next_us - STEP_US, &raw([0.1, 1.7, 0.0], AT_REST)),
        None
    );
    assert_eq!(head.measure(i64::MIN, &raw([0.1, 1.7, 0.0], AT_REST)), None);
    assert_eq!(head.motion(), before);
    assert_eq!(head.advance(i64::MAX), Some(HeadEvent::Lost));
}

#[test]
fn stamps_remove_the_networks_jitter() {
    let mut stamps = Stamps::new();
    let mut last_us = 0;
    for step in 0..600_i64 {
        let stamp_us = 40_000_000_000 + step * 10_000;
        // 2 ms of way, every fourth 7 ms late, and the clocks drift by 50 ppm.
        let arrived_us = 1_000_000 + step * 10_000 + step / 2 + 2_000 + (step % 4 / 3) * 7_000;
        let moment_us = stamps.moment_us(Some(stamp_us), arrived_us);
        assert!(moment_us <= arrived_us);
        if step > 0 {
            let step_us = moment_us - last_us;
            assert!((9_000..=11_000).contains(&step_us), "{step}: {step_us}");
        }
        last_us = moment_us;
    }
    // Midnight, and peers that stamp nonsense.
    assert_eq!(
        stamps.moment_us(Some(0), last_us + 10_000),
        last_us + 10_000
    );
    assert_eq!(stamps.moment_us(None, last_us + 20_000), last_us + 20_000);
    // A clock that stands still is none.
    let moments = (0..10).map(|step| stamps.moment_us(Some(77), last_us + step * 50_000));
    let moments: Vec<i64> = moments.collect();
    assert_eq!(moments[..3], [last_us; 3]);
    assert_eq!(
        moments[3..],
        [3, 4, 5, 6, 7, 8, 9].map(|step| last_us + step * 50_000)
    );
    for stamp_us in [i64::MAX, i64::MIN, 5, i64::MAX] {
        let moment_us = stamps.moment_us(Some(stamp_us), last_us + 30_000);
        assert!(moment_us <= last_us + 30_000);
    }
}
