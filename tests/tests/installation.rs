//! A running wall is measured anew, shows patterns, and follows tracked heads: real processes, real traffic.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::Value;
use tests::command::{self, Running};
use tests::{data, pictures};
use tracking::sim::{SimBody, VrpnServer, dtrack_packet};

/// Size of each of the two outputs.
const SIZE: [u32; 2] = [160, 120];
/// How long a wall may take to open its control API, or a tracker to be heard.
const PATIENCE: Duration = Duration::from_secs(60);

/// Two outputs side by side before two observers, of whom the second one looks at the screen.
fn wall(head_m: [f64; 3], left_m: f64, tracker: &str) -> String {
    let [width, height] = SIZE;
    let mut text = format!(
        "# The wall of a test.\n[wall]\nname = \"test\"\nfps = 20\n\n{tracker}\n\
         [[observers]]\nname = \"guide\"\nhead_m = [0.0, 1.5, 2.0]\n\n\
         [[observers]]\nname = \"viewer\"\nhead_m = {head_m:?} # measured\n{}\n\
         [[screens]]\nname = \"front\"\nkind = \"planar\"\nobserver = \"viewer\"\nsize_px = [{}, {height}]\n\
         corners_m = {{ bottom_left = [{left_m:?}, 1.0, 0.0], bottom_right = [{:?}, 1.0, 0.0], \
         top_left = [{left_m:?}, 1.9, 0.0] }}\n",
        if tracker.is_empty() {
            ""
        } else {
            "tracker = \"glasses\"\n"
        },
        2 * width,
        left_m + 2.4,
    );
    for (host, x) in [("left", 0), ("right", width)] {
        text += &format!(
            "\n[[hosts]]\nname = \"{host}\"\n[[hosts.outputs]]\nname = \"out\"\nsize_px = [{width}, {height}]\n\
             headless = true\ngamma = 2.2\n\
             channels = [{{ screen = \"front\", canvas_px = [{x}, 0, {width}, {height}], black_level = 0.0 }}]\n"
        );
    }
    text
}

/// The Alps from above: near things move when a head does.
fn scene() -> String {
    let data = data::repositories();
    format!(
        "[camera]\nmode = \"fixed\"\n\
         place = {{ latitude_deg = 45.6, longitude_deg = 6.8, altitude_m = 5e3, pitch_deg = -25.0 }}\n\n\
         [layers.relief]\nkind = \"elevation\"\nrepository = \"{}/elevation\"\n",
        data.display()
    )
}

/// A port that nobody has.
fn free_port() -> u16 {
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    free.local_addr().unwrap().port()
}

struct Show {
    folder: tempfile::TempDir,
    running: Running,
    control: String,
}

impl Show {
    fn start(wall: &str, frames: u32) -> Self {
        let folder = data::folder(&[("wall.toml", wall), ("scene.toml", &scene())]);
        let control = format!("127.0.0.1:{}", free_port());
        let at = folder.path().display();
        let line = format!(
            "up {at}/wall.toml --scene {at}/scene.toml --headless --frames {frames} --control {control} \
             --capture {at}/shot --report {at}/report.json --no-error"
        );
        let running = command::start_with(line.split_whitespace(), &[("LP_NUM_THREADS", "1")]);
        Self {
            folder,
            running,
            control,
        }
    }

