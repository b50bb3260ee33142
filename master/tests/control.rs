//! The control API of a running master: what it grants, and that whatever else it is sent changes nothing.
//! In: requests, right and wrong. Out: verdicts on answers and on the scene after them. No node draws here.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::indexing_slicing,
    reason = "a test that panics has failed"
)]

mod http;
#[path = "control/members.rs"]
mod members;

use std::net::SocketAddr;
use std::sync::Arc;

use http::{get, patch, request};
use link::Identity;
use master::{ControlOptions, Master, MasterOptions, StartError};
use protocol::wall::Surfaces;
use protocol::{Scene, Wall};
use serde_json::{Value, json};

const WALL: &str = r#"
    [wall]
    name = "one"
    fps = 60.0
    [[observers]]
    name = "viewer"
    head_m = [0.0, 1.5, 3.0]
    [[screens]]
    name = "front"
    kind = "planar"
    observer = "viewer"
    size_px = [16, 16]
    corners_m = { bottom_left = [-1.0, 1.0, 0.0], bottom_right = [1.0, 1.0, 0.0], top_left = [-1.0, 3.0, 0.0] }
    [[hosts]]
    name = "west"
    [[hosts.outputs]]
    name = "out"
    size_px = [16, 16]
    headless = true
    channels = [{ screen = "front", canvas_px = [0, 0, 16, 16] }]
"#;

const SCENE: &str = r#"
    [camera]
    mode = "fixed"
    place = { latitude_deg = 45.8, longitude_deg = 6.9, altitude_m = 9000.0, pitch_deg = -30.0 }
    [layers.relief]
    kind = "elevation"
    repository = "/data/elevation"
    [layers.photo]
    kind = "imagery"
    repository = "/data/imagery"
    [layers.lines]
    kind = "isolines"
    [lenses.loupe]
    latitude_deg = 45.8
    longitude_deg = 6.9
    radius_m = 20000.0
    [lenses.loupe.layers.relief]
    scale = 3.0
"#;

struct Running {
    master: Master,
    address: SocketAddr,
    /// Holds the identity.
    folder: tempfile::TempDir,
}

fn start_with(change: impl FnOnce(&mut MasterOptions)) -> Result<Running, StartError> {
    let folder = tempfile::tempdir().unwrap();
    let identity = Identity::create(folder.path()).unwrap();
    let (wall, scene) = (
        Wall::parse(WALL, "test").unwrap(),
        Scene::parse(SCENE, "test").unwrap(),
    );
    let open_surfaces =
        Arc::new(|wall: &Wall| Surfaces::load(wall, |file, _| Err(file.to_owned())));
    let mut options = MasterOptions::new(
        wall,
        open_surfaces,
        scene,
        identity,
        "127.0.0.1:0".parse().unwrap(),
    );
    options.start_timeout = None;
    options.control = Some(ControlOptions {
        bind: "127.0.0.1:0".parse().unwrap(),
        token: None,
    });
    change(&mut options);
    let master = Master::start(options)?;
    Ok(Running {
        address: master.control_address().unwrap_or_else(|| master.address()),
        master,
        folder,
    })
}

fn start() -> Running {
    start_with(|_| {}).unwrap()
}

