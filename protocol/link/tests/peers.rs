//! Two ends over loopback: what arrives, and who is kept out.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::time::{Duration, Instant};

use link::{
    BindError, Channel, CloseCode, Closed, ConnectError, DatagramError, HandshakeError, Identity,
    LARGEST_DATAGRAM_BYTES, MessageError, Peer, Server, connect,
};

const CAP: usize = 100_000;

fn any_port() -> SocketAddr {
    SocketAddr::from((Ipv4Addr::LOCALHOST, 0))
}

async fn accept_one(server: &Server) -> Result<Peer, HandshakeError> {
    server.accept().await.unwrap().handshake().await
}

/// A server, the server's side of a connection, and the client's side.
async fn pair() -> (Server, Peer, Peer) {
    let identity = Identity::throw_away().unwrap();
    let server = Server::bind(any_port(), &identity).unwrap();
    let address = server.local_address().unwrap().to_string();
    let (near, far) = tokio::join!(accept_one(&server), connect(&address, &identity));
    (server, near.unwrap(), far.unwrap())
}

#[tokio::test]
async fn messages_datagrams_and_bulk_arrive_whole() {
    let (_server, master, node) = pair().await;
    let (mut master_out, mut master_in) = master.open_control(CAP, CAP).await.unwrap();
    master_out.send(b"challenge").await.unwrap();
    let (mut node_out, mut node_in) = node.accept_control(CAP, CAP).await.unwrap();
    assert_eq!(node_in.receive().await.unwrap(), b"challenge");
    node_out.send(b"hello").await.unwrap();
    assert_eq!(master_in.receive().await.unwrap(), b"hello");

    // Many messages of all sizes, the empty one and the longest among them, keep their borders.
    let lengths = [0, 1, 3, 4, 5, 1_000, 65_536, CAP];
    let sender = tokio::spawn(async move {
        for length in lengths {
            master_out.send(&vec![length as u8; length]).await.unwrap();
        }
        master_out
    });
    for length in lengths {
        assert_eq!(node_in.receive().await.unwrap(), vec![length as u8; length]);
    }
    let master_out = sender.await.unwrap();

    for channel in [Channel::State, Channel::Message] {
        master
            .send_datagram(channel, &[7; LARGEST_DATAGRAM_BYTES])
            .unwrap();
        let arrived = node.receive_datagram().await.unwrap();
        assert_eq!(arrived, (channel, vec![7; LARGEST_DATAGRAM_BYTES]));
    }
    let error = master
        .send_datagram(Channel::State, &[7; 5_000])
        .unwrap_err();
    assert!(
        matches!(error, DatagramError::TooLong { bytes: 5_000, .. }),
        "{error}"
    );

    let picture: Vec<u8> = (0..1_000_000u32).map(|i| (i % 251) as u8).collect();
    let start = Instant::now();
    let mut bulk = node.open_bulk(2_000_000, 10_000_000).await.unwrap();
    let (_, received) = tokio::join!(
        async {
            bulk.send(&picture).await.unwrap();
            bulk.finish().await;
        },
        async {
            let mut bulk = master.accept_bulk(1_000_000).await.unwrap();
            let picture = bulk.receive().await.unwrap();
            assert_eq!(bulk.receive().await.unwrap_err(), MessageError::Ended);
            picture
        }
    );
    assert_eq!(received, picture);
    assert!(
        start.elapsed() >= Duration::from_millis(95),
        "a megabyte at 10 MB/s takes 100 ms"
    );

    drop(master_out);
    assert_eq!(node_in.receive().await.unwrap_err(), MessageError::Ended);
    master.close(CloseCode::Refused, "no such node");
    let reason = Closed::ByPeer {
        code: CloseCode::Refused,
        reason: "no such node".into(),
    };
    assert_eq!(node.closed().await, reason);
}

