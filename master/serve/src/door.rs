//! The listening side: a bounded number of connections, none of which may linger, until it is closed.
//! In: a listening socket, what answers. Out: connections for axum. A client that neither sends nor reads is cut off,
//! so that it holds a place only for a while. It must not look at what is sent.

use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::Router;
use axum::serve::Listener;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::time::{Instant, Sleep, sleep};

/// Before the next try after a connection could not be taken, for example because there are no file descriptors.
const PAUSE: Duration = Duration::from_millis(200);

/// A listening socket with a number of places, for any server of this program.
pub struct Door {
    listener: TcpListener,
    places: Arc<Semaphore>,
    stillness: Duration,
}

impl Door {
    /// Takes a socket that does not block. To be called inside a runtime. So many connections are served at the same
    /// time, further ones wait in the system's queue; one on which nothing moves for `stillness` is cut.
    ///
    /// # Errors
    /// A socket that the runtime cannot watch.
    pub fn new(
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

    /// Answers until `closing` says true or its sender is gone. Answers under way may take for `farewell` then.
    ///
    /// # Errors
    /// What ended it before.
    pub async fn serve(
        self,
        router: Router,
        closing: watch::Receiver<bool>,
        farewell: Duration,
    ) -> std::io::Result<()> {
        let served =
            axum::serve(self, router).with_graceful_shutdown(until_closed(closing.clone()));
        let patience = async {
            until_closed(closing).await;
            sleep(farewell).await;
        };
        tokio::select! {
            ended = served => ended,
            () = patience => Ok(()),
        }
    }
}

async fn until_closed(mut closing: watch::Receiver<bool>) {
    // An error means that the sender is gone, which closes as well.
    let _gone = closing.wait_for(|closed| *closed).await;
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
pub struct Guest {
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use std::io::{Read as _, Write as _};

    use axum::routing::get;

    use super::*;

    const PLACES: usize = 8;

    /// Serves a door whose guests may be still for 300 ms.
    fn serve() -> (tokio::runtime::Runtime, SocketAddr) {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        listener.set_nonblocking(true).unwrap();
        let address = listener.local_addr().unwrap();
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .unwrap();
        let _inside = runtime.enter();
        let door = Door::new(listener, PLACES, Duration::from_millis(300)).unwrap();
        let router = Router::new().route("/", get(async || "here"));
        runtime.spawn(async { axum::serve(door, router).await });
        drop(_inside);
        (runtime, address)
    }

    fn ask(address: SocketAddr) -> String {
        let mut stream = std::net::TcpStream::connect(address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(10)))
            .unwrap();
        stream
            .write_all(b"GET / HTTP/1.1\r\nHost: here\r\nConnection: close\r\n\r\n")
            .unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    #[test]
    fn silent_connections_cannot_hold_all_places() {
        let (_runtime, address) = serve();
        let connect = |_| std::net::TcpStream::connect(address).unwrap();
        let mut silent: Vec<_> = (0..2 * PLACES).map(connect).collect();
        // One of them begins a request and never ends it.
        silent[0].write_all(b"GET / HT").unwrap();
        let begin = std::time::Instant::now();
        assert!(ask(address).ends_with("here"));
        let waited = begin.elapsed();
        assert!(
            waited >= Duration::from_millis(250),
            "{waited:?}: all places were taken"
        );
        assert!(waited < Duration::from_secs(5), "{waited:?}");
        // The first have been cut.
        silent[0]
            .set_read_timeout(Some(Duration::from_secs(10)))
            .unwrap();
        let ended = silent[0].read(&mut [0; 16]);
        assert!(matches!(ended, Ok(0) | Err(_)), "{ended:?}");
    }
}
