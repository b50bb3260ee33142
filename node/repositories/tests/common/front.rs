//! A front before a real server that can do to a request whatever networks do. It speaks HTTP/1.1 over plain sockets, so
//! that resets and cut bodies are real ones.
//! In: a server, a script. Out: an address, counts of what came.
#![allow(
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "a test that panics has failed; not all tests use all of it"
)]

use std::collections::HashMap;
use std::io::{Read as _, Write as _};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// The beginning of a request.
pub struct Head {
    pub method: String,
    pub path: String,
    /// By lower-case names.
    pub headers: HashMap<String, String>,
    /// Its number, from 0.
    pub number: u64,
    raw: Vec<u8>,
}

/// What is done to a request.
pub enum Action {
    /// The server behind answers.
    Forward,
    /// It answers, and the connection breaks after so many bytes of the answer.
    ForwardPart(usize),
    /// It answers, in pieces with pauses.
    ForwardSlowly(usize, Duration),
    /// These bytes are the answer.
    Reply(Vec<u8>),
    /// The connection is reset.
    Reset,
    /// Nothing is ever answered; the connection stays open.
    Silence,
}

/// An answer without a body but of the given headers, each ended by CRLF.
pub fn reply(status: &str, headers: &str, body: &[u8]) -> Action {
    let length = body.len();
    let mut bytes =
        format!("HTTP/1.1 {status}\r\nContent-Length: {length}\r\n{headers}\r\n").into_bytes();
    bytes.extend_from_slice(body);
    Action::Reply(bytes)
}

type Script = dyn Fn(&Head) -> Action + Send + Sync;

struct State {
    behind: Option<SocketAddr>,
    script: Mutex<Arc<Script>>,
    requests: AtomicU64,
    connections: AtomicU64,
    in_flight: AtomicU64,
    most_in_flight: AtomicU64,
    stopped: AtomicBool,
}

/// The front. Its threads end with their connections.
pub struct Front {
    pub address: SocketAddr,
    state: Arc<State>,
}

impl Front {
    /// Before a server, or all alone.
    pub fn new(
        behind: Option<SocketAddr>,
        script: impl Fn(&Head) -> Action + Send + Sync + 'static,
    ) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let state = Arc::new(State {
            behind,
            script: Mutex::new(Arc::new(script)),
            requests: AtomicU64::new(0),
            connections: AtomicU64::new(0),
            in_flight: AtomicU64::new(0),
            most_in_flight: AtomicU64::new(0),
            stopped: AtomicBool::new(false),
        });
        let shared = Arc::clone(&state);
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                if shared.stopped.load(Ordering::SeqCst) {
                    return;
                }
                let Ok(stream) = stream else { continue };
                shared.connections.fetch_add(1, Ordering::SeqCst);
                let shared = Arc::clone(&shared);
                std::thread::spawn(move || {
                    // A client may leave whenever it likes.
                    let _ = shared.serve(stream);
                });
            }
        });
        Self { address, state }
    }

    /// Does something else from now on.
    pub fn script(&self, script: impl Fn(&Head) -> Action + Send + Sync + 'static) {
        *self.state.script.lock().unwrap() = Arc::new(script);
    }

    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    pub fn requests(&self) -> u64 {
        self.state.requests.load(Ordering::SeqCst)
    }

    pub fn connections(&self) -> u64 {
        self.state.connections.load(Ordering::SeqCst)
    }

    pub fn most_in_flight(&self) -> u64 {
        self.state.most_in_flight.load(Ordering::SeqCst)
    }
}

impl Drop for Front {
    fn drop(&mut self) {
        self.state.stopped.store(true, Ordering::SeqCst);
        // Wakes the thread that accepts.
        drop(TcpStream::connect(self.address));
    }
}

impl State {
    fn serve(&self, mut client: TcpStream) -> std::io::Result<()> {
        client.set_nodelay(true)?;
        while let Some(head) = self.head(&mut client)? {
            let script = Arc::clone(&self.script.lock().unwrap());
            let now = self.in_flight.fetch_add(1, Ordering::SeqCst) + 1;
            self.most_in_flight.fetch_max(now, Ordering::SeqCst);
            let action = script(&head);
            let silent = matches!(action, Action::Silence);
            let kept = self.act(&head, action, &mut client);
            if silent {
                // Until the client gives up.
                let _ = client.read(&mut [0]);
            }
            if !kept? {
                break;
            }
        }
        Ok(())
    }

