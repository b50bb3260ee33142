//! Moments of measurement. In: time stamps of a peer whose clock is nobody's, and when they arrived. Out: the
//! moments on this host's clock, without the network's jitter. It reads no clock.
//!
//! The least of (arrival − stamp) over the last seconds is the distance of the two clocks and the shortest way;
//! what a message takes longer is jitter. A burst that TCP held back so keeps its rhythm.

/// The least distance is sought over one to two of these.
const WINDOW_US: i64 = 5_000_000;
/// A distance that differs by more than this is another clock: midnight in DTrack, a server that restarted.
const ANOTHER_CLOCK_US: i64 = 1_000_000;

/// A stamp that stays the same for longer is none. Bodies that are measured at once share theirs.
const SAME_STAMP_US: i64 = 100_000;

/// Turns a peer's time stamps into moments.
#[derive(Clone, Debug, Default)]
pub struct Stamps {
    before: Option<i64>,
    current: Option<i64>,
    current_since_us: i64,
    last_stamp_us: Option<i64>,
    /// When that stamp came first.
    last_stamp_came_us: i64,
    last_us: Option<i64>,
}

impl Stamps {
    /// Knows nothing of the peer's clock.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// When a message was made that has arrived at `arrived_us` and bears `stamp_us`; one that bears no
    /// stamp was made when it arrived. Never after its arrival; never before the message before.
    pub fn moment_us(&mut self, stamp_us: Option<i64>, arrived_us: i64) -> i64 {
        let Some(stamp_us) = stamp_us else {
            *self = Self::default();
            return arrived_us;
        };
        let distance_us = arrived_us.saturating_sub(stamp_us);
        let known = self.least_us();
        let another_clock = known.is_some_and(|known| {
            distance_us.saturating_sub(known).saturating_abs() > ANOTHER_CLOCK_US
        }) || self.last_stamp_us.is_some_and(|last| stamp_us < last);
        if another_clock {
            *self = Self::default();
        }
        if self.last_stamp_us != Some(stamp_us) {
            self.last_stamp_came_us = arrived_us;
        } else if arrived_us.saturating_sub(self.last_stamp_came_us) > SAME_STAMP_US {
            return arrived_us;
        }
        self.last_stamp_us = Some(stamp_us);
        match self.current {
            Some(current) if arrived_us.saturating_sub(self.current_since_us) < WINDOW_US => {
                self.current = Some(current.min(distance_us));
            }
            current => {
                self.before = current;
                self.current = Some(distance_us);
                self.current_since_us = arrived_us;
            }
        }
        let least_us = self.least_us().unwrap_or(distance_us);
        let moment_us = stamp_us.saturating_add(least_us).min(arrived_us);
        let moment_us = self.last_us.map_or(moment_us, |last| moment_us.max(last));
        self.last_us = Some(moment_us);
        moment_us
    }

    fn least_us(&self) -> Option<i64> {
        match (self.before, self.current) {
            (Some(before), Some(current)) => Some(before.min(current)),
            (before, current) => before.or(current),
        }
    }
}
