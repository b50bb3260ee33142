//! A small VRPN server. In: poses, buttons, analog values of one device, or any bytes. Out: VRPN's messages to all
//! clients, over TCP; UDP requests for a call back are answered. Pings are answered as long as it is not dumb.

use std::io::{Error, ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use crate::vrpn::{
    ANALOG_CHANNEL, BUTTON_CHANGE, BUTTON_STATES, COOKIE_BYTES, HEADER_BYTES, PING, PONG,
    SENDER_DESCRIPTION, TRACKER_POSE, TYPE_DESCRIPTION, cookie, description, encode,
};

/// This server's numbers of the types: their places. Those of real servers begin with names that are of no use
/// here, too.
const TYPES: [&str; 8] = [
    "VRPN_Connection_Got_First_Connection",
    PING,
    PONG,
    TRACKER_POSE,
    "vrpn_Tracker Velocity",
    BUTTON_CHANGE,
    BUTTON_STATES,
    ANALOG_CHANNEL,
];
/// Places in [`TYPES`].
const PONG_NUMBER: i32 = 2;
const POSE_NUMBER: i32 = 3;
const BUTTON_NUMBER: i32 = 5;
const BUTTONS_NUMBER: i32 = 6;
const ANALOG_NUMBER: i32 = 7;
/// This server's number of the device.
const DEVICE_NUMBER: i32 = 1;
/// How often threads look whether they shall end.
const LOOK: Duration = Duration::from_millis(5);
/// A client must take what it is sent within this time.
const SEND_WITHIN: Duration = Duration::from_millis(500);

struct State {
    device: String,
    clients: Mutex<Vec<TcpStream>>,
    ended: AtomicBool,
    dumb: AtomicBool,
    pings: AtomicUsize,
}

impl State {
    fn clients(&self) -> MutexGuard<'_, Vec<TcpStream>> {
        self.clients.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The threads that read hold the sockets, too, so closing them takes a word.
    fn hang_up(&self) {
        for client in self.clients().drain(..) {
            // One that is gone already needs no word.
            let _ = client.shutdown(Shutdown::Both);
        }
    }

    fn send(&self, bytes: &[u8]) {
        self.clients()
            .retain_mut(|client| client.write_all(bytes).is_ok());
    }
}

/// A VRPN server with one device. Dropping it closes everything.
pub struct VrpnServer {
    address: SocketAddr,
    state: Arc<State>,
    threads: Vec<JoinHandle<()>>,
}

impl VrpnServer {
    /// Listens on `address`, by TCP and UDP; port 0 takes a free one.
    pub fn start(address: &str, device: &str) -> Result<Self, Error> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        Self::run(Some(listener), UdpSocket::bind(address)?, device)
    }

    /// A server as they were before they listened by TCP: on UDP alone, it calls back.
    pub fn start_udp_only(address: &str, device: &str) -> Result<Self, Error> {
        Self::run(None, UdpSocket::bind(address)?, device)
    }

    fn run(
        listener: Option<TcpListener>,
        requests: UdpSocket,
        device: &str,
    ) -> Result<Self, Error> {
        let address = requests.local_addr()?;
        let state = Arc::new(State {
            device: device.to_owned(),
            clients: Mutex::default(),
            ended: AtomicBool::new(false),
            dumb: AtomicBool::new(false),
            pings: AtomicUsize::new(0),
        });
        let mut threads = Vec::new();
        if let Some(listener) = listener {
            listener.set_nonblocking(true)?;
            let state = Arc::clone(&state);
            threads.push(std::thread::spawn(move || accept(&listener, &state)));
        }
        requests.set_read_timeout(Some(LOOK))?;
        let asked = Arc::clone(&state);
        threads.push(std::thread::spawn(move || call_back(&requests, &asked)));
        Ok(Self {
            address,
            state,
            threads,
        })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// How many clients have exchanged cookies and are connected, as far as known.
    #[must_use]
    pub fn clients(&self) -> usize {
        self.state.clients().len()
    }

    /// How many pings have come.
    #[must_use]
    pub fn pings(&self) -> usize {
        self.state.pings.load(Ordering::Relaxed)
    }

    /// Whether pings stay unanswered.
    pub fn set_dumb(&self, dumb: bool) {
        self.state.dumb.store(dumb, Ordering::Relaxed);
    }

    /// Hangs up on all clients; they may come back.
    pub fn drop_clients(&self) {
        self.state.hang_up();
    }

    /// Sends a pose of a sensor, now: position, and quaternion x, y, z, w.
    pub fn send_pose(&self, sensor: i32, position: [f64; 3], orientation: [f64; 4]) {
        let mut body = Vec::new();
        body.extend_from_slice(&sensor.to_be_bytes());
        body.extend_from_slice(&sensor.to_be_bytes());
        for number in position.iter().chain(&orientation) {
            body.extend_from_slice(&number.to_be_bytes());
        }
        self.send(POSE_NUMBER, &body);
    }

    /// Sends one button's change.
    pub fn send_button(&self, button: i32, pressed: bool) {
        let mut body = button.to_be_bytes().to_vec();
        body.extend_from_slice(&i32::from(pressed).to_be_bytes());
        self.send(BUTTON_NUMBER, &body);
    }

    /// Sends all buttons' states.
    pub fn send_buttons(&self, pressed: &[bool]) {
        let mut body = i32::try_from(pressed.len())
            .unwrap_or(0)
            .to_be_bytes()
            .to_vec();
        for pressed in pressed {
            body.extend_from_slice(&i32::from(*pressed).to_be_bytes());
        }
        self.send(BUTTONS_NUMBER, &body);
    }

    /// Sends all analog values.
    pub fn send_analog(&self, values: &[f64]) {
        let mut body = (values.len() as f64).to_be_bytes().to_vec();
        for value in values {
            body.extend_from_slice(&value.to_be_bytes());
        }
        self.send(ANALOG_NUMBER, &body);
    }

    /// Sends a body as if it were a pose.
    pub fn send_broken_pose(&self, body: &[u8]) {
        self.send(POSE_NUMBER, body);
    }

    /// Sends any bytes.
    pub fn send_raw(&self, bytes: &[u8]) {
        self.state.send(bytes);
    }

    fn send(&self, kind: i32, body: &[u8]) {
        let mut bytes = Vec::new();
        encode(&mut bytes, now_us(), DEVICE_NUMBER, kind, 0, body);
        self.state.send(&bytes);
    }
}

impl Drop for VrpnServer {
    fn drop(&mut self) {
        self.state.ended.store(true, Ordering::Relaxed);
        self.state.hang_up();
        for thread in self.threads.drain(..) {
            // A thread that panicked has nothing left to do.
            let _ = thread.join();
        }
    }
}

fn now_us() -> i64 {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    i64::try_from(since.as_micros()).unwrap_or(0)
}

fn accept(listener: &TcpListener, state: &Arc<State>) {
    while !state.ended.load(Ordering::Relaxed) {
        match listener.accept() {
            Ok((stream, _)) => welcome(stream, state),
            Err(_) => std::thread::sleep(LOOK),
        }
    }
}

/// Answers `ADDRESS PORT` with a connection to there.
fn call_back(requests: &UdpSocket, state: &Arc<State>) {
    let mut buffer = [0; 150];
    while !state.ended.load(Ordering::Relaxed) {
        let Ok((length, _)) = requests.recv_from(&mut buffer) else {
            continue;
        };
        let text = buffer
            .get(..length)
            .and_then(|text| text.strip_suffix(b"\0"));
        let address = text
            .and_then(|text| std::str::from_utf8(text).ok())
            .and_then(|text| text.replace(' ', ":").parse::<SocketAddr>().ok());
        if let Some(Ok(stream)) = address.map(TcpStream::connect) {
            welcome(stream, state);
        }
    }
}

/// Exchanges cookies and names, then reads what the client says in a thread.
fn welcome(mut stream: TcpStream, state: &Arc<State>) {
    let mut begin = || {
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(SEND_WITHIN))?;
        stream.set_read_timeout(Some(SEND_WITHIN))?;
        stream.write_all(&cookie())?;
        let mut theirs = [0; COOKIE_BYTES];
        stream.read_exact(&mut theirs)?;
        if theirs != cookie() {
            return Err(Error::other("no cookie"));
        }
        let mut names = Vec::new();
        for (number, name) in (0..).zip(["VRPN Control", &state.device]) {
            encode(
                &mut names,
                now_us(),
                number,
                SENDER_DESCRIPTION,
                0,
                &description(name),
            );
        }
        for (number, name) in (0..).zip(TYPES) {
            encode(
                &mut names,
                now_us(),
                number,
                TYPE_DESCRIPTION,
                0,
                &description(name),
            );
        }
        stream.write_all(&names)?;
        stream.set_read_timeout(Some(LOOK))?;
        stream.try_clone()
    };
    let Ok(reading) = begin() else {
        return;
    };
    state.clients().push(stream);
    let state = Arc::clone(state);
    std::thread::spawn(move || listen(reading, &state));
}

