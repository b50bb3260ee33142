//! What `bench refine` shows: a zoom from space onto mountains, then elevation that changes under a still camera.
//!
//! In: the repositories that `make data` built, how long the sequence is. Out: scene and pose at any time of it. It
//! draws nothing.

use std::path::Path;

use protocol::scene::{Layer, Process, Refine};
use protocol::{Pose, Scene};

use crate::args::RefineMethod;
use crate::failure::Failure;

/// The zoom, and what is shown. A copy stands in every binary, so that it runs anywhere.
const SCENE: &str = include_str!("../../../../configs/scenes/bench-refine.toml");
/// Where the scene's own times end, and where the zoom does.
const WHOLE_S: f64 = 24.0;
const ZOOM_S: f64 = 16.0;
/// The layer whose opacity and weight change.
const FINER: &str = "srtm";
/// By how many metres elevation moves where everything made of it is to be made anew: too little to be seen, and
/// enough for the last bit of any height on this planet.
const NUDGE_M: f64 = 1.0 / 512.0;
/// By how much the ambient light changes where a picture is to be drawn anew and nothing else.
const GLIMMER: f64 = 1.0 / 4096.0;

/// The sequence.
pub(super) struct Sequence {
    scene: Scene,
    seconds: f64,
}

/// Changes that nobody sees. They stay, so that the next picture finds what it may use again.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Touches {
    /// How many times elevation was moved.
    pub(super) elevation: u32,
    /// How many times the light was changed.
    pub(super) light: u32,
}

impl Sequence {
    /// The sequence over the repositories in `data`, tiles being split beyond a side of `tile_px` pixels.
    pub(super) fn open(data: &Path, seconds: f64, tile_px: f64) -> Result<Self, Failure> {
        let mut scene = Scene::parse(SCENE, "the scene of the bench")?;
        scene.mesh.tile_px = tile_px;
        let data = std::path::absolute(data)?;
        for layer in &mut scene.layers {
            let Some(repository) = &mut layer.repository else {
                continue;
            };
            let name = repository.rsplit('/').next().unwrap_or_default();
            let place = data.join(name);
            if !place.join("dataset.toml").is_file() {
                return Err(Failure::configuration(format!(
                    "{} is not there: run make data, or name the folder that holds etopo5/, srtm/ and imagery/ with \
                     --data",
                    place.display()
                )));
            }
            *repository = place.to_string_lossy().into_owned();
        }
        Ok(Self { scene, seconds })
    }

    /// The error in pixels that refined meshes stay under.
    pub(super) fn tau_px(&self) -> f64 {
        self.scene.mesh.tau
    }

    /// Where the viewer is.
    pub(super) fn pose(&self, time_s: f64) -> Pose {
        let camera = &self.scene.camera;
        camera.pose(&self.scene.planet, self.own_time(time_s))
    }

    /// What happens at a time.
    pub(super) fn phase(&self, time_s: f64) -> &'static str {
        match Change::at(self.own_time(time_s)) {
            Change::None => "zoom",
            Change::Scale(_) => "scale",
            Change::Opacity(_) => "opacity",
            Change::Weight(_) => "weight",
        }
    }

    /// What is shown at a time.
    pub(super) fn scene(&self, method: RefineMethod, time_s: f64, touches: Touches) -> Scene {
        let mut scene = self.scene.clone();
        scene.mesh.refine = match method {
            RefineMethod::Off => Refine::Off,
            RefineMethod::Fine => Refine::Fine,
            RefineMethod::TopDown => Refine::TopDown,
            RefineMethod::BottomUp => Refine::BottomUp,
        };
        scene.light.ambient += GLIMMER * f64::from(touches.light % 2);
        let change = Change::at(self.own_time(time_s));
        for layer in &mut scene.layers {
            change.apply(layer, NUDGE_M * f64::from(touches.elevation));
        }
        scene
    }

    /// The time in the scene's own seconds.
    fn own_time(&self, time_s: f64) -> f64 {
        time_s / self.seconds * WHOLE_S
    }
}

