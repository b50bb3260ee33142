//! What a renderer is asked, and what it says of a frame: views, limits, figures.
//! Plain data.

use std::time::Duration;

use glam::{DMat3, DVec3};

use crate::canvas::PlanarScreen;
use crate::outputs::WarpPart;

/// Limits of memory and time.
#[derive(Clone, Copy, Debug)]
pub struct RenderBudget {
    /// GPU memory for tiles and meshes in bytes.
    pub gpu_bytes: u64,
    /// Time that processing the next scene may take from one frame. What the shown scene lacks may take as long as its
    /// picture takes to draw, if that is more.
    pub upload: Duration,
    /// Other nodes want this machine's processors too. It counts only where the driver computes on them as well.
    pub shared: bool,
}

/// Where the viewers' eyes are, and what is to be drawn for each.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewPoint {
    /// Eyes in ECEF metres.
    pub eyes: Vec<DVec3>,
    /// The room's x, y and z axes in ECEF, as columns.
    pub room: DMat3,
    /// What is seen from the eyes.
    pub views: Vec<EyeView>,
    /// The parts of each channel that is warped. An empty list shows nothing.
    pub warps: Vec<Vec<WarpPart>>,
    /// Density of the wall's densest screen. The same on every node.
    pub pixels_per_radian: f64,
}

/// A picture on a plane, seen from an eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeView {
    /// Index into [`ViewPoint::eyes`].
    pub eye: usize,
    /// The plane's rectangle in room axes, relative to the eye.
    pub screen: PlanarScreen,
}

/// What one call of [`Renderer::draw`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameStatistics {
    /// False where nothing had changed and the old picture stands.
    pub redrawn: bool,
    /// True when every visible tile shows the best data that exists.
    pub converged: bool,
    /// Tiles that are still on their way.
    pub pending_tiles: u32,
    /// Leaves of the selection over the whole planet.
    pub selected_tiles: u32,
    /// Patches drawn, over all blocks.
    pub drawn_tiles: u32,
    /// Triangles drawn.
    pub triangles: u64,
    /// Results made in this frame: fused heights or colours of a tile.
    pub processed_tiles: u32,
    /// The scene in preparation, once everything that this view needs of it is there.
    pub prepared: Option<u64>,
    /// Leaves whose heights were brought to the device in this frame.
    pub meshes_built: u32,
    /// Leaves whose mesh was made in this frame. All others were used again.
    pub refined_leaves: u32,
    /// The screen-space error in wall pixels that the meshes stay under: the scene's τ, or a multiple of it where the
    /// memory for meshes forbids it. 0 where nothing is refined.
    pub achieved_tau_px: f64,
    /// The side in pixels beyond which tiles were split: the scene's, or more where budgets forbid it.
    pub achieved_tile_px: f64,
    /// It is more, and a larger budget would not change that.
    pub is_device_bound: bool,
}
