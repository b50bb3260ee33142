//! Walls: the shipped files are valid, and every way to get one wrong is told with its place and remedy.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::path::{Path, PathBuf};

use proptest::prelude::*;
use protocol::Fault;
use protocol::wall::{Rect, Screen, Wall};

const DEMO: &str = include_str!("../../configs/walls/demo-2x2.toml");

fn configs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs")
}

fn demo() -> Wall {
    Wall::parse(DEMO, "demo-2x2.toml").unwrap()
}

#[test]
fn every_shipped_wall_is_valid() {
    let mut count = 0;
    for entry in std::fs::read_dir(configs().join("walls")).unwrap() {
        let path = entry.unwrap().path();
        // Beside walls lie the calibrations that they name.
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        let wall = Wall::parse(&text, &path.to_string_lossy()).unwrap();
        assert_eq!(
            Some(wall.name.as_str()),
            path.file_stem().and_then(|stem| stem.to_str())
        );
        wall.validate().unwrap();
        count += 1;
    }
    assert!(count >= 8, "only {count}");
}

#[test]
fn the_demo_wall_is_four_quarters_of_one_canvas() {
    let wall = demo();
    assert_eq!(wall.hosts.len(), 4);
    assert_eq!(wall.screens[0].size_px, [1280, 720]);
    let mut covered = vec![0_u8; 1280 * 720];
    for piece in wall.canvas_layout() {
        assert_eq!(
            wall.hosts[piece.host].outputs[piece.output].size_px,
            [640, 360]
        );
        for y in piece.canvas_px.y..piece.canvas_px.bottom() {
            for x in piece.canvas_px.x..piece.canvas_px.right() {
                covered[(y * 1280 + x) as usize] += 1;
            }
        }
    }
    assert!(covered.iter().all(|count| *count == 1));
}

#[test]
fn a_single_wall_has_the_same_canvases() {
    let text = std::fs::read_to_string(configs().join("walls/powerwall-3x2-bezels.toml")).unwrap();
    for wall in [demo(), Wall::parse(&text, "powerwall").unwrap()] {
        let single = wall.single();
        single.validate().unwrap();
        assert_eq!(single.screens, wall.screens);
        assert_eq!(single.observers, wall.observers);
        assert_eq!(
            single.pixels_per_radian().to_bits(),
            wall.pixels_per_radian().to_bits()
        );
        assert_eq!(single.hosts.len(), 1);
        assert_eq!(single.hosts[0].name, "single");
        let pieces = single.canvas_layout();
        assert_eq!(pieces.len(), wall.screens.len());
        for (piece, screen) in pieces.iter().zip(&wall.screens) {
            let [width, height] = screen.size_px;
            assert_eq!(
                piece.canvas_px,
                Rect {
                    x: 0,
                    y: 0,
                    width,
                    height
                }
            );
            assert_eq!(
                single.hosts[0].outputs[piece.output].size_px,
                screen.size_px
            );
        }
    }
}

/// Replaces the first `from` of the demo wall and returns the error.
fn error_of(from: &str, to: &str) -> protocol::WallError {
    assert!(DEMO.contains(from), "the demo wall has no {from}");
    let text = DEMO.replacen(from, to, 1);
    Wall::parse(&text, "w.toml").expect_err(&format!("{from} → {to} was accepted"))
}

