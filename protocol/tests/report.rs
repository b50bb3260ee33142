//! Reports: the keys that other tools read, skew per frame, late and missing reports, bounded memory;
//! and captured pictures.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

#[path = "report/changes.rs"]
mod changes;
#[path = "report/error.rs"]
mod error;

use protocol::capture::{CaptureAssembly, CaptureError, MAX_ROW_BYTES, split_rows};
use protocol::membership::Membership;
use protocol::message::{
    CacheLevel, Drawable, ErrorMeasured, Hello, PROTOCOL_VERSION, Presented, TileCounters, TileNews,
};
use protocol::report::{Recorder, Report};
use protocol::wall::Wall;

fn wall() -> Wall {
    Wall::parse(include_str!("../../configs/walls/demo-2x2.toml"), "demo").unwrap()
}

fn membership() -> Membership {
    let mut members = Membership::new(&wall(), 1, "0.1.0");
    for host in &wall().hosts {
        let hello = Hello {
            protocol_version: PROTOCOL_VERSION,
            program_version: "0.1.0".to_owned(),
            session: 1,
            node: host.name.clone(),
            adapter: "llvmpipe".to_owned(),
            process_id: 1,
        };
        let node = members.hello(&hello, 0).unwrap().seat.node;
        members.entered(node);
        members.presented(node, 120_000);
    }
    members
}

fn presented(frame: u64, presented_us: i64) -> Presented {
    Presented {
        epoch: 1,
        frame,
        presented_us,
        clock_error_us: 30,
        view_latency_us: 400,
        view_to_present_us: 9_000,
        swap_slack_us: 900,
        draw_us: 5_000,
        redrawn: true,
        triangles: 1234,
        converged: true,
        refined_leaves: 3,
        achieved_tau_px: 0.5,
        achieved_tile_px: 363.5,
    }
}

/// Numbers within the three digits that histograms keep.
fn near(value: f64, expected: f64) -> bool {
    (value - expected).abs() <= expected * 0.002 + 0.001
}

#[test]
fn the_report_has_the_keys_that_tools_read() {
    let mut recorder = Recorder::new(&wall());
    recorder.view(210);
    recorder.scene(999);
    // Frame 7 is presented from 140,000 to 140,300 µs.
    for revision in 2..=5 {
        recorder.change_submitted(revision, 90_000 + revision as i64 * 10_000);
    }
    recorder.change_shown(2, 7, 1, 120_000);
    recorder.change_superseded(3);
    recorder.change_refused(5);
    recorder.change_shown(4, 7, 0, 130_000);
    for frame in 1..=100_u64 {
        for node in 0..4 {
            recorder.presented(
                node,
                &presented(frame, frame as i64 * 20_000 + node as i64 * 100),
            );
        }
    }
    let counters = TileCounters {
        distinct: 3,
        repository_reads: 2,
        disk_hits: 5,
        ram_hits: 7,
        vain_bytes: 5,
        ..TileCounters::default()
    };
    let news = |loaded: &[u64], after_us| TileNews {
        loaded: loaded.to_vec(),
        used: vec![3],
        drawable: vec![Drawable {
            level: CacheLevel::Disk,
            after_us,
        }],
    };
    recorder.counters(0, counters, &news(&[1, 2, 3], 20_000));
    recorder.counters(1, counters, &news(&[3, 4], 20_000));
    recorder.error("a node was killed");
    recorder.tau(0.5);
    for (max_px, samples) in [(0.125, 100), (0.375, 50)] {
        recorder.error_measured(&ErrorMeasured {
            max_px,
            samples,
            uncovered: 0,
            tau_px: 0.5,
        });
    }
    let report = recorder.report(&membership());
    let json: serde_json::Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
    assert_eq!(json["frames"], 100);
    assert!(near(json["fps"].as_f64().unwrap(), 50.0));
    for (path, expected) in [
        ("/frame_ms/p50", 20.0),
        ("/frame_ms/p99", 20.0),
        ("/skew_us/p50", 300.0),
        ("/skew_us/p99", 300.0),
        ("/skew_us/max", 300.0),
        ("/view_bytes/max", 210.0),
        ("/scene_bytes", 999.0),
        ("/state_latency_us/p50", 400.0),
        ("/state_latency_us/p99", 400.0),
        ("/view_to_present_us/p50", 9_000.0),
        ("/clock_error_us/max", 30.0),
        ("/tiles/distinct", 4.0),
        ("/tiles/repository_reads", 4.0),
        ("/tiles/disk_hits", 10.0),
        ("/tiles/ram_hits", 14.0),
        ("/tiles/shown", 1.0),
        ("/tiles/vain_bytes", 10.0),
        ("/tiles/drawable_after_ms/disk/p50", 20.0),
        ("/tiles/drawable_after_ms/ram/max", 0.0),
        ("/missed_deadlines", 0.0),
        ("/changes/submitted", 4.0),
        ("/changes/shown", 2.0),
        ("/changes/superseded", 1.0),
        ("/changes/refused", 1.0),
        ("/changes/unprepared", 1.0),
        ("/changes/unconverged", 0.0),
        ("/changes/to_shown_us/p50", 10_300.0),
        ("/changes/to_shown_us/p99", 30_300.0),
        ("/changes/to_shown_us/max", 30_300.0),
        ("/changes/to_converged_us/p50", 10_300.0),
        ("/changes/to_converged_us/p99", 30_300.0),
        ("/changes/to_converged_us/max", 30_300.0),
        ("/error_px/tau", 0.5),
        ("/error_px/measured_max", 0.375),
        ("/error_px/samples", 150.0),
        ("/error_px/uncovered", 0.0),
        ("/error_px/views", 2.0),
        ("/achieved_tau", 0.5),
        ("/achieved_tile_px", 363.5),
        ("/refined_leaves", 1_200.0),
        ("/triangles/max", 1_234.0),
        ("/nodes/3/frames", 1.0),
        ("/nodes/3/missed_deadlines", 0.0),
        ("/nodes/3/joins", 1.0),
        ("/nodes/3/join_ms", 120.0),
        ("/nodes/3/draw_ms/p50", 5.0),
    ] {
        let value = json.pointer(path).unwrap_or_else(|| panic!("no {path}"));
        assert!(near(value.as_f64().unwrap(), expected), "{path} is {value}");
    }
    assert_eq!(json["converged"], true);
    assert_eq!(json["nodes"].as_array().unwrap().len(), 4);
    assert_eq!(json["nodes"][2]["name"], "left-bottom");
    assert_eq!(json["nodes"][2]["adapter"], "llvmpipe");
    assert_eq!(json["errors"][0], "a node was killed");
    assert_eq!(json["series"]["skew_us"].as_array().unwrap().len(), 99);
    let back: Report = serde_json::from_value(json).unwrap();
    assert_eq!(back, report);
}

