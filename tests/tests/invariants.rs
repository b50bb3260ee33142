//! The invariants that README states, held against `cargo metadata` and the sources themselves.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, PackageId};
use tests::sources;

/// Crate → the crates of the house that it may use, and nothing else.
const ARROWS: &[(&str, &[&str])] = &[
    ("geodesy", &[]),
    ("screens", &[]),
    ("calibration", &[]),
    ("protocol", &["geodesy", "screens"]),
    ("link", &["protocol"]),
    ("shaders", &[]),
    ("disk_cache", &[]),
    ("tiles", &["disk_cache", "geodesy"]),
    ("terrain", &["geodesy"]),
    ("import", &["geodesy", "tiles"]),
    ("render", &["geodesy", "shaders", "terrain", "tiles"]),
    ("repositories", &["geodesy", "tiles"]),
    (
        "node",
        &[
            "calibration",
            "link",
            "protocol",
            "render",
            "repositories",
            "screens",
        ],
    ),
    ("tracking", &[]),
    ("convert", &[]),
    ("serve", &["tiles"]),
    (
        "master",
        &[
            "convert", "import", "link", "node", "protocol", "screens", "serve", "tracking",
        ],
    ),
];

/// Crate → packages that must not be reached from it, however far away.
const FORBIDDEN: &[(&str, &[&str])] = &[
    ("protocol", &["tokio", "quinn", "wgpu", "winit", "socket2"]),
    ("geodesy", &["tokio", "quinn", "wgpu", "winit", "socket2"]),
    ("terrain", &["tokio", "quinn", "wgpu", "winit", "socket2"]),
    ("screens", &["tokio", "quinn", "wgpu", "winit", "socket2"]),
    (
        "calibration",
        &["tokio", "quinn", "wgpu", "winit", "socket2"],
    ),
    ("convert", &["tokio", "quinn", "wgpu", "winit", "socket2"]),
    ("tracking", &["quinn", "wgpu", "winit"]),
    ("render", &["tokio", "quinn", "rustls", "link", "protocol"]),
    ("disk_cache", &["wgpu", "winit", "quinn", "tokio"]),
    ("tiles", &["wgpu", "winit", "quinn", "tokio"]),
    ("import", &["wgpu", "winit", "quinn", "tokio"]),
    // What is compiled C beyond ring stays out.
    (
        "repositories",
        &[
            "wgpu",
            "winit",
            "quinn",
            "aws-lc-rs",
            "aws-lc-sys",
            "openssl-sys",
            "native-tls",
        ],
    ),
    ("serve", &["wgpu", "winit", "quinn", "rustls", "reqwest"]),
];

/// Package → the crates of the house that may name it.
const CONFINED: &[(&str, &[&str])] = &[
    ("quinn", &["link"]),
    ("rustls", &["link", "repositories"]),
    ("rcgen", &["link"]),
    ("bincode", &["protocol"]),
    ("wgpu", &["render"]),
    ("anyhow", &["master", "node"]),
    ("clap", &["master"]),
    ("axum", &["master", "serve"]),
    ("tower-http", &["serve"]),
    ("object_store", &["repositories"]),
    ("reqwest", &["repositories"]),
    ("ureq", &["master"]),
];

fn metadata() -> Metadata {
    let version = Command::new("rustc")
        .arg("-vV")
        .output()
        .expect("rustc runs");
    let version = String::from_utf8(version.stdout).unwrap();
    let host = version
        .lines()
        .find_map(|line| line.strip_prefix("host: "))
        .unwrap();
    MetadataCommand::new()
        .manifest_path(sources::root().join("Cargo.toml"))
        .other_options(vec![
            "--locked".to_owned(),
            "--filter-platform".to_owned(),
            host.to_owned(),
        ])
        .exec()
        .expect("cargo metadata runs")
}

