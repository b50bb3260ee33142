//! The selection covers the planet once, is restricted everywhere, and obeys its criterion and budget.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod common;

use std::cell::RefCell;
use std::collections::HashMap;

use common::{PLACES, Random, earth_like, view};
use geodesy::{CELLS, Direction, Ellipsoid, Face, LatticePoint, Tile, TileHull};
use glam::DVec3;
use terrain::{EdgeNeighbour, Frustum, LodLimits, LodView, Selection, cull, select};

fn some_selections() -> Vec<(Ellipsoid, LodView, LodLimits, Selection)> {
    let mut random = Random(11);
    let bodies = [Ellipsoid::EARTH, Ellipsoid::MOON, Ellipsoid::MARS];
    let mut made = Vec::new();
    for round in 0..60 {
        let ellipsoid = bodies[round % 3];
        let normal = match PLACES.get(round) {
            Some((latitude, longitude)) => Ellipsoid::normal(*latitude, *longitude),
            None => random.direction(),
        };
        let eye = ellipsoid.point(normal, 10.0_f64.powf(random.between(0.3, 7.8)));
        let view = LodView {
            eye,
            pixels_per_radian: random.between(300.0, 2000.0),
        };
        let limits = LodLimits {
            deepest_level: random.below(23) as u8,
            tile_px: 257.0,
            most_tiles: 4000,
        };
        let selection = select(&ellipsoid, &view, &limits, &earth_like);
        made.push((ellipsoid, view, limits, selection));
    }
    made
}

#[test]
fn leaves_are_sorted_and_cover_the_planet_once() {
    for (_, _, limits, selection) in some_selections() {
        let leaves = selection.leaves();
        assert!(leaves.is_sorted() && leaves.len() <= limits.most_tiles);
        // Areas in units of the deepest level's tiles, exactly.
        let area: u64 = leaves
            .iter()
            .map(|leaf| 1_u64 << (2 * (22 - leaf.level())))
            .sum();
        assert_eq!(area, 6 << 44);
        for leaf in leaves {
            assert!(leaf.level() <= limits.deepest_level);
            assert!(selection.is_leaf(*leaf) && !selection.is_divided(*leaf));
            for ancestor in leaf.lineage().skip(1) {
                assert!(!selection.is_leaf(ancestor) && selection.is_divided(ancestor));
                assert_eq!(selection.leaf_at(ancestor), None);
            }
            assert_eq!(selection.leaf_at(*leaf), Some(*leaf));
            for child in leaf.children().into_iter().flatten() {
                assert_eq!(selection.leaf_at(child), Some(*leaf));
                assert!(!selection.is_leaf(child));
            }
        }
    }
}

#[test]
fn leaves_that_touch_differ_by_one_level_at_most() {
    // Which tiles touch is asked of the lattice's shared nodes, not of the neighbour rules that selection uses.
    for (_, _, _, selection) in some_selections() {
        for leaf in selection.leaves() {
            let mut touching = Vec::new();
            for step in 0..4 {
                let along = step * CELLS / 4;
                for (i, j) in [
                    (along, 0),
                    (CELLS, along),
                    (CELLS - along, CELLS),
                    (0, CELLS - along),
                ] {
                    let point = LatticePoint::of_tile(*leaf, i, j);
                    touching.extend(point.tiles());
                    // The finer tiles at the same place.
                    if let Some(finer) =
                        (leaf.level() < 22).then(|| point.at_level(leaf.level() + 1))
                    {
                        touching.extend(finer.unwrap().tiles());
                    }
                }
            }
            let mut around = Vec::new();
            for tile in touching {
                match selection.leaf_at(tile) {
                    Some(beside) => {
                        assert!(beside.level() + 1 >= leaf.level(), "{beside} beside {leaf}");
                        around.push(beside);
                    }
                    // Divided further: only tiles of the leaf's own level may be.
                    None => assert_eq!(
                        tile.level(),
                        leaf.level(),
                        "{tile} beside {leaf} is divided"
                    ),
                }
            }
            around.retain(|tile| tile != leaf);
            around.sort_unstable();
            around.dedup();
            assert_eq!(around, selection.leaves_around(*leaf), "around {leaf}");
        }
    }
}

