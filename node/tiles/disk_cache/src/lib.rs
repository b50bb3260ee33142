//! Immutable files in a directory that many processes on many hosts share, over any POSIX file system.
//!
//! In: names and payloads. Out: the payloads, every byte verified, or the right to fetch one, which is given to one
//! process of the cluster at a time. No daemon, and no clock that two hosts must agree on. It knows nothing of tiles.
//!
//! ```text
//! ROOT/GROUP/PATH.cached                 published files: a header (see `header`), then the payload; never changed
//! ROOT/.parts/HOLDER-NUMBER              files being written; renamed or linked to their places
//! ROOT/.leases/HASH-OF-NAME | janitor    who fetches a name, who is the janitor (see `leases`)
//! ROOT/.ledger/HOLDER.ledger             what a process has published and reserved (see `books`)
//! ROOT/.ledger/NUMBER.baseline           what the janitor counted last
//! ```
//!
//! What holds whoever is killed when: a file is whole or not there; a name can be had again within a lease; published
//! files have no more bytes than the smallest budget of the processes that write. A process that stood still amid a
//! publication for more than four leases may add its one file to that.
//!
//! Two programs of different versions of the header must not share a directory: each removes the other's files.

mod account;
mod books;
mod cache;
mod error;
mod header;
mod janitor;
mod layout;
mod leases;
mod maintain;
mod name;
mod scan;
mod shared;
mod stored;
mod usage;
mod watch;

pub use cache::{Claim, Config, DiskCache, Lease};
pub use error::{MaintenanceError, OpenError, PublishError, Reason};
pub use header::{Broken, MAX_PAYLOAD_BYTES};
pub use maintain::{Files, Statistics, Verification};
pub use name::{Name, NameError};
pub use shared::Counters;
pub use stored::Stored;
