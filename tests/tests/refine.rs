//! The error of refined meshes stays under τ: random views of real and of adversarial elevation, measured sample by
//! sample by the program itself; limits, changes while a wall runs, and wrong input.
//!
//! `TERRAWALL_REFINE_VIEWS=200 cargo test --release -p tests --test refine -- --nocapture`
//! looks at 200 views of each planet and τ instead of a few.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stderr,
    reason = "a test that panics has failed"
)]

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::time::Duration;

use serde_json::{Value, json};
use tests::command::{self, Ran};
use tests::rough::Rough;
use tests::{data, pictures, sources};

/// Bounds in pixels.
const TAUS: [f64; 3] = [0.5, 1.0, 4.0];
/// Pixels of the wall of views.
const SIZE: (u32, u32) = (400, 320);
/// What one view may take on a busy machine with two processors.
const PATIENCE_PER_VIEW: Duration = Duration::from_secs(30);

/// Views of each planet and τ, if the environment asks for the long form.
fn long_form() -> Option<u32> {
    let text = std::env::var("TERRAWALL_REFINE_VIEWS").ok()?;
    Some(text.parse().expect("TERRAWALL_REFINE_VIEWS is a number"))
}

/// A wall of one node with this much memory on the device.
fn wall(gpu_mib: u32) -> String {
    data::wall(1, SIZE.0, SIZE.1, 60.0) + &format!("\n[cache]\ngpu_mib = {gpu_mib}\n")
}

/// A scene of elevation and nothing else.
fn scene(repositories: &[&Path], mesh: &str) -> String {
    let mut text = "[camera]\nmode = \"fixed\"\n\
         place = { latitude_deg = 45.99, longitude_deg = 6.63, altitude_m = 7000, heading_deg = 135, pitch_deg = -8 }\n\n"
        .to_owned();
    for (index, repository) in repositories.iter().enumerate() {
        text += &format!(
            "[layers.heights{index}]\nkind = \"elevation\"\nrepository = \"{}\"\npriority = {index}\n\n",
            repository.display()
        );
    }
    text + &format!("[mesh]\n{mesh}\n")
}

/// Looks at views of a scene with a real process. Returns how it ended and its report.
fn look(wall: &str, scene: &str, views: u32, seed: u32) -> (Ran, Value) {
    let folder = data::folder(&[("wall.toml", wall), ("scene.toml", scene)]);
    let at = folder.path().display();
    let line = format!(
        "verify {at}/wall.toml --scene {at}/scene.toml --error --views {views} --seed {seed} --report {at}/report.json"
    );
    let patience = command::PATIENCE + PATIENCE_PER_VIEW * views;
    let ran = command::start(line.split_whitespace()).wait_within(patience);
    let report = std::fs::read_to_string(folder.path().join("report.json"))
        .unwrap_or_else(|error| panic!("{error}: terrawall {line}\n{scene}\n{}", ran.stderr));
    (ran, serde_json::from_str(&report).unwrap())
}

/// Measures the error of views of a scene, none of which may be off by more than τ.
fn measure(wall: &str, scene: &str, views: u32, seed: u32) -> Value {
    let (ran, report) = look(wall, scene, views, seed);
    assert_eq!(ran.code, Some(0), "{scene}\n{}{}", ran.stdout, ran.stderr);
    report
}

/// A number of a report, which must be there and be one.
fn number(report: &Value, pointer: &str) -> f64 {
    report
        .pointer(pointer)
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("no number at {pointer} in {report:#}"))
}

/// The report must say that samples of so many pictures were looked at, and that all of them keep to τ.
fn check(name: &str, report: &Value, tau: f64, least_views: u32) {
    let [said, most, samples, views, uncovered] =
        ["tau", "measured_max", "samples", "views", "uncovered"]
            .map(|key| number(report, &format!("/error_px/{key}")));
    eprintln!("{name}, τ {tau}: {most:.4} px at most, {samples} samples in {views} views");
    assert_eq!(said, tau, "{name}: {report:#}");
    assert!(views >= f64::from(least_views), "{name}: {report:#}");
    assert!(most <= tau, "{name}: {report:#}");
    assert!(most > 0.0, "{name}: nothing is off at all: {report:#}");
    // A view shows one leaf at least, and a leaf has more than 60,000 samples.
    assert!(samples >= 60_000.0 * views, "{name}: {report:#}");
    assert_eq!(uncovered, 0.0, "{name}: {report:#}");
}

