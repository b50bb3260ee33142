//! Adding to a repository: a second source refines the first, holes show what lies below, whatever the order.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod support;

use std::path::{Path, PathBuf};

use geodesy::{Ellipsoid, TilePosition};
use support::{Placement, Values, options, run, shared, write_bands, write_geotiff};
use tiff::encoder::colortype::{RGB16, RGB32Float};
use tiles::Kind;

const COARSE: Placement = Placement {
    epsg: 4326,
    geographic: true,
    x: 5.0,
    y: 50.0,
    dx: 0.05,
    dy: 0.05,
    point: false,
};
const FINE: Placement = Placement {
    epsg: 4326,
    geographic: true,
    x: 8.0,
    y: 48.0,
    dx: 0.004,
    dy: 0.004,
    point: false,
};
/// A hole in the fine source: columns and rows.
const HOLE: std::ops::Range<u32> = 100..160;

fn sources(directory: &Path) -> [PathBuf; 2] {
    let [coarse, fine] = ["coarse.tif", "fine.tif"].map(|name| directory.join(name));
    write_geotiff(&coarse, 160, 120, COARSE, None, |_, _| 100.0);
    write_geotiff(&fine, 300, 300, FINE, Some(-1.0), |column, row| {
        if HOLE.contains(&column) && HOLE.contains(&row) {
            -1.0
        } else {
            1000.0
        }
    });
    [coarse, fine]
}

/// Latitude and longitude of a sample.
fn place(placement: Placement, column: f64, row: f64) -> (f64, f64) {
    let (x, y) = placement.model(column, row);
    (y, x)
}

fn check(into: &Path) {
    let mut values = Values::open(into);
    let deepest = values.repository.dataset().deepest_level;
    let (latitude, longitude) = place(FINE, 50.0, 50.0);
    assert_eq!(values.at(latitude, longitude, deepest, 0), Some(1000.0));
    // In the hole of the fine source stands the coarse one.
    let (latitude, longitude) = place(FINE, 130.0, 130.0);
    assert_eq!(values.at(latitude, longitude, deepest, 0), Some(100.0));
    // Around the fine source too, as far as its tiles reach, at every level that has a tile there.
    let (latitude, longitude) = place(FINE, -4.0, 150.0);
    for level in 0..=deepest {
        let position = TilePosition::of_normal(Ellipsoid::normal(latitude, longitude), level);
        if values.tile(position.tile).is_some() {
            assert!(
                values.at(latitude, longitude, level, 0).is_some(),
                "level {level}"
            );
        }
    }
    assert!(values.check_shared_nodes() > 1000);
    let index = values.repository.load_index().unwrap();
    let tiles: Vec<_> = values
        .repository
        .tiles()
        .unwrap()
        .into_iter()
        .map(|(tile, _)| tile)
        .collect();
    assert_eq!(index.tiles(), tiles);
    for tile in tiles {
        let statistics = values.tile(tile).unwrap().statistics;
        assert_eq!(
            index.range(tile),
            Some((statistics.lowest, statistics.highest)),
            "{tile}"
        );
        assert!(
            tile.parent().is_none_or(|parent| index.contains(parent)),
            "{tile} has no parent"
        );
    }
}

#[test]
fn a_second_source_refines_the_first() {
    let directory = tempfile::tempdir().unwrap();
    let [coarse, fine] = sources(directory.path());
    let into = directory.path().join("repository");
    let first = run(&options(Kind::Elevation, &[coarse], &into)).unwrap();
    let second = run(&options(Kind::Elevation, &[fine], &into)).unwrap();
    assert!(second.levels[0] > first.levels[0]);
    check(&into);
    let mut values = Values::open(&into);
    // The coarse level has learnt of the fine source, and not beyond it.
    let level = first.levels[0];
    let (latitude, longitude) = place(FINE, 240.0, 240.0);
    assert_eq!(values.at(latitude, longitude, level, 0), Some(1000.0));
    let (latitude, longitude) = place(COARSE, 10.0, 10.0);
    assert_eq!(values.at(latitude, longitude, level, 0), Some(100.0));
    let dataset = values.repository.dataset();
    assert_eq!((dataset.revision, dataset.sources.len()), (2, 2));
}

