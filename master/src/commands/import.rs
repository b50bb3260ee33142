//! `terrawall import`: sources into a repository.
//!
//! In: arguments. Out: a repository that is there whole, or as it was, and a summary. Progress goes to standard
//! error.

use import::{Endianness, ImportError, ImportOptions, RawLayout, RawSample};

use crate::args::{ByteOrder, DataKind, Import, Planet, RawType, Registration};
use crate::failure::Failure;
use crate::{interrupt, output};

/// Imports.
pub(crate) fn run(args: Import) -> Result<(), Failure> {
    let (json, report_file) = (args.json, args.report.clone());
    let options = options(args);
    let report =
        import::import(&options, &import::Bar::new(), interrupt::flag()).map_err(explain)?;
    if let Some(path) = &report_file {
        output::json_file(path, &report)?;
    }
    if json {
        return output::json(&report);
    }
    output::line(format!(
        "{}: {} tiles, {:.1} MB from {:.1} megapixels of {} sources in {:.1} s{}",
        report.into.display(),
        report.tiles,
        report.bytes as f64 / 1e6,
        report.source_megapixels,
        report.sources,
        report.wall_s,
        if report.resumed {
            ", going on where it was stopped"
        } else {
            ""
        }
    ))
}

/// What was asked for wrongly has another exit status than what did not work out.
fn explain(error: ImportError) -> Failure {
    match error {
        ImportError::Options(_) => Failure::Configuration(error.into()),
        error => Failure::Failed(error.into()),
    }
}

fn options(args: Import) -> ImportOptions {
    let raw = args
        .raw_size
        .zip(args.raw_type)
        .map(|(size, sample)| RawLayout {
            width: size.width,
            height: size.height,
            sample: match sample {
                RawType::U8 => RawSample::U8,
                RawType::I8 => RawSample::I8,
                RawType::U16 => RawSample::U16,
                RawType::I16 => RawSample::I16,
                RawType::U32 => RawSample::U32,
                RawType::I32 => RawSample::I32,
                RawType::F32 => RawSample::F32,
                RawType::F64 => RawSample::F64,
            },
            endianness: match args.raw_order {
                ByteOrder::Little => Endianness::Little,
                ByteOrder::Big => Endianness::Big,
            },
            header_bytes: args.raw_header,
            bands: args.raw_bands as usize,
        });
    ImportOptions {
        sources: args.sources,
        into: args.into,
        kind: match args.kind {
            DataKind::Elevation => import::Kind::Elevation,
            DataKind::Imagery => import::Kind::Imagery,
            DataKind::Sar => import::Kind::Sar,
        },
        extent: args.extent.map(|extent| import::Extent {
            west: extent.west,
            south: extent.south,
            east: extent.east,
            north: extent.north,
        }),
        crs: args.crs,
        node_registered: args
            .registration
            .map(|registration| registration == Registration::Node),
        raw,
        nodata: args.nodata,
        level: args.level,
        planet: match args.planet {
            Planet::Earth => import::Ellipsoid::EARTH,
            Planet::Moon => import::Ellipsoid::MOON,
            Planet::Mars => import::Ellipsoid::MARS,
        },
        quantum_m: args.quantum,
        name: args.name,
        bands: args.bands,
        range: args.range.map(|range| [range.low, range.high]),
        threads: args.threads.map(|threads| threads as usize),
        memory_bytes: args.memory << 20,
    }
}
