//! What a run has measured, as a value that becomes `report.json`.
//! In: what the [`Recorder`] has collected. Out: a [`Report`] with stable keys. It writes no file.

mod changes;
mod error;
mod recorder;
mod tally;
mod tracker;

use serde::{Deserialize, Serialize};

pub use error::ErrorReport;
pub use recorder::Recorder;
pub use tracker::{TrackerReport, TrackerState};

/// Measurements of a run. Keys are read by other tools: they may be added, never renamed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Name of the wall.
    pub wall: String,
    /// Frames that at least one node presented.
    pub frames: u64,
    /// Such frames per second, between the first and the last; 0 for fewer than two.
    pub fps: f64,
    /// Milliseconds from one frame's presentation on the whole wall to the next frame's.
    pub frame_ms: Quantiles,
    /// Per frame, the last minus the first node's time of presentation, in microseconds on one clock.
    /// Only frames that at least two nodes presented count.
    pub skew_us: QuantilesAndMax,
    /// Bytes of an encoded view.
    pub view_bytes: Max,
    /// Bytes of the encoded scene.
    pub scene_bytes: u64,
    /// Microseconds from the sending of a view to its arrival at a node.
    pub state_latency_us: Quantiles,
    /// Microseconds from the sending of a view to the presentation of its picture.
    pub view_to_present_us: Quantiles,
    /// Largest bound of a node's clock error, in microseconds: what `skew_us` may be off by.
    pub clock_error_us: Max,
    /// What the nodes' tile caches did.
    pub tiles: TileReport,
    /// Deadlines missed, over all nodes. 0 in reports older than this key.
    #[serde(default)]
    pub missed_deadlines: u64,
    /// What became of changes of the scene. Zeros in reports older than this key.
    #[serde(default)]
    pub changes: ChangeReport,
    /// The error of the last picture of every node. Nothing was measured in reports older than this key.
    #[serde(default)]
    pub error_px: ErrorReport,
    /// The largest τ in wall pixels that the meshes of any frame kept on any node: the scene's, or more where the
    /// memory for meshes forbade it. Absent where no frame's meshes kept any.
    #[serde(default)]
    pub achieved_tau: Option<f64>,
    /// The largest side in wall pixels above which tiles were split in any frame: the scene's `mesh.tile_px`, or more
    /// where the memory for tiles (`cache.gpu_mib`) did not hold what was seen. Absent where no frame told one.
    #[serde(default)]
    pub achieved_tile_px: Option<f64>,
    /// Tiles whose meshes were made, over all frames and nodes. All others were used again.
    #[serde(default)]
    pub refined_leaves: u64,
    /// Most triangles that a node drew in a frame.
    #[serde(default)]
    pub triangles: Max,
    /// The wall's trackers, in its order. Empty in reports older than this key.
    #[serde(default)]
    pub trackers: Vec<TrackerReport>,
    /// Whether nothing was missing in the last picture of any node.
    pub converged: bool,
    /// Every host of the wall, in its order.
    pub nodes: Vec<NodeReport>,
    /// What went wrong, at most 100 sentences.
    pub errors: Vec<String>,
    /// Measurements over time, for plots.
    pub series: Series,
}

/// Median and 99th percentile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quantiles {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
}

/// Median, 99th percentile and maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct QuantilesAndMax {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Maximum.
    pub max: f64,
}

/// A maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Max {
    /// Maximum.
    pub max: u64,
}

/// What became of changes of the scene during the run. Every submitted one was shown, superseded or refused,
/// or was undecided when the run ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChangeReport {
    /// Changes that were accepted as revisions.
    pub submitted: u64,
    /// Revisions that were shown.
    pub shown: u64,
    /// Revisions that a later one overtook before any frame showed them.
    pub superseded: u64,
    /// Revisions that a node could not show.
    pub refused: u64,
    /// Of the shown ones, those that at least one member had not prepared.
    pub unprepared: u64,
    /// Of the shown ones, those after which no frame was seen in which nothing was missing on any node.
    pub unconverged: u64,
    /// Microseconds from the submission of a change to the moment at which the last node presented the
    /// first frame that shows it or a later change and that every node presented. A node that has been
    /// silent for 256 frames is not waited for.
    pub to_shown_us: QuantilesAndMax,
    /// The same to the first such frame in which nothing was missing on any node.
    pub to_converged_us: QuantilesAndMax,
}

/// What the nodes' tile caches did, together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TileReport {
    /// Different tiles that came into the main memory of any node.
    pub distinct: u64,
    /// Different tiles that the wall showed.
    pub shown: u64,
    /// Tiles read from repositories, over all nodes. Where all nodes share one disk cache, each tile is read once.
    pub repository_reads: u64,
    /// Their compressed bytes.
    pub repository_bytes: u64,
    /// Tiles found in disk caches.
    pub disk_hits: u64,
    /// Tiles found in main memory.
    pub ram_hits: u64,
    /// Tiles whose checksum was wrong.
    pub corrupt: u64,
    /// Tiles that are given up for the time being.
    pub failed: u64,
    /// Bytes of tiles that came into main memory before they were wanted, over all nodes.
    pub early_bytes: u64,
    /// Of these, the bytes of tiles that were not wanted until now.
    pub vain_bytes: u64,
    /// Milliseconds from the first frame that wanted a tile to the one that could draw it, by where the tile was found.
    pub drawable_after_ms: DrawableAfter,
}

/// Times by the level of the cache.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DrawableAfter {
    /// Tiles found in a repository.
    pub repository: QuantilesAndMax,
    /// Tiles found in the disk cache.
    pub disk: QuantilesAndMax,
    /// Tiles found in main memory.
    pub ram: QuantilesAndMax,
}

/// What one node did.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NodeReport {
    /// Name of the host.
    pub name: String,
    /// Its graphics adapter; empty if it never came.
    pub adapter: String,
    /// Frames presented.
    pub frames: u64,
    /// Deadlines missed.
    pub missed_deadlines: u64,
    /// Times that the barrier began to wait for it.
    pub joins: u32,
    /// Milliseconds from its last hello to its first picture in step; absent if there was none.
    pub join_ms: Option<f64>,
    /// Milliseconds spent drawing a frame.
    pub draw_ms: Quantiles,
    /// Most triangles in a frame.
    pub triangles: Max,
}

/// Measurements over time. Long runs are thinned out: each value is then the largest of `stride` frames.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// Frames that one value stands for.
    pub stride: u64,
    /// As [`Report::frame_ms`].
    pub frame_ms: Vec<f32>,
    /// As [`Report::skew_us`]; 0 where fewer than two nodes presented.
    pub skew_us: Vec<f32>,
}

impl Report {
    /// The report as indented JSON.
    ///
    /// # Errors
    /// None for reports of a [`Recorder`]; numbers that JSON cannot hold otherwise.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self)
    }
}
