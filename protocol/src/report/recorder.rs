//! Collects what a run measures, in bounded memory.
//! In: what nodes report, in any order and late. Out: a [`Report`].

use std::collections::{BTreeMap, HashSet};

use super::changes::ChangeTally;
use super::tally::{SeriesTally, Tally};
use super::{DrawableAfter, ErrorReport, Max, NodeReport, Report, TileReport};
use crate::barrier::NodeId;
use crate::membership::Membership;
use crate::message::{CacheLevel, Drawable, ErrorMeasured, Presented, TileCounters, TileNews};
use crate::wall::Wall;

/// Frames whose reports are still waited for.
const OPEN_FRAMES: usize = 256;
/// Errors that are kept.
const MAX_ERRORS: usize = 100;
/// Tiles that are told apart.
const MAX_TILES: usize = 4_000_000;

/// Collects the measurements of a run.
#[derive(Debug)]
pub struct Recorder {
    wall: String,
    names: Vec<String>,
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
    /// Tiles that came into any node's main memory, and those that any showed.
    loaded: HashSet<u64>,
    shown: HashSet<u64>,
    /// From wanted to drawable, for tiles of the repository, the disk and the memory.
    drawable_us: [Tally; 3],
    errors: Vec<String>,
    series: SeriesTally,
    changes: ChangeTally,
    error_px: ErrorReport,
    achieved_tau_px: f64,
    achieved_tile_px: f64,
    refined_leaves: u64,
}

#[derive(Clone, Debug)]
struct OpenFrame {
    earliest_us: i64,
    latest_us: i64,
    /// Nothing was missing in any picture of it so far.
    converged: bool,
    /// Which nodes have presented it.
    presented_by: Vec<bool>,
}

