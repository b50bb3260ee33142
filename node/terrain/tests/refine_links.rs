//! Proof that twins are the same vertex, over all faces and differences of level; and that the ring around
//! what is visible is wide enough for its marks.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod common;
mod refined;

use std::collections::{HashMap, HashSet};

use common::Random;
use geodesy::{LatticePoint, Tile};
use refined::{planet, random_forest};
use terrain::{
    ALLOWANCE_WORDS, BLOCKS, Domain, LATTICE_NODES, LinkKind, Marks, NOT_AT_HAND, Selection, ring,
    top_down,
};

/// The vertex of a mark, as deep as levels go, so that leaves of all levels compare.
fn vertex(tile: Tile, [x, y]: [u16; 2]) -> [i64; 3] {
    let point = LatticePoint::of_tile(tile, i64::from(x), i64::from(y));
    point.at_level(22).unwrap().cube()
}

fn border() -> impl Iterator<Item = [u16; 2]> {
    (0..=256).flat_map(|t| [[0, t], [256, t], [t, 0], [t, 256]])
}

#[test]
fn twins_are_the_same_vertex_and_none_is_missing() {
    let mut random = Random(1);
    let mut links = HashMap::new();
    for round in 0..40 {
        let selection = random_forest(&mut random, 1 + round % 4, 4);
        let domain = planet(&selection);
        // All leaves that have a mark at a vertex.
        let mut holders: HashMap<[i64; 3], Vec<(u16, [u16; 2])>> = HashMap::new();
        for (place, leaf) in (0..).zip(&domain.leaves) {
            for mark in border().collect::<HashSet<_>>() {
                holders
                    .entry(vertex(leaf.tile, mark))
                    .or_default()
                    .push((place, mark));
            }
            for (edge, link) in leaf.links.iter().enumerate() {
                let link = link.expect("on a whole planet every edge has a link");
                let key = (edge, link.edge, link.flip, link.half, link.kind as u8);
                *links.entry(key).or_insert(0) += 1;
                assert!(!link.places.contains(&NOT_AT_HAND));
                assert_eq!(leaf.finer >> edge & 1 == 1, link.kind == LinkKind::Finer);
                assert_eq!(
                    leaf.coarser >> edge & 1 == 1,
                    link.kind == LinkKind::Coarser
                );
            }
        }
        for (place, leaf) in (0..).zip(&domain.leaves) {
            for [x, y] in border() {
                let found: HashSet<_> = domain.twins(place, x, y).collect();
                let mut others: HashSet<_> = holders[&vertex(leaf.tile, [x, y])]
                    .iter()
                    .copied()
                    .filter(|holder| holder.0 != place)
                    .collect();
                let corner = |c: u16| c == 0 || c == 256;
                if corner(x) && corner(y) {
                    // Leaves that only touch at the corner are no twins.
                    assert!(found.is_subset(&others), "{:?} at {x}, {y}", leaf.tile);
                    continue;
                }
                // At the middle of an edge beside finer leaves, these have corners there.
                others.retain(|(other, _)| {
                    let leaves = leaf.links.iter().flatten();
                    leaves.clone().any(|link| link.places.contains(other))
                });
                assert_eq!(found, others, "{} at {x}, {y}", leaf.tile);
                for (other, [x2, y2]) in found {
                    assert!(
                        domain
                            .twins(other, x2, y2)
                            .any(|twin| twin == (place, [x, y]))
                    );
                }
            }
            assert_eq!(domain.twins(place, 5, 7).count(), 0);
        }
    }
    let kinds = |kind: u8| links.keys().filter(|key| key.4 == kind).count();
    // Straight onto the opposite edge, and flipped onto one that stands upright on it; half by half beside coarser ones.
    assert_eq!([kinds(0), kinds(1), kinds(2)], [8, 16, 8], "{links:?}");
    let flips: HashSet<_> = links.keys().map(|key| (key.2, key.4)).collect();
    assert_eq!(flips.len(), 6);
}

