//! Several elevation layers in one mesh: what one layer was before, what the fuse function is given, and no
//! gaps, whatever each layer shows where and whatever the fuse function does at the rim of a lens.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod common;

use std::cell::RefCell;
use std::collections::HashMap;

use common::{Noise, PLACES, Random, Resident, build_one, lookup};
use geodesy::{Circle, Ellipsoid, LatticePoint, Relation, Tile, TilePosition};
use glam::DVec3;
use terrain::{
    ElevationLayer, Lattice, LodLimits, LodView, MAX_ELEVATION_LAYERS, MeshError, Patch, Seams,
    Selection, Vertex, Walker, build, seams, select,
};

const QUANTUM_M: f64 = 1.0 / 16.0;

/// One elevation layer of a whole planet: which level each leaf shows of it, and the data for that.
struct Layer {
    shown: HashMap<Tile, Option<u8>>,
    resident: Resident,
}

impl Layer {
    /// Leaves show this layer at random levels, at most `deepest`, and here and there not at all.
    fn random(random: &mut Random, selection: &Selection, deepest: u8, holes: u64) -> Self {
        let seed = random.next();
        let mut resident = Resident::new();
        let shown = selection.leaves().iter().map(|leaf| {
            let most = leaf.level().min(deepest);
            let level = match random.below(8) {
                0 => None,
                1 | 2 => Some(random.below(u64::from(most) + 1) as u8),
                _ => Some(most),
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
        Self { shown, resident }
    }
}

type Fuse<'a> = dyn Fn(DVec3, &[Option<i32>]) -> f64 + 'a;

/// A leaf's vertices, and its border variant, out of all layers.
fn mesh(
    ellipsoid: &Ellipsoid,
    leaf: Tile,
    selection: &Selection,
    layers: &[Layer],
    patch: &Patch,
    fuse: &Fuse<'_>,
) -> (Vec<Vertex>, u8) {
    let own: Vec<Seams> = layers
        .iter()
        .map(|layer| seams(leaf, selection, &|tile| layer.shown[&tile]))
        .collect();
    let finders: Vec<_> = layers
        .iter()
        .map(|layer| |tile: Tile| layer.resident.get(&tile).map(|noise| noise as &dyn Lattice))
        .collect();
    let elevation: Vec<ElevationLayer<'_>> = finders
        .iter()
        .zip(&own)
        .map(|(data, seams)| ElevationLayer {
            levels: seams.levels,
            data,
        })
        .collect();
    let mut vertices = Vec::new();
    build(
        ellipsoid,
        leaf,
        &elevation,
        &patch.positions,
        fuse,
        &mut vertices,
    )
    .unwrap();
    (vertices, own[0].variant)
}

/// The last valid layer above half of the one below it, as an example of fusion.
fn blend(samples: &[Option<i32>]) -> f64 {
    let mut height_m: Option<f64> = None;
    for sample in samples.iter().flatten() {
        let own = f64::from(*sample) * QUANTUM_M;
        height_m = Some(height_m.map_or(own, |below| 0.3 * below + 0.7 * own));
    }
    height_m.unwrap_or(-20.0)
}

/// FNV-1a (G. Fowler, L. C. Noll, K.-P. Vo), 64 bits.
fn hashed(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

#[test]
fn one_layer_as_it_is_has_the_bits_it_always_had() {
    // The hash is that of the meshes of the version that knew one layer only.
    let mut random = Random(11);
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut count = 0_usize;
    for (round, (latitude, longitude)) in PLACES.into_iter().enumerate() {
        let ellipsoid = [Ellipsoid::EARTH, Ellipsoid::MOON, Ellipsoid::MARS][round % 3];
        let over = Ellipsoid::normal(latitude, longitude);
        let view = LodView {
            eye: ellipsoid.point(over, 10.0_f64.powi(round as i32 % 6 + 2)),
            pixels_per_radian: 300.0,
        };
        let limits = LodLimits {
            deepest_level: 12,
            tile_px: 257.0,
            most_tiles: 300,
        };
        let selection = select(&ellipsoid, &view, &limits, &common::earth_like);
        let seed = random.next();
        let holes = [0, 3, 40][round % 3];
        let mut resident = Resident::new();
        let shown = selection.leaves().iter().map(|leaf| {
            let level = match random.below(6) {
                0 => None,
                1 | 2 => Some(random.below(u64::from(leaf.level()) + 1) as u8),
                _ => Some(leaf.level()),
            };
            if let Some(level) = level {
                let tile = leaf.ancestor(level);
                let amplitude = 100_000;
                resident.insert(
                    tile,
                    Noise {
                        tile,
                        seed,
                        amplitude,
                        holes,
                    },
                );
            }
            (*leaf, level)
        });
        let shown: HashMap<_, _> = shown.collect();
        let patch = Patch::new(2 + round as u8 % 3).unwrap();
        let mut vertices = Vec::new();
        for leaf in selection.leaves() {
            let Seams { levels, .. } = seams(*leaf, &selection, &|tile| shown[&tile]);
            let data = lookup(&resident);
            let heights = build_one(
                &ellipsoid,
                *leaf,
                &levels,
                &patch,
                QUANTUM_M,
                &data,
                &mut vertices,
            )
            .unwrap();
            let ends = [heights.lowest_m, heights.highest_m].map(|h| h.to_bits().to_le_bytes());
            hash = hashed(hash, ends.as_flattened());
        }
        count += vertices.len();
        for vertex in &vertices {
            hash = hashed(hash, &vertex.to_bytes());
        }
    }
    assert_eq!((count, hash), (240_246, 0xf1aa_f618_097a_bc57));
}

/// Builds the whole planet with a lens inside which heights are three times as large and 100 m higher. All
/// surfaces must close, and all vertices of one place have the same bits.
fn lensed_planet_is_closed(
    random: &mut Random,
    ellipsoid: &Ellipsoid,
    selection: &Selection,
    patch: &Patch,
    circle: &Circle,
) {
    let layers = [
        Layer::random(random, selection, 22, 0),
        Layer::random(random, selection, 5, 3),
        Layer::random(random, selection, 2, 20),
    ];
    let fuse = |normal: DVec3, samples: &[Option<i32>]| {
        let height_m = blend(samples);
        if circle.contains(normal) {
            3.0 * height_m + 100.0
        } else {
            height_m
        }
    };
    let mut walker = Walker::default();
    let mut places: HashMap<LatticePoint, [u32; 6]> = HashMap::new();
    let (mut shared, mut inside, mut outside) = (0, 0, 0);
    for leaf in selection.leaves() {
        let (vertices, variant) = mesh(ellipsoid, *leaf, selection, &layers, patch, &fuse);
        walker.add(&vertices, &patch.indices[usize::from(variant)]);
        let relation = circle.relation(*leaf);
        for vertex in &vertices {
            let [i, j] = vertex.lattice.map(i64::from);
            let point = LatticePoint::of_tile(*leaf, i, j);
            let lensed = circle.contains(point.normal());
            inside += usize::from(lensed);
            outside += usize::from(!lensed);
            assert!(
                relation
                    != if lensed {
                        Relation::Outside
                    } else {
                        Relation::Inside
                    }
            );
            // Leaves of different levels name a shared vertex at the finest level alike.
            let finest = point.at_level(22).unwrap();
            let on_edge = i % 256 == 0 || j % 256 == 0;
            if let Some(before) = places.insert(finest, vertex.position) {
                assert!(on_edge);
                assert_eq!(before, vertex.position, "{leaf} at {i}, {j}");
                shared += 1;
            }
        }
    }
    let walk = walker.finish();
    assert!(walk.is_closed(), "{walk:?}");
    assert_eq!(walk.euler_characteristic(), 2, "{walk:?}");
    assert!(shared > 0 && inside > 0 && outside > 0);
}

/// A selection around a place whose leaves differ in level there.
fn selection_at(ellipsoid: &Ellipsoid, normal: DVec3, altitude_m: f64) -> Selection {
    let view = LodView {
        eye: ellipsoid.point(normal, altitude_m),
        pixels_per_radian: 300.0,
    };
    let limits = LodLimits {
        deepest_level: 14,
        tile_px: 257.0,
        most_tiles: 1000,
    };
    select(ellipsoid, &view, &limits, &common::earth_like)
}

#[test]
fn the_planet_is_closed_with_three_layers_and_a_lens() {
    let mut random = Random(21);
    let bodies = [Ellipsoid::EARTH, Ellipsoid::MOON, Ellipsoid::MARS];
    for round in 0..36 {
        let ellipsoid = bodies[round % 3];
        // All special places first: cube corners, face edges, the poles.
        let normal = PLACES.get(round).map_or_else(
            || random.direction(),
            |(latitude, longitude)| Ellipsoid::normal(*latitude, *longitude),
        );
        let altitude_m = 10.0_f64.powf(random.between(3.0, 7.0));
        let selection = selection_at(&ellipsoid, normal, altitude_m);
        // Around the place in view, from within one leaf to a third of the planet; its rim crosses coarse and
        // fine leaves.
        let radius_m = altitude_m.min(1.5e6) * random.between(0.3, 2.5);
        let beside =
            (normal + random.direction() * (0.5 * radius_m / ellipsoid.semi_major_m)).normalize();
        let (latitude, longitude) = Ellipsoid::angles_deg(beside);
        let circle = Circle::new(&ellipsoid, latitude, longitude, radius_m).unwrap();
        let patch = Patch::new([2, 3, 1][round % 3]).unwrap();
        lensed_planet_is_closed(&mut random, &ellipsoid, &selection, &patch, &circle);
    }
}

#[test]
fn a_rim_through_vertices_opens_nothing() {
    // The rim passes through the very corners of tiles: the closest call there is.
    let mut random = Random(22);
    let ellipsoid = Ellipsoid::EARTH;
    for (round, (latitude, longitude)) in PLACES.into_iter().enumerate() {
        let normal = Ellipsoid::normal(latitude, longitude);
        let selection = selection_at(&ellipsoid, normal, 20_000.0);
        let leaf = TilePosition::of_normal(normal, 22).tile;
        let leaf = *selection
            .leaves()
            .iter()
            .find(|l| l.contains(leaf))
            .unwrap();
        let corner = LatticePoint::of_tile(leaf, 0, 256).normal();
        let (mut inside, mut outside) = (1e3, 1e6);
        for _ in 0..60 {
            let radius_m = 0.5 * (inside + outside);
            let circle = Circle::new(&ellipsoid, latitude, longitude, radius_m).unwrap();
            if circle.contains(corner) {
                outside = radius_m;
            } else {
                inside = radius_m;
            }
        }
        let circle = Circle::new(
            &ellipsoid,
            latitude,
            longitude,
            [inside, outside][round % 2],
        )
        .unwrap();
        let patch = Patch::new(3).unwrap();
        lensed_planet_is_closed(&mut random, &ellipsoid, &selection, &patch, &circle);
    }
}

#[test]
fn the_fuse_function_gets_each_layers_sample_and_the_normal() {
    let ellipsoid = Ellipsoid::MARS;
    let leaf = Tile::new(3, 4, 6, 9).unwrap();
    let noise = |tile, seed, holes| Noise {
        tile,
        seed,
        amplitude: 1000,
        holes,
    };
    let own = noise(leaf, 1, 2);
    let coarse = noise(leaf.parent().unwrap(), 2, 3);
    let resident_own = Resident::from([(own.tile, own)]);
    let resident_coarse = Resident::from([(coarse.tile, coarse)]);
    let (find_own, find_coarse) = (
        |tile| resident_own.get(&tile).map(|n| n as &dyn Lattice),
        |tile| resident_coarse.get(&tile).map(|n| n as &dyn Lattice),
    );
    let layers = [
        ElevationLayer {
            levels: Seams::uniform(3).levels,
            data: &find_coarse,
        },
        ElevationLayer {
            levels: Seams::uniform(terrain::NO_DATA).levels,
            data: &find_own,
        },
        ElevationLayer {
            levels: Seams::uniform(4).levels,
            data: &find_own,
        },
    ];
    let calls = RefCell::new(Vec::new());
    let fuse = |normal: DVec3, samples: &[Option<i32>]| {
        calls.borrow_mut().push((normal, samples.to_vec()));
        0.25 * calls.borrow().len() as f64
    };
    let patch = Patch::new(7).unwrap();
    let mut vertices = Vec::new();
    let heights = build(
        &ellipsoid,
        leaf,
        &layers,
        &patch.positions,
        &fuse,
        &mut vertices,
    )
    .unwrap();
    let calls = calls.take();
    assert_eq!(calls.len(), vertices.len());
    assert_eq!(heights.lowest_m, 0.25);
    assert_eq!(heights.highest_m, 0.25 * calls.len() as f64);
    let (mut holes, mut even) = (0, 0);
    for (number, (vertex, (normal, samples))) in vertices.iter().zip(&calls).enumerate() {
        let [i, j] = vertex.lattice.map(i64::from);
        let point = LatticePoint::of_tile(leaf, i, j);
        assert_eq!(
            normal.to_array().map(f64::to_bits),
            point.normal().to_array().map(f64::to_bits)
        );
        let height_m = 0.25 * (number + 1) as f64;
        let exact = geodesy::frame::FixedPoint::from_ecef(ellipsoid.point(*normal, height_m));
        assert_eq!(vertex.point(), exact);
        assert_eq!(samples[1..], [None, own.height(i, j)]);
        holes += usize::from(samples[2].is_none());
        if i % 2 == 0 && j % 2 == 0 {
            // Nodes of the coarse layer itself: no valid node means no sample.
            let (u, v) = point.position_in(coarse.tile).unwrap();
            assert_eq!(samples[0], coarse.height(u / 2, v / 2));
            even += 1;
        }
    }
    assert!(holes > 1000 && even > 1000);
}

#[test]
fn refusals_leave_nothing_behind() {
    let leaf = Tile::new(0, 3, 1, 2).unwrap();
    let patch = Patch::new(2).unwrap();
    let mut vertices = vec![Vertex {
        position: [1; 6],
        normal: [2; 4],
        lattice: [3; 2],
    }];
    let before = vertices.clone();
    let layer = ElevationLayer {
        levels: Seams::uniform(terrain::NO_DATA).levels,
        data: &|_| None,
    };
    let earth = Ellipsoid::EARTH;
    let mut attempt = |count: usize, fuse: &Fuse<'_>| {
        let result = build(
            &earth,
            leaf,
            &vec![layer; count],
            &patch.positions,
            fuse,
            &mut vertices,
        );
        assert!(result.is_ok() || vertices == before);
        vertices.truncate(1);
        result
    };
    assert!(attempt(0, &|_, samples| samples.len() as f64).is_ok());
    assert!(attempt(MAX_ELEVATION_LAYERS, &|_, samples| samples.len() as f64).is_ok());
    assert_eq!(
        attempt(MAX_ELEVATION_LAYERS + 1, &|_, _| 0.0),
        Err(MeshError::TooManyLayers(9))
    );
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let middle = LatticePoint::of_tile(leaf, 128, 128).normal();
        let error = attempt(2, &|normal, _| if normal == middle { wrong } else { 5.0 });
        assert_eq!(
            error,
            Err(MeshError::NotFinite {
                tile: leaf,
                i: 128,
                j: 128
            })
        );
    }
}
