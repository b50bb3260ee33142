//! Whole walls as processes: pictures, reports, late and lost nodes, and ends.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::Value;
use tests::command::{self, Running};
use tests::{data, pictures};

/// Two nodes of this size make the walls of these tests.
const SIZE: (u32, u32) = (96, 54);

/// A folder with `wall.toml`, `scene.toml` and the identity `cluster`.
struct Site(tempfile::TempDir);

impl Site {
    fn new(nodes: u32) -> Self {
        let site = Self(data::folder(&[
            ("wall.toml", &data::wall(nodes, SIZE.0, SIZE.1, 30.0)),
            ("scene.toml", &data::scene()),
        ]));
        command::succeed(&format!("identity create {}", site.text("cluster")));
        site
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }

    fn up(&self, more: &str) -> Running {
        let line = format!(
            "up {} --scene {} --headless {more}",
            self.text("wall.toml"),
            self.text("scene.toml")
        );
        command::start(line.split_whitespace())
    }

    fn master(&self, port: u16, more: &str) -> Running {
        let line = format!(
            "master {} --scene {} --headless --identity {} --listen 127.0.0.1:{port} --wait 1 {more}",
            self.text("wall.toml"),
            self.text("scene.toml"),
            self.text("cluster")
        );
        command::start(line.split_whitespace())
    }

    fn node(&self, port: u16, name: &str, identity: &str) -> Running {
        let identity = self.text(identity);
        let line = format!(
            "node --headless --master 127.0.0.1:{port} --name {name} --identity {identity}"
        );
        command::start(line.split_whitespace())
    }

    fn report(&self) -> Value {
        serde_json::from_str(&std::fs::read_to_string(self.path("report.json")).unwrap()).unwrap()
    }
}

/// A port that nobody listens at.
fn free_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port()
}

fn node<'r>(report: &'r Value, name: &str) -> &'r Value {
    report["nodes"]
        .as_array()
        .unwrap()
        .iter()
        .find(|node| node["name"] == name)
        .unwrap()
}

/// The report's keys that other tools read, and their types.
fn check_report(report: &Value, nodes: usize) {
    for key in [
        "/frames",
        "/fps",
        "/frame_ms/p50",
        "/frame_ms/p99",
        "/skew_us/p50",
        "/skew_us/p99",
        "/skew_us/max",
        "/view_bytes/max",
        "/scene_bytes",
        "/state_latency_us/p50",
        "/state_latency_us/p99",
        "/tiles/distinct",
        "/tiles/repository_reads",
        "/tiles/disk_hits",
        "/tiles/ram_hits",
    ] {
        assert!(
            report.pointer(key).is_some_and(Value::is_number),
            "{key} must be a number in {report:#}"
        );
    }
    assert!(report["converged"].is_boolean());
    let listed = report["nodes"].as_array().unwrap();
    assert_eq!(listed.len(), nodes);
    for node in listed {
        assert!(
            node["name"].is_string() && node["adapter"].is_string(),
            "{node}"
        );
        for key in ["frames", "missed_deadlines", "joins", "join_ms"] {
            assert!(node[key].is_number(), "{key} must be a number in {node}");
        }
    }
    assert!(report["view_bytes"]["max"].as_u64().unwrap() <= 1100);
}

