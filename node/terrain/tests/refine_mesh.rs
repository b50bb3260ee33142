//! Proof that refined meshes conform, cover and close over whole planets, top down as bottom up.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]
#![allow(clippy::print_stdout, reason = "one test prints what it measures")]

mod common;
mod refined;

use std::time::Instant;

use common::Random;
use geodesy::frame::FixedPoint;
use geodesy::{LatticePoint, Tile};
use glam::DVec3;
use refined::{adversarial, forest, fractal, nodes, planet, random_forest, random_limits};
use terrain::{
    Domain, Marks, Selection, Vertex, Walker, bottom_up, pair, pyramid, ring, top_down, triangles,
    uniform,
};

/// A vertex whose position is the lattice point itself, so that it is exact which vertices are one.
fn vertex(tile: Tile, [x, y]: [u16; 2]) -> Vertex {
    let point = LatticePoint::of_tile(tile, i64::from(x), i64::from(y));
    Vertex {
        position: FixedPoint(point.at_level(22).unwrap().cube()).words(),
        normal: [0; 4],
        lattice: [x, y],
    }
}

/// Apexes of what is set are set, twins agree, what must be set is and what must not is not.
fn check_conformity(domain: &Domain, marks: &[Marks]) {
    assert_eq!(marks.len(), domain.leaves.len());
    for (place, (leaf, own)) in domain.leaves.iter().zip(marks).enumerate() {
        for [x, y] in nodes() {
            for (other, [x2, y2]) in domain.twins(place as u16, x, y) {
                let other = &marks[usize::from(other)];
                assert_eq!(
                    own.is_set(x, y),
                    other.is_set(x2, y2),
                    "{} {x} {y}",
                    leaf.tile
                );
            }
            let Some(pair) = pair(8, x, y) else {
                assert!(own.is_set(x, y));
                continue;
            };
            let edges = [x == 0, x == 256, y == 0, y == 256];
            let beside = (0..4).find(|edge| edges[*edge]);
            if pair.level == 0 && beside.is_some_and(|edge| leaf.finer >> edge & 1 == 1) {
                assert!(own.is_set(x, y));
            }
            if own.is_set(x, y) {
                assert!(
                    pair.apexes
                        .into_iter()
                        .flatten()
                        .all(|[x, y]| own.is_set(x, y))
                );
                let odd = (x | y) & 1 == 1;
                assert!(!odd || beside.is_none_or(|edge| leaf.coarser >> edge & 1 == 0));
            }
        }
    }
}

/// Every leaf is covered by right isosceles triangles, all of them together are one closed surface, and all marks are used.
fn check_mesh(domain: &Domain, marks: &[Marks]) -> usize {
    let mut walker = Walker::default();
    let (mut count, mut vertices) = (0, 0);
    for (leaf, own) in domain.leaves.iter().zip(marks) {
        let triangles = triangles(own);
        let mut doubled = 0;
        let mut used = Marks::new();
        for [a, b, apex] in &triangles {
            let to = |end: &[u16; 2]| [0, 1].map(|c| i64::from(end[c]) - i64::from(apex[c]));
            let ([ax, ay], [bx, by]) = (to(a), to(b));
            assert_eq!(ax * bx + ay * by, 0, "a right angle at the apex");
            assert_eq!(ax * ax + ay * ay, bx * bx + by * by, "equal legs");
            assert!(ax * by - ay * bx > 0, "counter-clockwise");
            doubled += ax * by - ay * bx;
            for [x, y] in [a, b, apex] {
                assert!(own.is_set(*x, *y));
                used.set(*x, *y);
            }
        }
        assert_eq!(doubled, 2 * 256 * 256);
        assert_eq!(used, *own);
        count += triangles.len();
        let corners = triangles.iter().flatten();
        let corners: Vec<Vertex> = corners.map(|mark| vertex(leaf.tile, *mark)).collect();
        let numbers: Vec<u32> = (0..).take(corners.len()).collect();
        walker.add(&corners, &numbers);
        vertices += own.count();
    }
    let walk = walker.finish();
    assert!(walk.is_closed(), "{walk:?}");
    assert_eq!((walk.euler_characteristic(), walk.triangles), (2, count));
    assert!(walk.vertices <= vertices);
    count
}

