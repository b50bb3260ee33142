//! Changes of the scene on a running wall: shown by all nodes at the same frame, or by none.
//! In: walls of node processes, requests to the control API. Out: verdicts on what the nodes presented.

use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;
use std::path::Path;
use std::time::{Duration, Instant};

use master::{ControlOptions, Master, MasterOptions, Notice};
use protocol::change::PATIENCE_US;
use serde_json::{Value, json};

use super::http::{get, patch, request};
use super::support::{Nodes, options, presentations, wait_for, wait_for_start, wall};
use super::{identity, longest_frame_ms, machine};

fn controlled(nodes: usize, identity: &Path) -> MasterOptions {
    let mut options = options(wall(nodes, 60.0), identity);
    options.control = Some(ControlOptions {
        bind: "127.0.0.1:0".parse().unwrap(),
        token: None,
    });
    options
}

fn ambient(value: f64) -> Value {
    json!({ "light": { "ambient": value } })
}

/// Changes the scene 60 times a second; returns the last revision.
fn storm(address: SocketAddr, changes: u32) -> u64 {
    let begin = Instant::now();
    let mut last = 0;
    for change in 1..=changes {
        let revision = patch(address, &ambient(f64::from(change) / 1_000.0)).revision();
        assert!(revision > last, "{revision} after {last}");
        last = revision;
        let due = Duration::from_secs(1) * change / 60;
        std::thread::sleep(due.saturating_sub(begin.elapsed()));
    }
    last
}