#[test]
fn each_fault_names_place_key_and_remedy() {
    use Fault::{Geometry, MissingKey, Name, OutOfRange, Syntax, UnknownKey, WrongType};
    let corners = "bottom_right = [2.0, 0.5, 0.0]";
    let cases: &[(&str, &str, Fault, &str, &str)] = &[
        ("fps = 30", "fps = = 30", Syntax, "", "not TOML"),
        (
            "fps = 30",
            "fsp = 30",
            UnknownKey,
            "wall.fsp",
            "did you mean fps?",
        ),
        ("fps = 30", "", MissingKey, "wall.fps", "fps = 60"),
        (
            "fps = 30",
            "fps = \"30\"",
            WrongType,
            "wall.fps",
            "write a number",
        ),
        ("fps = 30", "fps = 0", OutOfRange, "wall.fps", "1…240"),
        ("fps = 30", "fps = nan", OutOfRange, "wall.fps", "finite"),
        (
            "fps = 30",
            "fps = 30\ncolour = 1",
            UnknownKey,
            "wall.colour",
            "name, fps",
        ),
        (
            "head_m =",
            "head =",
            UnknownKey,
            "observers[0].head",
            "did you mean head_m?",
        ),
        (
            "head_m =",
            "head_mm =",
            UnknownKey,
            "observers[0].head_mm",
            "did you mean head_m?",
        ),
        (
            "[0.0, 1.7, 3.0]",
            "[0.0, 1.7]",
            WrongType,
            "observers[0].head_m",
            "list of 3",
        ),
        (
            "[0.0, 1.7, 3.0]",
            "[0.0, 1.7, \"3 m\"]",
            WrongType,
            "observers[0].head_m[2]",
            "a number",
        ),
        (
            "[0.0, 1.7, 3.0]",
            "[0.0, 1.7, 3000.0]",
            OutOfRange,
            "observers[0].head_m",
            "metres",
        ),
        (
            "[0.0, 1.7, 3.0]",
            "[0.0, 1.7, -3.0]",
            Geometry,
            "screens[0].corners_m",
            "behind the screen",
        ),
        (
            "[0.0, 1.7, 3.0]",
            "[0.0, 1.7, 0.0]",
            Geometry,
            "screens[0].corners_m",
            "in the plane",
        ),
        (
            "observer = \"viewer\"",
            "observer = \"vewer\"",
            Name,
            "screens[0].observer",
            "one of viewer",
        ),
        (
            "\"planar\"",
            "\"dome\"",
            OutOfRange,
            "screens[0].kind",
            "planar",
        ),
        (
            corners,
            "bottom_right = [2.0, 0.6, 0.0]",
            Geometry,
            "screens[0].corners_m",
            "rectangle",
        ),
        (
            corners,
            "bottom_right = [-2.0, 0.5, 0.0]",
            Geometry,
            "screens[0].corners_m",
            "no area",
        ),
        (
            corners,
            "bottom_right = [2.5, 0.5, 0.0]",
            Geometry,
            "screens[0].size_px",
            "not square",
        ),
        (
            corners,
            "botom_right = [2.0, 0.5, 0.0]",
            UnknownKey,
            "screens[0].corners_m.botom_right",
            "bottom_right",
        ),
        (
            "size_px = [1280, 720]",
            "size_px = [1280, 0]",
            OutOfRange,
            "screens[0].size_px",
            "16384",
        ),
        (
            "size_px = [1280, 720]",
            "size_px = [1280.5, 720]",
            WrongType,
            "screens[0].size_px[0]",
            "whole",
        ),
        (
            "size_px = [640, 360]",
            "size_px = [-640, 360]",
            OutOfRange,
            "hosts[0].outputs[0].size_px[0]",
            "range",
        ),
        (
            "name = \"right-top\"",
            "name = \"left-top\"",
            Name,
            "hosts[1].name",
            "already",
        ),
        (
            "name = \"left-top\"",
            "name = \"\"",
            Name,
            "hosts[0].name",
            "1…64",
        ),
        (
            "window = { position_px = [0, 0] }",
            "",
            MissingKey,
            "hosts[0].outputs[0]",
            "headless = true",
        ),
        (
            "window = { position_px = [0, 0] }",
            "window = { position_px = [0, 0] }\nheadless = true",
            OutOfRange,
            "hosts[0].outputs[0].window",
            "remove one",
        ),
        (
            "canvas_px = [640, 0, 640, 360]",
            "canvas_px = [641, 0, 640, 360]",
            OutOfRange,
            "hosts[1].outputs[0].channels[0].canvas_px",
            "1280×720",
        ),
        (
            "canvas_px = [0, 0, 640, 360]",
            "canvas_px = [0, 0, 0, 360]",
            OutOfRange,
            "hosts[0].outputs[0].channels[0].canvas_px",
            "empty",
        ),
        (
            "canvas_px = [0, 0, 640, 360], output_px = [0, 0]",
            "canvas_px = [0, 0, 640, 360], output_px = [1, 0]",
            OutOfRange,
            "hosts[0].outputs[0].channels[0].output_px",
            "640×360",
        ),
        (
            "output_px = [0, 0] }]",
            "output_px = [0, 0] }, { screen = \"front\", canvas_px = [0, 0, 9, 9] }]",
            Geometry,
            "hosts[0].outputs[0].channels[1].output_px",
            "channel 0",
        ),
        (
            "gpu_mib = 1024",
            "gpu_mib = 0",
            OutOfRange,
            "cache.gpu_mib",
            "MiB",
        ),
        (
            "ram_mib = 512",
            "ram_mib = 63",
            OutOfRange,
            "cache.ram_mib",
            "at least 64",
        ),
        (
            "gpu_mib = 1024",
            "gpu_gib = 1",
            UnknownKey,
            "cache.gpu_gib",
            "gpu_mib",
        ),
        (
            "[[observers]]",
            "[[observer]]",
            UnknownKey,
            "observer",
            "did you mean observers?",
        ),
    ];
    for (from, to, fault, key, advice) in cases {
        let error = error_of(from, to);
        let text = error.to_string();
        assert_eq!(error.fault(), *fault, "{from} → {to}: {text}");
        assert_eq!(error.key(), *key, "{from} → {to}: {text}");
        assert!(text.contains(advice), "{from} → {to}: {text}");
        // The place: on the changed line, or above it where a table's header stands for what is missing.
        let changed = DEMO[..DEMO.find(from).unwrap()].matches('\n').count() + 1;
        let (line, column) = error.position();
        assert!(
            text.starts_with(&format!("w.toml:{line}:{column}: ")),
            "{text}"
        );
        assert!(line >= 1 && column >= 1, "{text}");
        if !matches!(fault, MissingKey | Geometry) && !to.contains('\n') {
            assert_eq!(line, changed, "{from} → {to}: {text}");
        }
    }
}

