//! The error of the last picture: measured by nodes when no frame follows, and told in the report.
//! In: walls of processes, some of which are slow, unable or gone. Out: failed tests.

use std::time::{Duration, Instant};

use master::{Master, Notice};

use super::{identity, machine, options};
use crate::support::{Nodes, wait_for, wall};

#[test]
fn every_node_measures_its_last_picture() {
    let _machine = machine();
    let identity = identity();
    let mut options = options(wall(4, 60.0), identity.path());
    options.frames = Some(10);
    options.measure_error = true;
    let mut scene = options.scene.clone();
    scene.mesh.tau = 2.0;
    options.scene = scene;
    let master = Master::start(options).unwrap();
    let mut nodes = Nodes::new(master.address(), identity.path());
    nodes.start_all(4);
    let report = master.finish().unwrap().report;
    let error = &report.error_px;
    assert_eq!((error.tau, error.measured_max), (2.0, Some(0.625)));
    assert_eq!((error.samples, error.uncovered), (400, 0));
    assert_eq!((error.views, error.unmeasured.len()), (4, 0));
    assert!(error.holds() && report.errors.is_empty());
    assert_eq!(report.achieved_tau, Some(1.0));
    assert_eq!(report.triangles.max, 1);
    assert!(report.refined_leaves > 0);
}

#[test]
fn nodes_that_cannot_measure_are_named_and_hold_nobody_up() {
    let _machine = machine();
    let identity = identity();
    let mut options = options(wall(5, 60.0), identity.path());
    options.measure_error = true;
    options.measure_timeout = Duration::from_millis(3_500);
    let master = Master::start(options).unwrap();
    let mut nodes = Nodes::new(master.address(), identity.path());
    for (name, measure_ms) in [
        ("node0", 0),
        ("node1", u64::MAX),
        ("node2", 1_800),
        ("node3", 600_000),
        ("node4", 600_000),
    ] {
        nodes.drawing.measure_ms = measure_ms;
        nodes.start(name);
    }
    crate::support::wait_for_start(&master);
    std::thread::sleep(Duration::from_millis(500));
    let stopped = Instant::now();
    master.stop();
    // It takes more than a second, so people are told.
    let waits_for = wait_for(&master, 5, |notice| match notice {
        Notice::Measuring { waits_for } => Some(waits_for.clone()),
        _ => None,
    });
    assert_eq!(waits_for, ["node2", "node3", "node4"]);
    nodes.kill("node4");
    let report = master.finish().unwrap().report;
    let took = stopped.elapsed();
    assert!(took < Duration::from_millis(3_500 + 2_500), "{took:?}");
    let error = &report.error_px;
    assert_eq!((error.views, error.samples), (2, 200));
    assert_eq!(error.measured_max, Some(0.5));
    let mut unmeasured = error.unmeasured.clone();
    unmeasured.sort();
    assert_eq!(unmeasured, ["node1", "node3", "node4"]);
    for (node, why) in [
        ("node1", "the elevation has left memory"),
        ("node3", "did not answer within 3.5s"),
        ("node4", "its connection ended"),
    ] {
        let names = |error: &&String| error.contains(node) && error.contains(why);
        assert_eq!(
            report.errors.iter().filter(names).count(),
            1,
            "{node}: {:?}",
            report.errors
        );
    }
}

#[test]
fn a_run_that_is_stopped_before_its_first_frame_measures_nothing() {
    let _machine = machine();
    let identity = identity();
    let mut options = options(wall(2, 60.0), identity.path());
    options.measure_error = true;
    let master = Master::start(options).unwrap();
    let mut nodes = Nodes::new(master.address(), identity.path());
    nodes.start("node0");
    wait_for(&master, 20, |notice| {
        matches!(notice, Notice::Joined { .. }).then_some(())
    });
    let stopped = Instant::now();
    master.stop();
    let report = master.finish().unwrap().report;
    assert!(stopped.elapsed() < Duration::from_secs(3));
    assert_eq!(
        (report.error_px.views, report.error_px.measured_max),
        (0, None)
    );
}