/// As [`check`], of random views: some look at the sky, most do not.
fn check_views(name: &str, report: &Value, tau: f64, views: u32) {
    assert_eq!(
        number(report, "/looked_from"),
        f64::from(views),
        "{report:#}"
    );
    check(name, report, tau, views / 2);
    assert_eq!(number(report, "/achieved_tau"), tau, "{name}: {report:#}");
}

#[test]
fn real_elevation_keeps_to_tau() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let folder = data::repositories();
    let (etopo5, srtm) = (folder.join("etopo5"), folder.join("srtm"));
    for (seed, tau) in (1..).zip(TAUS) {
        let views = long_form().unwrap_or(7);
        let mesh = format!("refine = \"top-down\"\ntau = {tau:?}");
        let report = measure(&wall(1024), &scene(&[&etopo5, &srtm], &mesh), views, seed);
        check_views("real elevation", &report, tau, views);
    }
}

#[test]
fn adversarial_elevation_keeps_to_tau() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (index, rough) in Rough::ALL.into_iter().enumerate() {
        let repository = rough.write(folder.path());
        let (taus, views) = match long_form() {
            Some(views) => (TAUS.to_vec(), views),
            None => (vec![TAUS[index % TAUS.len()]], 4),
        };
        for tau in taus {
            let method = ["top-down", "bottom-up"][index % 2];
            let mesh = format!("refine = \"{method}\"\ntau = {tau:?}");
            let seed = 100 + index as u32;
            let report = measure(&wall(2048), &scene(&[&repository], &mesh), views, seed);
            check_views(&format!("{rough:?}, {method}"), &report, tau, views);
        }
    }
}

/// Samples that are no numbers or infinite are holes of the data, and holes are no holes of the mesh.
#[test]
fn elevation_that_is_not_finite_becomes_holes_and_keeps_to_tau() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let (width, height) = (512_usize, 256_usize);
    let raw: Vec<u8> = (0..width * height)
        .flat_map(|sample| {
            let (x, y) = (sample % width, sample / width);
            let height_m = 3000.0 * ((x as f32) * 0.2).sin() * ((y as f32) * 0.3).cos();
            let height_m = match sample % 97 {
                0 => f32::NAN,
                1 => f32::INFINITY,
                2 => f32::NEG_INFINITY,
                _ => height_m,
            };
            height_m.to_le_bytes()
        })
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().display();
    std::fs::write(folder.path().join("grid.raw"), raw).unwrap();
    command::succeed(&format!(
        "import {at}/grid.raw --into {at}/grid --kind elevation --extent=-180,-90,180,90 \
         --raw-size {width}x{height} --raw-type f32"
    ));
    let repository = folder.path().join("grid");
    let mesh = "refine = \"top-down\"\ntau = 1.0";
    let report = measure(&wall(1024), &scene(&[&repository], mesh), 4, 7);
    check_views("not finite", &report, 1.0, 4);
}

