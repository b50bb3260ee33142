//! One repository behind the network: attempts, pauses, the breaker and its probes.
//!
//! In: names of files. Out: their bytes, whole, or why not. All waiting happens on the runtime; the thread that
//! asks waits for one message. It must not know what the files mean.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::sync_channel;
use std::time::{Duration, Instant};

use futures_util::StreamExt as _;
use geodesy::Tile;
use object_store::path::Path;
use object_store::{GetOptions, ObjectMeta, ObjectStore};
use parking_lot::Mutex;
use tiles::{DATASET_FILE, Dataset, Repository, Source, SourceError, TileData};
use tokio::runtime::Handle;
use tokio::sync::{Semaphore, watch};
use tokio::time::{sleep, timeout, timeout_at};

use crate::address::{Address, Place};
use crate::backoff::{pause, random};
use crate::breaker::{Breaker, Rules};
use crate::failure::Failure;
use crate::options::Options;
use crate::store::{self, StoreError};
use crate::transport::Transport;

/// A body may take a second more for so many bytes: slower is as good as not at all.
const SLOWEST_BYTES_PER_S: u64 = 65_536;
/// A tile file may be larger than its plain samples by an eighth (what does not compress grows a little, a mask is
/// an eighth of a byte a node) and this.
const TILE_SLACK_BYTES: u64 = 65_536;
/// Bytes that a description may have.
pub(crate) const MOST_DESCRIPTION_BYTES: u64 = 16 << 20;

/// How a repository is doing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RepositoryState {
    /// Its address.
    pub address: String,
    /// Whether requests are sent; if not, it is probed until it answers.
    pub reachable: bool,
    /// For how long that has been so.
    pub unchanged_for: Duration,
    /// HTTP requests sent, retries and probes included.
    pub requests: u64,
    /// Files that were asked for a second, third, … time.
    pub retries: u64,
    /// Attempts that failed by a fault of the server or the network.
    pub failures: u64,
    /// Bytes of bodies received.
    pub bytes: u64,
    /// The last failure, for people.
    pub last_failure: Option<String>,
}

/// Figures of one repository since it was first opened.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    requests: AtomicU64,
    retries: AtomicU64,
    failures: AtomicU64,
    bytes: AtomicU64,
    last_failure: Mutex<Option<String>>,
}

impl Tally {
    /// Notes that a request is being sent.
    pub(crate) fn count_request(&self) {
        self.requests.fetch_add(1, Ordering::Relaxed);
    }
}

/// A file that was read whole.
pub(crate) struct Answer {
    pub(crate) bytes: Vec<u8>,
    /// By which it can be asked for again only if it has changed.
    pub(crate) validator: ObjectMeta,
}

/// What was opened last.
pub(crate) struct Seen {
    pub(crate) dataset: Dataset,
    pub(crate) description: ObjectMeta,
}

/// One repository behind the network.
pub(crate) struct Remote {
    address: Address,
    prefix: Path,
    store: Arc<dyn ObjectStore>,
    options: Options,
    in_flight: Arc<Semaphore>,
    breaker: Mutex<Breaker>,
    /// False while the breaker is open; ends the pauses of those who wait for another attempt.
    reachable: watch::Sender<bool>,
    tally: Arc<Tally>,
    pub(crate) seen: Mutex<Option<Seen>>,
    runtime: Handle,
}

impl Remote {
    /// Sets up the store. Nothing is sent. Must not be called with the address of a directory.
    pub(crate) fn new(
        address: &Address,
        options: &Options,
        transport: &Transport,
        in_flight: Arc<Semaphore>,
        runtime: Handle,
    ) -> Result<Self, StoreError> {
        let tally = Arc::new(Tally::default());
        let connector = transport.connector(Arc::clone(&tally));
        let trusts = transport.trusts_anybody();
        let (store, prefix) = match address.place() {
            Place::Http(url) => (store::http(url, connector, trusts)?, Path::default()),
            Place::Bucket { bucket, prefix } => {
                let environment = std::env::vars_os().filter_map(|(name, value)| {
                    Some((name.into_string().ok()?, value.into_string().ok()?))
                });
                let file = options.credentials_file.as_deref();
                let store = store::s3(bucket, environment, file, connector, trusts)?;
                let prefix =
                    Path::parse(prefix).map_err(|error| StoreError::Settings(error.to_string()))?;
                (store, prefix)
            }
            Place::Directory(path) => {
                let path = path.display();
                return Err(StoreError::Settings(format!("{path} is a directory")));
            }
        };
        let rules = Rules {
            give_up_after: options.give_up_after,
            first_probe: options.first_probe,
            longest_probe: options.longest_probe,
        };
        Ok(Self {
            address: address.clone(),
            prefix,
            store,
            options: options.clone(),
            in_flight,
            breaker: Mutex::new(Breaker::new(rules, Instant::now())),
            reachable: watch::Sender::new(true),
            tally,
            seen: Mutex::new(None),
            runtime,
        })
    }

