//! Barrier, follower and membership, move by move. What holds over thousands of schedules is proved in
//! the crate's own simulation.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use protocol::barrier::{Action, Barrier, BarrierOptions, LeaveReason};
use protocol::camera::Pose;
use protocol::follower::{Follower, Step};
use protocol::membership::{Membership, Refusal, SILENCE_US};
use protocol::message::{Hello, PROTOCOL_VERSION, Swap, View};
use protocol::wall::{Viewers, Wall};

const DEMO: &str = include_str!("../../configs/walls/demo-2x2.toml");

fn barrier(nodes: usize) -> (Barrier, i64) {
    let mut barrier = Barrier::new(BarrierOptions::new(60.0), 0);
    for node in 0..nodes {
        assert!(barrier.connected(node).is_empty());
    }
    let mut now_us = 0;
    // The first frame enters everybody, the second begins with all as members.
    for _ in 0..2 {
        now_us = now_us.max(barrier.next_wake_us());
        barrier.tick(now_us);
        answer(&mut barrier, 0..nodes, now_us + 1000);
        now_us += 1000;
    }
    assert_eq!(barrier.members().count(), nodes);
    (barrier, now_us)
}

fn answer(
    barrier: &mut Barrier,
    nodes: impl IntoIterator<Item = usize>,
    now_us: i64,
) -> Vec<Action> {
    let (epoch, frame) = (barrier.epoch(), barrier.frame());
    nodes
        .into_iter()
        .flat_map(|node| barrier.ready(node, epoch, frame, now_us))
        .collect()
}

fn swap_of(actions: &[Action]) -> Option<Swap> {
    actions.iter().find_map(|action| match action {
        Action::Swap(swap) => Some(*swap),
        _ => None,
    })
}

/// Runs one frame that `nodes` answer after 1 ms; returns its actions and when it was swapped.
fn frame(barrier: &mut Barrier, nodes: &[usize]) -> (Vec<Action>, i64, i64) {
    let begun_us = barrier.next_wake_us();
    let mut actions = barrier.tick(begun_us);
    actions.extend(answer(barrier, nodes.iter().copied(), begun_us + 1000));
    let mut now_us = begun_us + 1000;
    while swap_of(&actions).is_none() {
        now_us = barrier.next_wake_us().max(now_us);
        actions.extend(barrier.tick(now_us));
    }
    (actions, begun_us + 1000, now_us)
}

#[test]
fn all_ready_swaps_at_once_on_the_grid() {
    let (mut barrier, _) = barrier(3);
    let epoch = barrier.epoch();
    let mut before: Option<Swap> = None;
    for _ in 0..100 {
        let (actions, ready_us, swapped_us) = frame(&mut barrier, &[0, 1, 2]);
        assert_eq!(ready_us, swapped_us);
        let swap = swap_of(&actions).unwrap();
        assert!(swap.present_at_us >= swapped_us + barrier.lead_us());
        // Ticks of 60 Hz, each one used once.
        let ticks = swap.present_at_us as f64 * 60.0 / 1e6;
        assert!((ticks - ticks.round()).abs() < 1e-4);
        if let Some(before) = before {
            assert_eq!(swap.frame, before.frame + 1);
            assert!((swap.present_at_us - before.present_at_us - 16_667).abs() <= 1);
        }
        before = Some(swap);
        assert_eq!(barrier.epoch(), epoch);
    }
}

#[test]
fn a_silent_member_is_waited_for_less_and_less_and_leaves_after_three() {
    let (mut barrier, _) = barrier(4);
    for _ in 0..40 {
        frame(&mut barrier, &[0, 1, 2, 3]);
    }
    let epoch = barrier.epoch();
    let deadline_us = barrier.deadline_us();
    assert!(deadline_us < 100_000, "{deadline_us}");
    for (strike, share) in [1, 2, 4].into_iter().enumerate() {
        let (actions, ready_us, swapped_us) = frame(&mut barrier, &[0, 1, 3]);
        assert_eq!(swapped_us - ready_us, deadline_us / share);
        assert!(
            actions
                .iter()
                .any(|action| matches!(action, Action::Missed { node: 2, .. }))
        );
        let left = Action::Left {
            node: 2,
            reason: LeaveReason::Deadlines,
        };
        assert_eq!(actions.contains(&left), strike == 2);
    }
    // The wall goes on without it, in a new epoch.
    let (_, ready_us, swapped_us) = frame(&mut barrier, &[0, 1, 3]);
    assert_eq!(ready_us, swapped_us);
    assert_eq!(barrier.epoch(), epoch + 1);
    // When it has caught up, it enters with the next frame and another epoch.
    frame(&mut barrier, &[2, 0, 1, 3]);
    let (actions, ..) = frame(&mut barrier, &[0, 1, 2, 3]);
    assert!(actions.contains(&Action::Entered { node: 2 }));
    assert_eq!(barrier.epoch(), epoch + 2);
}