/// The tiled wall shows what one picture shows, whatever makes the meshes.
#[test]
fn tiles_and_one_picture_agree_however_meshes_are_made() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let repositories = data::repositories();
    for (pose, method, tau) in [
        ("verify-mountains", "top-down", 1.0),
        ("verify-mountains", "bottom-up", 1.0),
        ("verify-limb", "bottom-up", 0.5),
        ("layers", "top-down", 4.0),
    ] {
        let file = format!("configs/scenes/{pose}.toml");
        let text = std::fs::read_to_string(sources::root().join(file)).unwrap();
        let text = text.replace("../../out/data", repositories.to_str().unwrap());
        let mut in_mesh = false;
        let mut scene: Vec<&str> = text
            .lines()
            .filter(|line| {
                if line.starts_with('[') {
                    in_mesh = *line == "[mesh]";
                }
                !in_mesh
            })
            .collect();
        let mesh = format!("[mesh]\nrefine = \"{method}\"\ntau = {tau:?}");
        scene.push(&mesh);
        let folder = data::folder(&[("scene.toml", &scene.join("\n"))]);
        let at = folder.path().display();
        command::succeed(&format!(
            "verify configs/walls/demo-2x2.toml --scene {at}/scene.toml --report {at}/report.json --keep {at}/keep"
        ));
        let report = std::fs::read_to_string(folder.path().join("report.json")).unwrap();
        let report: Value = serde_json::from_str(&report).unwrap();
        assert_eq!(report["pixels"], 1280 * 720, "{pose}, {method}: {report}");
        assert_eq!(report["differing"], 0, "{pose}, {method}: {report}");
        let picture = pictures::load(&folder.path().join("keep/tiled/wall.png"));
        assert!(
            pictures::colours(&picture) > 500,
            "{pose}, {method} shows nothing"
        );
    }
}

#[test]
fn wrong_refinement_is_refused_with_its_name() {
    let folder = data::folder(&[("wall.toml", &wall(256))]);
    let at = folder.path().display();
    let etopo5 = data::repositories().join("etopo5");
    for (mesh, words) in [
        ("tau = 0", vec!["mesh.tau", "0.05"]),
        ("tau = -1.0", vec!["mesh.tau", "0.05"]),
        ("tau = 100.5", vec!["mesh.tau", "100"]),
        ("tau = nan", vec!["mesh.tau"]),
        ("tau = inf", vec!["mesh.tau"]),
        ("tau = \"1 px\"", vec!["tau"]),
        (
            "refine = \"sideways\"",
            vec!["mesh.refine", "sideways", "top-down"],
        ),
        ("refine = 3", vec!["refine"]),
        ("refinement = 8", vec!["mesh.refinement", "7"]),
        ("refinement = -1", vec!["mesh.refinement"]),
        ("wireframe = 1", vec!["wireframe"]),
    ] {
        std::fs::write(folder.path().join("scene.toml"), scene(&[&etopo5], mesh)).unwrap();
        for line in [
            format!("up {at}/wall.toml --scene {at}/scene.toml --headless --frames 1"),
            format!("verify {at}/wall.toml --scene {at}/scene.toml --error"),
        ] {
            let ran = command::run(line.split_whitespace());
            assert_eq!(ran.code, Some(2), "{mesh}: {}", ran.stderr);
            for word in words.iter().chain(&["scene.toml:"]) {
                assert!(
                    ran.stderr.contains(word),
                    "{mesh}: no {word} in {}",
                    ran.stderr
                );
            }
        }
    }
    std::fs::write(folder.path().join("scene.toml"), scene(&[&etopo5], "")).unwrap();
    let ran = command::run(
        format!("verify {at}/wall.toml --scene {at}/scene.toml --error --views 0")
            .split_whitespace(),
    );
    assert_eq!(ran.code, Some(2), "{}", ran.stderr);
    assert!(ran.stderr.contains("--views"), "{}", ran.stderr);
}

