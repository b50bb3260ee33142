//! Changes of the scene, move by move; and thousands of schedules in virtual time, in which nodes come and
//! go, answer late, refuse or never answer (`change/`).
//! In: submissions and answers. Out: failed tests.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

#[path = "change/model.rs"]
mod model;
#[path = "change/schedules.rs"]
mod schedules;
#[path = "change/world.rs"]
mod world;

use std::collections::BTreeSet;

use protocol::change::ChangeAction::{Refused, Send, Show, Superseded};
use protocol::change::{ChangeAction, Changes, PATIENCE_US};

fn nodes(nodes: impl IntoIterator<Item = usize>) -> BTreeSet<usize> {
    nodes.into_iter().collect()
}

fn show(revision: u64) -> ChangeAction {
    Show {
        revision,
        unprepared: Vec::new(),
    }
}

fn refused(revision: u64, node: usize) -> ChangeAction {
    Refused {
        revision,
        node,
        reason: "no such data".to_owned(),
    }
}

fn refuse(changes: &mut Changes, node: usize, revision: u64) -> Vec<ChangeAction> {
    changes.cannot_prepare(node, revision, "no such data".to_owned(), 0)
}

#[test]
fn a_change_is_shown_once_every_member_has_prepared_it() {
    let mut changes = Changes::new(1);
    assert_eq!((changes.shown(), changes.newest()), (1, 1));
    assert_eq!((changes.preparing(), changes.next_wake_us()), (None, None));
    let (revision, actions) = changes.submit(&nodes([0, 1, 2]), 5);
    assert_eq!((revision, actions), (2, vec![Send { revision: 2 }]));
    assert_eq!(changes.preparing(), Some(2));
    assert_eq!((changes.shown(), changes.newest()), (1, 2));
    assert_eq!(changes.prepared(2, 2, 10), []);
    assert_eq!(changes.prepared(0, 2, 11), []);
    // Twice, another revision, and a node that nobody waits for: none of it completes the set.
    assert_eq!(changes.prepared(0, 2, 12), []);
    assert_eq!(changes.prepared(1, 1, 13), []);
    assert_eq!(changes.prepared(1, 3, 13), []);
    assert_eq!(changes.prepared(9, 2, 14), []);
    assert_eq!(changes.prepared(1, 2, 15), [show(2)]);
    assert_eq!((changes.shown(), changes.newest()), (2, 2));
    assert_eq!((changes.preparing(), changes.next_wake_us()), (None, None));
    // What comes late changes nothing, not even a refusal.
    assert_eq!(changes.prepared(1, 2, 16), []);
    assert_eq!(refuse(&mut changes, 1, 2), []);
    assert_eq!(changes.shown(), 2);
}

#[test]
fn without_members_a_change_is_sent_and_shown_at_once() {
    let mut changes = Changes::new(7);
    let (revision, actions) = changes.submit(&nodes([]), 0);
    assert_eq!(
        (revision, actions),
        (8, vec![Send { revision: 8 }, show(8)])
    );
    // The last member goes, with a change in preparation and one queued: both are shown in their order.
    let all = nodes([0]);
    assert_eq!(changes.submit(&all, 1).1, [Send { revision: 9 }]);
    assert_eq!(changes.submit(&all, 2), (10, vec![]));
    assert_eq!(
        changes.members(&nodes([]), 3),
        [show(9), Send { revision: 10 }, show(10)]
    );
    assert_eq!((changes.shown(), changes.queued()), (10, None));
}

#[test]
fn of_many_changes_the_latest_goes_next() {
    let mut changes = Changes::new(1);
    let all = nodes([0, 1]);
    assert_eq!(changes.submit(&all, 0).1, [Send { revision: 2 }]);
    assert_eq!(changes.submit(&all, 1), (3, vec![]));
    for revision in 4..=60 {
        let overtaken = revision - 1;
        assert_eq!(
            changes.submit(&all, 1),
            (
                revision,
                vec![Superseded {
                    revision: overtaken
                }]
            )
        );
        assert_eq!(changes.newest(), revision);
    }
    assert_eq!(
        (changes.shown(), changes.preparing(), changes.queued()),
        (1, Some(2), Some(60))
    );
    assert_eq!(changes.prepared(0, 2, 2), []);
    assert_eq!(changes.prepared(1, 2, 3), [show(2), Send { revision: 60 }]);
    assert_eq!(changes.prepared(0, 60, 4), []);
    assert_eq!(changes.prepared(1, 60, 5), [show(60)]);
}

