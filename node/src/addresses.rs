//! Where scenes' repositories are: directories, web servers, buckets.
//! In: places as scenes name them. Out: opened data sets for the tile cache. It reads no tiles itself.

use std::path::Path;
use std::sync::Arc;

use render::{Directories, OpenDataset, Opener};
use repositories::{Address, Options, Repositories, SetupError};

/// All places a node can read from.
pub(crate) struct Addresses(pub(crate) Arc<Repositories>);

/// Sets up what reads repositories on this node, with its credentials.
pub(crate) fn repositories() -> Result<Arc<Repositories>, SetupError> {
    Ok(Arc::new(Repositories::new(&Options::from_environment())?))
}

impl Opener for Addresses {
    fn open(&self, place: &Path) -> Result<OpenDataset, Box<dyn std::error::Error + Send + Sync>> {
        match address(place) {
            Some(text) => Ok(self.0.open(&text.parse::<Address>()?)?),
            None => Directories.open(place),
        }
    }

    fn reopen(
        &self,
        place: &Path,
    ) -> Result<Option<OpenDataset>, Box<dyn std::error::Error + Send + Sync>> {
        let Some(text) = address(place) else {
            return Directories.reopen(place);
        };
        match self.0.revalidate(&text.parse::<Address>()?) {
            // What is known of it goes on to hold, and what is cached can be shown.
            Err(error) if error.may_pass() => {
                tracing::warn!(%error, "a repository cannot be asked whether it has changed");
                Ok(None)
            }
            answer => Ok(answer?),
        }
    }
}

/// The text of an address. Any other name is one of the file system, whatever letters it has.
fn address(place: &Path) -> Option<&str> {
    place.to_str().filter(|text| text.contains("://"))
}
