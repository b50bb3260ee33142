//! How a node's words reach the master: datagrams, the control stream, pictures in bulk.
//! In: what the frame loop says, moments for pings. Out: encoded messages on the way that suits them. It hears
//! nothing and never waits for a master that does not read.

use std::sync::Arc;
use std::time::Duration;

use link::{Channel, Peer};
use protocol::ToMaster;
use protocol::capture::split_rows;
use protocol::codec::{MAX_LARGE_BYTES, encode_to_master};
use tokio::sync::mpsc;
use tokio::time::Instant;

use crate::mail::{Mail, Outgoing};
use crate::picture::OutputImage;

/// Pace of captured pictures: a tenth of a gigabit link, so that views pass beside them.
const CAPTURE_BYTES_PER_SECOND: u32 = 60_000_000;

/// When the master's clock is asked for next.
#[derive(Debug)]
pub(crate) struct Pings {
    /// The moment.
    pub(crate) next: Instant,
    /// Number of the last ping.
    pub(crate) sequence: u32,
}

impl Pings {
    /// The ping that is due, and when the next one is.
    pub(crate) fn ping(&mut self, wait_us: i64) -> ToMaster {
        self.next = Instant::now() + Duration::from_micros(wait_us.unsigned_abs());
        self.sequence = self.sequence.wrapping_add(1);
        ToMaster::ClockPing {
            sequence: self.sequence,
            node_sent_us: link::now_us(),
        }
    }
}

/// What the node says, on the way that suits it.
pub(crate) struct Speaker<'a> {
    /// The master.
    pub(crate) peer: &'a Peer,
    /// Encoded messages that must arrive; `None` once the node has said all.
    pub(crate) control: Option<mpsc::Sender<Vec<u8>>>,
}

impl Speaker<'_> {
    /// Sends a datagram, or not: what travels so is said again if it is lost.
    pub(crate) fn datagram(&self, message: &ToMaster) {
        let sent = encode_to_master(message)
            .map_err(|error| error.to_string())
            .and_then(|bytes| {
                self.peer
                    .send_datagram(Channel::Message, &bytes)
                    .map_err(|error| error.to_string())
            });
        if let Err(error) = sent {
            tracing::debug!(%error, "a datagram did not leave");
        }
    }

    /// False if the master has taken nothing for so long that the queue is full.
    pub(crate) fn say(&self, outgoing: Outgoing, mail: &Arc<Mail>) -> bool {
        match outgoing {
            Outgoing::Datagram(message) => {
                self.datagram(&message);
                true
            }
            Outgoing::Message(message) => match (encode_to_master(&message), &self.control) {
                (Ok(bytes), Some(control)) => control.try_send(bytes).is_ok(),
                (Ok(_), None) => true,
                (Err(error), _) => {
                    tracing::error!(%error, "a message of this node does not fit");
                    true
                }
            },
            Outgoing::Pictures(id, pictures) => {
                tokio::spawn(send_pictures(
                    self.peer.clone(),
                    id,
                    pictures,
                    Arc::clone(mail),
                ));
                true
            }
        }
    }
}

/// Sends captured pictures in bulk, then the word that they are complete.
async fn send_pictures(peer: Peer, id: u32, pictures: Vec<OutputImage>, mail: Arc<Mail>) {
    let sent = async {
        let mut bulk = peer
            .open_bulk(MAX_LARGE_BYTES, CAPTURE_BYTES_PER_SECOND)
            .await
            .map_err(|error| error.to_string())?;
        let outputs = pictures.len() as u32;
        for (output, picture) in (0u32..).zip(&pictures) {
            for rows in split_rows(id, output, picture.width, &picture.rgba) {
                let bytes = encode_to_master(&ToMaster::CaptureRows(rows))
                    .map_err(|error| error.to_string())?;
                bulk.send(&bytes).await.map_err(|error| error.to_string())?;
            }
        }
        let done = encode_to_master(&ToMaster::CaptureDone { id, outputs })
            .map_err(|error| error.to_string())?;
        bulk.send(&done).await.map_err(|error| error.to_string())?;
        bulk.finish().await;
        Ok::<(), String>(())
    };
    if let Err(reason) = sent.await {
        mail.send(
            Outgoing::Message(ToMaster::CaptureFailed { id, reason }),
            true,
        );
    }
}
