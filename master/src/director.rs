//! Decides what each frame shows: the scene's camera over time, or the operator who has taken it over.
//! In: scenes by revision, the moment of a frame, steering. Out: views, and the encoded scenes. When a revision
//! is due, `protocol::change` decides; this file keeps those that are alive. It sends nothing.

use std::collections::BTreeMap;
use std::sync::Arc;

use protocol::barrier::Action;
use protocol::camera::Navigator;
use protocol::codec::{EncodeError, encode_view};
use protocol::message::{Steer, Swap};
use protocol::wall::{Head, Surfaces, Viewers};
use protocol::{Pose, Scene, View, Wall};

use crate::change::Revision;
use crate::session::Bytes;

/// The revision of the scene that a run starts with.
pub(crate) const FIRST_REVISION: u64 = 1;

/// How the camera's time runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum CameraTime {
    /// It stands at its beginning until the wall is complete.
    Waiting,
    /// It runs with the clock since this moment.
    Clock { start_us: i64 },
    /// Each frame is one step, however long it takes: a run of a given number of frames shows the same
    /// pictures on every machine.
    Steps { frame: u64, fps: f64 },
    /// It has stopped where it was.
    Held,
}

/// What is shown, and what is to be shown.
pub(crate) struct Director {
    shown: u64,
    showing: Arc<Revision>,
    /// Revisions that are prepared or queued.
    coming: BTreeMap<u64, Arc<Revision>>,
    wall: Arc<Wall>,
    wall_revision: u32,
    surfaces: Surfaces,
    viewers: Viewers,
    pose: Pose,
    navigator: Option<Navigator>,
    /// Seconds that had passed when the shown camera began; none until its first frame.
    camera_began_s: Option<f64>,
}

/// A frame as the barrier asks for it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameRequest {
    pub(crate) epoch: u32,
    pub(crate) frame: u64,
    pub(crate) previous_swap: Option<Swap>,
    pub(crate) presented_from_us: i64,
}

impl FrameRequest {
    /// The request in a barrier's action, if it is one.
    pub(crate) fn from_action(action: &Action) -> Option<Self> {
        match *action {
            Action::BeginFrame {
                epoch,
                frame,
                previous_swap,
                presented_from_us,
            } => Some(Self {
                epoch,
                frame,
                previous_swap,
                presented_from_us,
            }),
            _ => None,
        }
    }
}

/// Steps of density in each doubling.
const DENSITY_STEPS: f64 = 8.0;

/// A density that is not below the given one, and stays the same while a head moves a little: all meshes depend on it.
fn in_steps(pixels_per_radian: f64) -> f64 {
    ((pixels_per_radian.log2() * DENSITY_STEPS).ceil() / DENSITY_STEPS).exp2()
}

impl Director {
    /// Starts with a scene, as revision [`FIRST_REVISION`].
    pub(crate) fn new(
        wall: &Arc<Wall>,
        surfaces: Surfaces,
        scene: Scene,
    ) -> Result<Self, EncodeError> {
        Ok(Self {
            shown: FIRST_REVISION,
            pose: scene.camera.pose(&scene.planet, 0.0),
            showing: Arc::new(Revision::new(FIRST_REVISION, scene)?),
            coming: BTreeMap::new(),
            viewers: surfaces.viewers(wall, wall.heads()),
            wall: Arc::clone(wall),
            wall_revision: 0,
            surfaces,
            navigator: None,
            camera_began_s: Some(0.0),
        })
    }

    /// The viewers' heads from the next frame on, in the wall's order. While the camera is held, they are held too.
    pub(crate) fn follow(&mut self, heads: Vec<Head>, time: CameraTime) {
        if heads == self.viewers.heads || time == CameraTime::Held {
            return;
        }
        let mut viewers = self.surfaces.viewers(&self.wall, heads);
        viewers.pixels_per_radian = in_steps(viewers.pixels_per_radian);
        self.viewers = viewers;
    }

    /// Shows the wall with other measures, and the surfaces that they make, from the next frame on, as the next revision of
    /// it, which is returned. Heads that rest do so at their new places.
    pub(crate) fn measure(&mut self, wall: &Arc<Wall>, surfaces: Surfaces) -> u32 {
        let resting = self.wall.heads();
        let heads = self
            .viewers
            .heads
            .iter()
            .zip(resting.iter().zip(wall.heads()));
        let heads = heads.map(|(now, (before, after))| if now == before { after } else { *now });
        let heads: Vec<Head> = heads.collect();
        self.viewers = surfaces.viewers(wall, heads);
        self.surfaces = surfaces;
        self.wall = Arc::clone(wall);
        self.wall_revision += 1;
        self.wall_revision
    }

    /// Keeps a revision that is to be shown later.
    pub(crate) fn expect(&mut self, number: u64, revision: Arc<Revision>) {
        self.coming.insert(number, revision);
    }