#[test]
fn the_scene_is_read_changed_and_read_again() {
    let running = start();
    let first = get(running.address);
    assert_eq!(first.revision(), 1);
    assert_eq!(first.header("etag"), Some("\"1\""));
    assert_eq!(first.header("content-type"), Some("application/json"));
    assert_eq!(
        (&first.body["shown"], &first.body["refused"]),
        (&json!(1), &Value::Null)
    );
    assert_eq!(first.body["scene"]["layers"]["relief"]["scale"], json!(1.0));
    assert_eq!(
        first.body["scene"]["lenses"]["loupe"]["layers"]["relief"],
        json!({ "scale": 3.0 }),
        "lenses only show what they give"
    );

    let change = json!({ "layers": { "relief": { "scale": 2.0 } }, "light": { "ambient": 0.5 } });
    let changed = patch(running.address, &change);
    assert_eq!(changed.revision(), 2);
    assert_eq!(changed.header("etag"), Some("\"2\""));
    let second = get(running.address);
    // There is no node to wait for.
    assert_eq!((second.revision(), &second.body["shown"]), (2, &json!(2)));
    let mut expected = first.body["scene"].clone();
    expected["layers"]["relief"]["scale"] = json!(2.0);
    expected["light"]["ambient"] = json!(0.5);
    assert_eq!(
        second.body["scene"], expected,
        "and nothing else has changed"
    );

    // What changes nothing is no revision.
    assert_eq!(patch(running.address, &change).revision(), 2);
    assert_eq!(patch(running.address, &json!({})).revision(), 2);
    // Null gives the default back, and takes a layer away that no lens uses.
    let change = json!({ "layers": { "relief": { "scale": null }, "photo": null } });
    assert_eq!(patch(running.address, &change).revision(), 3);
    let third = get(running.address);
    assert_eq!(third.body["scene"]["layers"]["relief"]["scale"], json!(1.0));
    assert_eq!(third.body["scene"]["layers"].get("photo"), None);
    // The other content type, and a method that clients may use to look whether somebody is there.
    let headers = [("Content-Type", "application/json; charset=utf-8")];
    let body = br#"{"lenses": {"loupe": null}}"#;
    let changed = request(running.address, "PATCH", "/api/scene", &headers, body);
    assert_eq!(changed.revision(), 4);
    assert_eq!(get(running.address).body["scene"]["lenses"], json!({}));
    assert_eq!(
        request(running.address, "HEAD", "/api/scene", &[], b"").status,
        200
    );
}