#[test]
fn a_coarse_source_that_comes_later_fills_the_holes() {
    let directory = tempfile::tempdir().unwrap();
    let [coarse, fine] = sources(directory.path());
    let into = directory.path().join("repository");
    let first = run(&options(Kind::Elevation, &[fine], &into)).unwrap();
    let mut values = Values::open(&into);
    let (latitude, longitude) = place(FINE, 130.0, 130.0);
    assert_eq!(values.at(latitude, longitude, first.levels[0], 0), None);
    run(&options(Kind::Elevation, &[coarse], &into)).unwrap();
    check(&into);
}

#[test]
fn both_at_once_are_the_same_as_one_after_the_other() {
    let directory = tempfile::tempdir().unwrap();
    let [coarse, fine] = sources(directory.path());
    let [one, other] = ["one", "other"].map(|name| directory.path().join(name));
    // Given in either order: the coarser goes first.
    run(&options(
        Kind::Elevation,
        &[fine.clone(), coarse.clone()],
        &one,
    ))
    .unwrap();
    run(&options(Kind::Elevation, &[coarse], &other)).unwrap();
    run(&options(Kind::Elevation, &[fine], &other)).unwrap();
    check(&one);
    let [mut one, mut other] = [Values::open(&one), Values::open(&other)];
    let tiles = one.repository.tiles().unwrap();
    assert_eq!(tiles, other.repository.tiles().unwrap());
    for (tile, _) in tiles {
        assert_eq!(one.tile(tile), other.tile(tile));
    }
}

#[test]
fn raw_imagery_refines_and_fills_like_heights() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: String| directory.path().join(name);
    let hole = |c, r| HOLE.contains(&c) && HOLE.contains(&r);
    for float in [false, true] {
        let [coarse, fine] = ["coarse", "fine"].map(|n| path(format!("{n}{float}.tif")));
        let unit = if float { 0.125 } else { 1.0 };
        if float {
            write_bands::<RGB32Float>(&coarse, (160, 120), COARSE, None, &[], |_, _, b| {
                (100.0 + b as f32) * 0.125
            });
            write_bands::<RGB32Float>(&fine, (300, 300), FINE, None, &[], |c, r, b| {
                if hole(c, r) {
                    f32::NAN
                } else {
                    (60_000.0 + b as f32) * 0.125
                }
            });
        } else {
            write_bands::<RGB16>(&coarse, (160, 120), COARSE, None, &[], |_, _, b| {
                100 + b as u16
            });
            write_bands::<RGB16>(&fine, (300, 300), FINE, Some(0.0), &[], |c, r, b| {
                if hole(c, r) { 0 } else { 60_000 + b as u16 }
            });
        }
        let orders = [
            [coarse.clone(), fine.clone()]
                .map(|source| vec![source])
                .to_vec(),
            [fine.clone(), coarse.clone()]
                .map(|source| vec![source])
                .to_vec(),
            vec![vec![fine.clone(), coarse.clone()]],
        ];
        let mut first: Option<Values> = None;
        for (number, order) in orders.into_iter().enumerate() {
            let into = path(format!("{number}{float}"));
            for sources in order {
                run(&options(Kind::Imagery, &sources, &into)).unwrap();
            }
            let mut values = Values::open(&into);
            let deepest = values.repository.dataset().deepest_level;
            for channel in 0..3_u8 {
                let mut near = |(latitude, longitude), due: f64| {
                    let value = values.at(latitude, longitude, deepest, channel).unwrap();
                    let due = (due + f64::from(channel)) * unit;
                    assert!((value - due).abs() < 1e-9 * due, "{value}, due {due}");
                };
                near(place(FINE, 50.0, 50.0), 60_000.0);
                near(place(FINE, 130.0, 130.0), 100.0);
                near(place(FINE, -4.0, 150.0), 100.0);
            }
            assert!(values.check_shared_nodes() > 1000);
            match &mut first {
                None => first = Some(values),
                // Coarse first is the order that a single import takes too.
                Some(first) if number == 2 => {
                    let tiles = first.repository.tiles().unwrap();
                    assert_eq!(tiles, values.repository.tiles().unwrap());
                    for (tile, _) in tiles {
                        assert_eq!(first.tile(tile), values.tile(tile), "{tile}");
                    }
                }
                Some(_) => {}
            }
        }
    }
}

