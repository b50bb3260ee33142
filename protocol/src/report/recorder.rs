//! Collects what a run measures, in bounded memory.
//! In: what nodes report, in any order and late. Out: a [`Report`].

use std::collections::{BTreeMap, HashSet};

use hdrhistogram::Histogram;

use super::{Max, NodeReport, Quantiles, QuantilesAndMax, Report, Series, TileReport};
use crate::barrier::NodeId;
use crate::membership::Membership;
use crate::message::{Presented, TileCounters};
use crate::wall::Wall;

/// Frames whose reports are still waited for.
const OPEN_FRAMES: usize = 256;
/// Values of a series before it is thinned out.
const SERIES_LENGTH: usize = 16_384;
/// Errors that are kept.
const MAX_ERRORS: usize = 100;
/// Tiles that are told apart.
const MAX_TILES: usize = 4_000_000;
/// Largest value of a histogram: ten minutes in microseconds.
const LONGEST_US: u64 = 600_000_000;

/// Collects the measurements of a run.
#[derive(Debug)]
pub struct Recorder {
    wall: String,
    nodes: Vec<NodeTally>,
    open: BTreeMap<u64, OpenFrame>,
    closed_below: u64,
    frames: u64,
    first_us: i64,
    previous_us: Option<i64>,
    frame_us: Tally,
    skew_us: Tally,
    latency_us: Tally,
    view_to_present_us: Tally,
    view_bytes: u64,
    scene_bytes: u64,
    clock_error_us: u64,
    tiles: HashSet<u64>,
    errors: Vec<String>,
    series: SeriesTally,
}

#[derive(Clone, Copy, Debug)]
struct OpenFrame {
    earliest_us: i64,
    latest_us: i64,
    reports: u32,
}

#[derive(Debug)]
struct NodeTally {
    draw_us: Tally,
    triangles: u64,
    counters: TileCounters,
    converged: bool,
    newest_frame: u64,
}

/// A histogram with three significant digits that takes no value above ten minutes.
#[derive(Debug)]
struct Tally(Option<Histogram<u32>>);

#[derive(Debug)]
struct SeriesTally {
    stride: u64,
    pending: u64,
    frame_ms: f32,
    skew_us: f32,
    series: Series,
}

impl Recorder {
    /// Nothing is measured yet.
    #[must_use]
    pub fn new(wall: &Wall) -> Self {
        let node = |_| NodeTally {
            draw_us: Tally::new(),
            triangles: 0,
            counters: TileCounters::default(),
            converged: false,
            newest_frame: 0,
        };
        Self {
            wall: wall.name.clone(),
            nodes: wall.hosts.iter().map(node).collect(),
            open: BTreeMap::new(),
            closed_below: 0,
            frames: 0,
            first_us: 0,
            previous_us: None,
            frame_us: Tally::new(),
            skew_us: Tally::new(),
            latency_us: Tally::new(),
            view_to_present_us: Tally::new(),
            view_bytes: 0,
            scene_bytes: 0,
            clock_error_us: 0,
            tiles: HashSet::new(),
            errors: Vec::new(),
            series: SeriesTally::new(),
        }
    }

    /// A view of this many bytes was sent.
    pub fn view(&mut self, bytes: usize) {
        self.view_bytes = self.view_bytes.max(bytes as u64);
    }

    /// A scene of this many bytes was sent.
    pub fn scene(&mut self, bytes: usize) {
        self.scene_bytes = bytes as u64;
    }

