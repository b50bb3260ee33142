//! What is shown: planet, camera, layers, lenses, light, air and mesh.
//! In: TOML text or JSON. Out: a validated [`Scene`], its JSON, or an error that names place, value and remedy.
//! It opens no file; credentials have no place in it, because it is sent to every node.

mod assignment;
mod check;
mod fields;
mod json;
mod keys;
mod layer;
mod lens;
mod process;
mod ramps;
mod raw;
mod slot;

use std::path::Path;

use geodesy::Ellipsoid;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::config::{ConfigError, Document, Problem};

pub use assignment::AssignmentError;
pub use layer::{Blend, Fusion, Layer, LayerKind, LayerParameters};
pub use lens::{Lens, LensLayer};
pub use process::{
    Aspect, Elevation, Hillshade, Imagery, Isolines, Process, Ramp, RampName, RampStop, Sar,
    SarMapping, Slope,
};

/// Why a scene was refused.
pub type SceneError = ConfigError;

/// Most elevation layers of a scene: as many as are fused at once.
pub const MAX_ELEVATION_LAYERS: usize = 8;
/// Most layers of all other kinds together: as many colours as are fused at once.
pub const MAX_COLOUR_LAYERS: usize = 8;
/// Most lenses of a scene.
pub const MAX_LENSES: usize = 8;
/// Most keyframes of a camera path.
pub const MAX_KEYFRAMES: usize = 4096;

/// A validated scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// The body whose surface is shown.
    pub planet: Ellipsoid,
    /// Where the viewer is, over time.
    pub camera: Camera,
    /// What is shown of the surface, sorted by name: at most 8 layers of elevation and 8 of all other kinds.
    pub layers: Vec<Layer>,
    /// Where other parameters hold, sorted by name, at most 8.
    pub lenses: Vec<Lens>,
    /// How the surface is lit.
    pub light: Light,
    /// The air around the planet.
    pub atmosphere: Atmosphere,
    /// How finely the surface is drawn.
    pub mesh: MeshOptions,
}

/// How the surface is lit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Light {
    /// Where light comes from.
    pub sun: Sun,
    /// Share of light that reaches every surface, 0…1.
    pub ambient: f64,
    /// Factor on slopes when they are shaded, and only then, 0…100. 1 is the truth.
    pub relief: f64,
}

/// Where light comes from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Sun {
    /// Over the viewer's left shoulder, so that whatever is looked at is lit.
    Camera,
    /// From the zenith of a place.
    Fixed {
        /// Latitude where the sun is in the zenith, −90…90.
        latitude_deg: f64,
        /// Longitude where the sun is in the zenith, −180…180.
        longitude_deg: f64,
    },
}

/// The air around the planet.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Atmosphere {
    /// Whether it is drawn.
    pub enabled: bool,
    /// Height in metres at which it ends, 1…10⁶.
    pub thickness_m: f64,
    /// Linear red, green, blue of the scattered light, each 0…1.
    pub colour: [f64; 3],
}

/// How finely the surface is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshOptions {
    /// How the mesh of a tile is made.
    pub refine: Refine,
    /// How far a sample may be from the drawn surface on the wall, in pixels, 0.05…100. It bounds meshes whose making
    /// is [`Refine::BottomUp`] or [`Refine::TopDown`].
    pub tau: f64,
    /// Draws the edges of triangles and of tiles over the surface.
    pub wireframe: bool,
    /// Of [`Refine::Off`] only, the base level: 2^refinement squares a side of a tile, of four triangles each, 0…7.
    pub refinement: u8,
    /// Side of a tile on the wall, in pixels, above which it splits, 16…4096.
    pub tile_px: f64,
    /// The deepest level that is drawn, 0…22.
    pub deepest_level: u8,
}

/// How the mesh of a tile is made (Lambers 2011, chapter 3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Refine {
    /// The same squares everywhere, whatever error that leaves.
    Off,
    /// Every sample is a vertex.
    Fine,
    /// Every mark is tested, short edges first.
    BottomUp,
    /// Triangles are split from the coarsest on, where they must be. The mesh is that of [`Refine::BottomUp`].
    TopDown,
}

impl Refine {
    /// Whether τ bounds the error of such meshes.
    #[must_use]
    pub fn is_bounded(self) -> bool {
        matches!(self, Self::BottomUp | Self::TopDown)
    }
}

impl Default for Light {
    fn default() -> Self {
        Self {
            sun: Sun::Camera,
            ambient: 0.15,
            relief: 1.0,
        }
    }
}

impl Default for Atmosphere {
    fn default() -> Self {
        Self {
            enabled: true,
            thickness_m: 80_000.0,
            colour: [0.30, 0.55, 1.0],
        }
    }
}

impl Default for MeshOptions {
    fn default() -> Self {
        Self {
            refine: Refine::TopDown,
            tau: 1.0,
            wireframe: false,
            refinement: 3,
            tile_px: 257.0,
            deepest_level: geodesy::MAX_LEVEL,
        }
    }
}

/// A repository's place that cannot be sent to other hosts.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "layer \"{layer}\": the path {path} is not valid UTF-8 and cannot be sent to nodes; move the scene or the repository to a path that is"
)]
pub struct ResolveError {
    /// The layer's name.
    pub layer: String,
    /// The path, as far as it can be shown.
    pub path: String,
}

impl Scene {
    /// Reads and validates a scene. `origin` names the text in errors, usually the file's path.
    ///
    /// # Errors
    /// The first thing that is wrong, with its line and column and what to write instead.
    pub fn parse(text: &str, origin: &str) -> Result<Self, SceneError> {
        Self::read(&Document::parse(text, origin)?)
    }

    /// Checks a scene that did not come from [`Scene::parse`], for example one from the wire.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn validate(&self) -> Result<(), SceneError> {
        self.check().map_err(Problem::without_origin)
    }

    fn read(document: &Document<'_>) -> Result<Self, SceneError> {
        let scene = raw::read(document)?;
        scene
            .check()
            .map_err(|problem| document.error_at(problem))?;
        Ok(scene)
    }

    /// The scene with the repositories' relative paths taken from `base_directory`, usually the
    /// directory of the scene file. Absolute paths and URLs stay as they are.
    ///
    /// # Errors
    /// A path that is not valid UTF-8.
    pub fn resolve(mut self, base_directory: &Path) -> Result<Self, ResolveError> {
        for layer in &mut self.layers {
            let Some(repository) = &mut layer.repository else {
                continue;
            };
            if repository.contains("://") {
                continue;
            }
            let path = base_directory.join(&*repository).into_os_string();
            *repository = path.into_string().map_err(|path| ResolveError {
                layer: layer.name.clone(),
                path: path.to_string_lossy().into_owned(),
            })?;
        }
        Ok(self)
    }
}
