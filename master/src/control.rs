//! The control API: the running scene, read and changed over HTTP and JSON.
//! In: where to listen, whom to trust. Out: proposals for the frame loop, its answers for clients. It has a thread
//! and a runtime of its own, with the priority of all others, so that no request disturbs a frame: the frame
//! loop never parses, validates or waits for anything that comes from here.

mod api;
mod guard;
mod installation;
mod json;
mod refusal;

use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::Duration;

use serve::Door;
use tokio::sync::watch;

use self::api::Api;
use crate::events::EventSender;
use crate::master::OpenSurfaces;
use crate::wall_file::WallFile;

/// Where the control API is found unless told otherwise.
pub const DEFAULT_CONTROL_ADDRESS: SocketAddr =
    SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 4680);

/// Longest token.
const MAX_TOKEN_BYTES: usize = 4_096;
/// Connections at the same time; further ones wait in the system's queue.
const PLACES: usize = 64;
/// A connection on which nothing has moved for so long is cut: strangers can hold places only for moments.
const STILLNESS: Duration = Duration::from_secs(20);
/// How long open requests may take to end once the run is over.
const FAREWELL: Duration = Duration::from_millis(500);

/// Where the control API listens and whom it trusts.
#[derive(Clone, PartialEq, Eq)]
pub struct ControlOptions {
    /// Where to listen; port 0 takes a free one.
    pub bind: SocketAddr,
    /// What every request must bear as `Authorization: Bearer TOKEN`: 1…4096 visible ASCII characters. `None`: the
    /// processes of this machine are trusted, which only a loopback address allows.
    pub token: Option<String>,
}

/// Why the control API could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// Others could reach it and nothing would keep them out.
    #[error(
        "the control API at {address} would be open to everyone who reaches that address: give it a token \
         (--control-token-file FILE), bind it to 127.0.0.1, or do without it (--no-control)"
    )]
    TokenMissing {
        /// Where it was to listen.
        address: SocketAddr,
    },
    /// A token that no request could bear.
    #[error(
        "the token of the control API must be 1 to 4096 visible ASCII characters without blanks, for example the \
         output of: openssl rand -hex 32"
    )]
    Token,
    /// The address cannot be listened on.
    #[error(
        "the control API cannot listen at {address}: {source}; choose another address with --control, or do without \
         it with --no-control"
    )]
    Bind {
        /// Where it was to listen.
        address: SocketAddr,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// A thread or a runtime could not be had.
    #[error("the control API cannot be started: {0}")]
    System(#[source] std::io::Error),
}

impl ControlOptions {
    /// Whether these options are safe and possible.
    ///
    /// # Errors
    /// [`ControlError::TokenMissing`] or [`ControlError::Token`].
    pub fn check(&self) -> Result<(), ControlError> {
        match &self.token {
            None if !self.bind.ip().to_canonical().is_loopback() => {
                Err(ControlError::TokenMissing { address: self.bind })
            }
            Some(token)
                if !(1..=MAX_TOKEN_BYTES).contains(&token.len())
                    || !token.bytes().all(|byte| byte.is_ascii_graphic()) =>
            {
                Err(ControlError::Token)
            }
            _ => Ok(()),
        }
    }
}

/// What a control API needs beside its options.
pub(crate) struct ControlContext {
    /// Take a free port where the asked one is taken.
    pub(crate) any_port: bool,
    /// Where relative repositories of changed layers are taken from.
    pub(crate) scene_directory: Option<PathBuf>,
    /// The wall's file, if it may be changed.
    pub(crate) wall_file: Option<WallFile>,
    /// What a wall with other measures is made of.
    pub(crate) open_surfaces: OpenSurfaces,
    pub(crate) events: EventSender,
}

/// An open control API. Dropping it closes it.
pub(crate) struct Control {
    address: SocketAddr,
    closed: watch::Sender<bool>,
    thread: Option<JoinHandle<()>>,
}

impl Control {
    /// Begins to listen.
    pub(crate) fn open(
        options: ControlOptions,
        context: ControlContext,
    ) -> Result<Self, ControlError> {
        options.check()?;
        let listener = listen(options.bind, context.any_port)?;
        let address = listener.local_addr().map_err(ControlError::System)?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(ControlError::System)?;
        let door = {
            let _inside = runtime.enter();
            Door::new(listener, PLACES, STILLNESS).map_err(ControlError::System)?
        };
        let router = api::router(Api::new(
            context.events,
            options.token,
            context.scene_directory,
            context.wall_file,
            context.open_surfaces,
        ));
        let (closed, closing) = watch::channel(false);
        let thread = std::thread::Builder::new()
            .name("control".to_owned())
            .spawn(move || {
                let served = door.serve(router, closing, FAREWELL);
                if let Err(error) = runtime.block_on(served) {
                    tracing::warn!(%error, "the control API has ended");
                }
                // A request may be reading the wall's files, from a disk that does not answer: the run ends all the same.
                runtime.shutdown_background();
            })
            .map_err(ControlError::System)?;
        Ok(Self {
            address,
            closed,
            thread: Some(thread),
        })
    }

    /// Where it listens.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Control {
    fn drop(&mut self) {
        self.closed.send_replace(true);
        if let Some(thread) = self.thread.take() {
            let _panicked = thread.join();
        }
    }
}

/// A listening socket that tokio can take.
fn listen(address: SocketAddr, any_port: bool) -> Result<TcpListener, ControlError> {
    let bound = match TcpListener::bind(address) {
        Err(error) if any_port && error.kind() == std::io::ErrorKind::AddrInUse => {
            TcpListener::bind(SocketAddr::new(address.ip(), 0))
        }
        bound => bound,
    };
    bound
        .and_then(|listener| listener.set_nonblocking(true).map(|()| listener))
        .map_err(|source| ControlError::Bind { address, source })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;

    #[test]
    fn only_loopback_is_open_without_a_token() {
        let check = |bind: &str, token: Option<&str>| {
            let (bind, token) = (bind.parse().unwrap(), token.map(str::to_owned));
            ControlOptions { bind, token }.check()
        };
        for bind in [
            "127.0.0.1:0",
            "127.9.9.9:1",
            "[::1]:0",
            "[::ffff:127.0.0.1]:0",
        ] {
            check(bind, None).unwrap();
        }
        for bind in [
            "0.0.0.0:0",
            "[::]:0",
            "192.168.0.1:0",
            "[::ffff:10.0.0.1]:0",
        ] {
            let error = check(bind, None).unwrap_err();
            assert!(matches!(error, ControlError::TokenMissing { .. }), "{bind}");
            check(bind, Some("secret")).unwrap();
        }
        for token in [
            "",
            "two words",
            "new\nline",
            "schlüssel",
            &"x".repeat(4_097),
        ] {
            let error = check("127.0.0.1:0", Some(token)).unwrap_err();
            assert!(matches!(error, ControlError::Token), "{token:?}");
        }
    }

    #[test]
    fn a_taken_port_is_an_error_or_gives_way_to_a_free_one() {
        let first = listen("127.0.0.1:0".parse().unwrap(), false).unwrap();
        let taken = first.local_addr().unwrap();
        let error = listen(taken, false).unwrap_err().to_string();
        assert!(
            error.contains(&taken.to_string()) && error.contains("--control"),
            "{error}"
        );
        let second = listen(taken, true).unwrap().local_addr().unwrap();
        assert!(second.port() != taken.port() && second.ip() == taken.ip());
    }
}
