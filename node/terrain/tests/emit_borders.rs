//! Refined leaves side by side: the same bits at shared vertices, and closed surfaces over the whole planet.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod common;

use std::cell::RefCell;
use std::collections::HashMap;

use common::{Noise, PLACES, Random, Resident, lookup, mix, view};
use geodesy::{Ellipsoid, Tile};
use glam::DVec3;
use terrain::{
    ALLOWANCE_WORDS, BLOCKS, BORDER_WORDS, Domain, ElevationLayer, LATTICE_NODES, Lattice,
    LodLimits, Marks, Seams, Selection, Vertex, Walker, anchors, border_index, border_positions,
    border_words, build, count, emit, quantise, seams, select, top_down, uniform,
};

const UNIT_M: f64 = 1.0 / 128.0;
const QUANTUM_M: f64 = 1.0 / 16.0;

/// A planet's leaves with their borders as `build` makes them.
struct Planet {
    ellipsoid: Ellipsoid,
    domain: Domain,
    borders: Vec<Vec<Vertex>>,
    words: Vec<Vec<u32>>,
}

impl Planet {
    /// Leaves show nothing, their own data or an ancestor's, as chance has it.
    fn new(ellipsoid: Ellipsoid, selection: &Selection, random: &mut Random) -> Self {
        let seed = random.next();
        let mut resident = Resident::new();
        let mut shown: HashMap<Tile, Option<u8>> = HashMap::new();
        for leaf in selection.leaves() {
            let level = random.below(u64::from(leaf.level()) + 2).checked_sub(1);
            let level = level.map(|level| level as u8);
            shown.insert(*leaf, level);
            let tile = leaf.ancestor(level.unwrap_or(0));
            let noise = Noise {
                tile,
                seed,
                amplitude: 16 * 4_000,
                holes: 9,
            };
            resident.insert(tile, noise);
        }
        let data = lookup(&resident);
        let data = |tile: Tile| data(tile).map(|noise| noise as &dyn Lattice);
        let (mut borders, mut words) = (Vec::new(), Vec::new());
        let domain = Domain::new(selection, selection.leaves());
        for leaf in &domain.leaves {
            let Seams { levels, variant } = seams(leaf.tile, selection, &|tile| shown[&tile]);
            assert_eq!(variant, leaf.finer);
            let heights_m = RefCell::new(Vec::new());
            let fuse = |_: DVec3, samples: &[Option<i32>]| {
                let height_m = f64::from(samples[0].unwrap_or(0)) * QUANTUM_M;
                heights_m.borrow_mut().push(height_m);
                height_m
            };
            let mut vertices = Vec::new();
            let layers = [ElevationLayer {
                levels,
                data: &data,
            }];
            build(
                &ellipsoid,
                leaf.tile,
                &layers,
                border_positions(),
                &fuse,
                &mut vertices,
            )
            .unwrap();
            words.push(border_words(
                &vertices,
                &heights_m.into_inner(),
                UNIT_M,
                leaf.coarser,
            ));
            borders.push(vertices);
        }
        Self {
            ellipsoid,
            domain,
            borders,
            words,
        }
    }

    /// The mesh of the leaf at `place` over random ground.
    fn mesh(&self, place: usize, marks: &Marks, seed: u64) -> (Vec<Vertex>, Vec<u32>) {
        let hash = |n: usize| mix(seed ^ (n as u64) << 20 ^ place as u64);
        let units = |hash: u64| quantise((hash % 16_000) as f64 - 8_000.0, UNIT_M);
        let heights: Vec<i32> = (0..LATTICE_NODES).map(|n| units(hash(n))).collect();
        let references: Vec<i32> = (0..BLOCKS).map(|n| units(hash(n + 70_000))).collect();
        let tile = self.domain.leaves[place].tile;
        let anchors = anchors(&self.ellipsoid, tile, &references, UNIT_M);
        emit(marks, &heights, &anchors, &self.words[place], UNIT_M)
    }

    /// Emits all leaves and walks all edges.
    fn assert_closed(&self, marks: &[Marks], seed: u64) {
        let mut walker = Walker::default();
        let mut triangles = 0;
        for (place, marks) in marks.iter().enumerate() {
            let (vertices, indices) = self.mesh(place, marks, seed);
            let counted = count(marks);
            assert_eq!(counted.vertices as usize, vertices.len());
            assert_eq!(counted.triangles as usize, indices.len() / 3);
            for vertex in &vertices {
                let [x, y] = vertex.lattice;
                if let Some(node) = border_index(x, y) {
                    assert_eq!(*vertex, self.borders[place][node]);
                }
            }
            triangles += indices.len() / 3;
            walker.add(&vertices, &indices);
        }
        let walk = walker.finish();
        assert!(walk.is_closed(), "{walk:?} in {} leaves", marks.len());
        assert_eq!(walk.euler_characteristic(), 2, "{walk:?}");
        assert_eq!(walk.triangles, triangles);
    }
}

