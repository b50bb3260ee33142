//! One display on which `bench refine` draws each picture until nothing is missing, and takes the times of its passes.
//!
//! In: scenes and poses. Out: milliseconds, triangles, the error of the picture that stands. It decides nothing about
//! what is shown.

use std::time::{Duration, Instant};

use node::{Drawn, ErrorMeasure, Picture, PictureMaker as _, PictureRequest, WallPictureMaker};
use protocol::wall::Viewers;
use protocol::{Pose, Scene, View, Wall};
use tempfile::TempDir;

use crate::failure::Failure;
use crate::interrupt;

/// A picture that has not settled by then never will.
const PATIENCE: Duration = Duration::from_secs(180);
/// How long to leave the device alone when there is nothing to do but to wait for it.
const PAUSE: Duration = Duration::from_micros(200);
/// Memory on the device. Every sample as a vertex needs a lot.
const GPU_MIB: u64 = 6144;
/// Pixels of the screen in metres.
const PITCH_M: f64 = 0.0003;
/// The distance of the eye in heights of the screen: the picture is 49° high.
const DISTANCE: f64 = 1.1;

/// The display.
pub(super) struct Stage {
    picture: Box<dyn Picture>,
    viewers: Viewers,
    revision: u64,
    shown: Option<(Scene, Pose)>,
    frame: u64,
    /// The tile cache is the stage's own and ends with it: no method finds what another has left.
    _cache: TempDir,
}

/// What a picture took until nothing was missing any more.
#[derive(Clone, Debug, Default)]
pub(super) struct Settled {
    /// From the wish to the settled picture, loading and fusion included.
    pub(super) frame_ms: f64,
    /// Of that, the call that drew the picture as it stands.
    pub(super) last_draw_ms: f64,
    /// Passes of creation and refinement on the device, by name, in the order in which they first ran.
    pub(super) passes: Passes,
}

/// Milliseconds of passes by name, and how often each ran.
#[derive(Clone, Debug, Default)]
pub(super) struct Passes(pub(super) Vec<(String, f64, u32)>);

impl Passes {
    /// Adds one run of a pass.
    pub(super) fn add(&mut self, label: &str, ms: f64) {
        match self.0.iter_mut().find(|(known, ..)| known == label) {
            Some((_, sum_ms, runs)) => {
                *sum_ms += ms;
                *runs += 1;
            }
            None => self.0.push((label.to_owned(), ms, 1)),
        }
    }

    /// All passes together.
    pub(super) fn sum_ms(&self) -> f64 {
        self.0.iter().map(|(_, ms, _)| ms).sum()
    }
}

impl Stage {
    /// A headless display of this many pixels on an open device, with nothing in memory.
    pub(super) fn open(
        maker: &mut WallPictureMaker,
        [width, height]: [u32; 2],
    ) -> Result<Self, Failure> {
        let mut wall = Wall::parse(&wall_text([width, height]), "the wall of the bench")?;
        let cache = tempfile::tempdir().map_err(Failure::failed)?;
        wall.cache.directory = Some(cache.path().to_string_lossy().into_owned());
        wall.cache.gpu_mib = GPU_MIB;
        let request = PictureRequest {
            wall: &wall,
            host: 0,
            windows: vec![None],
        };
        let mut picture = maker.make(request)?;
        picture.time_passes(true);
        Ok(Self {
            picture,
            viewers: node::viewers(&wall)?,
            revision: 0,
            shown: None,
            frame: 0,
            _cache: cache,
        })
    }