    /// A node presented a frame. Reports may come late and in any order; those for frames that are
    /// closed already count for the node alone.
    pub fn presented(&mut self, node: NodeId, presented: &Presented) {
        let Some(tally) = self.nodes.get_mut(node) else {
            return;
        };
        tally.draw_us.add(i64::from(presented.draw_us));
        tally.triangles = tally.triangles.max(presented.triangles);
        if presented.frame >= tally.newest_frame {
            tally.newest_frame = presented.frame;
            tally.converged = presented.converged;
        }
        self.latency_us.add(i64::from(presented.view_latency_us));
        self.view_to_present_us
            .add(i64::from(presented.view_to_present_us));
        self.clock_error_us = self.clock_error_us.max(u64::from(presented.clock_error_us));
        if presented.frame < self.closed_below {
            return;
        }
        let moment_us = presented.presented_us;
        let new = OpenFrame {
            earliest_us: moment_us,
            latest_us: moment_us,
            reports: 0,
        };
        let frame = self.open.entry(presented.frame).or_insert(new);
        frame.earliest_us = frame.earliest_us.min(moment_us);
        frame.latest_us = frame.latest_us.max(moment_us);
        frame.reports += 1;
        while self.open.len() > OPEN_FRAMES {
            self.close_oldest();
        }
    }

    /// What a node's tile caches have done since it started, and numbers of tiles it used since the
    /// last time.
    pub fn counters(&mut self, node: NodeId, counters: TileCounters, new_tiles: &[u64]) {
        if let Some(tally) = self.nodes.get_mut(node) {
            tally.counters = counters;
        }
        let room = MAX_TILES.saturating_sub(self.tiles.len());
        self.tiles.extend(new_tiles.iter().take(room));
    }

    /// Something went wrong.
    pub fn error(&mut self, message: impl Into<String>) {
        if self.errors.len() < MAX_ERRORS {
            self.errors.push(message.into());
        }
    }

    /// Forgets what was measured so far, but keeps what nodes have counted. For runs whose measurement
    /// begins once the wall is complete.
    pub fn restart(&mut self) {
        if let Some((newest, _)) = self.open.last_key_value() {
            self.closed_below = newest + 1;
        }
        self.open.clear();
        self.frames = 0;
        self.previous_us = None;
        self.frame_us = Tally::new();
        self.skew_us = Tally::new();
        self.latency_us = Tally::new();
        self.view_to_present_us = Tally::new();
        self.clock_error_us = 0;
        self.series = SeriesTally::new();
        for node in &mut self.nodes {
            node.draw_us = Tally::new();
            node.triangles = 0;
        }
    }

    /// The report so far, with what is known of the nodes. Closes all frames.
    pub fn report(&mut self, membership: &Membership) -> Report {
        while !self.open.is_empty() {
            self.close_oldest();
        }
        let span_us = self
            .previous_us
            .map_or(0, |last| last.saturating_sub(self.first_us));
        let fps = if self.frames > 1 && span_us > 0 {
            (self.frames - 1) as f64 * 1e6 / span_us as f64
        } else {
            0.0
        };
        let records = membership.nodes().iter().zip(&self.nodes);
        let nodes = records.map(|(record, tally)| NodeReport {
            name: record.name.clone(),
            adapter: record.adapter.clone(),
            frames: record.frames,
            missed_deadlines: record.missed_deadlines,
            joins: record.joins,
            join_ms: record.join_us.map(|microseconds| microseconds as f64 / 1e3),
            draw_ms: tally.draw_us.quantiles(1e-3),
            triangles: Max {
                max: tally.triangles,
            },
        });
        Report {
            wall: self.wall.clone(),
            frames: self.frames,
            fps,
            frame_ms: self.frame_us.quantiles(1e-3),
            skew_us: self.skew_us.quantiles_and_max(),
            view_bytes: Max {
                max: self.view_bytes,
            },
            scene_bytes: self.scene_bytes,
            state_latency_us: self.latency_us.quantiles(1.0),
            view_to_present_us: self.view_to_present_us.quantiles(1.0),
            clock_error_us: Max {
                max: self.clock_error_us,
            },
            tiles: self.tile_report(),
            converged: !self.nodes.is_empty() && self.nodes.iter().all(|node| node.converged),
            nodes: nodes.collect(),
            errors: self.errors.clone(),
            series: self.series.finish(),
        }
    }