#[tokio::test]
async fn what_is_too_long_is_refused_before_it_is_stored() {
    let (_server, master, node) = pair().await;
    // The node believes in longer messages than the master takes.
    let (mut master_out, mut master_in) = master.open_control(CAP, 1_000).await.unwrap();
    master_out.send(b"challenge").await.unwrap();
    let (mut node_out, _node_in) = node.accept_control(10_000, CAP).await.unwrap();
    node_out.send(&[1; 1_000]).await.unwrap();
    assert_eq!(master_in.receive().await.unwrap().len(), 1_000);
    node_out.send(&[1; 1_001]).await.unwrap();
    let error = MessageError::TooLong {
        bytes: 1_001,
        cap: 1_000,
    };
    assert_eq!(master_in.receive().await.unwrap_err(), error);
    let error = MessageError::TooLong {
        bytes: 10_001,
        cap: 10_000,
    };
    assert_eq!(node_out.send(&[1; 10_001]).await.unwrap_err(), error);
}

#[tokio::test]
async fn another_cluster_is_refused_by_both_sides() {
    let ours = Identity::throw_away().unwrap();
    let theirs = Identity::throw_away().unwrap();
    let server = Server::bind(any_port(), &ours).unwrap();
    let address = server.local_address().unwrap().to_string();
    // The stranger does not accept our certificate, so it never gets to show its own.
    let (near, far) = tokio::join!(accept_one(&server), connect(&address, &theirs));
    let far = far.err().unwrap();
    let refused = matches!(
        far,
        ConnectError::Closed {
            reason: Closed::CertificateRefused { .. },
            ..
        }
    );
    assert!(refused, "{far}");
    let near = near.err().unwrap();
    assert!(
        matches!(near.reason, Closed::CertificateRefused { .. }),
        "{near}"
    );
}

