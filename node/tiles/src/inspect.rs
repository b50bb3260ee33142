//! What `terrawall inspect` tells: a repository's contents and health, one tile file, one value.
//! In: paths and positions. Out: figures that serialise. It reads only, and takes no detour over the caches, so
//! that it tells what is really in the files.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use geodesy::{Ellipsoid, MAX_LEVEL, Tile, TilePosition};
use parking_lot::Mutex;
use serde::{Serialize, Serializer};
use thiserror::Error;

use crate::dataset::Dataset;
use crate::format::{DecodeError, Kind, SampleType, Statistics, TileData};
use crate::repository::{Repository, RepositoryError};

/// A repository's contents.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Its description.
    pub dataset: Dataset,
    /// Tile files in all.
    pub tiles: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Level by level, those without tiles left out.
    pub levels: Vec<LevelSummary>,
    /// Lowest sample of all tiles in natural units; `None` without valid samples.
    pub lowest: Option<f64>,
    /// Highest sample of all tiles in natural units.
    pub highest: Option<f64>,
    /// Tiles that are broken, belong elsewhere, or are in the index without a file.
    pub broken: Vec<BrokenTile>,
    /// Tile files that the index does not know, as an import at work leaves them; they are never drawn.
    pub unindexed: u64,
    /// Why there is no index, where there is none.
    pub index_problem: Option<String>,
}

/// One level of a repository.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct LevelSummary {
    /// The level.
    pub level: u8,
    /// Its tile files.
    pub tiles: u64,
    /// Their bytes.
    pub bytes: u64,
}

/// A tile that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct BrokenTile {
    /// Which one, as face/level/x/y.
    #[serde(serialize_with = "as_text")]
    pub tile: Tile,
    /// Its file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: String,
}

/// What a tile file holds.
#[derive(Clone, Debug, Serialize)]
pub struct TileSummary {
    /// Which tile, as face/level/x/y.
    #[serde(serialize_with = "as_text")]
    pub tile: Tile,
    /// What it means.
    pub kind: Kind,
    /// Its number type.
    pub sample_type: SampleType,
    /// Channels a node.
    pub channels: u8,
    /// The file's size.
    pub bytes: u64,
    /// Valid nodes of the 275², border included.
    pub valid_nodes: u64,
    /// Figures in sample units: quanta for elevation.
    pub statistics: Statistics,
}

/// A value at a geodetic position.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ValueAt {
    /// The tile that answered, as face/level/x/y.
    #[serde(serialize_with = "as_text")]
    pub tile: Tile,
    /// Its level.
    pub level: u8,
    /// One number a channel in natural units, metres for elevation; empty where it is not valid. Serialised as
    /// a number where there is one channel, as null where it is not valid.
    #[serde(serialize_with = "as_number")]
    pub value: Vec<f64>,
    /// True where all lattice nodes that take part hold data.
    pub valid: bool,
}

/// Why nothing could be told.
#[derive(Debug, Error)]
pub enum InspectError {
    /// The repository could not be opened or read.
    #[error(transparent)]
    Repository(#[from] RepositoryError),
    /// A file could not be read.
    #[error("cannot read {path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A tile is broken.
    #[error("{path}: {problem}", path = path.display())]
    Broken {
        /// The file.
        path: PathBuf,
        /// Why.
        problem: DecodeError,
    },
    /// The position is none.
    #[error(
        "latitude {latitude_deg}°, longitude {longitude_deg}°: latitude is −90…90, longitude −180…360, both finite"
    )]
    Position {
        /// The latitude that was given.
        latitude_deg: f64,
        /// The longitude that was given.
        longitude_deg: f64,
    },
    /// The level is none.
    #[error("level {0}: levels are 0…{MAX_LEVEL}")]
    Level(u8),
    /// No tile there.
    #[error("no tile at latitude {latitude_deg}°, longitude {longitude_deg}° {which}")]
    NoTile {
        /// The latitude that was given.
        latitude_deg: f64,
        /// The longitude that was given.
        longitude_deg: f64,
        /// At which level.
        which: String,
    },
}

