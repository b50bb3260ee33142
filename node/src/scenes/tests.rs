//! The contract of [`Scenes`], case by case.
//! In: scenes and views by hand. Out: nothing; a broken promise panics. Random orders are in `orders`.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::indexing_slicing,
    reason = "a test that panics has failed"
)]

mod orders;

use super::*;

fn queue(revisions: impl IntoIterator<Item = (u64, i64)>) -> SceneQueue<u64> {
    let mut queue = SceneQueue::default();
    for (revision, at_us) in revisions {
        queue.push(revision, at_us, revision);
    }
    queue
}

#[test]
fn a_scene_is_held_back_until_the_one_before_is_shown_or_refused() {
    for refused in [false, true] {
        let mut scenes = Scenes::new();
        scenes.arrived(queue([(1, 0), (2, 5)]));
        assert_eq!(scenes.next_scene(), Some((1, 1)));
        scenes.taken(1);
        assert_eq!(scenes.next_scene(), None, "the first has not been shown");
        assert_eq!(scenes.view(1, 10), Verdict::Draw);
        assert_eq!(scenes.drawn(1, None), None);
        assert_eq!(scenes.next_scene(), Some((2, 2)));
        scenes.taken(2);
        assert_eq!(
            scenes.drawn(1, Some(2)),
            Some(ToMaster::Prepared { revision: 2 })
        );
        assert_eq!(scenes.drawn(1, Some(2)), None, "said once");
        // The next scene overtakes the view that shows the second, or that does not.
        scenes.arrived(queue([(3, 100)]));
        assert_eq!(scenes.view(1, 100), Verdict::Draw);
        assert_eq!(
            scenes.next_scene(),
            None,
            "the view was sent before the scene came"
        );
        if refused {
            assert_eq!(scenes.view(1, 101), Verdict::Draw);
        } else {
            assert_eq!(scenes.view(2, 101), Verdict::Draw);
            assert_eq!(scenes.next_scene(), None, "the second has not been shown");
            assert_eq!(scenes.drawn(2, None), None);
        }
        assert_eq!(scenes.next_scene(), Some((3, 3)));
    }
}

#[test]
fn refusals_of_what_the_wall_shows_are_faults_and_others_are_not() {
    let mut scenes = Scenes::new();
    scenes.arrived(queue([(7, 0), (8, 0)]));
    assert_eq!(scenes.next_scene(), Some((7, 7)));
    let fault = scenes.refused(7, "no repository");
    assert!(matches!(fault, ToMaster::Fault { message } if message == "no repository"));
    assert_eq!(scenes.view(7, 1), Verdict::Never(None), "the master knows");
    assert_eq!(scenes.next_scene(), Some((8, 8)));
    assert_eq!(
        scenes.refused(8, "no disk"),
        ToMaster::cannot_prepare(8, "no disk")
    );
    // The wall shows it all the same: this node was not waited for.
    let Verdict::Never(Some(ToMaster::Fault { message })) = scenes.view(8, 2) else {
        panic!("nobody is told");
    };
    assert!(
        message.contains("revision 8") && message.contains("no disk"),
        "{message}"
    );
    assert_eq!(scenes.view(8, 3), Verdict::Never(None));
    assert_eq!(scenes.view(9, 4), Verdict::Wait);
    scenes.arrived(queue([(9, 5)]));
    assert_eq!(scenes.next_scene(), Some((9, 9)));
    assert!(matches!(
        scenes.refused(9, "no luck"),
        ToMaster::Fault { .. }
    ));
}

#[test]
fn what_is_past_is_forgotten_and_what_is_old_is_not_drawn() {
    let mut scenes = Scenes::new();
    assert_eq!(scenes.view(4, 1), Verdict::Wait, "it overtook its scene");
    scenes.arrived(queue([(3, 2), (4, 2), (5, 2)]));
    assert_eq!(scenes.next_scene(), Some((4, 4)));
    scenes.taken(4);
    assert_eq!(scenes.view(4, 1), Verdict::Draw);
    assert_eq!(scenes.drawn(4, None), None);
    assert_eq!(scenes.view(3, 0), Verdict::Never(None));
    scenes.arrived(queue([(4, 9), (5, 9)]));
    assert_eq!(scenes.next_scene(), Some((5, 5)));
    scenes.taken(5);
    scenes.arrived(queue([(5, 10)]));
    assert_eq!(scenes.next_scene(), None, "the same revision again");
}

#[test]
fn a_flood_of_scenes_costs_neither_the_shown_one_nor_the_newest_nor_memory() {
    let mut flood = queue((1..=1_000).map(|revision| (revision, 0)));
    let mut kept = Vec::new();
    while let Some((revision, _)) = flood.pop() {
        kept.push(revision);
    }
    assert!(kept.len() <= 16, "{kept:?}");
    assert_eq!((kept.first(), kept.last()), (Some(&1), Some(&1_000)));

    // A revision that was left and is shown all the same is told, once.
    let mut scenes = Scenes::new();
    scenes.arrived(queue((1..=1_000).map(|revision| (revision, 0))));
    let verdict = scenes.view(500, 1);
    assert!(
        matches!(&verdict, Verdict::Never(Some(ToMaster::Fault { message })) if message.contains("500")),
        "{verdict:?}"
    );
    assert_eq!(scenes.view(500, 2), Verdict::Never(None));
    assert_eq!(scenes.next_scene(), Some((1_000, 1_000)));
}

#[test]
fn a_view_waits_for_a_scene_whose_data_is_being_opened() {
    let mut scenes = Scenes::new();
    scenes.arrived(queue([(1, 10)]));
    assert_eq!(scenes.next_scene(), Some((1, 1)));
    scenes.taken(1);
    scenes.drawn(1, None);
    scenes.arrived(queue([(2, 20)]));
    assert_eq!(scenes.next_scene(), Some((2, 2)));
    scenes.opens(2);
    assert_eq!(scenes.view(1, 25), Verdict::Draw, "the shown scene goes on");
    assert_eq!(scenes.view(2, 30), Verdict::Wait);
    scenes.taken(2);
    assert_eq!(scenes.view(2, 31), Verdict::Draw);
}
