//! The running wall as others see it: its measures, and the patterns on its outputs.
//! Plain data between the frame loop and the control API.

use std::sync::Arc;

use protocol::Wall;
use protocol::pattern::Pattern;
use protocol::wall::Surfaces;

/// How the wall stands.
#[derive(Clone, Debug)]
pub(crate) struct Installation {
    pub(crate) wall: Arc<Wall>,
    /// What each output of each host shows instead of the scene.
    pub(crate) patterns: Vec<Vec<Option<Pattern>>>,
}

/// The running wall with other measures, and what the files that it names make of them.
#[derive(Debug)]
pub(crate) struct AdjustedWall {
    pub(crate) wall: Arc<Wall>,
    pub(crate) surfaces: Surfaces,
}

/// An output of the wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OutputPlace {
    pub(crate) host: usize,
    pub(crate) output: usize,
}

impl Installation {
    /// The place of an output that is named `HOST/OUTPUT`.
    pub(crate) fn place(&self, name: &str) -> Option<OutputPlace> {
        let mut hosts = self.wall.hosts.iter().enumerate();
        hosts.find_map(|(host, of_host)| {
            let mut outputs = of_host.outputs.iter();
            let output =
                outputs.position(|output| format!("{}/{}", of_host.name, output.name) == name)?;
            Some(OutputPlace { host, output })
        })
    }

    /// The names of all outputs with what they show, in the wall's order.
    pub(crate) fn shown(&self) -> impl Iterator<Item = (String, Option<Pattern>)> {
        let hosts = self.wall.hosts.iter().zip(&self.patterns);
        hosts.flat_map(|(host, patterns)| {
            let outputs = host.outputs.iter().zip(patterns);
            outputs.map(|(output, shown)| (format!("{}/{}", host.name, output.name), *shown))
        })
    }
}