/// Waits until the newest revision is shown.
fn wait_until_shown(address: SocketAddr, revision: u64) {
    let deadline = Instant::now() + Duration::from_secs(10);
    loop {
        let scene = get(address);
        assert_eq!(scene.revision(), revision);
        if scene.body["shown"] == json!(revision) {
            return;
        }
        assert!(Instant::now() < deadline, "{:?}", scene.body["shown"]);
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The revisions that the nodes presented, frame by frame. No two nodes may show different scenes in one frame, and
/// no revision may mean two scenes.
fn revisions(log: &Path, nodes: usize) -> BTreeMap<u64, u64> {
    let (mut frames, mut contents) = (BTreeMap::new(), BTreeMap::new());
    let mut heard = BTreeSet::new();
    for shown in presentations(log) {
        let revision = *frames.entry(shown.frame).or_insert(shown.revision);
        assert_eq!(
            revision, shown.revision,
            "another node in this frame: {shown:?}"
        );
        let content = *contents.entry(shown.revision).or_insert(shown.content);
        assert_eq!(
            content, shown.content,
            "the same revision elsewhere: {shown:?}"
        );
        heard.insert(shown.node);
    }
    assert_eq!(heard.len(), nodes, "{heard:?}");
    let different: BTreeSet<u64> = contents.values().copied().collect();
    assert_eq!(
        different.len(),
        contents.len(),
        "every change was another scene"
    );
    let in_order: Vec<u64> = frames.values().copied().collect();
    assert!(in_order.is_sorted(), "{in_order:?}");
    frames
}

fn wait_for_all(nodes: &mut Nodes, number: usize) {
    for index in 0..number {
        let (well, said) = nodes.wait(&format!("node{index}"));
        assert!(well, "node{index} did not leave well: {said}");
    }
}

#[test]
fn a_storm_of_changes_is_shown_by_all_nodes_at_the_same_frames() {
    const CHANGES: u32 = 120;
    let _machine = machine();
    let (identity, log) = (identity(), tempfile::tempdir().unwrap());
    let master = Master::start(controlled(4, identity.path())).unwrap();
    let address = master.control_address().unwrap();
    let mut nodes = Nodes::new(master.address(), identity.path());
    nodes.log = Some(log.path().to_owned());
    // The camera moves in every frame: what is there at once has converged at once.
    nodes.drawing.drawings_to_converge = 1;
    for index in 0..4 {
        // Some are faster than others.
        nodes.drawing.drawings_to_prepare = 1 + index;
        nodes.start(&format!("node{index}"));
    }
    wait_for_start(&master);
    let last = storm(address, CHANGES);
    wait_until_shown(address, last);
    std::thread::sleep(Duration::from_millis(200));
    master.stop();
    let report = master.finish().unwrap().report;
    wait_for_all(&mut nodes, 4);
    let frames = revisions(log.path(), 4);
    let shown: BTreeSet<u64> = frames.values().copied().collect();
    eprintln!(
        "{} of {CHANGES} changes were seen; {:?}; longest frame {} ms",
        shown.len(),
        report.changes,
        longest_frame_ms(&report)
    );
    assert_eq!(frames.values().last(), Some(&last), "the last change stays");
    assert!(shown.len() > 10, "{shown:?}");
    let changes = &report.changes;
    assert_eq!(changes.submitted, u64::from(CHANGES));
    assert_eq!(changes.shown + changes.superseded, changes.submitted);
    assert_eq!((changes.refused, changes.unprepared), (0, 0));
    assert!(changes.to_shown_us.p50 > 0.0 && changes.to_converged_us.max > 0.0);
    assert!(longest_frame_ms(&report) < 155.0);
}

#[test]
fn a_node_that_comes_amid_changes_shows_what_all_show() {
    let _machine = machine();
    let (identity, log) = (identity(), tempfile::tempdir().unwrap());
    let mut options = controlled(3, identity.path());
    options.start_after = Some(Duration::from_millis(400));
    let master = Master::start(options).unwrap();
    let address = master.control_address().unwrap();
    // Before anybody is there a change is shown at once.
    assert_eq!(patch(address, &ambient(0.9)).revision(), 2);
    wait_until_shown(address, 2);
    let mut nodes = Nodes::new(master.address(), identity.path());
    nodes.log = Some(log.path().to_owned());
    nodes.start("node0");
    nodes.start("node2");
    wait_for(&master, 20, |notice| {
        matches!(notice, Notice::Started { .. }).then_some(())
    });
    let last = std::thread::scope(|scope| {
        let storm = scope.spawn(|| storm(address, 150));
        std::thread::sleep(Duration::from_millis(300));
        nodes.start("node1");
        wait_for(&master, 10, |notice| {
            matches!(notice, Notice::Entered { node } if node == "node1").then_some(())
        });
        storm.join().unwrap()
    });
    wait_until_shown(address, last);
    std::thread::sleep(Duration::from_millis(200));
    master.stop();
    let report = master.finish().unwrap().report;
    wait_for_all(&mut nodes, 3);
    let frames = revisions(log.path(), 3);
    assert_eq!(
        frames.values().next(),
        Some(&2),
        "nobody saw the first scene"
    );
    assert_eq!(frames.values().last(), Some(&last));
    let late = presentations(log.path());
    let late = late.iter().filter(|shown| shown.node == "node1");
    assert!(
        late.map(|shown| shown.revision)
            .collect::<BTreeSet<_>>()
            .len()
            > 5
    );
    assert_eq!(report.changes.unprepared, 0, "{:?}", report.changes);
}

#[test]
fn a_node_that_never_prepares_holds_a_change_up_until_patience_is_over() {
    let _machine = machine();
    let (identity, log) = (identity(), tempfile::tempdir().unwrap());
    let master = Master::start(controlled(2, identity.path())).unwrap();
    let address = master.control_address().unwrap();
    let mut nodes = Nodes::new(master.address(), identity.path());
    nodes.log = Some(log.path().to_owned());
    nodes.start("node0");
    nodes.drawing.drawings_to_prepare = u32::MAX;
    nodes.start("node1");
    wait_for_start(&master);
    let begin = Instant::now();
    assert_eq!(patch(address, &ambient(0.2)).revision(), 2);
    // Of those that come meanwhile the last wins.
    for value in [0.3, 0.4, 0.5] {
        patch(address, &ambient(value)).revision();
    }
    let shown = |revision: u64| {
        wait_for(&master, 10, |notice| match notice {
            Notice::ChangeShown {
                revision: number,
                unprepared,
            } => {
                assert_eq!(*number, revision);
                assert_eq!(unprepared, &["node1"]);
                Some(())
            }
            _ => None,
        });
        begin.elapsed()
    };
    let (first, second) = (shown(2), shown(5));
    let patience = Duration::from_micros(PATIENCE_US.unsigned_abs());
    let least = patience - Duration::from_millis(100);
    let most = patience + Duration::from_millis(1_500);
    assert!((least..most).contains(&first), "{first:?}");
    assert!((least..most).contains(&(second - first)), "{second:?}");
    std::thread::sleep(Duration::from_millis(200));
    master.stop();
    let report = master.finish().unwrap().report;
    wait_for_all(&mut nodes, 2);
    let frames = revisions(log.path(), 2);
    let seen: BTreeSet<u64> = frames.into_values().collect();
    assert_eq!(seen, BTreeSet::from([1, 2, 5]));
    let changes = &report.changes;
    assert_eq!(
        (changes.shown, changes.superseded, changes.unprepared),
        (2, 2, 2)
    );
    assert!(changes.to_shown_us.max >= 1_900_000.0, "{changes:?}");
    assert!(longest_frame_ms(&report) < 155.0, "the wall never waited");
}

#[test]
fn a_refused_change_is_told_and_never_shown() {
    let _machine = machine();
    let (identity, log) = (identity(), tempfile::tempdir().unwrap());
    let master = Master::start(controlled(2, identity.path())).unwrap();
    let address = master.control_address().unwrap();
    let mut nodes = Nodes::new(master.address(), identity.path());
    nodes.log = Some(log.path().to_owned());
    nodes.start("node0");
    nodes.drawing.refuses_changes = true;
    nodes.start("node1");
    wait_for_start(&master);
    let before = get(address).body["scene"].clone();
    for revision in [2, 3] {
        assert_eq!(patch(address, &ambient(0.6)).revision(), revision);
        let reason = wait_for(&master, 10, |notice| match notice {
            Notice::ChangeRefused {
                revision: number,
                node,
                reason,
            } => {
                assert_eq!((*number, &**node), (revision, "node1"));
                Some(reason.clone())
            }
            _ => None,
        });
        assert!(reason.contains("no repository"), "{reason}");
        let after = get(address);
        assert_eq!((after.revision(), after.header("etag")), (1, Some("\"1\"")));
        assert_eq!(after.body["scene"], before);
        assert_eq!(
            after.body["refused"],
            json!({ "revision": revision, "node": "node1", "error": reason })
        );
        // Whoever builds on the refused revision is told that it is gone.
        let tag = format!("\"{revision}\"");
        let headers = [("Content-Type", "application/json"), ("If-Match", &*tag)];
        let body = br#"{"light": {"ambient": 0.7}}"#;
        assert_eq!(
            request(address, "PATCH", "/api/scene", &headers, body).status,
            409
        );
    }
    master.stop();
    let report = master.finish().unwrap().report;
    wait_for_all(&mut nodes, 2);
    assert!(
        revisions(log.path(), 2)
            .values()
            .all(|revision| *revision == 1)
    );
    assert_eq!((report.changes.refused, report.changes.shown), (2, 0));
    assert!(
        report
            .errors
            .iter()
            .any(|error| error.contains("revision 2") && error.contains("node1"))
    );
}

#[test]
fn pictures_wait_for_the_change_that_is_on_its_way() {
    let _machine = machine();
    let identity = identity();
    let mut options = controlled(2, identity.path());
    options.frames = Some(30);
    options.capture = true;
    let master = Master::start(options).unwrap();
    let address = master.control_address().unwrap();
    let mut nodes = Nodes::new(master.address(), identity.path());
    // Longer than the run, shorter than patience.
    nodes.drawing.drawings_to_prepare = 60;
    nodes.start_all(2);
    wait_for_start(&master);
    assert_eq!(patch(address, &ambient(0.5)).revision(), 2);
    let outcome = master.finish().unwrap();
    wait_for_all(&mut nodes, 2);
    assert_eq!(outcome.captures.len(), 2);
    for output in &outcome.captures {
        assert_eq!(output.rgba[2], 2, "{} shows another revision", output.host);
    }
    assert!(outcome.report.converged);
}