/// Direct dependencies of each crate of the house, tests' own ones left out.
fn direct(metadata: &Metadata) -> BTreeMap<String, BTreeSet<String>> {
    metadata
        .workspace_packages()
        .into_iter()
        .map(|package| {
            let used = package
                .dependencies
                .iter()
                .filter(|used| used.kind != DependencyKind::Development);
            (
                package.name.to_string(),
                used.map(|used| used.name.clone()).collect(),
            )
        })
        .collect()
}

#[test]
fn the_arrows_are_those_of_the_house() {
    let direct = direct(&metadata());
    let house: BTreeSet<&String> = direct.keys().collect();
    let listed: BTreeSet<&str> = ARROWS
        .iter()
        .map(|(name, _)| *name)
        .chain(["tests"])
        .collect();
    assert_eq!(
        house
            .iter()
            .map(|name| name.as_str())
            .collect::<BTreeSet<_>>(),
        listed
    );
    for (name, allowed) in ARROWS {
        for used in direct[*name].iter().filter(|used| house.contains(used)) {
            assert!(
                allowed.contains(&used.as_str()),
                "{name} must not use {used}"
            );
        }
    }
}

#[test]
fn nothing_forbidden_is_reached() {
    let metadata = metadata();
    let names: BTreeMap<&PackageId, &str> = metadata
        .packages
        .iter()
        .map(|package| (&package.id, package.name.as_str()))
        .collect();
    let resolve = metadata.resolve.as_ref().expect("a resolved graph");
    let edges: BTreeMap<&PackageId, Vec<&PackageId>> = resolve
        .nodes
        .iter()
        .map(|node| {
            let used = node.deps.iter().filter(|dependency| {
                dependency
                    .dep_kinds
                    .iter()
                    .any(|kind| kind.kind == DependencyKind::Normal)
            });
            (&node.id, used.map(|dependency| &dependency.pkg).collect())
        })
        .collect();
    for (name, forbidden) in FORBIDDEN {
        let start = metadata
            .workspace_packages()
            .into_iter()
            .find(|package| package.name == *name)
            .unwrap();
        let mut reached = BTreeSet::from([&start.id]);
        let mut waiting = vec![&start.id];
        while let Some(package) = waiting.pop() {
            waiting.extend(
                edges[package]
                    .iter()
                    .copied()
                    .filter(|used| reached.insert(used)),
            );
        }
        let reached: BTreeSet<&str> = reached.into_iter().map(|id| names[id]).collect();
        for package in *forbidden {
            assert!(
                !reached.contains(package),
                "{name} must not reach {package}"
            );
        }
    }
}

#[test]
fn confined_packages_stay_where_they_belong() {
    let direct = direct(&metadata());
    for (package, owners) in CONFINED {
        for (name, used) in direct.iter().filter(|(name, _)| *name != "tests") {
            assert!(
                !used.contains(*package) || owners.contains(&name.as_str()),
                "{name} must not use {package}"
            );
        }
    }
}

#[test]
fn the_masters_library_knows_neither_node_nor_import() {
    for source in sources::all(&[".rs"]) {
        // The command (args, commands and what only they use) may; the modules of the library may not.
        let library = std::fs::read_to_string(sources::root().join("master/src/lib.rs")).unwrap();
        let module = source
            .path
            .strip_prefix("master/src/")
            .and_then(|path| path.strip_suffix(".rs"));
        let Some(module) = module.filter(|module| library.contains(&format!("mod {module};")))
        else {
            continue;
        };
        for word in ["node::", "import::"] {
            let named = source.without_tests().match_indices(word).any(|(at, _)| {
                !source.text[..at]
                    .ends_with(|before: char| before.is_alphanumeric() || "_:".contains(before))
            });
            assert!(!named, "master's library module {module} uses {word}");
        }
    }
}