#[test]
fn edge_neighbours_agree_from_both_sides() {
    let back = |from: Tile, to: Tile, selection: &Selection| {
        Direction::EDGES
            .iter()
            .filter_map(|edge| selection.edge_neighbour(from, *edge))
            .any(|n| match n {
                EdgeNeighbour::Same(tile) | EdgeNeighbour::Coarser(tile) => tile == to,
                EdgeNeighbour::Finer(tiles) => tiles.contains(&to),
            })
    };
    for (_, _, _, selection) in some_selections() {
        for leaf in selection.leaves() {
            for edge in Direction::EDGES {
                match selection.edge_neighbour(*leaf, edge).unwrap() {
                    EdgeNeighbour::Same(tile) => {
                        assert_eq!(tile.level(), leaf.level());
                        assert!(selection.is_leaf(tile) && back(tile, *leaf, &selection));
                    }
                    EdgeNeighbour::Coarser(tile) => {
                        assert_eq!(tile.level() + 1, leaf.level());
                        assert!(selection.is_leaf(tile) && back(tile, *leaf, &selection));
                    }
                    EdgeNeighbour::Finer(tiles) => {
                        let along = |n| match edge {
                            Direction::Left => (0, n),
                            Direction::Right => (CELLS, n),
                            Direction::Down => (n, 0),
                            _ => (n, CELLS),
                        };
                        for (tile, place) in tiles.into_iter().zip([CELLS / 4, 3 * CELLS / 4]) {
                            assert_eq!(tile.level(), leaf.level() + 1);
                            assert!(selection.is_leaf(tile) && back(tile, *leaf, &selection));
                            // The order is that of the growing coordinate.
                            let (i, j) = along(place);
                            let node = LatticePoint::of_tile(*leaf, i, j)
                                .at_level(tile.level())
                                .unwrap();
                            assert!(node.tiles().contains(&tile));
                        }
                    }
                }
            }
        }
        assert_eq!(
            selection.edge_neighbour(selection.leaves()[0], Direction::LeftUp),
            None
        );
        assert_eq!(
            selection.corner_neighbour(selection.leaves()[0], Direction::Left),
            None
        );
    }
}

#[test]
fn the_result_is_the_smallest_restricted_forest_that_obeys_the_criterion() {
    // By brute force: divide every leaf that covers too much, then every leaf that is too coarse beside
    // another, until nothing changes. What covers too much is learned from the selection's own
    // questions, so that this holds the restriction and the search, not the criterion.
    let ellipsoid = Ellipsoid::EARTH;
    for (latitude, longitude) in PLACES {
        let view = view(&ellipsoid, latitude, longitude, 700_000.0);
        let limits = LodLimits {
            deepest_level: 6,
            ..LodLimits::default()
        };
        let asked = RefCell::new(Vec::new());
        let record = |tile: Tile| {
            asked.borrow_mut().push(tile);
            earth_like(tile)
        };
        let selection = select(&ellipsoid, &view, &limits, &record);
        let wanted = |tile: Tile| {
            // A forest of this tile's lineage alone: the tile is divided only if it covers too much.
            let alone = |t: Tile| {
                if t.contains(tile) {
                    earth_like(t)
                } else {
                    (0.0, 0.0)
                }
            };
            let deepest_level = tile.level() + 1;
            select(
                &ellipsoid,
                &view,
                &LodLimits {
                    deepest_level,
                    ..limits
                },
                &alone,
            )
            .is_divided(tile)
        };
        let mut known = HashMap::new();
        let mut leaves = Tile::ROOTS.to_vec();
        loop {
            let divided = leaves.iter().position(|leaf| {
                leaf.level() < limits.deepest_level
                    && (*known.entry(*leaf).or_insert_with(|| wanted(*leaf))
                        || leaves.iter().any(|other| {
                            other.level() > leaf.level() + 1
                                && Direction::ALL
                                    .iter()
                                    .filter_map(|d| other.neighbour(*d))
                                    .any(|n| leaf.contains(n))
                        }))
            });
            let Some(index) = divided else { break };
            let leaf = leaves.swap_remove(index);
            leaves.extend(leaf.children().unwrap());
        }
        leaves.sort_unstable();
        assert_eq!(selection.leaves(), leaves, "at {latitude}, {longitude}");
        assert!(
            asked.borrow().len() < 2 * leaves.len(),
            "every tile is measured once"
        );
    }
}

