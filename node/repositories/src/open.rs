//! Opening a repository behind the network, and asking whether it has changed.
//!
//! In: a repository. Out: its description and index of the same import. An import may end between the two reads;
//! it writes the description last, so that the index belongs to a description that reads the same before and
//! after. It must not fetch tiles.

use std::sync::Arc;

use thiserror::Error;
use tiles::{
    DATASET_FILE, Dataset, DatasetError, INDEX_FILE, Index, IndexError, OpenDataset,
    RepositoryError,
};

use crate::address::Address;
use crate::failure::Failure;
use crate::remote::{Answer, MOST_DESCRIPTION_BYTES, Remote, RemoteSource, Seen};
use crate::store::StoreError;

/// Bytes that an index may have: hundreds of millions of tiles.
const MOST_INDEX_BYTES: u64 = 2 << 30;
/// So often the description may change while the index is read.
const ROUNDS: usize = 5;

/// Why a repository could not be opened.
#[derive(Debug, Error)]
pub enum OpenError {
    /// A directory was refused.
    #[error(transparent)]
    Directory(#[from] RepositoryError),
    /// The store could not be set up.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// There is no repository.
    #[error(
        "{address} is no repository: it has no {DATASET_FILE}; give the address of a directory that `terrawall import` \
         made and that is served as it is"
    )]
    NoRepository {
        /// The address.
        address: String,
    },
    /// There is no index.
    #[error(
        "{address} has no {INDEX_FILE}: its import was interrupted or not copied whole; run it again"
    )]
    NoIndex {
        /// The address.
        address: String,
    },
    /// A file could not be read.
    #[error("cannot read {place}: {failure}")]
    Unread {
        /// The file's address.
        place: String,
        /// Why.
        failure: Failure,
    },
    /// The description was refused.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The index was refused.
    #[error("{place}: {source}")]
    Index {
        /// The file's address.
        place: String,
        /// Why.
        source: IndexError,
    },
    /// It does not come to rest.
    #[error(
        "{address} changed {ROUNDS} times while it was read: wait until nobody imports into it"
    )]
    Restless {
        /// The address.
        address: String,
    },
}

impl OpenError {
    pub(crate) fn closing(address: &Address) -> Self {
        Self::Unread {
            place: address.to_string(),
            failure: Failure::Closing,
        }
    }

    /// Whether the repository may be had later without anybody's doing: the server or the network is away.
    #[must_use]
    pub fn may_pass(&self) -> bool {
        match self {
            Self::Unread { failure, .. } => {
                failure.may_pass() || matches!(failure, Failure::Unreachable(_))
            }
            Self::Restless { .. } => true,
            _ => false,
        }
    }
}

/// Opens a repository.
pub(crate) fn open(remote: &Arc<Remote>) -> Result<OpenDataset, OpenError> {
    let description = describe(remote)?;
    open_from(remote, description)
}

/// Opens a repository if it has changed since it was opened last.
pub(crate) fn revalidate(remote: &Arc<Remote>) -> Result<Option<OpenDataset>, OpenError> {
    let known = remote
        .seen
        .lock()
        .as_ref()
        .map(|seen| (seen.dataset.clone(), seen.description.clone()));
    let Some((dataset, validator)) = known else {
        return open(remote).map(Some);
    };
    let answer = match remote.read(DATASET_FILE, MOST_DESCRIPTION_BYTES, Some(&validator)) {
        Err(Failure::NotModified) => return Ok(None),
        answer => description(remote, answer)?,
    };
    if answer.0 == dataset {
        // Touched or served from elsewhere, but the same.
        remember(remote, &answer);
        return Ok(None);
    }
    open_from(remote, answer).map(Some)
}

type Description = (Dataset, Answer);

/// From a description that has been read: reads the index, and the description again, until both belong together.
fn open_from(remote: &Arc<Remote>, mut before: Description) -> Result<OpenDataset, OpenError> {
    for _ in 0..ROUNDS {
        let index = remote.read(INDEX_FILE, MOST_INDEX_BYTES, None);
        let known = Some(&before.1.validator);
        let after = match remote.read(DATASET_FILE, MOST_DESCRIPTION_BYTES, known) {
            Err(Failure::NotModified) => None,
            answer => Some(description(remote, answer)?),
        };
        match after {
            Some(after) if after.1.bytes != before.1.bytes => before = after,
            _ => {
                let index = decode(remote, index)?;
                remember(remote, &before);
                let source = RemoteSource::new(remote, &before.0);
                return Ok(OpenDataset::new(before.0, index, Box::new(source)));
            }
        }
    }
    Err(OpenError::Restless {
        address: remote.address().to_string(),
    })
}

fn describe(remote: &Arc<Remote>) -> Result<Description, OpenError> {
    let answer = remote.read(DATASET_FILE, MOST_DESCRIPTION_BYTES, None);
    description(remote, answer)
}

fn description(remote: &Remote, answer: Result<Answer, Failure>) -> Result<Description, OpenError> {
    let place = remote.place_of(DATASET_FILE);
    let answer = answer.map_err(|failure| match failure {
        Failure::NotFound => OpenError::NoRepository {
            address: remote.address().to_string(),
        },
        failure => OpenError::Unread {
            place: place.clone(),
            failure,
        },
    })?;
    let text = String::from_utf8_lossy(&answer.bytes);
    let dataset = Dataset::from_text(&text, &place)?;
    Ok((dataset, answer))
}

fn decode(remote: &Remote, answer: Result<Answer, Failure>) -> Result<Index, OpenError> {
    let place = remote.place_of(INDEX_FILE);
    match answer {
        Ok(answer) => {
            Index::decode(&answer.bytes).map_err(|source| OpenError::Index { place, source })
        }
        Err(Failure::NotFound) => Err(OpenError::NoIndex {
            address: remote.address().to_string(),
        }),
        Err(failure) => Err(OpenError::Unread { place, failure }),
    }
}

fn remember(remote: &Remote, (dataset, answer): &Description) {
    *remote.seen.lock() = Some(Seen {
        dataset: dataset.clone(),
        description: answer.validator.clone(),
    });
}