#[test]
fn records_say_what_links_say() {
    let mut random = Random(2);
    let selection = random_forest(&mut random, 3, 4);
    let all = selection.leaves();
    let some: Vec<Tile> = all
        .iter()
        .copied()
        .filter(|_| random.below(2) == 0)
        .collect();
    let (mut partial, mut none) = (0, 0);
    for tiles in [all, &some] {
        let domain = Domain::new(&selection, tiles);
        let whole = planet(&selection);
        for (place, leaf) in domain.leaves.iter().enumerate() {
            let at = all.iter().position(|tile| *tile == leaf.tile).unwrap();
            // What lies beyond is known where it is not at hand, too.
            assert_eq!(
                (leaf.finer, leaf.coarser),
                (whole.leaves[at].finer, whole.leaves[at].coarser)
            );
            let record = domain.record(place, 77);
            let flags = u32::from(leaf.finer) | u32::from(leaf.coarser) << 4;
            assert_eq!(record[8..], [flags, 77, u32::from(leaf.tile.level()), 0]);
            for (edge, link) in leaf.links.iter().enumerate() {
                let [first, second] = [record[2 * edge], record[2 * edge + 1]];
                let full = whole.leaves[at].links[edge].unwrap();
                let Some(link) = link else {
                    assert_eq!([first, second], [0, 0]);
                    none += 1;
                    continue;
                };
                assert_eq!(
                    (link.edge, link.flip, link.half),
                    (full.edge, full.flip, full.half)
                );
                assert_eq!(first & 0xffff, u32::from(link.places[0]));
                assert_eq!(first >> 16 & 3, [1, 2, 3][link.kind as usize]);
                assert_eq!(first >> 18 & 3, u32::from(link.edge));
                assert_eq!(
                    first >> 20,
                    u32::from(link.flip) | u32::from(link.half) << 1
                );
                assert_eq!(second, u32::from(link.places[1]));
                let finer = link.kind == LinkKind::Finer;
                for n in 0..if finer { 2 } else { 1 } {
                    let tile = all[usize::from(full.places[n])];
                    let wanted = tiles
                        .binary_search(&tile)
                        .map_or(NOT_AT_HAND, |at| at as u16);
                    assert_eq!(link.places[n], wanted);
                    partial += usize::from(wanted == NOT_AT_HAND);
                }
            }
            for [x, y] in border() {
                let twins = domain.twins(place as u16, x, y);
                let found: HashSet<_> = twins
                    .map(|(place, mark)| (tiles[usize::from(place)], mark))
                    .collect();
                let wanted: HashSet<_> = whole
                    .twins(at as u16, x, y)
                    .map(|(place, mark)| (all[usize::from(place)], mark))
                    .filter(|(tile, _)| tiles.contains(tile))
                    .collect();
                assert_eq!(found, wanted);
            }
        }
    }
    assert!(partial > 0 && none > 0, "{partial} {none}");
    assert_eq!(planet(&selection).record(all.len(), 1), [0; 12]);
}

/// A table of limits: triangles of levels 0…6 always split or never, smaller ones never.
fn limits(split: bool) -> Vec<u32> {
    let mut table = vec![u32::MAX; ALLOWANCE_WORDS];
    if split {
        table[BLOCKS..].fill(0);
    }
    table
}

/// The marks of leaves `tiles` where some are split, whatever the view, and others never.
fn split(selection: &Selection, tiles: &[Tile], how: &dyn Fn(Tile) -> Split) -> Vec<Marks> {
    let flat = vec![0; LATTICE_NODES];
    let tables = [limits(false), limits(true), Vec::new()]; // what is missing is always split
    let allowances: Vec<&[u32]> = tiles
        .iter()
        .map(|tile| tables[how(*tile) as usize].as_slice())
        .collect();
    let errors = vec![flat.as_slice(); tiles.len()];
    top_down(&Domain::new(selection, tiles), &errors, &allowances)
}

#[derive(Clone, Copy, PartialEq)]
enum Split {
    Never,
    Coarse,
    Whole,
}

fn any(random: &mut Random, leaves: &[Tile]) -> Tile {
    leaves[random.below(leaves.len() as u64) as usize]
}

/// Marks are the union of what each failing triangle asks for. So nothing outside the ring counts if everything outside
/// being split leaves the marks of a leaf as they are; and then the same holds for any set of visible leaves.
#[test]
fn nothing_outside_the_ring_of_a_leaf_counts() {
    let mut random = Random(3);
    for round in 0..60 {
        let selection = random_forest(&mut random, 1 + round % 5, 5);
        let leaves = selection.leaves();
        for turn in 0..40.min(leaves.len()) {
            let leaf = any(&mut random, leaves);
            let outside = if turn == 0 && round < 4 {
                Split::Whole
            } else {
                Split::Coarse
            };
            let tiles = ring(&selection, &[leaf]);
            assert!(tiles.is_sorted_by(|a, b| a < b) && tiles.len() <= 20);
            let never = |_: Tile| Split::Never;
            let inside = |tile: Tile| {
                if tiles.contains(&tile) {
                    Split::Never
                } else {
                    outside
                }
            };
            let local = split(&selection, &tiles, &never);
            let global = split(&selection, leaves, &inside);
            let at = |tiles: &[Tile]| tiles.binary_search(&leaf).unwrap();
            assert!(
                local[at(&tiles)] == global[at(leaves)],
                "{leaf} in {leaves:?}"
            );
        }
    }
}

/// Were it narrower, marks would be missed: proof that the test above can fail, and that no leaf is in it for nothing.
#[test]
fn every_leaf_of_a_ring_counts() {
    let mut random = Random(4);
    let mut beyond = 0;
    for round in 0..30 {
        let selection = random_forest(&mut random, 1 + round % 5, 5);
        let leaves = selection.leaves();
        for _ in 0..6 {
            let leaf = any(&mut random, leaves);
            let at = leaves.binary_search(&leaf).unwrap();
            let touching = selection.leaves_around(leaf);
            let without = &split(&selection, leaves, &|_| Split::Never)[at];
            for member in ring(&selection, &[leaf])
                .into_iter()
                .filter(|tile| *tile != leaf)
            {
                let only = |tile: Tile| {
                    if tile == member {
                        Split::Coarse
                    } else {
                        Split::Never
                    }
                };
                assert!(
                    split(&selection, leaves, &only)[at] != *without,
                    "{member} beside {leaf}"
                );
                beyond += usize::from(!touching.contains(&member));
            }
        }
    }
    assert!(beyond > 50, "{beyond} leaves that count without touching");
}
