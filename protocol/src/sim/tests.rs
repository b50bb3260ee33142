//! Proofs over thousands of schedules: what holds whatever the network and the machines do.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::collections::HashMap;

use super::VirtualWall;
use super::events::{Conditions, Random};
use crate::barrier::{LeaveReason, NodeId};
use crate::wall::Wall;

const SECOND_US: i64 = 1_000_000;
const START_US: i64 = super::START_US;
/// Schedules of the worst test: enough for every rare meeting of faults, in a few seconds.
const SEEDS: u64 = 4_000;
const DEADLINE_US: i64 = 100_000;

/// A wall of hosts node0, node1, … side by side.
fn wall(nodes: usize) -> Wall {
    let mut text = format!(
        "[wall]\nname = \"virtual\"\nfps = 60\n[[observers]]\nname = \"viewer\"\nhead_m = [0, 0, 2]\n\
         [[screens]]\nname = \"front\"\nkind = \"planar\"\nobserver = \"viewer\"\nsize_px = [{}, 10]\n\
         corners_m = {{ bottom_left = [0, 0, 0], bottom_right = [{nodes}, 0, 0], top_left = [0, 1, 0] }}\n",
        nodes * 10
    );
    for node in 0..nodes {
        text += &format!(
            "[[hosts]]\nname = \"node{node}\"\n[[hosts.outputs]]\nname = \"out\"\nsize_px = [10, 10]\n\
             headless = true\nchannels = [{{ screen = \"front\", canvas_px = [{}, 0, 10, 10] }}]\n",
            node * 10
        );
    }
    Wall::parse(&text, "virtual.toml").unwrap()
}

fn calm(nodes: usize) -> Conditions {
    Conditions {
        nodes,
        fps: 60.0,
        loss: 0.0,
        delay_us: 100,
        jitter_us: 50.0,
        draw_us: (1_000, 6_000),
        hiccups: 0.0,
    }
}

/// What must hold in every world.
fn check_always(world: &VirtualWall, seed: u64) {
    let history = &world.history;
    // Every frame is swapped at most once, in order, at least a period apart.
    for pair in history.swaps.windows(2) {
        let (before, after) = (pair[0].swap, pair[1].swap);
        assert!(
            after.frame > before.frame,
            "seed {seed}: {before:?} {after:?}"
        );
        assert!(
            after.present_at_us - before.present_at_us >= 16_600,
            "seed {seed}: {after:?}"
        );
        assert!(after.epoch >= before.epoch, "seed {seed}: {after:?}");
    }
    // Nobody waits for a late node longer than one deadline, unless the master itself was held up.
    for record in &history.swaps {
        if let Some(first_ready_us) = record.first_ready_us
            && !record.master_stalled
        {
            let waited_us = record.decided_us - first_ready_us;
            assert!(
                waited_us <= DEADLINE_US,
                "seed {seed}: waited {waited_us} µs: {record:?}\n{:?}\n{:?}",
                history.missed,
                history.left
            );
        }
    }
    // The error of a node's clock is within its bound.
    for record in &history.presented {
        let (error_us, bound_us) = (record.clock_error_us, record.clock_bound_us);
        assert!(error_us <= bound_us + 2, "seed {seed}: {record:?}");
    }
    // A process presents every frame at most once, in order, and only frames that were swapped.
    let swapped: HashMap<u64, i64> = history
        .swaps
        .iter()
        .map(|record| (record.swap.frame, record.swap.present_at_us))
        .collect();
    let mut newest: HashMap<(NodeId, u32), u64> = HashMap::new();
    for record in &history.presented {
        assert!(
            swapped.contains_key(&record.frame),
            "seed {seed}: {record:?}"
        );
        let newest = newest.entry((record.node, record.process)).or_default();
        assert!(
            record.frame > *newest,
            "seed {seed}: {record:?} after {newest}"
        );
        *newest = record.frame;
    }
    // No node shows a frame when another node already shows a later one: between two swaps, one frame
    // is new on the wall and no other.
    let mut latest_us: HashMap<u64, i64> = HashMap::new();
    let mut worst_error_us = 0;
    for record in &history.presented {
        let latest = latest_us.entry(record.frame).or_insert(i64::MIN);
        *latest = (*latest).max(record.at_us);
        worst_error_us = worst_error_us.max(record.clock_error_us);
    }
    let mut frames: Vec<u64> = latest_us.keys().copied().collect();
    frames.sort_unstable();
    let mut latest_before_us = i64::MIN;
    for frame in frames {
        let shown = history
            .presented
            .iter()
            .filter(|record| record.frame == frame);
        let earliest_us = shown.map(|record| record.at_us).min().unwrap();
        let slack_us = 2 * worst_error_us;
        assert!(
            earliest_us + slack_us >= latest_before_us,
            "seed {seed}: frame {frame} mixes"
        );
        latest_before_us = latest_us[&frame];
    }
}

