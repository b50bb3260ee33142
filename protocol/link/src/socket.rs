//! UDP sockets with the buffers that a wall needs. In: a local address. Out: a bound socket.

use std::io;
use std::net::{SocketAddr, UdpSocket};

use socket2::{Domain, Protocol, Socket, Type};

/// Asked of the kernel for arriving packets, in bytes. The usual 208 KiB lose thousands of packets
/// while bulk data arrives; 4 MiB lose none and are the usual upper bound (`net.core.rmem_max`).
pub const RECEIVE_BUFFER_BYTES: usize = 4 << 20;

/// Asked of the kernel for leaving packets, in bytes. Small on purpose: what queues below QUIC cannot be
/// overtaken by the next view, so a large buffer turns bulk data into latency of the wall.
pub const SEND_BUFFER_BYTES: usize = 208 << 10;

/// Binds a UDP socket. IPv6 wildcards accept IPv4 too.
pub(crate) fn bind(address: SocketAddr) -> io::Result<UdpSocket> {
    let socket = Socket::new(
        Domain::for_address(address),
        Type::DGRAM,
        Some(Protocol::UDP),
    )?;
    if address.is_ipv6() {
        socket.set_only_v6(false)?;
    }
    // Kernels cap the size silently; a refusal only costs speed.
    if let Err(error) = socket.set_recv_buffer_size(RECEIVE_BUFFER_BYTES) {
        tracing::debug!(%error, "the kernel keeps its receive buffer");
    }
    if let Err(error) = socket.set_send_buffer_size(SEND_BUFFER_BYTES) {
        tracing::debug!(%error, "the kernel keeps its send buffer");
    }
    socket.set_nonblocking(true)?;
    socket.bind(&address.into())?;
    Ok(socket.into())
}