    /// Forgets a revision that will not be shown.
    pub(crate) fn forget(&mut self, number: u64) {
        self.coming.remove(&number);
    }

    /// Shows an expected revision from the next frame on. The camera begins anew where it is another one, or on
    /// another planet; otherwise it goes on, even under the operator's hand.
    pub(crate) fn show(&mut self, number: u64) {
        let Some(revision) = self.coming.remove(&number) else {
            return;
        };
        self.coming.retain(|coming, _| *coming > number);
        let (new, old) = (&revision.scene, &self.showing.scene);
        if new.camera != old.camera || new.planet != old.planet {
            self.pose = new.camera.pose(&new.planet, 0.0);
            self.navigator = None;
            self.camera_began_s = None;
        }
        self.shown = number;
        self.showing = revision;
    }

    /// The number of the revision that views bear.
    #[cfg(test)]
    pub(crate) fn shown(&self) -> u64 {
        self.shown
    }

    /// A revision that is shown, or is to be: the shown one where `number` is neither.
    pub(crate) fn revision(&self, number: u64) -> &Arc<Revision> {
        self.coming.get(&number).unwrap_or(&self.showing)
    }

    /// The shown scene.
    pub(crate) fn scene(&self) -> &Scene {
        &self.showing.scene
    }

    /// The shown scene as nodes are sent it.
    pub(crate) fn encoded_scene(&self) -> &Bytes {
        &self.showing.encoded
    }

    /// The operator takes the camera over, where it is.
    pub(crate) fn steer(&mut self, steer: &Steer, now_us: i64) {
        let (planet, pose) = (self.showing.scene.planet, &self.pose);
        self.navigator
            .get_or_insert_with(|| Navigator::new(planet, pose))
            .steer(steer, now_us);
    }

    /// The encoded view of a frame that is sent now.
    pub(crate) fn view(
        &mut self,
        request: FrameRequest,
        time: CameraTime,
        now_us: i64,
    ) -> Result<Bytes, EncodeError> {
        self.pose = self.pose_at(time, request.presented_from_us);
        let view = View {
            epoch: request.epoch,
            frame: request.frame,
            scene_revision: self.shown,
            sent_us: now_us,
            pose: self.pose,
            wall_revision: self.wall_revision,
            viewers: self.viewers.clone(),
            settle: time == CameraTime::Held,
            previous_swap: request.previous_swap,
        };
        Ok(Arc::from(encode_view(&view)?))
    }