/// After some quiet seconds, every living node is a member and shows the newest pictures.
fn check_recovered(world: &VirtualWall, seed: u64) {
    let newest = world.history.swaps.last().unwrap().swap.frame;
    let members: Vec<NodeId> = world.barrier.members().collect();
    let alive: Vec<NodeId> = world.alive().collect();
    assert_eq!(members, alive, "seed {seed}");
    for node in alive {
        let shown = world
            .history
            .presented
            .iter()
            .rev()
            .find(|record| record.node == node);
        let shown = shown.unwrap_or_else(|| panic!("seed {seed}: node {node} never presented"));
        assert!(
            shown.frame + 30 > newest,
            "seed {seed}: node {node} shows {shown:?} of {newest}"
        );
    }
}

#[test]
fn a_calm_wall_is_complete_at_once_and_never_misses() {
    for nodes in [1, 2, 4, 8, 16] {
        let mut world = VirtualWall::new(&wall(nodes), calm(nodes), nodes as u64);
        world.run_until(5 * SECOND_US);
        check_always(&world, 0);
        check_recovered(&world, 0);
        assert!(
            world.history.missed.is_empty(),
            "{:?}",
            world.history.missed
        );
        assert!(world.history.left.is_empty());
        let complete_us = world
            .history
            .entered
            .iter()
            .map(|(_, at_us)| *at_us)
            .max()
            .unwrap();
        assert!(
            complete_us - START_US < 150_000,
            "complete after {}",
            complete_us - START_US
        );
        // 60 frames a second, and skew within what the clocks allow.
        let frames = world.history.swaps.len();
        assert!((295..=301).contains(&frames), "{frames} frames in 5 s");
        let late = world
            .history
            .presented
            .iter()
            .filter(|record| record.at_us > START_US + SECOND_US);
        let mut by_frame: HashMap<u64, (i64, i64)> = HashMap::new();
        for record in late {
            let span = by_frame
                .entry(record.frame)
                .or_insert((record.at_us, record.at_us));
            *span = (span.0.min(record.at_us), span.1.max(record.at_us));
        }
        let skew_us = by_frame
            .values()
            .map(|(low, high)| high - low)
            .max()
            .unwrap();
        assert!(skew_us < 120, "{nodes} nodes: skew {skew_us} µs");
    }
}

#[test]
fn a_killed_node_costs_one_deadline_a_frame_and_comes_back() {
    for seed in 0..200 {
        let mut world = VirtualWall::new(&wall(4), calm(4), seed);
        world.kill(2, 2 * SECOND_US);
        world.start(2, 3 * SECOND_US);
        world.run_until(6 * SECOND_US);
        check_always(&world, seed);
        check_recovered(&world, seed);
        let left = world
            .history
            .left
            .iter()
            .find(|(node, ..)| *node == 2)
            .unwrap();
        assert!(
            left.1 - (START_US + 2 * SECOND_US) < 300_000,
            "seed {seed}: left {left:?}"
        );
        assert_eq!(left.2, LeaveReason::Deadlines);
        // No frame of the others is later than one deadline and a period.
        let gaps = world
            .history
            .swaps
            .windows(2)
            .map(|pair| pair[1].swap.present_at_us - pair[0].swap.present_at_us);
        let longest_us = gaps.max().unwrap();
        assert!(
            longest_us <= DEADLINE_US + 17_000,
            "seed {seed}: {longest_us}"
        );
        // It is back within 200 ms of its restart.
        let back = world
            .history
            .presented
            .iter()
            .find(|record| record.node == 2 && record.at_us > START_US + 3 * SECOND_US);
        let back_us = back.unwrap().at_us - (START_US + 3 * SECOND_US);
        assert!(back_us < 200_000, "seed {seed}: back after {back_us}");
    }
}

