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
