//! What an operator wants to know while a wall runs.
//! In: what happens in the frame loop. Out: notices in a bounded queue, which may be read or not: nothing waits.

use std::net::SocketAddr;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Notices that may wait for somebody to read them; more are dropped.
const LONGEST_NOTICE_QUEUE: usize = 4_096;

/// Something an operator wants to know while the wall runs.
#[derive(Clone, Debug, PartialEq)]
pub enum Notice {
    /// A node was welcomed. It draws, and is waited for once it has caught up.
    Joined {
        /// The node.
        node: String,
        /// Its graphics adapter.
        adapter: String,
        /// Where it is.
        address: SocketAddr,
    },
    /// A node keeps step from now on.
    Entered {
        /// The node.
        node: String,
    },
    /// A node keeps step no longer.
    Left {
        /// The node.
        node: String,
        /// Why.
        reason: String,
    },
    /// A node's connection is over.
    Disconnected {
        /// The node.
        node: String,
        /// Why.
        reason: String,
    },
    /// A member of the cluster was not let in.
    Refused {
        /// The name it gave.
        node: String,
        /// Where it is.
        address: SocketAddr,
        /// Why, as it was told.
        reason: String,
    },
    /// Somebody could not prove membership, or did not introduce itself.
    Stranger {
        /// Where it is.
        address: SocketAddr,
        /// What went wrong.
        reason: String,
    },
    /// A node cannot draw what it should; it goes on.
    Fault {
        /// The node.
        node: String,
        /// Its words.
        message: String,
    },
    /// Something lowers the quality of what a node draws, or does so no longer.
    Trouble {
        /// The node.
        node: String,
        /// Its words.
        message: String,
    },
    /// The wall is complete, or the time to wait for it is over: frames count from now on.
    Started {
        /// Nodes in step.
        nodes: usize,
        /// Hosts of the wall.
        hosts: usize,
    },
    /// About four times a second while frames count.
    Progress {
        /// Frames so far.
        frame: u64,
        /// All frames, if their number was given.
        frames: Option<u64>,
    },
    /// The camera holds still; about once a second until the pictures are there.
    Settling {
        /// Whom it waits for and why.
        waits_for: Vec<String>,
    },
    /// The run is over but for the error of the last picture, which nodes measure; about once a second from the first
    /// second on.
    Measuring {
        /// Nodes that have not answered.
        waits_for: Vec<String>,
    },
    /// Something happened to a tracker or to what it is measured by.
    Tracker {
        /// What, in a sentence that names it.
        event: String,
    },
    /// A change of the scene is shown from the next frame on.
    ChangeShown {
        /// Its number.
        revision: u64,
        /// Nodes that were not waited for any longer: they show it once they have prepared it.
        unprepared: Vec<String>,
    },
    /// A node cannot show a change of the scene: the wall goes on as it was.
    ChangeRefused {
        /// Its number.
        revision: u64,
        /// The node.
        node: String,
        /// Why.
        reason: String,
    },
}

/// The frame loop's end of the notices.
pub(crate) struct NoticeSender(SyncSender<Notice>);

impl NoticeSender {
    /// Tells the operator, or nobody if nobody reads.
    pub(crate) fn send(&self, notice: Notice) {
        let _unread = self.0.try_send(notice);
    }
}

/// A new queue of notices.
pub(crate) fn queue() -> (NoticeSender, Receiver<Notice>) {
    let (sender, receiver) = sync_channel(LONGEST_NOTICE_QUEUE);
    (NoticeSender(sender), receiver)
}
