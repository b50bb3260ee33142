//! No gaps: closed surfaces over the whole planet, whatever is selected and whatever data is there.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod common;

use std::collections::HashMap;

use common::{Noise, PLACES, Random, Resident, build_one, lookup};
use geodesy::{Ellipsoid, Tile};
use terrain::{
    DataLevels, LodLimits, LodView, MeshError, Patch, Seams, Selection, Walker, seams, select,
};

/// Builds every leaf of the planet and walks all edges.
fn planet_is_closed(
    ellipsoid: &Ellipsoid,
    selection: &Selection,
    patch: &Patch,
    shown: &HashMap<Tile, Option<u8>>,
    resident: &Resident,
) {
    let mut walker = Walker::default();
    let mut vertices = Vec::new();
    let (mut triangles, mut patches) = (0, 0);
    for leaf in selection.leaves() {
        let Seams { variant, levels } = seams(*leaf, selection, &|tile| shown[&tile]);
        vertices.clear();
        build_one(
            ellipsoid,
            *leaf,
            &levels,
            patch,
            1.0 / 16.0,
            &lookup(resident),
            &mut vertices,
        )
        .unwrap();
        assert_eq!(vertices.len(), patch.positions.len());
        walker.add(&vertices, &patch.indices[usize::from(variant)]);
        triangles += patch.triangles(variant);
        patches += 1;
    }
    let walk = walker.finish();
    assert!(walk.is_closed(), "{walk:?} in {patches} patches");
    assert_eq!(walk.euler_characteristic(), 2, "{walk:?}");
    assert_eq!(walk.triangles, triangles);
}

/// Leaves show nothing, themselves, or some ancestor, and only what they show is resident.
fn random_data(
    random: &mut Random,
    selection: &Selection,
    holes: u64,
) -> (HashMap<Tile, Option<u8>>, Resident) {
    let seed = random.next();
    let mut resident = Resident::new();
    let shown = selection.leaves().iter().map(|leaf| {
        let level = match random.below(10) {
            0 => None,
            1..4 => Some(random.below(u64::from(leaf.level()) + 1) as u8),
            4..6 => Some(leaf.level().saturating_sub(1)),
            _ => Some(leaf.level()),
        };
        if let Some(level) = level {
            let tile = leaf.ancestor(level);
            resident.insert(
                tile,
                Noise {
                    tile,
                    seed,
                    amplitude: 100_000,
                    holes,
                },
            );
        }
        (*leaf, level)
    });
    let shown = shown.collect();
    (shown, resident)
}

#[test]
fn the_planet_is_closed_for_random_views_and_data() {
    let mut random = Random(1);
    let bodies = [Ellipsoid::EARTH, Ellipsoid::MOON, Ellipsoid::MARS];
    for round in 0..40 {
        let ellipsoid = bodies[round % 3];
        let normal = match PLACES.get(round) {
            Some((latitude, longitude)) => Ellipsoid::normal(*latitude, *longitude),
            None => random.direction(),
        };
        let altitude_m = 10.0_f64.powf(random.between(0.5, 7.5));
        let view = LodView {
            eye: ellipsoid.point(normal, altitude_m),
            pixels_per_radian: 300.0,
        };
        let limits = LodLimits {
            deepest_level: random.below(15) as u8 + 1,
            tile_px: 257.0,
            most_tiles: 1500,
        };
        let selection = select(&ellipsoid, &view, &limits, &common::earth_like);
        let (shown, resident) = random_data(&mut random, &selection, [0, 2, 50][round % 3]);
        let patch = Patch::new(random.below(3) as u8).unwrap();
        planet_is_closed(&ellipsoid, &selection, &patch, &shown, &resident);
    }
}

#[test]
fn it_does_not_matter_which_resident_tile_answers() {
    // Each leaf is built with its own ancestors alone, as if at another moment than its neighbours.
    let ellipsoid = Ellipsoid::MARS;
    let mut random = Random(6);
    let patch = Patch::new(2).unwrap();
    for (latitude, longitude) in PLACES {
        let view = common::view(&ellipsoid, latitude, longitude, 300_000.0);
        let selection = select(
            &ellipsoid,
            &view,
            &LodLimits::default(),
            &common::earth_like,
        );
        let (shown, resident) = random_data(&mut random, &selection, 4);
        let seed = resident.values().next().unwrap().seed;
        let mut walker = Walker::default();
        for leaf in selection.leaves() {
            let Seams { variant, levels } = seams(*leaf, &selection, &|tile| shown[&tile]);
            let own = levels.ancestors(*leaf).into_iter().map(|tile| {
                assert!(tile.contains(*leaf));
                (
                    tile,
                    Noise {
                        tile,
                        seed,
                        amplitude: 100_000,
                        holes: 4,
                    },
                )
            });
            let own: Resident = own.collect();
            let mut vertices = Vec::new();
            build_one(
                &ellipsoid,
                *leaf,
                &levels,
                &patch,
                0.125,
                &lookup(&own),
                &mut vertices,
            )
            .unwrap();
            walker.add(&vertices, &patch.indices[usize::from(variant)]);
        }
        let walk = walker.finish();
        assert!(
            walk.is_closed() && walk.euler_characteristic() == 2,
            "{walk:?}"
        );
    }
}

