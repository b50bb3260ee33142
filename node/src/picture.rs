//! What the frame loop and the commands that measure pictures need from a renderer, and nothing else of it.
//! In: scenes and views. Out: pictures, on screens or as pixels, and their error. The renderer implements [`Picture`];
//! tests of the wall's step implement it with something cheaper. Nothing here knows GPUs or the network.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::Duration;

use protocol::message::{TileCounters, TileNews};
use protocol::pattern::Pattern;
use protocol::{Scene, View, Wall};
use render::{ErrorMeasure, Fetched, PassTime};
use winit::window::Window;

/// Why a picture could not be made. Fatal ones end the node; the others are told to the master, and the
/// last picture stays.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PictureError {
    /// There is nothing to draw with: no adapter, no surface. The text says what to do.
    #[error("{0}")]
    Unavailable(String),
    /// A scene cannot be shown: a repository is missing or of another version. The text names it.
    #[error("{0}")]
    Scene(String),
    /// One frame failed. The next may succeed.
    #[error("{0}")]
    Frame(String),
}

/// What became of a view.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drawn {
    /// Something had to be drawn; `false` if the last picture already shows this view.
    pub redrawn: bool,
    /// Nothing is missing: drawing the same view again would give the same picture.
    pub converged: bool,
    /// Tiles that are on their way.
    pub pending_tiles: u32,
    /// Triangles drawn.
    pub triangles: u64,
    /// Tiles whose mesh was made for this picture.
    pub refined_leaves: u32,
    /// The τ that the meshes keep, in wall pixels: the scene's, or more where the memory for meshes forbids it. 0 where
    /// none is kept.
    pub achieved_tau_px: f64,
    /// The side of a tile in wall pixels above which it is split: the scene's, or more where the memory for tiles does not
    /// hold what is seen.
    pub achieved_tile_px: f64,
}

/// The pixels of one output.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputImage {
    /// The output's name in the wall.
    pub output: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// width × height × 4 bytes, top row first: red, green, blue, alpha.
    pub rgba: Vec<u8>,
}

/// Where a picture is to be made.
pub struct PictureRequest<'a> {
    /// The whole wall.
    pub wall: &'a Wall,
    /// This node's index into the wall's hosts.
    pub host: usize,
    /// One per output of the host, in order; `None` for an output without a window.
    pub windows: Vec<Option<Arc<Window>>>,
}

/// An open graphics device that can make pictures.
pub trait PictureMaker {
    /// Name of the graphics adapter, for reports.
    fn adapter(&self) -> String;

    /// Makes the outputs of one host. Called when the master has told the wall, and again if it tells
    /// another one; the earlier picture is gone by then.
    ///
    /// # Errors
    /// An output that the device cannot draw.
    fn make(&mut self, request: PictureRequest<'_>) -> Result<Box<dyn Picture>, PictureError>;
}

/// All outputs of one host.
pub trait Picture {
    /// Begins to open what a scene needs and has not been opened, beside the frames, for [`Picture::prepare_scene`]
    /// to find. Returns whether there is nothing left to be waited for; if not, it is to be asked again.
    fn open_ahead(&mut self, scene: &Scene) -> bool;

    /// Takes a new scene. The first one is shown at once. A later one is prepared while views of the shown one
    /// are drawn, and takes the place of another in preparation; from its first view on it is the shown one.
    /// `revision` is its number in views until another scene of the same number comes: a new master counts
    /// anew. What was drawn last may still have to be presented.
    ///
    /// # Errors
    /// A scene that cannot be shown; nothing changes.
    fn prepare_scene(&mut self, revision: u64, scene: &Scene) -> Result<(), PictureError>;

    /// Takes other measures of the wall that the picture was made for: places of viewers and screens, blending. Sizes and
    /// channels are the same. The next drawing is for them.
    ///
    /// # Errors
    /// A wall of other outputs, a channel that lights nothing any more; the picture keeps the measures it has.
    fn set_wall(&mut self, wall: &Wall) -> Result<(), PictureError>;

    /// Shows patterns instead of the scene from the next drawing on: one for each output of the host, `None` for the
    /// scene. What is not named shows the scene.
    fn show_patterns(&mut self, patterns: &[Option<Pattern>]);

    /// Prepares and draws a view and waits for the GPU, but not for data: what is missing is shown as its
    /// best ancestor. Draws nothing if the last picture already shows the view. The view's scene is the shown
    /// one or the one in preparation, whether that is prepared or not.
    ///
    /// # Errors
    /// A lost device and the like.
    fn draw(&mut self, view: &View) -> Result<Drawn, PictureError>;

    /// Brings what drawing a view would show through the tile cache, and so onto the disk, without drawing. Tiles of
    /// `known` numbers are passed over. Waits for so long at most; what is left then comes by further calls. The
    /// last copies may still be written until the picture is dropped.
    ///
    /// # Errors
    /// A scene that was not prepared.
    fn fetch(
        &mut self,
        view: &View,
        known: &HashSet<u64>,
        patience: Duration,
    ) -> Result<Fetched, PictureError>;

