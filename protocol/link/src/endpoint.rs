//! Endpoints: a server that takes members of the cluster, and the way to one.
//! In: addresses and an identity. Out: [`Peer`]s. Everything here must be called inside a tokio runtime.

use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use quinn::{Endpoint, EndpointConfig, TokioRuntime};

use crate::closed::{CloseCode, Closed};
use crate::identity::{Identity, IdentityError};
use crate::peer::Peer;
use crate::transport::{CLUSTER_NAME, client_config, server_config, server_endpoint_config};
use crate::{IDLE_TIMEOUT, socket};

/// Why a server could not start to listen.
#[derive(Debug, thiserror::Error)]
pub enum BindError {
    /// Somebody else has the port.
    #[error(
        "UDP port {} of {} is in use, perhaps by another master; stop that one, or choose another port \
         (port 0 takes a free one)", address.port(), address.ip()
    )]
    PortInUse {
        /// The address asked for.
        address: SocketAddr,
    },
    /// The address belongs to no interface of this host.
    #[error(
        "{} is not an address of this host; bind to one that is, or to 0.0.0.0 or [::] for all",
        address.ip()
    )]
    NotHere {
        /// The address asked for.
        address: SocketAddr,
    },
    /// The system refused in some other way, ports below 1024 among them.
    #[error("cannot listen on UDP {address}: {source}")]
    Socket {
        /// The address asked for.
        address: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// The identity cannot be used.
    #[error(transparent)]
    Identity(#[from] IdentityError),
}

/// Why a connection to a server did not come about.
#[derive(Debug, thiserror::Error)]
pub enum ConnectError {
    /// The address is no `HOST:PORT`, or the host has no address.
    #[error("cannot resolve the master's address {address:?}: {source}; write HOST:PORT")]
    Resolve {
        /// The address as given.
        address: String,
        /// What the resolver said.
        source: io::Error,
    },
    /// This host cannot open a socket.
    #[error("cannot open a UDP socket towards {address}: {source}")]
    Socket {
        /// The server's address.
        address: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// Nobody answered.
    #[error(
        "no answer from {address}: check that the master runs, that the port is right, and that a \
         firewall lets UDP through"
    )]
    NoAnswer {
        /// The server's address.
        address: SocketAddr,
    },
    /// Somebody answered, and the connection ended before it was one.
    #[error("no connection to {address}: {reason}")]
    Closed {
        /// The server's address.
        address: SocketAddr,
        /// Why.
        reason: Closed,
    },
    /// The identity cannot be used.
    #[error(transparent)]
    Identity(#[from] IdentityError),
}

/// Why a stranger did not become a peer.
#[derive(Debug, thiserror::Error)]
#[error("{address} did not become a peer: {reason}")]
pub struct HandshakeError {
    /// Where it came from.
    pub address: SocketAddr,
    /// What went wrong.
    pub reason: Closed,
}

/// A listening endpoint.
pub struct Server {
    endpoint: Endpoint,
}

impl Server {
    /// Listens on `address`. Must be called inside a tokio runtime.
    ///
    /// # Errors
    /// [`BindError`] names the address and what to do.
    pub fn bind(address: SocketAddr, identity: &Identity) -> Result<Self, BindError> {
        let config = server_config(identity)?;
        let endpoint_config = server_endpoint_config(identity);
        let endpoint = socket::bind(address)
            .and_then(|socket| {
                Endpoint::new(
                    endpoint_config,
                    Some(config),
                    socket,
                    Arc::new(TokioRuntime),
                )
            })
            .map_err(|source| match source.kind() {
                io::ErrorKind::AddrInUse => BindError::PortInUse { address },
                io::ErrorKind::AddrNotAvailable => BindError::NotHere { address },
                _ => BindError::Socket { address, source },
            })?;
        Ok(Self { endpoint })
    }

    /// Where it listens, with the port that the system chose if 0 was asked for.
    ///
    /// # Errors
    /// What the system says if the socket is gone.
    pub fn local_address(&self) -> io::Result<SocketAddr> {
        self.endpoint.local_addr()
    }

    /// The next stranger; `None` once the server is closed. Run its handshake in a task of its own.
    pub async fn accept(&self) -> Option<Incoming> {
        self.endpoint.accept().await.map(Incoming)
    }

    /// Closes every connection with the same reason, and waits until the peers know or a second has
    /// passed.
    pub async fn close(&self, code: CloseCode, reason: &str) {
        self.endpoint.close(code.wire(), reason.as_bytes());
        let _late = tokio::time::timeout(Duration::from_secs(1), self.endpoint.wait_idle()).await;
    }
}

/// A stranger who has sent a first packet and proved nothing.
pub struct Incoming(quinn::Incoming);

impl Incoming {
    /// Where the packet says it came from.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.0.remote_address()
    }

    /// Runs the TLS handshake. A peer that comes out holds a certificate of the cluster.
    ///
    /// # Errors
    /// [`HandshakeError`] for strangers, and for members that fall silent.
    pub async fn handshake(self) -> Result<Peer, HandshakeError> {
        let address = self.0.remote_address();
        let failed = |reason| HandshakeError { address, reason };
        let connecting = self.0.accept().map_err(|error| failed(error.into()))?;
        match tokio::time::timeout(IDLE_TIMEOUT, connecting).await {
            Ok(Ok(connection)) => Ok(Peer::new(connection, None)),
            Ok(Err(error)) => Err(failed(error.into())),
            Err(_elapsed) => Err(failed(Closed::TimedOut)),
        }
    }
}

/// Connects to the server at `address` (`HOST:PORT`, resolved anew at every call). Gives up after the idle
/// timeout. The server's membership is proved; whether the server accepts ours shows only with its first
/// answer.
///
/// # Errors
/// [`ConnectError`] names the address and what to do.
pub async fn connect(address: &str, identity: &Identity) -> Result<Peer, ConnectError> {
    let unresolved = |source| ConnectError::Resolve {
        address: address.to_owned(),
        source,
    };
    let remote = tokio::net::lookup_host(address)
        .await
        .map_err(unresolved)?
        .next()
        .ok_or_else(|| unresolved(io::Error::other("the name has no address")))?;
    let local = match remote {
        SocketAddr::V4(_) => SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0)),
        SocketAddr::V6(_) => SocketAddr::from((Ipv6Addr::UNSPECIFIED, 0)),
    };
    let config = client_config(identity)?;
    let endpoint = socket::bind(local)
        .and_then(|socket| {
            Endpoint::new(
                EndpointConfig::default(),
                None,
                socket,
                Arc::new(TokioRuntime),
            )
        })
        .map_err(|source| ConnectError::Socket {
            address: remote,
            source,
        })?;
    let connecting = endpoint
        .connect_with(config, remote, CLUSTER_NAME)
        .map_err(|error| {
            let source = io::Error::other(error);
            ConnectError::Socket {
                address: remote,
                source,
            }
        })?;
    match tokio::time::timeout(IDLE_TIMEOUT, connecting).await {
        Ok(Ok(connection)) => Ok(Peer::new(connection, Some(endpoint))),
        Ok(Err(error)) => Err(match Closed::from(error) {
            Closed::TimedOut => ConnectError::NoAnswer { address: remote },
            reason => ConnectError::Closed {
                address: remote,
                reason,
            },
        }),
        Err(_elapsed) => Err(ConnectError::NoAnswer { address: remote }),
    }
}