/// With hardly any memory τ grows by whole steps until the meshes fit. The report says how far, and nothing is lost.
#[test]
fn without_memory_tau_grows_by_whole_steps() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let folder = data::folder(&[("wall.toml", &wall(48))]);
    let repository = Rough::Checkerboard.write(folder.path());
    let tau = 0.05;
    let scene = scene(
        &[&repository],
        &format!("refine = \"top-down\"\ntau = {tau:?}"),
    );
    std::fs::write(folder.path().join("scene.toml"), &scene).unwrap();
    let at = folder.path().display();
    // A wall shows what it can, and says what that is.
    command::succeed(&format!(
        "up {at}/wall.toml --scene {at}/scene.toml --headless --no-control --frames 4 --capture {at}/out \
         --report {at}/report.json"
    ));
    let report = std::fs::read_to_string(folder.path().join("report.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["converged"], true, "{report:#}");
    check_achieved("a wall", &report, tau);
    // Who verifies is told why τ is not kept.
    let (ran, report) = look(&wall(48), &scene, 3, 5);
    check_achieved("verification", &report, tau);
    if number(&report, "/error_px/measured_max") > tau {
        assert_eq!(ran.code, Some(1), "{}", ran.stderr);
        assert!(ran.stderr.contains("gpu_mib"), "{}", ran.stderr);
    } else {
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    }
}

/// A report must say that more than τ was needed, by whole steps, and that no more than that was used.
fn check_achieved(name: &str, report: &Value, tau: f64) {
    let [said, most, uncovered] =
        ["tau", "measured_max", "uncovered"].map(|key| number(report, &format!("/error_px/{key}")));
    let achieved = number(report, "/achieved_tau");
    eprintln!("{name}: asked for {tau} px, got {achieved} px, measured {most} px");
    assert_eq!(said, tau, "{name}: {report:#}");
    assert!(achieved > tau, "{name}: everything fits: {report:#}");
    let steps = achieved / tau;
    assert!(
        (steps - steps.round()).abs() < 1e-6,
        "{name}: {steps} steps: {report:#}"
    );
    assert!(most <= achieved, "{name}: {report:#}");
    assert_eq!(uncovered, 0.0, "{name}: {report:#}");
}

/// A change of the running scene, or how it was refused.
fn patch(address: SocketAddr, change: &Value) -> (u16, Value) {
    let body = change.to_string();
    let mut stream = TcpStream::connect(address).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(20)))
        .unwrap();
    write!(
        stream,
        "PATCH /api/scene HTTP/1.1\r\nHost: {address}\r\nContent-Type: application/merge-patch+json\r\n\
         Connection: close\r\nContent-Length: {}\r\n\r\n{body}",
        body.len()
    )
    .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let status = answer.split_whitespace().nth(1).unwrap().parse().unwrap();
    let body = answer.split_once("\r\n\r\n").unwrap().1;
    (status, serde_json::from_str(body).unwrap())
}