    /// Goes on with the scene in preparation, for the view that was drawn last, for about this long at most and
    /// never longer than a frame can spare. To be called once after each drawing. Returns the revision in
    /// preparation, once everything that the view needs of it is there.
    ///
    /// # Errors
    /// A lost device and the like.
    fn prepare_ahead(&mut self, at_most: Duration) -> Result<Option<u64>, PictureError>;

    /// Geodetic latitude and longitude in degrees of the ground under a pixel of an output, in the view that
    /// was drawn last. `output` counts the host's outputs, `pixel` is right and down from the upper left
    /// corner. `None` beside the planet and before the first view.
    fn ground_under(&self, output: usize, pixel: [f64; 2]) -> Option<[f64; 2]>;

    /// What the operator ought to hear of the data behind the picture, a sentence each: repositories that do not answer,
    /// memory that does not hold what is seen. Each is told once.
    fn take_troubles(&mut self) -> Vec<String>;

    /// Forgets what was told of them: those that last are told again.
    fn forget_troubles(&mut self);

    /// Loads nothing more, and waits so long at most for what is on its way: counters change no more then.
    fn finish_loading(&mut self, at_most: Duration);

    /// Brings what was drawn to the screens, at once. Headless outputs have nothing to do.
    ///
    /// # Errors
    /// A lost surface and the like.
    fn present(&mut self) -> Result<(), PictureError>;

    /// The pixels of what was drawn last, one image per output, in the wall's order.
    ///
    /// # Errors
    /// A failed read-back.
    fn capture(&mut self) -> Result<Vec<OutputImage>, PictureError>;

    /// The error of what was drawn last, over every sample of elevation in view. It reads everything back from the
    /// device and takes as long as many pictures. Before the first view there are no samples.
    ///
    /// # Errors
    /// Elevation that has left memory since, a failed read-back, an error that is no distance.
    fn measure_error(&mut self) -> Result<ErrorMeasure, PictureError>;

    /// Triangles of the smallest meshes over the same tiles that would keep τ in what was drawn last. Slower still.
    ///
    /// # Errors
    /// As [`Picture::measure_error`].
    fn minimum_triangles(&mut self) -> Result<u64, PictureError>;

    /// Whether times of the device's passes are taken from now on. What was taken is dropped.
    fn time_passes(&mut self, on: bool);

    /// What passes took since the last call, in the order of their running.
    fn take_pass_times(&mut self) -> Vec<PassTime>;

    /// Height in metres above the ellipsoid of the highest surface of the shown scene at a place in degrees, by its
    /// finest data. It reads files, and waits for them.
    ///
    /// # Errors
    /// Data that cannot be read.
    fn ground_height_m(&self, latitude_deg: f64, longitude_deg: f64) -> Result<f64, PictureError>;

    /// Numbers of the finest tiles of every layer of elevation of the scene that was taken last, at most `most`, spread
    /// over all of them. It reads files, and waits for them.
    ///
    /// # Errors
    /// A repository that cannot be read.
    fn finest_tiles(&self, most: usize) -> Result<Vec<u64>, PictureError>;

    /// What the tile caches have done since the node started.
    fn counters(&self) -> TileCounters;

    /// What happened to tiles since the last call, at most `most` of each sort; the rest comes with the next call. A
    /// number means the same data set and tile on every node.
    fn take_tile_news(&mut self, most: usize) -> TileNews;
}

/// A measure whose numbers are distances: finite and not below 0. Others could not be compared with any τ.
pub(crate) fn comparable(measure: ErrorMeasure) -> Result<ErrorMeasure, PictureError> {
    let is_distance = |pixels: f64| pixels.is_finite() && pixels >= 0.0;
    if is_distance(measure.max_px) && is_distance(measure.tau_px) {
        return Ok(measure);
    }
    let place = measure
        .worst
        .map_or("no tile".to_owned(), |(tile, [x, y])| {
            format!("tile {tile}, node {x}, {y}")
        });
    Err(PictureError::Frame(format!(
        "the error of the picture is {} pixels at {place}, with τ = {}: no distance, a defect of the program",
        measure.max_px, measure.tau_px
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_distance_is_no_measure() {
        let measure = ErrorMeasure {
            max_px: 0.25,
            samples: 7,
            tau_px: 0.5,
            ..ErrorMeasure::default()
        };
        assert_eq!(comparable(measure), Ok(measure));
        for bad in [f64::NAN, f64::INFINITY, -1.0] {
            let max_px = comparable(ErrorMeasure {
                max_px: bad,
                ..measure
            });
            let tau_px = comparable(ErrorMeasure {
                tau_px: bad,
                ..measure
            });
            for refused in [max_px, tau_px] {
                assert!(
                    matches!(&refused, Err(PictureError::Frame(reason)) if reason.contains("no distance")),
                    "{refused:?}"
                );
            }
        }
    }
}
