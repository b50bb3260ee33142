//! What is known of all trackers. In: what sources tell. Out: snapshots, published. It reads no socket and no
//! clock, and it is bounded: devices, buttons and events have their most.

use std::collections::BTreeMap;
use std::sync::Arc;

use tokio::sync::watch;

use crate::config::{ConfigError, Source, TrackerConfig};
use crate::event::{Log, What};
use crate::head::{Head, HeadState, RawPose};
use crate::tracking::{Device, HeadReport, Snapshot};

/// Most devices: a server may name as many as it likes.
const MOST_DEVICES: usize = 64;

struct Tracker {
    name: Arc<str>,
    source: Source,
    body: u32,
    latency_us: i64,
    head: Head,
    measurements: u64,
}

/// What is known of all trackers.
pub(super) struct Board {
    trackers: Vec<Tracker>,
    devices: Arc<BTreeMap<Arc<str>, Device>>,
    log: Log,
    publisher: watch::Sender<Arc<Snapshot>>,
}

impl Board {
    pub(super) fn new(
        trackers: &[TrackerConfig],
        publisher: watch::Sender<Arc<Snapshot>>,
    ) -> Result<Self, ConfigError> {
        let trackers = trackers.iter().map(|tracker| {
            Ok(Tracker {
                name: tracker.name.as_str().into(),
                source: tracker.source.clone(),
                body: tracker.body,
                latency_us: tracker.latency_us(),
                head: tracker.head()?,
                measurements: 0,
            })
        });
        Ok(Self {
            trackers: trackers.collect::<Result<_, ConfigError>>()?,
            devices: Arc::default(),
            log: Log::default(),
            publisher,
        })
    }

    /// A body of a source was measured at `moment_us`, before the trackers' latency.
    pub(super) fn pose(
        &mut self,
        source: &Source,
        body: u32,
        moment_us: i64,
        now_us: i64,
        raw: &RawPose,
    ) {
        for tracker in &mut self.trackers {
            if tracker.body != body || tracker.source != *source {
                continue;
            }
            tracker.measurements = tracker.measurements.saturating_add(1);
            let measured_us = moment_us.saturating_sub(tracker.latency_us);
            if let Some(event) = tracker.head.measure(measured_us, raw) {
                self.log.record(now_us, &tracker.name, What::Head(event));
            }
        }
    }

    /// Changes a device; one that is new only while there is room.
    pub(super) fn device(&mut self, name: &str, now_us: i64, change: impl FnOnce(&mut Device)) {
        let devices = Arc::make_mut(&mut self.devices);
        if !devices.contains_key(name) {
            if devices.len() >= MOST_DEVICES {
                return;
            }
            devices.insert(name.into(), Device::default());
        }
        if let Some(device) = devices.get_mut(name) {
            change(device);
            device.at_us = now_us;
        }
    }

    /// Something happened to a source.
    pub(super) fn record(&mut self, now_us: i64, source: &Arc<str>, what: What) {
        if self.log.record(now_us, source, what) {
            self.publish(now_us);
        }
    }

    /// Lets time go on, and publishes what it changed.
    pub(super) fn advance(&mut self, now_us: i64) {
        let mut changed = false;
        for tracker in &mut self.trackers {
            // A measurement is as old as its latency when it arrives: that is no silence.
            let silent_until_us = now_us.saturating_sub(tracker.latency_us);
            if let Some(event) = tracker.head.advance(silent_until_us) {
                self.log.record(now_us, &tracker.name, What::Head(event));
                changed |= matches!(tracker.head.state(), HeadState::Lost { .. });
            }
        }
        if changed {
            self.publish(now_us);
        }
    }

    /// Shows everything to readers.
    pub(super) fn publish(&self, now_us: i64) {
        let heads = self.trackers.iter().map(|tracker| HeadReport {
            tracker: Arc::clone(&tracker.name),
            state: tracker.head.state(),
            motion: tracker.head.motion(),
            measurements: tracker.measurements,
        });
        // Made before it is swapped in: a reader is held up by one pointer at most.
        let snapshot = Arc::new(Snapshot {
            at_us: now_us,
            heads: heads.collect(),
            devices: Arc::clone(&self.devices),
            events: self.log.events(),
        });
        self.publisher.send_replace(snapshot);
    }
}
