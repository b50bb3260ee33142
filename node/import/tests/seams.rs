//! Shared nodes: whatever tiles hold a node, in their cores or borders, over tile edges, face edges and cube corners,
//! at every level, hold the same bits.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test that panics has failed, and what it prints is its result"
)]

mod support;

use geodesy::{LatticePoint, Tile};
use support::{Placement, Random, Values, options, run, shared, write_geotiff};
use tiles::Kind;

const DEGREES: Placement = Placement {
    epsg: 4326,
    geographic: true,
    x: 0.0,
    y: 0.0,
    dx: 1.0,
    dy: 1.0,
    point: false,
};

/// Rough heights without any pattern that a mistake could hide in.
fn rough(column: u32, row: u32) -> f32 {
    let mut random = Random(u64::from(column) << 32 | u64::from(row));
    (random.within(-4000.0, 4000.0)) as f32
}

#[test]
fn a_rough_globe_agrees_everywhere() {
    let directory = tempfile::tempdir().unwrap();
    let source = directory.path().join("globe.tif");
    let placement = Placement {
        x: -180.0,
        y: 90.0,
        dx: 0.25,
        dy: 0.25,
        ..DEGREES
    };
    write_geotiff(&source, 1440, 720, placement, None, rough);
    let into = directory.path().join("globe");
    let report = run(&options(Kind::Elevation, &[source], &into)).unwrap();
    let tiles: u64 = (0..=report.levels[0]).map(|level| 6 << (2 * level)).sum();
    assert_eq!(report.tiles, tiles, "{report:?}");
    let mut values = Values::open(&into);
    assert!(values.check_shared_nodes() > 200_000);
    // No node of a global source is void, not even at the poles and across the antimeridian.
    for (tile, _) in values.repository.tiles().unwrap() {
        assert_eq!(
            values.tile(tile).unwrap().validity,
            tiles::Validity::All,
            "{tile}"
        );
    }
}

#[test]
fn sources_over_a_cube_corner_and_with_holes_agree() {
    let directory = tempfile::tempdir().unwrap();
    // A corner of the cube lies at 35.26°N (geocentric direction as normal), 45°E.
    let placement = Placement {
        x: 43.0,
        y: 37.0,
        dx: 0.01,
        dy: 0.01,
        ..DEGREES
    };
    let source = directory.path().join("corner.tif");
    write_geotiff(
        &source,
        401,
        333,
        placement,
        Some(-9999.0),
        |column, row| {
            let hole = (column / 37 + row / 23) % 5 == 0 || column * row % 71 == 0;
            if hole { -9999.0 } else { rough(column, row) }
        },
    );
    let into = directory.path().join("corner");
    let report = run(&options(Kind::Elevation, &[source], &into)).unwrap();
    let mut values = Values::open(&into);
    assert!(values.check_shared_nodes() > 10_000);
    let faces: std::collections::BTreeSet<u8> = values
        .repository
        .tiles()
        .unwrap()
        .iter()
        .map(|(tile, _)| tile.face().number())
        .collect();
    assert_eq!(faces.len(), 3, "{report:?}");
    // At the cube corner itself every level has the value of the finest.
    let finest = values.repository.dataset().deepest_level;
    let corner = |level: u8| {
        let last = (1_u32 << level) - 1;
        let tile = Tile::new(0, level, last, last).unwrap();
        LatticePoint::of_tile(tile, 256, 256)
    };
    let at = |values: &mut Values, level: u8| {
        let (tile, i, j) = corner(level).owner();
        values.tile(tile).unwrap().height(i, j)
    };
    let due = at(&mut values, finest);
    for level in 0..finest {
        assert_eq!(at(&mut values, level), due, "level {level}");
    }
}

#[test]
fn colours_and_amplitudes_agree_too() {
    let directory = tempfile::tempdir().unwrap();
    let picture = directory.path().join("picture.png");
    let pixels = image::RgbImage::from_fn(720, 360, |x, y| {
        let mut random = Random(u64::from(x) << 32 | u64::from(y));
        image::Rgb([0; 3].map(|_| random.within(0.0, 255.0) as u8))
    });
    pixels.save(&picture).unwrap();
    let into = directory.path().join("picture");
    let mut asked = options(Kind::Imagery, &[picture], &into);
    asked.extent = Some(import::Extent {
        west: -180.0,
        south: -90.0,
        east: 180.0,
        north: 90.0,
    });
    run(&asked).unwrap();
    assert!(Values::open(&into).check_shared_nodes() > 20_000);

    let placement = Placement {
        x: -180.0,
        y: 90.0,
        dx: 0.5,
        dy: 0.5,
        ..DEGREES
    };
    let radar = directory.path().join("radar.tif");
    write_geotiff(&radar, 720, 360, placement, None, rough);
    let into = directory.path().join("radar");
    run(&options(Kind::Sar, &[radar], &into)).unwrap();
    assert!(Values::open(&into).check_shared_nodes() > 20_000);
}

#[test]
fn real_heights_agree() {
    for name in ["etopo5.tif", "alps_srtm3.zip"] {
        let Some(source) = shared(name) else { return };
        let directory = tempfile::tempdir().unwrap();
        run(&options(Kind::Elevation, &[source], directory.path())).unwrap();
        let compared = Values::open(directory.path()).check_shared_nodes();
        println!("{name}: {compared} shared nodes");
        assert!(compared > 1_000_000);
    }
}
