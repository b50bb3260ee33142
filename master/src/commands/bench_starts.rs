//! `terrawall bench starts`: does every cold start of a wall give a complete wall?
//!
//! In: how many nodes, how often. Out: complete walls, and how long a start takes. Each start is a whole
//! `terrawall up` as an operator would type it: new identity, new processes, one captured picture.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::Context as _;
use serde::Serialize;

use crate::args::BenchStarts;
use crate::failure::Failure;
use crate::{interrupt, output};

use super::synthetic;

/// Pixels of each node.
const SIZE: [u32; 2] = [96, 54];

/// What was measured.
#[derive(Debug, Serialize)]
pub(crate) struct Figures {
    nodes: u32,
    runs: u32,
    /// Runs whose picture shows every node and had converged.
    complete: u32,
    /// From the command to its end, capture included.
    start_s: Quantiles,
    /// What went wrong in the runs that were not complete.
    failures: Vec<String>,
}

/// Spread of a figure.
#[derive(Debug, Serialize)]
struct Quantiles {
    p50: f64,
    p99: f64,
    max: f64,
}

/// Runs the bench and prints its table.
pub(crate) fn run(args: &BenchStarts) -> Result<(), Failure> {
    let figures = measure(args.nodes, args.runs)?;
    if let Some(report) = &args.report {
        output::json_file(report, &figures)?;
    }
    if args.json {
        output::json(&figures)?;
    } else {
        print(&figures)?;
    }
    if figures.complete == figures.runs {
        return Ok(());
    }
    let first = figures.failures.first().map_or("", String::as_str);
    Err(Failure::failed(format!(
        "{} of {} starts gave no complete wall; the first: {first}",
        figures.runs - figures.complete,
        figures.runs
    )))
}

/// Prints figures as a table.
pub(crate) fn print(figures: &Figures) -> Result<(), Failure> {
    let row = vec![
        format!("{} nodes", figures.nodes),
        figures.runs.to_string(),
        figures.complete.to_string(),
        format!("{:.2}", figures.start_s.p50),
        format!("{:.2}", figures.start_s.p99),
        format!("{:.2}", figures.start_s.max),
    ];
    output::table(
        &["cold starts", "runs", "complete", "p50 s", "p99 s", "max s"],
        &[row],
    )
}

/// Starts a wall `runs` times, one after the other.
pub(crate) fn measure(nodes: u32, runs: u32) -> Result<Figures, Failure> {
    let program = std::env::current_exe().context("cannot find this program")?;
    let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
    let folder = folder.path();
    output::file(
        &folder.join("wall.toml"),
        synthetic::wall_text(nodes, SIZE, 60.0).as_bytes(),
    )?;
    output::file(&folder.join("scene.toml"), synthetic::SCENE.as_bytes())?;
    let bar = indicatif::ProgressBar::new(u64::from(runs));
    let mut seconds = Vec::new();
    let mut failures = Vec::new();
    for run in 1..=runs {
        let start = Instant::now();
        let result = start_once(&program, folder, nodes);
        seconds.push(start.elapsed().as_secs_f64());
        if interrupt::requested() {
            return Err(Failure::failed("interrupted"));
        }
        failures.extend(result.err().map(|failure| format!("run {run}: {failure}")));
        bar.inc(1);
    }
    bar.finish_and_clear();
    seconds.sort_by(f64::total_cmp);
    let quantile = |share: f64| {
        let index = ((seconds.len() as f64 * share).ceil() as usize).max(1) - 1;
        seconds.get(index).copied().unwrap_or(f64::NAN)
    };
    let failed = u32::try_from(failures.len()).unwrap_or(runs);
    let start_s = Quantiles {
        p50: quantile(0.5),
        p99: quantile(0.99),
        max: quantile(1.0),
    };
    Ok(Figures {
        nodes,
        runs,
        complete: runs - failed,
        start_s,
        failures,
    })
}

/// One start. An error says what was not complete.
fn start_once(program: &Path, folder: &Path, nodes: u32) -> Result<(), Failure> {
    let (shot, report) = (folder.join("shot"), folder.join("report.json"));
    // What an earlier run left must not pass for this one's.
    let _ = std::fs::remove_dir_all(&shot);
    let _ = std::fs::remove_file(&report);
    let ended = Command::new(program)
        .arg("up")
        .arg(folder.join("wall.toml"))
        .arg("--scene")
        .arg(folder.join("scene.toml"))
        .args(["--headless", "--frames", "1", "--no-error", "--capture"])
        .arg(&shot)
        .arg("--report")
        .arg(&report)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .output()
        .context("cannot start terrawall up")?;
    if !ended.status.success() {
        let words = String::from_utf8_lossy(&ended.stderr)
            .trim()
            .replace('\n', " ");
        return Err(Failure::failed(format!("{}: {words}", ended.status)));
    }
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(&report)?)?;
    let took_part =
        |node: &&serde_json::Value| node["frames"].as_u64().is_some_and(|frames| frames > 0);
    let joined = report["nodes"]
        .as_array()
        .map_or(0, |nodes| nodes.iter().filter(took_part).count());
    if joined != nodes as usize || report["converged"] != true || !shot.join("wall.png").is_file() {
        return Err(Failure::failed(format!(
            "{joined} of {nodes} nodes took part, converged: {}",
            report["converged"]
        )));
    }
    Ok(())
}