    /// Draws a scene from a place until nothing is missing. A new scene is prepared before it is drawn, as on a wall,
    /// where the viewer rests.
    pub(super) fn show(&mut self, scene: &Scene, pose: &Pose) -> Result<Settled, Failure> {
        let begin = Instant::now();
        let deadline = begin + PATIENCE;
        let (same_scene, same_pose) = self
            .shown
            .as_ref()
            .map_or((false, false), |(old_scene, old_pose)| {
                (old_scene == scene, old_pose == pose)
            });
        if !same_scene {
            self.revision += 1;
            self.picture.prepare_scene(self.revision, scene)?;
        }
        // After a failure everything is drawn from the beginning, and what it took is forgotten.
        self.shown = None;
        drop(self.picture.take_pass_times());
        while !same_scene
            && same_pose
            && self.picture.prepare_ahead(PATIENCE)? != Some(self.revision)
        {
            wait(deadline)?;
        }
        let mut last_draw_ms = 0.0;
        loop {
            let begin = Instant::now();
            let drawn = self.draw(pose)?;
            if drawn.redrawn {
                last_draw_ms = begin.elapsed().as_secs_f64() * 1e3;
            }
            if drawn.converged {
                break;
            }
            wait(deadline)?;
        }
        let frame_ms = begin.elapsed().as_secs_f64() * 1e3;
        self.shown = Some((scene.clone(), *pose));
        let mut passes = Passes::default();
        for pass in self.picture.take_pass_times() {
            passes.add(pass.label, pass.ms);
        }
        Ok(Settled {
            frame_ms,
            last_draw_ms,
            passes,
        })
    }

    /// The error of the picture that stands.
    pub(super) fn error(&mut self) -> Result<ErrorMeasure, Failure> {
        Ok(self.picture.measure_error()?)
    }

    /// Triangles of the smallest mesh that would do for the picture that stands.
    pub(super) fn minimum_triangles(&mut self) -> Result<u64, Failure> {
        Ok(self.picture.minimum_triangles()?)
    }

    fn draw(&mut self, pose: &Pose) -> Result<Drawn, Failure> {
        self.frame += 1;
        let view = View {
            epoch: 0,
            frame: self.frame,
            scene_revision: self.revision,
            sent_us: 0,
            pose: *pose,
            wall_revision: 0,
            viewers: self.viewers.clone(),
            settle: false,
            previous_swap: None,
        };
        Ok(self.picture.draw(&view)?)
    }
}

/// A moment for the device and for tiles on their way. Fails when there is no more time, or on Ctrl-C.
fn wait(deadline: Instant) -> Result<(), Failure> {
    if interrupt::requested() {
        return Err(Failure::failed("interrupted"));
    }
    if Instant::now() > deadline {
        return Err(Failure::failed(format!(
            "a picture did not settle within {PATIENCE:?}"
        )));
    }
    std::thread::sleep(PAUSE);
    Ok(())
}

/// One screen, the eye before its middle. One frame a second gives each call all the time it can use.
fn wall_text([width, height]: [u32; 2]) -> String {
    let (half_m, high_m) = (
        f64::from(width) * PITCH_M / 2.0,
        f64::from(height) * PITCH_M,
    );
    format!(
        "[wall]\nname = \"bench\"\nfps = 1.0\n\n\
         [[observers]]\nname = \"viewer\"\nhead_m = [0.0, {:?}, {:?}]\n\n\
         [[screens]]\nname = \"front\"\nkind = \"planar\"\nobserver = \"viewer\"\nsize_px = [{width}, {height}]\n\
         corners_m = {{ bottom_left = [{:?}, 0.0, 0.0], bottom_right = [{half_m:?}, 0.0, 0.0], \
         top_left = [{:?}, {high_m:?}, 0.0] }}\n\n\
         [[hosts]]\nname = \"here\"\n[[hosts.outputs]]\nname = \"out\"\nsize_px = [{width}, {height}]\n\
         headless = true\nchannels = [{{ screen = \"front\", canvas_px = [0, 0, {width}, {height}] }}]\n",
        high_m / 2.0,
        high_m * DISTANCE,
        -half_m,
        -half_m,
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    #[test]
    fn the_wall_is_valid_at_every_size() {
        for size in [[64, 64], [1280, 1024], [8192, 8192]] {
            let wall = Wall::parse(&wall_text(size), "bench").unwrap();
            assert_eq!(wall.screens[0].size_px, size);
        }
    }

    #[test]
    fn passes_of_one_name_add_up() {
        let mut passes = Passes::default();
        for (label, ms) in [("marks", 1.0), ("emit", 4.0), ("marks", 2.0)] {
            passes.add(label, ms);
        }
        assert_eq!(passes.sum_ms(), 7.0);
        let names = passes
            .0
            .iter()
            .map(|(name, ms, runs)| (name.as_str(), *ms, *runs));
        assert_eq!(
            names.collect::<Vec<_>>(),
            [("marks", 3.0, 2), ("emit", 4.0, 1)]
        );
    }
}