fn slices(tables: &[Vec<u32>]) -> Vec<&[u32]> {
    tables.iter().map(Vec::as_slice).collect()
}

/// Errors and limits for all leaves of a selection.
fn tables(random: &mut Random, selection: &Selection) -> [Vec<Vec<u32>>; 2] {
    let seed = random.next();
    let leaves = selection.leaves();
    let errors = leaves
        .iter()
        .map(|tile| match random.below(6) {
            kind @ 0..4 => pyramid(&adversarial(random, kind)),
            _ => pyramid(&fractal(*tile, 50_000.0, 0.55, seed)),
        })
        .collect();
    let limits = leaves.iter().map(|_| {
        let most = 1 << (8 + random.below(10));
        random_limits(random, most)
    });
    let limits = limits.collect();
    [errors, limits]
}

#[test]
fn both_ways_give_one_conforming_closed_mesh() {
    let mut random = Random(7);
    let (mut counts, mut mixed) = (Vec::new(), 0);
    for round in 0..6 {
        let selection = random_forest(&mut random, 1 + round % 3, 3);
        let domain = planet(&selection);
        let [errors, limits] = tables(&mut random, &selection);
        let marks = top_down(&domain, &slices(&errors), &slices(&limits));
        assert!(marks == bottom_up(&domain, &slices(&errors), &slices(&limits)));
        check_conformity(&domain, &marks);
        let finest = uniform(&domain, 15);
        mixed += marks
            .iter()
            .zip(&finest)
            .filter(|(own, finest)| own.count() > 300 && own.count() < finest.count() - 300)
            .count();
        counts.push(check_mesh(&domain, &marks));
    }
    // It proves nothing where all is coarse or all is fine.
    assert!(mixed > 60, "{mixed} {counts:?}");
}

/// The corners of the cube, each beside leaves of all three differences of level.
#[test]
fn it_closes_at_cube_corners() {
    let mut random = Random(8);
    let corner =
        |n: u64| DVec3::from([0, 1, 2].map(|bit| if n >> bit & 1 == 1 { 1.0 } else { -1.0 }));
    for n in 0..8 {
        let hair = random.direction() * 0.01;
        let selection = forest(vec![((corner(n) + hair).normalize(), 2 + (n % 3) as u8)]);
        let domain = planet(&selection);
        let leaves = selection.leaves();
        // Little splits but at a few spikes, from which splits spread over edges.
        let errors: Vec<_> = leaves
            .iter()
            .map(|_| {
                let mut heights = vec![0; 257 * 257];
                for _ in 0..random.below(4) {
                    heights[random.below(257 * 257) as usize] = 100_000;
                }
                pyramid(&heights)
            })
            .collect();
        let limits: Vec<_> = leaves.iter().map(|_| vec![0x0400_0400; 545]).collect();
        let marks = top_down(&domain, &slices(&errors), &slices(&limits));
        assert!(marks == bottom_up(&domain, &slices(&errors), &slices(&limits)));
        check_conformity(&domain, &marks);
        check_mesh(&domain, &marks);
    }
}

#[test]
fn visible_leaves_have_the_marks_of_the_planet() {
    let mut random = Random(9);
    for round in 0..4 {
        let selection = random_forest(&mut random, 1 + round % 4, 3);
        let leaves = selection.leaves();
        let [errors, limits] = tables(&mut random, &selection);
        let global = top_down(&planet(&selection), &slices(&errors), &slices(&limits));
        for _ in 0..12 {
            // Some at random; some that lie together.
            let share = 1 + random.below(20);
            let middle = random.direction();
            let near = random.below(2) == 0;
            let visible: Vec<Tile> = leaves
                .iter()
                .copied()
                .filter(|tile| {
                    if near {
                        LatticePoint::of_tile(*tile, 128, 128).normal().dot(middle) > 0.9
                    } else {
                        random.below(share) == 0
                    }
                })
                .collect();
            let tiles = ring(&selection, &visible);
            let at = |tile: &Tile| leaves.binary_search(tile).unwrap();
            let some = |tables: &'_ [Vec<u32>]| -> Vec<Vec<u32>> {
                tiles.iter().map(|tile| tables[at(tile)].clone()).collect()
            };
            let domain = Domain::new(&selection, &tiles);
            let (errors, limits) = (some(&errors), some(&limits));
            let local = top_down(&domain, &slices(&errors), &slices(&limits));
            assert!(local == bottom_up(&domain, &slices(&errors), &slices(&limits)));
            for tile in &visible {
                let place = tiles.binary_search(tile).unwrap();
                assert!(local[place] == global[at(tile)], "{tile} of {visible:?}");
            }
        }
    }
}

