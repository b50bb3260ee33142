//! The capture at the end of a run: waits until every node has drawn everything, then takes the pictures.
//! In: what nodes say about held frames, captured pictures. Out: when to ask for pictures, and the pictures,
//! or who is still waited for and for what. It reads no clock and sends nothing.

use protocol::Wall;
use protocol::barrier::NodeId;
use protocol::capture::CapturedPicture;
use protocol::membership::NodeRecord;

/// The pixels of one output.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CapturedOutput {
    /// Name of the host.
    pub host: String,
    /// Index into the wall's hosts.
    pub host_index: usize,
    /// Name of the output.
    pub output: String,
    /// Index into the host's outputs.
    pub output_index: usize,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// width × height × 4 bytes, top row first: red, green, blue, alpha.
    pub rgba: Vec<u8>,
}

#[derive(Clone, Debug, Default)]
struct NodeState {
    /// What it said of the newest held frame: whether nothing was missing, and how many tiles were.
    said: Option<(bool, u32)>,
    pictures: Option<Vec<CapturedPicture>>,
}

/// The state of a capture.
#[derive(Clone, Debug)]
pub(crate) struct Capture {
    first_frame: u64,
    nodes: Vec<NodeState>,
    asked: bool,
    /// Whether they were asked at any time.
    begun: bool,
}

impl Capture {
    /// The number by which nodes are asked. There is one capture in a run.
    pub(crate) const ID: u32 = 1;

    /// The camera holds still from frame `first_frame` on.
    pub(crate) fn new(wall: &Wall, first_frame: u64) -> Self {
        let nodes = vec![NodeState::default(); wall.hosts.len()];
        Self {
            first_frame,
            nodes,
            asked: false,
            begun: false,
        }
    }

    /// What is shown has changed: only what nodes say of frames from `first_frame` on counts.
    pub(crate) fn begin_again(&mut self, first_frame: u64) {
        self.first_frame = first_frame;
        for state in &mut self.nodes {
            state.said = None;
        }
    }

    /// A node has drawn a frame.
    pub(crate) fn ready(&mut self, node: NodeId, frame: u64, converged: bool, pending: u32) {
        if let Some(state) = self.nodes.get_mut(node)
            && frame >= self.first_frame
        {
            state.said = Some((converged, pending));
        }
    }

    /// A node is gone: what it said counts no longer, and its pictures must come from its successor.
    pub(crate) fn lost(&mut self, node: NodeId) {
        if let Some(state) = self.nodes.get_mut(node)
            && state.pictures.is_none()
        {
            state.said = None;
            // The successor draws the held frame first; all are asked again.
            self.asked = false;
        }
    }

    /// True once: when all nodes have converged and are to be asked for their pictures.
    pub(crate) fn ask_now(&mut self) -> bool {
        let converged = |state: &NodeState| matches!(state.said, Some((true, _)));
        let ask = !self.asked && self.nodes.iter().all(converged);
        self.asked |= ask;
        self.begun |= ask;
        ask
    }

    /// Whether a node may have sent pictures already: the others' must show the same scene.
    pub(crate) fn has_begun(&self) -> bool {
        self.begun
    }

    /// Whether pictures are on their way, during which no frames are begun.
    pub(crate) fn is_asked(&self) -> bool {
        self.asked
    }

    /// A node's pictures have arrived.
    pub(crate) fn pictures(&mut self, node: NodeId, pictures: Vec<CapturedPicture>) {
        if let Some(state) = self.nodes.get_mut(node) {
            state.pictures = Some(pictures);
        }
    }

    /// Whether all pictures are there.
    pub(crate) fn is_complete(&self) -> bool {
        self.nodes.iter().all(|state| state.pictures.is_some())
    }

    /// Whom the capture waits for and why, one sentence a node.
    pub(crate) fn waits_for(&self, records: &[NodeRecord]) -> Vec<String> {
        let waiting = records
            .iter()
            .zip(&self.nodes)
            .filter(|(_, state)| state.pictures.is_none());
        waiting
            .filter_map(|(record, state)| {
                let name = &record.name;
                Some(match state.said {
                    _ if !record.connected => format!("node \"{name}\" is not connected"),
                    None => format!("node \"{name}\" has not drawn the last frame"),
                    Some((false, 0)) => format!("node \"{name}\" has not finished its picture"),
                    Some((false, tiles)) => format!("node \"{name}\" waits for {tiles} tiles"),
                    Some((true, _)) if self.asked => {
                        format!("node \"{name}\" has not sent its pictures")
                    }
                    Some((true, _)) => return None,
                })
            })
            .collect()
    }

