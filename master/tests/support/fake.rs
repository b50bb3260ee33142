//! A picture that burns processor time, and holds the frame loop to the contract of [`Picture`].
//! In: scenes and views. Out: one shade per output, and a log of what was presented. It prepares scenes and
//! converges by counting drawings. Whoever asks it for a scene that it does not hold ends its process.

use std::collections::HashSet;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Duration;

use node::{
    Drawn, ErrorMeasure, Fetched, OutputImage, PassTime, Picture, PictureError, PictureMaker,
    PictureRequest,
};
use protocol::message::{TileCounters, TileNews};
use protocol::pattern::Pattern;
use protocol::{Scene, View, Wall};

use super::Drawing;

pub(super) struct FakeMaker {
    drawing: Drawing,
    log: Option<PathBuf>,
}

impl FakeMaker {
    pub(super) fn new(drawing: Drawing, log: Option<PathBuf>) -> Self {
        Self { drawing, log }
    }
}

impl PictureMaker for FakeMaker {
    fn adapter(&self) -> String {
        "a picture that burns time".to_owned()
    }

    fn make(&mut self, request: PictureRequest<'_>) -> Result<Box<dyn Picture>, PictureError> {
        let host = &request.wall.hosts[request.host];
        let names = host
            .outputs
            .iter()
            .map(|output| (output.name.clone(), output.size_px));
        Ok(Box::new(FakePicture {
            drawing: self.drawing,
            log: self.log.clone(),
            presented: String::new(),
            outputs: names.collect(),
            shade: request.host as u8,
            shown: None,
            preparing: None,
            last: None,
            drawings: 0,
        }))
    }
}

/// A scene that the picture holds.
#[derive(Clone, Copy)]
struct FakeScene {
    revision: u64,
    content: u64,
    /// Drawings since it is in preparation.
    drawings: u32,
}

struct FakePicture {
    drawing: Drawing,
    log: Option<PathBuf>,
    presented: String,
    outputs: Vec<(String, [u32; 2])>,
    shade: u8,
    shown: Option<FakeScene>,
    preparing: Option<FakeScene>,
    /// The view that was drawn last, and of which content.
    last: Option<(View, u64)>,
    drawings: u32,
}

impl FakePicture {
    /// Shows the scene of a view. The one in preparation first: a new master may count like the last one.
    fn show(&mut self, revision: u64) -> FakeScene {
        if let Some(scene) = self.preparing.take_if(|scene| scene.revision == revision) {
            self.shown = Some(scene);
        }
        match self.shown {
            Some(scene) if scene.revision == revision => scene,
            _ => panic!("a view of revision {revision}, which this picture does not hold"),
        }
    }
}

impl Picture for FakePicture {
    fn open_ahead(&mut self, _scene: &Scene) -> bool {
        true
    }

    fn prepare_scene(&mut self, revision: u64, scene: &Scene) -> Result<(), PictureError> {
        if self.drawing.broken_scene || (self.drawing.refuses_changes && self.shown.is_some()) {
            return Err(PictureError::Scene(
                "layer \"relief\": no repository".to_owned(),
            ));
        }
        let scene = FakeScene {
            revision,
            content: fingerprint(scene.to_json().to_string().as_bytes()),
            drawings: 0,
        };
        match &self.shown {
            None => self.shown = Some(scene),
            Some(_) => self.preparing = Some(scene),
        }
        Ok(())
    }

    fn forget_troubles(&mut self) {}

    fn finish_loading(&mut self, _: Duration) {}

    fn take_troubles(&mut self) -> Vec<String> {
        Vec::new()
    }

    fn set_wall(&mut self, _wall: &Wall) -> Result<(), PictureError> {
        Ok(())
    }

    fn show_patterns(&mut self, _patterns: &[Option<Pattern>]) {}

    fn draw(&mut self, view: &View) -> Result<Drawn, PictureError> {
        let scene = self.show(view.scene_revision);
        let same = self
            .last
            .as_ref()
            .is_some_and(|(last, content)| last.pose == view.pose && *content == scene.content);
        self.drawings = if same { self.drawings + 1 } else { 1 };
        let converged = self.drawings >= self.drawing.drawings_to_converge;
        let redrawn = self.drawings <= self.drawing.drawings_to_converge;
        if redrawn {
            burn(self.drawing.burn_us);
        }
        self.last = Some((view.clone(), scene.content));
        let pending_tiles = self
            .drawing
            .drawings_to_converge
            .saturating_sub(self.drawings);
        Ok(Drawn {
            redrawn,
            converged,
            pending_tiles,
            triangles: 1,
            refined_leaves: u32::from(redrawn),
            achieved_tau_px: 1.0,
            achieved_tile_px: 257.0,
        })
    }