    /// Asks the running master, until it is there.
    fn ask(&mut self, line: &str) -> command::Ran {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let words = format!("{line} --control {}", self.control);
            let ran = command::run(words.split_whitespace());
            let absent = ran.stderr.contains("cannot reach the control API");
            if !absent || self.running.has_ended() || Instant::now() > deadline {
                return ran;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// The composed wall, each output's picture, and the report.
    fn finish(self) -> (image::RgbImage, Value, tempfile::TempDir) {
        let folder = self.end();
        let at = |name: &str| folder.path().join(name);
        let report = std::fs::read_to_string(at("report.json")).unwrap();
        let wall = pictures::load(Path::new(&at("shot/wall.png")));
        (wall, serde_json::from_str(&report).unwrap(), folder)
    }

    /// Waits for the end. Each output's picture is in the folder.
    fn end(self) -> tempfile::TempDir {
        let ran = self.running.wait();
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        self.folder
    }
}

fn mean_difference(a: &image::RgbImage, b: &image::RgbImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let sum: u64 = a
        .as_raw()
        .iter()
        .zip(b.as_raw())
        .map(|(a, b)| u64::from(a.abs_diff(*b)))
        .sum();
    sum as f64 / a.as_raw().len() as f64
}

#[test]
fn a_wall_that_is_measured_anew_shows_what_one_of_these_measures_does() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let before = wall([0.0, 1.5, 2.0], -1.2, "");
    let after = wall([0.4, 1.7, 1.6], -1.25, "");
    let mut show = Show::start(&before, 60);
    for (bad, words) in [
        ("observers.viewer.head_m=[0,1,-5]", "behind the screen"),
        ("observers.nobody.head_m=[0,1,5]", "guide, viewer"),
        (
            "screens.front.size_px=[8,8]",
            "cannot change while the wall runs",
        ),
        ("hosts.left.name=3", "restart"),
        (
            "outputs.left/out.channels.7.black_level=0.1",
            "no such channel",
        ),
    ] {
        let ran = show.ask(&format!("adjust {bad}"));
        assert_eq!(ran.code, Some(2), "{bad}: {}", ran.stderr);
        assert!(ran.stderr.contains(words), "{bad}: {}", ran.stderr);
    }
    let ran = show.ask(
        "adjust observers.viewer.head_m=[0.4,1.7,1.6] screens.front.corners_m.bottom_left=[-1.25,1.0,0.0] \
         screens.front.corners_m.bottom_right=[1.15,1.0,0.0] screens.front.corners_m.top_left=[-1.25,1.9,0.0] --save",
    );
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let (adjusted, _, folder) = show.finish();
    let saved = std::fs::read_to_string(folder.path().join("wall.toml")).unwrap();
    assert!(
        saved.contains("# The wall of a test.") && saved.contains("[0.4, 1.7, 1.6] # measured"),
        "comments are gone:\n{saved}"
    );
    let (started, _, _) = Show::start(&after, 2).finish();
    let (untouched, _, _) = Show::start(&before, 2).finish();
    assert_eq!(pictures::differing(&adjusted, &started), 0);
    assert!(
        mean_difference(&untouched, &started) > 3.0,
        "measures change nothing"
    );
    // The file now says what was shown.
    let (again, _, _) = Show::start(&saved, 2).finish();
    assert_eq!(pictures::differing(&again, &started), 0);
}

/// Corners of a screen that is twice as wide.
fn corners_m(half_width_m: f64) -> [[f64; 3]; 3] {
    let (bottom, top) = (0.9, 0.9 + 0.75 * half_width_m);
    [
        [-half_width_m, bottom, 0.0],
        [half_width_m, bottom, 0.0],
        [-half_width_m, top, 0.0],
    ]
}

/// The pair of projectors that an archive puts in place on such a screen, with few pixels.
fn calibrated_pair(archive: &Path, half_width_m: f64) -> String {
    let wall = tests::sources::root().join("configs/walls/pair-mpcdi.toml");
    let text = std::fs::read_to_string(wall).unwrap();
    let mut changed = text.clone();
    let [bottom_left, bottom_right, top_left] = corners_m(half_width_m);
    for (from, to) in [
        ("[1280, 800]", "[160, 100]".to_owned()),
        ("\"pair.mpcdi\"", format!("{archive:?}")),
        (
            "{ bottom_left = [-1.8, 0.9, 0.0], bottom_right = [1.8, 0.9, 0.0], top_left = [-1.8, 2.25, 0.0] }",
            format!(
                "{{ bottom_left = {bottom_left:?}, bottom_right = {bottom_right:?}, top_left = {top_left:?} }}"
            ),
        ),
    ] {
        assert!(changed.contains(from), "{from}");
        changed = changed.replace(from, &to);
    }
    changed
}

/// Where pixels are that a calibration puts in place, and how much detail they need, is found anew with every measure. What
/// cannot be read then is refused, and the wall shows what it did.
#[test]
fn a_calibrated_wall_that_is_measured_anew_has_the_detail_of_its_new_place() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let copied = tempfile::tempdir().unwrap();
    let archive = copied.path().join("pair.mpcdi");
    let shipped = tests::sources::root().join("configs/walls/pair.mpcdi");
    std::fs::copy(shipped, &archive).unwrap();
    let (wide, narrow) = (
        calibrated_pair(&archive, 2.4),
        calibrated_pair(&archive, 0.8),
    );
    let mut show = Show::start(&wide, 60);
    let adjust = |half_width_m: f64| {
        let [bottom_left, bottom_right, top_left] = corners_m(half_width_m);
        let of = |corner: &str, at_m: [f64; 3]| {
            let [x, y, z] = at_m;
            format!(" screens.front.corners_m.{corner}=[{x:?},{y:?},{z:?}]")
        };
        [
            "adjust".to_owned(),
            of("bottom_left", bottom_left),
            of("bottom_right", bottom_right),
            of("top_left", top_left),
        ]
        .concat()
    };
    let ran = show.ask(&adjust(0.8));
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let aside = copied.path().join("aside.mpcdi");
    std::fs::rename(&archive, &aside).unwrap();
    let ran = show.ask(&adjust(1.2));
    assert_eq!(ran.code, Some(2), "{}", ran.stderr);
    assert!(ran.stderr.contains("pair.mpcdi"), "{}", ran.stderr);
    std::fs::rename(&aside, &archive).unwrap();
    let adjusted = show.end();
    let started = Show::start(&narrow, 2).end();
    let untouched = Show::start(&wide, 2).end();
    for output in ["left", "right"] {
        let picture = |folder: &tempfile::TempDir| {
            pictures::load(&folder.path().join(format!("shot/projection-{output}.png")))
        };
        let started = picture(&started);
        assert_eq!(pictures::differing(&picture(&adjusted), &started), 0);
        assert!(
            mean_difference(&picture(&untouched), &started) > 3.0,
            "measures change nothing"
        );
    }
}

