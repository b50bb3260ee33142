//! `terrawall bench cache`: nodes with cold caches on one shared directory fly a path, twice.
//!
//! In: the imported data, how many nodes. Out: how often the repository was read beside how many different tiles came
//! to any node, how long tiles took to be drawable by where they were found, and what plain files on the same disk
//! give beside the cache. Any tile that is read from the repository twice is a failure. No two flights want exactly the
//! same: what is loaded ahead, and what leaves the view before it comes, depends on when it comes. So the second flight is
//! held to what the first one left on the disk.

use std::path::Path;

use anyhow::Context as _;
use protocol::report::{QuantilesAndMax, Report, TileReport};
use protocol::{Scene, Wall};
use serde::Serialize;

use crate::args::BenchCache;
use crate::failure::{Failure, OrConfiguration as _};
use crate::output;

use super::{local, synthetic};

/// From space into the Alps, along them, out again and around the Earth: a minute.
const SCENE: &str = "\
[camera]
mode = \"path\"
looped = false
keyframes = [
    { time_s = 0, place = { latitude_deg = 30, longitude_deg = 0, altitude_m = 1.2e7, pitch_deg = -90 } },
    { time_s = 10, place = { latitude_deg = 44, longitude_deg = 4, altitude_m = 1.5e6, pitch_deg = -80 } },
    { time_s = 18, place = { latitude_deg = 45.6, longitude_deg = 6.0, altitude_m = 6e4, heading_deg = 60, pitch_deg = -35 } },
    { time_s = 30, place = { latitude_deg = 46.4, longitude_deg = 8.6, altitude_m = 3e4, heading_deg = 75, pitch_deg = -25 } },
    { time_s = 38, place = { latitude_deg = 40, longitude_deg = 15, altitude_m = 2e6, heading_deg = 120, pitch_deg = -70 } },
    { time_s = 50, place = { latitude_deg = -10, longitude_deg = 70, altitude_m = 4e6, heading_deg = 90, pitch_deg = -80 } },
    { time_s = 60, place = { latitude_deg = -30, longitude_deg = 140, altitude_m = 3e6, heading_deg = 90, pitch_deg = -85 } },
]

[layers.relief]
kind = \"elevation\"
repository = \"elevation\"

[layers.colour]
kind = \"imagery\"
repository = \"imagery\"
";
/// Seconds of the path.
const SECONDS: f64 = 60.0;
const WIDTH_PX: u32 = 96;
const HEIGHT_PX: u32 = 54;

/// What was measured.
#[derive(Debug, Serialize)]
pub(crate) struct Figures {
    nodes: u32,
    /// With nothing in any cache, then with what that run left on the disk.
    runs: Vec<RunFigures>,
    disk: node::DiskRate,
}

#[derive(Debug, Serialize)]
struct RunFigures {
    name: String,
    frames: u64,
    fps: f64,
    missed_deadlines: u64,
    /// Tiles that no flight before had brought into the cache.
    new_tiles: u64,
    /// Reads from the repository beyond one for each new tile.
    read_again: u64,
    tiles: TileReport,
}

/// Runs the bench and prints its tables.
pub(crate) fn run(args: &BenchCache) -> Result<(), Failure> {
    let figures = measure(&args.data, args.nodes, args.fps)?;
    if let Some(report) = &args.report {
        output::json_file(report, &figures)?;
    }
    if args.json {
        output::json(&figures)?;
    } else {
        print(&figures)?;
    }
    figures.verdict()
}

/// Flies the path with cold caches, then with a warm one.
pub(crate) fn measure(data: &Path, nodes: u32, fps: f64) -> Result<Figures, Failure> {
    let data = std::path::absolute(data)
        .with_context(|| format!("--data {}", data.display()))
        .or_configuration()?;
    let scene = Scene::parse(SCENE, "the scene of the bench")?.resolve(&data)?;
    let cache = tempfile::Builder::new()
        .prefix("terrawall-cache-")
        .tempdir()
        .context("cannot make a temporary folder for the cache")?;
    let text = synthetic::wall_text(nodes, [WIDTH_PX, HEIGHT_PX], fps);
    let mut wall = Wall::parse(&text, "--nodes, --fps").or_configuration()?;
    wall.name = format!("{nodes} nodes of {WIDTH_PX}×{HEIGHT_PX}");
    wall.cache.directory = Some(cache.path().to_string_lossy().into_owned());
    let mut runs = Vec::new();
    let mut known = 0;
    for name in ["cold", "warm"] {
        let report = fly(&wall, &scene, fps)?;
        let now = node::count_on_disk(cache.path()).context("cannot read the cache")?;
        runs.push(RunFigures::of(name, report, now.saturating_sub(known))?);
        known = now;
    }
    let disk = node::measure_disk(
        cache.path(),
        &[data.join("elevation"), data.join("imagery")],
    )
    .map_err(Failure::failed)?;
    Ok(Figures { nodes, runs, disk })
}

