//! The TIFF fixtures of the data beside the repository, as each kind: read right, or refused with a reason.
//! What is right was read with rasterio 1.4.4 (GDAL) and lies in `tests/data/tiff_fixtures.tsv`: size, number of
//! valid pixels, means of the channels, four pixels. Wide imagery is there as stored, in
//! 32-bit floating point where its numbers are neither bytes nor unsigned 16-bit.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use tiles::Kind;

use super::{Pixels, open};
use crate::grid::Position;
use crate::lru::Lru;
use crate::options::{Extent, ImportOptions};
use crate::sampler::Sampler;

const KINDS: [Kind; 3] = [Kind::Elevation, Kind::Imagery, Kind::Sar];

fn options(kind: Kind) -> ImportOptions {
    ImportOptions {
        sources: Vec::new(),
        into: PathBuf::new(),
        kind,
        extent: Some(Extent {
            west: 0.0,
            south: 0.0,
            east: 1.0,
            north: 1.0,
        }),
        crs: None,
        node_registered: None,
        raw: None,
        nodata: None,
        level: None,
        planet: geodesy::Ellipsoid::EARTH,
        quantum_m: None,
        name: None,
        bands: None,
        range: None,
        threads: None,
        memory_bytes: 256 << 20,
    }
}

struct Reference<'text> {
    size: [u32; 2],
    valid: usize,
    means: Vec<f64>,
    probes: Vec<&'text str>,
}

fn numbers(text: &str) -> Vec<f64> {
    text.split(',')
        .map(|number| number.parse().unwrap())
        .collect()
}

fn check(name: &str, source: &super::Source, reference: &Reference<'_>) {
    let grid = source.grid();
    assert_eq!([grid.width, grid.height], reference.size, "{name}");
    let description = &source.description;
    let channels = description.channels;
    assert_eq!(channels, reference.means.len(), "{name}: channels");
    let cache = Lru::new(1 << 28);
    let mut sampler = Sampler::<16>::new(source, 0, &cache);
    let (mut sums, mut valid) = (vec![0.0; channels], 0);
    // The same pixels through the chunks as a whole and one by one.
    for row in 0..grid.height {
        for column in 0..grid.width {
            let (value, holds) = sampler.sample(i64::from(column), i64::from(row)).unwrap();
            if holds {
                valid += 1;
                for (sum, number) in sums.iter_mut().zip(value) {
                    *sum += number * description.scale + description.offset;
                }
            }
        }
    }
    assert_eq!(valid, reference.valid, "{name}: valid pixels");
    // JPEG decoders round differently by a few of 255.
    let jpeg = [
        "jpeg",
        "jpg",
        "hot-oam",
        "cog_rgb_with_stats",
        "yellowstone",
    ]
    .iter()
    .any(|part| name.contains(part));
    let (mean_tolerance, tolerance) = if jpeg { (1.0, 12.0) } else { (1e-5, 1e-6) };
    let near = |value: f64, due: f64, tolerance: f64| {
        (value - due).abs()
            <= if jpeg {
                tolerance
            } else {
                tolerance * due.abs().max(1.0)
            }
    };
    for (sum, due) in sums.iter().zip(&reference.means) {
        let mean = if valid > 0 { sum / valid as f64 } else { 0.0 };
        assert!(
            near(mean, *due, mean_tolerance),
            "{name}: mean {mean}, due {due}"
        );
    }
    let (w, h) = (grid.width, grid.height);
    for ((column, row), due) in [(0, 0), (w / 3, h / 2), (w - 1, h - 1), (w / 2, h / 3)]
        .into_iter()
        .zip(&reference.probes)
    {
        let position = Position {
            column: f64::from(column),
            row: f64::from(row),
        };
        let mut values = [None];
        sampler.values(&[Some(position)], &mut values).unwrap();
        match values[0] {
            None => assert_eq!(*due, "void", "{name}: pixel {column}, {row}"),
            Some(value) => {
                assert_ne!(*due, "void", "{name}: pixel {column}, {row}");
                for (value, due) in value.iter().zip(numbers(due)) {
                    let value = value * description.scale + description.offset;
                    assert!(
                        near(value, due, tolerance),
                        "{name}: pixel {column}, {row} is {value}, due {due}"
                    );
                }
            }
        }
    }
}

