//! Whole walls of real processes for tests: nodes are this test program itself, run again with a name in
//! the environment, and draw with a picture that burns processor time instead of a graphics device.
//! In: walls, scenes, how to draw. Out: masters, node processes, what these presented. It judges nothing.

mod fake;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use link::Identity;
use master::{Master, MasterOptions, Notice};
use node::NodeOptions;
use protocol::wall::Surfaces;
use protocol::{Scene, Wall};

use fake::FakeMaker;

const NODE: &str = "TERRAWALL_TEST_NODE";
const MASTER: &str = "TERRAWALL_TEST_MASTER";
const STARTED: &str = "started";
const SIZE: [u32; 2] = [96, 54];

/// How a test node draws.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawing {
    /// Processor time of a drawing.
    pub(crate) burn_us: u64,
    /// Drawings of a held view until nothing is missing.
    pub(crate) drawings_to_converge: u32,
    /// Whether scenes can be shown at all.
    pub(crate) broken_scene: bool,
    /// Drawings until a scene in preparation is prepared; `u32::MAX`: never.
    pub(crate) drawings_to_prepare: u32,
    /// Whether only the first scene can be shown.
    pub(crate) refuses_changes: bool,
    /// How long the error takes to be measured; `u64::MAX`: it cannot be.
    pub(crate) measure_ms: u64,
}

impl Default for Drawing {
    fn default() -> Self {
        Self {
            burn_us: 1_500,
            drawings_to_converge: 5,
            broken_scene: false,
            drawings_to_prepare: 2,
            refuses_changes: false,
            measure_ms: 0,
        }
    }
}

/// A wall of `nodes` headless hosts `node0`, `node1`… side by side on one screen.
pub(crate) fn wall(nodes: usize, fps: f64) -> Wall {
    const PITCH_M: f64 = 0.004;
    let [width, height] = SIZE;
    let half_m = (nodes as f64) * f64::from(width) * PITCH_M / 2.0;
    let top_m = 1.0 + f64::from(height) * PITCH_M;
    let mut text = format!(
        "[wall]\nname = \"test\"\nfps = {fps:?}\n\n\
         [[observers]]\nname = \"viewer\"\nhead_m = [0.0, 1.5, {:?}]\n\n\
         [[screens]]\nname = \"front\"\nkind = \"planar\"\nobserver = \"viewer\"\nsize_px = [{}, {height}]\n\
         corners_m = {{ bottom_left = [{:?}, 1.0, 0.0], bottom_right = [{half_m:?}, 1.0, 0.0], \
         top_left = [{:?}, {top_m:?}, 0.0] }}\n",
        2.0 * half_m,
        nodes as u32 * width,
        -half_m,
        -half_m
    );
    for node in 0..nodes {
        write!(
            text,
            "\n[[hosts]]\nname = \"node{node}\"\n[[hosts.outputs]]\nname = \"out\"\n\
             size_px = [{width}, {height}]\nheadless = true\n\
             channels = [{{ screen = \"front\", canvas_px = [{}, 0, {width}, {height}] }}]\n",
            node as u32 * width
        )
        .unwrap();
    }
    Wall::parse(&text, "test wall").unwrap()
}

/// A bare Earth that turns under the viewer.
pub(crate) fn scene() -> Scene {
    let text = "layers = {}\n\n[camera]\nmode = \"orbit\"\n\
         place = { latitude_deg = 20.0, longitude_deg = 10.0, altitude_m = 12e6, pitch_deg = -90.0 }\n\
         centre = { latitude_deg = 90.0, longitude_deg = 0.0 }\ndegrees_per_second = 10.0\n";
    Scene::parse(text, "test scene").unwrap()
}

/// To be called first in a test `node_process` of every test program that starts nodes: runs the node if
/// this process was started as one.
pub(crate) fn be_a_node() {
    let Ok(name) = std::env::var(NODE) else {
        return;
    };
    let get = |key: &str| std::env::var(format!("{NODE}_{key}")).unwrap();
    let drawing = Drawing {
        burn_us: get("BURN_US").parse().unwrap(),
        drawings_to_converge: get("CONVERGE").parse().unwrap(),
        broken_scene: get("BROKEN") == "true",
        drawings_to_prepare: get("PREPARE").parse().unwrap(),
        refuses_changes: get("REFUSES") == "true",
        measure_ms: get("MEASURE").parse().unwrap(),
    };
    let log = std::env::var(format!("{NODE}_LOG")).ok().map(PathBuf::from);
    let options = NodeOptions {
        master: get("MASTER"),
        name,
        identity: Identity::load(Path::new(&get("IDENTITY"))).unwrap(),
        headless: true,
        digests: None,
        stop: Arc::new(|| false),
        status: Arc::new(|_| {}),
    };
    let result = node::run(options, |_| Ok(Box::new(FakeMaker::new(drawing, log))));
    if let Err(error) = &result {
        eprintln!("{error}");
    }
    std::process::exit(i32::from(result.is_err()));
}