#[test]
fn patterns_come_and_go_while_the_wall_runs() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let text = wall([0.0, 1.5, 2.0], -1.2, "");
    let mut show = Show::start(&text, 60);
    let ran = show.ask("pattern identify");
    assert_eq!(
        ran.stdout, "left/out identify\nright/out identify\n",
        "{}",
        ran.stderr
    );
    let ran = show.ask("pattern off right/out");
    assert_eq!(
        ran.stdout, "left/out identify\nright/out scene\n",
        "{}",
        ran.stderr
    );
    let ran = show.ask("pattern grid middle/out");
    assert_eq!(ran.code, Some(2));
    assert!(ran.stderr.contains("left/out, right/out"), "{}", ran.stderr);
    let ran = show.ask("pattern chess");
    assert_eq!(ran.code, Some(2));
    assert!(ran.stderr.contains("focus-star"), "{}", ran.stderr);
    let (_, _, folder) = show.finish();
    let (plain, _, plain_folder) = Show::start(&text, 2).finish();
    assert!(pictures::colours(&plain) > 300);
    let output = |folder: &tempfile::TempDir, name: &str| {
        image::open(folder.path().join("shot").join(name))
            .unwrap()
            .to_rgba8()
    };
    let left = output(&folder, "left-out.png");
    let found = node::read_identity(left.as_raw(), left.width(), left.height());
    assert_eq!(found, Some(node::identity("test", "left", "out")));
    let right = output(&folder, "right-out.png");
    assert!(
        right == output(&plain_folder, "right-out.png"),
        "the scene is back"
    );
}

