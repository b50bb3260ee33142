//! Heads that trackers follow, in the order of the wall's observers.
//!
//! In: a wall with trackers, moments of presentation. Out: every observer's head then, resting where nothing was measured
//! yet; what happened to trackers. It waits for no tracker.

use std::sync::Arc;

use protocol::Wall;
use protocol::report::{TrackerReport, TrackerState};
use protocol::wall::{Head, Tracker, TrackerSource};
use tokio::runtime::Handle;
use tracking::{Axes, Body, ConfigError, HeadState, Smoothing, Source, TrackerConfig, Tracking};

/// The heads of a wall's observers.
pub(crate) struct Heads {
    wall: Arc<Wall>,
    tracking: Option<Tracking>,
    /// The number of the last event that was told.
    told: Option<u64>,
}

impl Heads {
    /// Begins to follow, if the wall has trackers.
    pub(crate) fn start(wall: &Arc<Wall>, runtime: &Handle) -> Result<Self, ConfigError> {
        let configs: Vec<TrackerConfig> = wall.trackers.iter().map(config).collect();
        let tracking = if configs.is_empty() {
            None
        } else {
            Some(Tracking::start(&configs, link::now_us, runtime)?)
        };
        Ok(Self {
            wall: Arc::clone(wall),
            tracking,
            told: None,
        })
    }

    /// All heads at a moment of presentation on this host's clock; `None` where nothing follows any.
    pub(crate) fn at(&self, presented_us: i64) -> Option<Vec<Head>> {
        let tracked = self.tracking.as_ref()?.heads_at(presented_us);
        let head = |observer: &protocol::wall::Observer| {
            let pose = tracked.get(observer.tracker?)?.pose?;
            Some(Head {
                position_m: pose.position_m,
                right: pose.right.map(|part| part as f32),
            })
        };
        let observers = self.wall.observers.iter();
        Some(
            observers
                .map(|observer| {
                    head(observer)
                        .filter(Head::is_sound)
                        .unwrap_or_else(|| observer.resting_head())
                })
                .collect(),
        )
    }

    /// What has happened since the last call, a sentence each.
    pub(crate) fn take_events(&mut self) -> Vec<String> {
        let Some(tracking) = &self.tracking else {
            return Vec::new();
        };
        let snapshot = tracking.snapshot();
        let told = self.told;
        let new = snapshot
            .events
            .iter()
            .filter(|event| told.is_none_or(|told| event.number > told));
        let sentences = new.map(ToString::to_string).collect();
        self.told = snapshot.events.back().map(|event| event.number).or(told);
        sentences
    }

    /// How trackers stand.
    pub(crate) fn report(&self) -> Vec<TrackerReport> {
        let Some(tracking) = &self.tracking else {
            return Vec::new();
        };
        let snapshot = tracking.snapshot();
        let heads = snapshot.heads.iter();
        heads
            .zip(&self.wall.trackers)
            .map(|(head, tracker)| {
                // Trackers of one server share what happens to it: its events bear its address alone.
                let source = config(tracker).source.to_string();
                let is_own = |subject: &str| subject == tracker.name || source.ends_with(subject);
                TrackerReport {
                    name: tracker.name.clone(),
                    state: match head.state {
                        HeadState::Waiting => TrackerState::Waiting,
                        HeadState::Tracked => TrackerState::Tracked,
                        HeadState::Lost { .. } => TrackerState::Lost,
                    },
                    measurements: head.measurements,
                    events: snapshot
                        .events
                        .iter()
                        .filter(|event| is_own(&event.subject))
                        .map(ToString::to_string)
                        .collect(),
                }
            })
            .collect()
    }
}

fn config(tracker: &Tracker) -> TrackerConfig {
    TrackerConfig {
        name: tracker.name.clone(),
        source: match &tracker.source {
            TrackerSource::Vrpn { device, host, port } => Source::Vrpn {
                device: device.clone(),
                host: host.clone(),
                port: *port,
            },
            TrackerSource::Dtrack { listen } => Source::Dtrack {
                listen: listen.clone(),
            },
        },
        body: tracker.body,
        to_room: Axes {
            origin_m: tracker.to_room.origin_m,
            x: tracker.to_room.x,
            y: tracker.to_room.y,
            z: tracker.to_room.z,
        },
        unit_m: tracker.unit_m,
        to_head: Body {
            offset_m: tracker.to_head.offset_m,
            looks_deg: tracker.to_head.looks_deg,
        },
        smoothing: Smoothing {
            minimum_cutoff_hz: tracker.smoothing.minimum_cutoff_hz,
            speed_coefficient: tracker.smoothing.speed_coefficient,
        },
        latency_ms: tracker.latency_ms,
    }
}
