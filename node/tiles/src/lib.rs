//! Tile files and the way of a tile: repository, disk cache, RAM cache.
//!
//! In: a repository directory and wishes for tiles. Out: decoded tiles, from the nearest place that has
//! them. Never blocks the caller that draws, never shows half a tile or a broken one. It knows no GPU and
//! no network.

mod codec;
mod dataset;
mod format;
mod index;
mod inspect;
mod loader;
mod measure;
mod opener;
mod publish;
mod ram;
mod repository;
pub mod upkeep;

pub use codec::{CodecError, Origin};
pub use dataset::{DATASET_FILE, DATASET_VERSION, Dataset, DatasetError, DatasetId, SourceNote};
pub use format::{
    DecodeError, EncodeError, FORMAT_VERSION, Kind, MASK_WORDS, MAX_CHANNELS, NODE_COUNT,
    SampleType, Samples, Statistics, TileData, Validity,
};
pub use index::{INDEX_FILE, INDEX_VERSION, Index, IndexError};
pub use inspect::{
    BrokenTile, InspectError, LevelSummary, Summary, TileSummary, ValueAt, inspect_repository,
    inspect_tile, value_at,
};
pub use loader::{CacheConfig, CacheError, Counters, Lookup, TileCache, Wish, Wishes};
pub use measure::{DiskRate, count_on_disk, measure_disk};
pub use opener::{Directories, OpenDataset, Opener, ReadError};
pub use publish::PublishError;
pub use ram::Level;
pub use repository::{Repository, RepositoryError, Source, SourceError};
