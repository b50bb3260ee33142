//! Serves repositories of tiles over HTTP: the files of a repository and nothing else.
//!
//! In: a directory. Out: its `dataset.toml`, `index.bin` and tiles, with ranges, validators and caching headers. It
//! has a runtime of its own. It must not write, list, follow links or look into tiles.

mod door;
mod files;
mod paths;
mod respond;

use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use thiserror::Error;
use tiles::DATASET_FILE;
use tokio::sync::watch;

use respond::Site;

pub use door::{Door, Guest};
pub use respond::Counters;

/// How long answers under way may take to end once the server is stopped.
const FAREWELL: Duration = Duration::from_secs(2);
/// Threads that answer; reading files has threads of its own.
const THREADS: usize = 2;
/// Most connections that can be asked for.
const MOST_CONNECTIONS: usize = 65_536;

/// What is served, where and to how many.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Config {
    /// A repository, or a directory of repositories.
    pub directory: PathBuf,
    /// Where to listen; port 0 takes a free one.
    pub listen: SocketAddr,
    /// Connections at the same time, 1…65536; further ones wait.
    pub connections: usize,
    /// A connection on which nothing moves for so long is cut.
    pub stillness: Duration,
}

/// Why nothing is served.
#[derive(Debug, Error)]
pub enum ServeError {
    /// There is nothing to serve.
    #[error(
        "{directory} is no repository and has none directly beneath it: give a directory that `terrawall import` made, or \
         the one in which such directories lie (their names of letters, digits, dots, hyphens and underlines)",
        directory = directory.display()
    )]
    NoRepository {
        /// What was to be served.
        directory: PathBuf,
    },
    /// The directory cannot be read.
    #[error("cannot read {directory}: {source}", directory = directory.display())]
    Directory {
        /// What was to be served.
        directory: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A figure is out of range.
    #[error("{connections} connections are out of range: 1…{MOST_CONNECTIONS}")]
    Connections {
        /// What was asked for.
        connections: usize,
    },
    /// The address cannot be listened on.
    #[error("cannot listen at {address}: {source}; choose another address")]
    Listen {
        /// Where it was to listen.
        address: SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
    /// No threads or sockets.
    #[error("cannot start the server: {0}")]
    System(std::io::Error),
}

/// A running server. Dropping it stops it: answers under way get two seconds to end.
pub struct Server {
    address: SocketAddr,
    site: Arc<Site>,
    repositories: Vec<String>,
    closed: watch::Sender<bool>,
    thread: Option<JoinHandle<()>>,
}

impl Config {
    /// The usual limits.
    #[must_use]
    pub fn new(directory: &Path, listen: SocketAddr) -> Self {
        Self {
            directory: directory.to_owned(),
            listen,
            connections: 256,
            stillness: Duration::from_secs(30),
        }
    }
}

impl Server {
    /// Begins to listen. Where the directory is a repository itself its files lie at `/`, else those of the
    /// repository `NAME` beneath it at `/NAME/`, also of those that are made later.
    ///
    /// # Errors
    /// [`ServeError`].
    pub fn start(config: &Config) -> Result<Self, ServeError> {
        let (connections, directory) = (config.connections, &config.directory);
        if !(1..=MOST_CONNECTIONS).contains(&connections) {
            return Err(ServeError::Connections { connections });
        }
        let single = directory.join(DATASET_FILE).is_file();
        let repositories = if single {
            vec![String::new()]
        } else {
            repositories(directory).map_err(|source| ServeError::Directory {
                directory: directory.clone(),
                source,
            })?
        };
        if repositories.is_empty() {
            return Err(ServeError::NoRepository {
                directory: directory.clone(),
            });
        }
        let listen = |source| ServeError::Listen {
            address: config.listen,
            source,
        };
        let listener = TcpListener::bind(config.listen).map_err(listen)?;
        listener.set_nonblocking(true).map_err(listen)?;
        let address = listener.local_addr().map_err(listen)?;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(THREADS)
            .thread_name("serve")
            .enable_all()
            .build()
            .map_err(ServeError::System)?;
        let door = {
            let _inside = runtime.enter();
            Door::new(listener, connections, config.stillness).map_err(ServeError::System)?
        };
        let site = Arc::new(Site::new(directory, single));
        let router = respond::router(Arc::clone(&site));
        let (closed, closing) = watch::channel(false);
        let thread = std::thread::Builder::new()
            .name("serve".to_owned())
            .spawn(move || {
                let served = door.serve(router, closing, FAREWELL);
                if let Err(error) = runtime.block_on(served) {
                    tracing::error!(%error, "the server has ended");
                }
                // Reads that hang on a dead file system must not hold up the end.
                runtime.shutdown_background();
            })
            .map_err(ServeError::System)?;
        Ok(Self {
            address,
            site,
            repositories,
            closed,
            thread: Some(thread),
        })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The paths of the repositories that were there at the start, without slashes; one empty path where the
    /// directory is a repository itself.
    #[must_use]
    pub fn repositories(&self) -> &[String] {
        &self.repositories
    }

    /// What has been answered so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.site.counters()
    }

    /// Whether it still listens: false only after a failure, which the log names.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.thread
            .as_ref()
            .is_some_and(|thread| !thread.is_finished())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.closed.send_replace(true);
        if let Some(thread) = self.thread.take() {
            // It panics only by a bug, which has been reported on standard error then.
            let _ = thread.join();
        }
    }
}

/// The names of the repositories in a directory, sorted.
fn repositories(directory: &Path) -> std::io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(directory)? {
        let entry = entry?;
        // Not through links, which are not served either.
        if !entry.file_type()?.is_dir() || !entry.path().join(DATASET_FILE).is_file() {
            continue;
        }
        match entry.file_name().into_string() {
            Ok(name) if paths::is_name(&name) => names.push(name),
            _ => {
                let path = entry.path();
                let path = path.display();
                tracing::warn!(%path, "not served: its name has other characters than letters, digits, . - _");
            }
        }
    }
    names.sort();
    Ok(names)
}
