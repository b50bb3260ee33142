//! How trackers stood at the end of a run, and what happened to them.
//! Plain data.

use serde::{Deserialize, Serialize};

/// One tracker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackerReport {
    /// Its name in the wall.
    pub name: String,
    /// How it stood.
    pub state: TrackerState,
    /// How many measurements have come from it.
    pub measurements: u64,
    /// What happened to it or to its source, the oldest first, at most 64 sentences.
    pub events: Vec<String>,
}

/// How a tracker stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TrackerState {
    /// Nothing was measured yet: heads rest where the wall file says.
    Waiting,
    /// The head is where it says.
    Tracked,
    /// Nothing is measured any more: the head stays where it was.
    Lost,
}