#[test]
fn uniform_meshes_are_the_coarsest_the_finest_and_between() {
    let mut random = Random(10);
    for round in 0..3 {
        let selection = random_forest(&mut random, 1 + round, 3);
        let domain = planet(&selection);
        let coarsest = uniform(&domain, 0);
        for (leaf, marks) in domain.leaves.iter().zip(&coarsest) {
            assert_eq!(marks.count(), 5 + leaf.finer.count_ones() as usize);
        }
        let mut before: Vec<Marks> = coarsest.clone();
        for levels in 0..=15 {
            let marks = uniform(&domain, levels);
            for ((leaf, own), before) in domain.leaves.iter().zip(&marks).zip(&before) {
                assert!(before.positions().all(|[x, y]| own.is_set(x, y)));
                for [x, y] in nodes() {
                    let Some(pair) = pair(8, x, y) else { continue };
                    let edges = [x == 0, x == 256, y == 0, y == 256];
                    let barred = (x | y) & 1 == 1
                        && (0..4).any(|edge| edges[edge] && leaf.coarser >> edge & 1 == 1);
                    assert!(pair.level >= levels || barred != own.is_set(x, y));
                    // Nothing more at the end; and before, no more than neighbours two levels further ask for.
                    assert!(!own.is_set(x, y) || pair.level < levels + 2 || levels == 0);
                }
            }
            if round == 0 || levels < 12 {
                check_mesh(&domain, &marks);
            }
            before = marks;
        }
        assert!(before == uniform(&domain, 255));
        check_conformity(&domain, &before);
        check_conformity(&domain, &coarsest);
        // Tables that are missing are no reason to draw less.
        assert!(before == top_down(&domain, &[], &[]) && before == bottom_up(&domain, &[], &[]));
    }
}

#[test]
fn what_is_within_its_limit_stays() {
    let selection = forest(Vec::new());
    let domain = planet(&selection);
    let mut heights = vec![0; 257 * 257];
    heights[257 * 77 + 40] = 1000;
    let errors = vec![pyramid(&heights); 6];
    // A limit of n + 1 lets n stay. A spike is 1000 off in every triangle that it is a sample of.
    let marks_at = |limit: u32| {
        let tables = vec![vec![limit | limit << 16; 545]; 6];
        top_down(&domain, &slices(&errors), &slices(&tables))
    };
    // No sum of bounds is more than this.
    assert!(marks_at(5001) == uniform(&domain, 0));
    assert!(marks_at(1000).iter().all(|marks| marks.is_set(40, 77)));
    assert!(marks_at(0) == uniform(&domain, 15));
}

#[test]
#[ignore = "measures"]
fn times() {
    let selection = forest(vec![(DVec3::new(1.0, 0.2, 0.3), 5)]);
    let domain = planet(&selection);
    let errors: Vec<_> = selection
        .leaves()
        .iter()
        .map(|tile| pyramid(&fractal(*tile, 8e5, 0.5, 1)))
        .collect();
    for limit in [22_000_u32, 14_000, 12_000, 10_000, 8000, 4000] {
        let limits = vec![vec![limit | limit << 16; 545]; errors.len()];
        let fastest = |work: &dyn Fn() -> Vec<Marks>| {
            let once = |_| {
                let start = Instant::now();
                work();
                start.elapsed().as_secs_f64() * 1e3
            };
            (0..3).map(once).fold(f64::INFINITY, f64::min)
        };
        let down = fastest(&|| top_down(&domain, &slices(&errors), &slices(&limits)));
        let up = fastest(&|| bottom_up(&domain, &slices(&errors), &slices(&limits)));
        let marks = top_down(&domain, &slices(&errors), &slices(&limits));
        let set: usize = marks.iter().map(Marks::count).sum();
        let leaves = marks.len();
        println!(
            "{leaves} leaves, limit {limit}: {set} marks, top down {down:.2} ms, bottom up {up:.2} ms"
        );
    }
}
