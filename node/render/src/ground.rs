//! What the CPU works out of a leaf's heights for their geometry on the GPU: bounds by block, the border's vertices.
//! In: a scene, a leaf, the data that it shows and how it meets its neighbours. Out: words for the device and the bounds
//! behind them. Bounds come from the data's samples by the parameters, block by block. It processes no inner node.

use std::cell::RefCell;

use geodesy::{CELLS, Relation, Tile};
use glam::DVec3;
use terrain::{BLOCKS, BlockRanges, ElevationLayer, Lattice, MeshError, TileGeometryError};

use crate::geometry::Ground;
use crate::heights::VertexHeights;
use crate::loaded::{Active, LoadedScene};
use crate::ranges::{around, fused_range, processed};

/// Cells along a side of a block, and blocks along a side of a leaf.
const BLOCK_CELLS: i64 = 16;
const BLOCKS_A_SIDE: i64 = CELLS / BLOCK_CELLS;

/// What a leaf is made of: all that its heights depend on.
pub(crate) struct LeafSources<'r, 'a> {
    pub(crate) leaf: Tile,
    /// The elevation layers, with their levels inside and along the border.
    pub(crate) layers: &'r [ElevationLayer<'a>],
    /// The data that the leaf shows of each of them.
    pub(crate) shown: &'r [Option<&'a dyn Lattice>],
    pub(crate) relations: &'r [Relation],
    /// Edges beyond which a coarser leaf lies.
    pub(crate) coarser: u8,
}

/// What the device is given of a leaf beside its fused heights.
pub(crate) struct LeafWords {
    pub(crate) ground: Ground,
    pub(crate) border: Vec<u32>,
    pub(crate) anchors: Vec<u32>,
}

/// Works out a leaf's bounds, border and anchors.
pub(crate) fn leaf_words(
    scene: &LoadedScene,
    heights: &VertexHeights,
    sources: &LeafSources<'_, '_>,
) -> Result<LeafWords, MeshError> {
    let ellipsoid = &scene.data.ellipsoid;
    let positions = terrain::border_positions();
    let mut vertices = Vec::with_capacity(positions.len());
    let border_m = RefCell::new(Vec::with_capacity(positions.len()));
    let fuse = |normal: DVec3, samples: &[Option<i32>]| {
        let height_m = heights.at(scene, sources.relations, normal, samples);
        border_m.borrow_mut().push(height_m);
        height_m
    };
    terrain::build(
        ellipsoid,
        sources.leaf,
        sources.layers,
        positions,
        &fuse,
        &mut vertices,
    )?;
    let border_m = border_m.into_inner();
    let mut blocks = inner_ranges(scene, sources);
    for ([x, y], height_m) in positions.iter().zip(&border_m) {
        for block in blocks_at(*x, *y) {
            if let Some(range) = blocks.get_mut(block) {
                *range = around(*range, (*height_m, *height_m));
            }
        }
    }
    let range_m = blocks.iter().copied().reduce(around).unwrap_or_default();
    let unit_m = terrain::height_unit(range_m);
    let references: Vec<i32> = blocks
        .iter()
        .map(|(low, high)| terrain::quantise(f64::midpoint(*low, *high), unit_m))
        .collect();
    Ok(LeafWords {
        border: terrain::border_words(&vertices, &border_m, unit_m, sources.coarser),
        anchors: terrain::anchors(ellipsoid, sources.leaf, &references, unit_m),
        ground: Ground {
            unit_m,
            shape: TileGeometryError::new(ellipsoid, sources.leaf),
            blocks: BlockRanges(blocks),
            range_m,
            border_m,
        },
    })
}

/// The blocks that a node belongs to.
fn blocks_at(x: u16, y: u16) -> impl Iterator<Item = usize> {
    let along = |c: u16| {
        let c = i64::from(c);
        let last = (c / BLOCK_CELLS).min(BLOCKS_A_SIDE - 1);
        let first = if c % BLOCK_CELLS == 0 {
            (last - 1).max(0)
        } else {
            last
        };
        first..=last
    };
    along(y)
        .flat_map(move |row| along(x).map(move |column| (row * BLOCKS_A_SIDE + column) as usize))
}

/// Bounds of the processed and fused heights of each block, border nodes of the leaf left out of account.
fn inner_ranges(scene: &LoadedScene, sources: &LeafSources<'_, '_>) -> Vec<(f64, f64)> {
    let sets = scene.sets_in(sources.leaf, true);
    let quanta: Vec<Vec<Samples>> = sources
        .shown
        .iter()
        .map(|shown| match shown {
            Some(data) => block_samples(sources.leaf, *data),
            None => vec![Samples::NONE; BLOCKS],
        })
        .collect();
    let mut ranges = Vec::with_capacity(BLOCKS);
    for block in 0..BLOCKS {
        let of_layer = |active: &Active| {
            let slot = scene
                .elevation_layers
                .iter()
                .position(|layer| *layer == active.layer)?;
            let samples = quanta.get(slot)?.get(block)?;
            let source = scene.source(active.layer)?;
            let range = processed(active, source, samples.range?)?;
            Some((range, samples.holes))
        };
        let range = sets
            .iter()
            .filter_map(|set| scene.sets.get(*set))
            .map(|set| fused_range(set, &of_layer))
            .reduce(around)
            .unwrap_or_default();
        // 32-bit numbers on the way round a little.
        let slack = 1e-3 + 1e-6 * range.0.abs().max(range.1.abs());
        ranges.push((range.0 - slack, range.1 + slack));
    }
    ranges
}

/// The raw samples of one layer in a block.
#[derive(Clone, Copy)]
struct Samples {
    /// Lowest and highest in quanta.
    range: Option<(f64, f64)>,
    holes: bool,
}

impl Samples {
    const NONE: Self = Self {
        range: None,
        holes: true,
    };
}

/// The samples around each block of a leaf, whose data is its own or an ancestor's.
fn block_samples(leaf: Tile, data: &dyn Lattice) -> Vec<Samples> {
    let tile = data.tile();
    let shift = u32::from(leaf.level().saturating_sub(tile.level()));
    let origin = |leaf: u32, data: u32| (i64::from(leaf) - (i64::from(data) << shift)) * CELLS;
    let (left, down) = (origin(leaf.x(), tile.x()), origin(leaf.y(), tile.y()));
    let nodes = |first: i64| {
        let last = first + BLOCK_CELLS;
        (first >> shift)..=((last + (1 << shift) - 1) >> shift)
    };
    let mut samples = Vec::with_capacity(BLOCKS);
    for row in 0..BLOCKS_A_SIDE {
        for column in 0..BLOCKS_A_SIDE {
            let (mut low, mut high, mut holes) = (i32::MAX, i32::MIN, false);
            for j in nodes(down + row * BLOCK_CELLS) {
                for i in nodes(left + column * BLOCK_CELLS) {
                    match data.height(i, j) {
                        Some(height) => {
                            low = low.min(height);
                            high = high.max(height);
                        }
                        None => holes = true,
                    }
                }
            }
            samples.push(Samples {
                range: (low <= high).then(|| (f64::from(low), f64::from(high))),
                holes,
            });
        }
    }
    samples
}
