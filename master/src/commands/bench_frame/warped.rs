//! What warping costs: one display of 1920×1080 on a cylinder, moving at 500 km.
//!
//! In: an open device and the scene of the bench. Out: milliseconds of a frame, and of its warp passes, measured over
//! the same path in two runs, because passes that are timed one by one hold up the others.

use node::WallPictureMaker;
use protocol::Scene;
use serde::Serialize;

use super::{Bench, near, quantile};
use crate::failure::Failure;

/// A quarter of a cylinder, seen from beside its axis.
const WALL: &str = "\
[wall]
name = \"bench\"
fps = 60

[[observers]]
name = \"viewer\"
head_m = [0.3, 1.6, 0.2]

[[screens]]
name = \"arc\"
kind = \"cylinder\"
observer = \"viewer\"
foot_m = [0.0, 0.0, 0.0]
radius_m = 2.5
azimuth_deg = [-45.0, 45.0]
height_m = [0.4, 2.6]
size_px = [1920, 1080]

[[hosts]]
name = \"here\"
[[hosts.outputs]]
name = \"out\"
size_px = [1920, 1080]
headless = true
channels = [{ screen = \"arc\", canvas_px = [0, 0, 1920, 1080] }]
";

/// One warped output.
#[derive(Debug, Serialize)]
pub(super) struct WarpFigures {
    /// Half of the frames took less, in milliseconds, warping included.
    frame_p50_ms: f64,
    /// Half of the frames were warped in less, in milliseconds.
    warp_p50_ms: f64,
    /// The one over the other.
    warp_share: f64,
}

impl WarpFigures {
    pub(super) fn line(&self) -> String {
        let Self {
            frame_p50_ms,
            warp_p50_ms,
            warp_share,
        } = self;
        format!(
            "warping 1920×1080 onto a cylinder: {warp_p50_ms:.2} ms of {frame_p50_ms:.1} ms, {:.1} % of a frame",
            warp_share * 100.0
        )
    }
}

/// Measures `frames` frames.
pub(super) fn measure(
    maker: &mut WallPictureMaker,
    scene: Scene,
    frames: u32,
) -> Result<WarpFigures, Failure> {
    let mut bench = Bench::open(maker, WALL, scene)?;
    bench.picture.prepare_scene(1, &bench.scene)?;
    let arc = bench.view("cylinder", near(), frames)?;
    bench.picture.time_passes(true);
    let mut warp_ms = Vec::new();
    for frame in 1..=frames {
        drop(bench.picture.take_pass_times());
        bench.draw(frame)?;
        let passes = bench.picture.take_pass_times();
        let warps = passes.iter().filter(|pass| pass.label == "output/warp");
        warp_ms.push(warps.map(|pass| pass.ms).sum::<f64>());
    }
    let warp_p50_ms = quantile(&warp_ms, 0.5);
    if warp_p50_ms.is_nan() || warp_p50_ms <= 0.0 {
        return Err(Failure::failed("no pass warped the cylinder's picture"));
    }
    Ok(WarpFigures {
        frame_p50_ms: arc.p50_ms,
        warp_p50_ms,
        warp_share: warp_p50_ms / arc.p50_ms,
    })
}
