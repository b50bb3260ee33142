//! `terrawall bench`: this build on this machine, in figures that can be held against others'.
//!
//! In: which bench. Out: tables on standard output, JSON where asked for, and with `all` plots as SVG. Absolute
//! times on shared machines mean little: look at ratios that were measured side by side.

use std::path::Path;

use protocol::report::Report;
use protocol::{Scene, Wall};

use crate::args::{Bench, BenchAll, BenchRefine, BenchSync, Size};
use crate::failure::{Failure, OrConfiguration as _};
use crate::output;
use crate::plot::{Plot, Series};

use super::{
    bench_cache, bench_frame, bench_import, bench_process, bench_refine, bench_starts, files,
    local, synthetic,
};

/// Runs a bench.
pub(crate) fn run(bench: Bench) -> Result<(), Failure> {
    match bench {
        Bench::Sync(args) => sync(&args),
        Bench::Starts(args) => bench_starts::run(&args),
        Bench::Frame(args) => bench_frame::run(&args),
        Bench::Process(args) => bench_process::run(&args),
        Bench::Refine(args) => bench_refine::run(args),
        Bench::Import(args) => bench_import::run(&args),
        Bench::Cache(args) => bench_cache::run(&args),
        Bench::All(args) => all(&args),
    }
}

fn sync(args: &BenchSync) -> Result<(), Failure> {
    let report = measure_sync(args)?;
    if let Some(path) = &args.report {
        output::json_file(path, &report)?;
    }
    if args.json {
        output::json(&report)
    } else {
        print_sync(&[report])
    }
}

/// Runs a row of nodes and returns the wall's own report.
fn measure_sync(args: &BenchSync) -> Result<Report, Failure> {
    let size = [args.size.width, args.size.height];
    let wall = synthetic::wall_text(args.nodes, size, args.fps);
    let mut wall = Wall::parse(&wall, "--nodes, --size").or_configuration()?;
    wall.name = format!("{} nodes of {}×{}", args.nodes, size[0], size[1]);
    let scene = match &args.scene {
        Some(path) => files::scene(path)?,
        None => Scene::parse(synthetic::SCENE, "the scene of the bench")?,
    };
    let frames = (args.fps * args.seconds).ceil() as u64;
    let run = local::Run {
        headless: true,
        fps: Some(args.fps),
        frames: Some(frames),
        capture: false,
        measure_error: true,
        digests: None,
    };
    let shown = local::run(&wall, &scene, run, None)?;
    match shown.lost {
        _ if shown.outcome.stopped => Err(Failure::failed("interrupted")),
        Some(lost) => Err(Failure::failed(lost)),
        None => Ok(shown.outcome.report),
    }
}

fn print_sync(reports: &[Report]) -> Result<(), Failure> {
    let milliseconds = |microseconds: f64| format!("{:.3}", microseconds / 1e3);
    let rows: Vec<Vec<String>> = reports
        .iter()
        .map(|report| {
            vec![
                report.wall.clone(),
                report.frames.to_string(),
                format!("{:.1}", report.fps),
                milliseconds(report.skew_us.p50),
                milliseconds(report.skew_us.p99),
                milliseconds(report.skew_us.max),
                milliseconds(report.state_latency_us.p50),
                milliseconds(report.state_latency_us.p99),
                report.view_bytes.max.to_string(),
                report
                    .nodes
                    .iter()
                    .map(|node| node.missed_deadlines)
                    .sum::<u64>()
                    .to_string(),
            ]
        })
        .collect();
    let head = [
        "wall",
        "frames",
        "fps",
        "skew p50 ms",
        "p99 ms",
        "max ms",
        "latency p50 ms",
        "p99 ms",
        "view bytes",
        "missed",
    ];
    output::table(&head, &rows)
}

fn all(args: &BenchAll) -> Result<(), Failure> {
    let out = &args.out;
    output::line("Swap skew and state latency, node processes on this machine")?;
    let mut reports = Vec::new();
    // Four nodes share a machine's cores: at the second rate a software driver keeps up on two of them.
    for (nodes, size, fps, name) in [
        (
            8,
            Size {
                width: 96,
                height: 54,
            },
            60.0,
            "sync-8x96x54",
        ),
        (
            4,
            Size {
                width: 640,
                height: 360,
            },
            10.0,
            "sync-4x640x360",
        ),
    ] {
        let sync = BenchSync {
            nodes,
            size,
            fps,
            seconds: 30.0,
            scene: None,
            report: None,
            json: false,
        };
        let report = measure_sync(&sync)?;
        output::json_file(&out.join(format!("{name}.json")), &report)?;
        plot_sync(&out.join(format!("{name}.svg")), &report)?;
        reports.push(report);
    }
    print_sync(&reports)?;

    output::line("\nCold starts")?;
    let starts = bench_starts::measure(8, 100)?;
    output::json_file(&out.join("starts.json"), &starts)?;
    bench_starts::print(&starts)?;

    output::line("\nFrames of 1280×720 with elevation and imagery")?;
    let frames = bench_frame::measure(Path::new("out/data"), 60)?;
    output::json_file(&out.join("frame.json"), &frames)?;
    output::file(
        &out.join("frame.svg"),
        bench_frame::plot(&frames).svg().as_bytes(),
    )?;
    bench_frame::print(&frames)?;

    output::line("\nProcessing stages")?;
    let stages = bench_process::measure()?;
    output::json_file(&out.join("process.json"), &stages)?;
    bench_process::print(&stages)?;

    output::line("\nRefined meshes")?;
    let short = BenchRefine::short("out/data".into(), out.clone());
    let refinement = bench_refine::measure(&short)?;
    bench_refine::write(&short.out, &refinement)?;
    bench_refine::print(&refinement)?;

    output::line("\nImports")?;
    let imports = bench_import::measure(Path::new("tests/data"))?;
    output::json_file(&out.join("import.json"), &imports)?;
    bench_import::print(&imports)?;

    output::line("\nOne cache for a cluster")?;
    let cache = bench_cache::measure(Path::new("out/data"), 8, 10.0)?;
    output::json_file(&out.join("cache.json"), &cache)?;
    bench_cache::print(&cache)?;

    output::line(format!("\nReports and plots are in {}", out.display()))?;
    cache.verdict()
}

/// Skew and frame times over frames.
fn plot_sync(path: &Path, report: &Report) -> Result<(), Failure> {
    let series = &report.series;
    let line = |name: &str, values: &[f32], scale: f64| Series {
        name: name.to_owned(),
        points: values
            .iter()
            .enumerate()
            .map(|(index, value)| {
                (
                    (index as u64 * series.stride) as f64,
                    f64::from(*value) * scale,
                )
            })
            .collect(),
    };
    let plot = Plot {
        title: format!(
            "{}: {:.1} frames a second, skew p99 {:.2} ms",
            report.wall,
            report.fps,
            report.skew_us.p99 / 1e3
        ),
        x_label: "frame".to_owned(),
        y_label: "ms".to_owned(),
        series: vec![
            line("from frame to frame", &series.frame_ms, 1.0),
            line("skew of the nodes", &series.skew_us, 1e-3),
        ],
    };
    output::file(path, plot.svg().as_bytes())
}