#[test]
fn an_error_shows_the_value_and_reads_as_a_sentence() {
    let text = error_of("fps = 30", "fps = 500").to_string();
    assert_eq!(
        text,
        "w.toml:6:7: wall.fps = 500: write a number of frames a second within 1…240"
    );
}

#[test]
fn counts_are_limited() {
    let mut wall = demo();
    wall.observers = vec![wall.observers[0].clone(); 17];
    for (index, observer) in wall.observers.iter_mut().enumerate() {
        observer.name = format!("viewer {index}");
    }
    assert_eq!(wall.validate().unwrap_err().key(), "observers");
    let mut wall = demo();
    wall.hosts.clear();
    assert_eq!(wall.validate().unwrap_err().key(), "hosts");
    let mut wall = demo();
    wall.hosts[1].outputs[0].channels[0].screen = 7;
    assert_eq!(wall.validate().unwrap_err().fault(), Fault::Name);
}

/// Pixels per radian between neighbouring points of the canvas, by brute force.
fn measured_density(screen: &Screen, head_m: [f64; 3], x: f64, y: f64, toward: [f64; 2]) -> f64 {
    let seen = screen.eye_to_screen(head_m).unwrap();
    let step = 1e-3;
    let a = glam::DVec3::from(seen.to_canvas_m(screen.size_px, x, y));
    let moved = seen.to_canvas_m(screen.size_px, x + toward[0] * step, y + toward[1] * step);
    let b = glam::DVec3::from(moved);
    // The sine: exact for small angles, where the cosine is not.
    step * a.length() * b.length() / a.cross(b).length()
}

proptest! {
    /// The density bounds what is measured anywhere on the canvas, in any direction, and is reached.
    #[test]
    fn density_is_the_maximum(
        head in prop::array::uniform3(-2.0..2.0_f64), distance in 0.3..4.0_f64,
        u in 0.0..1.0_f64, v in 0.0..1.0_f64, angle in 0.0..6.3_f64,
    ) {
        let mut wall = demo();
        let head_m = [head[0], head[1] + 1.6, distance];
        wall.observers[0].head_m = head_m;
        let screen = &wall.screens[0];
        let density = screen.pixels_per_radian(head_m).unwrap();
        let (x, y) = (u * 1280.0, v * 720.0);
        let here = measured_density(screen, head_m, x, y, [angle.cos(), angle.sin()]);
        prop_assert!(here <= density.densest * (1.0 + 1e-4), "{here} {density:?}");
        prop_assert!(here >= density.sparsest * (1.0 - 1e-4), "{here} {density:?}");
        // It is reached at a corner, in the direction away from the foot of the perpendicular.
        let seen = screen.eye_to_screen(head_m).unwrap();
        let corner = glam::DVec3::from(seen.lower_left_m);
        let foot_x = -corner.dot(glam::DVec3::from(seen.right)) / seen.width_m * 1280.0;
        let foot_y = 720.0 + corner.dot(glam::DVec3::from(seen.up)) / seen.height_m * 720.0;
        let reached = [[0.0, 0.0], [1280.0, 0.0], [0.0, 720.0], [1280.0, 720.0]].map(|[x, y]| {
            let away = glam::DVec2::new(x - foot_x, y - foot_y).normalize_or(glam::DVec2::X);
            measured_density(screen, head_m, x, y, away.to_array())
        });
        let most = reached.into_iter().fold(0.0, f64::max);
        prop_assert!((most / density.densest - 1.0).abs() < 1e-4, "{most} {density:?}");
        prop_assert_eq!(wall.pixels_per_radian().to_bits(), density.densest.to_bits());
    }

    /// Whatever the text is, parsing answers and does not panic.
    #[test]
    fn no_text_panics(cut in 0..DEMO.len(), insert in ".{0,8}", length in 0..20_usize) {
        let start = (0..=cut).rev().find(|index| DEMO.is_char_boundary(*index)).unwrap();
        let end = (start + length..=DEMO.len()).find(|index| DEMO.is_char_boundary(*index));
        let text = format!("{}{insert}{}", &DEMO[..start], &DEMO[end.unwrap_or(DEMO.len())..]);
        let _ = Wall::parse(&text, "w.toml").map_err(|error| error.to_string());
    }
}

#[test]
fn a_head_behind_the_screen_sees_nothing() {
    let screen = &demo().screens[0];
    assert!(screen.eye_to_screen([0.0, 1.7, -0.1]).is_none());
    assert!(screen.pixels_per_radian([0.0, 1.7, 0.0]).is_none());
    let seen = screen.eye_to_screen([0.0, 1.7, 3.0]).unwrap();
    assert_eq!(seen.lower_left_m, [-2.0, -1.2, -3.0]);
    assert_eq!(
        (seen.right, seen.up, seen.back),
        ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    );
    assert_eq!(
        (seen.width_m, seen.height_m, seen.distance_m),
        (4.0, 2.25, 3.0)
    );
}
