//! A change of the running scene on its way to the frame loop, and what the frame loop says of it.
//! In: what the frame loop knows at one moment, and another scene made of it. Out: a proposal that is encoded
//! already, so that the frame loop has only numbers to compare. Whether the scene is valid, its maker knows.

use std::sync::Arc;

use protocol::codec::{EncodeError, encode_to_node};
use protocol::{Scene, ToNode};

use crate::session::Bytes;

/// A scene, as it is kept and as nodes are sent it.
#[derive(Debug)]
pub(crate) struct Revision {
    pub(crate) scene: Scene,
    pub(crate) encoded: Bytes,
}

impl Revision {
    /// A scene under its number.
    pub(crate) fn new(number: u64, scene: Scene) -> Result<Self, EncodeError> {
        let message = ToNode::Scene {
            revision: number,
            scene: Box::new(scene.clone()),
        };
        let encoded = Arc::from(encode_to_node(&message)?);
        Ok(Self { scene, encoded })
    }
}

/// A revision that a node could not show.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct RefusedChange {
    pub(crate) revision: u64,
    pub(crate) node: String,
    pub(crate) reason: String,
}

/// What the frame loop knows of the scene at one moment.
#[derive(Clone, Debug)]
pub(crate) struct Snapshot {
    /// The newest accepted revision, on which the next change is to be made.
    pub(crate) newest: u64,
    /// That revision.
    pub(crate) revision: Arc<Revision>,
    /// The revision that frames show.
    pub(crate) shown: u64,
    /// The number that the next change gets.
    pub(crate) next: u64,
    /// The change that was refused last.
    pub(crate) refused: Option<RefusedChange>,
}

/// Another scene, made of a snapshot's newest.
#[derive(Debug)]
pub(crate) struct Proposal {
    /// The revision that it was made of.
    pub(crate) base: u64,
    /// The number that it is encoded with.
    pub(crate) number: u64,
    pub(crate) revision: Arc<Revision>,
}

impl Proposal {
    /// Encodes a scene that is to follow the snapshot's newest.
    pub(crate) fn new(base: &Snapshot, scene: Scene) -> Result<Self, EncodeError> {
        Ok(Self {
            base: base.newest,
            number: base.next,
            revision: Arc::new(Revision::new(base.next, scene)?),
        })
    }
}

/// Why a proposal was not taken.
#[derive(Clone, Debug)]
pub(crate) enum Declined {
    /// Another change came before it; this is how things stand now.
    Raced(Snapshot),
    /// The last frame has been begun: nothing will be shown any longer.
    Over,
}