#[test]
fn a_lost_link_ends_the_wait_at_once() {
    let (mut barrier, _) = barrier(2);
    let begun_us = barrier.next_wake_us();
    barrier.tick(begun_us);
    assert!(answer(&mut barrier, [0], begun_us + 500).is_empty());
    let actions = barrier.disconnected(1, begun_us + 700);
    assert!(actions.contains(&Action::Left {
        node: 1,
        reason: LeaveReason::LinkLost
    }));
    assert!(swap_of(&actions).is_some());
}

#[test]
fn views_are_repeated_to_those_that_have_not_answered() {
    let (mut barrier, _) = barrier(3);
    let begun_us = barrier.next_wake_us();
    barrier.tick(begun_us);
    answer(&mut barrier, [1], begun_us + 500);
    assert_eq!(barrier.next_wake_us(), begun_us + 25_000);
    let actions = barrier.tick(begun_us + 25_000);
    assert_eq!(
        actions,
        [Action::Resend {
            frame: barrier.frame(),
            nodes: vec![0, 2]
        }]
    );
    // A node that connects in the middle of a frame gets its view, too.
    let actions = barrier.connected(7);
    assert_eq!(
        actions,
        [Action::Resend {
            frame: barrier.frame(),
            nodes: vec![7]
        }]
    );
}

#[test]
fn nonsense_from_nodes_changes_nothing() {
    let (mut barrier, _) = barrier(2);
    let begun_us = barrier.next_wake_us();
    barrier.tick(begun_us);
    let (epoch, frame) = (barrier.epoch(), barrier.frame());
    for (node, epoch, frame) in [
        (9, epoch, frame),
        (0, epoch + 1, frame),
        (0, epoch, frame + 1),
        (0, epoch, u64::MAX),
        (0, epoch, 0),
    ] {
        assert!(barrier.ready(node, epoch, frame, begun_us + 10).is_empty());
    }
    assert!(barrier.disconnected(9, begun_us + 20).is_empty());
    // Saying ready twice counts once.
    assert!(answer(&mut barrier, [0, 0], begun_us + 30).is_empty());
}

fn view(frame: u64, previous_swap: Option<Swap>) -> View {
    View {
        epoch: 1,
        frame,
        scene_revision: 1,
        sent_us: 0,
        pose: Pose {
            position_m: [7e6, 0.0, 0.0],
            right: [0.0, 1.0, 0.0],
            up: [0.0, 0.0, 1.0],
            back: [1.0, 0.0, 0.0],
        },
        wall_revision: 0,
        viewers: Viewers {
            heads: vec![],
            pixels_per_radian: 1000.0,
        },
        settle: false,
        previous_swap,
    }
}

fn swap(frame: u64, present_at_us: i64) -> Swap {
    Swap {
        epoch: 1,
        frame,
        present_at_us,
    }
}

const READY_1: Step = Step::SayReady { epoch: 1, frame: 1 };

#[test]
fn a_follower_draws_answers_and_presents() {
    let mut follower = Follower::new(60.0);
    assert_eq!(follower.view(view(1, None), 0), [Step::Draw(view(1, None))]);
    assert_eq!(follower.drawn(1, 1, 10), [READY_1]);
    assert_eq!(
        follower.swap(swap(1, 100), 20),
        [Step::Present(swap(1, 100))]
    );
    // The next view waits until the picture is presented.
    assert!(follower.view(view(2, Some(swap(1, 100))), 30).is_empty());
    assert!(follower.is_due(100));
    assert_eq!(
        follower.presented(101),
        [Step::Draw(view(2, Some(swap(1, 100))))]
    );
}

#[test]
fn a_lost_swap_is_learned_from_the_next_view() {
    let mut follower = Follower::new(60.0);
    follower.view(view(1, None), 0);
    follower.drawn(1, 1, 10);
    let steps = follower.view(view(2, Some(swap(1, 1000))), 500);
    assert_eq!(steps, [Step::Present(swap(1, 1000))]);
}

