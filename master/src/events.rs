//! What the network and the control API tell and ask the frame loop.
//! In: events from tasks of connections and of requests. Out: one bounded queue. Nothing here waits.

use std::net::SocketAddr;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

use protocol::ToMaster;
use protocol::capture::CapturedPicture;
use protocol::message::Hello;
use protocol::pattern::Pattern;
use tokio::sync::oneshot;

use crate::change::{Declined, Proposal, Snapshot};
use crate::installation::{AdjustedWall, Installation, OutputPlace};
use crate::session::NodeLink;

/// Number of a connection, never used again within a run.
pub(crate) type ConnectionId = u64;

/// Events that may wait for the frame loop: seconds of a whole wall's talk.
const LONGEST_QUEUE: usize = 16_384;

/// Something happened on the network.
#[derive(Debug)]
pub(crate) enum Event {
    /// A member of the cluster introduces itself and waits for an answer.
    Hello {
        id: ConnectionId,
        address: SocketAddr,
        hello: Hello,
        link: NodeLink,
    },
    /// A node says something, read at this moment of the master's clock.
    Said {
        id: ConnectionId,
        at_us: i64,
        message: ToMaster,
    },
    /// A node's pictures are complete, or will not be.
    Captured {
        id: ConnectionId,
        result: Result<Vec<CapturedPicture>, String>,
    },
    /// A connection that had introduced itself is over.
    Gone { id: ConnectionId, reason: String },
    /// Somebody did not get as far as a hello.
    Stranger { address: SocketAddr, reason: String },
    /// Somebody asks how the scene stands.
    LookAtScene { reply: oneshot::Sender<Snapshot> },
    /// Somebody has made a change. The answer is the revision's number.
    Propose {
        proposal: Proposal,
        reply: oneshot::Sender<Result<u64, Declined>>,
    },
    /// Somebody asks how the wall stands.
    LookAtWall {
        reply: oneshot::Sender<Installation>,
    },
    /// Somebody has measured the wall anew. The answer is the revision of its measures.
    AdjustWall {
        adjusted: Box<AdjustedWall>,
        reply: oneshot::Sender<u32>,
    },
    /// Somebody wants patterns on outputs, or on all where no place is named, one after the other.
    ShowPatterns {
        wishes: Vec<(Option<OutputPlace>, Option<Pattern>)>,
        reply: oneshot::Sender<Installation>,
    },
    /// Show another scene, whatever the present one is.
    SetScene(Box<protocol::Scene>),
    /// The operator wants the run to end.
    Stop,
}

/// The network's end of the queue.
#[derive(Clone)]
pub(crate) struct EventSender(SyncSender<Event>);

impl EventSender {
    /// Queues an event. If the frame loop is that far behind, the event is lost like a datagram.
    pub(crate) fn send(&self, event: Event) {
        if let Err(TrySendError::Full(event)) = self.0.try_send(event) {
            tracing::warn!(?event, "the frame loop is too far behind to hear this");
        }
    }
}

/// A new queue.
pub(crate) fn queue() -> (EventSender, Receiver<Event>) {
    let (sender, receiver) = sync_channel(LONGEST_QUEUE);
    (EventSender(sender), receiver)
}
