//! Membership and transport: QUIC endpoints, TLS identities, socket settings, the clock of this host.
//! In: an address and a cluster identity. Out: a [`Peer`] that carries datagrams, framed messages and
//! bulk data, as bytes. This crate alone knows quinn and rustls. It does not know what the bytes mean.
//!
//! A peer that comes out of [`Incoming::handshake`] has proved that it holds a certificate of the
//! cluster. A peer that comes out of [`connect`] has proved the same, but with TLS 1.3 the *server's*
//! opinion of our own certificate is known only once the server has answered something: a caller must
//! exchange a hello and an answer before it believes that it is a member.

mod clock;
mod closed;
mod endpoint;
mod identity;
mod message;
mod peer;
mod socket;
mod transport;

pub use clock::{go_before_others, now_us, sleep_until_us, use_precise_timers};
pub use closed::{CloseCode, Closed};
pub use endpoint::{BindError, ConnectError, HandshakeError, Incoming, Server, connect};
pub use identity::{Identity, IdentityError};
pub use message::{MessageError, MessageReceiver, MessageSender};
pub use peer::{Channel, DatagramError, Peer};
pub use socket::{RECEIVE_BUFFER_BYTES, SEND_BUFFER_BYTES};
pub use transport::{CLUSTER_NAME, IDLE_TIMEOUT, KEEP_ALIVE, LARGEST_DATAGRAM_BYTES};
