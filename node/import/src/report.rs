//! What an import has done and what it cost.
//! In: counts while it runs. Out: a report that is written as JSON. It measures the whole process.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::source::Source;

/// The result of an import.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImportReport {
    /// The repository's directory.
    pub into: PathBuf,
    /// Levels that sources were imported at, the coarsest first.
    pub levels: Vec<u8>,
    /// Tiles written or replaced, all levels together.
    pub tiles: u64,
    /// The same by level.
    pub tiles_by_level: BTreeMap<u8, u64>,
    /// Bytes of these tiles' files.
    pub bytes: u64,
    /// Sources, those in archives counted one by one.
    pub sources: usize,
    /// Samples of all sources (pixels, not channels), in millions.
    pub source_megapixels: f64,
    /// `bytes` by the number of source samples (pixels).
    pub bytes_per_source_sample: f64,
    /// Processor seconds of the process during the import; absent where the system does not tell.
    pub cpu_s: Option<f64>,
    /// Processor seconds a million source samples.
    pub cpu_s_per_megapixel: Option<f64>,
    /// Seconds from begin to end.
    pub wall_s: f64,
    /// True where tiles of an earlier, unfinished run were used.
    pub resumed: bool,
}

impl ImportReport {
    pub(crate) fn new(into: &Path, sources: &[Source], resumed: bool) -> Self {
        let samples: u64 = sources.iter().map(Source::sample_count).sum();
        Self {
            into: into.to_owned(),
            levels: Vec::new(),
            tiles: 0,
            tiles_by_level: BTreeMap::new(),
            bytes: 0,
            sources: sources.len(),
            source_megapixels: samples as f64 / 1e6,
            bytes_per_source_sample: 0.0,
            cpu_s: None,
            cpu_s_per_megapixel: None,
            wall_s: 0.0,
            resumed,
        }
    }

    pub(crate) fn count(&mut self, level: u8, bytes: u64) {
        self.tiles += 1;
        self.bytes += bytes;
        *self.tiles_by_level.entry(level).or_default() += 1;
    }

    pub(crate) fn levels_done(&mut self, level: u8) {
        if self.levels.last() != Some(&level) {
            self.levels.push(level);
        }
    }

    pub(crate) fn close(&mut self) {
        self.bytes_per_source_sample = self.bytes as f64 / (self.source_megapixels * 1e6).max(1.0);
    }

    pub(crate) fn measured(&mut self, wall_s: f64, cpu_s: Option<f64>) {
        self.wall_s = wall_s;
        self.cpu_s = cpu_s;
        self.cpu_s_per_megapixel = cpu_s.map(|cpu_s| cpu_s / self.source_megapixels.max(1e-6));
    }
}

/// Processor time of this process since it was started.
pub(crate) struct Stopwatch {
    at_start_s: Option<f64>,
}

impl Stopwatch {
    pub(crate) fn start() -> Self {
        Self {
            at_start_s: process_cpu_s(),
        }
    }

    pub(crate) fn cpu_s(&self) -> Option<f64> {
        Some(process_cpu_s()? - self.at_start_s?)
    }
}

/// User and system time of the process, from Linux's /proc (proc(5): fields 14 and 15, hundredths of a second).
fn process_cpu_s() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The second field is a name in brackets that may hold anything.
    let (_, rest) = text.rsplit_once(')')?;
    let mut fields = rest.split_whitespace().skip(11);
    let user: f64 = fields.next()?.parse().ok()?;
    let system: f64 = fields.next()?.parse().ok()?;
    Some((user + system) / 100.0)
}