#[test]
fn the_planet_is_closed_at_every_refinement() {
    let ellipsoid = Ellipsoid::EARTH;
    let mut random = Random(2);
    // Just above a cube corner, so that levels change around it.
    let view = common::view(&ellipsoid, 35.26, 45.0, 3_000_000.0);
    let selection = select(
        &ellipsoid,
        &view,
        &LodLimits::default(),
        &common::earth_like,
    );
    for refinement in 0..=5 {
        let (shown, resident) = random_data(&mut random, &selection, 5);
        let patch = Patch::new(refinement).unwrap();
        planet_is_closed(&ellipsoid, &selection, &patch, &shown, &resident);
    }
    // The finest refinement on the six roots, to keep the walk short.
    let far = LodView {
        eye: view.eye * 1000.0,
        pixels_per_radian: 300.0,
    };
    let selection = select(&ellipsoid, &far, &LodLimits::default(), &common::earth_like);
    assert_eq!(selection.leaves(), Tile::ROOTS);
    let (shown, resident) = random_data(&mut random, &selection, 3);
    planet_is_closed(
        &ellipsoid,
        &selection,
        &Patch::new(7).unwrap(),
        &shown,
        &resident,
    );
}

#[test]
fn a_changed_height_opens_a_gap_that_the_walker_finds() {
    let ellipsoid = Ellipsoid::EARTH;
    let selection = select(
        &ellipsoid,
        &common::view(&ellipsoid, 10.0, 20.0, 1e7),
        &LodLimits::default(),
        &common::earth_like,
    );
    let patch = Patch::new(2).unwrap();
    let mut walker = Walker::default();
    for (number, leaf) in selection.leaves().iter().enumerate() {
        let mut vertices = Vec::new();
        let seams = seams(*leaf, &selection, &|_| None);
        build_one(
            &ellipsoid,
            *leaf,
            &seams.levels,
            &patch,
            1.0,
            &|_| None,
            &mut vertices,
        )
        .unwrap();
        if number == 3 {
            // One step of a micrometre at one corner.
            vertices[0].position[0] ^= 1;
        }
        walker.add(&vertices, &patch.indices[usize::from(seams.variant)]);
    }
    let walk = walker.finish();
    assert!(walk.open_edges >= 4 && !walk.is_closed(), "{walk:?}");
}

#[test]
fn borders_take_the_coarsest_data_and_insides_their_own() {
    let ellipsoid = Ellipsoid::EARTH;
    let selection = select(
        &ellipsoid,
        &common::view(&ellipsoid, 10.0, 20.0, 1e6),
        &LodLimits::default(),
        &common::earth_like,
    );
    let patch = Patch::new(4).unwrap();
    let leaf = *selection.leaves().last().unwrap();
    let level = leaf.level() as i8;
    let own = seams(leaf, &selection, &|tile| Some(tile.level()));
    assert_eq!(own.levels.inside, level);
    assert!(
        own.levels
            .corners
            .iter()
            .chain(own.levels.half_edges.as_flattened())
            .all(|l| *l <= level)
    );
    let coarse = seams(leaf, &selection, &|tile| {
        (tile == leaf).then_some(leaf.level())
    });
    assert_eq!(
        coarse.levels,
        DataLevels {
            inside: level,
            corners: [-1; 4],
            half_edges: [[-1; 2]; 4]
        }
    );
    assert_eq!(own.variant, coarse.variant);

    // No data beside: heights 0 on the border, the tile's own within, exactly.
    let noise = Noise {
        tile: leaf,
        seed: 5,
        amplitude: 50_000,
        holes: 0,
    };
    let resident = Resident::from([(leaf, noise)]);
    let mut vertices = Vec::new();
    let heights = build_one(
        &ellipsoid,
        leaf,
        &coarse.levels,
        &patch,
        0.25,
        &lookup(&resident),
        &mut vertices,
    )
    .unwrap();
    assert!(heights.lowest_m < 0.0 && heights.highest_m > 0.0);
    for vertex in &vertices {
        let [i, j] = vertex.lattice.map(i64::from);
        let on_border = i % 256 == 0 || j % 256 == 0;
        let expected = if on_border {
            0
        } else {
            terrain::Lattice::height(&noise, i, j).unwrap()
        };
        let normal = geodesy::LatticePoint::of_tile(leaf, i, j).normal();
        let position = ellipsoid.point(normal, f64::from(expected) * 0.25);
        assert_eq!(
            vertex.point(),
            geodesy::frame::FixedPoint::from_ecef(position)
        );
    }
}