#[test]
fn every_fixture_is_read_right_or_refused_with_a_reason() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let fixtures = root.join("../../../shared/data/tiff-fixtures");
    let Ok(entries) = std::fs::read_dir(&fixtures) else {
        return;
    };
    let table = std::fs::read_to_string(root.join("tests/data/tiff_fixtures.tsv")).unwrap();
    let mut references = BTreeMap::new();
    for line in table.lines() {
        let fields: Vec<&str> = line.split('\t').collect();
        let reference = Reference {
            size: [fields[2].parse().unwrap(), fields[3].parse().unwrap()],
            valid: fields[4].parse().unwrap(),
            means: numbers(fields[5]),
            probes: fields[6..].to_vec(),
        };
        references.insert((fields[0], fields[1]), reference);
    }
    let mut names: Vec<String> = entries
        .flatten()
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert_eq!(names.len(), 86);
    let mut accepted = BTreeMap::new();
    for name in &names {
        for kind in KINDS {
            let outcome = open(&fixtures.join(name), &options(kind));
            match outcome {
                Ok(sources) => {
                    let kind = kind.to_string();
                    let reference = references.get(&(name.as_str(), kind.as_str()));
                    let reference =
                        reference.unwrap_or_else(|| panic!("{name} as {kind}: no reference"));
                    check(&format!("{name} as {kind}"), &sources[0], reference);
                    *accepted.entry(kind).or_insert(0) += 1;
                }
                Err(error) => {
                    let message = error.to_string();
                    assert!(
                        message.contains(name.as_str()) && message.ends_with('.'),
                        "{message}"
                    );
                    assert!(message.len() > name.len() + 60, "{message}");
                }
            }
        }
    }
    // Refusing everything would be right too, but of no use.
    let due = [("elevation", 36), ("imagery", 70), ("sar", 29)];
    assert_eq!(
        accepted,
        due.map(|(kind, count)| (kind.to_owned(), count)).into()
    );
}

#[test]
fn cut_off_fixtures_are_damaged_and_never_panic() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let fixtures = root.join("../../../shared/data/tiff-fixtures");
    let Ok(entries) = std::fs::read_dir(&fixtures) else {
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    for entry in entries.flatten() {
        let bytes = std::fs::read(entry.path()).unwrap();
        for part in 1..8 {
            let path = directory.path().join("cut.tif");
            std::fs::write(&path, &bytes[..bytes.len() * part / 8]).unwrap();
            let Ok(sources) = open(&path, &options(Kind::Imagery)) else {
                continue;
            };
            // Only what lies behind the samples may be missing.
            let description = &sources[0].description;
            let read = |column, row| -> Result<Pixels, _> { sources[0].raster.read(column, row) };
            for row in 0..description.grid.height.div_ceil(description.chunk.1) {
                for column in 0..description.grid.width.div_ceil(description.chunk.0) {
                    let _ = read(column, row);
                }
            }
        }
    }
}

/// Sample of a band of the embedded TIFFs, which GDAL 3.6 wrote from this formula.
fn due(band: usize, column: u32, row: u32) -> f64 {
    f64::from((column * 3 + row * 5 + band as u32 * 40) % 251)
}

#[test]
fn every_band_of_every_arrangement_is_read_as_it_was_written() {
    let embedded = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    for (name, bands) in [
        ("rgb_and_infrared.tif", 4),
        ("planes.tif", 3),
        ("plane_strips.tif", 3),
        ("big_endian.tif", 2),
        ("sparse.tif", 1),
    ] {
        for band in 0..bands {
            let mut asked = options(Kind::Elevation);
            asked.bands = Some(vec![band + 1]);
            let sources = open(&embedded.join(name), &asked).unwrap();
            let cache = Lru::new(1 << 20);
            let mut sampler = Sampler::<1>::new(&sources[0], 0, &cache);
            for row in 0..50 {
                for column in 0..70 {
                    let value = sampler.sample(i64::from(column), i64::from(row));
                    let (value, valid) = value.unwrap_or_else(|error| {
                        panic!("{name} band {band}, {column}, {row}: {error}")
                    });
                    let written = name != "sparse.tif" || (column < 32 && row < 32);
                    assert_eq!(valid, written, "{name}: {column}, {row}");
                    if written {
                        assert_eq!(
                            value[0],
                            due(band, column, row),
                            "{name} band {band}: {column}, {row}"
                        );
                    }
                }
            }
        }
    }
    let sources = open(
        &embedded.join("rgb_and_infrared.tif"),
        &options(Kind::Imagery),
    )
    .unwrap();
    let cache = Lru::new(1 << 20);
    let sample = Sampler::<4>::new(&sources[0], 0, &cache).sample(69, 49);
    let bands = [0, 1, 2, 3].map(|band| due(band, 69, 49));
    assert_eq!(sample.unwrap(), (bands, true));
}
