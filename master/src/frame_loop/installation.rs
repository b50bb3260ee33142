//! Changes of the running wall in the frame loop: measures of viewers and screens, test patterns.
//! In: walls that were checked, patterns. Out: messages to the nodes, from the next frame on. It opens no file.

use std::sync::Arc;

use protocol::ToNode;
use protocol::codec::encode_to_node;
use protocol::pattern::Pattern;

use super::FrameLoop;
use crate::installation::{AdjustedWall, Installation, OutputPlace};
use crate::session::Bytes;

impl FrameLoop {
    /// How the wall stands.
    pub(super) fn installation(&self) -> Installation {
        Installation {
            wall: Arc::clone(&self.wall),
            patterns: self.patterns.clone(),
        }
    }

    /// Shows the wall with other measures from the next frame on; their revision.
    pub(super) fn adjust(&mut self, adjusted: AdjustedWall) -> u32 {
        let AdjustedWall { wall, surfaces } = adjusted;
        let revision = self.director.measure(&wall, surfaces);
        self.wall = wall;
        self.wall_revision = revision;
        if let Some(message) = self.wall_message() {
            self.tell_all(&message);
        }
        revision
    }

    /// Shows a pattern on one output, or on all; without a pattern the scene.
    pub(super) fn show_pattern(&mut self, place: Option<OutputPlace>, pattern: Option<Pattern>) {
        for (host, outputs) in self.patterns.iter_mut().enumerate() {
            for (output, shown) in outputs.iter_mut().enumerate() {
                if place.is_none_or(|place| place == OutputPlace { host, output }) {
                    *shown = pattern;
                }
            }
        }
        for node in 0..self.patterns.len() {
            self.tell_patterns(node);
        }
    }

    /// Tells a node that has just been welcomed what has changed since the start.
    pub(super) fn tell_installation(&mut self, node: usize) {
        if self.wall_revision > 0
            && let Some(message) = self.wall_message()
        {
            self.tell(node, &message);
        }
        let shown = self.patterns.get(node);
        if shown.is_some_and(|shown| shown.iter().any(Option::is_some)) {
            self.tell_patterns(node);
        }
    }

    fn wall_message(&self) -> Option<Bytes> {
        let message = ToNode::Wall {
            revision: self.wall_revision,
            wall: Box::new((*self.wall).clone()),
        };
        // A wall of the same names and counts was encoded at the start.
        encode_to_node(&message).ok().map(Arc::from)
    }

    fn tell_patterns(&mut self, node: usize) {
        let shown = self.patterns.get(node).cloned().unwrap_or_default();
        if let Ok(message) = encode_to_node(&ToNode::Patterns(shown)) {
            self.tell(node, &Arc::from(message));
        }
    }

    fn tell_all(&mut self, message: &Bytes) {
        for node in 0..self.links.len() {
            self.tell(node, message);
        }
    }
}
