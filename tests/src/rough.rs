//! Planets that no mesh likes: spikes, cliffs, checkerboards, holes, on every node of every level.
//!
//! In: a kind and a folder. Out: a repository of elevation. Nodes that tiles share have the same height in all of them,
//! as in every imported repository; from level to level heights need not agree, so that each level is as bad.

use std::path::{Path, PathBuf};

use geodesy::{Ellipsoid, LatticePoint, Tile, TilePosition};
use tiles::{Dataset, Index, Kind, Repository, SampleType, Samples, TileData, Validity};

/// Elevation quanta in a metre.
const PER_M: i32 = 16;
/// Nodes a side of a tile with its border.
const SIDE: usize = 275;
/// Tiles go all the way down to this level around [`FOCI`].
const DEEPEST: u8 = 8;
/// Latitude and longitude of a cube corner, of a pole, of an edge between faces, and of a place inside of one.
pub const FOCI: [(f64, f64); 4] = [(35.26, 45.0), (90.0, 0.0), (0.0, 45.0), (12.0, 8.0)];

/// What is wrong with a planet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rough {
    /// Single nodes 8 km above a plain.
    Spikes,
    /// Plateaus whose walls are 8 km high and as steep as the lattice lets them be.
    Cliffs,
    /// Every other node 3 km up, all the others as far down.
    Checkerboard,
    /// Cliffs with nodes, patches and whole tiles without data.
    Holes,
}

impl Rough {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Spikes, Self::Cliffs, Self::Checkerboard, Self::Holes];

    /// The sample at a node; none where there is no data.
    fn quanta(self, point: LatticePoint) -> Option<i32> {
        // The one tile that owns a node and its place there are the same for all that share it.
        let (tile, i, j) = point.owner();
        let noise = mix(tile.id(), i as u64, j as u64);
        let cliffs = || {
            let plateau = (point.normal() * 23.0).floor().as_i64vec3();
            [-4000, 4000][((plateau.x + plateau.y + plateau.z) & 1) as usize]
        };
        let height_m = match self {
            Self::Spikes if noise.is_multiple_of(101) => 8000,
            Self::Spikes => 0,
            Self::Cliffs => cliffs(),
            Self::Checkerboard => [-3000, 3000][((i + j) & 1) as usize],
            Self::Holes => {
                let patch = mix(tile.id(), (i / 11) as u64, (j / 7) as u64);
                let lacks = noise.is_multiple_of(53) || patch.is_multiple_of(9);
                return (!lacks).then(|| cliffs() * PER_M);
            }
        };
        Some(height_m * PER_M)
    }

    /// Whether a tile deeper than the first levels is there.
    fn has(self, tile: Tile) -> bool {
        let near = FOCI.iter().any(|(latitude_deg, longitude_deg)| {
            let focus = Ellipsoid::normal(*latitude_deg, *longitude_deg);
            TilePosition::of_normal(focus, tile.level()).tile == tile
        });
        let wide = tile.level() <= 1 || tile.level() == 2 && tile.face().number() < 2;
        let torn = self == Self::Holes && tile.level() >= 3 && tile.id().is_multiple_of(3);
        (wide || near) && !torn
    }

    fn tile(self, tile: Tile) -> TileData {
        let samples: Vec<Option<i32>> = (-9..266)
            .flat_map(|j| (-9..266).map(move |i| (i, j)))
            .map(|(i, j)| self.quanta(LatticePoint::of_tile(tile, i, j)))
            .collect();
        assert_eq!(samples.len(), SIDE * SIDE);
        let validity = Validity::from_nodes(|node| samples[node].is_some());
        let samples = samples.into_iter().map(Option::unwrap_or_default).collect();
        TileData::new(tile, Kind::Elevation, 1, Samples::I32(samples), validity)
            .expect("samples of one tile")
    }

    /// Writes the repository into a folder, which must not exist.
    pub fn write(self, folder: &Path) -> PathBuf {
        let name = format!("{self:?}").to_lowercase();
        let root = folder.join(&name);
        let mut dataset = Dataset::new(&name, Kind::Elevation, SampleType::I32, 1);
        dataset.deepest_level = DEEPEST;
        dataset.quantum_m = Some(1.0 / f64::from(PER_M));
        let repository = Repository::create(&root, dataset).expect("a new repository");
        let mut index = Index::new();
        let mut level: Vec<Tile> = Tile::ROOTS.to_vec();
        for _ in 0..=DEEPEST {
            level.retain(|tile| self.has(*tile));
            for tile in &level {
                let data = self.tile(*tile);
                let bytes = data.encode().expect("a tile can be written");
                repository
                    .write_atomic(*tile, &bytes)
                    .expect("a tile is written");
                index.insert_tile(&data);
            }
            level = level
                .iter()
                .flat_map(|tile| tile.children().expect("no leaf of the planet"))
                .collect();
        }
        repository.store_index(&index).expect("an index is written");
        root
    }
}

/// A number that looks like chance (the finaliser of `SplitMix64`, Steele, Lea and Flood 2014).
fn mix(a: u64, b: u64, c: u64) -> u64 {
    let mut z = a
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add(b.wrapping_mul(0xD134_2543_DE82_EF95))
        .wrapping_add(c.wrapping_mul(0xA076_1D64_78BD_642F));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_as_rough_as_it_says_and_reaches_the_deepest_level() {
        for rough in Rough::ALL {
            let folder = tempfile::tempdir().expect("a folder");
            let root = rough.write(folder.path());
            let repository = Repository::open(&root).expect("a repository");
            let index = repository.load_index().expect("an index");
            let (lowest, highest) = index.range(Tile::ROOTS[0]).expect("a root");
            let relief_m = (highest - lowest) * repository.dataset().unit();
            assert!(relief_m >= 6000.0, "{rough:?}: {relief_m} m");
            if rough != Rough::Holes {
                assert_eq!(index.deepest_level(), DEEPEST, "{rough:?}");
            }
            let tile = repository
                .read(Tile::ROOTS[0])
                .expect("readable")
                .expect("there");
            let tile = TileData::decode_tile(&tile, Tile::ROOTS[0]).expect("a tile");
            let holes = (0..=256).any(|i| tile.height(i, 3).is_none());
            assert_eq!(holes, rough == Rough::Holes, "{rough:?}");
        }
    }

    #[test]
    fn tiles_agree_on_the_nodes_they_share() {
        for rough in Rough::ALL {
            for edge in 0..=256 {
                // Over the edge of a face too: the same node has the same owner.
                let [a, b] = [
                    Tile::ROOTS[0],
                    Tile::ROOTS[0].children().expect("children")[1],
                ];
                for tile in [a, b] {
                    let point = LatticePoint::of_tile(tile, 0, edge);
                    for other in point.tiles() {
                        let (i, j) = point.within(other).expect("a tile that holds it");
                        let there = rough.quanta(LatticePoint::of_tile(other, i, j));
                        assert_eq!(rough.quanta(point), there);
                    }
                }
            }
        }
    }
}