#[derive(Debug)]
struct NodeTally {
    draw_us: Tally,
    triangles: u64,
    counters: TileCounters,
    converged: bool,
    first_frame: Option<u64>,
    newest_frame: u64,
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
            first_frame: None,
            newest_frame: 0,
        };
        Self {
            wall: wall.name.clone(),
            names: wall.hosts.iter().map(|host| host.name.clone()).collect(),
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
            loaded: HashSet::new(),
            shown: HashSet::new(),
            drawable_us: [Tally::new(), Tally::new(), Tally::new()],
            errors: Vec::new(),
            series: SeriesTally::new(),
            changes: ChangeTally::new(),
            error_px: ErrorReport::default(),
            achieved_tau_px: 0.0,
            achieved_tile_px: 0.0,
            refined_leaves: 0,
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
        self.achieved_tau_px = self.achieved_tau_px.max(presented.achieved_tau_px);
        self.achieved_tile_px = self.achieved_tile_px.max(presented.achieved_tile_px);
        self.refined_leaves = self
            .refined_leaves
            .saturating_add(u64::from(presented.refined_leaves));
        if presented.frame >= tally.newest_frame {
            tally.newest_frame = presented.frame;
            tally.converged = presented.converged;
        }
        let first_frame = tally.first_frame.unwrap_or(u64::MAX);
        tally.first_frame = Some(first_frame.min(presented.frame));
        self.latency_us.add(i64::from(presented.view_latency_us));
        self.view_to_present_us
            .add(i64::from(presented.view_to_present_us));
        self.clock_error_us = self.clock_error_us.max(u64::from(presented.clock_error_us));
        if presented.frame < self.closed_below {
            return;
        }
        let moment_us = presented.presented_us;
        let nodes = self.nodes.len();
        let frame = self
            .open
            .entry(presented.frame)
            .or_insert_with(|| OpenFrame {
                earliest_us: moment_us,
                latest_us: moment_us,
                converged: true,
                presented_by: vec![false; nodes],
            });
        frame.earliest_us = frame.earliest_us.min(moment_us);
        frame.latest_us = frame.latest_us.max(moment_us);
        frame.converged &= presented.converged;
        if let Some(presented_by) = frame.presented_by.get_mut(node) {
            *presented_by = true;
        }
        while self.open.len() > OPEN_FRAMES {
            self.close_oldest();
        }
    }

    /// What a node's tile caches have done since it started, and what happened since the last time.
    pub fn counters(&mut self, node: NodeId, counters: TileCounters, news: &TileNews) {
        if let Some(tally) = self.nodes.get_mut(node) {
            tally.counters = counters;
        }
        for (known, new) in [
            (&mut self.loaded, &news.loaded),
            (&mut self.shown, &news.used),
        ] {
            let room = MAX_TILES.saturating_sub(known.len());
            known.extend(new.iter().take(room));
        }
        for Drawable { level, after_us } in &news.drawable {
            let tally = match level {
                CacheLevel::Repository => &mut self.drawable_us[0],
                CacheLevel::Disk => &mut self.drawable_us[1],
                CacheLevel::Ram => &mut self.drawable_us[2],
            };
            tally.add(i64::from(*after_us));
        }
    }

    /// A change of the scene was accepted as this revision; `now_us` is on the master's clock.
    pub fn change_submitted(&mut self, revision: u64, now_us: i64) {
        self.changes.submitted(revision, now_us);
    }

    /// A revision was overtaken by a later one before any frame showed it. Like the two below, it counts only if the
    /// revision's submission was counted, so that the numbers of a report fit each other.
    pub fn change_superseded(&mut self, revision: u64) {
        self.changes.superseded(revision);
    }

    /// A node cannot show a revision, so no node does.
    pub fn change_refused(&mut self, revision: u64) {
        self.changes.refused(revision);
    }

    /// It was decided at `now_us`, on the master's clock, to show a revision from this frame on;
    /// `unprepared` members had not prepared it. When it was on all of the wall follows from
    /// [`Recorder::presented`].
    pub fn change_shown(&mut self, revision: u64, frame: u64, unprepared: usize, now_us: i64) {
        self.changes.shown(revision, frame, unprepared, now_us);
    }

    /// The pictures that stand are of a scene with this τ, in wall pixels; what nodes measure of them follows.
    pub fn tau(&mut self, tau: f64) {
        self.error_px = ErrorReport::new(tau);
    }

    /// A node has measured its picture.
    pub fn error_measured(&mut self, measured: &ErrorMeasured) {
        self.error_px.add(measured);
        self.achieved_tau_px = self.achieved_tau_px.max(measured.tau_px);
    }

    /// A node has not measured its picture.
    pub fn error_unmeasured(&mut self, node: NodeId, reason: &str) {
        let Some(name) = self.names.get(node).cloned() else {
            return;
        };
        self.error(format!(
            "the error of node \"{name}\" was not measured: {reason}"
        ));
        self.error_px.unmeasured.push(name);
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
            self.closed_below = newest.saturating_add(1);
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
        self.changes = ChangeTally::new();
        self.achieved_tau_px = 0.0;
        self.achieved_tile_px = 0.0;
        self.refined_leaves = 0;
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
            error_px: self.error_px.clone(),
            achieved_tau: (self.achieved_tau_px > 0.0).then_some(self.achieved_tau_px),
            achieved_tile_px: (self.achieved_tile_px > 0.0).then_some(self.achieved_tile_px),
            refined_leaves: self.refined_leaves,
            triangles: Max {
                max: self
                    .nodes
                    .iter()
                    .map(|node| node.triangles)
                    .max()
                    .unwrap_or(0),
            },
            converged: !self.nodes.is_empty() && self.nodes.iter().all(|node| node.converged),
            missed_deadlines: membership
                .nodes()
                .iter()
                .map(|node| node.missed_deadlines)
                .sum(),
            changes: self.changes.report(),
            trackers: Vec::new(),
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
            report.repository_bytes += counters.repository_bytes;
            report.failed += counters.failed;
            report.early_bytes += counters.early_bytes;
            report.vain_bytes += counters.vain_bytes;
        }
        // Exact as long as the nodes name all their tiles; never less than one node's own count.
        report.distinct = report.distinct.max(self.loaded.len() as u64);
        report.shown = self.shown.len() as u64;
        let [repository, disk, ram] = &self.drawable_us;
        report.drawable_after_ms = DrawableAfter {
            repository: repository.quantiles_and_max_times(1e-3),
            disk: disk.quantiles_and_max_times(1e-3),
            ram: ram.quantiles_and_max_times(1e-3),
        };
        report
    }

    fn close_oldest(&mut self) {
        let Some((number, frame)) = self.open.pop_first() else {
            return;
        };
        self.closed_below = number.saturating_add(1);
        self.frames += 1;
        if self.was_on_all_nodes(number, &frame) {
            self.changes
                .presented(number, frame.latest_us, frame.converged);
        }
        let skew_us = frame.latest_us.saturating_sub(frame.earliest_us);
        if frame.presented_by.iter().filter(|by| **by).count() > 1 {
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

    /// Whether every node presented a frame that is being closed. A node counts from its first frame on,
    /// and until it has been silent for as many frames as are kept open: then it is gone, and its last
    /// frame was before the one in question.
    fn was_on_all_nodes(&self, number: u64, frame: &OpenFrame) -> bool {
        let newest = self.nodes.iter().map(|node| node.newest_frame).max();
        let silent_below = newest.unwrap_or(0).saturating_sub(OPEN_FRAMES as u64);
        let mut nodes = self.nodes.iter().zip(&frame.presented_by);
        nodes.all(|(node, presented)| {
            let is_there = node.first_frame.is_some_and(|first| first <= number)
                && node.newest_frame >= silent_below;
            *presented || !is_there
        })
    }
}