#[test]
fn patience_ends_two_seconds_after_the_sending() {
    let mut changes = Changes::new(1);
    let all = nodes([0, 1, 2]);
    let (_, actions) = changes.submit(&all, 1_000);
    assert_eq!(actions, [Send { revision: 2 }]);
    assert_eq!(changes.submit(&all, 900_000).0, 3);
    assert_eq!(changes.prepared(1, 2, 1_000_000), []);
    let over_us = 1_000 + PATIENCE_US;
    assert_eq!(changes.next_wake_us(), Some(over_us));
    assert_eq!(changes.tick(over_us - 1), []);
    // The queued one was submitted long ago, but has all of its own time before it.
    assert_eq!(
        changes.tick(over_us),
        [
            Show {
                revision: 2,
                unprepared: vec![0, 2]
            },
            Send { revision: 3 }
        ]
    );
    assert_eq!(changes.next_wake_us(), Some(over_us + PATIENCE_US));
    assert_eq!(changes.prepared(0, 2, over_us), []);
    assert_eq!(changes.tick(over_us + PATIENCE_US - 1), []);
}

#[test]
fn a_master_that_was_held_up_reads_its_messages_before_it_loses_patience() {
    let mut changes = Changes::new(1);
    let all = nodes([0, 1]);
    assert_eq!(changes.submit(&all, 0).1.len(), 1);
    let late_us = 3 * PATIENCE_US;
    assert_eq!(changes.prepared(0, 2, late_us), []);
    assert_eq!(changes.members(&all, late_us), []);
    assert_eq!(changes.submit(&all, late_us), (3, vec![]));
    assert_eq!(
        changes.prepared(1, 2, late_us),
        [show(2), Send { revision: 3 }]
    );
}

#[test]
fn who_leaves_is_not_waited_for_and_who_enters_is() {
    let mut changes = Changes::new(1);
    assert_eq!(changes.submit(&nodes([0, 1]), 0).1.len(), 1);
    assert_eq!(changes.prepared(0, 2, 1), []);
    // A node that is not yet a member prepares, and another enters without.
    assert_eq!(changes.prepared(2, 2, 2), []);
    assert_eq!(changes.members(&nodes([0, 1, 2, 3]), 3), []);
    assert_eq!(changes.members(&nodes([0, 2, 3]), 4), []);
    assert_eq!(changes.members(&nodes([0, 2]), 5), [show(2)]);
    // The members that a submission brings count as well.
    assert_eq!(changes.submit(&nodes([0, 1]), 6).1.len(), 1);
    assert_eq!(changes.prepared(0, 3, 7), []);
    assert_eq!(
        changes.submit(&nodes([0]), 8),
        (4, vec![show(3), Send { revision: 4 }])
    );
}

#[test]
fn what_a_node_had_prepared_is_lost_with_its_link_but_not_with_its_membership() {
    let mut changes = Changes::new(1);
    let all = nodes([0, 1]);
    assert_eq!(changes.submit(&all, 0).1.len(), 1);
    assert_eq!(changes.prepared(0, 2, 1), []);
    assert_eq!(changes.members(&nodes([1]), 2), []);
    assert_eq!(changes.members(&all, 3), []);
    assert_eq!(changes.prepared(1, 2, 4), [show(2)]);

    assert_eq!(changes.submit(&all, 5).1.len(), 1);
    assert_eq!(changes.prepared(0, 3, 6), []);
    changes.disconnected(0);
    assert_eq!(changes.members(&nodes([1]), 7), []);
    assert_eq!(changes.members(&all, 8), []);
    assert_eq!(changes.prepared(1, 3, 9), []);
    assert_eq!(changes.prepared(0, 3, 10), [show(3)]);
    // Nothing is in preparation: nothing is lost.
    changes.disconnected(0);
    assert_eq!(changes.shown(), 3);
}