#[test]
fn no_leaf_shows_more_pixels_than_it_has_samples() {
    // Independent of hulls: the solid angle of the surface at its highest, summed over small quads.
    for (ellipsoid, view, limits, selection) in some_selections() {
        for leaf in selection
            .leaves()
            .iter()
            .filter(|leaf| leaf.level() < limits.deepest_level)
        {
            let (_, highest_m) = earth_like(*leaf);
            let step = CELLS / 8;
            let mut solid_angle = 0.0;
            for i in (0..CELLS).step_by(step as usize) {
                for j in (0..CELLS).step_by(step as usize) {
                    let at = |di, dj| {
                        let normal = LatticePoint::of_tile(*leaf, i + di, j + dj).normal();
                        ellipsoid.point(normal, highest_m) - view.eye
                    };
                    let (a, b, c, d) = (at(0, 0), at(step, 0), at(step, step), at(0, step));
                    let area = 0.5 * (c - a).cross(d - b);
                    let middle = 0.25 * (a + b + c + d);
                    solid_angle += (-area.dot(middle) / middle.length().powi(3)).max(0.0);
                }
            }
            let px = solid_angle * view.pixels_per_radian.powi(2);
            assert!(
                px <= 1.05 * selection.achieved_tile_px().powi(2),
                "{leaf}: {px} px"
            );
        }
    }
}

#[test]
fn poles_cost_what_the_equator_costs() {
    let limits = LodLimits {
        deepest_level: 16,
        ..LodLimits::default()
    };
    let bodies = [Ellipsoid::EARTH, Ellipsoid::MARS];
    for (body, altitude_m) in bodies
        .iter()
        .flat_map(|b| [200.0, 2e3, 2e4, 5e5, 3e6, 2e7, 4e7].map(|a| (b, a)))
    {
        // All leaves, and those that a square picture of 60° straight down shows.
        let count = |latitude: f64, longitude: f64| {
            let view = view(body, latitude, longitude, altitude_m);
            let selection = select(body, &view, &limits, &earth_like);
            let [east, north, up] = Ellipsoid::east_north_up(body.normal_below(view.eye));
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(x, y): (f64, f64)| -up + (east * x + north * y) * 0.577);
            let frusta = [Frustum::from_corners(view.eye, corners)];
            let horizon = geodesy::Horizon::new(body, -600.0, view.eye);
            let seen = cull(body, &selection, &frusta, &horizon, &earth_like).len();
            (selection.leaves().len() as f64, seen as f64)
        };
        // Few tiles are in view, and they are of one level or of four times as many: at one longitude in
        // ten chance decides, so the visible ones are held against their mean and against longitude 0.
        let longitudes = [
            0.0, 20.0, 37.0, 45.0, 66.0, 77.0, 90.0, 135.0, 158.0, 180.0, -45.0, -101.0,
        ];
        let equator: Vec<_> = longitudes
            .iter()
            .map(|longitude| count(0.0, *longitude))
            .collect();
        let mean_seen = equator.iter().map(|(_, seen)| seen).sum::<f64>() / equator.len() as f64;
        for (latitude, longitude) in [(90.0, 0.0), (-90.0, 0.0), (90.0, 33.0), (-90.0, -120.0)] {
            let (leaves, seen) = count(latitude, longitude);
            for (at_equator, _) in &equator {
                assert!(
                    leaves <= 1.5 * at_equator,
                    "{altitude_m} m: {leaves} leaves, not {at_equator}"
                );
            }
            assert!(
                seen <= 1.5 * mean_seen,
                "{altitude_m} m: {seen} seen, not {mean_seen}"
            );
            assert!(
                seen <= 1.5 * equator[0].1,
                "{altitude_m} m: {seen} seen, not {}",
                equator[0].1
            );
        }
    }
}

