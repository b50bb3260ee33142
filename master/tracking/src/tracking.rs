//! The trackers of a wall, for whoever draws. In: configurations. Out: at any moment a [`Snapshot`], and heads at
//! a presentation time. Reading waits for nobody: it copies a pointer to what was published last.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use tokio::runtime::Handle;
use tokio::sync::watch;
use tokio::task::JoinHandle;

use crate::config::{ConfigError, TrackerConfig, check_all};
use crate::event::Event;
use crate::head::HeadState;
use crate::motion::{HeadPose, Motion};
use crate::run;

/// Microseconds on the clock of presentation times. Must not be set back.
pub type Clock = fn() -> i64;

/// All that is known of trackers at a moment.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// When it was made.
    pub at_us: i64,
    /// One for each tracker, in the order of the configurations.
    pub heads: Vec<HeadReport>,
    /// Buttons and analog values by device: `DEVICE@HOST:PORT` for VRPN, `flystickN@ADDRESS:PORT` for
    /// DTrack. A device stays as it was when its source goes away.
    pub devices: Arc<BTreeMap<Arc<str>, Device>>,
    /// The last events, the oldest first, at most [`crate::MOST_EVENTS`].
    pub events: Arc<VecDeque<Event>>,
}

/// What is known of one tracker's head.
#[derive(Clone, Debug)]
pub struct HeadReport {
    /// The tracker's name.
    pub tracker: Arc<str>,
    /// How it is followed.
    pub state: HeadState,
    /// Its motion as last believed; `None` only while waiting.
    pub motion: Option<Motion>,
    /// How many measurements have come for it.
    pub measurements: u64,
}

/// Buttons and analog values of a device.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Device {
    /// Whether each is pressed.
    pub buttons: Vec<bool>,
    /// As the device tells them; joysticks −1…1.
    pub analogs: Vec<f64>,
    /// When they last came.
    pub at_us: i64,
}

/// A head at a presentation time.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackedHead {
    /// The tracker's name.
    pub tracker: Arc<str>,
    /// How it is followed.
    pub state: HeadState,
    /// Where it is then; `None` only while waiting.
    pub pose: Option<HeadPose>,
}

impl Snapshot {
    /// All heads at `presentation_us`, in the order of the configurations.
    #[must_use]
    pub fn heads_at(&self, presentation_us: i64) -> Vec<TrackedHead> {
        self.heads
            .iter()
            .map(|head| TrackedHead {
                tracker: Arc::clone(&head.tracker),
                state: head.state,
                pose: head.motion.map(|motion| motion.at(presentation_us)),
            })
            .collect()
    }

    /// The head of a tracker.
    #[must_use]
    pub fn head(&self, tracker: &str) -> Option<&HeadReport> {
        self.heads.iter().find(|head| &*head.tracker == tracker)
    }
}

/// The running task. Dropping it stops the task.
#[derive(Debug)]
pub struct Tracking {
    published: watch::Receiver<Arc<Snapshot>>,
    task: JoinHandle<()>,
}

impl Tracking {
    /// Checks `trackers` and starts to follow them, in one task of `runtime`, which needs I/O and time. What
    /// cannot be reached is tried again for ever.
    pub fn start(
        trackers: &[TrackerConfig],
        clock: Clock,
        runtime: &Handle,
    ) -> Result<Self, ConfigError> {
        check_all(trackers)?;
        let (publisher, published) = watch::channel(Arc::new(Snapshot::default()));
        let work = run::work(trackers, clock, publisher)?;
        Ok(Self {
            published,
            task: runtime.spawn(work),
        })
    }

    /// What was published last. Waits for nobody.
    #[must_use]
    pub fn snapshot(&self) -> Arc<Snapshot> {
        Arc::clone(&self.published.borrow())
    }

    /// All heads at `presentation_us`, in the order of the configurations. Waits for nobody.
    #[must_use]
    pub fn heads_at(&self, presentation_us: i64) -> Vec<TrackedHead> {
        self.snapshot().heads_at(presentation_us)
    }

    /// A receiver that tells when there is something new.
    #[must_use]
    pub fn subscribe(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.published.clone()
    }
}

impl Drop for Tracking {
    fn drop(&mut self) {
        self.task.abort();
    }
}
