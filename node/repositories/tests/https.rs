//! `https://`: a server is believed if this system's certificates vouch for it, and else refused. The certificates
//! are named to a second process by its environment, because nobody may change that of a running one.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod common;

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::Command;
use std::sync::Arc;

use common::{pyramid, quick, tile_data, write_repository};
use repositories::Repositories;
use rustls::crypto::ring::default_provider;
use rustls::pki_types::{PrivateKeyDer, PrivatePkcs8KeyDer};
use rustls::{ServerConfig, ServerConnection, StreamOwned};

const ADDRESS: &str = "TERRAWALL_TEST_ADDRESS";

/// Encrypts what `behind` answers; one request a connection. Its threads end with the process.
fn encrypt(behind: SocketAddr, certified: &rcgen::CertifiedKey<rcgen::KeyPair>) -> SocketAddr {
    let key = PrivatePkcs8KeyDer::from(certified.signing_key.serialize_der());
    let tls = ServerConfig::builder_with_provider(Arc::new(default_provider()))
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_no_client_auth()
        .with_single_cert(vec![certified.cert.der().clone()], PrivateKeyDer::from(key))
        .unwrap();
    let tls = Arc::new(tls);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let connection = ServerConnection::new(Arc::clone(&tls)).unwrap();
            std::thread::spawn(move || {
                // A client that does not believe it leaves.
                let _ = answer(StreamOwned::new(connection, stream), behind);
            });
        }
    });
    address
}

fn answer(
    mut client: StreamOwned<ServerConnection, TcpStream>,
    behind: SocketAddr,
) -> std::io::Result<()> {
    let mut head = Vec::new();
    let mut byte = [0];
    while !head.ends_with(b"\r\n\r\n") {
        client.read_exact(&mut byte)?;
        head.push(byte[0]);
    }
    head.truncate(head.len() - 2);
    head.extend_from_slice(b"Connection: close\r\n\r\n");
    let mut server = TcpStream::connect(behind)?;
    server.write_all(&head)?;
    let mut answer = Vec::new();
    server.read_to_end(&mut answer)?;
    client.write_all(&answer)?;
    client.conn.send_close_notify();
    client.flush()
}

#[test]
fn a_server_is_believed_only_with_a_certificate() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    write_repository(&data, 0);
    let listen = "127.0.0.1:0".parse().unwrap();
    let server = serve::Server::start(&serve::Config::new(&data, listen)).unwrap();
    let certified = rcgen::generate_simple_self_signed(vec!["localhost".to_owned()]).unwrap();
    let port = encrypt(server.address(), &certified).port();
    let address = format!("https://localhost:{port}");
    let read = |certificates: &str| {
        let file = folder.path().join("certificates.pem");
        std::fs::write(&file, certificates).unwrap();
        let output = Command::new(std::env::current_exe().unwrap())
            .args([
                "--exact",
                "reads_what_it_is_told",
                "--ignored",
                "--nocapture",
            ])
            .env("SSL_CERT_FILE", &file)
            .env_remove("SSL_CERT_DIR")
            .env(ADDRESS, &address)
            .output()
            .unwrap();
        let text = [output.stdout, output.stderr].concat();
        (
            output.status.success(),
            String::from_utf8_lossy(&text).into_owned(),
        )
    };
    let (good, text) = read(&certified.cert.pem());
    assert!(good, "{text}");
    assert!(text.contains("1 passed"), "{text}");
    assert_eq!(server.counters().files, 2 + pyramid(0).len() as u64);
    // Somebody else's certificate.
    let other = rcgen::generate_simple_self_signed(vec!["localhost".to_owned()]).unwrap();
    let (good, text) = read(&other.cert.pem());
    assert!(!good && text.contains("certificate"), "{text}");
    // None at all.
    let (good, text) = read("");
    assert!(!good && text.contains("ca-certificates"), "{text}");
    assert_eq!(server.counters().files, 2 + pyramid(0).len() as u64);
}

#[test]
#[ignore = "run by the other test, with an environment of its own"]
fn reads_what_it_is_told() {
    let address = std::env::var(ADDRESS).unwrap().parse().unwrap();
    let repositories = Repositories::new(&quick()).unwrap();
    let open = match repositories.open(&address) {
        Ok(open) => open,
        Err(error) => panic!("{error}"),
    };
    for tile in pyramid(0) {
        assert_eq!(open.read_now(tile).unwrap().unwrap(), tile_data(tile));
    }
}
