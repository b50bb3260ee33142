//! Scenes between their arrival and the picture.
//! In: scenes in the order in which the master sent them, the revision that it shows. Out: the scenes that
//! can still be shown, oldest first. It never grows beyond [`MOST_SCENES`].

use std::collections::VecDeque;

/// Most scenes that are kept. Views say which are past, 60 times a second: so many are kept only by a node
/// that has looked at none for a while.
const MOST_SCENES: usize = 16;

/// A scene that has arrived.
#[derive(Debug)]
struct Arrival<S> {
    revision: u64,
    at_us: i64,
    scene: S,
}

/// Scenes in the order of their revisions.
#[derive(Debug)]
pub(crate) struct SceneQueue<S> {
    arrivals: VecDeque<Arrival<S>>,
}

impl<S> Default for SceneQueue<S> {
    fn default() -> Self {
        Self {
            arrivals: VecDeque::new(),
        }
    }
}

impl<S> SceneQueue<S> {
    /// A scene has arrived at this moment. It is ignored unless its revision is the newest.
    ///
    /// The oldest may be the one that the wall shows, and the newest is the one that it waits for. So when
    /// there are too many, the second oldest goes.
    pub(crate) fn push(&mut self, revision: u64, at_us: i64, scene: S) {
        self.add(Arrival {
            revision,
            at_us,
            scene,
        });
    }

    /// Puts what has arrived later behind.
    pub(crate) fn append(&mut self, later: Self) {
        for arrival in later.arrivals {
            self.add(arrival);
        }
    }

    fn add(&mut self, arrival: Arrival<S>) {
        if self
            .newest()
            .is_some_and(|newest| arrival.revision <= newest)
        {
            return;
        }
        if self.arrivals.len() == MOST_SCENES {
            self.arrivals.remove(1);
        }
        self.arrivals.push_back(arrival);
    }

    /// The master shows this revision: earlier ones will not be shown again.
    pub(crate) fn forget_before(&mut self, revision: u64) {
        while self
            .arrivals
            .front()
            .is_some_and(|first| first.revision < revision)
        {
            self.arrivals.pop_front();
        }
    }

    /// The last revision.
    pub(crate) fn newest(&self) -> Option<u64> {
        self.arrivals.back().map(|last| last.revision)
    }

    /// Whether this revision's scene is here.
    pub(crate) fn contains(&self, revision: u64) -> bool {
        self.arrivals
            .iter()
            .any(|arrival| arrival.revision == revision)
    }

    /// When the oldest arrived.
    pub(crate) fn first_at_us(&self) -> Option<i64> {
        self.arrivals.front().map(|first| first.at_us)
    }

    /// The oldest revision, and when the one after it arrived; `None` for fewer than two.
    pub(crate) fn first_and_next(&self) -> Option<(u64, i64)> {
        let mut arrivals = self.arrivals.iter();
        let first = arrivals.next()?;
        Some((first.revision, arrivals.next()?.at_us))
    }

    /// Takes the oldest.
    pub(crate) fn pop(&mut self) -> Option<(u64, S)> {
        let first = self.arrivals.pop_front()?;
        Some((first.revision, first.scene))
    }
}