/// Node processes; they end with this value.
pub(crate) struct Nodes {
    pub(crate) master: SocketAddr,
    pub(crate) identity: PathBuf,
    pub(crate) drawing: Drawing,
    /// Where each node writes what it presented when it ends well, in a file of its name: see
    /// [`presentations`].
    pub(crate) log: Option<PathBuf>,
    running: BTreeMap<String, Child>,
}

impl Nodes {
    pub(crate) fn new(master: SocketAddr, identity: &Path) -> Self {
        let identity = identity.to_owned();
        Self {
            master,
            identity,
            drawing: Drawing::default(),
            log: None,
            running: BTreeMap::new(),
        }
    }

    pub(crate) fn start(&mut self, name: &str) {
        let child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "node_process", "--nocapture", "--test-threads=1"])
            .env(NODE, name)
            .env(format!("{NODE}_MASTER"), self.master.to_string())
            .env(format!("{NODE}_IDENTITY"), &self.identity)
            .env(format!("{NODE}_BURN_US"), self.drawing.burn_us.to_string())
            .env(
                format!("{NODE}_CONVERGE"),
                self.drawing.drawings_to_converge.to_string(),
            )
            .env(
                format!("{NODE}_BROKEN"),
                self.drawing.broken_scene.to_string(),
            )
            .env(
                format!("{NODE}_PREPARE"),
                self.drawing.drawings_to_prepare.to_string(),
            )
            .env(
                format!("{NODE}_REFUSES"),
                self.drawing.refuses_changes.to_string(),
            )
            .env(
                format!("{NODE}_MEASURE"),
                self.drawing.measure_ms.to_string(),
            )
            .envs(
                self.log
                    .iter()
                    .map(|log| (format!("{NODE}_LOG"), log.join(name))),
            )
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        self.running.insert(name.to_owned(), child);
    }

    pub(crate) fn start_all(&mut self, nodes: usize) {
        for node in 0..nodes {
            self.start(&format!("node{node}"));
        }
    }

    /// Sends a signal by its name, as kill(1) does.
    pub(crate) fn signal(&mut self, name: &str, signal: &str) {
        let process = self.running[name].id().to_string();
        assert!(
            Command::new("kill")
                .args([signal, &process])
                .status()
                .unwrap()
                .success()
        );
    }

    /// Kills without a chance to say good-bye.
    pub(crate) fn kill(&mut self, name: &str) {
        let mut child = self.running.remove(name).unwrap();
        child.kill().unwrap();
        child.wait().unwrap();
    }

    /// Waits until a node has ended by itself; whether it ended well, and what it said.
    pub(crate) fn wait(&mut self, name: &str) -> (bool, String) {
        let output = self
            .running
            .remove(name)
            .unwrap()
            .wait_with_output()
            .unwrap();
        (
            output.status.success(),
            String::from_utf8_lossy(&output.stderr).into_owned(),
        )
    }
}

impl Drop for Nodes {
    fn drop(&mut self) {
        for child in self.running.values_mut() {
            let _ended = child.kill();
            let _reaped = child.wait();
        }
    }
}

/// A master in a process of its own, to be killed.
pub(crate) struct MasterProcess(Child);

impl MasterProcess {
    pub(crate) fn start(bind: SocketAddr, identity: &Path) -> Self {
        let child = Command::new(std::env::current_exe().unwrap())
            .args([
                "--exact",
                "master_process",
                "--nocapture",
                "--test-threads=1",
            ])
            .env(MASTER, bind.to_string())
            .env(format!("{NODE}_IDENTITY"), identity)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        Self(child)
    }

    pub(crate) fn wait_for_start(&mut self) {
        let words = BufReader::new(self.0.stderr.take().unwrap()).lines();
        assert!(
            words.map_while(Result::ok).any(|line| line == STARTED),
            "the master has not started"
        );
    }

