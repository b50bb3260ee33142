//! Changes of the scene in the report: what became of them, and when they were on all of the wall.
//! In: decisions and presentations, late, missing or mixed up. Out: failed tests.

use protocol::barrier::NodeId;
use protocol::report::{ChangeReport, Recorder, Report};

use super::{membership, near, presented, wall};

const PERIOD_US: i64 = 10_000;

/// When the last node presents a frame.
fn moment_us(frame: u64) -> i64 {
    frame as i64 * PERIOD_US
}

/// Some nodes present a frame, one 10 µs after the other, the last at the frame's moment.
fn present(recorder: &mut Recorder, frame: u64, nodes: &[NodeId], converged: bool) {
    for (before, node) in nodes.iter().rev().enumerate() {
        let mut presented = presented(frame, moment_us(frame) - before as i64 * 10);
        presented.converged = converged;
        recorder.presented(*node, &presented);
    }
}

fn changes(recorder: &mut Recorder) -> ChangeReport {
    recorder.report(&membership()).changes
}

/// Submitted at the moment of frame 10, shown from frame 12 on.
fn changed() -> Recorder {
    let mut recorder = Recorder::new(&wall());
    recorder.change_submitted(2, moment_us(10));
    recorder.change_shown(2, 12, 0, moment_us(11));
    recorder
}

#[test]
fn a_change_counts_as_shown_when_all_nodes_presented_it_and_as_converged_when_nothing_was_missing()
{
    let mut recorder = changed();
    for frame in 1..=40 {
        // Frame 12 lacks a node; 13 is the first of all nodes, but only 15 lacks nothing anywhere.
        let nodes: &[NodeId] = if frame == 12 {
            &[0, 1, 3]
        } else {
            &[0, 1, 2, 3]
        };
        let converged = frame <= 12 || frame >= 15;
        present(&mut recorder, frame, nodes, converged);
        if frame == 14 {
            // One node alone has converged.
            recorder.presented(2, &presented(14, moment_us(14)));
        }
    }
    let report = changes(&mut recorder);
    assert_eq!((report.submitted, report.shown), (1, 1));
    assert_eq!((report.unprepared, report.unconverged), (0, 0));
    assert!(near(report.to_shown_us.max, 30_000.0), "{report:?}");
    assert!(near(report.to_converged_us.max, 50_000.0), "{report:?}");
}

#[test]
fn reports_in_any_order_give_the_same() {
    let mut recorder = changed();
    // Node 2 reports a hundred frames late, node 3 backwards in blocks of fifty.
    for frame in 1..=400_u64 {
        present(&mut recorder, frame, &[0, 1], true);
        if frame > 100 {
            present(&mut recorder, frame - 100, &[2], true);
        }
        if frame % 50 == 0 {
            for back in 0..50 {
                present(&mut recorder, frame - back, &[3], true);
            }
        }
    }
    let report = changes(&mut recorder);
    assert!(near(report.to_shown_us.max, 20_000.0), "{report:?}");
    assert!(near(report.to_converged_us.max, 20_000.0), "{report:?}");
}

#[test]
fn changes_that_overtake_each_other_converge_together() {
    let mut recorder = Recorder::new(&wall());
    let all = [0, 1, 2, 3];
    for frame in 1..=30 {
        if frame <= 10 {
            recorder.change_submitted(frame + 1, moment_us(frame));
            recorder.change_shown(
                frame + 1,
                frame + 1,
                usize::from(frame == 3),
                moment_us(frame),
            );
        }
        present(&mut recorder, frame, &all, frame >= 20);
    }
    let report = changes(&mut recorder);
    assert_eq!(
        (report.submitted, report.shown, report.unprepared),
        (10, 10, 1)
    );
    assert_eq!(report.unconverged, 0);
    // Each is on the wall one frame after its submission; all have converged with frame 20.
    assert!(near(report.to_shown_us.p50, 10_000.0), "{report:?}");
    assert!(near(report.to_shown_us.max, 10_000.0), "{report:?}");
    assert!(near(report.to_converged_us.p50, 140_000.0), "{report:?}");
    assert!(near(report.to_converged_us.max, 190_000.0), "{report:?}");
}

#[test]
fn what_has_not_converged_is_told() {
    let mut recorder = changed();
    for frame in 1..=30 {
        present(&mut recorder, frame, &[0, 1, 2, 3], frame < 12);
    }
    let report = changes(&mut recorder);
    assert_eq!((report.shown, report.unconverged), (1, 1));
    assert!(near(report.to_shown_us.max, 20_000.0), "{report:?}");
    assert!(near(report.to_converged_us.max, 0.0), "{report:?}");
    // A change whose frame nobody has presented was neither seen nor has it converged.
    let mut recorder = changed();
    let report = changes(&mut recorder);
    assert_eq!((report.shown, report.unconverged), (1, 1));
    assert!(near(report.to_shown_us.max, 0.0), "{report:?}");
}

