//! What a viewer's eye sees of each kind of wall is what a picture rendered for that eye alone shows: the outputs of real
//! node processes are cast back through the room, compared by ꟻLIP, and planar walls are exact.
//!
//! `TERRAWALL_EYES_HEADS=100 cargo test --release -p tests --test eyes -- --nocapture`
//! looks from 100 random heads at each wall besides the few that are always there.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stderr,
    reason = "a test that panics has failed"
)]

use std::path::Path;
use std::sync::OnceLock;

use glam::DVec3;
use image::{GrayImage, Luma, RgbImage};
use protocol::Wall;
use protocol::wall::{Eye, Sight};
use tempfile::TempDir;
use tests::viewer::{self, Camera, Compared, Room, made, walls};
use tests::{command, data, flip, pictures, sources};
use toml::Table;

/// Pixels of what an eye sees.
const SIZE_PX: [u32; 2] = [240, 160];
/// Degrees across it.
const FIELD_DEG: f64 = 80.0;
/// Rays along each side of a pixel, and pixels of the reference to a pixel.
const SAMPLES: u32 = 3;
/// Most mean ꟻLIP between what an eye sees and what it should see.
const MOST_FLIP: f64 = 0.02;
/// How far off an eye is put to see whether that is noticed, in metres.
const SHIFT_M: f64 = 0.1;
/// Heads whose references are drawn at once.
const AT_ONCE: usize = 6;

/// A wall file and how to look at it.
struct Setting {
    /// Name of the wall file.
    wall: &'static str,
    /// `--pixels`.
    share: f64,
    /// Another place for the scene's camera, and for its sun.
    view: Option<&'static str>,
    /// Whose eyes there are.
    eyes: &'static [Eye],
    /// Heads beside the resting one.
    looks: [Look; 2],
    /// What the resting head looks at: yaw and pitch in degrees.
    ahead_deg: [f64; 2],
    /// How far random heads are from the resting one at most, in metres.
    reach_m: [f64; 3],
    /// Middle and half the range of yaw and pitch of random looks, in degrees.
    turns_deg: [[f64; 2]; 2],
}

/// A head in the room, and where its eye looks.
#[derive(Clone, Copy, Debug)]
struct Look {
    /// None: the resting head of the wall file as it is.
    head: Option<([f64; 3], [f64; 3])>,
    eye: Eye,
    yaw_deg: f64,
    pitch_deg: f64,
}

/// A head at a place in metres that is turned by `looks_deg`, and an eye that looks by yaw and pitch.
const fn look(
    head_m: [f64; 3],
    looks_deg: [f64; 3],
    eye: Eye,
    [yaw_deg, pitch_deg]: [f64; 2],
) -> Look {
    Look {
        head: Some((head_m, looks_deg)),
        eye,
        yaw_deg,
        pitch_deg,
    }
}

const CAVE: Setting = Setting {
    wall: "cave-4",
    share: 0.4,
    view: None,
    eyes: &[Eye::Left, Eye::Right],
    looks: [
        look(
            [-0.6, 1.5, -0.2],
            [35.0, 0.0, 0.0],
            Eye::Right,
            [50.0, -20.0],
        ),
        look(
            [0.7, 1.85, 0.7],
            [-60.0, -10.0, 8.0],
            Eye::Left,
            [-45.0, -20.0],
        ),
    ],
    ahead_deg: [0.0, -15.0],
    reach_m: [0.7, 0.3, 0.7],
    turns_deg: [[0.0, 70.0], [-20.0, 15.0]],
};

const LABORATORY: Setting = Setting {
    wall: "vrlab-siegen",
    share: 0.3,
    view: None,
    eyes: &[Eye::Left, Eye::Right],
    looks: [
        look(
            [0.6, 1.6, -0.5],
            [-30.0, 0.0, 0.0],
            Eye::Right,
            [-30.0, -15.0],
        ),
        look(
            [-0.7, 1.9, 0.3],
            [25.0, -10.0, 8.0],
            Eye::Left,
            [30.0, -15.0],
        ),
    ],
    ahead_deg: [0.0, -12.0],
    reach_m: [0.8, 0.3, 0.6],
    turns_deg: [[0.0, 40.0], [-15.0, 12.0]],
};

const DOME: Setting = Setting {
    wall: "dome-5",
    share: 0.4,
    // Amid the mountains and upside down, the sun aside: the ground is overhead, on all sides.
    view: Some(
        "place = { latitude_deg = 45.7, longitude_deg = 6.9, altitude_m = 7000, heading_deg = 135, pitch_deg = -8, \
         roll_deg = 180 }\nsun = { latitude_deg = 20, longitude_deg = 50 }",
    ),
    eyes: &[Eye::Centre],
    looks: [
        look([0.8, 1.2, -0.6], [0.0; 3], Eye::Centre, [120.0, 45.0]),
        look([-1.0, 1.7, 0.9], [0.0; 3], Eye::Centre, [-70.0, 35.0]),
    ],
    ahead_deg: [0.0, 15.0],
    reach_m: [1.0, 0.4, 1.0],
    turns_deg: [[0.0, 180.0], [40.0, 20.0]],
};