    fn pose_at(&mut self, time: CameraTime, presented_us: i64) -> Pose {
        let time_s = match time {
            CameraTime::Held => return self.pose,
            CameraTime::Waiting => 0.0,
            CameraTime::Clock { start_us } => presented_us.saturating_sub(start_us) as f64 * 1e-6,
            CameraTime::Steps { frame, fps } => frame as f64 / fps,
        };
        match &mut self.navigator {
            Some(navigator) => {
                navigator.advance(presented_us, 0.0);
                navigator.pose()
            }
            None => {
                let began_s = *self.camera_began_s.get_or_insert(time_s);
                let Scene { camera, planet, .. } = &self.showing.scene;
                camera.pose(planet, (time_s - began_s).max(0.0))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::expect_used,
        reason = "a test that panics has failed"
    )]

    use protocol::ToNode;
    use protocol::codec::{decode_to_node, decode_view};
    use protocol::message::HeldKeys;

    use super::*;

    const SCENE: &str = "layers = {}\n[camera]\nmode = \"orbit\"\n\
        place = { latitude_deg = 20.0, longitude_deg = 10.0, altitude_m = 12e6, pitch_deg = -90.0 }\n\
        centre = { latitude_deg = 90.0, longitude_deg = 0.0 }\ndegrees_per_second = 10.0\n";

    fn director() -> Director {
        let scene = Scene::parse(SCENE, "test").unwrap();
        let wall = Wall {
            name: "test".into(),
            fps: 60.0,
            observers: vec![],
            trackers: vec![],
            screens: vec![],
            hosts: vec![],
            cache: protocol::wall::CacheBudgets::default(),
        };
        let surfaces = Surfaces::load(&wall, |file, _| Err(file.to_owned())).unwrap();
        Director::new(&Arc::new(wall), surfaces, scene).unwrap()
    }

    fn view(director: &mut Director, frame: u64, time: CameraTime) -> View {
        let presented_from_us = 1_000_000 + frame as i64 * 50_000;
        let request = FrameRequest {
            epoch: 3,
            frame,
            previous_swap: None,
            presented_from_us,
        };
        decode_view(&director.view(request, time, 7).unwrap()).unwrap()
    }

    #[test]
    fn steps_do_not_depend_on_how_long_frames_take_and_the_clock_does() {
        let mut director = director();
        let start = view(&mut director, 1, CameraTime::Waiting);
        assert_eq!(
            start.pose,
            view(
                &mut director,
                1,
                CameraTime::Steps {
                    frame: 0,
                    fps: 60.0
                }
            )
            .pose
        );
        let second = view(
            &mut director,
            61,
            CameraTime::Steps {
                frame: 60,
                fps: 60.0,
            },
        );
        let clock = view(
            &mut director,
            20,
            CameraTime::Clock {
                start_us: 1_000_000,
            },
        );
        assert_eq!(
            second.pose, clock.pose,
            "both are one second after the start"
        );
        assert_ne!(second.pose, start.pose);
        let held = view(&mut director, 90, CameraTime::Held);
        assert!(held.settle && held.pose == clock.pose && !clock.settle);
        assert_eq!(
            (held.epoch, held.frame, held.sent_us, held.scene_revision),
            (3, 90, 7, 1)
        );
    }

    #[test]
    fn the_operator_takes_the_camera_over_where_it_is() {
        let mut director = director();
        let before = view(&mut director, 10, CameraTime::Clock { start_us: 0 });
        director.steer(&Steer::default(), 1_500_000);
        let after = view(&mut director, 11, CameraTime::Clock { start_us: 0 });
        let moved = |a: &View, b: &View| {
            let distance = |i: usize| (a.pose.position_m[i] - b.pose.position_m[i]).powi(2);
            (0..3).map(distance).sum::<f64>().sqrt()
        };
        assert!(
            moved(&before, &after) < 1e-3,
            "the scene's own motion has ended"
        );
        let held = HeldKeys::default().with(HeldKeys::SINK, true);
        director.steer(
            &Steer {
                held,
                ..Steer::default()
            },
            1_550_000,
        );
        view(&mut director, 11, CameraTime::Clock { start_us: 0 });
        let later = view(&mut director, 12, CameraTime::Clock { start_us: 0 });
        assert!(moved(&after, &later) > 1.0);
    }

    fn expect(director: &mut Director, number: u64, text: &str) {
        let scene = Scene::parse(text, "test").unwrap();
        director.expect(number, Arc::new(Revision::new(number, scene).unwrap()));
    }

    #[test]
    fn a_new_camera_begins_when_its_revision_is_shown() {
        let mut director = director();
        director.steer(&Steer::default(), 0);
        let elsewhere = SCENE.replace("longitude_deg = 10.0", "longitude_deg = 50.0");
        expect(&mut director, 2, &elsewhere);
        let clock = CameraTime::Clock { start_us: 0 };
        assert_eq!(view(&mut director, 5, clock).scene_revision, 1);
        director.show(2);
        let sent = decode_to_node(director.encoded_scene()).unwrap();
        assert!(matches!(sent, ToNode::Scene { revision: 2, .. }));
        let first = view(&mut director, 6, clock);
        let scene = Scene::parse(&elsewhere, "test").unwrap();
        assert_eq!(first.scene_revision, 2);
        assert_eq!(
            first.pose,
            scene.camera.pose(&scene.planet, 0.0),
            "not in its midst"
        );
        let later = view(&mut director, 26, clock);
        let expected = scene.camera.pose(&scene.planet, 1.0).position_m;
        let apart = |axis: usize| (later.pose.position_m[axis] - expected[axis]).abs();
        assert!((0..3).all(|axis| apart(axis) < 1e-3), "a second later");
    }

    #[test]
    fn the_same_camera_goes_on_through_other_scenes() {
        let (mut director, mut undisturbed) = (director(), director());
        let clock = CameraTime::Clock { start_us: 0 };
        view(&mut director, 5, clock);
        expect(
            &mut director,
            2,
            &format!("{SCENE}\n[light]\nambient = 0.5\n"),
        );
        director.show(2);
        let (changed, plain) = (
            view(&mut director, 6, clock),
            view(&mut undisturbed, 6, clock),
        );
        assert_eq!((changed.scene_revision, changed.pose), (2, plain.pose));
        director.steer(&Steer::default(), 1_300_000);
        let held = view(&mut director, 7, clock).pose;
        expect(&mut director, 3, SCENE);
        director.show(3);
        let after = view(&mut director, 40, clock);
        let moved = after.pose.position_m[0] - held.position_m[0];
        assert!(moved.abs() < 1e-3, "the operator still holds the camera");
    }

    #[test]
    fn only_revisions_that_are_alive_are_kept() {
        let mut director = director();
        for number in 2..=5 {
            expect(&mut director, number, SCENE);
        }
        director.forget(3);
        director.show(3);
        assert_eq!(director.shown(), 1, "a forgotten revision is never shown");
        director.show(4);
        assert_eq!(director.shown(), 4);
        assert_eq!(director.coming.keys().collect::<Vec<_>>(), [&5]);
        let encoded = |number| &director.revision(number).encoded;
        assert!(Arc::ptr_eq(encoded(2), encoded(4)) && !Arc::ptr_eq(encoded(5), encoded(4)));
    }
}