    fn tile_report(&self) -> TileReport {
        let mut report = TileReport::default();
        for NodeTally { counters, .. } in &self.nodes {
            report.distinct = report.distinct.max(counters.distinct);
            report.repository_reads += counters.repository_reads;
            report.disk_hits += counters.disk_hits;
            report.ram_hits += counters.ram_hits;
            report.corrupt += counters.corrupt;
        }
        // Exact as long as the nodes name all their tiles; never less than one node's own count.
        report.distinct = report.distinct.max(self.tiles.len() as u64);
        report
    }

    fn close_oldest(&mut self) {
        let Some((number, frame)) = self.open.pop_first() else {
            return;
        };
        self.closed_below = number + 1;
        self.frames += 1;
        let skew_us = frame.latest_us.saturating_sub(frame.earliest_us);
        if frame.reports > 1 {
            self.skew_us.add(skew_us);
        }
        let frame_us = match self.previous_us {
            Some(previous_us) => frame.latest_us.saturating_sub(previous_us).max(0),
            None => {
                self.first_us = frame.latest_us;
                0
            }
        };
        if self.previous_us.is_some() {
            self.frame_us.add(frame_us);
            self.series.add(frame_us as f32 / 1e3, skew_us as f32);
        }
        self.previous_us = Some(frame.latest_us);
    }
}

impl Tally {
    fn new() -> Self {
        // These bounds are always valid; a histogram that cannot be made measures nothing.
        Self(Histogram::new_with_bounds(1, LONGEST_US, 3).ok())
    }

    /// Counts a value; below 0 (clock error) it counts as 0.
    fn add(&mut self, value: i64) {
        if let Some(histogram) = &mut self.0 {
            histogram.saturating_record(value.max(0).unsigned_abs());
        }
    }

    fn at(&self, quantile: f64) -> f64 {
        self.0.as_ref().map_or(0.0, |histogram| {
            histogram.value_at_quantile(quantile) as f64
        })
    }

    fn quantiles(&self, factor: f64) -> Quantiles {
        Quantiles {
            p50: self.at(0.5) * factor,
            p99: self.at(0.99) * factor,
        }
    }

    fn quantiles_and_max(&self) -> QuantilesAndMax {
        let max = self
            .0
            .as_ref()
            .map_or(0.0, |histogram| histogram.max() as f64);
        // A histogram rounds up within its precision; a quantile must not exceed the maximum.
        QuantilesAndMax {
            p50: self.at(0.5).min(max),
            p99: self.at(0.99).min(max),
            max,
        }
    }
}

impl SeriesTally {
    fn new() -> Self {
        Self {
            stride: 1,
            pending: 0,
            frame_ms: 0.0,
            skew_us: 0.0,
            series: Series::default(),
        }
    }

    fn add(&mut self, frame_ms: f32, skew_us: f32) {
        self.frame_ms = self.frame_ms.max(frame_ms);
        self.skew_us = self.skew_us.max(skew_us);
        self.pending += 1;
        if self.pending < self.stride {
            return;
        }
        self.push();
        if self.series.frame_ms.len() >= SERIES_LENGTH {
            self.stride *= 2;
            halve(&mut self.series.frame_ms);
            halve(&mut self.series.skew_us);
        }
    }

    fn push(&mut self) {
        self.series
            .frame_ms
            .push(std::mem::take(&mut self.frame_ms));
        self.series.skew_us.push(std::mem::take(&mut self.skew_us));
        self.pending = 0;
    }

    fn finish(&mut self) -> Series {
        if self.pending > 0 {
            self.push();
        }
        self.series.stride = self.stride;
        self.series.clone()
    }
}

/// Keeps the larger of each pair of values.
fn halve(values: &mut Vec<f32>) {
    *values = values
        .chunks(2)
        .map(|pair| pair.iter().copied().fold(0.0, f32::max))
        .collect();
}
