//! Lattice nodes: one address, one direction and one owner for every point, from whatever tile it is named.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use geodesy::{BORDER, CELLS, Direction, LatticePoint, NODES, STORED_NODES, Tile};
use proptest::prelude::*;

fn any_tile() -> impl Strategy<Value = Tile> {
    (0..6_u8, 0..=22_u8, any::<u32>(), any::<u32>(), 0..4_u8).prop_map(
        |(face, level, x, y, place)| {
            let last = (1_u64 << level) as u32 - 1;
            let end = |c: u32| if c & 1 == 0 { 0 } else { last };
            let (x, y) = match place {
                0 => (x & last, y & last),
                1 => (end(x), y & last),
                2 => (x & last, end(y)),
                _ => (end(x), end(y)),
            };
            Tile::new(face, level, x, y).unwrap()
        },
    )
}

/// Nodes of a tile, edges and corners as often as the inside.
fn any_node() -> impl Strategy<Value = (i64, i64)> {
    let along = || prop_oneof![Just(0), Just(CELLS), 0..=CELLS];
    (along(), along())
}

fn bits(point: LatticePoint) -> [u64; 3] {
    point.normal().to_array().map(|c| (c + 0.0).to_bits())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(4000) })]

    #[test]
    fn every_tile_that_shares_a_node_names_it_alike((tile, (i, j)) in (any_tile(), any_node())) {
        let point = LatticePoint::of_tile(tile, i, j);
        let tiles = point.tiles();
        prop_assert!(tiles.is_sorted() && tiles.contains(&tile));
        let on_edges = usize::from(i % CELLS == 0) + usize::from(j % CELLS == 0);
        let expected = match on_edges {
            2 if point.on_cube_corner() => 3,
            n => 1 << n,
        };
        prop_assert_eq!(tiles.len(), expected);
        for other in &tiles {
            let (oi, oj) = point.within(*other).unwrap();
            let again = LatticePoint::of_tile(*other, oi, oj);
            prop_assert_eq!(again, point);
            prop_assert_eq!(bits(again), bits(point));
        }
        prop_assert!((point.normal().length() - 1.0).abs() < 1e-15);
        // No other tile near it has it.
        for direction in Direction::ALL {
            if let Some(beside) = tile.neighbour(direction) {
                prop_assert_eq!(point.within(beside).is_some(), tiles.contains(&beside));
            }
        }
        let (owner, oi, oj) = point.owner();
        prop_assert!(tiles.contains(&owner));
        prop_assert_eq!(point.within(owner), Some((oi, oj)));
        for other in &tiles {
            let (i, j) = point.within(*other).unwrap();
            prop_assert_eq!(LatticePoint::of_tile(*other, i, j).owner(), (owner, oi, oj));
        }
    }

    #[test]
    fn levels_share_every_other_node((tile, (i, j)) in (any_tile(), any_node())) {
        let point = LatticePoint::of_tile(tile, i, j);
        for level in tile.level()..=22 {
            let finer = point.at_level(level).unwrap();
            prop_assert_eq!(finer.level(), level);
            prop_assert_eq!(bits(finer), bits(point));
            prop_assert_eq!(finer.at_level(tile.level()), Some(point));
            prop_assert_eq!(finer.on_face_edge(), point.on_face_edge());
            // The finer node lies in this tile at a whole number of fine steps.
            let shift = level - tile.level();
            prop_assert_eq!(finer.position_in(tile), Some((i << shift, j << shift)));
        }
        if let Some(parent) = tile.parent() {
            let coarser = point.at_level(tile.level() - 1);
            prop_assert_eq!(coarser.is_some(), i % 2 == 0 && j % 2 == 0);
            let (u, v) = point.position_in(parent).unwrap();
            prop_assert!((0..=2 * CELLS).contains(&u) && (0..=2 * CELLS).contains(&v));
            if let Some(coarser) = coarser {
                prop_assert_eq!(coarser.within(parent), Some((u / 2, v / 2)));
                prop_assert_eq!(bits(coarser), bits(point));
            }
            prop_assert_eq!(point.within(parent), None);
        }
        for ancestor in tile.lineage() {
            prop_assert!(point.position_in(ancestor).is_some());
        }
        for child in tile.children().into_iter().flatten() {
            prop_assert_eq!(point.position_in(child), None);
        }
    }

    #[test]
    fn borders_are_the_neighbours_nodes(
        (tile, along, beyond) in (any_tile(), 0..=CELLS, 1..=BORDER),
    ) {
        for edge in Direction::EDGES {
            let (i, j) = match edge {
                Direction::Left => (-beyond, along),
                Direction::Right => (CELLS + beyond, along),
                Direction::Down => (along, -beyond),
                _ => (along, CELLS + beyond),
            };
            let point = LatticePoint::of_tile(tile, i, j);
            let beside = tile.neighbour(edge).unwrap();
            // `beyond` steps from the shared edge, and straight on from the node on it.
            let inside = point.within(beside);
            prop_assert!(inside.is_some(), "{tile} {i} {j} is not in {beside}");
            let (oi, oj) = inside.unwrap();
            let edge_node = LatticePoint::of_tile(tile, i.clamp(0, CELLS), j.clamp(0, CELLS));
            let (ei, ej) = edge_node.within(beside).unwrap();
            prop_assert_eq!((oi - ei).abs() + (oj - ej).abs(), beyond);
            prop_assert!(oi == ei || oj == ej);
            // The other tile's border names our own nodes in turn.
            let back = [(2 * ei - oi, 2 * ej - oj)].map(|(i, j)| LatticePoint::of_tile(beside, i, j));
            let own = LatticePoint::of_tile(tile, 2 * i.clamp(0, CELLS) - i, 2 * j.clamp(0, CELLS) - j);
            prop_assert_eq!(back[0], own);
        }
    }

    #[test]
    fn corner_borders_are_the_diagonal_neighbours_nodes(
        (tile, a, b) in (any_tile(), 1..=BORDER, 1..=BORDER),
    ) {
        for (corner, i, j) in [
            (Direction::LeftDown, -a, -b),
            (Direction::RightDown, CELLS + a, -b),
            (Direction::LeftUp, -a, CELLS + b),
            (Direction::RightUp, CELLS + a, CELLS + b),
        ] {
            let point = LatticePoint::of_tile(tile, i, j);
            match tile.neighbour(corner) {
                Some(beyond) => prop_assert!(point.within(beyond).is_some(), "{tile} {i} {j}"),
                // No lattice continues beyond a cube corner; the fold ends on a tile next to it.
                None => {
                    let shared = LatticePoint::of_tile(tile, i.clamp(0, CELLS), j.clamp(0, CELLS));
                    prop_assert!(shared.on_cube_corner());
                    prop_assert!(shared.tiles().iter().any(|t| point.within(*t).is_some()));
                }
            }
        }
    }

    #[test]
    fn folding_keeps_neighbouring_nodes_together((tile, i, j) in (any_tile(), -BORDER..NODES + BORDER - 1, -BORDER..NODES + BORDER)) {
        // Neighbouring indices are neighbouring points: no node of the stored array is far off.
        let step = LatticePoint::of_tile(tile, i, j).normal().distance(LatticePoint::of_tile(tile, i + 1, j).normal());
        let corner_fold = !(0..CELLS).contains(&i) && !(0..=CELLS).contains(&j);
        let typical = 1.0 / (CELLS << tile.level()) as f64;
        let limit = if corner_fold { 2.0 * BORDER as f64 + 2.0 } else { 2.7 };
        prop_assert!(step < limit * typical, "{step} against {typical}");
    }
}

#[test]
fn sizes() {
    assert_eq!(STORED_NODES, 275);
    assert_eq!(NODES, 257);
    let point = LatticePoint::of_tile(Tile::ROOTS[2], 17, 256);
    assert_eq!(point.cube().iter().filter(|c| c.abs() == 256).count(), 2);
    assert!(point.on_face_edge() && !point.on_cube_corner());
}