    /// The pictures of all outputs, in the wall's order.
    pub(crate) fn into_outputs(self, wall: &Wall) -> Vec<CapturedOutput> {
        let mut outputs = Vec::new();
        for ((host_index, host), state) in wall.hosts.iter().enumerate().zip(self.nodes) {
            for picture in state.pictures.unwrap_or_default() {
                let name = host
                    .outputs
                    .get(picture.output)
                    .map(|output| output.name.clone());
                outputs.push(CapturedOutput {
                    host: host.name.clone(),
                    host_index,
                    output: name.unwrap_or_default(),
                    output_index: picture.output,
                    width: picture.width,
                    height: picture.height,
                    rgba: picture.rgba,
                });
            }
        }
        outputs
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::expect_used,
        reason = "a test that panics has failed"
    )]

    use protocol::membership::Membership;
    use protocol::message::Hello;
    use protocol::{PROTOCOL_VERSION, Wall};

    use super::*;

    const WALL: &str = r#"
        [wall]
        name = "two"
        fps = 60.0
        [[observers]]
        name = "viewer"
        head_m = [0.0, 1.5, 3.0]
        [[screens]]
        name = "front"
        kind = "planar"
        observer = "viewer"
        size_px = [32, 16]
        corners_m = { bottom_left = [-1.0, 1.0, 0.0], bottom_right = [1.0, 1.0, 0.0], top_left = [-1.0, 2.0, 0.0] }
        [[hosts]]
        name = "west"
        [[hosts.outputs]]
        name = "out"
        size_px = [16, 16]
        headless = true
        channels = [{ screen = "front", canvas_px = [0, 0, 16, 16] }]
        [[hosts]]
        name = "east"
        [[hosts.outputs]]
        name = "out"
        size_px = [16, 16]
        headless = true
        channels = [{ screen = "front", canvas_px = [16, 0, 16, 16] }]
    "#;

    fn picture(shade: u8) -> Vec<CapturedPicture> {
        vec![CapturedPicture {
            output: 0,
            width: 16,
            height: 16,
            rgba: vec![shade; 1024],
        }]
    }

    #[test]
    fn pictures_are_asked_for_once_when_all_have_converged() {
        let wall = Wall::parse(WALL, "test").unwrap();
        let mut capture = Capture::new(&wall, 10);
        capture.ready(0, 9, true, 0);
        capture.ready(1, 10, true, 0);
        assert!(!capture.ask_now(), "frame 9 moved");
        capture.ready(0, 10, false, 4);
        assert!(!capture.ask_now());
        capture.ready(0, 11, true, 0);
        assert!(capture.ask_now() && capture.is_asked() && !capture.ask_now());
        capture.pictures(1, picture(1));
        assert!(!capture.is_complete());
        capture.pictures(0, picture(0));
        assert!(capture.is_complete());
        let outputs = capture.into_outputs(&wall);
        let shades: Vec<_> = outputs
            .iter()
            .map(|output| (&*output.host, output.rgba[0]))
            .collect();
        assert_eq!(shades, [("west", 0), ("east", 1)]);
    }

    #[test]
    fn another_scene_is_waited_for_anew() {
        let wall = Wall::parse(WALL, "test").unwrap();
        let mut capture = Capture::new(&wall, 10);
        capture.ready(0, 10, true, 0);
        capture.begin_again(12);
        capture.ready(1, 12, true, 0);
        capture.ready(0, 11, true, 0);
        assert!(!capture.ask_now(), "frame 11 showed the scene before");
        capture.ready(0, 12, true, 0);
        assert!(capture.ask_now());
    }

    #[test]
    fn a_node_lost_before_its_pictures_came_is_waited_for_again() {
        let wall = Wall::parse(WALL, "test").unwrap();
        let mut capture = Capture::new(&wall, 1);
        capture.ready(0, 1, true, 0);
        capture.ready(1, 1, true, 0);
        assert!(capture.ask_now());
        capture.pictures(0, picture(0));
        capture.lost(0);
        assert!(capture.is_asked(), "what it sent is still good");
        capture.lost(1);
        assert!(!capture.is_asked(), "frames go on for its successor");
        assert!(capture.has_begun(), "but what they show is settled");
        capture.ready(1, 5, true, 0);
        assert!(capture.ask_now());
    }

    #[test]
    fn it_says_whom_it_waits_for_and_why() {
        let wall = Wall::parse(WALL, "test").unwrap();
        let mut membership = Membership::new(&wall, 1, "test");
        let mut capture = Capture::new(&wall, 1);
        let hello = |node: &str| Hello {
            protocol_version: PROTOCOL_VERSION,
            program_version: "test".into(),
            session: 1,
            node: node.into(),
            adapter: "none".into(),
            process_id: 1,
        };
        membership.hello(&hello("west"), 0).unwrap();
        capture.ready(0, 1, false, 7);
        let waits_for = capture.waits_for(membership.nodes());
        assert_eq!(
            waits_for,
            [
                "node \"west\" waits for 7 tiles",
                "node \"east\" is not connected"
            ]
        );
        membership.hello(&hello("east"), 0).unwrap();
        capture.ready(0, 2, true, 0);
        capture.ready(1, 2, true, 0);
        assert!(capture.waits_for(membership.nodes()).is_empty());
        assert!(capture.ask_now());
        capture.pictures(0, picture(0));
        let waits_for = capture.waits_for(membership.nodes());
        assert_eq!(waits_for, ["node \"east\" has not sent its pictures"]);
    }
}
