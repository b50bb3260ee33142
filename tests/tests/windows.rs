//! Real windows on a virtual display: what the screen shows is what a capture holds.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use image::{Rgb, RgbImage};
use tests::{command, data, pictures};

/// Size of each of the two windows.
const SIZE: (u32, u32) = (160, 90);

/// A virtual X display of 640×480 whose pixels lie in a file. Ends when dropped.
struct Display {
    server: Child,
    name: String,
    folder: tempfile::TempDir,
}

impl Display {
    fn start() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let mut server = Command::new("Xvfb")
            .args([
                "-displayfd",
                "1",
                "-screen",
                "0",
                "640x480x24",
                "-nolisten",
                "tcp",
                "-fbdir",
            ])
            .arg(folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap())
            .read_line(&mut number)
            .unwrap();
        Some(Self {
            server,
            name: format!(":{}", number.trim()),
            folder,
        })
    }

    /// What the display shows: an XWD file, whose header is made of big-endian 32-bit numbers.
    fn screenshot(&self) -> RgbImage {
        let bytes = std::fs::read(self.folder.path().join("Xvfb_screen0")).unwrap();
        let field = |index: usize| {
            u32::from_be_bytes(bytes[index * 4..index * 4 + 4].try_into().unwrap()) as usize
        };
        // 0 header size, 4 width, 5 height, 11 bits a pixel, 12 bytes a line, 19 colours of 12 bytes each.
        let (start, width, height, line) =
            (field(0) + 12 * field(19), field(4), field(5), field(12));
        assert_eq!(field(11), 32);
        RgbImage::from_fn(width as u32, height as u32, |x, y| {
            let at = start + y as usize * line + x as usize * 4;
            Rgb([bytes[at + 2], bytes[at + 1], bytes[at]])
        })
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

#[test]
fn windows_show_what_a_capture_holds() {
    let _alone = command::alone();
    let display = Display::start();
    if !data::driver()
        || !data::skip_unless(display.is_some(), "Xvfb (run make test, or install xvfb)")
    {
        return;
    }
    let display = display.unwrap();
    let mut wall = data::wall(2, SIZE.0, SIZE.1, 30.0);
    for x in [20, 300] {
        wall = wall.replacen(
            "headless = true",
            &format!("window = {{ position_px = [{x}, 40] }}"),
            1,
        );
    }
    let folder = data::folder(&[("wall.toml", &wall), ("scene.toml", &data::scene())]);
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let line = format!(
        "up {} --scene {} --frames 120 --capture {}",
        at("wall.toml"),
        at("scene.toml"),
        at("shot")
    );
    let mut running = command::start_with(line.split_whitespace(), &[("DISPLAY", &display.name)]);
    let window = |screen: &RgbImage, x: u32| {
        image::imageops::crop_imm(screen, x, 40, SIZE.0, SIZE.1).to_image()
    };
    let mut shown = RgbImage::new(640, 480);
    while !running.has_ended() {
        // The last moment at which both windows were there.
        let now = display.screenshot();
        if [20, 300]
            .iter()
            .all(|x| pictures::colours(&window(&now, *x)) > 300)
        {
            shown = now;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let ran = running.wait();
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let wall = pictures::load(Path::new(&at("shot/wall.png")));
    for (from, to) in [(0, 20), (SIZE.0, 300)] {
        let captured = image::imageops::crop_imm(&wall, from, 0, SIZE.0, SIZE.1).to_image();
        let shown = window(&shown, to);
        assert_eq!(
            pictures::differing(&captured, &shown),
            0,
            "the window at {to}, 40"
        );
    }
}

#[test]
fn every_window_of_a_wall_says_on_the_screen_which_output_it_is() {
    let _alone = command::alone();
    let display = Display::start();
    if !data::driver()
        || !data::skip_unless(display.is_some(), "Xvfb (run make test, or install xvfb)")
    {
        return;
    }
    let display = display.unwrap();
    let mut wall = data::wall(3, SIZE.0, SIZE.1, 30.0);
    // Two by their places on the desktop, one by its monitor.
    for window in [
        "position_px = [20, 40]",
        "position_px = [300, 40]",
        "monitor = 0, position_px = [100, 200]",
    ] {
        wall = wall.replacen("headless = true", &format!("window = {{ {window} }}"), 1);
    }
    let folder = data::folder(&[("wall.toml", &wall), ("scene.toml", &data::scene())]);
    let at = folder.path().display();
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let control = free.local_addr().unwrap();
    drop(free);
    let line = format!("up {at}/wall.toml --scene {at}/scene.toml --control {control}");
    let environment = [("DISPLAY", display.name.as_str()), ("LP_NUM_THREADS", "1")];
    let mut running = command::start_with(line.split_whitespace(), &environment);
    let deadline = std::time::Instant::now() + command::PATIENCE;
    let due: Vec<(u32, [u32; 2])> = [
        ("node0", [22, 42]),
        ("node1", [302, 42]),
        ("node2", [102, 202]),
    ]
    .map(|(host, block_px)| (node::identity("test", host, "out"), block_px))
    .to_vec();
    loop {
        assert!(
            !running.has_ended() && std::time::Instant::now() < deadline,
            "not every output could be read off the screen"
        );
        let words = format!("pattern identify --control {control}");
        let _not_yet_there = command::run(words.split_whitespace());
        std::thread::sleep(std::time::Duration::from_millis(200));
        let screen = image::DynamicImage::ImageRgb8(display.screenshot()).to_rgba8();
        let (width, height) = screen.dimensions();
        let found = node::read_identities(screen.as_raw(), width, height);
        let found: Vec<(u32, [u32; 2])> = found
            .iter()
            .map(|found| (found.number, found.block_px))
            .collect();
        if due.iter().all(|output| found.contains(output)) {
            assert_eq!(found.len(), due.len(), "{found:?}");
            break;
        }
    }
    running.signal("INT");
    let ran = running.wait();
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
}