#[test]
fn a_wall_leaves_its_pictures_and_a_report() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let site = Site::new(2);
    let more = format!(
        "--frames 60 --capture {} --report {}",
        site.text("shot"),
        site.text("report.json")
    );
    let ran = site.up(&more).wait();
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let report = site.report();
    check_report(&report, 2);
    assert!(report["frames"].as_u64().unwrap() >= 60);
    assert_eq!(report["converged"], true);
    assert!(report["tiles"]["distinct"].as_u64().unwrap() > 6);

    let wall = pictures::load(&site.path("shot/wall.png"));
    assert_eq!(wall.dimensions(), (2 * SIZE.0, SIZE.1));
    // The globe stands in the middle on black; Africa is redder and the Atlantic bluer.
    assert!(
        pictures::colours(&wall) > 1000,
        "only {} colours",
        pictures::colours(&wall)
    );
    assert_eq!(
        pictures::mean(&wall, 0, 0, 4, 4),
        [0.0; 3],
        "space is black"
    );
    let sahara = pictures::mean(&wall, SIZE.0 - 2, SIZE.1 / 2 - 8, 4, 4);
    let atlantic = pictures::mean(&wall, SIZE.0 - 20, SIZE.1 / 2 + 6, 4, 4);
    assert!(
        sahara[0] > sahara[2],
        "the Sahara is yellow, not {sahara:?}"
    );
    assert!(
        atlantic[2] > atlantic[0],
        "the Atlantic is blue, not {atlantic:?}"
    );
    // Every output is there, and its pixels are the wall's.
    let outputs: Vec<PathBuf> = std::fs::read_dir(site.path("shot"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| !path.ends_with("wall.png"))
        .collect();
    assert_eq!(outputs.len(), 2, "{outputs:?}");
    for path in outputs {
        let picture = pictures::load(&path);
        let x = if path.to_string_lossy().contains("node0") {
            0
        } else {
            SIZE.0
        };
        let part = image::imageops::crop_imm(&wall, x, 0, SIZE.0, SIZE.1).to_image();
        assert_eq!(
            pictures::differing(&picture, &part),
            0,
            "{}",
            path.display()
        );
    }
}

#[test]
fn a_late_node_and_one_that_comes_back_show_the_same_picture() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let site = Site::new(2);
    let capture = |name: &str| {
        format!(
            "--capture {} --report {}",
            site.text(name),
            site.text("report.json")
        )
    };

    let together = site
        .up(&format!("--frames 10 {}", capture("together")))
        .wait();
    assert_eq!(together.code, Some(0), "{}", together.stderr);

    let port = free_port();
    let master = site.master(port, &format!("--frames 300 {}", capture("late")));
    let _first = site.node(port, "node0", "cluster");
    std::thread::sleep(Duration::from_secs(3));
    let second = site.node(port, "node1", "cluster");
    std::thread::sleep(Duration::from_secs(3));
    second.signal("KILL");
    drop(second);
    std::thread::sleep(Duration::from_secs(1));
    let _third = site.node(port, "node1", "cluster");
    let ran = master.wait();
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let report = site.report();
    check_report(&report, 2);
    assert_eq!(node(&report, "node0")["joins"], 1);
    assert_eq!(node(&report, "node1")["joins"], 2);
    assert!(
        node(&report, "node1")["join_ms"].as_f64().unwrap() < 2000.0,
        "{report:#}"
    );
    let (late, together) = (
        pictures::load(&site.path("late/wall.png")),
        pictures::load(&site.path("together/wall.png")),
    );
    assert_eq!(pictures::differing(&late, &together), 0);
}

#[test]
fn a_killed_node_neither_stops_nor_slows_the_others() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let site = Site::new(3);
    let running = site.up(&format!(
        "--frames 240 --report {}",
        site.text("report.json")
    ));
    command::wait_until("the nodes start", || {
        command::children_of(running.process_id()).len() == 3
    });
    std::thread::sleep(Duration::from_secs(4));
    let victim = command::children_of(running.process_id())[1];
    command::signal(victim, "KILL");
    let ran = running.wait();
    assert!(
        ran.stderr.contains("ended"),
        "the end of a node is told: {}",
        ran.stderr
    );
    let report = site.report();
    assert_eq!(report["frames"].as_u64().unwrap(), 240);
    let frames = |node: &Value| node["frames"].as_u64().unwrap();
    let all: Vec<u64> = report["nodes"]
        .as_array()
        .unwrap()
        .iter()
        .map(frames)
        .collect();
    assert_eq!(
        all.iter().filter(|frames| **frames >= 235).count(),
        2,
        "two nodes went on: {all:?}"
    );
}

#[test]
fn a_wall_ends_with_its_operators_wish_and_leaves_nothing() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let site = Site::new(2);
    for (signal, code) in [("INT", Some(0)), ("TERM", Some(0)), ("KILL", None)] {
        let temporary = tempfile::tempdir().unwrap();
        let line = format!(
            "up {} --scene {} --headless",
            site.text("wall.toml"),
            site.text("scene.toml")
        );
        let place = [("TMPDIR", temporary.path().to_str().unwrap())];
        let running = command::start_with(line.split_whitespace(), &place);
        command::wait_until("the nodes start", || {
            command::children_of(running.process_id()).len() == 2
        });
        let children = command::children_of(running.process_id());
        std::thread::sleep(Duration::from_secs(1));
        running.signal(signal);
        let ran = running.wait();
        assert_eq!(ran.code, code, "after SIG{signal}: {}", ran.stderr);
        command::wait_until("the nodes end", || {
            children
                .iter()
                .all(|child| !Path::new(&format!("/proc/{child}")).exists())
        });
        if signal != "KILL" {
            let left: Vec<_> = std::fs::read_dir(temporary.path())
                .unwrap()
                .map(|file| file.unwrap().path())
                .collect();
            assert!(left.is_empty(), "left behind after SIG{signal}: {left:?}");
        }
    }
}

