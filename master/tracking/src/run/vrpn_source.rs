//! One VRPN server. In: its host and port, and the devices that are wanted of it. Out: poses, buttons, analog values
//! and events on the board. It connects again whenever the connection ends; it never ends itself.

use std::io::ErrorKind;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::TcpStream;
use tokio::time::{sleep, timeout};

use super::backoff::Backoff;
use super::board::Board;
use super::vrpn_connect::connect;
use super::{Shared, Turn};
use crate::config::Source;
use crate::event::What;
use crate::stamps::Stamps;
use crate::vrpn::{Client, Message};

/// How often the client is asked whether the server is still there.
const TICK: Duration = Duration::from_millis(250);
/// A server must take what it is sent within this time.
const SEND_WITHIN: Duration = Duration::from_secs(1);
/// Most that is read at once.
const READ_BYTES: usize = 64 * 1024;

/// A server, and what is known of it while it is connected.
struct Server {
    host: String,
    port: u16,
    subject: Arc<str>,
    shared: Shared,
    backoff: Backoff,
}

/// Reads for ever.
pub(super) async fn follow(host: String, port: u16, devices: Vec<Arc<str>>, shared: Shared) {
    let mut server = Server {
        subject: format!("{host}:{port}").into(),
        host,
        port,
        shared,
        backoff: Backoff::new(),
    };
    loop {
        let what = match connect(&server.host, server.port).await {
            Ok((stream, how)) => What::Disconnected {
                reason: server.converse(&stream, &how, &devices).await,
            },
            Err(reason) => What::Unreachable { reason },
        };
        let now_us = server.shared.now_us();
        server.shared.lock().record(now_us, &server.subject, what);
        sleep(server.backoff.next()).await;
    }
}

impl Server {
    /// Reads until the connection ends, and tells why it did.
    async fn converse(&mut self, stream: &TcpStream, how: &str, devices: &[Arc<str>]) -> String {
        // Pings are short and must not wait for more.
        if let Err(error) = stream.set_nodelay(true) {
            return format!("cannot set up the connection: {error}");
        }
        let mut client = Client::new(devices, self.shared.now_us());
        let mut stamps = Stamps::new();
        let mut messages = Vec::new();
        let mut buffer = vec![0; READ_BYTES];
        let mut turn = Turn::default();
        loop {
            turn.read_one().await;
            let outgoing = client.take_outgoing();
            if let Err(reason) = send(stream, &outgoing).await {
                return reason;
            }
            let readable = timeout(TICK, stream.readable()).await;
            let now_us = self.shared.now_us();
            let received = match readable {
                Err(_) => &[],
                Ok(Err(error)) => return format!("cannot receive: {error}"),
                Ok(Ok(())) => match stream.try_read(&mut buffer) {
                    Ok(0) => return "the server closed the connection".to_owned(),
                    Ok(length) => buffer.get(..length).unwrap_or_default(),
                    Err(error) if error.kind() == ErrorKind::WouldBlock => &[],
                    Err(error) => return format!("cannot receive: {error}"),
                },
            };
            let outcome = client.receive(received, now_us, &mut messages);
            self.take(&mut messages, how, &mut stamps, now_us);
            if let Err(error) = outcome.and_then(|()| client.advance(now_us)) {
                return error.to_string();
            }
        }
    }

    /// Writes on the board what the server told.
    fn take(&mut self, messages: &mut Vec<Message>, how: &str, stamps: &mut Stamps, now_us: i64) {
        if messages.is_empty() {
            return;
        }
        let mut board = self.shared.lock();
        for message in messages.drain(..) {
            match message {
                Message::Greeted { version } => {
                    let how = format!("{how}: {version}");
                    board.record(now_us, &self.subject, What::Connected { how });
                }
                Message::Malformed(malformed) => {
                    let reason = malformed.to_string();
                    board.record(now_us, &self.subject, What::Refused { reason });
                }
                told => {
                    // A peer that greets and then sends rubbish is not worth a quick return; this one is.
                    self.backoff.reset();
                    tell(&mut board, told, &self.host, self.port, stamps, now_us);
                }
            }
        }
        board.publish(now_us);
    }
}

fn tell(
    board: &mut Board,
    message: Message,
    host: &str,
    port: u16,
    stamps: &mut Stamps,
    now_us: i64,
) {
    let named = |sender: &str| format!("{sender}@{host}:{port}");
    match message {
        Message::Pose {
            sender,
            sensor,
            stamp_us,
            pose,
        } => {
            let moment_us = stamps.moment_us(stamp_us, now_us);
            let Ok(body) = u32::try_from(sensor) else {
                return;
            };
            let source = Source::Vrpn {
                device: sender.to_string(),
                host: host.to_owned(),
                port,
            };
            board.pose(&source, body, moment_us, now_us, &pose);
        }
        Message::Button {
            sender,
            button,
            pressed,
        } => board.device(&named(&sender), now_us, |device| {
            // The client bounds the number.
            if device.buttons.len() <= button {
                device.buttons.resize(button + 1, false);
            }
            if let Some(state) = device.buttons.get_mut(button) {
                *state = pressed;
            }
        }),
        Message::Buttons { sender, pressed } => {
            board.device(&named(&sender), now_us, |device| device.buttons = pressed);
        }
        Message::Analog { sender, values } => {
            board.device(&named(&sender), now_us, |device| device.analogs = values);
        }
        Message::Greeted { .. } | Message::Malformed(_) => {}
    }
}

async fn send(stream: &TcpStream, mut bytes: &[u8]) -> Result<(), String> {
    while !bytes.is_empty() {
        match timeout(SEND_WITHIN, stream.writable()).await {
            Err(_) => return Err("the server takes nothing".to_owned()),
            Ok(Err(error)) => return Err(format!("cannot send: {error}")),
            Ok(Ok(())) => {}
        }
        match stream.try_write(bytes) {
            Ok(sent) => bytes = bytes.get(sent..).unwrap_or_default(),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => return Err(format!("cannot send: {error}")),
        }
    }
    Ok(())
}