    fn fetch(
        &mut self,
        _view: &View,
        _known: &HashSet<u64>,
        _patience: Duration,
    ) -> Result<Fetched, PictureError> {
        panic!("the wall's step does not ask for this")
    }

    fn prepare_ahead(&mut self, _at_most: Duration) -> Result<Option<u64>, PictureError> {
        let enough = self.drawing.drawings_to_prepare;
        Ok(self.preparing.as_mut().and_then(|scene| {
            scene.drawings = scene.drawings.saturating_add(1);
            (enough != u32::MAX && scene.drawings >= enough).then_some(scene.revision)
        }))
    }

    /// A flat map of the whole Earth on each output.
    fn ground_under(&self, output: usize, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let (_, [width, height]) = self.outputs.get(output)?;
        let (right, down) = (x / f64::from(*width), y / f64::from(*height));
        let inside = (0.0..=1.0).contains(&right) && (0.0..=1.0).contains(&down);
        let place = [90.0 - 180.0 * down, 360.0 * right - 180.0];
        (inside && self.last.is_some()).then_some(place)
    }

    fn present(&mut self) -> Result<(), PictureError> {
        let now_us = link::now_us();
        if let (Some(_), Some((view, content))) = (&self.log, &self.last) {
            let (frame, revision) = (view.frame, view.scene_revision);
            writeln!(self.presented, "{frame} {now_us} {revision} {content:016x}").unwrap();
        }
        Ok(())
    }

    fn capture(&mut self) -> Result<Vec<OutputImage>, PictureError> {
        let (longitude, revision) = self.last.as_ref().map_or((0.0, 0), |(view, _)| {
            (view.pose.position_m[1], view.scene_revision)
        });
        let image = |(output, [width, height]): &(String, [u32; 2])| OutputImage {
            output: output.clone(),
            width: *width,
            height: *height,
            rgba: [
                self.shade,
                (longitude / 1e5) as i32 as u8,
                revision as u8,
                255,
            ]
            .repeat((width * height) as usize),
        };
        Ok(self.outputs.iter().map(image).collect())
    }

    /// A number of its own for each host.
    fn measure_error(&mut self) -> Result<ErrorMeasure, PictureError> {
        assert!(self.last.is_some(), "asked before anything was drawn");
        if self.drawing.measure_ms == u64::MAX {
            return Err(PictureError::Frame(
                "the elevation has left memory".to_owned(),
            ));
        }
        std::thread::sleep(Duration::from_millis(self.drawing.measure_ms));
        Ok(ErrorMeasure {
            max_px: 0.25 + f64::from(self.shade) / 8.0,
            samples: 100,
            tau_px: 1.0,
            ..ErrorMeasure::default()
        })
    }

    fn minimum_triangles(&mut self) -> Result<u64, PictureError> {
        panic!("the wall's step does not ask for this")
    }

    fn time_passes(&mut self, _on: bool) {
        panic!("the wall's step does not ask for this")
    }

    fn take_pass_times(&mut self) -> Vec<PassTime> {
        panic!("the wall's step does not ask for this")
    }

    fn ground_height_m(&self, _latitude: f64, _longitude: f64) -> Result<f64, PictureError> {
        panic!("the wall's step does not ask for this")
    }

    fn finest_tiles(&self, _most: usize) -> Result<Vec<u64>, PictureError> {
        panic!("the wall's step does not ask for this")
    }

    fn counters(&self) -> TileCounters {
        TileCounters {
            distinct: 3,
            repository_reads: 3,
            ..TileCounters::default()
        }
    }

    fn take_tile_news(&mut self, _: usize) -> TileNews {
        let loaded = if self.drawings == 1 {
            vec![1, 2, 3]
        } else {
            Vec::new()
        };
        TileNews {
            loaded,
            ..TileNews::default()
        }
    }
}

impl Drop for FakePicture {
    fn drop(&mut self) {
        if let Some(log) = &self.log {
            std::fs::write(log, &self.presented).unwrap();
        }
    }
}

/// FNV-1a: Fowler, Noll, Vo, "The FNV Non-Cryptographic Hash Algorithm", RFC 9923.
fn fingerprint(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Keeps a processor busy for so long; the time while others run does not count.
fn burn(burn_us: u64) {
    use rustix::time::{ClockId, clock_gettime};
    let used_us = || {
        let time = clock_gettime(ClockId::ThreadCPUTime);
        (time.tv_sec * 1_000_000 + time.tv_nsec / 1_000).unsigned_abs()
    };
    let start_us = used_us();
    while used_us() - start_us < burn_us {
        std::hint::spin_loop();
    }
}
