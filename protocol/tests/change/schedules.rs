//! What holds over thousands of schedules: at every step (checked by the world itself), and at the end.
//! In: seeds. Out: failed tests.

use protocol::change::PATIENCE_US;

use super::world::{Conditions, Fate, Random, Tallies, World};

const SECOND_US: i64 = 1_000_000;
/// Schedules of the worst test: enough for every rare meeting of faults, in a few seconds.
const SEEDS: u64 = 4_000;
/// Sixty submissions a second.
const SUBMISSION_US: i64 = 16_667;

fn calm(nodes: usize) -> Conditions {
    Conditions {
        nodes,
        delay_us: (50, 500),
        prepare_us: (5_000, 40_000),
        silent: 0.0,
        refusals: 0.0,
    }
}

/// Every submission has come to exactly one end, and the newest scene that could be shown is shown. (That
/// no revision comes to two ends is checked when it does.)
fn check_settled(world: &World, seed: u64) {
    for (revision, fate) in &world.fates {
        assert!(
            !matches!(fate, Fate::Waiting | Fate::InPreparation { .. }),
            "seed {seed}: {revision} is {fate:?}"
        );
    }
    assert_eq!(world.changes.preparing(), None, "seed {seed}");
    assert_eq!(world.changes.newest(), world.changes.shown(), "seed {seed}");
    // The very last submission is never overtaken.
    let (last, fate) = world.fates.last_key_value().unwrap();
    match fate {
        Fate::Shown { .. } => assert_eq!(world.changes.shown(), *last, "seed {seed}"),
        fate => assert_eq!(*fate, Fate::Refused, "seed {seed}: {last}"),
    }
}

#[test]
fn a_calm_wall_follows_sixty_changes_a_second() {
    for seed in 0..200 {
        let mut world = World::new(calm(4), seed);
        for node in 0..4 {
            world.start(node, 0, 1_000);
        }
        world.run_until(2_000);
        let submissions = 600;
        for number in 0..submissions {
            world.submit(10_000 + number * SUBMISSION_US);
        }
        let last_us = 10_000 + (submissions - 1) * SUBMISSION_US;
        world.run_until(last_us + SECOND_US);
        check_settled(&world, seed);
        let tallies = world.tallies;
        assert_eq!(
            tallies.shown + tallies.superseded,
            submissions as u64,
            "seed {seed}: {tallies:?}"
        );
        // Preparing takes at most 41 ms, so in ten seconds at least two hundred are shown, and the last
        // no later than after one whole preparation before its own.
        assert!(tallies.shown >= 200, "seed {seed}: {tallies:?}");
        assert_eq!(tallies.unprepared, 0, "seed {seed}");
        let (_, fate) = world.fates.last_key_value().unwrap();
        assert!(
            matches!(fate, Fate::Shown { at_us } if *at_us <= last_us + 2 * 41_000),
            "seed {seed}: {fate:?}"
        );
    }
}

#[test]
fn one_node_that_never_answers_costs_patience_and_no_more() {
    for seed in 0..100 {
        let mut conditions = calm(3);
        conditions.silent = 1.0;
        let mut world = World::new(conditions, seed);
        for node in 0..3 {
            world.start(node, 0, 1_000);
        }
        world.run_until(2_000);
        // Two patiences and a half.
        let submissions = PATIENCE_US * 5 / 2 / SUBMISSION_US;
        for number in 0..submissions {
            world.submit(10_000 + number * SUBMISSION_US);
        }
        let last_us = 10_000 + (submissions - 1) * SUBMISSION_US;
        // At most one revision is in preparation before the last one.
        world.run_until(last_us + 2 * PATIENCE_US);
        check_settled(&world, seed);
        let tallies = world.tallies;
        assert_eq!(tallies.shown, tallies.unprepared, "seed {seed}");
        // One each patience: begun at 0, 1 and 2 of them, and the last.
        assert_eq!(tallies.shown, 4, "seed {seed}: {tallies:?}");
    }
}

