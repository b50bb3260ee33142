//! `terrawall bench process`: how fast raw tiles become heights and colours on the local adapter.
//!
//! In: nothing but the adapter. Out: tiles a second of every stage, and how many copies of the same bytes fit into the
//! time of one. No network and no data take part.

use node::{PictureMaker as _, WallPictureMaker};
use serde::Serialize;

use crate::args::BenchProcess;
use crate::failure::Failure;
use crate::output;

/// What was measured.
#[derive(Debug, Serialize)]
pub(crate) struct Figures {
    adapter: String,
    stages: Vec<StageFigures>,
}

/// One stage.
#[derive(Debug, Serialize)]
struct StageFigures {
    name: String,
    tiles_per_second: f64,
    /// Read and written for one tile of 275×275 words.
    bytes: u64,
    /// Time of a tile over the time of copying as many bytes, half of them read and half written.
    times_a_copy: f64,
    /// The first tile, compilation included, in milliseconds.
    first_ms: f64,
}

/// Runs the bench and prints its table.
pub(crate) fn run(args: &BenchProcess) -> Result<(), Failure> {
    let figures = measure()?;
    if let Some(report) = &args.report {
        output::json_file(report, &figures)?;
    }
    if args.json {
        output::json(&figures)
    } else {
        print(&figures)
    }
}

/// Measures every stage.
pub(crate) fn measure() -> Result<Figures, Failure> {
    let maker = WallPictureMaker::open(None)?;
    let timings = maker.time_stages()?;
    // The last one is the copy.
    let copied = timings.last().map_or(f64::INFINITY, |copy| {
        copy.tiles_per_second * copy.bytes as f64
    });
    let stages = timings.into_iter().map(|timing| StageFigures {
        times_a_copy: copied / (timing.tiles_per_second * timing.bytes as f64),
        name: timing.name,
        tiles_per_second: timing.tiles_per_second,
        bytes: timing.bytes,
        first_ms: timing.first.as_secs_f64() * 1e3,
    });
    Ok(Figures {
        adapter: maker.adapter(),
        stages: stages.collect(),
    })
}

/// Prints figures as a table.
pub(crate) fn print(figures: &Figures) -> Result<(), Failure> {
    let rows: Vec<Vec<String>> = figures
        .stages
        .iter()
        .map(|stage| {
            vec![
                stage.name.clone(),
                format!("{:.0}", stage.tiles_per_second),
                format!("{:.2}", 1e3 / stage.tiles_per_second),
                format!("{:.2}", stage.bytes as f64 / 1e6),
                format!("{:.1}", stage.times_a_copy),
                format!("{:.0}", stage.first_ms),
            ]
        })
        .collect();
    let head = [
        "stage", "tiles/s", "ms/tile", "MB/tile", "× copy", "first ms",
    ];
    output::table(&head, &rows)?;
    output::line(format!("on {}", figures.adapter))
}