/// A client that trusts anybody, with or without a certificate: what an attacker would use.
fn careless_client(certified: Option<(Vec<u8>, Vec<u8>)>) -> quinn::ClientConfig {
    #[derive(Debug)]
    struct TrustAnybody;
    impl rustls::client::danger::ServerCertVerifier for TrustAnybody {
        fn verify_server_cert(
            &self,
            _: &rustls::pki_types::CertificateDer<'_>,
            _: &[rustls::pki_types::CertificateDer<'_>],
            _: &rustls::pki_types::ServerName<'_>,
            _: &[u8],
            _: rustls::pki_types::UnixTime,
        ) -> Result<rustls::client::danger::ServerCertVerified, rustls::Error> {
            Ok(rustls::client::danger::ServerCertVerified::assertion())
        }
        fn verify_tls12_signature(
            &self,
            _: &[u8],
            _: &rustls::pki_types::CertificateDer<'_>,
            _: &rustls::DigitallySignedStruct,
        ) -> Result<rustls::client::danger::HandshakeSignatureValid, rustls::Error> {
            Ok(rustls::client::danger::HandshakeSignatureValid::assertion())
        }
        fn verify_tls13_signature(
            &self,
            _: &[u8],
            _: &rustls::pki_types::CertificateDer<'_>,
            _: &rustls::DigitallySignedStruct,
        ) -> Result<rustls::client::danger::HandshakeSignatureValid, rustls::Error> {
            Ok(rustls::client::danger::HandshakeSignatureValid::assertion())
        }
        fn supported_verify_schemes(&self) -> Vec<rustls::SignatureScheme> {
            rustls::crypto::ring::default_provider()
                .signature_verification_algorithms
                .supported_schemes()
        }
    }
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let builder = rustls::ClientConfig::builder_with_provider(provider)
        .with_protocol_versions(&[&rustls::version::TLS13])
        .unwrap()
        .dangerous()
        .with_custom_certificate_verifier(Arc::new(TrustAnybody));
    let mut tls = match certified {
        Some((certificate, key)) => builder
            .with_client_auth_cert(vec![certificate.into()], key.try_into().unwrap())
            .unwrap(),
        None => builder.with_no_client_auth(),
    };
    tls.alpn_protocols = vec![b"terrawall".to_vec()];
    let quic = quinn::crypto::rustls::QuicClientConfig::try_from(tls).unwrap();
    quinn::ClientConfig::new(Arc::new(quic))
}

#[tokio::test]
async fn a_peer_without_our_certificate_gets_nothing_and_says_nothing() {
    let server = Server::bind(any_port(), &Identity::throw_away().unwrap()).unwrap();
    let address = server.local_address().unwrap();
    let key = rcgen::KeyPair::generate().unwrap();
    let forged = rcgen::CertificateParams::new(vec![link::CLUSTER_NAME.into()])
        .unwrap()
        .self_signed(&key)
        .unwrap();
    let forged = (forged.der().to_vec(), key.serialize_der());
    for certified in [None, Some(forged)] {
        let endpoint = quinn::Endpoint::client(any_port()).unwrap();
        let connecting = endpoint
            .connect_with(careless_client(certified), address, link::CLUSTER_NAME)
            .unwrap();
        let (near, far) = tokio::join!(accept_one(&server), async {
            // With TLS 1.3 the client believes itself connected. It can write; nobody will read.
            let connection = connecting.await?;
            let mut send = connection.open_uni().await?;
            let _written = send.write_all(b"\x05\0\0\0hello").await;
            let challenge = connection.accept_bi().await;
            assert!(challenge.is_err(), "the server spoke to a stranger");
            Ok::<_, quinn::ConnectionError>(connection.closed().await)
        });
        let near = near.err().unwrap();
        assert!(
            matches!(near.reason, Closed::CertificateRefused { .. }),
            "{near}"
        );
        // The stranger sees a TLS alert, at once or when it first uses the connection.
        let (Ok(far) | Err(far)) = far;
        let far = Closed::from(far);
        assert!(matches!(far, Closed::CertificateRefused { .. }), "{far}");
    }
}

#[tokio::test]
async fn garbage_on_the_port_disturbs_nobody() {
    let (server, master, node) = pair().await;
    let address = server.local_address().unwrap();
    let vandal = UdpSocket::bind(any_port()).unwrap();
    let mut seed = 1u32;
    for length in [0, 1, 20, 1_200, 1_400].into_iter().cycle().take(500) {
        let noise: Vec<u8> = (0..length)
            .map(|_| {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (seed >> 24) as u8
            })
            .collect();
        vandal.send_to(&noise, address).unwrap();
    }
    master.send_datagram(Channel::Message, &[1, 2, 3]).unwrap();
    assert_eq!(
        node.receive_datagram().await.unwrap(),
        (Channel::Message, vec![1, 2, 3])
    );
    assert_eq!(master.close_reason(), None);
}

#[tokio::test]
async fn errors_name_the_address_and_the_remedy() {
    let identity = Identity::throw_away().unwrap();
    let taken = UdpSocket::bind(any_port()).unwrap();
    let address = taken.local_addr().unwrap();
    let error = Server::bind(address, &identity).err().unwrap();
    assert!(matches!(error, BindError::PortInUse { .. }), "{error}");
    assert!(
        error.to_string().contains(&address.port().to_string()),
        "{error}"
    );
    let error = Server::bind("192.0.2.1:7000".parse().unwrap(), &identity)
        .err()
        .unwrap();
    assert!(matches!(error, BindError::NotHere { .. }), "{error}");

    // The port is bound, but nobody behind it speaks QUIC.
    let error = connect(&address.to_string(), &identity)
        .await
        .err()
        .unwrap();
    assert!(matches!(error, ConnectError::NoAnswer { .. }), "{error}");
    let error = connect("no-port-here", &identity).await.err().unwrap();
    assert!(matches!(error, ConnectError::Resolve { .. }), "{error}");
}

#[tokio::test]
async fn a_silent_peer_is_gone_after_the_idle_timeout() {
    // The node's end lives in a runtime of its own that is frozen without a goodbye.
    let identity = Arc::new(Identity::throw_away().unwrap());
    let server = Server::bind(any_port(), &identity).unwrap();
    let address = server.local_address().unwrap().to_string();
    let (freeze, frozen) = std::sync::mpsc::channel::<()>();
    let thread = std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        let peer = runtime.block_on(connect(&address, &identity)).unwrap();
        runtime.block_on(async { tokio::time::sleep(Duration::from_millis(100)).await });
        // Outside `block_on` nothing runs.
        let _released = frozen.recv();
        drop(peer);
    });
    let peer = accept_one(&server).await.unwrap();
    let start = Instant::now();
    assert_eq!(peer.closed().await, Closed::TimedOut);
    let silent = start.elapsed();
    assert!(
        silent < link::IDLE_TIMEOUT + Duration::from_secs(1),
        "{silent:?}"
    );
    drop(freeze);
    thread.join().unwrap();
}