    pub(crate) fn address(&self) -> &Address {
        &self.address
    }

    /// The address of a file, for messages.
    pub(crate) fn place_of(&self, file: &str) -> String {
        format!("{}/{file}", self.address)
    }

    pub(crate) fn state(&self) -> RepositoryState {
        let (reachable, since) = {
            let breaker = self.breaker.lock();
            (breaker.is_closed(), breaker.since())
        };
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        RepositoryState {
            address: self.address.to_string(),
            reachable,
            unchanged_for: since.elapsed(),
            requests: count(&self.tally.requests),
            retries: count(&self.tally.retries),
            failures: count(&self.tally.failures),
            bytes: count(&self.tally.bytes),
            last_failure: self.tally.last_failure.lock().clone(),
        }
    }

    /// Reads a file of at most `most` bytes while the calling thread waits; with `known`, only if it has changed
    /// since. Must not be called on the runtime.
    pub(crate) fn read(
        self: &Arc<Self>,
        file: &str,
        most: u64,
        known: Option<&ObjectMeta>,
    ) -> Result<Answer, Failure> {
        let (sender, receiver) = sync_channel(1);
        let (remote, file, known) = (Arc::clone(self), file.to_owned(), known.cloned());
        // A runtime that has been shut down drops the task, and with it the sender.
        drop(self.runtime.spawn(async move {
            let answer = remote.get(&file, most, known.as_ref()).await;
            // Who asked is gone only with the whole process.
            let _ = sender.send(answer);
        }));
        receiver.recv().unwrap_or(Err(Failure::Closing))
    }