const POWERWALL: Setting = Setting {
    wall: "powerwall-4x3-bezels",
    share: 0.125,
    view: None,
    eyes: &[Eye::Centre],
    looks: [
        look([-1.2, 1.4, 2.0], [0.0; 3], Eye::Centre, [-20.0, 0.0]),
        look([1.0, 1.9, 2.4], [0.0; 3], Eye::Centre, [15.0, -10.0]),
    ],
    ahead_deg: [0.0, 0.0],
    reach_m: [1.2, 0.4, 0.8],
    turns_deg: [[0.0, 15.0], [-5.0, 10.0]],
};

const DEMONSTRATION: Setting = Setting {
    wall: "demo-2x2",
    share: 0.5,
    view: None,
    eyes: &[Eye::Centre],
    looks: [
        look([-1.2, 1.4, 2.0], [0.0; 3], Eye::Centre, [-20.0, 0.0]),
        look([1.0, 1.9, 2.4], [0.0; 3], Eye::Centre, [15.0, -10.0]),
    ],
    ahead_deg: [0.0, -2.0],
    reach_m: [1.2, 0.4, 0.8],
    turns_deg: [[0.0, 15.0], [-5.0, 10.0]],
};

/// Both projectors are calibrated by places on the canvas (MPCDI 2d), which lies on a plane of the room: their pictures follow
/// the head.
const PAIR: Setting = Setting {
    wall: "pair-mpcdi",
    share: 0.3125,
    view: None,
    eyes: &[Eye::Centre],
    looks: [
        look([-0.8, 1.4, 1.8], [0.0; 3], Eye::Centre, [-15.0, 0.0]),
        look([0.7, 1.9, 2.0], [0.0; 3], Eye::Centre, [12.0, -10.0]),
    ],
    ahead_deg: [0.0, 0.0],
    reach_m: [0.9, 0.4, 0.6],
    turns_deg: [[0.0, 15.0], [-2.0, 8.0]],
};

/// Two projectors on a cylinder, the one calibrated by points of the room (MPCDI a3), the other by places on the canvas: their
/// pictures follow the head, too. No file of `configs` is like this; the test writes it.
const CYLINDER: Setting = Setting {
    wall: MADE,
    share: 1.0,
    view: None,
    eyes: &[Eye::Centre],
    looks: [
        look([-0.6, 1.4, 0.5], [0.0; 3], Eye::Centre, [-20.0, -5.0]),
        look([0.7, 1.8, -0.4], [0.0; 3], Eye::Centre, [15.0, -10.0]),
    ],
    ahead_deg: [0.0, -5.0],
    reach_m: [0.7, 0.3, 0.6],
    turns_deg: [[0.0, 25.0], [-6.0, 8.0]],
};
/// In the place of a wall file's name: the wall is made by the test.
const MADE: &str = "calibrated-cylinder";

#[test]
fn cave() {
    see(&CAVE);
}

#[test]
fn laboratory_of_siegen() {
    see(&LABORATORY);
}

#[test]
fn dome() {
    see(&DOME);
}

#[test]
fn powerwall() {
    see(&POWERWALL);
    stays_exact(&POWERWALL);
}

#[test]
fn demonstration() {
    see(&DEMONSTRATION);
    stays_exact(&DEMONSTRATION);
}

#[test]
fn calibrated_pair() {
    see(&PAIR);
}

#[test]
fn calibrated_cylinder() {
    see(&CYLINDER);
}

/// Looks at a wall from all heads. Pictures of the worst one are kept if it is bad.
fn see(setting: &Setting) {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let folder = data::folder(&[("scene.toml", &scene(setting))]);
    let looks = looks(setting);
    for looks in looks.chunks(AT_ONCE) {
        let rooms: Vec<String> = looks.iter().map(|look| room(setting, look)).collect();
        let cameras: Vec<Camera> = rooms
            .iter()
            .zip(looks)
            .map(|(room, look)| camera(room, look))
            .collect();
        let references = references(setting, &cameras, folder.path());
        for (((look, room), camera), reference) in
            looks.iter().zip(&rooms).zip(&cameras).zip(&references)
        {
            check(setting, look, room, camera, reference, folder.path());
        }
    }
}

