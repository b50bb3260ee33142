//! Real tiles for the stages: the embedded elevation models and imagery, imported and read as slots.
//! In: the embedded files. Out: words of slots. Amplitudes are made of the imagery's luma, for want of a radar image.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use geodesy::{Ellipsoid, Tile, TilePosition};
use import::{Extent, ImportOptions, Silent, import};
use shaders::{INVALID_WORD, raw_colour};
use tiles::{Kind, Repository, TileData};

/// The summit of Mont Blanc, within the finer elevation model.
pub(super) const SUMMIT: [f64; 2] = [45.832_6, 6.865_2];

/// The repositories, in a folder that vanishes with them.
pub(super) struct Data {
    folder: tempfile::TempDir,
}

impl Data {
    pub(super) fn import() -> Self {
        let data = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        data.add("globe", "etopo5.tif", Kind::Elevation);
        data.add("cell", "N45E006.zip", Kind::Elevation);
        data.add("picture", "bmng.jpg", Kind::Imagery);
        data
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn add(&self, name: &str, file: &str, kind: Kind) {
        let embedded = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../../tests/data")
            .join(file);
        let whole_planet = Extent {
            west: -180.0,
            south: -90.0,
            east: 180.0,
            north: 90.0,
        };
        let options = ImportOptions {
            sources: vec![embedded],
            into: self.path(name),
            kind,
            extent: (kind == Kind::Imagery).then_some(whole_planet),
            crs: None,
            node_registered: None,
            raw: None,
            nodata: None,
            level: None,
            planet: Ellipsoid::EARTH,
            quantum_m: None,
            name: None,
            bands: None,
            range: None,
            threads: None,
            memory_bytes: 256 << 20,
        };
        import(&options, &Silent, &AtomicBool::new(false)).unwrap();
    }

    fn tile(&self, name: &str, tile: Tile) -> (TileData, f64) {
        let repository = Repository::open(&self.path(name)).unwrap();
        let bytes = repository.read(tile).unwrap();
        let bytes = bytes.unwrap_or_else(|| panic!("{name} has no tile {tile}"));
        let data = TileData::decode_tile(&bytes, tile).unwrap();
        (data, repository.dataset().unit())
    }

    /// The tile of a level with the summit in it.
    pub(super) fn summit_tile(level: u8) -> Tile {
        TilePosition::of_normal(Ellipsoid::normal(SUMMIT[0], SUMMIT[1]), level).tile
    }

    /// Heights in metres.
    pub(super) fn heights(&self, name: &str, tile: Tile) -> Vec<u32> {
        let (data, unit_m) = self.tile(name, tile);
        slot(|i, j| match data.value(i, j, 0) {
            Some(quanta) => ((quanta * unit_m) as f32).to_bits(),
            None => INVALID_WORD,
        })
    }

    /// Raw colours of the imagery, with holes where `mask`, a slot of heights, has some.
    pub(super) fn colours(&self, tile: Tile, mask: &[u32]) -> Vec<u32> {
        let (data, _) = self.tile("picture", tile);
        let colours = slot(|i, j| {
            let code =
                |channel| (data.value(i, j, channel).unwrap() * 1023.0 / 255.0).round() as u32;
            raw_colour(code(0), code(1), code(2))
        });
        masked(&colours, mask, 0)
    }

    /// Amplitudes of a wide range: the imagery's luma, 0…255, to the power of 2.2, with the mask's holes.
    pub(super) fn amplitudes(&self, tile: Tile, mask: &[u32]) -> Vec<u32> {
        let (data, _) = self.tile("picture", tile);
        let amplitudes = slot(|i, j| {
            let part = |channel| data.value(i, j, channel).unwrap();
            let luma = 0.2126 * part(0) + 0.7152 * part(1) + 0.0722 * part(2);
            (luma.powf(2.2) as f32).to_bits()
        });
        masked(&amplitudes, mask, INVALID_WORD)
    }
}

fn masked(words: &[u32], mask: &[u32], hole: u32) -> Vec<u32> {
    let pairs = words.iter().zip(mask);
    pairs
        .map(|(word, mask)| if *mask == INVALID_WORD { hole } else { *word })
        .collect()
}

fn slot(word: impl Fn(i64, i64) -> u32) -> Vec<u32> {
    (-9..266)
        .flat_map(|j| (-9..266).map(move |i| (i, j)))
        .map(|(i, j)| word(i, j))
        .collect()
}