#[test]
fn reports_that_are_late_missing_or_mixed_up_are_put_in_their_frames() {
    let mut recorder = Recorder::new(&wall());
    // Nodes 0 and 1 in order, node 2 a hundred frames late, node 3 never; frame 50 only by node 0.
    for frame in 1..=400_u64 {
        let moment_us = frame as i64 * 10_000;
        recorder.presented(0, &presented(frame, moment_us));
        if frame != 50 {
            recorder.presented(1, &presented(frame, moment_us + 70));
        }
        if frame > 100 && frame != 150 {
            recorder.presented(2, &presented(frame - 100, moment_us - 1_000_000 - 30));
        }
    }
    let report = recorder.report(&membership());
    assert_eq!(report.frames, 400);
    assert!(near(report.skew_us.p50, 100.0), "{:?}", report.skew_us);
    assert!(near(report.skew_us.max, 100.0), "{:?}", report.skew_us);
    // Frame 50 had one node and no skew.
    assert_eq!(report.series.skew_us[48], 0.0);
    assert!(!report.converged);
}

#[test]
fn long_runs_are_thinned_out_and_keep_their_peaks() {
    let mut recorder = Recorder::new(&wall());
    let frames = 100_000_u64;
    for frame in 1..=frames {
        let moment_us = frame as i64 * 16_667;
        recorder.presented(0, &presented(frame, moment_us));
        let skew_us = if frame == 77_777 { 9_000 } else { 50 };
        recorder.presented(1, &presented(frame, moment_us + skew_us));
    }
    let report = recorder.report(&membership());
    assert_eq!(report.frames, frames);
    assert!(report.series.skew_us.len() <= 16_384 && report.series.stride >= 8);
    let covered = report.series.skew_us.len() as u64 * report.series.stride;
    assert!(
        (frames - 1..frames + report.series.stride).contains(&covered),
        "{covered}"
    );
    assert_eq!(
        report.series.skew_us.iter().copied().fold(0.0, f32::max),
        9_000.0
    );
    assert!(near(report.skew_us.max, 9_000.0));
    assert!(near(report.skew_us.p99, 50.0));
}

#[test]
fn a_restart_forgets_measurements_and_a_hostile_node_breaks_nothing() {
    let mut recorder = Recorder::new(&wall());
    recorder.presented(0, &presented(1, 0));
    recorder.presented(1, &presented(1, 1_000_000));
    recorder.restart();
    recorder.presented(2, &presented(1, 5));
    recorder.presented(99, &presented(2, 5));
    for (frame, moment_us) in [(5, i64::MAX), (6, i64::MIN), (u64::MAX - 1, 0), (7, 3)] {
        recorder.presented(0, &presented(frame, moment_us));
        recorder.presented(1, &presented(frame, moment_us));
    }
    for _ in 0..1000 {
        recorder.error("again");
    }
    let report = recorder.report(&membership());
    assert_eq!(report.frames, 4);
    assert_eq!(report.skew_us.max, 0.0);
    assert_eq!(report.errors.len(), 100);
    report.to_json().unwrap();
}

#[test]
fn pictures_survive_being_cut_and_put_together() {
    let host = &wall().hosts[0];
    let picture: Vec<u8> = (0..640 * 360 * 4)
        .map(|index| (index % 251) as u8)
        .collect();
    let rows: Vec<_> = split_rows(3, 0, 640, &picture).collect();
    assert!(rows.len() > 1 && rows.iter().all(|rows| rows.rgba.len() <= MAX_ROW_BYTES));
    let mut assembly = CaptureAssembly::new(3, host);
    for rows in &rows {
        assembly.add(rows).unwrap();
    }
    // More than the picture holds is refused.
    assert!(matches!(
        assembly.add(&rows[0]),
        Err(CaptureError::Misplaced { .. })
    ));
    let pictures = assembly.finish().unwrap();
    assert_eq!((pictures[0].width, pictures[0].height), (640, 360));
    assert_eq!(pictures[0].rgba, picture);

    let mut assembly = CaptureAssembly::new(3, host);
    let mut other = rows[0].clone();
    other.id = 4;
    assert!(matches!(
        assembly.add(&other),
        Err(CaptureError::OtherCapture { .. })
    ));
    other.id = 3;
    other.output = 1;
    assert!(matches!(
        assembly.add(&other),
        Err(CaptureError::UnknownOutput { .. })
    ));
    assert!(matches!(
        assembly.add(&rows[1]),
        Err(CaptureError::Misplaced { .. })
    ));
    assembly.add(&rows[0]).unwrap();
    let error = assembly.finish().unwrap_err().to_string();
    assert!(
        error.contains("display") && error.contains("left-top"),
        "{error}"
    );
}
