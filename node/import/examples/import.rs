//! The import without the rest of the program, for measuring and trying out.
//! In: `KIND INTO [key=value]… SOURCE…` with the keys extent, crs, level, bands, nodata, memory-mib, threads. Out: the
//! report on standard output. `terrawall import` is the command for people.

use std::sync::atomic::AtomicBool;

use geodesy::Ellipsoid;
use import::{Bar, Extent, ImportOptions, import};
use tiles::Kind;

fn numbers(text: &str) -> Result<Vec<f64>, std::num::ParseFloatError> {
    text.split(',').map(str::parse).collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let usage = "KIND INTO [key=value]… SOURCE…";
    let kind = match arguments.next().as_deref() {
        Some("elevation") => Kind::Elevation,
        Some("imagery") => Kind::Imagery,
        Some("sar") => Kind::Sar,
        _ => return Err(usage.into()),
    };
    let mut options = ImportOptions {
        sources: Vec::new(),
        into: arguments.next().ok_or(usage)?.into(),
        kind,
        extent: None,
        crs: None,
        node_registered: None,
        raw: None,
        nodata: None,
        level: None,
        planet: Ellipsoid::EARTH,
        quantum_m: None,
        name: None,
        bands: None,
        range: None,
        threads: None,
        memory_bytes: 512 << 20,
    };
    for argument in arguments {
        match argument.split_once('=') {
            Some(("extent", text)) => {
                let [west, south, east, north] = numbers(text)?[..] else {
                    return Err("extent=WEST,SOUTH,EAST,NORTH".into());
                };
                options.extent = Some(Extent {
                    west,
                    south,
                    east,
                    north,
                });
            }
            Some(("crs", text)) => options.crs = Some(text.to_owned()),
            Some(("level", text)) => options.level = Some(text.parse()?),
            Some(("nodata", text)) => options.nodata = Some(text.parse()?),
            Some(("threads", text)) => options.threads = Some(text.parse()?),
            Some(("memory-mib", text)) => options.memory_bytes = text.parse::<u64>()? << 20,
            Some(("bands", text)) => {
                options.bands = Some(numbers(text)?.into_iter().map(|n| n as usize).collect());
            }
            _ => options.sources.push(argument.into()),
        }
    }
    let report = import(&options, &Bar::new(), &AtomicBool::new(false))?;
    serde_json::to_writer_pretty(std::io::stdout(), &report)?;
    Ok(())
}