/// Status, path of the value in question (`-` for none) and body of patches that must change nothing.
const WRONG: &str = r#"400 - scale=2
400 layers {"layers": {
400 layers.relief.scale {"layers": {"relief": {"scale": NaN}}}
400 light.ambient {"light": {"ambient": 0.2, "ambient": 0.3}}
400 - {"light": {"ambient": 0.2}} {}
422 layers.relief.scale {"layers": {"relief": {"scale": 1e999}}}
422 layers.relief.clamp_m[0] {"layers": {"relief": {"clamp_m": [-1e999, 5]}}}
422 layers.relief.scale {"layers": {"relief": {"scale": "NaN"}}}
422 layers.relief.scale {"layers": {"relief": {"scale": 100.5}}}
422 layers.relief.scale {"layers": {"relief": {"scale": -1}}}
422 layers.relief.clamp_m {"layers": {"relief": {"clamp_m": [5, 5]}}}
422 layers.photo.opacity {"layers": {"photo": {"opacity": 1.01}}}
422 layers.lines.spacing_m {"layers": {"lines": {"spacing_m": 0}}}
422 layers.relief.blend {"layers": {"relief": {"blend": "screen"}}}
422 light.ambient {"light": {"ambient": 2}}
422 layers.releif {"layers": {"releif": {"scale": 2}}}
422 layers.relief.sacle {"layers": {"relief": {"sacle": 2}}}
422 layers.colours.ramp {"layers": {"colours": {"kind": "ramp", "ramp": "rainbow"}}}
422 layers.relief.kind {"layers": {"relief": {"kind": "lava"}}}
422 lenses.loupe.layers.clouds {"lenses": {"loupe": {"layers": {"clouds": {"opacity": 0}}}}}
422 lens {"lens": {}}
422 lenses.loupe.radius_m {"lenses": {"loupe": {"radius_m": 0}}}
422 lenses.loupe.radius_m {"lenses": {"loupe": {"radius_m": -3}}}
422 lenses.loupe.latitude_deg {"lenses": {"loupe": {"latitude_deg": 91}}}
422 lenses.loupe.layers.relief.scale {"lenses": {"loupe": {"layers": {"relief": {"scale": 101}}}}}
422 lenses.loupe.layers.relief {"layers": {"relief": null}}
422 layers.relief {"layers": {"relief": 7}}
422 layers.relief.scale {"layers": {"relief": {"scale": [2]}}}
422 layers {"layers": [{"name": "relief"}]}
422 camera {"camera": null}
422 layers.more.repository {"layers": {"more": {"kind": "imagery", "repository": "beside"}}}
422 - 7
422 - null"#;

fn row(line: &str) -> (u16, &str, &str) {
    let mut words = line.splitn(3, ' ');
    let mut word = || words.next().unwrap();
    (word().parse().unwrap(), word(), word())
}

#[test]
fn whatever_is_wrong_is_told_with_its_path_and_changes_nothing() {
    let running = start();
    let before = get(running.address).body;
    let json_type = ("Content-Type", "application/merge-patch+json");
    let large = format!(
        r#"{{"light": {{"ambient": 0.5}}, "x": "{}"}}"#,
        "x".repeat(1 << 20)
    );
    let empty_and_large = [(400, "-", ""), (413, "-", &*large)];
    for (status, path, body) in WRONG.lines().map(row).chain(empty_and_large) {
        let answer = request(
            running.address,
            "PATCH",
            "/api/scene",
            &[json_type],
            body.as_bytes(),
        );
        let shown: String = body.chars().take(80).collect();
        assert_eq!(answer.status, status, "{shown}: {}", answer.body);
        let error = answer.body["error"].as_str().unwrap();
        let given = answer.body["path"].as_str().unwrap_or_default();
        assert!(!error.is_empty(), "{shown}");
        // The path may go on to the part that is missing, but not stop short.
        let goes_on = |rest: &str| rest.is_empty() || rest.starts_with(['.', '[']);
        assert!(
            match path {
                "-" => given.is_empty(),
                path => given.strip_prefix(path).is_some_and(goes_on),
            },
            "{shown}: the path is {given}, not {path}: {error}"
        );
        assert_eq!(answer.header("content-type"), Some("application/json"));
        assert_eq!(get(running.address).body, before, "{shown}");
    }
    let unknown = patch(
        running.address,
        &json!({ "layers": { "releif": { "scale": 2 } } }),
    );
    let error = unknown.body["error"].as_str().unwrap();
    assert!(
        error.contains("no layer \"releif\"") && error.contains("lines, photo, relief"),
        "{error}"
    );
    // One bad value spoils the good ones beside it.
    let half = json!({ "light": { "ambient": 0.9 }, "layers": { "relief": { "scale": 1000 } } });
    assert_eq!(patch(running.address, &half).status, 422);
    assert_eq!(get(running.address).body, before);
    assert_eq!(
        patch(running.address, &json!({ "light": { "ambient": 0.9 } })).revision(),
        2
    );
}

#[test]
fn how_the_surface_is_meshed_is_changed_like_everything_else() {
    let running = start();
    let before = get(running.address).body["scene"]["mesh"].clone();
    assert_eq!(
        (&before["refine"], &before["tau"], &before["wireframe"]),
        (&json!("top-down"), &json!(1.0), &json!(false))
    );
    let change = json!({ "mesh": { "refine": "bottom-up", "tau": 0.5, "wireframe": true } });
    assert_eq!(patch(running.address, &change).revision(), 2);
    let mut expected = before;
    expected["refine"] = json!("bottom-up");
    expected["tau"] = json!(0.5);
    expected["wireframe"] = json!(true);
    assert_eq!(get(running.address).body["scene"]["mesh"], expected);
    for (tau, advice) in [
        (json!(0), "0.05…100"),
        (json!(-1.0), "0.05…100"),
        (json!(1e6), "0.05…100"),
        (json!("fine"), "a number"),
    ] {
        let refused = patch(running.address, &json!({ "mesh": { "tau": tau } }));
        assert_eq!(refused.status, 422, "{tau}");
        let error = refused.body["error"].as_str().unwrap();
        assert!(
            error.contains("mesh.tau") && error.contains(advice),
            "{error}"
        );
    }
    assert_eq!(get(running.address).body["scene"]["mesh"], expected);
}

/// Method, path, status and a header of requests that must change nothing; a header without value is left out.
const FOREIGN: &str = r#"PATCH /api/scene 415 Content-Type: text/plain
PATCH /api/scene 415 Content-Type:
PATCH /api/scene 415 Content-Encoding: gzip
PATCH /api/scene 409 If-Match: "2"
PATCH /api/scene 409 If-Match: "0"
PATCH /api/scene 403 Host: wall.example
PATCH /api/scene 403 Host: wall.example:4680
PATCH /api/scene 403 Host:
PATCH /api/scene 403 Origin: http://wall.example
PATCH /api/scene 403 Origin: null
PATCH http://wall.example/api/scene 403 Accept: */*
GET /api/scene 403 Host: wall.example
PUT /api/scene 405 Accept: */*
OPTIONS /api/scene 405 Accept: */*
DELETE /api/scene 405 Accept: */*
GET / 404 Accept: */*
PATCH /api/scene/layers 404 Accept: */*
GET /api/scene/../../etc/passwd 404 Accept: */*"#;

#[test]
fn requests_that_are_none_of_its_own_are_refused() {
    let running = start();
    let address = running.address;
    let before = get(address).body;
    let body = br#"{"light": {"ambient": 0.5}}"#;
    let json_type = ("Content-Type", "application/json");
    for line in FOREIGN.lines() {
        let words: Vec<&str> = line.splitn(4, ' ').collect();
        let (method, path, status) = (words[0], words[1], words[2].parse::<u16>().unwrap());
        let (name, value) = words[3].split_once(':').unwrap();
        let mut headers = vec![(name, value.trim())];
        if name != "Content-Type" {
            headers.push(json_type);
        }
        let answer = request(address, method, path, &headers, body);
        assert_eq!(
            answer.status, status,
            "{method} {path} {headers:?}: {}",
            answer.body
        );
        assert!(
            answer.body["error"].is_string(),
            "{method} {path} {headers:?}"
        );
        if status == 405 {
            let allowed = answer.header("allow").unwrap();
            assert!(
                allowed.contains("GET") && allowed.contains("PATCH"),
                "{allowed}"
            );
        }
        assert_eq!(get(address).body, before, "{method} {path} {headers:?}");
    }
    // The right base, and a browser's page that the API itself would have shown.
    let origin = format!("http://{address}");
    let headers = [json_type, ("If-Match", "\"1\""), ("Origin", &*origin)];
    assert_eq!(
        request(address, "PATCH", "/api/scene", &headers, body).revision(),
        2
    );
    // No HTTP at all.
    let noise = std::net::TcpStream::connect(address).unwrap();
    std::io::Write::write_all(&mut &noise, &[0xff; 300]).unwrap();
    assert_eq!(get(address).revision(), 2);
}

#[test]
fn a_token_is_wanted_where_there_is_one() {
    let secret = "correct-horse";
    let running = start_with(|options| {
        options.control = Some(ControlOptions {
            bind: "0.0.0.0:0".parse().unwrap(),
            token: Some(secret.to_owned()),
        });
    })
    .unwrap();
    let address = SocketAddr::from(([127, 0, 0, 1], running.address.port()));
    for given in [
        "",
        "Bearer",
        "Bearer wrong-horse",
        "Bearer correct-hors",
        "Basic correct-horse",
    ] {
        for (method, body) in [("GET", ""), ("PATCH", r#"{"light": {"ambient": 0.5}}"#)] {
            let headers = [
                ("Content-Type", "application/json"),
                ("Authorization", given),
            ];
            let answer = request(address, method, "/api/scene", &headers, body.as_bytes());
            assert_eq!(answer.status, 401, "{given}");
            assert!(
                answer
                    .header("www-authenticate")
                    .unwrap()
                    .starts_with("Bearer")
            );
            assert!(
                answer.body["error"]
                    .as_str()
                    .unwrap()
                    .contains("--token-file")
            );
        }
    }
    let right = ("Authorization", "Bearer correct-horse");
    let headers = [right, ("Host", "wall.example:4680")];
    assert_eq!(
        request(address, "GET", "/api/scene", &headers, b"").revision(),
        1
    );

    let open = start_with(|options| {
        options.control = Some(ControlOptions {
            bind: "0.0.0.0:0".parse().unwrap(),
            token: None,
        });
    });
    let Err(StartError::Control(error)) = open.map(|_| ()) else {
        panic!("open to everyone")
    };
    assert!(
        error.to_string().contains("--control-token-file"),
        "{error}"
    );
}

#[test]
fn clients_that_change_different_values_at_once_lose_none() {
    const ROUNDS: u32 = 12;
    let running = start();
    let address = running.address;
    let values = [
        ["layers", "relief", "scale"],
        ["layers", "relief", "offset_m"],
        ["layers", "relief", "datum_shift_m"],
        ["layers", "photo", "exposure_stops"],
        ["layers", "photo", "contrast"],
        ["layers", "photo", "gamma"],
        ["layers", "lines", "spacing_m"],
        ["layers", "lines", "width_px"],
    ];
    let mut revisions: Vec<u64> = std::thread::scope(|scope| {
        let clients = values.map(|[top, layer, key]| {
            scope.spawn(move || {
                (1..=ROUNDS)
                    .map(|round| {
                        let value = 1.0 + f64::from(round) / 8.0;
                        let answer = patch(address, &json!({ top: { layer: { key: value } } }));
                        let revision = answer.revision();
                        // What was answered is there from then on.
                        let seen = get(address);
                        assert_eq!(seen.body["scene"][top][layer][key], json!(value), "{key}");
                        assert!(seen.revision() >= revision);
                        revision
                    })
                    .collect::<Vec<u64>>()
            })
        });
        clients.map(|client| client.join().unwrap()).concat()
    });
    let scene = get(address);
    for [top, layer, key] in values {
        let last = 1.0 + f64::from(ROUNDS) / 8.0;
        assert_eq!(
            scene.body["scene"][top][layer][key],
            json!(last),
            "{key} was lost"
        );
    }
    revisions.sort_unstable();
    let all: Vec<u64> = (2..2 + u64::from(ROUNDS) * 8).collect();
    assert_eq!(revisions, all, "every change has a revision of its own");
    assert_eq!(scene.revision(), *all.last().unwrap());
}

#[test]
fn a_value_can_be_counted_up_by_many_with_if_match() {
    const ROUNDS: u32 = 5;
    let running = start();
    let address = running.address;
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..ROUNDS {
                    loop {
                        let seen = get(address);
                        let offset = &seen.body["scene"]["layers"]["relief"]["offset_m"];
                        let next = offset.as_f64().unwrap() + 1.0;
                        let body = json!({ "layers": { "relief": { "offset_m": next } } });
                        let tag = seen.header("etag").unwrap();
                        let headers = [("Content-Type", "application/json"), ("If-Match", tag)];
                        let body = body.to_string();
                        match request(address, "PATCH", "/api/scene", &headers, body.as_bytes()) {
                            answer if answer.status == 409 => {}
                            answer => break assert!(answer.revision() > seen.revision()),
                        }
                    }
                }
            });
        }
    });
    let scene = get(address);
    let counted = &scene.body["scene"]["layers"]["relief"]["offset_m"];
    assert_eq!(counted, &json!(f64::from(4 * ROUNDS)));
}

