//! One connection to a member of the cluster.
//! In: bytes. Out: bytes: datagrams (small, newest matters, may be lost), framed messages on one control
//! stream (all arrive, in order), and messages in bulk on streams of their own, paced.

use std::net::SocketAddr;
use std::time::Duration;

use quinn::{Connection, Endpoint, RecvStream, SendDatagramError, SendStream};

use crate::closed::{CloseCode, Closed};
use crate::message::{MessageReceiver, MessageSender};

/// Two kinds of datagrams that the receiver must tell apart before it reads them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Channel {
    /// State, of which only the newest counts.
    State = 0,
    /// Short messages.
    Message = 1,
}

/// Why a datagram did not leave.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DatagramError {
    /// The connection is over.
    #[error(transparent)]
    Closed(#[from] Closed),
    /// It does not fit into a packet on this path.
    #[error("a datagram of {bytes} bytes; this path carries {cap}")]
    TooLong {
        /// Its length.
        bytes: usize,
        /// The longest that the path carries now.
        cap: usize,
    },
}

/// A connection to a peer. Clones are handles to the same connection.
#[derive(Clone)]
pub struct Peer {
    connection: Connection,
    /// The socket of a connection that this side opened; a server keeps its own.
    endpoint: Option<Endpoint>,
}

impl Peer {
    pub(crate) const fn new(connection: Connection, endpoint: Option<Endpoint>) -> Self {
        Self {
            connection,
            endpoint,
        }
    }

    /// The peer's address.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.connection.remote_address()
    }

    /// Whether the peer is a process of this host, which reads the same [`crate::now_us`].
    #[must_use]
    pub fn is_on_this_host(&self) -> bool {
        self.address().ip().to_canonical().is_loopback()
    }

    /// Smoothed round-trip time.
    #[must_use]
    pub fn round_trip(&self) -> Duration {
        self.connection.rtt()
    }

    /// Queues a datagram. Never waits: if the peer does not take them, the oldest is dropped.
    ///
    /// # Errors
    /// [`DatagramError`]; what is too long is not sent.
    pub fn send_datagram(&self, channel: Channel, bytes: &[u8]) -> Result<(), DatagramError> {
        let mut datagram = Vec::with_capacity(1 + bytes.len());
        datagram.push(channel as u8);
        datagram.extend_from_slice(bytes);
        self.connection
            .send_datagram(datagram.into())
            .map_err(|error| match error {
                SendDatagramError::ConnectionLost(error) => DatagramError::Closed(error.into()),
                SendDatagramError::TooLarge => DatagramError::TooLong {
                    bytes: bytes.len(),
                    cap: self
                        .connection
                        .max_datagram_size()
                        .unwrap_or(0)
                        .saturating_sub(1),
                },
                SendDatagramError::UnsupportedByPeer | SendDatagramError::Disabled => {
                    DatagramError::Closed(Closed::NotTerrawall)
                }
            })
    }

    /// The next datagram. One of no known channel is skipped. Dropping the future loses nothing.
    ///
    /// # Errors
    /// [`Closed`] once the connection is over.
    pub async fn receive_datagram(&self) -> Result<(Channel, Vec<u8>), Closed> {
        loop {
            let datagram = self.connection.read_datagram().await?;
            let Some((channel, bytes)) = datagram.split_first() else {
                continue;
            };
            let channel = match channel {
                0 => Channel::State,
                1 => Channel::Message,
                _ => continue,
            };
            return Ok((channel, bytes.to_vec()));
        }
    }

    /// Opens the control stream; the server's part. The client sees it with the first message. Messages
    /// of more than `longest_sent` or `longest_received` bytes are errors.
    ///
    /// # Errors
    /// [`Closed`] if the connection is over.
    pub async fn open_control(
        &self,
        longest_sent: usize,
        longest_received: usize,
    ) -> Result<(MessageSender, MessageReceiver), Closed> {
        let (send, receive) = self.connection.open_bi().await?;
        Ok(control(send, receive, longest_sent, longest_received))
    }

    /// Takes the control stream; the client's part. Waits for the server's first message.
    ///
    /// # Errors
    /// [`Closed`] if the connection is over, for example because the server refuses our certificate.
    pub async fn accept_control(
        &self,
        longest_sent: usize,
        longest_received: usize,
    ) -> Result<(MessageSender, MessageReceiver), Closed> {
        let (send, receive) = self.connection.accept_bi().await?;
        Ok(control(send, receive, longest_sent, longest_received))
    }

    /// Opens a stream for messages in bulk, sent at no more than `bytes_per_second` and after everything
    /// else; the client's part.
    ///
    /// # Errors
    /// [`Closed`] if the connection is over.
    pub async fn open_bulk(
        &self,
        longest_sent: usize,
        bytes_per_second: u32,
    ) -> Result<MessageSender, Closed> {
        let stream = self.connection.open_uni().await?;
        Ok(MessageSender::paced(stream, longest_sent, bytes_per_second))
    }

    /// Takes the next stream for messages in bulk; the server's part.
    ///
    /// # Errors
    /// [`Closed`] if the connection is over.
    pub async fn accept_bulk(&self, longest_received: usize) -> Result<MessageReceiver, Closed> {
        let stream = self.connection.accept_uni().await?;
        Ok(MessageReceiver::new(stream, longest_received))
    }

    /// Closes the connection. What is queued may be lost; the peer is told the reason.
    pub fn close(&self, code: CloseCode, reason: &str) {
        self.connection.close(code.wire(), reason.as_bytes());
    }

    /// Waits until a connection that this side opened has told its end to the peer, at most 200 ms.
    pub async fn flush_close(&self) {
        if let Some(endpoint) = &self.endpoint {
            let _late =
                tokio::time::timeout(Duration::from_millis(200), endpoint.wait_idle()).await;
        }
    }

    /// Waits for the end of the connection and says why.
    pub async fn closed(&self) -> Closed {
        self.connection.closed().await.into()
    }

    /// Why the connection is over, if it is.
    #[must_use]
    pub fn close_reason(&self) -> Option<Closed> {
        self.connection.close_reason().map(Closed::from)
    }
}

fn control(
    send: SendStream,
    receive: RecvStream,
    longest_sent: usize,
    longest_received: usize,
) -> (MessageSender, MessageReceiver) {
    // Control goes before bulk on the way out. It fails only on a stream that is already over.
    let _over = send.set_priority(1);
    (
        MessageSender::new(send, longest_sent),
        MessageReceiver::new(receive, longest_received),
    )
}
