//! One node's connection, in a task of its own on the network thread.
//! In: bytes from the node; the newest view and swap, and messages, from the frame loop. Out: events for
//! the frame loop. Whatever a node does or fails to do, the frame loop never waits for it: views and swaps
//! lie in a slot where the newest wins, messages in a short queue, and a node that lets it overflow is gone.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use link::{Channel, CloseCode, MessageReceiver, MessageSender, Peer};
use protocol::capture::CaptureAssembly;
use protocol::codec::{MAX_LARGE_BYTES, decode_to_master, encode_to_node};
use protocol::message::Hello;
use protocol::{PROTOCOL_VERSION, ToMaster, ToNode, Wall};
use tokio::sync::{mpsc, watch};
use tokio::time::timeout;

use crate::events::{ConnectionId, Event, EventSender};

/// A peer that proved membership must introduce itself within this time.
const GREETING_TIMEOUT: Duration = Duration::from_secs(3);
/// Messages that may wait for a node that does not read.
const CONTROL_QUEUE: usize = 64;
/// How long a refused or leaving node has to read why.
const FAREWELL: Duration = Duration::from_millis(500);

/// Encoded bytes that several nodes are sent.
pub(crate) type Bytes = Arc<[u8]>;

/// What changes with every frame. The newest wins; the numbers tell the task what is new.
#[derive(Clone, Debug, Default)]
struct Slot {
    view: Option<Bytes>,
    views: u64,
    swap: Option<Bytes>,
    swaps: u64,
}

/// The frame loop's end of a node's connection. Nothing here ever waits.
#[derive(Debug)]
pub(crate) struct NodeLink {
    slot: watch::Sender<Slot>,
    control: mpsc::Sender<Control>,
}

#[derive(Debug)]
enum Control {
    Message(Bytes),
    /// The last message, after which the connection is closed with a reason.
    Farewell(Bytes, CloseCode, String),
}

impl NodeLink {
    /// Puts the newest view into the node's slot.
    pub(crate) fn show(&self, view: &Bytes) {
        self.slot.send_modify(|slot| {
            slot.view = Some(Arc::clone(view));
            slot.views += 1;
        });
    }

    /// Puts the newest swap into the node's slot.
    pub(crate) fn swap(&self, swap: &Bytes) {
        self.slot.send_modify(|slot| {
            slot.swap = Some(Arc::clone(swap));
            slot.swaps += 1;
        });
    }

    /// Queues a message that must arrive. False if the node has not read for so long that it must go.
    pub(crate) fn tell(&self, message: &Bytes) -> bool {
        self.control
            .try_send(Control::Message(Arc::clone(message)))
            .is_ok()
    }

    /// Queues the last message; the connection ends when the node has read it, or soon after.
    pub(crate) fn dismiss(&self, message: &Bytes, code: CloseCode, reason: &str) -> bool {
        let farewell = Control::Farewell(Arc::clone(message), code, reason.to_owned());
        self.control.try_send(farewell).is_ok()
    }
}

/// What every connection needs to know of the master.
#[derive(Clone)]
pub(crate) struct Context {
    pub(crate) wall: Arc<Wall>,
    /// Number of this run of the master.
    pub(crate) session: u64,
    pub(crate) events: EventSender,
}

/// Serves one peer from its first word to its end.
pub(crate) async fn serve(peer: Peer, id: ConnectionId, context: Context) {
    let address = peer.address();
    let greeted = timeout(GREETING_TIMEOUT, greet(&peer, &context)).await;
    let (hello, sender, receiver) = match greeted {
        Ok(Ok(greeted)) => greeted,
        Ok(Err(reason)) => return stranger(&peer, address, reason, &context),
        Err(_elapsed) => {
            return stranger(
                &peer,
                address,
                "it did not introduce itself".to_owned(),
                &context,
            );
        }
    };
    let (slot, changed) = watch::channel(Slot::default());
    let (control, queue) = mpsc::channel(CONTROL_QUEUE);
    let link = NodeLink { slot, control };
    let host = context.wall.host_index(&hello.node);
    context.events.send(Event::Hello {
        id,
        address,
        hello,
        link,
    });
    let writer = tokio::spawn(write(peer.clone(), sender, queue));
    let reason = tokio::select! {
        reason = listen(&peer, receiver, id, &context) => reason,
        reason = send_newest(&peer, changed) => reason,
        reason = take_captures(&peer, id, host, &context) => reason,
    };
    // The frame loop hears of the end before anybody could hear of a successor.
    context.events.send(Event::Gone { id, reason });
    // A farewell that is still on its way out may finish; it bounds itself.
    let _ended = timeout(FAREWELL * 2, writer).await;
    peer.close(CloseCode::Finished, "");
}

fn stranger(peer: &Peer, address: SocketAddr, reason: String, context: &Context) {
    peer.close(CloseCode::Protocol, &reason);
    context.events.send(Event::Stranger { address, reason });
}

