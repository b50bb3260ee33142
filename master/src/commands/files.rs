//! Wall and scene files: from a path to what is validated.
//!
//! In: paths. Out: a wall or a scene, or a failure of configuration that names the file and what to do.

use std::path::Path;

use anyhow::Context as _;
use protocol::{Scene, Wall};

use crate::failure::{Failure, OrConfiguration as _};

/// Reads and validates a wall file.
pub(crate) fn wall(path: &Path) -> Result<Wall, Failure> {
    Wall::parse(&text(path, "wall")?, &path.display().to_string()).or_configuration()
}

/// Reads and validates a scene file. Its repositories are taken from the scene file's directory.
pub(crate) fn scene(path: &Path) -> Result<Scene, Failure> {
    let scene =
        Scene::parse(&text(path, "scene")?, &path.display().to_string()).or_configuration()?;
    let file =
        std::path::absolute(path).with_context(|| format!("cannot resolve {}", path.display()))?;
    scene
        .resolve(file.parent().unwrap_or(Path::new("/")))
        .or_configuration()
}

fn text(path: &Path, what: &str) -> Result<String, Failure> {
    std::fs::read_to_string(path)
        .with_context(|| {
            format!(
                "cannot read the {what} file {}; check the path and the permissions",
                path.display()
            )
        })
        .or_configuration()
}