#[test]
fn a_repeated_view_is_answered_again_and_not_drawn_again() {
    let mut follower = Follower::new(60.0);
    follower.view(view(1, None), 0);
    assert!(follower.view(view(1, None), 5).is_empty());
    follower.drawn(1, 1, 10);
    assert_eq!(follower.view(view(1, None), 20), [READY_1]);
    follower.swap(swap(1, 100), 30);
    assert!(follower.view(view(1, None), 40).is_empty());
    follower.presented(100);
    assert!(follower.view(view(1, None), 110).is_empty());
}

#[test]
fn a_follower_that_is_behind_skips_to_the_newest_view() {
    let mut follower = Follower::new(60.0);
    follower.view(view(1, None), 0);
    for frame in 2..=5 {
        assert!(
            follower
                .view(view(frame, Some(swap(frame - 1, 0))), frame as i64 * 16_667)
                .is_empty()
        );
    }
    // Frame 1 is done long after its time: it is told, left, and frame 5 drawn.
    let steps = follower.drawn(1, 1, 100_000);
    assert_eq!(steps, [READY_1, Step::Draw(view(5, Some(swap(4, 0))))]);
}

#[test]
fn a_picture_that_is_late_by_a_period_is_not_shown() {
    let mut follower = Follower::new(60.0);
    follower.view(view(1, None), 0);
    follower.drawn(1, 1, 10);
    follower.swap(swap(1, 1_000), 20);
    assert!(follower.is_due(15_000));
    assert!(!follower.is_due(17_000));
    assert!(follower.dropped(17_000).is_empty());
    // And one whose drawing ends that late is not even scheduled.
    let mut follower = Follower::new(60.0);
    follower.view(view(1, None), 0);
    follower.swap(swap(1, 1_000), 20);
    assert_eq!(follower.drawn(1, 1, 20_000), [READY_1]);
}

fn hello(node: &str) -> Hello {
    Hello {
        protocol_version: PROTOCOL_VERSION,
        program_version: "0.1.0".to_owned(),
        session: 7,
        node: node.to_owned(),
        adapter: "llvmpipe".to_owned(),
        process_id: 42,
    }
}

fn membership() -> Membership {
    Membership::new(&Wall::parse(DEMO, "demo").unwrap(), 7, "0.1.0")
}

#[test]
fn refusals_say_what_to_do() {
    let mut members = membership();
    let unknown = members.hello(&hello("left-midle"), 0).unwrap_err();
    assert_eq!(unknown.retry_after_ms(), None);
    let text = unknown.to_string();
    assert!(
        text.contains("left-midle") && text.contains("demo-2x2"),
        "{text}"
    );
    assert!(
        text.contains("left-top, right-top, left-bottom, right-bottom"),
        "{text}"
    );

    let old = Hello {
        protocol_version: 99,
        program_version: "9.9".to_owned(),
        ..hello("left-top")
    };
    let text = members.hello(&old, 0).unwrap_err().to_string();
    assert!(
        text.contains("9.9") && text.contains("0.1.0") && text.contains("same version"),
        "{text}"
    );

    let stale = Hello {
        session: 6,
        ..hello("left-top")
    };
    assert!(
        members
            .hello(&stale, 0)
            .unwrap_err()
            .retry_after_ms()
            .is_some()
    );

    members.hello(&hello("left-top"), 0).unwrap();
    let duplicate = members.hello(&hello("left-top"), 1000).unwrap_err();
    assert!(matches!(
        duplicate,
        Refusal::Duplicate { process_id: 42, .. }
    ));
    assert!(duplicate.retry_after_ms().is_some());
}

#[test]
fn a_restarted_node_takes_the_seat_of_a_silent_link() {
    let mut members = membership();
    let first = members.hello(&hello("right-top"), 0).unwrap();
    assert_eq!((first.seat.node, first.replaced), (1, None));
    assert!(members.heard(first.seat, 100_000));
    members.entered(1);
    members.presented(1, 250_000);
    members.presented(1, 266_667);
    let second = members
        .hello(&hello("right-top"), 100_000 + SILENCE_US)
        .unwrap();
    assert_eq!(second.replaced, Some(first.seat));
    // What the old link still says or that it is lost does not count.
    assert!(!members.heard(first.seat, 700_000));
    assert!(!members.lost(first.seat));
    assert!(members.is_current(second.seat));
    members.entered(1);
    members.presented(1, 900_000);
    let record = &members.nodes()[1];
    assert_eq!(
        (record.joins, record.frames, record.join_us),
        (2, 3, Some(300_000))
    );
    assert!(members.lost(second.seat));
    assert!(!members.nodes()[1].connected);
}