#[test]
fn importing_again_changes_no_tile() {
    let directory = tempfile::tempdir().unwrap();
    let [coarse, _] = sources(directory.path());
    let into = directory.path().join("repository");
    let asked = options(Kind::Elevation, &[coarse], &into);
    assert!(run(&asked).unwrap().tiles > 0);
    let before = Values::open(&into).repository.tiles().unwrap();
    assert_eq!(run(&asked).unwrap().tiles, 0);
    let dataset = Values::open(&into).repository.dataset().clone();
    assert_eq!((dataset.revision, dataset.sources.len()), (1, 1));
    assert_eq!(Values::open(&into).repository.tiles().unwrap(), before);
}

#[test]
fn a_coarser_level_than_the_source_has_is_filtered_not_picked() {
    let directory = tempfile::tempdir().unwrap();
    let source = directory.path().join("checks.tif");
    // A chessboard whose mean is 500: picking single samples would show 0 or 1000.
    write_geotiff(&source, 400, 400, FINE, None, |column, row| {
        ((column + row) % 2 * 1000) as f32
    });
    let into = directory.path().join("repository");
    let mut asked = options(Kind::Elevation, &[source], &into);
    let natural = run(&asked).unwrap().levels[0];
    std::fs::remove_dir_all(&into).unwrap();
    asked.level = Some(natural - 3);
    let report = run(&asked).unwrap();
    assert_eq!(report.tiles_by_level.keys().max(), Some(&(natural - 3)));
    let mut values = Values::open(&into);
    for step in 0..20 {
        let (latitude, longitude) = place(FINE, 80.0 + 11.0 * f64::from(step), 200.0);
        let value = values.at(latitude, longitude, natural - 3, 0).unwrap();
        assert!((value - 500.0).abs() < 20.0, "{value}");
    }
}

#[test]
fn other_data_is_not_mixed_in() {
    let directory = tempfile::tempdir().unwrap();
    let [coarse, fine] = sources(directory.path());
    let into = directory.path().join("repository");
    run(&options(Kind::Elevation, &[coarse], &into)).unwrap();
    let message = run(&options(Kind::Sar, std::slice::from_ref(&fine), &into))
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("holds elevation") && message.contains("another directory"),
        "{message}"
    );
    let mut moon = options(Kind::Elevation, std::slice::from_ref(&fine), &into);
    moon.planet = Ellipsoid::MOON;
    assert!(run(&moon).unwrap_err().to_string().contains("planet"));
    let description = into.join("dataset.toml");
    let text = std::fs::read_to_string(&description).unwrap();
    std::fs::write(
        &description,
        text.replace("format_version = 1", "format_version = 99"),
    )
    .unwrap();
    let message = run(&options(Kind::Elevation, &[fine], &into))
        .unwrap_err()
        .to_string();
    assert!(message.contains("another version"), "{message}");
    assert!(!into.join(".staging").exists() && !into.join(".import.lock").exists());
}

#[test]
fn voids_of_real_cells_stay_void_until_something_lies_below() {
    let (Some(alps), Some(globe)) = (shared("alps_srtm3.zip"), shared("etopo5.tif")) else {
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let into = directory.path();
    let report = run(&options(Kind::Elevation, &[alps], into)).unwrap();
    let level = report.levels[0];
    let mut values = Values::open(into);
    let fine: Vec<_> = values
        .repository
        .tiles()
        .unwrap()
        .into_iter()
        .map(|(tile, _)| tile)
        .collect();
    let fine: Vec<_> = fine
        .into_iter()
        .filter(|tile| tile.level() == level)
        .collect();
    let void = |values: &mut Values| {
        let voids = |data: &tiles::TileData| data.validity != tiles::Validity::All;
        fine.iter()
            .filter(|tile| values.tile(**tile).is_some_and(voids))
            .count()
    };
    assert!(void(&mut values) > 10);
    let summit = values.at(45.8326, 6.8652, level, 0).unwrap();
    assert!(
        (4400.0..4800.0).contains(&summit),
        "Mont Blanc is {summit} m high"
    );
    drop(values);
    run(&options(Kind::Elevation, &[globe], into)).unwrap();
    let mut values = Values::open(into);
    assert_eq!(void(&mut values), 0);
    assert_eq!(values.at(45.8326, 6.8652, level, 0), Some(summit));
}

#[test]
fn a_level_that_no_disk_could_hold_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let [coarse, _] = sources(directory.path());
    let into = directory.path().join("repository");
    let mut asked = options(Kind::Elevation, &[coarse], &into);
    asked.level = Some(22);
    let message = run(&asked).unwrap_err().to_string();
    assert!(
        message.contains("level 22") && message.contains("coarser level"),
        "{message}"
    );
    assert!(!into.exists());
}
