//! One UDP port to which DTrack sends. In: packets, from anybody who can reach the port. Out: poses, flysticks and
//! events on the board. Packets that make no sense are named and left out; it never ends.

use std::sync::Arc;

use tokio::net::UdpSocket;
use tokio::time::sleep;

use super::backoff::Backoff;
use super::{Shared, Turn};
use crate::config::Source;
use crate::dtrack::{self, LARGEST_PACKET_BYTES, Packet, PacketError};
use crate::event::What;
use crate::stamps::Stamps;

/// Most senders that are named.
const MOST_SENDERS: usize = 8;

/// Reads for ever.
pub(super) async fn follow(listen: String, shared: Shared) {
    let subject: Arc<str> = listen.as_str().into();
    let source = Source::Dtrack {
        listen: listen.clone(),
    };
    let mut backoff = Backoff::new();
    // One byte more than a packet may have: what fills it was cut.
    let mut buffer = vec![0; LARGEST_PACKET_BYTES + 1];
    loop {
        let error = match UdpSocket::bind(&listen).await {
            Ok(socket) => {
                read(
                    &socket,
                    &source,
                    &subject,
                    &mut buffer,
                    &mut backoff,
                    &shared,
                )
                .await
            }
            Err(error) => format!("cannot listen on {listen}: {error}"),
        };
        let now_us = shared.now_us();
        shared
            .lock()
            .record(now_us, &subject, What::Unreachable { reason: error });
        sleep(backoff.next()).await;
    }
}

/// Reads until the socket fails, and tells why.
async fn read(
    socket: &UdpSocket,
    source: &Source,
    subject: &Arc<str>,
    buffer: &mut [u8],
    backoff: &mut Backoff,
    shared: &Shared,
) -> String {
    let mut stamps = Stamps::new();
    let mut heard = Vec::new();
    let mut turn = Turn::default();
    loop {
        turn.read_one().await;
        let (length, from) = match socket.recv_from(buffer).await {
            Ok(received) => received,
            Err(error) => return format!("cannot receive: {error}"),
        };
        let now_us = shared.now_us();
        let packet = dtrack::parse(buffer.get(..length).unwrap_or_default());
        let mut board = shared.lock();
        match packet {
            Ok(packet) => {
                backoff.reset();
                if !heard.contains(&from) && heard.len() < MOST_SENDERS {
                    heard.push(from);
                    let how = format!("by packets from {from}");
                    board.record(now_us, subject, What::Connected { how });
                }
                let stamp_us = packet.stamp_s.map(|stamp_s| (stamp_s * 1e6) as i64);
                let moment_us = stamps.moment_us(stamp_us, now_us);
                for error in take(&packet, source, subject, moment_us, now_us, &mut board) {
                    let reason = error.to_string();
                    board.record(now_us, subject, What::Refused { reason });
                }
            }
            Err(error) => {
                let reason = format!("a packet from {from}: {error}");
                board.record(now_us, subject, What::Refused { reason });
            }
        }
        board.publish(now_us);
    }
}

/// Takes what a packet tells; the errors are of bodies that have no pose.
fn take(
    packet: &Packet,
    source: &Source,
    subject: &str,
    moment_us: i64,
    now_us: i64,
    board: &mut super::board::Board,
) -> Vec<PacketError> {
    let mut errors = Vec::new();
    for body in packet.bodies.iter().filter(|body| body.tracked) {
        match body.pose() {
            Ok(raw) => board.pose(source, body.id, moment_us, now_us, &raw),
            Err(error) => errors.push(error),
        }
    }
    for flystick in &packet.flysticks {
        let name = format!("flystick{}@{subject}", flystick.body.id);
        board.device(&name, now_us, |device| {
            device.buttons.clone_from(&flystick.buttons);
            device.analogs.clone_from(&flystick.controllers);
        });
    }
    errors
}