#[test]
fn a_budget_lowers_quality_by_known_steps() {
    let ellipsoid = Ellipsoid::EARTH;
    let view = view(&ellipsoid, 46.5, 8.0, 3000.0);
    let free = select(&ellipsoid, &view, &LodLimits::default(), &earth_like);
    assert_eq!(free.achieved_tile_px(), 257.0);
    let mut before = f64::INFINITY;
    for most_tiles in [6, 7, 20, 50, 100, 200, 400, 4000] {
        let limits = LodLimits {
            most_tiles,
            ..LodLimits::default()
        };
        let selection = select(&ellipsoid, &view, &limits, &earth_like);
        assert!(selection.leaves().len() <= most_tiles);
        let steps = 2.0 * (selection.achieved_tile_px() / 257.0).log2();
        assert!((steps - steps.round()).abs() < 1e-9 && steps >= -1e-9);
        assert!(
            selection.achieved_tile_px() <= before,
            "more tiles, no worse quality"
        );
        before = selection.achieved_tile_px();
        // One step finer would not fit.
        if steps > 0.5 {
            let tile_px = selection.achieved_tile_px() / std::f64::consts::SQRT_2;
            let finer = LodLimits {
                tile_px,
                most_tiles: usize::MAX,
                ..limits
            };
            assert!(
                select(&ellipsoid, &view, &finer, &earth_like)
                    .leaves()
                    .len()
                    > most_tiles
            );
        }
    }
}

#[test]
fn senseless_views_select_the_roots() {
    let ellipsoid = Ellipsoid::EARTH;
    for (eye, pixels_per_radian, tile_px) in [
        (DVec3::splat(f64::NAN), 1000.0, 257.0),
        (DVec3::new(7e6, f64::INFINITY, 0.0), 1000.0, 257.0),
        (DVec3::new(7e6, 0.0, 0.0), f64::NAN, 257.0),
        (DVec3::new(7e6, 0.0, 0.0), f64::INFINITY, 257.0),
        (DVec3::new(7e6, 0.0, 0.0), 0.0, 257.0),
        (DVec3::new(7e6, 0.0, 0.0), 1000.0, 0.0),
        (DVec3::new(7e6, 0.0, 0.0), 1000.0, f64::NAN),
    ] {
        let view = LodView {
            eye,
            pixels_per_radian,
        };
        let limits = LodLimits {
            tile_px,
            ..LodLimits::default()
        };
        assert_eq!(
            select(&ellipsoid, &view, &limits, &earth_like).leaves(),
            Tile::ROOTS
        );
    }
    // In the very middle of the planet everything is split until the budget says no.
    let limits = LodLimits {
        most_tiles: 100,
        ..LodLimits::default()
    };
    let view = LodView {
        eye: DVec3::ZERO,
        pixels_per_radian: 1000.0,
    };
    assert!(
        select(&ellipsoid, &view, &limits, &earth_like)
            .leaves()
            .len()
            <= 100
    );
}

#[test]
fn the_eye_is_always_over_the_finest_tiles() {
    for (latitude, longitude) in PLACES {
        let ellipsoid = Ellipsoid::EARTH;
        let view = view(&ellipsoid, latitude, longitude, 2.0);
        let limits = LodLimits {
            deepest_level: 18,
            ..LodLimits::default()
        };
        let selection = select(&ellipsoid, &view, &limits, &|_| (-1.0, 1.0));
        let below = geodesy::TilePosition::of_normal(ellipsoid.normal_below(view.eye), 18).tile;
        assert!(selection.is_leaf(below));
        let hull = TileHull::new(&ellipsoid, below, -1.0, 1.0);
        assert!(hull.ball.centre.distance(view.eye) < 200.0);
        assert!(Face::new(below.face().number()).is_some());
    }
}
