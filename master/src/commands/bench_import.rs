//! `terrawall bench import`: CPU time and bytes of importing the embedded sources, beside gdal2tiles.
//!
//! In: a folder with `etopo5.tif` and `bmng.jpg`. Out: a table and JSON. Every import runs as a process of its
//! own, so that its CPU time is the kernel's figure. Ratios count: both programs run on the same machine in
//! the same minutes.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use serde::Serialize;

use crate::args::BenchImport;
use crate::failure::Failure;
use crate::{interrupt, output};

/// Kernel ticks a second in `/proc/PID/stat`: the same on every Linux that Rust supports.
const TICKS_PER_SECOND: f64 = 100.0;

/// One import.
#[derive(Debug, Serialize)]
pub(crate) struct Figures {
    /// Program and source.
    name: String,
    /// Source pixels, millions.
    megapixels: f64,
    /// Seconds on the clock.
    wall_s: f64,
    /// User and system seconds of the process and its children.
    cpu_s: f64,
    /// CPU seconds for each source megapixel.
    cpu_s_per_megapixel: f64,
    /// Bytes written for each source sample, all channels of a pixel being one sample each.
    bytes_per_sample: f64,
}

/// Runs the bench and prints its table.
pub(crate) fn run(args: &BenchImport) -> Result<(), Failure> {
    let figures = measure(&args.sources)?;
    if let Some(report) = &args.report {
        output::json_file(report, &figures)?;
    }
    if args.json {
        output::json(&figures)
    } else {
        print(&figures)
    }
}

/// Prints figures as a table.
pub(crate) fn print(figures: &[Figures]) -> Result<(), Failure> {
    let rows: Vec<Vec<String>> = figures
        .iter()
        .map(|f| {
            vec![
                f.name.clone(),
                format!("{:.2}", f.megapixels),
                format!("{:.2}", f.wall_s),
                format!("{:.2}", f.cpu_s),
                format!("{:.3}", f.cpu_s_per_megapixel),
                format!("{:.2}", f.bytes_per_sample),
            ]
        })
        .collect();
    output::table(
        &[
            "import",
            "MP",
            "wall s",
            "CPU s",
            "CPU s/MP",
            "bytes/sample",
        ],
        &rows,
    )
}

/// Imports each source once, and gives the imagery to gdal2tiles where it is installed.
pub(crate) fn measure(sources: &Path) -> Result<Vec<Figures>, Failure> {
    let terrawall = std::env::current_exe().context("cannot find this program")?;
    let scratch = tempfile::tempdir().context("cannot make a temporary folder")?;
    let scratch = scratch.path();
    let mut figures = Vec::new();
    for (file, kind, extent, megapixels, channels) in [
        ("etopo5.tif", "elevation", None, 4320.0 * 2161.0 / 1e6, 1.0),
        (
            "bmng.jpg",
            "imagery",
            Some("--extent=-180,-90,180,90"),
            5400.0 * 2700.0 / 1e6,
            3.0,
        ),
    ] {
        let source = sources.join(file);
        if !source.is_file() {
            return Err(Failure::configuration(format!(
                "{} is not there: --sources names the folder that holds it, tests/data in the repository",
                source.display()
            )));
        }
        let into = scratch.join(kind);
        let mut command = Command::new(&terrawall);
        command
            .arg("import")
            .arg(&source)
            .args(["--kind", kind])
            .args(extent)
            .arg("--into")
            .arg(&into);
        let (wall_s, cpu_s) = time(&mut command)?;
        let samples = megapixels * 1e6 * channels;
        figures.push(row(
            format!("terrawall {file}"),
            megapixels,
            (wall_s, cpu_s),
            bytes_in(&into) / samples,
        ));
    }
    let source = sources.join("bmng.jpg");
    let (referenced, tiles) = (scratch.join("bmng.vrt"), scratch.join("gdal2tiles"));
    let mut translate = Command::new("gdal_translate");
    translate.args([
        "-q",
        "-of",
        "VRT",
        "-a_srs",
        "EPSG:4326",
        "-a_ullr",
        "-180",
        "90",
        "180",
        "-90",
    ]);
    translate
        .arg(
            source
                .canonicalize()
                .context("cannot resolve the source's path")?,
        )
        .arg(&referenced);
    translate.stdout(Stdio::null()).stderr(Stdio::null());
    let mut rival = Command::new("gdal2tiles.py");
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    rival
        .args([
            "-q",
            "-w",
            "none",
            "-z",
            "0-4",
            "--processes",
            &cores.to_string(),
        ])
        .arg(&referenced)
        .arg(&tiles);
    let installed = translate.status().is_ok_and(|status| status.success());
    if installed && let Ok((wall_s, cpu_s)) = time(&mut rival) {
        let megapixels = 5400.0 * 2700.0 / 1e6;
        let bytes = bytes_in(&tiles) / (megapixels * 3e6);
        figures.push(row(
            "gdal2tiles bmng.jpg".to_owned(),
            megapixels,
            (wall_s, cpu_s),
            bytes,
        ));
    } else {
        eprintln!(
            "bench import: GDAL is not installed (gdal-bin, python3-gdal), so there is no rival to compare with"
        );
    }
    Ok(figures)
}

fn row(
    name: String,
    megapixels: f64,
    (wall_s, cpu_s): (f64, f64),
    bytes_per_sample: f64,
) -> Figures {
    Figures {
        name,
        megapixels,
        wall_s,
        cpu_s,
        cpu_s_per_megapixel: cpu_s / megapixels,
        bytes_per_sample,
    }
}

/// Runs a command; returns seconds on the clock and CPU seconds of it and the children it waited for.
fn time(command: &mut Command) -> Result<(f64, f64), Failure> {
    let name = command.get_program().to_string_lossy().into_owned();
    let start = Instant::now();
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .with_context(|| format!("cannot start {name}"))?;
    let stat = format!("/proc/{}/stat", child.id());
    // A child that has ended but is not yet reaped still shows its times.
    let (wall_s, cpu_s) = loop {
        let fields =
            std::fs::read_to_string(&stat).with_context(|| format!("cannot read {stat}"))?;
        let fields: Vec<&str> = fields
            .rsplit(')')
            .next()
            .unwrap_or_default()
            .split_whitespace()
            .collect();
        if fields.first() == Some(&"Z") {
            // Fields 14 to 17 of proc(5): utime, stime, cutime, cstime.
            let ticks: f64 = fields
                .iter()
                .skip(11)
                .take(4)
                .filter_map(|field| field.parse::<f64>().ok())
                .sum();
            break (start.elapsed().as_secs_f64(), ticks / TICKS_PER_SECOND);
        }
        if interrupt::requested() {
            let _ = child.kill();
            let _ = child.wait();
            return Err(Failure::failed("interrupted"));
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let status = child
        .wait()
        .with_context(|| format!("cannot wait for {name}"))?;
    if !status.success() {
        return Err(Failure::failed(format!(
            "{name} failed ({status}); run it by hand to see why"
        )));
    }
    Ok((wall_s, cpu_s))
}

/// Bytes of all files below a folder.
fn bytes_in(folder: &Path) -> f64 {
    let mut bytes = 0;
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            match entry.metadata() {
                Ok(metadata) if metadata.is_dir() => folders.push(entry.path()),
                Ok(metadata) => bytes += metadata.len(),
                Err(_) => {}
            }
        }
    }
    bytes as f64
}