fn as_text<S: Serializer>(tile: &Tile, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(tile)
}

fn as_number<S: Serializer>(value: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    match value {
        [] => serializer.serialize_none(),
        [number] => serializer.serialize_f64(*number),
        numbers => numbers.serialize(serializer),
    }
}

/// Reads every tile of a repository in parallel and verifies it. `progress` hears from any thread how many
/// tiles are done, and of how many.
pub fn inspect_repository(
    root: &Path,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<Summary, InspectError> {
    let repository = Repository::open(root)?;
    let files = repository.tiles()?;
    let total = files.len() as u64;
    let (next, done) = (AtomicUsize::new(0), AtomicU64::new(0));
    let findings = Mutex::new((Vec::new(), None::<(f64, f64)>));
    let work = || {
        while let Some((tile, _)) = files.get(next.fetch_add(1, Ordering::Relaxed)) {
            let verdict = verify(&repository, *tile);
            let mut findings = findings.lock();
            match verdict {
                Ok(Some((lowest, highest))) => {
                    let (low, high) = findings.1.unwrap_or((lowest, highest));
                    findings.1 = Some((low.min(lowest), high.max(highest)));
                }
                Ok(None) => {}
                Err(problem) => findings.0.push(BrokenTile {
                    tile: *tile,
                    path: repository.path_of(*tile),
                    problem,
                }),
            }
            drop(findings);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, total);
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(work);
        }
        work();
    });
    let (mut broken, range) = findings.into_inner();
    let there: std::collections::HashSet<Tile> = files.iter().map(|(tile, _)| *tile).collect();
    let (index_problem, unindexed) = match repository.load_index() {
        Ok(index) => {
            let missing = index
                .tiles()
                .into_iter()
                .filter(|tile| !there.contains(tile));
            broken.extend(missing.map(|tile| BrokenTile {
                tile,
                path: repository.path_of(tile),
                problem: "in the index, but there is no file".to_owned(),
            }));
            (
                None,
                there.iter().filter(|tile| !index.contains(**tile)).count() as u64,
            )
        }
        Err(problem) => (Some(problem.to_string()), total),
    };
    broken.sort_unstable_by_key(|broken| broken.tile.id());
    let level = |level: u8| {
        let of_level = || files.iter().filter(move |(tile, _)| tile.level() == level);
        let (tiles, bytes) = (
            of_level().count() as u64,
            of_level().map(|(_, bytes)| bytes).sum(),
        );
        LevelSummary {
            level,
            tiles,
            bytes,
        }
    };
    let unit = repository.dataset().unit();
    Ok(Summary {
        dataset: repository.dataset().clone(),
        tiles: total,
        bytes: files.iter().map(|(_, bytes)| bytes).sum(),
        levels: (0..=MAX_LEVEL)
            .map(level)
            .filter(|level| level.tiles > 0)
            .collect(),
        lowest: range.map(|(lowest, _)| lowest * unit),
        highest: range.map(|(_, highest)| highest * unit),
        broken,
        unindexed,
        index_problem,
    })
}

/// The range of a good tile, `None` where it has no valid sample; or what is wrong.
fn verify(repository: &Repository, tile: Tile) -> Result<Option<(f64, f64)>, String> {
    let bytes = repository.read(tile).map_err(|error| error.to_string())?;
    let bytes = bytes.ok_or_else(|| "it vanished while it was inspected".to_owned())?;
    let data = TileData::decode_tile(&bytes, tile).map_err(|problem| problem.to_string())?;
    let Dataset {
        kind,
        channels,
        sample_type,
        ..
    } = *repository.dataset();
    if (data.kind, data.channels, data.samples.sample_type()) != (kind, channels, sample_type) {
        return Err("its kind, channels or sample type are not those of its data set".to_owned());
    }
    let statistics = Statistics::of(&data.samples, data.channels, &data.validity);
    if !agree(&statistics, &data.statistics) {
        return Err("its statistics are not those of its samples".to_owned());
    }
    Ok((statistics.count > 0).then_some((statistics.lowest, statistics.highest)))
}