#[test]
fn relative_repositories_lie_beside_the_scene_file() {
    let running =
        start_with(|options| options.scene_directory = Some("/walls/one".into())).unwrap();
    let more = json!({ "layers": { "more": { "kind": "imagery", "repository": "data/more" } } });
    assert_eq!(patch(running.address, &more).revision(), 2);
    let layers = &get(running.address).body["scene"]["layers"];
    assert_eq!(layers["more"]["repository"], json!("/walls/one/data/more"));
    assert_eq!(layers["relief"]["repository"], json!("/data/elevation"));
}

#[test]
fn a_taken_port_is_told_and_the_end_of_the_run_closes_the_api() {
    let running = start();
    let bind = running.address;
    let again = |any: bool| {
        start_with(|options| {
            options.control = Some(ControlOptions { bind, token: None });
            options.any_control_port = any;
        })
    };
    let Err(StartError::Control(error)) = again(false).map(|_| ()) else {
        panic!("two listen at one port")
    };
    assert!(error.to_string().contains(&bind.to_string()), "{error}");
    let other = again(true).unwrap();
    assert_ne!(other.address, bind);
    assert_eq!(get(other.address).revision(), 1);

    running.master.stop();
    running.master.finish().unwrap();
    assert!(
        std::net::TcpStream::connect(bind).is_err(),
        "nobody listens any longer"
    );
    let without = start_with(|options| options.control = None).unwrap();
    assert_eq!(without.master.control_address(), None);
}
