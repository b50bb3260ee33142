//! Brings tiles through the tile cache for nobody's picture: what is read from a repository is kept on the disk.
//!
//! In: wishes, numbers of tiles that are not to be brought again, patience. Out: which tiles came, from where, and why
//! others cannot be had. RAM may be smaller than what is wished for: what came makes room for the next.

use std::collections::HashSet;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use geodesy::Tile;
use tiles::{DatasetId, Level, Lookup, TileCache, Wish, upkeep};

/// How often arrivals are looked through while others are on their way.
const LOOK: Duration = Duration::from_millis(50);

/// A tile that came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FetchedTile {
    /// Its number, the same in every process, and another for every other tile.
    pub number: u64,
    /// Bytes of its samples.
    pub bytes: u64,
    /// Where it was found.
    pub level: Level,
    /// Its file below the root of the disk cache, if it is kept there.
    pub file: PathBuf,
}

/// A tile that cannot be had.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unfetched {
    /// Its number.
    pub number: u64,
    /// The tile and its data set, for people.
    pub tile: String,
    /// Why not.
    pub reason: String,
}

/// What came of wishes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Fetched {
    /// What came, and what was there.
    pub tiles: Vec<FetchedTile>,
    /// What is given up, after several attempts.
    pub failed: Vec<Unfetched>,
    /// How many tiles are on their way when patience has ended.
    pub waiting: usize,
}

/// Brings what is wished for, but for tiles of `known` numbers. Replaces the cache's own wishes, and withdraws them once all came;
/// waits for so long at most, and looks at every tile at least once.
#[must_use]
pub fn fetch(
    cache: &TileCache,
    wants: &[Wish],
    known: &HashSet<u64>,
    patience: Duration,
) -> Fetched {
    let deadline = Instant::now() + patience;
    let mut fetched = Fetched::default();
    let mut once = HashSet::new();
    let mut rest: Vec<Wish> = wants
        .iter()
        .filter(|(id, tile, _)| {
            let number = id.number(*tile);
            !known.contains(&number) && once.insert(number)
        })
        .copied()
        .collect();
    loop {
        rest.retain(|(id, tile, _)| !fetched.settles(cache, *id, *tile));
        let left = deadline.saturating_duration_since(Instant::now());
        if rest.is_empty() || left.is_zero() {
            break;
        }
        // Anew in every round: what came is withdrawn, and goes from RAM before what did not.
        cache.request(&rest);
        let _idle = cache.wait_idle(left.min(LOOK));
    }
    if rest.is_empty() {
        cache.request(&[]);
    }
    fetched.waiting = rest.len();
    fetched
}

impl Fetched {
    /// Notes a tile that is here or given up; false while it is on its way.
    fn settles(&mut self, cache: &TileCache, id: DatasetId, tile: Tile) -> bool {
        let failed = |reason: &str| {
            let name = cache.dataset(id).map(|data| data.dataset.name.clone());
            Unfetched {
                number: id.number(tile),
                tile: format!("tile {tile} of \"{}\"", name.unwrap_or_default()),
                reason: reason.to_owned(),
            }
        };
        // Before and after: what was just handed out may leave a small RAM at once, or have come just now.
        let level = cache.level(id, tile);
        match cache.get(id, tile) {
            Lookup::Pending | Lookup::Away(_) => return false,
            Lookup::Absent => self.failed.push(failed("its data set has no such tile")),
            Lookup::Failed(reason) => self.failed.push(failed(&reason)),
            Lookup::Ready(data) => {
                let Some(level) = level.or_else(|| cache.level(id, tile)) else {
                    return false;
                };
                let Some(dataset) = cache.dataset(id) else {
                    self.failed.push(failed("its data set is gone"));
                    return true;
                };
                match upkeep::file_of(&dataset.dataset, tile) {
                    Ok(file) => self.tiles.push(FetchedTile {
                        number: id.number(tile),
                        bytes: data.byte_size() as u64,
                        level,
                        file,
                    }),
                    Err(problem) => self.failed.push(failed(&problem.to_string())),
                }
            }
        }
        true
    }
}