#[test]
fn a_restart_before_the_link_is_known_dead_takes_the_old_place() {
    for seed in 0..100 {
        let mut world = VirtualWall::new(&wall(4), calm(4), seed);
        world.kill(1, 2 * SECOND_US);
        world.start(1, 2 * SECOND_US + 50_000);
        world.run_until(5 * SECOND_US);
        check_always(&world, seed);
        check_recovered(&world, seed);
        assert_eq!(world.membership.nodes()[1].joins, 2, "seed {seed}");
        let back =
            world.history.presented.iter().find(|record| {
                record.node == 1 && record.at_us > START_US + 2 * SECOND_US + 50_000
            });
        let back_us = back.unwrap().at_us - (START_US + 2 * SECOND_US);
        assert!(back_us < SECOND_US, "seed {seed}: back after {back_us}");
    }
}

#[test]
fn a_stall_of_everything_drops_nobody() {
    for seed in 0..100 {
        let mut world = VirtualWall::new(&wall(6), calm(6), seed);
        for node in 0..6 {
            world.stall(Some(node), 2 * SECOND_US, 400_000);
        }
        world.stall(None, 2 * SECOND_US, 400_000);
        world.run_until(4 * SECOND_US);
        check_always(&world, seed);
        check_recovered(&world, seed);
        assert!(
            world.history.left.is_empty(),
            "seed {seed}: {:?}",
            world.history.left
        );
    }
}

#[test]
fn a_stall_of_the_master_drops_nobody() {
    for seed in 0..100 {
        let mut world = VirtualWall::new(&wall(4), calm(4), seed);
        world.stall(None, 2 * SECOND_US + seed as i64 * 331, 300_000);
        world.run_until(3 * SECOND_US);
        check_always(&world, seed);
        assert!(
            world.history.left.is_empty(),
            "seed {seed}: {:?}",
            world.history.left
        );
        assert!(
            world.history.missed.is_empty(),
            "seed {seed}: {:?}",
            world.history.missed
        );
    }
}

#[test]
fn frames_heavy_for_everybody_are_late_for_nobody() {
    let mut conditions = calm(4);
    conditions.draw_us = (250_000, 300_000);
    let mut world = VirtualWall::new(&wall(4), conditions, 3);
    world.run_until(6 * SECOND_US);
    check_always(&world, 3);
    let missed = world.history.missed.len();
    assert!(missed == 0, "{missed}");
    assert_eq!(world.barrier.members().count(), 4);
    assert!(
        world.history.swaps.len() >= 15,
        "{}",
        world.history.swaps.len()
    );
}

#[test]
fn what_must_hold_holds_in_thousands_of_bad_worlds() {
    let walls: Vec<Wall> = (0..=8).map(|nodes| wall(nodes.max(1))).collect();
    let mut frames = 0;
    let mut leaves = 0;
    for seed in 0..SEEDS {
        let mut random = Random(seed ^ 0xABCD_EF01);
        let nodes = random.within(1, 9) as usize;
        let conditions = Conditions {
            nodes,
            fps: 60.0,
            loss: random.share() * random.share() * 0.3,
            delay_us: random.within(30, 2_000),
            jitter_us: random.share() * random.share() * 4_000.0,
            draw_us: (500, random.within(1_000, 20_000)),
            hiccups: if seed % 2 == 0 {
                0.0
            } else {
                random.share() * random.share() * 0.05
            },
        };
        let mut world = VirtualWall::new(&walls[nodes], conditions, seed);
        for _ in 0..random.within(0, 6) {
            let node = random.within(0, nodes as i64) as usize;
            let at_us = random.within(0, 2_000_000);
            match random.within(0, 4) {
                0 => {
                    world.kill(node, at_us);
                    world.start(node, at_us + random.within(1_000, 1_500_000));
                }
                1 => world.stall(Some(node), at_us, random.within(1_000, 700_000)),
                2 => world.stall(None, at_us, random.within(1_000, 400_000)),
                _ => world.kill(node, at_us),
            }
        }
        world.run_until(3_600_000);
        // Progress: whatever happened, frames went on while any node lived.
        let before = world.barrier.frame();
        world.run_until(5_200_000);
        assert!(
            world.barrier.frame() > before + 5,
            "seed {seed}: stuck at frame {before}"
        );
        check_always(&world, seed);
        for node in world.barrier.members() {
            assert!(
                world.alive().any(|alive| alive == node),
                "seed {seed}: waits for the dead"
            );
        }
        if conditions.loss < 0.03 && conditions.hiccups == 0.0 {
            check_recovered(&world, seed);
        }
        frames += world.history.swaps.len();
        leaves += world.history.left.len();
    }
    assert!(
        frames > 200_000 && leaves > 1_000,
        "{frames} frames, {leaves} leaves"
    );
}
