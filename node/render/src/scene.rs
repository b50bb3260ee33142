//! What to draw, in the words of this crate: planet, layers, lenses, light, air, mesh.
//! Plain data; opened and put in order by `loaded`.

use geodesy::Ellipsoid;

use crate::layer::{LayerData, LensData};

/// Sun and ambient light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit vector towards the sun in ECEF axes.
    pub sun: glam::DVec3,
    /// Share of light that is there in full shadow, 0…1.
    pub ambient: f64,
    /// Factor on slopes for shading only, ≥ 0; 1 is the truth.
    pub relief: f64,
}

/// The direction to a sun in the zenith of a place, in degrees.
#[must_use]
pub fn sun_over(latitude_deg: f64, longitude_deg: f64) -> glam::DVec3 {
    Ellipsoid::normal(latitude_deg, longitude_deg)
}

/// The air around the planet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Scale height in metres; 0 switches air off.
    pub thickness_m: f64,
    /// Its colour, gamma encoded, 0…1.
    pub colour: [f64; 3],
}

/// How the mesh of a leaf is made out of its edge mark array (Lambers 2011, chapter 3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Refine {
    /// The base patch, whatever error that leaves.
    Off,
    /// Every mark is set: all samples are vertices.
    Fine,
    /// Every mark is tested, short edges first.
    BottomUp,
    /// Triangles are split from the coarsest on, where they must be. Gives the same mesh as [`Refine::BottomUp`].
    TopDown,
}

impl Refine {
    /// Whether meshes keep a bound on their error.
    #[must_use]
    pub const fn is_bounded(self) -> bool {
        matches!(self, Self::TopDown | Self::BottomUp)
    }
}

/// What to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneData {
    /// The planet.
    pub ellipsoid: Ellipsoid,
    /// The layers, at most eight of elevation and eight others.
    pub layers: Vec<LayerData>,
    /// The lenses; where they overlap, the later one counts.
    pub lenses: Vec<LensData>,
    /// Light.
    pub light: Light,
    /// Air.
    pub air: Air,
    /// How a leaf's mesh is made.
    pub refine: Refine,
    /// The screen-space error in wall pixels that a refined mesh stays under, > 0.
    pub tau_px: f64,
    /// Draws the edges of the mesh and of the quadtree over the surface.
    pub wireframe: bool,
    /// Refinement level l of the base patches, 0…7, for [`Refine::Off`].
    pub refinement: u8,
    /// Side in pixels beyond which a tile is split.
    pub tile_px: f64,
    /// No tile is split beyond this level.
    pub deepest_level: u8,
}