fn wild(random: &mut Random, nodes: usize) -> Conditions {
    Conditions {
        nodes,
        delay_us: (30, random.within(60, 30_000)),
        prepare_us: (500, random.within(1_000, 900_000)),
        silent: if random.share() < 0.5 {
            0.0
        } else {
            random.share() * 0.3
        },
        refusals: if random.share() < 0.5 {
            0.0
        } else {
            random.share() * 0.2
        },
    }
}

#[test]
fn what_must_hold_holds_in_thousands_of_bad_worlds() {
    let mut sum = Tallies::default();
    let mut final_refusals = 0;
    for seed in 0..SEEDS {
        let mut random = Random(seed ^ 0x0DD5_EED5);
        let nodes = random.within(1, 9) as usize;
        let mut world = World::new(wild(&mut random, nodes), seed);
        for node in 0..nodes {
            let at_us = random.within(0, 500_000);
            world.start(node, at_us, random.within(0, 300_000));
        }
        for _ in 0..random.within(0, 8) {
            let node = random.within(0, nodes as i64) as usize;
            let at_us = random.within(0, 3 * SECOND_US);
            match random.within(0, 4) {
                0 => world.kill(node, at_us),
                1 => world.drop_out(node, at_us, random.within(1_000, SECOND_US)),
                _ => {
                    world.kill(node, at_us);
                    let back_us = at_us + random.within(1_000, SECOND_US);
                    world.start(node, back_us, random.within(0, 200_000));
                }
            }
        }
        // Bursts at sixty a second, with rests between them.
        let mut at_us = random.within(0, 200_000);
        let mut last_us = 0;
        for _ in 0..random.within(1, 4) {
            for _ in 0..random.within(1, 90) {
                world.submit(at_us);
                last_us = at_us;
                at_us += SUBMISSION_US;
            }
            at_us += random.within(0, SECOND_US);
        }
        world.run_until(last_us);
        // Whatever nodes do: patience with the one in preparation, then with the last one, and all is said.
        world.run_until(last_us + 2 * PATIENCE_US);
        check_settled(&world, seed);
        let (_, fate) = world.fates.last_key_value().unwrap();
        final_refusals += u64::from(*fate == Fate::Refused);

        // Once nodes answer, a new change is shown, whatever became of those before.
        world.set_conditions(calm(nodes));
        let again_us = 30 * SECOND_US;
        world.submit(again_us);
        world.run_until(again_us + SECOND_US);
        check_settled(&world, seed);
        let (last, fate) = world.fates.last_key_value().unwrap();
        assert!(
            matches!(fate, Fate::Shown { at_us } if *at_us <= again_us + 41_000),
            "seed {seed}: {last} is {fate:?}"
        );
        add(&mut sum, world.tallies);
    }
    // None of the cases above is missing.
    for (what, count, least) in [
        ("shown", sum.shown, 20_000),
        ("superseded", sum.superseded, 100_000),
        ("refused", sum.refused, 2_000),
        ("shown without all", sum.unprepared, 1_000),
        ("shown without members", sum.without_members, 1_000),
        ("shown because a member left", sum.by_leaving, 100),
        (
            "answers that were lost with their link",
            sum.answers_lost,
            100,
        ),
        ("bases that went back", sum.went_back, 100),
        ("last submissions that were refused", final_refusals, 50),
    ] {
        assert!(count >= least, "{what}: only {count} of {least}; {sum:?}");
    }
}

fn add(sum: &mut Tallies, tallies: Tallies) {
    sum.shown += tallies.shown;
    sum.superseded += tallies.superseded;
    sum.refused += tallies.refused;
    sum.unprepared += tallies.unprepared;
    sum.without_members += tallies.without_members;
    sum.by_leaving += tallies.by_leaving;
    sum.answers_lost += tallies.answers_lost;
    sum.went_back += tallies.went_back;
}
