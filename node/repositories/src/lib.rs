//! Repositories behind file paths, `http(s)://` and `s3://`, as sources of tiles.
//!
//! In: addresses. Out: [`tiles::OpenDataset`]s whose tiles come over the network, with retries, limits and a
//! breaker. Callers block in `fetch` and never see the runtime. It must not cache tiles and must not show
//! credentials.

mod address;
mod backoff;
mod breaker;
mod credentials;
mod failure;
mod open;
mod options;
mod remote;
mod store;
mod transport;

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use parking_lot::Mutex;
use thiserror::Error;
use tiles::{Dataset, OpenDataset};
use tokio::runtime::Runtime;
use tokio::sync::Semaphore;

pub use address::{Address, AddressError};
pub use credentials::CredentialsError;
pub use failure::Failure;
pub use open::OpenError;
pub use options::{CREDENTIALS_VARIABLE, Options, OptionsError};
pub use remote::RepositoryState;
pub use store::StoreError;

use address::Place;
use remote::Remote;
use transport::Transport;

/// Threads of the runtime. They move bytes and wait; decoding is done by those who fetch.
const THREADS: usize = 2;

/// All repositories of a process. They share one runtime, the connections and the limit of requests in flight.
/// Dropping it ends all pending requests at once, with an error; sources that live on answer with it too.
pub struct Repositories {
    options: Options,
    transport: Transport,
    in_flight: Arc<Semaphore>,
    remotes: Mutex<HashMap<Address, Arc<Remote>>>,
    /// The last description of each directory that was opened.
    directories: Mutex<HashMap<Address, Dataset>>,
    runtime: Option<Runtime>,
}

/// Why repositories could not be set up.
#[derive(Debug, Error)]
pub enum SetupError {
    /// An option is out of its range.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// The system gives no threads.
    #[error("cannot start the threads for network repositories: {0}")]
    Threads(std::io::Error),
    /// The HTTP client cannot be made.
    #[error("cannot set up HTTP: {0}")]
    Client(String),
}

impl Repositories {
    /// Starts the runtime. Nothing is asked of the network yet.
    ///
    /// # Errors
    /// [`SetupError`].
    pub fn new(options: &Options) -> Result<Self, SetupError> {
        options.check()?;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(THREADS)
            .thread_name("repositories")
            .enable_all()
            .build()
            .map_err(SetupError::Threads)?;
        Ok(Self {
            options: options.clone(),
            transport: Transport::new(options).map_err(SetupError::Client)?,
            in_flight: Arc::new(Semaphore::new(options.requests_in_flight)),
            remotes: Mutex::new(HashMap::new()),
            directories: Mutex::new(HashMap::new()),
            runtime: Some(runtime),
        })
    }

    /// Opens a repository: reads its description and its index. Blocks for as long as the attempts of
    /// [`Options`] take; where the repository is known to be unreachable it fails at once.
    ///
    /// # Errors
    /// [`OpenError`].
    pub fn open(&self, address: &Address) -> Result<OpenDataset, OpenError> {
        match address.place() {
            Place::Directory(path) => {
                let open = OpenDataset::of_repository(path)?;
                self.remember(address, &open);
                Ok(open)
            }
            Place::Http(_) | Place::Bucket { .. } => open::open(&self.remote(address)?),
        }
    }

    /// Opens a repository again if it has changed since it was opened last; `None` if it has not. Over the network
    /// an unchanged repository costs one conditional request without a body. The description decides: an import
    /// writes it last and counts its revision up.
    ///
    /// # Errors
    /// [`OpenError`].
    pub fn revalidate(&self, address: &Address) -> Result<Option<OpenDataset>, OpenError> {
        match address.place() {
            Place::Directory(path) => {
                let now = Dataset::load(path).map_err(tiles::RepositoryError::from)?;
                if self.directories.lock().get(address) == Some(&now) {
                    return Ok(None);
                }
                self.open(address).map(Some)
            }
            Place::Http(_) | Place::Bucket { .. } => open::revalidate(&self.remote(address)?),
        }
    }

    /// How the network repositories are doing that were opened or tried so far, by address.
    #[must_use]
    pub fn states(&self) -> Vec<RepositoryState> {
        let remotes: Vec<Arc<Remote>> = self.remotes.lock().values().map(Arc::clone).collect();
        let mut states: Vec<RepositoryState> =
            remotes.iter().map(|remote| remote.state()).collect();
        states.sort_by(|a, b| a.address.cmp(&b.address));
        states
    }

    fn remember(&self, address: &Address, open: &OpenDataset) {
        self.directories
            .lock()
            .insert(address.clone(), open.dataset.clone());
    }

    /// The one connection to an address, made when it is first needed.
    fn remote(&self, address: &Address) -> Result<Arc<Remote>, OpenError> {
        let Some(runtime) = &self.runtime else {
            return Err(OpenError::closing(address));
        };
        match self.remotes.lock().entry(address.clone()) {
            Entry::Occupied(known) => Ok(Arc::clone(known.get())),
            Entry::Vacant(place) => {
                let remote = Remote::new(
                    address,
                    &self.options,
                    &self.transport,
                    Arc::clone(&self.in_flight),
                    runtime.handle().clone(),
                )?;
                Ok(Arc::clone(place.insert(Arc::new(remote))))
            }
        }
    }
}

impl Drop for Repositories {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            // Drops every task, and with it the channel on which a fetching thread waits.
            runtime.shutdown_background();
        }
    }
}