/// One head: what it sees is right, and what is wrong would be seen.
fn check(
    setting: &Setting,
    look: &Look,
    room: &str,
    camera: &Camera,
    reference: &RgbImage,
    folder: &Path,
) {
    let what = format!("{} {look:?}", setting.wall);
    assert!(
        pictures::colours(reference) > 1000,
        "{what}: the reference shows nothing"
    );
    show(room, setting.share, "wall", folder);
    let wall = Wall::parse(room, "wall.toml")
        .unwrap()
        .with_share_of_pixels(setting.share);
    check_density(&what, &wall, camera);
    let captured = Room::load(&wall, &folder.join("wall"));
    let found = captured.seen(camera, look.eye, SAMPLES).compare(reference);
    let right = camera.direction([f64::from(SIZE_PX[0]), 0.0]) - camera.direction([0.0, 0.0]);
    let beside = camera.moved_to(camera.eye_m + right.normalize() * SHIFT_M);
    let other = match look.eye {
        Eye::Left => Some(Eye::Right),
        Eye::Right => Some(Eye::Left),
        Eye::Centre => None,
    };
    let of_other = other.map(|other| captured.seen(camera, other, 1).compare(reference).flip);
    let from_beside = captured.seen(&beside, look.eye, 1).compare(reference).flip;
    eprintln!(
        "{what}: ꟻLIP {:.4} ({:.0} % masked); {SHIFT_M} m beside {from_beside:.4}, with the other eye's \
         pictures {of_other:.4?}",
        found.flip,
        100.0 * found.masked
    );
    if std::env::var_os("TERRAWALL_EYES_KEEP").is_some() || found.flip > MOST_FLIP {
        let kept = keep(reference, &found);
        assert!(
            found.flip <= MOST_FLIP,
            "{what}: ꟻLIP {} is more than {MOST_FLIP}; pictures are in {kept}",
            found.flip
        );
        eprintln!("pictures are in {kept}");
    }
    assert!(
        found.masked < 0.8,
        "{what}: {} of the picture is off the wall",
        found.masked
    );
    assert!(
        from_beside > 2.0 * MOST_FLIP && from_beside > 2.0 * found.flip,
        "{what}: an eye {SHIFT_M} m beside sees the same, ꟻLIP {from_beside}"
    );
    assert!(
        of_other.is_none_or(|flip| flip > 2.0 * MOST_FLIP),
        "{what}: both eyes see the same, ꟻLIP {of_other:?}"
    );
}

