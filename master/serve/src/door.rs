//! The listening side: a bounded number of connections, none of which may linger.
//! In: a listening socket. Out: connections for axum. A client that neither sends nor reads is cut off, so that it
//! holds a place only for a while. It must not look at what is sent.

use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::serve::Listener;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep, sleep};

/// Before the next try after a connection could not be taken, for example because there are no file descriptors.
const PAUSE: Duration = Duration::from_millis(200);

/// A listening socket with a number of places.
pub(crate) struct Door {
    listener: TcpListener,
    places: Arc<Semaphore>,
    stillness: Duration,
}

impl Door {
    /// Takes a socket that does not block. To be called inside a runtime.
    pub(crate) fn new(
        listener: std::net::TcpListener,
        connections: usize,
        stillness: Duration,
    ) -> std::io::Result<Self> {
        Ok(Self {
            listener: TcpListener::from_std(listener)?,
            places: Arc::new(Semaphore::new(connections)),
            stillness,
        })
    }
}

impl Listener for Door {
    type Io = Guest;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Guest, SocketAddr) {
        loop {
            let Ok(place) = Arc::clone(&self.places).acquire_owned().await else {
                // Nobody closes the semaphore.
                return std::future::pending().await;
            };
            match self.listener.accept().await {
                Ok((stream, address)) => {
                    // Headers and the first bytes of a body are two writes; clients wait for both.
                    let _without = stream.set_nodelay(true);
                    let guest = Guest {
                        stream,
                        stillness: self.stillness,
                        cut: Box::pin(sleep(self.stillness)),
                        _place: place,
                    };
                    return (guest, address);
                }
                Err(error) => {
                    tracing::debug!(%error, "a connection could not be taken");
                    sleep(PAUSE).await;
                }
            }
        }
    }

    fn local_addr(&self) -> std::io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A connection that has a place until it ends.
pub(crate) struct Guest {
    stream: TcpStream,
    stillness: Duration,
    cut: Pin<Box<Sleep>>,
    _place: OwnedSemaphorePermit,
}

impl Guest {
    /// Passes on what the stream says, and cuts the connection if nothing moves.
    fn watch<T>(
        &mut self,
        context: &mut Context<'_>,
        polled: Poll<std::io::Result<T>>,
    ) -> Poll<std::io::Result<T>> {
        if polled.is_ready() {
            let moment = Instant::now() + self.stillness;
            self.cut.as_mut().reset(moment);
            return polled;
        }
        self.cut
            .as_mut()
            .poll(context)
            .map(|()| Err(std::io::ErrorKind::TimedOut.into()))
    }
}

impl AsyncRead for Guest {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        let polled = Pin::new(&mut self.stream).poll_read(context, buffer);
        self.watch(context, polled)
    }
}

impl AsyncWrite for Guest {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<std::io::Result<usize>> {
        let polled = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.watch(context, polled)
    }

    fn poll_flush(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