#[test]
fn a_tracked_head_is_followed_through_silence_jumps_and_rubbish() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let server = VrpnServer::start("127.0.0.1:0", "Head").unwrap();
    // The tracker's z is up and its y points to the wall; it stands a metre to the left.
    let tracker = format!(
        "[[trackers]]\nname = \"glasses\"\nkind = \"vrpn\"\nsource = \"Head@{}\"\nbody = 3\n\
         to_room = {{ origin_m = [-1.0, 0.0, 0.0], x = [1.0, 0.0, 0.0], y = [0.0, 0.0, -1.0], z = [0.0, 1.0, 0.0] }}\n",
        server.address()
    );
    let head_m = [0.4, 1.7, 1.6];
    let measured = [head_m[0] + 1.0, -head_m[2], head_m[1]];
    let send = |position: [f64; 3]| server.send_pose(3, position, [0.0, 0.0, 0.0, 1.0]);
    let mut show = Show::start(&wall([0.0, 1.5, 2.0], -1.2, &tracker), 160);
    let wait_for = |show: &mut Show, what: &str, met: &dyn Fn() -> bool| {
        let deadline = Instant::now() + PATIENCE;
        while !met() {
            assert!(
                !show.running.has_ended() && Instant::now() < deadline,
                "no {what}"
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    wait_for(&mut show, "client", &|| server.clients() > 0);
    let for_a_while = |seconds: f64, work: &dyn Fn()| {
        let end = Instant::now() + Duration::from_secs_f64(seconds);
        while Instant::now() < end {
            work();
            std::thread::sleep(Duration::from_millis(10));
        }
    };
    for_a_while(1.0, &|| send(measured));
    // A jump across the room, words that are no pose, and a line that breaks: the head stays.
    for_a_while(0.1, &|| send([50.0, 50.0, 50.0]));
    for_a_while(0.2, &|| server.send_broken_pose(&[1, 2, 3]));
    server.drop_clients();
    wait_for(&mut show, "second client", &|| server.clients() > 0);
    let sending = std::sync::atomic::AtomicBool::new(true);
    let (tracked, report) = std::thread::scope(|scope| {
        scope.spawn(|| {
            while sending.load(std::sync::atomic::Ordering::Relaxed) {
                send(measured);
                std::thread::sleep(Duration::from_millis(10));
            }
        });
        let (tracked, report, _) = show.finish();
        sending.store(false, std::sync::atomic::Ordering::Relaxed);
        (tracked, report)
    });
    let (resting, _, _) = Show::start(&wall([0.0, 1.5, 2.0], -1.2, ""), 2).finish();
    let (there, _, _) = Show::start(&wall(head_m, -1.2, ""), 2).finish();
    let (near, far) = (
        mean_difference(&tracked, &there),
        mean_difference(&tracked, &resting),
    );
    eprintln!("off a head that stands there by {near:.3}, off the resting one by {far:.3} of 255");
    assert!(near < 0.5 && far > 3.0, "{near} {far}");
    let tracker = &report["trackers"][0];
    assert_eq!(
        (&tracker["name"], &tracker["state"]),
        (&"glasses".into(), &"tracked".into())
    );
    assert!(tracker["measurements"].as_u64() > Some(100), "{tracker:#}");
    let events = tracker["events"].to_string();
    for words in ["jump", "is lost", "127.0.0.1"] {
        assert!(
            events.to_lowercase().contains(words),
            "{words}: {tracker:#}"
        );
    }
}

#[test]
fn a_head_that_dtrack_measures_is_followed_whatever_else_the_port_hears() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let port = {
        let free = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
        free.local_addr().unwrap().port()
    };
    // Millimetres, as DTrack sends them; the glasses' mark is 6 cm above the eyes.
    let tracker = format!(
        "[[trackers]]\nname = \"glasses\"\nkind = \"dtrack\"\nsource = \"127.0.0.1:{port}\"\nbody = 1\n\
         to_head = {{ offset_m = [0.0, -0.06, 0.0] }}\n"
    );
    let head_m = [0.4, 1.7, 1.6];
    let (sending, sender) = (
        std::sync::atomic::AtomicBool::new(true),
        std::net::UdpSocket::bind("127.0.0.1:0").unwrap(),
    );
    let body = |id, position_mm| SimBody {
        id,
        position_mm,
        orientation: [0.0, 0.0, 0.0, 1.0],
    };
    let show = Show::start(&wall([0.0, 1.5, 2.0], -1.2, &tracker), 120);
    let (tracked, report) = std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut frame = 0;
            while sending.load(std::sync::atomic::Ordering::Relaxed) {
                frame += 1;
                let bodies = [body(0, [0.0, 900.0, 0.0]), body(1, [400.0, 1760.0, 1600.0])];
                let packet = dtrack_packet(frame, f64::from(frame) * 0.01, &bodies, &[]);
                // Nobody may listen yet: the system then says so at the next packet.
                let _ = sender.send_to(packet.as_bytes(), ("127.0.0.1", port));
                if frame % 50 == 0 {
                    let _ = sender.send_to(b"6d 900000000 [1 2", ("127.0.0.1", port));
                }
                std::thread::sleep(Duration::from_millis(10));
            }
        });
        let (tracked, report, _) = show.finish();
        sending.store(false, std::sync::atomic::Ordering::Relaxed);
        (tracked, report)
    });
    let (there, _, _) = Show::start(&wall(head_m, -1.2, ""), 2).finish();
    let near = mean_difference(&tracked, &there);
    eprintln!("off a head that stands there by {near:.3} of 255");
    assert!(near < 0.5, "{near}");
    let tracker = &report["trackers"][0];
    assert_eq!(tracker["state"], "tracked", "{tracker:#}");
    assert!(tracker["measurements"].as_u64() > Some(100), "{tracker:#}");
    assert!(
        tracker["events"].to_string().contains("no DTrack packet"),
        "the rubbish is not named: {tracker:#}"
    );
}