    /// All attempts for one file.
    async fn get(
        self: &Arc<Self>,
        file: &str,
        most: u64,
        known: Option<&ObjectMeta>,
    ) -> Result<Answer, Failure> {
        let mut reachable = self.reachable.subscribe();
        let mut failed = 0;
        loop {
            // Waits its turn, but not for a server that has gone meanwhile.
            let place = tokio::select! {
                place = self.in_flight.acquire() => place.map_err(|_| Failure::Closing)?,
                () = until(&mut reachable, false) => return Err(self.unreachable()),
            };
            if !self.breaker.lock().is_closed() {
                return Err(self.unreachable());
            }
            let answer = self.attempt(file, most, known).await;
            drop(place);
            let failure = match answer {
                Err(failure) if failure.may_pass() => failure,
                answer => {
                    self.answered();
                    return answer;
                }
            };
            failed += 1;
            let Options {
                first_pause,
                longest_pause,
                ..
            } = self.options;
            let asked = failure.retry_after();
            let pause = pause(failed, random(), first_pause, longest_pause, asked);
            self.note(file, &failure, pause.is_none());
            let Some(pause) = pause.filter(|_| failed < self.options.attempts) else {
                return Err(failure);
            };
            tokio::select! {
                () = sleep(pause) => {}
                () = until(&mut reachable, false) => return Err(failure),
            }
            self.tally.retries.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// One attempt: the answer must begin in time, be of a possible size, and be complete.
    async fn attempt(
        &self,
        file: &str,
        most: u64,
        known: Option<&ObjectMeta>,
    ) -> Result<Answer, Failure> {
        let begin = tokio::time::Instant::now();
        let limit = self.options.attempt_timeout;
        let options = GetOptions {
            if_none_match: known.and_then(|known| known.e_tag.clone()),
            // Servers ignore it where there is an ETag; 0 is what the store says for "unknown".
            if_modified_since: known
                .map(|known| known.last_modified)
                .filter(|moment| moment.timestamp() != 0),
            ..GetOptions::default()
        };
        let key = store::key(&self.prefix, file);
        let found = timeout(limit, self.store.get_opts(&key, options))
            .await
            .map_err(|_| Failure::TimedOut(limit))?
            .map_err(|error| Failure::of(&error))?;
        let due = found.meta.size;
        if due > most {
            return Err(Failure::TooLarge { bytes: due, most });
        }
        let validator = found.meta.clone();
        let limit = limit + Duration::from_secs(due / SLOWEST_BYTES_PER_S);
        let mut stream = found.into_stream();
        let mut bytes = Vec::new();
        loop {
            let chunk = timeout_at(begin + limit, stream.next()).await;
            let Some(chunk) = chunk.map_err(|_| Failure::TimedOut(limit))? else {
                break;
            };
            let chunk = chunk.map_err(|error| Failure::of(&error))?;
            let arrived = (bytes.len() + chunk.len()) as u64;
            self.tally
                .bytes
                .fetch_add(chunk.len() as u64, Ordering::Relaxed);
            if arrived > due {
                return Err(Failure::TooLarge {
                    bytes: arrived,
                    most: due,
                });
            }
            bytes.extend_from_slice(&chunk);
        }
        if (bytes.len() as u64) < due {
            return Err(Failure::Short {
                bytes: bytes.len() as u64,
                due,
            });
        }
        Ok(Answer { bytes, validator })
    }

    /// Notes that the server answered, whatever it said.
    fn answered(&self) {
        if self.breaker.lock().succeeded(Instant::now()) {
            self.reachable.send_replace(true);
            tracing::info!(address = %self.address, "the repository answers again");
        }
    }

    /// Notes a failure. With `hold`, the server asked to be left alone for longer than anybody should wait.
    fn note(self: &Arc<Self>, file: &str, failure: &Failure, hold: bool) {
        self.tally.failures.fetch_add(1, Ordering::Relaxed);
        *self.tally.last_failure.lock() = Some(format!("{file}: {failure}"));
        let hold = failure.retry_after().filter(|_| hold);
        let opening = self.breaker.lock().failed(Instant::now(), hold, random());
        if let Some(opening) = opening {
            tracing::warn!(address = %self.address, %failure, "the repository cannot be reached; probing it");
            self.reachable.send_replace(false);
            drop(self.runtime.spawn(Arc::clone(self).probe(opening)));
        }
    }

    /// Asks for the description, ever more rarely, until the server answers.
    async fn probe(self: Arc<Self>, opening: u64) {
        loop {
            let now = Instant::now();
            let Some(pause) = self.breaker.lock().until_probe(now, opening) else {
                return;
            };
            if !pause.is_zero() {
                sleep(pause).await;
                continue;
            }
            let Ok(_place) = self.in_flight.acquire().await else {
                return;
            };
            match self
                .attempt(DATASET_FILE, MOST_DESCRIPTION_BYTES, None)
                .await
            {
                Err(failure) if failure.may_pass() => {
                    self.tally.failures.fetch_add(1, Ordering::Relaxed);
                    *self.tally.last_failure.lock() = Some(format!("{DATASET_FILE}: {failure}"));
                    let hold = failure.retry_after();
                    self.breaker
                        .lock()
                        .probe_failed(Instant::now(), hold, random());
                }
                _ => return self.answered(),
            }
        }
    }

    fn unreachable(&self) -> Failure {
        Failure::Unreachable(self.breaker.lock().since().elapsed())
    }
}

/// Ends when the breaker is in the given state. Its sender lives as long as the repository.
async fn until(reachable: &mut watch::Receiver<bool>, due: bool) {
    if reachable.wait_for(|now| *now == due).await.is_err() {
        std::future::pending::<()>().await;
    }
}

/// The tiles of one repository behind the network.
pub(crate) struct RemoteSource {
    remote: Arc<Remote>,
    most: u64,
}

impl RemoteSource {
    pub(crate) fn new(remote: &Arc<Remote>, dataset: &Dataset) -> Self {
        let full = TileData::full_size(dataset.sample_type, dataset.channels) as u64;
        Self {
            remote: Arc::clone(remote),
            most: full + full / 8 + TILE_SLACK_BYTES,
        }
    }
}

impl Source for RemoteSource {
    fn fetch(&self, tile: Tile) -> Result<Option<Vec<u8>>, SourceError> {
        let file = Repository::relative_path_of(tile).display().to_string();
        match self.remote.read(&file, self.most, None) {
            Ok(answer) => Ok(Some(answer.bytes)),
            Err(Failure::NotFound) => Ok(None),
            Err(failure) => Err(SourceError {
                place: self.remote.place_of(&file),
                source: failure.into_io(),
            }),
        }
    }

    fn is_away(&self) -> bool {
        !self.remote.breaker.lock().is_closed()
    }
}
