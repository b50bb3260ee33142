//! How long tiles take from being wanted to being drawable.
//!
//! In: tiles that a frame wants and does not have on the device, tiles that went into a result. Out: times, each with
//! the level of the cache that the tile was found at. It keeps no tile.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use geodesy::Tile;
use tiles::{DatasetId, Level};

/// Wanted tiles that are remembered: more than a frame can want.
const MOST_WANTED: usize = 65_536;
/// Times that nobody has taken.
const MOST_UNTOLD: usize = 65_536;

/// The clock of each tile.
#[derive(Debug, Default)]
pub(crate) struct Arrivals {
    wanted: HashMap<(DatasetId, Tile), Wanted>,
    drawable: Vec<(Level, Duration)>,
}

/// One tile's wait.
#[derive(Debug)]
struct Wanted {
    since: Instant,
    /// It was in memory when it was first wanted.
    in_memory: bool,
    /// The last frame that wanted it.
    frame: u64,
}

impl Arrivals {
    /// A frame wants a tile that is not on the device.
    pub(crate) fn wanted(&mut self, key: (DatasetId, Tile), in_memory: bool, frame: u64) {
        if self.wanted.len() >= MOST_WANTED {
            // Only where thousands of frames want what never comes.
            self.wanted.clear();
        }
        let first = Wanted {
            since: Instant::now(),
            in_memory,
            frame,
        };
        self.wanted.entry(key).or_insert(first).frame = frame;
    }

    /// A tile can be drawn. Asks from which level it was loaded where it had to be.
    pub(crate) fn drawable(
        &mut self,
        key: (DatasetId, Tile),
        loaded: impl FnOnce() -> Option<Level>,
    ) {
        let Some(wanted) = self.wanted.remove(&key) else {
            return;
        };
        let level = if wanted.in_memory {
            Some(Level::Ram)
        } else {
            loaded()
        };
        if let Some(level) = level.filter(|_| self.drawable.len() < MOST_UNTOLD) {
            self.drawable.push((level, wanted.since.elapsed()));
        }
    }

    /// What no frame since this one wants has left the view, and is not waited for any longer.
    pub(crate) fn forget_before(&mut self, frame: u64) {
        self.wanted.retain(|_, wanted| wanted.frame >= frame);
    }

    /// Times that were not told yet, at most `most`.
    pub(crate) fn take(&mut self, most: usize) -> Vec<(Level, Duration)> {
        let rest = self.drawable.split_off(most.min(self.drawable.len()));
        std::mem::replace(&mut self.drawable, rest)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    #[test]
    fn a_tile_is_timed_from_its_first_wish_by_where_it_was_then() {
        let id = DatasetId::random();
        let key = |x| (id, Tile::new(0, 4, x, 0).unwrap());
        let mut arrivals = Arrivals::default();
        arrivals.wanted(key(2), false, 1);
        arrivals.wanted(key(0), false, 1);
        let pause = Duration::from_millis(20);
        std::thread::sleep(pause);
        arrivals.wanted(key(0), true, 2);
        arrivals.wanted(key(1), true, 2);
        arrivals.forget_before(2);
        for x in 0..3 {
            arrivals.drawable(key(x), || Some(Level::Disk));
        }
        let told = arrivals.take(1);
        assert!(matches!(told[..], [(Level::Disk, after)] if after >= pause));
        let told = arrivals.take(9);
        assert!(matches!(told[..], [(Level::Ram, _)]), "{told:?}");
        assert!(arrivals.take(9).is_empty());
    }
}