#[test]
fn strangers_are_turned_away_and_the_wall_goes_on() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let site = Site::new(1);
    command::succeed(&format!("identity create {}", site.text("others")));
    let port = free_port();
    let master = site.master(
        port,
        &format!("--frames 240 --report {}", site.text("report.json")),
    );
    let _member = site.node(port, "node0", "cluster");
    std::thread::sleep(Duration::from_secs(3));

    let start = Instant::now();
    let unknown = site.node(port, "nobody", "cluster").wait();
    assert_eq!(unknown.code, Some(2), "{}", unknown.stderr);
    assert!(
        unknown.stderr.contains("nobody") && unknown.stderr.contains("node0"),
        "{}",
        unknown.stderr
    );
    let stranger = site.node(port, "node0", "others").wait();
    assert!(matches!(stranger.code, Some(1 | 2)), "{}", stranger.stderr);
    assert!(
        stranger.stderr.contains("certificate") || stranger.stderr.contains("identity"),
        "{}",
        stranger.stderr
    );
    let nobody = site.node(port, "node0", "absent").wait();
    assert_eq!(nobody.code, Some(2), "{}", nobody.stderr);
    assert!(nobody.stderr.contains("absent"), "{}", nobody.stderr);
    assert!(
        start.elapsed() < Duration::from_secs(30),
        "it took {:?}",
        start.elapsed()
    );

    let second = site.master(port, "--frames 5").wait();
    assert_eq!(second.code, Some(1), "{}", second.stderr);
    assert!(
        second.stderr.contains(&port.to_string()) && second.stderr.contains("use"),
        "{}",
        second.stderr
    );

    let ran = master.wait();
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let report = site.report();
    assert!(
        node(&report, "node0")["frames"].as_u64().unwrap() >= 235,
        "{report:#}"
    );
    assert_eq!(node(&report, "node0")["joins"], 1);
}

#[test]
fn without_an_adapter_the_operator_is_told_what_to_install() {
    let _alone = command::alone();
    let site = Site::new(1);
    let line = format!(
        "up {} --scene {} --headless --frames 5",
        site.text("wall.toml"),
        site.text("scene.toml")
    );
    let nowhere = "/nonexistent/driver.json";
    let environment = [("VK_DRIVER_FILES", nowhere), ("VK_ICD_FILENAMES", nowhere)];
    let ran = command::start_with(line.split_whitespace(), &environment).wait();
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    assert!(ran.stderr.contains("mesa-vulkan-drivers"), "{}", ran.stderr);
}

#[test]
fn a_repository_of_another_version_is_named() {
    let _alone = command::alone();
    let site = Site::new(1);
    let copy = site.path("elevation");
    std::fs::create_dir(&copy).unwrap();
    let dataset =
        std::fs::read_to_string(data::repositories().join("elevation/dataset.toml")).unwrap();
    let changed: String = dataset
        .lines()
        .map(|line| {
            if line.contains("version") {
                "format_version = 999\n".to_owned()
            } else {
                format!("{line}\n")
            }
        })
        .collect();
    assert_ne!(dataset, changed);
    std::fs::write(copy.join("dataset.toml"), changed).unwrap();
    let scene = data::scene().replace(
        data::repositories().join("elevation").to_str().unwrap(),
        copy.to_str().unwrap(),
    );
    std::fs::write(site.path("scene.toml"), scene).unwrap();
    let ran = site.up("--frames 5").wait();
    assert!(matches!(ran.code, Some(1 | 2)), "{}", ran.stderr);
    assert!(
        ran.stderr.contains(copy.to_str().unwrap()) && ran.stderr.contains("999"),
        "{}",
        ran.stderr
    );
}
