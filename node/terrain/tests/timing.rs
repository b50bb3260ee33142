//! What a frame's decisions cost. Prints times; run with
//! `cargo test --release -p terrain --test timing -- --ignored --nocapture`.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]
#![allow(clippy::print_stdout, reason = "printing is what it is for")]

mod common;

use std::time::Instant;

use common::{PLACES, build_one, view};
use geodesy::{Ellipsoid, Horizon, LatticePoint, Tile};
use glam::DVec3;
use terrain::{Frustum, Lattice, LodLimits, Patch, cull, seams, select};

fn fastest_us(mut work: impl FnMut()) -> f64 {
    (0..30)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64() * 1e6
        })
        .fold(f64::INFINITY, f64::min)
}

struct Flat(Tile, Vec<i32>);

impl Lattice for Flat {
    fn tile(&self) -> Tile {
        self.0
    }
    fn height(&self, i: i64, j: i64) -> Option<i32> {
        let value = *self.1.get(((j + 9) * 275 + i + 9) as usize)?;
        (value != i32::MIN).then_some(value)
    }
}

#[test]
#[ignore = "measures time"]
fn times() {
    let earth = Ellipsoid::EARTH;
    let limits = LodLimits {
        deepest_level: 14,
        ..LodLimits::default()
    };
    println!("altitude_m  ppr  leaves  select_us  cull_us  visible  seams_us");
    for altitude_m in [40e6, 10e6, 500e3, 10e3, 500.0] {
        for pixels_per_radian in [1100.0, 2000.0] {
            let (mut leaves, mut select_us, mut cull_us, mut visible, mut seams_us) =
                (0, 0.0_f64, 0.0_f64, 0, 0.0_f64);
            for (latitude, longitude) in PLACES {
                let mut lod = view(&earth, latitude, longitude, altitude_m);
                lod.pixels_per_radian = pixels_per_radian;
                let mut selection = select(&earth, &lod, &limits, &common::earth_like);
                select_us = select_us.max(fastest_us(|| {
                    selection = select(&earth, &lod, &limits, &common::earth_like);
                }));
                let normal = earth.normal_below(lod.eye);
                let [east, north, up] = Ellipsoid::east_north_up(normal);
                let forward = if altitude_m > 1e5 {
                    -up
                } else {
                    (north - 0.1 * up).normalize()
                };
                let above = if altitude_m > 1e5 { north } else { up };
                let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                    .map(|(x, y): (f64, f64)| forward + east * (0.58 * x) + above * (0.33 * y));
                let frusta = [Frustum::from_corners(lod.eye, corners)];
                let horizon = Horizon::new(&earth, -600.0, lod.eye);
                let mut seen = Vec::new();
                cull_us = cull_us.max(fastest_us(|| {
                    seen = cull(&earth, &selection, &frusta, &horizon, &common::earth_like);
                }));
                let mut keys = 0;
                seams_us = seams_us.max(fastest_us(|| {
                    for tile in &seen {
                        keys += usize::from(seams(*tile, &selection, &|t| Some(t.level())).variant);
                    }
                }));
                leaves = leaves.max(selection.leaves().len());
                visible = visible.max(seen.len());
            }
            println!(
                "{altitude_m} {pixels_per_radian} {leaves} {select_us:.0} {cull_us:.0} {visible} {seams_us:.0}"
            );
        }
    }
    let tile = Tile::new(1, 8, 77, 99).unwrap();
    let samples: Vec<i32> = (0..275 * 275).map(|n| n % 5000).collect();
    let data: Vec<Flat> = LatticePoint::of_tile(tile, 0, 0)
        .tiles()
        .into_iter()
        .chain(tile.lineage())
        .map(|tile| Flat(tile, samples.clone()))
        .collect();
    for refinement in [3, 4, 5, 7] {
        let patch = Patch::new(refinement).unwrap();
        let mut vertices = Vec::new();
        for shown in [8, 7, 4] {
            let levels = terrain::Seams::uniform(shown).levels;
            let us = fastest_us(|| {
                vertices.clear();
                let find = |tile| data.iter().find(|d| d.0 == tile).map(|d| d as &dyn Lattice);
                build_one(
                    &earth,
                    tile,
                    &levels,
                    &patch,
                    1.0 / 16.0,
                    &find,
                    &mut vertices,
                )
                .unwrap();
            });
            let count = patch.positions.len();
            println!(
                "refinement {refinement}, data level {shown}: {count} vertices, {us:.1} us, {:.1} ns each",
                us * 1e3 / count as f64
            );
        }
    }
    let references: Vec<i32> = (0..256).collect();
    let anchors_us = fastest_us(|| {
        let words = terrain::anchors(&earth, tile, &references, 0.25);
        assert!(!words.is_empty());
    });
    println!("anchors {anchors_us:.0} us");
    let hull_us = fastest_us(|| {
        let mut sum = DVec3::ZERO;
        for x in 0..100 {
            sum += geodesy::TileHull::new(&earth, Tile::new(1, 8, x, 99).unwrap(), -10.0, 100.0)
                .corners[7];
        }
        assert!(sum.is_finite());
    });
    println!("hull {:.0} ns", hull_us * 10.0);
}
