//! `terrawall inspect DIR|TILE`: what is in a repository or a tile, and single values.
//!
//! In: a path, and perhaps a position. Out: a summary, or the value there. It reads files and nothing else, so that
//! anyone can hold an import against its source.

use std::path::Path;

use import::inspect::{
    InspectError, Summary, TileSummary, ValueAt, inspect_repository, inspect_tile, value_at,
};
use serde_json::json;

use crate::args::{Inspect, Position};
use crate::failure::Failure;
use crate::output;

/// Inspects.
pub(crate) fn run(args: &Inspect) -> Result<(), Failure> {
    if let Some(position) = args.at {
        return value(args, position);
    }
    if args.path.is_file() {
        let tile = inspect_tile(&args.path)?;
        return if args.json {
            output::json(&tile)
        } else {
            print_tile(&tile)
        };
    }
    let summary = inspect_repository(&args.path, &progress())?;
    if args.json {
        output::json(&summary)?;
    } else {
        print_summary(&args.path, &summary)?;
    }
    let Some(first) = summary.broken.first() else {
        return Ok(());
    };
    Err(Failure::failed(format!(
        "{} of {} tiles of {} are broken; the first is {}: {}. Import the sources again to replace them.",
        summary.broken.len(),
        summary.tiles,
        args.path.display(),
        first.path.display(),
        first.problem
    )))
}

/// The value at a position. Where there is no tile there is no value, and that is an answer.
fn value(args: &Inspect, position: Position) -> Result<(), Failure> {
    match value_at(
        &args.path,
        position.latitude_deg,
        position.longitude_deg,
        args.level,
    ) {
        Ok(found) if args.json => output::json(&found),
        Ok(found) => print_value(&found),
        Err(InspectError::NoTile { .. }) if args.json => output::json(
            &json!({ "value": null, "valid": false, "tile": null, "level": args.level }),
        ),
        Err(error @ InspectError::NoTile { .. }) => output::line(error),
        Err(error) => Err(error.into()),
    }
}

fn print_value(found: &ValueAt) -> Result<(), Failure> {
    let value = match found.value.as_slice() {
        [] => "no data".to_owned(),
        [value] => value.to_string(),
        values => values
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(" "),
    };
    output::line(format!(
        "{value} (tile {}, level {})",
        found.tile, found.level
    ))
}

fn print_tile(tile: &TileSummary) -> Result<(), Failure> {
    output::line(format!(
        "tile {}: {:?}, {} × {:?}, {} bytes, {} valid nodes, samples from {} to {}",
        tile.tile,
        tile.kind,
        tile.channels,
        tile.sample_type,
        tile.bytes,
        tile.valid_nodes,
        tile.statistics.lowest,
        tile.statistics.highest
    ))
}

fn print_summary(path: &Path, summary: &Summary) -> Result<(), Failure> {
    let dataset = &summary.dataset;
    let range = match (summary.lowest, summary.highest) {
        (Some(lowest), Some(highest)) => format!("samples from {lowest} to {highest}"),
        _ => "no valid sample".to_owned(),
    };
    output::line(format!(
        "{}: \"{}\", {:?}, {} × {:?}, revision {}, {range}",
        path.display(),
        dataset.name,
        dataset.kind,
        dataset.channels,
        dataset.sample_type,
        dataset.revision
    ))?;
    for source in &dataset.sources {
        output::line(format!("  from {}: {}", source.file, source.description))?;
    }
    let level = |level: u8, tiles: u64, bytes: u64| {
        vec![
            format!("  {level}"),
            tiles.to_string(),
            format!("{:.2}", bytes as f64 / 1e6),
        ]
    };
    let mut rows: Vec<Vec<String>> = summary
        .levels
        .iter()
        .map(|found| level(found.level, found.tiles, found.bytes))
        .collect();
    rows.push(vec![
        "  all".to_owned(),
        summary.tiles.to_string(),
        format!("{:.2}", summary.bytes as f64 / 1e6),
    ]);
    output::table(&["  level", "tiles", "MB"], &rows)?;
    for broken in &summary.broken {
        output::line(format!(
            "  broken: {} ({}): {}",
            broken.tile,
            broken.path.display(),
            broken.problem
        ))?;
    }
    if summary.unindexed > 0 {
        output::line(format!(
            "  {} tiles are not in the index: an import is at work or was stopped",
            summary.unindexed
        ))?;
    }
    if let Some(problem) = &summary.index_problem {
        output::line(format!("  no index: {problem}"))?;
    }
    if summary.broken.is_empty() {
        output::line("  all checksums hold")?;
    }
    Ok(())
}

/// A bar on standard error, fed from any thread.
fn progress() -> impl Fn(u64, u64) + Sync {
    let bar = indicatif::ProgressBar::new(0);
    move |done, of| {
        bar.set_length(of);
        bar.set_position(done);
        if done == of {
            bar.finish_and_clear();
        }
    }
}
