//! The error of pictures in reports: measured numbers, or the word that there are none.
//! In: what nodes measure. Out: failed tests.

use protocol::message::{ErrorMeasured, Presented};
use protocol::report::{ErrorReport, Recorder, Report};

use super::{membership, presented, wall};

fn measured(max_px: f64, samples: u64, uncovered: u64) -> ErrorMeasured {
    ErrorMeasured {
        max_px,
        samples,
        uncovered,
        tau_px: 1.0,
    }
}

#[test]
fn what_was_not_measured_is_not_invented() {
    let mut recorder = Recorder::new(&wall());
    recorder.presented(0, &presented(1, 1_000));
    recorder.tau(2.0);
    let report = recorder.report(&membership());
    let json: serde_json::Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
    assert_eq!(json["error_px"]["views"], 0);
    assert_eq!(json["error_px"]["tau"], 2.0);
    assert!(json["error_px"]["measured_max"].is_null());
    assert!(!report.error_px.holds());

    // A picture without ground in view says nothing either.
    recorder.error_measured(&measured(0.0, 0, 0));
    let report = recorder.report(&membership());
    assert_eq!(
        (report.error_px.views, report.error_px.measured_max),
        (0, None)
    );

    // Reports from before these keys can be read.
    let mut old = json;
    for key in [
        "error_px",
        "achieved_tau",
        "achieved_tile_px",
        "refined_leaves",
        "triangles",
    ] {
        assert!(old.as_object_mut().unwrap().remove(key).is_some(), "{key}");
    }
    for key in [
        "early_bytes",
        "vain_bytes",
        "drawable_after_ms",
        "repository_bytes",
    ] {
        let tiles = old["tiles"].as_object_mut().unwrap();
        assert!(tiles.remove(key).is_some(), "{key}");
    }
    let old: Report = serde_json::from_value(old).unwrap();
    assert_eq!(old.error_px, ErrorReport::default());
}

#[test]
fn nodes_that_do_not_measure_are_named() {
    let mut recorder = Recorder::new(&wall());
    recorder.tau(1.0);
    recorder.error_measured(&measured(0.25, 10, 0));
    recorder.error_unmeasured(2, "it did not answer within 20 seconds");
    recorder.error_unmeasured(99, "there is no such node");
    let report = recorder.report(&membership());
    assert_eq!(report.error_px.unmeasured, ["left-bottom"]);
    assert_eq!(report.errors.len(), 1);
    assert!(
        report.errors[0].contains("left-bottom") && report.errors[0].contains("20 seconds"),
        "{}",
        report.errors[0]
    );
    // Another scene's pictures begin anew.
    recorder.tau(4.0);
    let report = recorder.report(&membership());
    assert_eq!(report.error_px, ErrorReport::new(4.0));
}

#[test]
fn the_bound_holds_only_where_all_samples_keep_it() {
    let of = |pictures: &[ErrorMeasured]| {
        let mut report = ErrorReport::new(1.0);
        pictures.iter().for_each(|picture| report.add(picture));
        report
    };
    assert!(of(&[measured(1.0, 1, 0), measured(0.0, 5, 0)]).holds());
    assert!(!of(&[measured(1.001, 1, 0), measured(0.0, 5, 0)]).holds());
    assert!(!of(&[measured(0.5, 1, 1)]).holds());
    assert!(!of(&[]).holds());
    let most = of(&[measured(0.1, u64::MAX, u64::MAX), measured(0.2, 7, 7)]);
    assert_eq!((most.samples, most.uncovered), (u64::MAX, u64::MAX));
}

#[test]
fn the_largest_tau_of_any_frame_is_told_and_none_where_none_was_kept() {
    let mut recorder = Recorder::new(&wall());
    let frame = |frame: u64, achieved_tau_px| Presented {
        achieved_tau_px,
        ..presented(frame, frame as i64 * 1_000)
    };
    recorder.presented(0, &frame(1, 8.0));
    recorder.restart();
    recorder.presented(0, &frame(2, 0.0));
    assert_eq!(recorder.report(&membership()).achieved_tau, None);
    recorder.presented(0, &frame(3, 3.0));
    recorder.presented(1, &frame(3, 1.0));
    let report = recorder.report(&membership());
    assert_eq!((report.achieved_tau, report.refined_leaves), (Some(3.0), 9));
}
