//! No gap on any shared edge: the whole planet, as the five verification scenes select and mesh it on the
//! demo wall from real data, is one closed surface, with the cliff of a lens below the viewer. Every edge of every leaf is
//! walked, cube corners too.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::collections::HashMap;
use std::sync::Arc;

use geodesy::{Circle, Tile};
use glam::DVec3;
use protocol::{Scene, Wall};
use terrain::{ElevationLayer, Lattice, LodLimits, LodView, Patch, Walker};
use tests::{data, sources};
use tiles::{Repository, TileData};

struct Heights(Arc<TileData>);

impl Lattice for Heights {
    fn tile(&self) -> Tile {
        self.0.tile
    }

    fn height(&self, i: i64, j: i64) -> Option<i32> {
        self.0.height(i, j)
    }
}

#[test]
fn the_surface_of_every_verification_scene_is_closed() {
    let read = |file: &str| std::fs::read_to_string(sources::root().join(file)).unwrap();
    let elevation = Repository::open(&data::repositories().join("elevation")).unwrap();
    let index = elevation.load_index().unwrap();
    let wall = Wall::parse(&read("configs/walls/demo-2x2.toml"), "demo-2x2.toml").unwrap();
    let mut loaded: HashMap<Tile, Heights> = HashMap::new();
    let scenes = [
        ("globe", 3e6),
        ("limb", 2e6),
        ("mountains", 2e4),
        ("pole", 1e6),
        ("horizon", 5e3),
    ];
    for (name, radius_m) in scenes {
        let file = format!("configs/scenes/verify-{name}.toml");
        let scene = Scene::parse(&read(&file), &file).unwrap();
        let pose = scene.camera.pose(&scene.planet, 0.0);
        let view = LodView {
            eye: DVec3::from(pose.position_m),
            pixels_per_radian: wall.pixels_per_radian(),
        };
        let limits = LodLimits {
            deepest_level: index.deepest_level(),
            ..LodLimits::default()
        };
        let unit = elevation.dataset().unit();
        let range = |tile: Tile| {
            let (lowest, highest) = index.range(tile).unwrap_or_default();
            (lowest * unit, highest * unit)
        };
        let selection = terrain::select(&scene.planet, &view, &limits, &range);
        let best = |leaf: Tile| index.best(leaf);
        for tile in selection.leaves().iter().filter_map(|leaf| best(*leaf)) {
            loaded.entry(tile).or_insert_with(|| {
                let bytes = elevation
                    .read(tile)
                    .unwrap()
                    .expect("the index tells the truth");
                Heights(Arc::new(TileData::decode_tile(&bytes, tile).unwrap()))
            });
        }
        let patch = Patch::new(scene.mesh.refinement).unwrap();
        let data = |tile: Tile| loaded.get(&tile).map(|heights| heights as &dyn Lattice);
        let below = scene.planet.to_geodetic(DVec3::from(pose.position_m));
        let (latitude_deg, longitude_deg) = (below.latitude_deg, below.longitude_deg);
        let lens = Circle::new(&scene.planet, latitude_deg, longitude_deg, radius_m).unwrap();
        let mut walker = Walker::default();
        let mut mixed = 0;
        for leaf in selection.leaves() {
            let seams = terrain::seams(*leaf, &selection, &|leaf| best(leaf).map(Tile::level));
            mixed += usize::from(
                seams
                    .levels
                    .corners
                    .iter()
                    .any(|c| *c != seams.levels.inside),
            );
            let mut vertices = Vec::new();
            let layers = [ElevationLayer {
                levels: seams.levels,
                data: &data,
            }];
            // As a lens changes heights: by geodetic normal and sample alone, with a cliff at its rim.
            let fuse = |normal: DVec3, samples: &[Option<i32>]| {
                let height_m = samples[0].map_or(0.0, |quanta| f64::from(quanta) * unit);
                if lens.contains(normal) {
                    3.0 * height_m + 2_000.0
                } else {
                    height_m
                }
            };
            terrain::build(
                &scene.planet,
                *leaf,
                &layers,
                &patch.positions,
                &fuse,
                &mut vertices,
            )
            .unwrap();
            walker.add(&vertices, &patch.indices[usize::from(seams.variant)]);
        }
        let walk = walker.finish();
        assert!(walk.is_closed(), "{name}: {walk:?}");
        assert_eq!(walk.euler_characteristic(), 2, "{name}: {walk:?}");
        let leaves = selection.leaves().len();
        eprintln!("{name}: {leaves} leaves, {mixed} of them beside coarser data, {walk:?}");
    }
}