/// Equal but for the order in which sums were added up.
fn agree(one: &Statistics, other: &Statistics) -> bool {
    let close = |a: f64, b: f64, scale: f64| (a - b).abs() <= 1e-9 * scale;
    let size = one.lowest.abs().max(one.highest.abs()) * one.count as f64;
    (one.lowest, one.highest, one.count) == (other.lowest, other.highest, other.count)
        && close(one.sum, other.sum, size)
        && close(one.sum_of_squares, other.sum_of_squares, one.sum_of_squares)
}

/// Reads and verifies one tile file.
pub fn inspect_tile(path: &Path) -> Result<TileSummary, InspectError> {
    let bytes = std::fs::read(path).map_err(|source| InspectError::Io {
        path: path.to_owned(),
        source,
    })?;
    let data = TileData::decode(&bytes).map_err(|problem| InspectError::Broken {
        path: path.to_owned(),
        problem,
    })?;
    Ok(TileSummary {
        tile: data.tile,
        kind: data.kind,
        sample_type: data.samples.sample_type(),
        channels: data.channels,
        bytes: bytes.len() as u64,
        valid_nodes: data.validity.count() as u64,
        statistics: data.statistics,
    })
}

/// The value at a geodetic position, bilinear between the four lattice nodes around it. Without a level, the
/// finest tile that exists there answers, valid or not. Longitudes up to 360° are welcome.
pub fn value_at(
    root: &Path,
    latitude_deg: f64,
    longitude_deg: f64,
    level: Option<u8>,
) -> Result<ValueAt, InspectError> {
    let possible = latitude_deg.abs() <= 90.0 && (-180.0..=360.0).contains(&longitude_deg);
    if !possible {
        return Err(InspectError::Position {
            latitude_deg,
            longitude_deg,
        });
    }
    if let Some(level) = level.filter(|level| *level > MAX_LEVEL) {
        return Err(InspectError::Level(level));
    }
    let repository = Repository::open(root)?;
    let normal = Ellipsoid::normal(latitude_deg, longitude_deg);
    let coarsest = level.unwrap_or(0);
    let finest = level.unwrap_or(repository.dataset().deepest_level);
    let mut positions = (coarsest..=finest)
        .rev()
        .map(|level| TilePosition::of_normal(normal, level));
    let Some(position) = positions.find(|position| repository.contains(position.tile)) else {
        let which = level.map_or("at any level".to_owned(), |level| {
            format!("at level {level}")
        });
        return Err(InspectError::NoTile {
            latitude_deg,
            longitude_deg,
            which,
        });
    };
    let path = repository.path_of(position.tile);
    let bytes = repository.read(position.tile)?.unwrap_or_default();
    let data = TileData::decode_tile(&bytes, position.tile)
        .map_err(|problem| InspectError::Broken { path, problem })?;
    let value: Option<Vec<f64>> = (0..data.channels)
        .map(|channel| bilinear(&data, position, channel).map(|v| v * repository.dataset().unit()))
        .collect();
    Ok(ValueAt {
        tile: position.tile,
        level: position.tile.level(),
        valid: value.is_some(),
        value: value.unwrap_or_default(),
    })
}

/// `None` where a node that takes part is invalid.
fn bilinear(data: &TileData, position: TilePosition, channel: u8) -> Option<f64> {
    let (i, j) = (position.i.floor(), position.j.floor());
    let (s, t) = (position.i - i, position.j - j);
    let mut sum = 0.0;
    for (di, dj, weight) in [
        (0, 0, (1.0 - s) * (1.0 - t)),
        (1, 0, s * (1.0 - t)),
        (0, 1, (1.0 - s) * t),
        (1, 1, s * t),
    ] {
        if weight > 0.0 {
            sum += weight * data.value(i as i64 + di, j as i64 + dj, channel)?;
        }
    }
    Some(sum)
}
