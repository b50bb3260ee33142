//! Every WGSL file is listed, resolves and passes naga; every compute stage has its CPU twin.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::path::Path;

use naga::valid::{Capabilities, ValidationFlags, Validator};
use shaders::Stage;

#[test]
fn every_stage_validates() {
    for stage in Stage::ALL {
        let source = stage.source().unwrap();
        let module = naga::front::wgsl::parse_str(&source)
            .unwrap_or_else(|error| panic!("{}: {}", stage.name(), error.emit_to_string(&source)));
        Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .unwrap_or_else(|error| panic!("{}: {error:?}", stage.name()));
    }
}

#[test]
fn every_file_is_listed_and_opens_with_its_duty() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("wgsl");
    let mut found = Vec::new();
    for folder in std::fs::read_dir(&root).unwrap() {
        for file in std::fs::read_dir(folder.unwrap().path()).unwrap() {
            let path = file.unwrap().path();
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(
                text.starts_with("// "),
                "{} does not say its duty",
                path.display()
            );
            let name = path.strip_prefix(&root).unwrap().with_extension("");
            found.push(name.to_string_lossy().into_owned());
        }
    }
    for name in found.iter().filter(|name| !name.starts_with("shared/")) {
        assert!(
            Stage::ALL.iter().any(|stage| stage.name() == name),
            "{name} is not in Stage::ALL"
        );
    }
}

#[test]
fn every_compute_stage_has_a_twin() {
    for stage in Stage::ALL.into_iter().filter(|stage| stage.is_compute()) {
        let name = stage.name().rsplit('/').next().unwrap();
        let twin = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("src/cpu/{name}.rs"));
        assert!(twin.exists(), "{name} has no CPU twin");
    }
}

#[test]
fn compute_stages_are_exactly_those_with_compute_entry_points() {
    for stage in Stage::ALL {
        assert_eq!(
            stage.source().unwrap().contains("@compute"),
            stage.is_compute(),
            "{}",
            stage.name()
        );
    }
}