/// What differs from the scene file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Change {
    None,
    /// Of all heights, 1 to 2 and back.
    Scale(f64),
    /// Of the finer model above the coarser one, down from 1.
    Opacity(f64),
    /// Of the finer model, in a mean of both.
    Weight(f64),
}

impl Change {
    fn at(own_time_s: f64) -> Self {
        /// The scale changes for so long after the zoom, then the opacity, then the weight.
        const SCALE_S: f64 = 3.0;
        const OPACITY_S: f64 = 2.5;
        const WEIGHT_S: f64 = WHOLE_S - ZOOM_S - SCALE_S - OPACITY_S;
        let since = own_time_s - ZOOM_S;
        let share = |start: f64, length: f64| ((since - start) / length).clamp(0.0, 1.0);
        if since <= 0.0 {
            Self::None
        } else if since <= SCALE_S {
            let turn = share(0.0, SCALE_S) * std::f64::consts::TAU;
            Self::Scale(1.5 - 0.5 * turn.cos())
        } else if since <= SCALE_S + OPACITY_S {
            Self::Opacity(1.0 - 0.8 * share(SCALE_S, OPACITY_S))
        } else {
            Self::Weight(0.25 + 3.75 * share(SCALE_S + OPACITY_S, WEIGHT_S))
        }
    }

    fn apply(self, layer: &mut Layer, nudge_m: f64) {
        let Process::Elevation(elevation) = &mut layer.parameters.process else {
            return;
        };
        elevation.offset_m += nudge_m;
        let fusion = &mut layer.parameters.fusion;
        match self {
            Self::None => {}
            Self::Scale(scale) => elevation.scale *= scale,
            Self::Opacity(opacity) if layer.name == FINER => fusion.opacity = opacity,
            Self::Opacity(_) => {}
            Self::Weight(weight) => {
                // On one level with the coarser model: where both have data, the mean by weight counts.
                fusion.priority = 0;
                if layer.name == FINER {
                    fusion.weight = weight;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    fn sequence(seconds: f64) -> Sequence {
        let scene = Scene::parse(SCENE, "bench-refine.toml").unwrap();
        Sequence { scene, seconds }
    }

    #[test]
    fn every_scene_of_the_sequence_is_valid_and_the_changes_change_it() {
        let sequence = sequence(12.0);
        let mut before: Option<(&str, Scene)> = None;
        let mut phases = Vec::new();
        for step in 0..=96 {
            let time_s = f64::from(step) / 8.0;
            let scene = sequence.scene(RefineMethod::TopDown, time_s, Touches::default());
            scene.validate().unwrap();
            let phase = sequence.phase(time_s);
            if let Some((phase_before, scene_before)) = &before {
                assert_eq!(phase != "zoom", scene != *scene_before, "{time_s}");
                if phase != *phase_before {
                    phases.push(phase);
                }
            }
            before = Some((phase, scene));
        }
        assert_eq!(phases, ["scale", "opacity", "weight"]);
    }

    #[test]
    fn the_camera_comes_down_from_space_and_rests_at_the_mountains() {
        let sequence = sequence(12.0);
        let planet = sequence.scene.planet;
        let altitude = |time_s: f64| {
            let position = sequence.pose(time_s).position_m;
            planet.to_geodetic(position.into()).height_m
        };
        assert!(altitude(0.0) > 1e7);
        assert!(altitude(8.0) < 1e4);
        assert_eq!(sequence.pose(8.0), sequence.pose(11.0));
        for step in 1..=64 {
            assert!(altitude(f64::from(step) / 8.0) < altitude(f64::from(step - 1) / 8.0));
        }
    }

    #[test]
    fn touches_differ_and_hardly_change_anything() {
        let sequence = sequence(24.0);
        let scene = |elevation, light| {
            sequence.scene(RefineMethod::Fine, 3.0, Touches { elevation, light })
        };
        assert_ne!(scene(0, 0), scene(1, 0));
        assert_ne!(scene(0, 0), scene(0, 1));
        assert_eq!(scene(0, 0), scene(0, 2));
        const { assert!(NUDGE_M * 1000.0 < 2.0) };
        scene(1000, 1).validate().unwrap();
    }
}