#[test]
fn data_that_went_away_is_named_and_nothing_is_left_behind() {
    let ellipsoid = Ellipsoid::EARTH;
    let leaf = Tile::new(2, 5, 7, 9).unwrap();
    let patch = Patch::new(1).unwrap();
    let mut vertices = Vec::new();
    let levels = Seams::uniform(3).levels;
    let error = build_one(
        &ellipsoid,
        leaf,
        &levels,
        &patch,
        1.0,
        &|_| None,
        &mut vertices,
    )
    .unwrap_err();
    assert_eq!(
        error,
        MeshError::NotResident {
            tile: leaf.ancestor(3)
        }
    );
    assert!(vertices.is_empty());
    let wrong = Noise {
        tile: leaf,
        seed: 0,
        amplitude: 1,
        holes: 0,
    };
    let error = build_one(
        &ellipsoid,
        leaf,
        &levels,
        &patch,
        1.0,
        &|_| Some(&wrong),
        &mut vertices,
    )
    .unwrap_err();
    assert_eq!(
        error,
        MeshError::WrongTile {
            wanted: leaf.ancestor(3),
            found: leaf
        }
    );
}

#[test]
fn coarse_data_is_bilinear_over_the_valid_nodes() {
    /// h = 16·i − 32·j, with the nodes of column 3 missing.
    struct Plane(Tile);
    impl terrain::Lattice for Plane {
        fn tile(&self) -> Tile {
            self.0
        }
        fn height(&self, i: i64, j: i64) -> Option<i32> {
            (i != 3).then(|| (16 * i - 32 * j) as i32)
        }
    }
    let root = Tile::ROOTS[0];
    let plane = Plane(root);
    // The left lower tile of level 5 covers nodes 0…8 of the root; one of its nodes is 1/32 of a cell.
    let leaf = root.children().unwrap()[0].children().unwrap()[0]
        .children()
        .unwrap()[0];
    let leaf = leaf.children().unwrap()[0].children().unwrap()[0];
    let mut vertices = Vec::new();
    let levels = Seams::uniform(0).levels;
    let patch = Patch::new(7).unwrap();
    let ellipsoid = Ellipsoid::MOON;
    build_one(
        &ellipsoid,
        leaf,
        &levels,
        &patch,
        1.0,
        &|tile| (tile == root).then_some(&plane as _),
        &mut vertices,
    )
    .unwrap();
    for vertex in vertices {
        let (x, y) = (
            f64::from(vertex.lattice[0]) / 32.0,
            f64::from(vertex.lattice[1]) / 32.0,
        );
        let x_valid = match x {
            x if x > 2.0 && x < 3.0 => 2.0,
            x if x > 3.0 && x < 4.0 => 4.0,
            x => x,
        };
        // At column 3 itself no valid node has any weight.
        let expected = if x == 3.0 {
            0.0
        } else {
            (16.0 * x_valid - 32.0 * y).round()
        };
        let height = vertex.point().to_ecef().length() - ellipsoid.semi_major_m;
        assert!(
            (height - expected).abs() < 1e-5,
            "at {x}, {y}: {height}, not {expected}"
        );
    }
}

#[test]
fn data_22_levels_coarser_does_not_overflow() {
    struct Extreme(Tile);
    impl terrain::Lattice for Extreme {
        fn tile(&self) -> Tile {
            self.0
        }
        fn height(&self, i: i64, j: i64) -> Option<i32> {
            Some(if (i + j) % 2 == 0 {
                i32::MAX
            } else {
                i32::MAX - 2
            })
        }
    }
    let root = Tile::ROOTS[1];
    let leaf = Tile::new(1, 22, 1234, 4321).unwrap();
    let data = Extreme(root);
    let mut vertices = Vec::new();
    let heights = build_one(
        &Ellipsoid::EARTH,
        leaf,
        &Seams::uniform(0).levels,
        &Patch::new(2).unwrap(),
        1.0 / 1024.0,
        &|tile| (tile == root).then_some(&data as _),
        &mut vertices,
    )
    .unwrap();
    assert!(heights.lowest_m >= f64::from(i32::MAX - 2) / 1024.0);
    assert!(heights.highest_m <= f64::from(i32::MAX) / 1024.0);
}