#[test]
fn the_last_frames_of_a_run_wait_for_the_reports_of_all_nodes() {
    // The run ends before node 3 has reported frame 12: it may not be there yet.
    let mut recorder = changed();
    for frame in 1..=12 {
        present(&mut recorder, frame, &[0, 1, 2], true);
    }
    for frame in 1..=11 {
        present(&mut recorder, frame, &[3], true);
    }
    let report = changes(&mut recorder);
    assert_eq!(report.unconverged, 1);
    assert!(near(report.to_shown_us.max, 0.0), "{report:?}");
}

#[test]
fn a_node_that_is_gone_is_not_waited_for_and_one_that_comes_is_from_its_first_frame_on() {
    let mut recorder = changed();
    recorder.change_submitted(3, moment_us(299));
    recorder.change_shown(3, 300, 0, moment_us(299));
    recorder.change_submitted(4, moment_us(499));
    recorder.change_shown(4, 500, 0, moment_us(499));
    for frame in 1..=1_000 {
        let mut nodes = vec![0, 1];
        // Node 2 is killed before the first change, node 3 arrives after it and skips frames 500 to 503.
        if frame < 10 {
            nodes.push(2);
        }
        if frame > 100 && !(500..=503).contains(&frame) {
            nodes.push(3);
        }
        present(&mut recorder, frame, &nodes, true);
    }
    let report = changes(&mut recorder);
    assert_eq!((report.shown, report.unconverged), (3, 0));
    // 12 − 10, 300 − 299 and 504 − 499 frames.
    assert!(near(report.to_shown_us.p50, 20_000.0), "{report:?}");
    assert!(near(report.to_shown_us.max, 50_000.0), "{report:?}");
}

#[test]
fn a_picture_is_not_seen_before_it_was_decided_on() {
    let mut recorder = Recorder::new(&wall());
    recorder.change_submitted(2, 1_000_000);
    recorder.change_shown(2, 12, 0, 1_004_000);
    // The nodes' clocks are wrong, or they lie.
    for frame in 1..=20 {
        present(&mut recorder, frame, &[0, 1, 2, 3], true);
    }
    let report = changes(&mut recorder);
    assert!(near(report.to_shown_us.max, 4_000.0), "{report:?}");
}

#[test]
fn only_what_was_submitted_counts_and_only_once() {
    let mut recorder = Recorder::new(&wall());
    // Before the measurement begins: nothing of it counts.
    recorder.change_submitted(2, 0);
    recorder.change_submitted(3, 0);
    recorder.change_shown(2, 1, 1, 0);
    recorder.restart();
    recorder.change_shown(3, 1, 1, 0);
    recorder.change_refused(2);
    recorder.change_superseded(99);
    assert_eq!(changes(&mut recorder), ChangeReport::default());
    recorder.change_submitted(4, 0);
    recorder.change_refused(4);
    recorder.change_refused(4);
    recorder.change_superseded(4);
    recorder.change_shown(4, 1, 1, 0);
    recorder.change_submitted(5, 0);
    recorder.change_superseded(5);
    recorder.change_superseded(5);
    recorder.change_submitted(6, 0);
    let report = changes(&mut recorder);
    assert_eq!((report.submitted, report.shown), (3, 0));
    assert_eq!((report.refused, report.superseded), (1, 1));
}

#[test]
fn hostile_numbers_and_endless_runs_break_nothing() {
    let mut recorder = Recorder::new(&wall());
    for (revision, frame, now_us) in [
        (0, u64::MAX, i64::MAX),
        (u64::MAX, 0, i64::MIN),
        (7, 5, i64::MIN),
    ] {
        recorder.change_submitted(revision, now_us);
        recorder.change_shown(revision, frame, usize::MAX, now_us.saturating_neg());
    }
    for frame in [0, 5, u64::MAX] {
        for (node, presented_us) in [(0, i64::MIN), (1, i64::MAX), (99, 0)] {
            recorder.presented(node, &presented(frame, presented_us));
        }
    }
    assert_eq!(changes(&mut recorder).shown, 3);
    // A day of changes that are decided by nobody, and of changes that nobody presents.
    for revision in 10..200_000 {
        recorder.change_submitted(revision, 0);
    }
    for revision in 200_000..400_000 {
        recorder.change_submitted(revision, 0);
        recorder.change_shown(revision, revision, 0, 0);
    }
    let report = changes(&mut recorder);
    assert_eq!(report.submitted, 3 + 399_990);
    assert_eq!(report.shown, 3 + 200_000);
    recorder.report(&membership()).to_json().unwrap();
}

#[test]
fn missed_deadlines_are_added_up_and_older_reports_can_be_read() {
    let mut members = membership();
    for (node, misses) in [(0, 2), (3, 5)] {
        for _ in 0..misses {
            members.missed(node);
        }
    }
    let report = Recorder::new(&wall()).report(&members);
    assert_eq!(report.missed_deadlines, 7);
    let mut json: serde_json::Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
    let keys = json.as_object_mut().unwrap();
    assert!(keys.remove("missed_deadlines").is_some() && keys.remove("changes").is_some());
    let older: Report = serde_json::from_value(json).unwrap();
    assert_eq!(older.missed_deadlines, 0);
    assert_eq!(older.changes, ChangeReport::default());
}