/// Reads messages, each without a body but for names, and answers pings.
fn listen(mut stream: TcpStream, state: &State) {
    let mut received = Vec::new();
    let mut pings = None;
    let mut buffer = [0; 4_096];
    while !state.ended.load(Ordering::Relaxed) {
        match stream.read(&mut buffer) {
            Ok(0) => return,
            Ok(length) => received.extend_from_slice(buffer.get(..length).unwrap_or_default()),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                continue;
            }
            Err(_) => return,
        }
        while let Some(words) = received.first_chunk::<HEADER_BYTES>() {
            let word = |place: usize| {
                let bytes = words.get(place * 4..).and_then(<[u8]>::first_chunk);
                bytes.map_or(0, |bytes| i32::from_be_bytes(*bytes))
            };
            let (length, number, kind) = (word(0), word(3), word(4));
            let length = usize::try_from(length)
                .unwrap_or(0)
                .max(HEADER_BYTES)
                .next_multiple_of(8);
            if received.len() < length {
                break;
            }
            let body: Vec<u8> = received.drain(..length).skip(HEADER_BYTES).collect();
            let name = body.get(4..4 + PING.len());
            if kind == TYPE_DESCRIPTION && name == Some(PING.as_bytes()) {
                pings = Some(number);
            }
            if Some(kind) == pings {
                state.pings.fetch_add(1, Ordering::Relaxed);
                if !state.dumb.load(Ordering::Relaxed) {
                    let mut pong = Vec::new();
                    encode(&mut pong, now_us(), DEVICE_NUMBER, PONG_NUMBER, 0, &[]);
                    // A client that is gone is told by the next read.
                    let _ = stream.write_all(&pong);
                }
            }
        }
    }
}
