//! Addressing, positions and neighbours, held against the `s2` crate. S2's directions are points of a
//! sphere and ours are geodetic normals: what is compared are the unit vectors.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use geodesy::{
    CELLS, Direction, FACES, Face, LatticePoint, Tile, TilePosition, st_to_uv, uv_to_st,
};
use glam::DVec3;
use proptest::prelude::*;
use s2::cellid::CellID;

/// S2 counts i and j at its own deepest level.
const S2_LEVEL: u32 = 30;

fn cell(tile: Tile) -> CellID {
    let shift = S2_LEVEL - u32::from(tile.level());
    // The middle of the tile, which for level 30 would be its only leaf.
    let ij = |c: u32| ((u64::from(c) << shift) + (1_u64 << shift) / 2) as i32;
    CellID::from_face_ij(tile.face().number(), ij(tile.x()), ij(tile.y()))
        .parent(u64::from(tile.level()))
}

fn tile(cell: CellID) -> Tile {
    let (face, i, j, _) = cell.face_ij_orientation();
    let shift = S2_LEVEL - cell.level() as u32;
    Tile::new(
        face,
        cell.level() as u8,
        i as u32 >> shift,
        j as u32 >> shift,
    )
    .unwrap()
}

fn any_tile() -> impl Strategy<Value = Tile> {
    (0..6_u8, 0..=22_u8, any::<u32>(), any::<u32>(), 0..4_u8).prop_map(
        |(face, level, x, y, place)| {
            let last = (1_u64 << level) as u32 - 1;
            // A quarter each: anywhere, on an edge, on another edge, at a corner.
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

fn sorted(mut tiles: Vec<Tile>) -> Vec<Tile> {
    tiles.sort_unstable();
    tiles.dedup();
    tiles
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(4000) })]

    #[test]
    fn cells_are_tiles(tile_here in any_tile()) {
        let here = cell(tile_here);
        prop_assert_eq!(tile(here), tile_here);
        prop_assert_eq!(here.level(), u64::from(tile_here.level()));
        // The centre, as cube coordinates and as direction.
        let uv = here.center_uv();
        let centre = TilePosition { tile: tile_here, i: 128.0, j: 128.0 };
        let (u, v) = tile_here.face().uv_of(centre.normal());
        prop_assert!((u - uv.x).abs() < 1e-15 && (v - uv.y).abs() < 1e-15, "{u} {v} {uv:?}");
        let raw = here.raw_point();
        let direction = DVec3::new(raw.x, raw.y, raw.z).normalize();
        prop_assert!(direction.distance(centre.normal()) < 1e-15);
        let node = LatticePoint::of_tile(tile_here, CELLS / 2, CELLS / 2).normal();
        prop_assert!(direction.distance(node) < 1e-15);
        // And back from a direction.
        let found = TilePosition::of_normal(direction, tile_here.level());
        prop_assert_eq!(found.tile, tile_here);
        // At level 22 the rounding of uv is a part in 10^7 of a tile.
        prop_assert!((found.i - 128.0).abs() < 1e-3 && (found.j - 128.0).abs() < 1e-3, "{found:?}");
        // Its bounds in cube space.
        let bound = here.bound_uv();
        let corner = |i, j| {
            let n = LatticePoint::of_tile(tile_here, i, j).normal();
            tile_here.face().uv_of(n)
        };
        let (low, high) = (corner(0, 0), corner(CELLS, CELLS));
        prop_assert!((bound.x.lo - low.0).abs() < 1e-14 && (bound.y.lo - low.1).abs() < 1e-14);
        prop_assert!((bound.x.hi - high.0).abs() < 1e-14 && (bound.y.hi - high.1).abs() < 1e-14);
    }

    #[test]
    fn edge_neighbours_are_those_of_s2(tile_here in any_tile()) {
        // S2's order: down, right, up, left.
        let ours = [Direction::Down, Direction::Right, Direction::Up, Direction::Left]
            .map(|direction| tile_here.neighbour(direction).unwrap());
        let theirs = cell(tile_here).edge_neighbors().map(tile);
        prop_assert_eq!(ours, theirs);
    }

    #[test]
    fn all_neighbours_are_those_of_s2(tile_here in any_tile()) {
        prop_assume!(tile_here.level() > 0);
        let ours = sorted(Direction::ALL.iter().filter_map(|d| tile_here.neighbour(*d)).collect());
        let theirs = cell(tile_here).all_neighbors(u64::from(tile_here.level()));
        let theirs = sorted(theirs.into_iter().map(tile).collect());
        prop_assert_eq!(&ours, &theirs);
        let last = (1_u64 << tile_here.level()) as u32 - 1;
        let ends = [tile_here.x(), tile_here.y()].iter().filter(|c| **c == 0 || **c == last).count();
        prop_assert_eq!(ours.len(), if ends == 2 { 7 } else { 8 });
        // Neighbours know each other.
        for other in ours {
            prop_assert!(Direction::ALL.iter().any(|d| other.neighbour(*d) == Some(tile_here)));
        }
    }

    #[test]
    fn children_and_parents_are_those_of_s2(tile_here in any_tile()) {
        if let Some(children) = tile_here.children() {
            let theirs = sorted(cell(tile_here).children().into_iter().map(tile).collect());
            prop_assert_eq!(sorted(children.to_vec()), theirs);
            for (index, child) in children.into_iter().enumerate() {
                prop_assert_eq!(child.parent(), Some(tile_here));
                prop_assert_eq!(child.child_index(), index);
                prop_assert!(tile_here.contains(child) && !child.contains(tile_here));
            }
        }
        for level in 0..=tile_here.level() {
            prop_assert_eq!(tile_here.ancestor(level), tile(cell(tile_here).parent(u64::from(level))));
        }
        prop_assert_eq!(tile_here.lineage().count(), usize::from(tile_here.level()) + 1);
        prop_assert_eq!(tile_here.parent().is_none(), tile_here.level() == 0);
    }

    #[test]
    fn directions_fall_on_s2s_faces(x in -1.0_f64..1.0, y in -1.0_f64..1.0, z in -1.0_f64..1.0) {
        let direction = DVec3::new(x, y, z);
        prop_assume!(direction.length() > 1e-3);
        let leaf = CellID::from(s2::point::Point::from_coords(x, y, z));
        let face = Face::of_direction(direction);
        prop_assert_eq!(face.number(), leaf.face());
        let (u, v) = face.uv_of(direction);
        prop_assert!(u.abs() <= 1.0 && v.abs() <= 1.0);
        // The same tile, unless rounding takes a direction across an edge.
        for level in [0, 3, 11, 22] {
            let found = TilePosition::of_normal(direction, level);
            let inside = |c: f64| c > 1e-3 && c < 255.999;
            if inside(found.i) && inside(found.j) {
                prop_assert_eq!(found.tile, tile(leaf.parent(u64::from(level))));
            }
            prop_assert!(found.normal().distance(direction.normalize()) < 1e-15);
        }
        prop_assert!(face.cube_point(u, v).normalize().distance(direction.normalize()) < 1e-15);
        let frame = face.frame();
        prop_assert_eq!(frame[0] * u + frame[1] * v + frame[2], face.cube_point(u, v));
    }

    #[test]
    fn the_projection_is_quadratic_and_odd(s in 0.0_f64..=1.0) {
        prop_assert!((uv_to_st(st_to_uv(s)) - s).abs() < 1e-15);
        // S2 Geometry, s2coords.h, S2_QUADRATIC_PROJECTION.
        let quadratic = if s >= 0.5 { (4.0 * s * s - 1.0) / 3.0 } else { (1.0 - 4.0 * (1.0 - s) * (1.0 - s)) / 3.0 };
        prop_assert!((st_to_uv(s) - quadratic).abs() < 1e-15);
        // Exactly odd about the middle for dyadic numbers, so that faces mirror bit for bit.
        let dyadic = (s * 4_294_967_296.0).round() / 4_294_967_296.0;
        prop_assert_eq!(st_to_uv(1.0 - dyadic), -st_to_uv(dyadic));
    }

    #[test]
    fn numbers_are_unique_ordered_and_read_back(a in any_tile(), b in any_tile()) {
        prop_assert_eq!(Tile::from_id(a.id()), Some(a));
        prop_assert_eq!(a.id() == b.id(), a == b);
        if a.level() == b.level() {
            // Depth first: where two tiles part, their ancestors' order is their order.
            let parted = (0..=a.level()).find(|level| a.ancestor(*level) != b.ancestor(*level));
            if let Some(level) = parted {
                prop_assert_eq!(a.id() < b.id(), a.ancestor(level).id() < b.ancestor(level).id());
                if level > 0 {
                    let order = |t: Tile| t.ancestor(level).child_index();
                    prop_assert_eq!(a.id() < b.id(), order(a) < order(b));
                } else {
                    prop_assert_eq!(a.id() < b.id(), a.face() < b.face());
                }
            }
        } else {
            prop_assert_eq!(a.id() < b.id(), a.level() < b.level());
        }
        prop_assert_eq!(a.to_string().parse::<Tile>().unwrap(), a);
        prop_assert_eq!(a < b, (a.level(), a.face(), a.y(), a.x()) < (b.level(), b.face(), b.y(), b.x()));
    }

    #[test]
    fn other_numbers_are_no_tiles(id in any::<u64>(), shift in 0..64_u32) {
        let id = id >> shift;
        if let Some(tile) = Tile::from_id(id) {
            prop_assert_eq!(tile.id(), id);
        }
    }
}

#[test]
fn addresses_out_of_range_are_refused_by_name() {
    for (face, level, x, y) in [
        (6, 0, 0, 0),
        (0, 23, 0, 0),
        (0, 0, 1, 0),
        (1, 4, 16, 0),
        (1, 4, 0, 16),
        (0, 22, u32::MAX, 0),
    ] {
        let error = Tile::new(face, level, x, y).unwrap_err().to_string();
        assert!(
            error.contains(&format!("{face}/{level}/{x}/{y}")),
            "{error}"
        );
    }
    for text in [
        "",
        "1/2/3",
        "1/2/3/1/0",
        "a/0/0/0",
        "300/0/0/0",
        "0/-1/0/0",
        "0 /1/0/0",
    ] {
        assert!(text.parse::<Tile>().is_err(), "{text}");
    }
    assert_eq!(FACES.map(Face::number), [0, 1, 2, 3, 4, 5]);
    assert_eq!(Face::new(6), None);
    assert_eq!(Tile::from_id(0), None);
}