fn fly(wall: &Wall, scene: &Scene, fps: f64) -> Result<Report, Failure> {
    let run = local::Run {
        headless: true,
        fps: Some(fps),
        frames: Some((fps * SECONDS).ceil() as u64),
        capture: false,
        measure_error: false,
        digests: None,
    };
    let shown = local::run(wall, scene, run, None)?;
    match shown.lost {
        _ if shown.outcome.stopped => Err(Failure::failed("interrupted")),
        Some(lost) => Err(Failure::failed(lost)),
        None => Ok(shown.outcome.report),
    }
}

impl RunFigures {
    fn of(name: &str, report: Report, new_tiles: u64) -> Result<Self, Failure> {
        let reads = report.tiles.repository_reads;
        // What came into the cache came from the repository.
        let read_again = reads.checked_sub(new_tiles).ok_or_else(|| {
            Failure::failed(format!(
                "{name} run: {new_tiles} tiles came into the cache after {reads} reads"
            ))
        })?;
        Ok(Self {
            name: name.to_owned(),
            new_tiles,
            read_again,
            frames: report.frames,
            fps: report.fps,
            missed_deadlines: report.missed_deadlines,
            tiles: report.tiles,
        })
    }
}

impl Figures {
    /// The repository is read once for each tile in the cold run, and for none that it left in the warm one.
    pub(crate) fn verdict(&self) -> Result<(), Failure> {
        let failure = |run: &RunFigures, what: &str| {
            let (reads, distinct) = (run.tiles.repository_reads, run.tiles.distinct);
            Err(Failure::failed(format!(
                "{} run: {what}: {reads} reads from the repository, {} new tiles, {distinct} different ones at all nodes",
                run.name, run.new_tiles
            )))
        };
        for (index, run) in self.runs.iter().enumerate() {
            if run.read_again > 0 {
                return failure(run, "tiles were read again");
            }
            if index == 0 && run.tiles.repository_reads != run.tiles.distinct {
                return failure(run, "the cache was not cold, or tiles did not come");
            }
        }
        Ok(())
    }
}

/// Prints figures as tables.
pub(crate) fn print(figures: &Figures) -> Result<(), Failure> {
    let rows: Vec<Vec<String>> = figures
        .runs
        .iter()
        .map(|run| {
            let tiles = &run.tiles;
            vec![
                run.name.clone(),
                format!("{:.1}", run.fps),
                tiles.distinct.to_string(),
                tiles.repository_reads.to_string(),
                run.read_again.to_string(),
                tiles.disk_hits.to_string(),
                tiles.ram_hits.to_string(),
                format!("{:.1}", tiles.vain_bytes as f64 / 1e6),
                run.missed_deadlines.to_string(),
            ]
        })
        .collect();
    output::line(format!("{} nodes, one cache", figures.nodes))?;
    output::table(
        &[
            "run",
            "fps",
            "tiles",
            "read from repository",
            "of these again",
            "from disk",
            "from memory",
            "in vain MB",
            "missed",
        ],
        &rows,
    )?;
    let times = |times: &QuantilesAndMax| match times.max > 0.0 {
        true => format!("{:.0} / {:.0}", times.p50, times.p99),
        false => "none".to_owned(),
    };
    let rows: Vec<Vec<String>> = figures
        .runs
        .iter()
        .map(|run| {
            let after = &run.tiles.drawable_after_ms;
            vec![
                run.name.clone(),
                times(&after.repository),
                times(&after.disk),
                times(&after.ram),
            ]
        })
        .collect();
    output::line("From wanted to drawable, p50 / p99 ms, by where the tile was found")?;
    output::table(&["run", "repository", "disk", "memory"], &rows)?;
    let disk = &figures.disk;
    output::line(format!(
        "Loading {} tiles from the disk cache: {:.0} MB/s, {:.0} % of {:.0} MB/s that plain sequential reads of the same files give",
        disk.tiles,
        disk.loaded_mb_per_s,
        disk.loaded_mb_per_s / disk.plain_mb_per_s * 100.0,
        disk.plain_mb_per_s
    ))
}