/// Selections around places that try the cube, of few leaves and many.
fn selections() -> Vec<Selection> {
    let ellipsoid = Ellipsoid::EARTH;
    PLACES
        .iter()
        .zip([2e7, 3e6, 1e5, 5e6, 1e4, 2e6].iter().cycle())
        .map(|((latitude, longitude), altitude_m)| {
            let mut view = view(&ellipsoid, *latitude, *longitude, *altitude_m);
            view.pixels_per_radian = 100.0;
            select(
                &ellipsoid,
                &view,
                &LodLimits::default(),
                &common::earth_like,
            )
        })
        .collect()
}

#[test]
fn twins_have_the_same_bits() {
    let mut random = Random(51);
    // Same, coarser and finer; between faces; at corners of the cube.
    let (mut kinds, mut between_faces, mut at_corners) = ([0; 3], 0, 0);
    for selection in selections() {
        let planet = Planet::new(Ellipsoid::EARTH, &selection, &mut random);
        for (place, leaf) in planet.domain.leaves.iter().enumerate() {
            for (node, [x, y]) in border_positions().iter().enumerate() {
                let own = &planet.borders[place][node];
                assert_eq!(own.lattice, [*x, *y]);
                for (beside, [i, j]) in planet.domain.twins(place as u16, *x, *y) {
                    let other = usize::from(beside);
                    let twin = &planet.borders[other][border_index(i, j).unwrap()];
                    assert_eq!((own.position, own.normal), (twin.position, twin.normal));
                    let at = node * BORDER_WORDS;
                    let there = border_index(i, j).unwrap() * BORDER_WORDS;
                    assert_eq!(
                        planet.words[place][at..at + 8],
                        planet.words[other][there..there + 8]
                    );
                    let neighbour = planet.domain.leaves[other].tile;
                    let coarser = neighbour.level().cmp(&leaf.tile.level());
                    kinds[(coarser as i8 + 1) as usize] += 1;
                    between_faces += usize::from(neighbour.face() != leaf.tile.face());
                    let point =
                        geodesy::LatticePoint::of_tile(leaf.tile, i64::from(*x), i64::from(*y));
                    at_corners += usize::from(point.on_cube_corner());
                }
            }
        }
    }
    assert!(kinds.iter().all(|twins| *twins > 10_000) && between_faces > 10_000);
    assert!(at_corners >= 8 * 6);
}

#[test]
fn refined_planets_are_closed() {
    let mut random = Random(52);
    let mut mixed = 0;
    for (number, selection) in selections().iter().enumerate() {
        let planet = Planet::new(Ellipsoid::EARTH, selection, &mut random);
        for levels in [0, 1, 4] {
            let seed = random.next();
            planet.assert_closed(&uniform(&planet.domain, levels), seed);
        }
        // Errors at random, of which some triangles fail: meshes of all levels at once.
        let percent = [5, 10, 20][number % 3];
        let leaves = planet.domain.leaves.len();
        let errors: Vec<Vec<u32>> = (0..leaves)
            .map(|_| {
                let start = random.next();
                let fails = |n: usize| u32::from(mix(start ^ n as u64) % 100 < percent);
                (0..LATTICE_NODES)
                    .map(|n| fails(n) | fails(n + LATTICE_NODES) << 16)
                    .collect()
            })
            .collect();
        let errors: Vec<&[u32]> = errors.iter().map(Vec::as_slice).collect();
        let limits = vec![0x0001_0001; ALLOWANCE_WORDS];
        let marks = top_down(&planet.domain, &errors, &vec![limits.as_slice(); leaves]);
        let vertices = marks.iter().map(Marks::count);
        mixed += vertices
            .clone()
            .filter(|count| (100..60_000).contains(count))
            .count();
        planet.assert_closed(&marks, random.next());
    }
    assert!(mixed > 20, "{mixed} leaves of many levels");
}

#[test]
fn finest_meshes_are_closed() {
    // Six roots with every mark, and a mark less beside a coarser leaf.
    let mut random = Random(53);
    let ellipsoid = Ellipsoid::EARTH;
    let far = view(&ellipsoid, 10.0, 20.0, 5e8);
    let mut selection = select(&ellipsoid, &far, &LodLimits::default(), &common::earth_like);
    assert_eq!(selection.leaves().len(), 6);
    for _ in 0..2 {
        let planet = Planet::new(ellipsoid, &selection, &mut random);
        let marks = uniform(&planet.domain, 15);
        let missing = marks.iter().map(|marks| LATTICE_NODES - marks.count());
        let of_two_edges = 2 * 128;
        assert!(missing.max() <= Some(of_two_edges));
        planet.assert_closed(&marks, random.next());
        // Closer until some root is divided.
        let limits = LodLimits {
            deepest_level: 1,
            ..LodLimits::default()
        };
        let mut altitude_m = 1e8;
        while selection.leaves().len() == 6 && altitude_m > 1e5 {
            altitude_m *= 0.9;
            let near = view(&ellipsoid, 35.3, 20.0, altitude_m);
            selection = select(&ellipsoid, &near, &limits, &common::earth_like);
        }
        let levels = selection.leaves().iter().map(|leaf| leaf.level());
        assert_eq!((levels.clone().min(), levels.max()), (Some(0), Some(1)));
    }
}