#[test]
fn manifests_state_nothing_twice() {
    for manifest in sources::all(&["Cargo.toml"])
        .iter()
        .filter(|manifest| manifest.path != "Cargo.toml")
    {
        assert!(
            manifest.text.contains("[lints]\nworkspace = true"),
            "{} must use the lints",
            manifest.path
        );
        let mut table = "";
        for line in manifest.text.lines() {
            if line.starts_with('[') {
                table = line;
            } else if table.contains("dependencies") && line.contains('=') {
                assert!(
                    line.contains("workspace = true"),
                    "{}: version stated beside the root: {line}",
                    manifest.path
                );
            }
        }
    }
}

#[test]
fn every_file_opens_with_its_duty_and_stays_readable() {
    for source in sources::all(&[".rs", ".wgsl"]) {
        let head = if source.path.ends_with(".rs") {
            "//!"
        } else {
            "//"
        };
        assert!(
            source.text.starts_with(head),
            "{} must open with {head}",
            source.path
        );
        let lines = source.text.lines().count();
        assert!(lines <= 800, "{} has {lines} lines: split it", source.path);
    }
}

#[test]
fn only_geodesy_knows_ellipsoid_constants() {
    // WGS84's axes and flattening as they are usually written; digits may be grouped.
    let constants = ["6378137", "6378.137", "6356752", "298.257"];
    for source in sources::all(&[".rs", ".wgsl"]) {
        if source.path.starts_with("protocol/geodesy/") || source.is_test() {
            continue;
        }
        let digits = source.without_tests().replace('_', "");
        for constant in constants {
            assert!(
                !digits.contains(constant),
                "{} knows the ellipsoid constant {constant}",
                source.path
            );
        }
    }
}

/// Shaders whose twin has another name than they, because what is one function on the CPU takes several passes on the
/// device. They are compared with it together.
const PARTS: [(&str, &str); 6] = [
    ("pyramid_fine", "pyramid"),
    ("seed_marks", "top_down"),
    ("advance", "top_down"),
    ("count_words", "count"),
    ("count_leaves", "count"),
    ("compact", "emit"),
];

/// Twins are in the crate of shaders. Those of refinement are the reference in terrain, but for what reads samples.
#[test]
fn every_compute_shader_has_a_twin() {
    let mut parts = 0;
    for shader in sources::all(&[".wgsl"])
        .iter()
        .filter(|shader| shader.text.contains("@compute"))
    {
        let path = shader.path.trim_end_matches(".wgsl");
        let stem = path.rsplit('/').next().unwrap();
        let refines = path.contains("/refine/");
        let part = PARTS.iter().find(|(part, _)| refines && *part == stem);
        parts += usize::from(part.is_some());
        let twin = match part {
            Some((_, whole)) => format!("node/terrain/src/refine/{whole}.rs"),
            None if refines && stem != "leaf_heights" => {
                format!("node/terrain/src/refine/{stem}.rs")
            }
            None => format!("shaders/src/cpu/{stem}.rs"),
        };
        assert!(
            sources::root().join(&twin).is_file(),
            "{} needs its twin on the CPU, {twin}",
            shader.path
        );
        if refines {
            let said = twin.rsplit('/').next().unwrap();
            assert!(
                shader.text.contains(said),
                "{} does not name its twin, {twin}",
                shader.path
            );
        }
    }
    assert_eq!(parts, PARTS.len(), "a part that is no shader");
}

#[test]
fn sources_promise_nothing_and_name_no_machine() {
    // Written in halves, so that this file does not find itself.
    let promises = [
        concat!("TO", "DO"),
        concat!("FIX", "ME"),
        concat!("X", "XX"),
        concat!("for ", "now"),
    ];
    let places = [
        concat!("/wo", "rk/"),
        concat!("/ro", "ot/"),
        concat!("/ho", "me/"),
    ];
    for source in sources::all(&[".rs", ".wgsl", ".toml", ".md"]) {
        for word in promises.iter().chain(&places) {
            assert!(
                !source.text.contains(word),
                "{} contains \"{word}\"",
                source.path
            );
        }
    }
}
