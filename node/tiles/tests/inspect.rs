//! Inspection against repositories made by hand.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod common;

use std::sync::atomic::{AtomicU64, Ordering};

use common::write_repository;
use geodesy::{BORDER, CELLS, Ellipsoid, LatticePoint, Tile, TilePosition};
use tiles::{
    Dataset, InspectError, Kind, Repository, SampleType, Samples, TileData, Validity,
    inspect_repository, inspect_tile, value_at,
};

#[test]
fn a_healthy_repository_is_summed_up() {
    let root = tempfile::tempdir().unwrap();
    let repository = write_repository(root.path(), 2);
    let heard = AtomicU64::new(0);
    let summary = inspect_repository(root.path(), &|done, total| {
        assert!(done <= total && total == 126);
        heard.fetch_add(1, Ordering::Relaxed);
    })
    .unwrap();
    assert_eq!(heard.into_inner(), 126);
    let levels: Vec<_> = summary
        .levels
        .iter()
        .map(|level| (level.level, level.tiles))
        .collect();
    assert_eq!(levels, [(0, 6), (1, 24), (2, 96)]);
    assert_eq!(
        summary.bytes,
        summary.levels.iter().map(|level| level.bytes).sum::<u64>()
    );
    assert!(summary.broken.is_empty() && summary.unindexed == 0 && summary.index_problem.is_none());
    assert_eq!(summary.dataset, *repository.dataset());
    let json = serde_json::to_value(&summary).unwrap();
    assert_eq!(json["dataset"]["kind"], "sar");
}

#[test]
fn all_that_is_broken_is_found() {
    let root = tempfile::tempdir().unwrap();
    let repository = write_repository(root.path(), 1);
    let tiles = common::pyramid(1);
    let path = repository.path_of(tiles[2]);
    let mut bytes = std::fs::read(&path).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&path, bytes).unwrap();
    std::fs::copy(repository.path_of(tiles[8]), repository.path_of(tiles[9])).unwrap();
    repository.remove(tiles[20]).unwrap();
    let mut lying = common::tile_data(tiles[12]);
    lying.statistics.highest += 1.0;
    repository
        .write_atomic(tiles[12], &lying.encode().unwrap())
        .unwrap();
    let stray = Tile::new(0, 2, 0, 0).unwrap();
    repository
        .write_atomic(stray, &common::tile_data(stray).encode().unwrap())
        .unwrap();
    let summary = inspect_repository(root.path(), &|_, _| {}).unwrap();
    let mut due = [tiles[2], tiles[9], tiles[12], tiles[20]];
    due.sort_unstable_by_key(|tile| tile.id());
    let found: Vec<Tile> = summary.broken.iter().map(|broken| broken.tile).collect();
    assert_eq!(found, due);
    assert_eq!(summary.unindexed, 1);
    assert!(
        inspect_tile(&path)
            .unwrap_err()
            .to_string()
            .contains("damaged")
    );
    let good = inspect_tile(&repository.path_of(tiles[0])).unwrap();
    assert_eq!(serde_json::to_value(&good).unwrap()["tile"], "0/0/0/0");
}

/// Metres that are linear in the cell coordinates of face 0, so that bilinear reading is exact.
fn metres(level: u8, x: f64, y: f64) -> f64 {
    let tiles = f64::from(1_u32 << level);
    100.0 * f64::from(level) + 32.0 * x / tiles - 64.0 * y / tiles
}

fn elevation(root: &std::path::Path) -> Repository {
    let mut dataset = Dataset::new("plane", Kind::Elevation, SampleType::I32, 1);
    dataset.deepest_level = 2;
    dataset.quantum_m = Some(1.0 / 1024.0);
    let repository = Repository::create(root, dataset).unwrap();
    for tile in [
        Tile::ROOTS[0],
        Tile::new(0, 1, 0, 1).unwrap(),
        Tile::new(0, 2, 1, 2).unwrap(),
    ] {
        let node = |k: u32, n: i64| f64::from(k) + n as f64 / CELLS as f64;
        let side = -BORDER..=CELLS + BORDER;
        let heights = side
            .clone()
            .flat_map(|j| side.clone().map(move |i| (i, j)))
            .map(|(i, j)| {
                (metres(tile.level(), node(tile.x(), i), node(tile.y(), j)) * 1024.0).round() as i32
            });
        // One node is missing at the deepest level.
        let hole = TileData::index(100, 100);
        let validity = if tile.level() == 2 {
            Validity::from_nodes(|n| n != hole)
        } else {
            Validity::All
        };
        let data = TileData::new(
            tile,
            Kind::Elevation,
            1,
            Samples::I32(heights.collect()),
            validity,
        )
        .unwrap();
        repository
            .write_atomic(tile, &data.encode().unwrap())
            .unwrap();
    }
    repository
}

#[test]
fn values_are_bilinear_at_the_finest_level_there() {
    let root = tempfile::tempdir().unwrap();
    elevation(root.path());
    for (latitude, longitude, finest) in [
        (10.0, -20.0, 2),
        (30.0, -40.0, 1),
        (-20.0, 14.0, 0),
        (12.345, -18.765, 2),
        (10.0, 340.0, 2),
    ] {
        let told = value_at(root.path(), latitude, longitude, None).unwrap();
        let normal = Ellipsoid::normal(latitude, longitude);
        let position = TilePosition::of_normal(normal, finest);
        assert_eq!(
            (told.tile, told.level, told.valid),
            (position.tile, finest, true)
        );
        let cells = CELLS as f64;
        let due = metres(
            finest,
            f64::from(position.tile.x()) + position.i / cells,
            f64::from(position.tile.y()) + position.j / cells,
        );
        assert!(
            (told.value[0] - due).abs() < 1e-3,
            "{} against {due}",
            told.value[0]
        );
        let coarse = value_at(root.path(), latitude, longitude, Some(0)).unwrap();
        assert_eq!(coarse.level, 0);
        let json = serde_json::to_value(&coarse).unwrap();
        assert!(json["value"].is_f64() && json["tile"] == "0/0/0/0" && json["valid"] == true);
    }
}

#[test]
fn holes_and_nowhere_are_told_apart() {
    let root = tempfile::tempdir().unwrap();
    elevation(root.path());
    let tile = Tile::new(0, 2, 1, 2).unwrap();
    let at = |i, j, level| {
        let (latitude, longitude) =
            Ellipsoid::angles_deg(LatticePoint::of_tile(tile, i, j).normal());
        value_at(root.path(), latitude, longitude, level)
    };
    let hole = at(100, 100, None).unwrap();
    assert!(!hole.valid && hole.value.is_empty());
    assert!(serde_json::to_value(&hole).unwrap()["value"].is_null());
    assert!(at(100, 100, Some(1)).unwrap().valid);
    assert!(at(103, 100, None).unwrap().valid);
    assert!(matches!(
        at(100, 100, Some(5)),
        Err(InspectError::NoTile { .. })
    ));
    assert!(matches!(
        at(100, 100, Some(23)),
        Err(InspectError::Level(23))
    ));
    let nowhere = value_at(root.path(), 0.0, 120.0, None).unwrap_err();
    assert!(
        nowhere
            .to_string()
            .contains("no tile at latitude 0°, longitude 120°"),
        "{nowhere}"
    );
    assert!(matches!(
        value_at(root.path(), 91.0, 0.0, None),
        Err(InspectError::Position { .. })
    ));
    assert!(matches!(
        value_at(root.path(), 0.0, f64::NAN, None),
        Err(InspectError::Position { .. })
    ));
}
