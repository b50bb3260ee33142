//! What both ends agree on below the messages: TLS 1.3 with certificates of the cluster on both sides, and
//! the transport's timers and windows. In: an identity. Out: quinn configurations.

use std::sync::Arc;
use std::time::Duration;

use quinn::crypto::rustls::{QuicClientConfig, QuicServerConfig};
use quinn::{
    ClientConfig, ConnectionId, ConnectionIdGenerator, EndpointConfig, ServerConfig,
    TransportConfig, VarInt,
};
use ring::hmac;
use ring::rand::{SecureRandom, SystemRandom};
use rustls::crypto::CryptoProvider;
use rustls::server::WebPkiClientVerifier;
use rustls::{RootCertStore, version};
use sha2::{Digest, Sha256};

use crate::identity::{Identity, IdentityError};

/// The server name in every certificate. Membership is what is proved, not the name of a host.
pub const CLUSTER_NAME: &str = "terrawall";

/// A peer that says nothing for this long is gone. quinn notices a dead process by nothing else.
pub const IDLE_TIMEOUT: Duration = Duration::from_secs(2);

/// Sent when nothing else is, four times per idle timeout.
pub const KEEP_ALIVE: Duration = Duration::from_millis(500);

/// The largest datagram that every path carries from the first packet on, in bytes.
pub const LARGEST_DATAGRAM_BYTES: usize = 1_150;

/// The application protocol in the TLS handshake. The version of the messages is in the hello, where a
/// mismatch can be explained.
const APPLICATION_PROTOCOL: &[u8] = b"terrawall";

pub(crate) fn client_config(identity: &Identity) -> Result<ClientConfig, IdentityError> {
    let mut tls = rustls::ClientConfig::builder_with_provider(provider())
        .with_protocol_versions(&[&version::TLS13])
        .map_err(IdentityError::unusable)?
        .with_root_certificates(roots(identity)?)
        .with_client_auth_cert(vec![identity.certificate()], identity.key())
        .map_err(IdentityError::unusable)?;
    tls.alpn_protocols = vec![APPLICATION_PROTOCOL.to_vec()];
    let quic = QuicClientConfig::try_from(tls).map_err(IdentityError::unusable)?;
    let mut config = ClientConfig::new(Arc::new(quic));
    // The server opens the control stream and nothing else.
    config.transport_config(Arc::new(transport(1, 0)));
    Ok(config)
}

pub(crate) fn server_config(identity: &Identity) -> Result<ServerConfig, IdentityError> {
    let verifier =
        WebPkiClientVerifier::builder_with_provider(Arc::new(roots(identity)?), provider())
            .build()
            .map_err(IdentityError::unusable)?;
    let mut tls = rustls::ServerConfig::builder_with_provider(provider())
        .with_protocol_versions(&[&version::TLS13])
        .map_err(IdentityError::unusable)?
        .with_client_cert_verifier(verifier)
        .with_single_cert(vec![identity.certificate()], identity.key())
        .map_err(IdentityError::unusable)?;
    tls.alpn_protocols = vec![APPLICATION_PROTOCOL.to_vec()];
    let quic = QuicServerConfig::try_from(tls).map_err(IdentityError::unusable)?;
    let mut config = ServerConfig::with_crypto(Arc::new(quic));
    // One control stream and a few bulk streams per node; a flood of half-open strangers is bounded.
    config
        .transport_config(Arc::new(transport(1, 4)))
        .max_incoming(64);
    Ok(config)
}

/// The endpoint of a server. Its reset key comes from the identity, so that a restarted master can tell the
/// nodes of the one before that their connections are void: they would wait for the idle timeout.
pub(crate) fn server_endpoint_config(identity: &Identity) -> EndpointConfig {
    let mut hash = Sha256::new();
    hash.update(b"terrawall stateless reset");
    hash.update(identity.key().secret_der());
    let reset_key = hmac::Key::new(hmac::HMAC_SHA256, &hash.finalize());
    let mut config = EndpointConfig::new(Arc::new(reset_key));
    config.cid_generator(|| Box::new(RandomNames(SystemRandom::new())));
    config
}

/// Names connections at random. The usual generator seals them with a key of its own run, and would not even
/// look at packets for connections of an earlier run.
struct RandomNames(SystemRandom);

impl RandomNames {
    const BYTES: usize = 8;
}

impl ConnectionIdGenerator for RandomNames {
    fn generate_cid(&mut self) -> ConnectionId {
        let mut name = [0; Self::BYTES];
        // Without randomness there was no TLS either; equal names would only cost the connection.
        let _no_randomness = self.0.fill(&mut name);
        ConnectionId::new(&name)
    }

    fn cid_len(&self) -> usize {
        Self::BYTES
    }

    fn cid_lifetime(&self) -> Option<Duration> {
        None
    }
}

fn provider() -> Arc<CryptoProvider> {
    Arc::new(rustls::crypto::ring::default_provider())
}

fn roots(identity: &Identity) -> Result<RootCertStore, IdentityError> {
    let mut roots = RootCertStore::empty();
    roots
        .add(identity.authority())
        .map_err(IdentityError::unusable)?;
    Ok(roots)
}

/// `bidirectional`, `unidirectional`: how many streams the other side may have open at once.
fn transport(bidirectional: u32, unidirectional: u32) -> TransportConfig {
    let mut transport = TransportConfig::default();
    transport
        .max_concurrent_bidi_streams(VarInt::from_u32(bidirectional))
        .max_concurrent_uni_streams(VarInt::from_u32(unidirectional))
        .max_idle_timeout(Some(
            VarInt::from_u32(IDLE_TIMEOUT.as_millis() as u32).into(),
        ))
        .keep_alive_interval(Some(KEEP_ALIVE))
        // Walls stand in one room: a lost first packet is sent again after tens of milliseconds, not a second.
        .initial_rtt(Duration::from_millis(20))
        .stream_receive_window(VarInt::from_u32(2 << 20))
        .receive_window(VarInt::from_u32(8 << 20))
        .send_window(8 << 20)
        // Datagrams are views and their answers: more than a handful waiting are out of date.
        .datagram_receive_buffer_size(Some(64 << 10))
        .datagram_send_buffer_size(16 << 10);
    transport
}