    fn head(&self, client: &mut TcpStream) -> std::io::Result<Option<Head>> {
        let Some(raw) = until_blank_line(client)? else {
            return Ok(None);
        };
        let text = String::from_utf8_lossy(&raw).into_owned();
        let mut lines = text.lines();
        let mut first = lines.next().unwrap_or_default().split(' ');
        Ok(Some(Head {
            method: first.next().unwrap_or_default().to_owned(),
            path: first.next().unwrap_or_default().to_owned(),
            headers: headers(lines),
            number: self.requests.fetch_add(1, Ordering::SeqCst),
            raw,
        }))
    }

    /// A request is over for this count once the client can know it: before the last bytes of the answer.
    fn done(&self) {
        self.in_flight.fetch_sub(1, Ordering::SeqCst);
    }

    /// Whether the connection can take another request.
    fn act(&self, head: &Head, action: Action, client: &mut TcpStream) -> std::io::Result<bool> {
        match action {
            Action::Forward => self.forward(head, client, usize::MAX, None),
            Action::ForwardPart(most) => {
                self.forward(head, client, most, None)?;
                reset(client)
            }
            Action::ForwardSlowly(piece, pause) => {
                self.forward(head, client, usize::MAX, Some((piece, pause)))
            }
            Action::Reply(bytes) => {
                self.done();
                client.write_all(&bytes)?;
                Ok(true)
            }
            Action::Reset => {
                self.done();
                reset(client)
            }
            Action::Silence => {
                // When the client gives up is seen too late here to be counted.
                self.done();
                Ok(false)
            }
        }
    }

    fn forward(
        &self,
        head: &Head,
        client: &mut TcpStream,
        most: usize,
        slowly: Option<(usize, Duration)>,
    ) -> std::io::Result<bool> {
        let mut server = TcpStream::connect(self.behind.unwrap())?;
        server.write_all(&head.raw)?;
        let answer = until_blank_line(&mut server)?.unwrap_or_default();
        let text = String::from_utf8_lossy(&answer).into_owned();
        let bodiless = head.method == "HEAD" || text.starts_with("HTTP/1.1 304");
        let length = headers(text.lines().skip(1))
            .get("content-length")
            .and_then(|length| length.parse::<usize>().ok());
        let mut body = Vec::new();
        match length {
            _ if bodiless => {}
            Some(length) => {
                body.resize(length, 0);
                server.read_exact(&mut body)?;
            }
            None => {
                // Its end is that of the connection.
                server.shutdown(Shutdown::Write)?;
                server.read_to_end(&mut body)?;
            }
        }
        let bytes = [answer, body].concat();
        let bytes = &bytes[..most.min(bytes.len())];
        match slowly {
            None => {
                self.done();
                client.write_all(bytes)?;
            }
            Some((piece, pause)) => {
                let mut pieces = bytes.chunks(piece).peekable();
                while let Some(piece) = pieces.next() {
                    if pieces.peek().is_none() {
                        self.done();
                    }
                    client.write_all(piece)?;
                    std::thread::sleep(pause);
                }
            }
        }
        Ok(bodiless || length.is_some())
    }
}

/// Ends a connection by a reset, as a dying server or a firewall does.
fn reset(client: &TcpStream) -> std::io::Result<bool> {
    socket2::SockRef::from(client).set_linger(Some(Duration::ZERO))?;
    Ok(false)
}

fn headers<'a>(lines: impl Iterator<Item = &'a str>) -> HashMap<String, String> {
    lines
        .filter_map(|line| line.split_once(':'))
        .map(|(name, value)| (name.to_ascii_lowercase(), value.trim().to_owned()))
        .collect()
}

/// `None` at the end of the connection.
fn until_blank_line(stream: &mut TcpStream) -> std::io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    let mut byte = [0];
    while !bytes.ends_with(b"\r\n\r\n") {
        if stream.read(&mut byte)? == 0 {
            return Ok(None);
        }
        bytes.push(byte[0]);
    }
    Ok(Some(bytes))
}

/// Whether a request is one of the unlucky `percent`: spread over the numbers, the same in every run. `kind`
/// chooses other ones.
pub fn unlucky(number: u64, kind: u64, percent: u64) -> bool {
    let mut mixed =
        (number + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ kind.wrapping_mul(0xbf58_476d);
    mixed = (mixed ^ (mixed >> 31)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (mixed >> 33) % 100 < percent
}