/// τ, method, scale and weights change while a wall runs; at the end it stands as the last change wants it.
#[test]
fn changes_keep_to_tau_while_a_wall_runs() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let repositories = data::repositories();
    let (etopo5, srtm) = (repositories.join("etopo5"), repositories.join("srtm"));
    let folder = data::folder(&[
        ("wall.toml", &data::wall(2, 200, 160, 20.0)),
        (
            "scene.toml",
            &scene(&[&etopo5, &srtm], "refine = \"off\"\ntau = 4.0"),
        ),
    ]);
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = free.local_addr().unwrap();
    drop(free);
    let at = folder.path().display();
    let line = format!(
        "up {at}/wall.toml --scene {at}/scene.toml --headless --report {at}/report.json --control {address} --digests \
         {at}/digests"
    );
    let mut running = command::start(line.split_whitespace());
    let converged = |revision: u64| {
        (0..2).all(|node| {
            let file = folder.path().join(format!("digests/node{node}.tsv"));
            let text = std::fs::read_to_string(file).unwrap_or_default();
            let whole = text.rfind('\n').map_or(0, |end| end + 1);
            let last: Vec<&str> = text[..whole]
                .lines()
                .last()
                .unwrap_or("")
                .split('\t')
                .collect();
            last.len() == 6
                && last[1].parse::<u64>().is_ok_and(|shown| shown >= revision)
                && last[5] == "1"
        })
    };
    command::wait_until("the wall shows its first picture", || {
        assert!(!running.has_ended(), "the wall has ended");
        converged(1)
    });
    let (status, refused) = patch(address, &json!({ "mesh": { "tau": 0 } }));
    assert!((400..500).contains(&status), "{refused}");
    assert!(refused.to_string().contains("mesh.tau"), "{refused}");
    let mut revision = 0;
    for change in [
        json!({ "mesh": { "refine": "top-down" } }),
        json!({ "mesh": { "tau": 0.5 }, "layers": { "heights0": { "scale": 1.5 } } }),
        json!({ "mesh": { "refine": "bottom-up" }, "layers": { "heights1": { "opacity": 0.4 } } }),
        json!({ "mesh": { "wireframe": true }, "layers": { "heights1": { "priority": 0, "weight": 3.0 } } }),
        json!({ "mesh": { "refine": "fine" } }),
        json!({ "mesh": { "refine": "top-down", "tau": 1.0, "wireframe": null }, "layers": { "heights0": { "scale": 2.0 } } }),
    ] {
        let (status, answer) = patch(address, &change);
        assert_eq!(status, 200, "{change}: {answer}");
        revision = answer["revision"].as_u64().unwrap();
        // Some are overtaken by the next one, some are seen.
        std::thread::sleep(Duration::from_millis(400));
    }
    command::wait_until("the last change is shown", || converged(revision));
    running.signal("INT");
    let ran = running.wait();
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let report = std::fs::read_to_string(folder.path().join("report.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["error_px"]["unmeasured"], json!([]), "{report:#}");
    check("changes", &report, 1.0, 2);
}

/// The bench runs through its sequence: nothing is off by more than τ, and the meshes are about as small as can be.
#[test]
fn the_bench_measures_every_second_of_its_sequence() {
    let _alone = command::alone();
    if !data::driver() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().display();
    let ran = command::run(
        format!(
            "bench refine --quick --data {} --out {at} ",
            data::repositories().display()
        )
        .split_whitespace(),
    );
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    eprintln!("{}", ran.stdout);
    let report = std::fs::read_to_string(folder.path().join("refine.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    assert!(number(&report, "/error_px/measured_max") <= number(&report, "/tau_px"));
    assert_eq!(number(&report, "/error_px/uncovered"), 0.0);
    let methods = report["methods"].as_array().unwrap();
    let names: Vec<&str> = methods
        .iter()
        .filter_map(|method| method["method"].as_str())
        .collect();
    assert_eq!(names, ["off", "fine", "top-down", "bottom-up"]);
    let mut triangles: Vec<Vec<Option<u64>>> = Vec::new();
    for method in methods {
        let seconds = method["seconds"].as_array().unwrap();
        assert_eq!(seconds.len(), 6);
        let phases: Vec<&str> = seconds
            .iter()
            .filter_map(|second| second["phase"].as_str())
            .collect();
        assert!(
            phases.contains(&"zoom") && phases.contains(&"opacity"),
            "{phases:?}"
        );
        triangles.push(
            seconds
                .iter()
                .map(|second| second["whole"]["triangles"].as_u64())
                .collect(),
        );
        for second in seconds {
            assert!(number(second, "/whole/anew_ms") > 0.0, "{second:#}");
            assert!(number(second, "/whole/drawing_ms") > 0.0, "{second:#}");
        }
    }
    // Both ways to refine give the same meshes; brute force gives all triangles there are.
    assert_eq!(triangles[2], triangles[3]);
    for (off, refined) in triangles[0].iter().zip(&triangles[2]) {
        assert!(off <= refined, "{triangles:?}");
    }
    for (fine, refined) in triangles[1].iter().zip(&triangles[2]) {
        assert!(fine.is_some() && refined < fine, "{triangles:?}");
    }
    let sums = report["sums"].as_array().unwrap();
    for sums in &sums[2..] {
        assert!(number(sums, "/triangles_ratio") <= 1.3, "{sums:#}");
        assert!(number(sums, "/anew_ratio") < 1.0, "{sums:#}");
    }
    assert!(!report["passes"]["passes"].as_array().unwrap().is_empty());
    for plot in ["refine-rates.svg", "refine-times.svg"] {
        let svg = std::fs::read_to_string(folder.path().join(plot)).unwrap();
        assert_eq!(svg.matches("<rect x=").count(), 4, "{plot} has no legend");
        assert!(
            svg.matches("<polyline").count() >= 4 && !svg.contains("NaN"),
            "{plot}"
        );
    }
    let missing =
        command::run(format!("bench refine --quick --data {at} --out {at}").split_whitespace());
    assert_eq!(missing.code, Some(2), "{}", missing.stderr);
    assert!(missing.stderr.contains("make data"), "{}", missing.stderr);
}
