//! What happened to trackers, for the report. In: events as they happen, however often. Out: the last of them,
//! numbered; what may come a thousand times a second, or every few seconds for days, comes rarely, with a
//! count. Beside the snapshot it tells the log.

use std::collections::{HashMap, VecDeque};
use std::fmt;
use std::mem::{Discriminant, discriminant};
use std::sync::Arc;

use crate::head::HeadEvent;

/// How many events a snapshot holds.
pub const MOST_EVENTS: usize = 64;
/// Refusals of one kind about one subject: one event in this time.
const REFUSALS_US: i64 = 1_000_000;
/// Failures to reach a subject: one event in this time, until it was reached.
const FAILURES_US: i64 = 60_000_000;

/// Something that happened.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Rises by 1 with every event: a reader knows what it has not seen.
    pub number: u64,
    /// When, on the clock of the reader.
    pub at_us: i64,
    /// A tracker's name, or a source.
    pub subject: Arc<str>,
    /// What.
    pub what: What,
    /// How often since the last event of this kind about this subject, at least 1.
    pub count: u64,
}

/// What happened.
#[derive(Clone, Debug, PartialEq)]
pub enum What {
    /// A source can be read from now.
    Connected {
        /// By which way, and to whom.
        how: String,
    },
    /// A source could not be reached; it is tried again.
    Unreachable {
        /// Why.
        reason: String,
    },
    /// A source went away; it is connected again.
    Disconnected {
        /// Why.
        reason: String,
    },
    /// A message or packet was refused; the next is read.
    Refused {
        /// Why.
        reason: String,
    },
    /// Something happened to a head.
    Head(HeadEvent),
}

impl fmt::Display for Event {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: {}", self.subject, self.what)?;
        if self.count > 1 {
            write!(formatter, " ({} times)", self.count)?;
        }
        Ok(())
    }
}

impl fmt::Display for What {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Connected { how } => write!(formatter, "connected {how}"),
            Self::Unreachable { reason } => write!(formatter, "cannot be reached: {reason}"),
            Self::Disconnected { reason } => write!(formatter, "disconnected: {reason}"),
            Self::Refused { reason } => write!(formatter, "refused: {reason}"),
            Self::Head(event) => event.fmt(formatter),
        }
    }
}

impl fmt::Display for HeadEvent {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Found => write!(formatter, "is tracked"),
            Self::Lost => write!(formatter, "is lost and stays where it was"),
            Self::JumpRefused {
                distance_m,
                speed_m_s,
            } => write!(
                formatter,
                "jumped {distance_m:.2} m at {speed_m_s:.0} m/s and stays where it was"
            ),
            Self::JumpAccepted { distance_m } => {
                write!(
                    formatter,
                    "is {distance_m:.2} m from where it was, and stays there"
                )
            }
            Self::Bad(bad) => bad.fmt(formatter),
        }
    }
}

/// The kinds of events that are counted, each on its own. The others are rare.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Kind {
    is_failure: bool,
    head: Option<Discriminant<HeadEvent>>,
}

impl Kind {
    fn of(what: &What) -> Option<Self> {
        let (is_failure, head) = match what {
            What::Unreachable { .. } => (true, None),
            What::Refused { .. } => (false, None),
            What::Head(event @ (HeadEvent::Bad(_) | HeadEvent::JumpRefused { .. })) => {
                (false, Some(discriminant(event)))
            }
            _ => return None,
        };
        Some(Self { is_failure, head })
    }

    fn pause_us(self) -> i64 {
        if self.is_failure {
            FAILURES_US
        } else {
            REFUSALS_US
        }
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Pause {
    since_us: Option<i64>,
    left_out: u64,
}

/// The last events. The number of subjects must be bounded by whoever records.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log {
    events: Arc<VecDeque<Event>>,
    pauses: HashMap<(Arc<str>, Kind), Pause>,
    next: u64,
}

impl Log {
    pub(crate) fn events(&self) -> Arc<VecDeque<Event>> {
        Arc::clone(&self.events)
    }

    /// Records; whether a reader will see something new.
    pub(crate) fn record(&mut self, at_us: i64, subject: &Arc<str>, what: What) -> bool {
        if matches!(what, What::Connected { .. }) {
            self.pauses
                .retain(|(about, kind), _| about != subject || !kind.is_failure);
        }
        let count = match Kind::of(&what) {
            Some(kind) => self.due(at_us, subject, kind),
            None => Some(1),
        };
        let Some(count) = count else {
            return false;
        };
        let event = Event {
            number: self.next,
            at_us,
            subject: Arc::clone(subject),
            what,
            count,
        };
        tracing::info!("{event}");
        self.next = self.next.saturating_add(1);
        let events = Arc::make_mut(&mut self.events);
        if events.len() >= MOST_EVENTS {
            events.pop_front();
        }
        events.push_back(event);
        true
    }

    /// How many events of a kind are to be told as one now; `None` for not yet.
    fn due(&mut self, at_us: i64, subject: &Arc<str>, kind: Kind) -> Option<u64> {
        let key = (Arc::clone(subject), kind);
        let pause = self.pauses.entry(key).or_default();
        let since_us = pause
            .since_us
            .map(|since_us| at_us.saturating_sub(since_us));
        if since_us.is_some_and(|since_us| since_us < kind.pause_us()) {
            pause.left_out = pause.left_out.saturating_add(1);
            return None;
        }
        pause.since_us = Some(at_us);
        Some(std::mem::take(&mut pause.left_out).saturating_add(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::head::BadPose;

    fn refused() -> What {
        What::Refused {
            reason: "rubbish".to_owned(),
        }
    }

    fn unreachable() -> What {
        What::Unreachable {
            reason: "nobody".to_owned(),
        }
    }

    #[test]
    fn floods_are_counted_and_news_are_not_held_back() {
        let mut log = Log::default();
        let (one, other): (Arc<str>, Arc<str>) = ("one".into(), "other".into());
        for step in 0..1_500 {
            log.record(step * 1_000, &one, refused());
        }
        assert!(log.record(0, &other, refused()));
        assert!(log.record(0, &one, What::Head(HeadEvent::Bad(BadPose::NotUnit(0.0)))));
        for _ in 0..3 {
            assert!(log.record(0, &one, What::Head(HeadEvent::Lost)));
            assert!(log.record(0, &one, What::Head(HeadEvent::Found)));
        }
        let told: Vec<String> = log.events().iter().map(ToString::to_string).collect();
        assert_eq!(
            told[..2],
            [
                "one: refused: rubbish",
                "one: refused: rubbish (1000 times)"
            ]
        );
        let numbers: Vec<u64> = log.events().iter().map(|event| event.number).collect();
        assert_eq!(numbers, (0..10).collect::<Vec<u64>>());
    }

    #[test]
    fn what_is_off_for_days_does_not_push_out_the_rest() {
        let mut log = Log::default();
        let one: Arc<str> = "one".into();
        for step in 0..100 {
            log.record(step * 5_000_000, &one, unreachable());
        }
        assert_eq!(log.events().len(), 9);
        let how = "by TCP".to_owned();
        assert!(log.record(500_000_000, &one, What::Connected { how }));
        assert!(log.record(500_000_001, &one, unreachable()), "news again");
        for _ in 0..1_000 {
            log.record(0, &one, What::Head(HeadEvent::Lost));
        }
        assert_eq!(log.events().len(), MOST_EVENTS);
    }
}