    pub(crate) fn kill(&mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }
}

impl Drop for MasterProcess {
    fn drop(&mut self) {
        let _ended = self.0.kill();
        let _reaped = self.0.wait();
    }
}

/// To be called in a test `master_process`: runs a wall of four until killed, if this process was started
/// for that.
pub(crate) fn be_a_master() {
    let Ok(bind) = std::env::var(MASTER) else {
        return;
    };
    let identity = std::env::var(format!("{NODE}_IDENTITY")).unwrap();
    let mut options = options(wall(4, 60.0), Path::new(&identity));
    options.bind = bind.parse().unwrap();
    let master = Master::start(options).unwrap();
    wait_for_start(&master);
    eprintln!("{STARTED}");
    loop {
        let _ignored = master.next_notice(Duration::from_secs(1));
    }
}

/// Options for a wall on this machine.
pub(crate) fn options(wall: Wall, identity: &Path) -> MasterOptions {
    let identity = Identity::load(identity).unwrap();
    let bind = "127.0.0.1:0".parse().unwrap();
    let open_surfaces =
        Arc::new(|wall: &Wall| Surfaces::load(wall, |file, _| Err(file.to_owned())));
    let mut options = MasterOptions::new(wall, open_surfaces, scene(), identity, bind);
    options.start_timeout = Some(Duration::from_secs(20));
    options.capture_timeout = Duration::from_secs(20);
    options
}

/// Waits for a notice that `wanted` accepts; fails after `seconds`.
pub(crate) fn wait_for<T>(
    master: &Master,
    seconds: u64,
    mut wanted: impl FnMut(&Notice) -> Option<T>,
) -> T {
    let deadline = Instant::now() + Duration::from_secs(seconds);
    let mut heard = Vec::new();
    while Instant::now() < deadline {
        if let Some(notice) = master.next_notice(Duration::from_millis(50)) {
            if let Some(found) = wanted(&notice) {
                return found;
            }
            heard.push(notice);
        }
    }
    panic!("the awaited notice did not come; what came: {heard:?}");
}

/// Waits until the whole wall is in step.
pub(crate) fn wait_for_start(master: &Master) {
    wait_for(master, 20, |notice| match notice {
        Notice::Started { nodes, hosts } => {
            assert_eq!(nodes, hosts);
            Some(())
        }
        _ => None,
    });
}

/// One presentation of one node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Presentation {
    pub(crate) node: String,
    pub(crate) frame: u64,
    /// On the clock of this host, which all processes read.
    pub(crate) moment_us: i64,
    /// The revision of the view that was drawn.
    pub(crate) revision: u64,
    /// Stands for all that the drawn scene holds: the same for equal scenes, and in all likelihood for no others.
    pub(crate) content: u64,
}

/// Everything that nodes have presented, as their logs say, which they write when they end well.
pub(crate) fn presentations(log: &Path) -> Vec<Presentation> {
    let mut presentations = Vec::new();
    for file in std::fs::read_dir(log).unwrap() {
        let path = file.unwrap().path();
        let node = path.file_name().unwrap().to_str().unwrap();
        for line in std::fs::read_to_string(&path).unwrap().lines() {
            let mut words = line.split(' ');
            let mut word = || words.next().unwrap();
            presentations.push(Presentation {
                node: node.to_owned(),
                frame: word().parse().unwrap(),
                moment_us: word().parse().unwrap(),
                revision: word().parse().unwrap(),
                content: u64::from_str_radix(word(), 16).unwrap(),
            });
        }
    }
    presentations
}

/// Spread of the nodes' presentations, frame by frame, on the clock of this host, which all processes read.
/// Unlike the report's it does not depend on any estimate of a clock. Sorted.
pub(crate) fn true_skews_us(log: &Path) -> Vec<i64> {
    let nodes = std::fs::read_dir(log).unwrap().count();
    let mut frames = BTreeMap::<u64, Vec<i64>>::new();
    for presentation in presentations(log) {
        let moments_us = frames.entry(presentation.frame).or_default();
        moments_us.push(presentation.moment_us);
    }
    let complete = frames
        .into_values()
        .filter(|moments_us| moments_us.len() == nodes);
    let spread = |us: Vec<i64>| us.iter().max().unwrap() - us.iter().min().unwrap();
    let mut skews_us: Vec<i64> = complete.map(spread).collect();
    skews_us.sort_unstable();
    skews_us
}