#[test]
fn a_refused_change_is_never_shown_and_the_queued_one_goes_next() {
    let mut changes = Changes::new(1);
    let all = nodes([0, 1]);
    assert_eq!(changes.submit(&all, 0).1.len(), 1);
    assert_eq!(changes.prepared(0, 2, 1), []);
    assert_eq!(refuse(&mut changes, 1, 2), [refused(2, 1)]);
    // What can still be shown is the scene before: the next change is made on that, under a new number.
    assert_eq!((changes.shown(), changes.newest()), (1, 1));
    assert_eq!(changes.preparing(), None);
    assert_eq!(changes.submit(&all, 2), (3, vec![Send { revision: 3 }]));

    // A change that was made on the refused one is tried, since it may have set things right, …
    assert_eq!(changes.submit(&all, 3), (4, vec![]));
    assert_eq!(
        refuse(&mut changes, 0, 3),
        [refused(3, 0), Send { revision: 4 }]
    );
    assert_eq!((changes.shown(), changes.newest()), (1, 4));
    // … and is refused in its turn if it has not.
    assert_eq!(refuse(&mut changes, 0, 4), [refused(4, 0)]);
    assert_eq!((changes.shown(), changes.newest()), (1, 1));
    assert_eq!(changes.submit(&all, 4), (5, vec![Send { revision: 5 }]));
    // Whoever refuses what was refused long ago, refuses nothing.
    assert_eq!(refuse(&mut changes, 0, 4), []);
    assert_eq!(changes.prepared(0, 5, 5), []);
    assert_eq!(changes.prepared(1, 5, 6), [show(5)]);
}

#[test]
fn a_node_that_is_no_member_cannot_hold_the_wall_up() {
    let mut changes = Changes::new(1);
    assert_eq!(changes.submit(&nodes([0, 1]), 0).1.len(), 1);
    assert_eq!(refuse(&mut changes, 2, 2), []);
    assert_eq!(changes.prepared(0, 2, 1), []);
    assert_eq!(changes.prepared(1, 2, 2), [show(2)]);

    // But if it becomes one while the revision is in preparation, the wall could not show it.
    assert_eq!(changes.submit(&nodes([0, 1]), 3).1.len(), 1);
    assert_eq!(refuse(&mut changes, 2, 3), []);
    assert_eq!(changes.prepared(0, 3, 4), []);
    assert_eq!(changes.members(&nodes([0, 1, 2]), 5), [refused(3, 2)]);

    // Its refusal goes with its link, and it may think better of it.
    assert_eq!(changes.submit(&nodes([0, 1]), 6).1.len(), 1);
    assert_eq!(refuse(&mut changes, 2, 4), []);
    changes.disconnected(2);
    assert_eq!(changes.members(&nodes([0, 1, 2]), 7), []);
    assert_eq!(changes.members(&nodes([0, 1]), 8), []);
    assert_eq!(refuse(&mut changes, 2, 4), []);
    assert_eq!(changes.prepared(2, 4, 9), []);
    assert_eq!(changes.members(&nodes([2]), 10), [show(4)]);
}

#[test]
fn times_at_the_ends_of_the_clock_break_nothing() {
    let mut changes = Changes::new(1);
    let all = nodes([0]);
    assert_eq!(changes.submit(&all, i64::MAX).1.len(), 1);
    assert_eq!(changes.next_wake_us(), Some(i64::MAX));
    assert_eq!(changes.tick(i64::MIN), []);
    assert_eq!(changes.tick(i64::MAX).len(), 1);
    assert_eq!(changes.submit(&all, i64::MIN).1.len(), 1);
    assert_eq!(changes.next_wake_us(), Some(i64::MIN + PATIENCE_US));
}
