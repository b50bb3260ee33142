//! The way to a VRPN server. In: host and port. Out: a TCP connection, and how it came about. It reads and writes
//! nothing on it.
//!
//! First TCP, straight to the server's port: every server that is built with VRPN's library listens there, for
//! clients behind firewalls (`listen_tcp_sock` in `vrpn_Connection.C`; VRPN's clients do this for `tcp://`).
//! Where that is refused, the way of VRPN's usual clients: a UDP packet to the same port with
//! the text `ADDRESS PORT` and a final zero asks the server to connect back by TCP.

use std::io::{Error, ErrorKind};
use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

use tokio::net::{TcpListener, TcpStream, UdpSocket, lookup_host};
use tokio::time::timeout;

/// A server must accept within this time.
const CONNECT_WITHIN: Duration = Duration::from_secs(2);
/// A server must call back within this time; then it is asked again.
const CALL_WITHIN: Duration = Duration::from_secs(1);
/// How often it is asked.
const CALLS: u32 = 2;

/// Connects, by either way.
pub(super) async fn connect(host: &str, port: u16) -> Result<(TcpStream, String), String> {
    let direct = match within(CONNECT_WITHIN, TcpStream::connect((host, port))).await {
        Ok(stream) => {
            let how = match stream.peer_addr() {
                Ok(address) => format!("by TCP to {address}"),
                Err(_) => "by TCP".to_owned(),
            };
            return Ok((stream, how));
        }
        Err(error) => error,
    };
    match called_back(host, port).await {
        Ok((stream, address)) => Ok((stream, format!("by a call back from {address}"))),
        Err(error) => Err(format!(
            "no TCP connection to {host}:{port} ({direct}), and no call back ({error})"
        )),
    }
}

async fn called_back(host: &str, port: u16) -> Result<(TcpStream, SocketAddr), Error> {
    let mut addresses = within(CONNECT_WITHIN, lookup_host((host, port))).await?;
    // VRPN writes and reads IPv4 addresses only.
    let server = addresses
        .find(SocketAddr::is_ipv4)
        .ok_or_else(|| Error::new(ErrorKind::NotFound, "the server has no IPv4 address"))?;
    let asking = UdpSocket::bind("0.0.0.0:0").await?;
    asking.connect(server).await?;
    let own = asking.local_addr()?.ip();
    let listener = TcpListener::bind((own, 0)).await?;
    let request = format!("{own} {}\0", listener.local_addr()?.port());
    let mut last = Error::from(ErrorKind::TimedOut);
    for _ in 0..CALLS {
        asking.send(request.as_bytes()).await?;
        match within(CALL_WITHIN, call_from(&listener, server.ip())).await {
            Ok(called) => return Ok(called),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// The first call from the server. Calls from elsewhere are hung up: whoever finds the port first must not be
/// taken for the tracker.
async fn call_from(
    listener: &TcpListener,
    server: IpAddr,
) -> Result<(TcpStream, SocketAddr), Error> {
    loop {
        let (stream, address) = listener.accept().await?;
        if address.ip() == server {
            return Ok((stream, address));
        }
    }
}

async fn within<T>(
    limit: Duration,
    work: impl Future<Output = Result<T, Error>>,
) -> Result<T, Error> {
    timeout(limit, work)
        .await
        .unwrap_or_else(|_| Err(Error::from(ErrorKind::TimedOut)))
}