/// Planar walls that show no more than their canvas are not a pixel off, wherever the head is.
fn stays_exact(setting: &Setting) {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let room = walls::with_share(&room(setting, &setting.looks[0]), setting.share);
    let folder = data::folder(&[("wall.toml", &room), ("scene.toml", &scene(setting))]);
    let at = folder.path().display();
    command::succeed(&format!(
        "verify {at}/wall.toml --scene {at}/scene.toml --report {at}/report.json --keep {at}/keep"
    ));
    let report = std::fs::read_to_string(folder.path().join("report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["differing"], 0, "{}: {report}", setting.wall);
    assert!(report["pixels"].as_u64() > Some(100_000), "{report}");
    let picture = pictures::load(&folder.path().join("keep/tiled/wall.png"));
    assert!(pictures::colours(&picture) > 2000, "{}", setting.wall);
}

/// The heads that always look, and random ones if the environment asks for the long form.
fn looks(setting: &Setting) -> Vec<Look> {
    let [yaw_deg, pitch_deg] = setting.ahead_deg;
    let resting = Look {
        head: None,
        eye: setting.eyes[0],
        yaw_deg,
        pitch_deg,
    };
    let mut looks = vec![resting, setting.looks[0], setting.looks[1]];
    let more = std::env::var("TERRAWALL_EYES_HEADS");
    let more: u64 = more.map_or(0, |more| more.parse().expect("a number of heads"));
    let rest_m = resting_head_m(setting);
    for head in 0..more {
        // From −1 to 1.
        let random = |number: u64| mix(head * 16 + number) as f64 / u64::MAX as f64 * 2.0 - 1.0;
        let head_m =
            [0, 1, 2].map(|axis| rest_m[axis] + setting.reach_m[axis] * random(axis as u64));
        let [yaw_deg, pitch_deg] = [0, 1].map(|turn| {
            let [middle, half] = setting.turns_deg[turn];
            middle + half * random(3 + turn as u64)
        });
        let eye = setting.eyes[head as usize % setting.eyes.len()];
        let turned = [yaw_deg + 10.0 * random(5), pitch_deg, 10.0 * random(6)];
        looks.push(look(head_m, turned, eye, [yaw_deg, pitch_deg]));
    }
    looks
}

/// A number that looks like chance (the finaliser of `SplitMix64`, Steele, Lea and Flood 2014).
fn mix(seed: u64) -> u64 {
    let z = seed.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// The mountains, seen through the walls of the room.
fn scene(setting: &Setting) -> String {
    let file = sources::root().join("configs/scenes/verify-mountains.toml");
    let text = std::fs::read_to_string(file).unwrap();
    let repositories = data::repositories();
    let text = text.replace("../../out/data", repositories.to_str().unwrap());
    let mut scene: Table = text.parse().unwrap();
    if let Some(view) = setting.view {
        let mut view: Table = view.parse().unwrap();
        for (table, key) in [("camera", "place"), ("light", "sun")] {
            scene[table][key] = view.remove(key).expect("a place and a sun");
        }
    }
    scene.to_string()
}

/// The wall file for a head.
fn room(setting: &Setting, look: &Look) -> String {
    walls::of_test(file(setting), look.head)
}

/// What the eyes should see: pictures that are rendered for them alone.
fn references(setting: &Setting, cameras: &[Camera], folder: &Path) -> Vec<RgbImage> {
    let wall = walls::single(resting_head_m(setting), cameras, SAMPLES);
    show(&wall, 1.0, "reference", folder);
    (0..cameras.len())
        .map(|number| {
            let file = folder.join(format!("reference/eye{number}-picture.png"));
            viewer::reduced(&pictures::load(&file), SAMPLES)
        })
        .collect()
}

/// Runs a wall with the folder's scene, and leaves the pictures of its outputs in a folder of that name.
fn show(wall: &str, share: f64, name: &str, folder: &Path) {
    let at = folder.display();
    std::fs::write(folder.join(format!("{name}.toml")), wall).unwrap();
    command::succeed(&format!(
        "up {at}/{name}.toml --scene {at}/scene.toml --headless --no-control --frames 2 --pixels {share:?} \
         --capture {at}/{name}"
    ));
}

/// The camera at the eye of a look.
fn camera(room: &str, look: &Look) -> Camera {
    let wall = Wall::parse(room, "wall.toml").unwrap();
    // All screens of these walls have one observer.
    let sight = Sight {
        screen: 0,
        eye: look.eye,
    };
    let eye_m = DVec3::from(wall.eye_m(sight, &wall.heads()));
    Camera::new(eye_m, look.yaw_deg, look.pitch_deg, FIELD_DEG, SIZE_PX)
}

/// Everywhere on the wall there are at least as many pixels to a radian as in the middle of the eye's picture.
fn check_density(what: &str, wall: &Wall, camera: &Camera) {
    let needed = 0.5 * f64::from(SIZE_PX[0]) / (0.5 * FIELD_DEG).to_radians().tan();
    for screen in &wall.screens {
        let density = screen.pixels_per_radian(camera.eye_m.to_array()).unwrap();
        assert!(
            density.sparsest >= needed,
            "{what}: screen {} has {} pixels to a radian, not {needed}",
            screen.name,
            density.sparsest
        );
    }
}

/// Writes what should be seen, what is seen, and how that differs. Returns the folder, which stays.
fn keep(reference: &RgbImage, found: &Compared) -> String {
    let folder = tempfile::tempdir().unwrap().keep();
    reference.save(folder.join("reference.png")).unwrap();
    found.filled.save(folder.join("seen.png")).unwrap();
    let errors = flip::map(reference, &found.filled, flip::PIXELS_PER_DEGREE);
    let errors = GrayImage::from_fn(reference.width(), reference.height(), |x, y| {
        let error = errors[(y * reference.width() + x) as usize];
        Luma([(error.min(1.0) * 255.0).round() as u8])
    });
    errors.save(folder.join("errors.png")).unwrap();
    folder.display().to_string()
}

/// The wall file as it is, but for the files that it names, which are named so that they are found from anywhere.
fn file(setting: &Setting) -> Table {
    static ARCHIVES: OnceLock<(TempDir, Table)> = OnceLock::new();
    if setting.wall == MADE {
        let made = ARCHIVES.get_or_init(|| {
            let folder = tempfile::tempdir().unwrap();
            let wall = made::calibrated_cylinder(folder.path());
            (folder, wall)
        });
        return made.1.clone();
    }
    let folder = sources::root().join("configs/walls");
    let text = std::fs::read_to_string(folder.join(format!("{}.toml", setting.wall))).unwrap();
    walls::with_files_from(text.parse().unwrap(), &folder)
}

/// Where the scene's pose holds.
fn resting_head_m(setting: &Setting) -> [f64; 3] {
    let wall = file(setting).to_string();
    Wall::parse(&wall, "wall.toml").unwrap().observers[0].head_m
}
