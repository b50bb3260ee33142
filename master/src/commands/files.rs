//! Wall and scene files: from a path to what is validated.
//!
//! In: paths. Out: a wall or a scene, or a failure of configuration that names the file and what to do.

use std::path::Path;
use std::sync::Arc;

use anyhow::Context as _;
use master::{OpenSurfaces, WallFile};
use protocol::{Scene, Wall};

use crate::failure::{Failure, OrConfiguration as _};

/// Reads and validates a wall file. The files that it names are taken from its directory.
pub(crate) fn wall(path: &Path) -> Result<Wall, Failure> {
    let mut wall =
        Wall::parse(&text(path, "wall")?, &path.display().to_string()).or_configuration()?;
    let file =
        std::path::absolute(path).with_context(|| format!("cannot resolve {}", path.display()))?;
    let directory = file.parent().unwrap_or(Path::new("/"));
    for named in wall.files_mut() {
        *named = directory.join(&*named).to_string_lossy().into_owned();
    }
    Ok(wall)
}

/// Reads the files that a wall names, as its hosts do.
pub(crate) fn open_surfaces() -> OpenSurfaces {
    Arc::new(|wall| node::surfaces(wall).map_err(|error| error.to_string()))
}

/// The same file, to be changed while the wall runs.
pub(crate) fn wall_file(path: &Path) -> Result<Option<WallFile>, Failure> {
    Ok(WallFile::open(path, &text(path, "wall")?))
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