/// Challenge and hello.
async fn greet(
    peer: &Peer,
    context: &Context,
) -> Result<(Hello, MessageSender, MessageReceiver), String> {
    let (mut sender, mut receiver) = peer
        .open_control(MAX_LARGE_BYTES, MAX_LARGE_BYTES)
        .await
        .map_err(|error| error.to_string())?;
    let challenge = ToNode::Challenge {
        protocol_version: PROTOCOL_VERSION,
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        session: context.session,
    };
    let challenge = encode_to_node(&challenge).map_err(|error| error.to_string())?;
    sender
        .send(&challenge)
        .await
        .map_err(|error| error.to_string())?;
    let hello = receiver
        .receive()
        .await
        .map_err(|error| error.to_string())?;
    match decode_to_master(&hello) {
        Ok(ToMaster::Hello(hello)) => Ok((hello, sender, receiver)),
        Ok(_) => Err("its first word was no hello".to_owned()),
        Err(error) => Err(error.to_string()),
    }
}

/// Reads what the node says until the connection ends; says why it ended.
async fn listen(
    peer: &Peer,
    mut control: MessageReceiver,
    id: ConnectionId,
    context: &Context,
) -> String {
    loop {
        let bytes = tokio::select! {
            message = control.receive() => match message {
                Ok(bytes) => bytes,
                Err(error) => return error.to_string(),
            },
            datagram = peer.receive_datagram() => match datagram {
                Ok((Channel::Message, bytes)) => bytes,
                // Nodes have no state to tell.
                Ok((Channel::State, _)) => continue,
                Err(closed) => return closed.to_string(),
            },
        };
        let at_us = link::now_us();
        match decode_to_master(&bytes) {
            Ok(message) => {
                if let ToMaster::ClockPing {
                    sequence,
                    node_sent_us,
                } = message
                {
                    answer_ping(peer, sequence, node_sent_us, at_us);
                }
                context.events.send(Event::Said { id, at_us, message });
            }
            Err(error) => {
                peer.close(CloseCode::Protocol, &error.to_string());
                return error.to_string();
            }
        }
    }
}

fn answer_ping(peer: &Peer, sequence: u32, node_sent_us: i64, master_received_us: i64) {
    let pong = ToNode::ClockPong {
        sequence,
        node_sent_us,
        master_received_us,
        master_sent_us: link::now_us(),
    };
    if let Ok(bytes) = encode_to_node(&pong) {
        // A lost answer is asked for again.
        let _lost = peer.send_datagram(Channel::Message, &bytes);
    }
}

/// Sends views and swaps as they appear in the slot.
async fn send_newest(peer: &Peer, mut changed: watch::Receiver<Slot>) -> String {
    let (mut views, mut swaps) = (0, 0);
    loop {
        if changed.changed().await.is_err() {
            // The frame loop has let go of this node. What ends the connection is the farewell.
            return peer.closed().await.to_string();
        }
        let slot = changed.borrow_and_update().clone();
        if let Some(swap) = slot.swap.filter(|_| slot.swaps != swaps) {
            swaps = slot.swaps;
            if let Err(error) = peer.send_datagram(Channel::Message, &swap) {
                tracing::debug!(%error, "a swap did not leave");
            }
        }
        if let Some(view) = slot.view.filter(|_| slot.views != views) {
            views = slot.views;
            if let Err(error) = peer.send_datagram(Channel::State, &view) {
                tracing::debug!(%error, "a view did not leave");
            }
        }
    }
}

/// Sends messages in order.
async fn write(peer: Peer, mut sender: MessageSender, mut queue: mpsc::Receiver<Control>) {
    while let Some(control) = queue.recv().await {
        match control {
            Control::Message(bytes) => {
                if sender.send(&bytes).await.is_err() {
                    return;
                }
            }
            Control::Farewell(bytes, code, reason) => {
                let said = async {
                    if sender.send(&bytes).await.is_ok() {
                        sender.finish().await;
                        // A node that is told to leave says good-bye itself; it may have figures to tell.
                        peer.closed().await;
                    }
                };
                let _elapsed = timeout(FAREWELL, said).await;
                peer.close(code, &reason);
                return;
            }
        }
    }
    // The frame loop has let go of this node without a word: it has given it up, or it has a successor.
    peer.close(CloseCode::Replaced, "this connection is given up");
}

/// Puts captured pictures together, one capture after the other.
async fn take_captures(
    peer: &Peer,
    id: ConnectionId,
    host: Option<usize>,
    context: &Context,
) -> String {
    loop {
        let mut bulk = match peer.accept_bulk(MAX_LARGE_BYTES).await {
            Ok(bulk) => bulk,
            Err(closed) => return closed.to_string(),
        };
        let Some(host) = host.and_then(|host| context.wall.hosts.get(host)) else {
            peer.close(
                CloseCode::Protocol,
                "pictures of a host that the wall does not have",
            );
            return peer.closed().await.to_string();
        };
        let mut assembly: Option<CaptureAssembly> = None;
        let result = loop {
            let message = match bulk.receive().await {
                Ok(bytes) => decode_to_master(&bytes).map_err(|error| error.to_string()),
                Err(error) => Err(error.to_string()),
            };
            match message {
                Ok(ToMaster::CaptureRows(rows)) => {
                    let assembly =
                        assembly.get_or_insert_with(|| CaptureAssembly::new(rows.id, host));
                    if let Err(error) = assembly.add(&rows) {
                        break Err(error.to_string());
                    }
                }
                Ok(ToMaster::CaptureDone { id, .. }) => {
                    let assembly = assembly.unwrap_or_else(|| CaptureAssembly::new(id, host));
                    break assembly.finish().map_err(|error| error.to_string());
                }
                Ok(_) => break Err("its pictures are mixed with other words".to_owned()),
                Err(error) => break Err(error),
            }
        };
        context.events.send(Event::Captured { id, result });
    }
}
