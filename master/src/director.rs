//! Decides what each frame shows: the scene's camera over time, or the operator who has taken it over.
//! In: a scene, the moment of a frame, steering. Out: views, and the encoded scene. It sends nothing.

use std::sync::Arc;

use protocol::barrier::Action;
use protocol::camera::Navigator;
use protocol::codec::{EncodeError, encode_to_node, encode_view};
use protocol::message::{Steer, Swap};
use protocol::{Pose, Scene, ToNode, View, Wall};

use crate::session::Bytes;

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

/// What is shown.
pub(crate) struct Director {
    scene: Scene,
    revision: u64,
    encoded_scene: Bytes,
    heads_m: Vec<[f64; 3]>,
    pose: Pose,
    navigator: Option<Navigator>,
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

impl Director {
    /// Starts with a scene, as revision 1.
    pub(crate) fn new(wall: &Wall, scene: Scene) -> Result<Self, EncodeError> {
        let pose = scene.camera.pose(&scene.planet, 0.0);
        Ok(Self {
            revision: 1,
            encoded_scene: encode_scene(1, &scene)?,
            heads_m: wall.heads_m(),
            pose,
            navigator: None,
            scene,
        })
    }

    /// Shows another scene from the next frame on. The camera is the new scene's.
    pub(crate) fn set_scene(&mut self, scene: Scene) -> Result<(), EncodeError> {
        self.encoded_scene = encode_scene(self.revision + 1, &scene)?;
        self.revision += 1;
        self.pose = scene.camera.pose(&scene.planet, 0.0);
        self.navigator = None;
        self.scene = scene;
        Ok(())
    }

    /// The scene as nodes are sent it.
    pub(crate) fn encoded_scene(&self) -> &Bytes {
        &self.encoded_scene
    }

    /// The operator takes the camera over, where it is.
    pub(crate) fn steer(&mut self, steer: &Steer, now_us: i64) {
        let (planet, pose) = (self.scene.planet, &self.pose);
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
            scene_revision: self.revision,
            sent_us: now_us,
            pose: self.pose,
            heads_m: self.heads_m.clone(),
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
            None => self.scene.camera.pose(&self.scene.planet, time_s.max(0.0)),
        }
    }
}

fn encode_scene(revision: u64, scene: &Scene) -> Result<Bytes, EncodeError> {
    let message = ToNode::Scene {
        revision,
        scene: Box::new(scene.clone()),
    };
    Ok(Arc::from(encode_to_node(&message)?))
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::expect_used,
        reason = "a test that panics has failed"
    )]

    use protocol::codec::{decode_to_node, decode_view};
    use protocol::message::HeldKeys;

    use super::*;

    const SCENE: &str = "layers = []\n[camera]\nmode = \"orbit\"\n\
        place = { latitude_deg = 20.0, longitude_deg = 10.0, altitude_m = 12e6, pitch_deg = -90.0 }\n\
        centre = { latitude_deg = 90.0, longitude_deg = 0.0 }\ndegrees_per_second = 10.0\n";

    fn director() -> Director {
        let scene = Scene::parse(SCENE, "test").unwrap();
        let wall = Wall {
            name: "test".into(),
            fps: 60.0,
            observers: vec![],
            screens: vec![],
            hosts: vec![],
            cache: protocol::wall::CacheBudgets::default(),
        };
        Director::new(&wall, scene).unwrap()
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

    #[test]
    fn another_scene_is_another_revision() {
        let mut director = director();
        director.steer(&Steer::default(), 0);
        let scene = Scene::parse(
            &SCENE.replace("longitude_deg = 10.0", "longitude_deg = 50.0"),
            "test",
        );
        director.set_scene(scene.unwrap()).unwrap();
        let sent = decode_to_node(director.encoded_scene()).unwrap();
        assert!(matches!(sent, ToNode::Scene { revision: 2, .. }));
        let first = view(&mut director, 5, CameraTime::Waiting);
        assert_eq!(first.scene_revision, 2);
    }
}
