//! What the tests of allowances and oracle share: made-up ground, its quantised form, and meshes of marks.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "each test binary uses its own part"
)]

use geodesy::frame::FixedPoint;
use geodesy::{Ellipsoid, LatticePoint, Tile};
use glam::DVec3;
use terrain::{
    BlockRanges, Domain, EyeCell, LATTICE_NODES, Marks, Measured, RefineView, RefinedLeaf,
    TileGeometryError, Vertex, allowances, height_unit, measure, minimum, pyramid, top_down,
    triangles,
};

use crate::common::{Random, mix};

pub const NODES: usize = 257;

/// Shapes of ground. Heights are a function of the place on the planet alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ground {
    /// Nothing but the ellipsoid.
    Flat,
    /// Self-similar mountains.
    Fractal,
    /// Mountains in a sea: half of the ground is level.
    Coast,
    /// Rare needles on level ground.
    Spikes,
    /// A step of the full height across the tile.
    Cliff,
    /// Every node is up or down.
    Checkerboard,
    /// Independent random heights.
    Noise,
    /// Pits of the full depth, as where data is missing.
    Holes,
    /// Everything far up or far down.
    High,
    Deep,
}

pub const GROUNDS: [Ground; 10] = [
    Ground::Flat,
    Ground::Fractal,
    Ground::Coast,
    Ground::Spikes,
    Ground::Cliff,
    Ground::Checkerboard,
    Ground::Noise,
    Ground::Holes,
    Ground::High,
    Ground::Deep,
];

fn hash_of(cell: [i64; 3], seed: u64) -> f64 {
    let hash = cell.iter().fold(seed, |hash, c| mix(hash ^ *c as u64));
    (hash >> 11) as f64 / (1_u64 << 53) as f64
}

/// Value noise, 0…1, smooth between the integer points.
fn value_noise(p: DVec3, seed: u64) -> f64 {
    let base = p.floor();
    let f = p - base;
    let f = f * f * (DVec3::splat(3.0) - 2.0 * f);
    let corner = |dx: i64, dy: i64, dz: i64| {
        hash_of(
            [base.x as i64 + dx, base.y as i64 + dy, base.z as i64 + dz],
            seed,
        )
    };
    let mut sum = 0.0;
    for (dz, wz) in [(0, 1.0 - f.z), (1, f.z)] {
        for (dy, wy) in [(0, 1.0 - f.y), (1, f.y)] {
            for (dx, wx) in [(0, 1.0 - f.x), (1, f.x)] {
                sum += wx * wy * wz * corner(dx, dy, dz);
            }
        }
    }
    sum
}

/// The widest to the narrowest waves of ground around tiles of `level`.
pub fn fractal(normal: DVec3, level: u8, seed: u64) -> f64 {
    let mut frequency = f64::from(1_u32 << level) * 2.0;
    let (mut amplitude, mut sum) = (0.5, 0.0);
    for octave in 0..8 {
        sum += amplitude * (value_noise(normal * frequency, seed + octave) - 0.5);
        frequency *= 2.0;
        amplitude *= 0.5;
    }
    sum
}

/// The ground of one tile.
pub struct Leaf {
    pub tile: Tile,
    pub heights_m: Vec<f64>,
    pub unit_m: f64,
    pub units: Vec<i32>,
    pub blocks: BlockRanges,
    pub errors: Vec<u32>,
    pub geometry: TileGeometryError,
    pub ellipsoid: Ellipsoid,
}

impl Leaf {
    pub fn new(
        ellipsoid: &Ellipsoid,
        tile: Tile,
        ground: Ground,
        relief_m: f64,
        seed: u64,
    ) -> Self {
        let heights = (0..NODES * NODES).map(|node| {
            let point = LatticePoint::of_tile(tile, (node % NODES) as i64, (node / NODES) as i64);
            let random = hash_of(point.cube(), seed);
            let normal = point.normal();
            let (x, y) = (node % NODES, node / NODES);
            relief_m
                * match ground {
                    Ground::Flat => 0.0,
                    Ground::Fractal => fractal(normal, tile.level(), seed),
                    Ground::Coast => fractal(normal, tile.level(), seed).max(0.0),
                    Ground::Spikes => f64::from(random < 1e-3),
                    Ground::Cliff => f64::from(3 * x + y > 500),
                    Ground::Checkerboard => f64::from((x + y) % 2 == 0),
                    Ground::Noise => random,
                    Ground::Holes => -f64::from(
                        value_noise(normal * f64::from(8_u32 << tile.level()), seed) > 0.75,
                    ),
                    Ground::High => 20.0 + fractal(normal, tile.level(), seed),
                    Ground::Deep => -20.0 + fractal(normal, tile.level(), seed),
                }
        });
        Self::of_heights(ellipsoid, tile, heights.collect())
    }

    /// The same beside coarser leaves beyond the edges of these bits: odd nodes there are on the coarser leaf's lines.
    pub fn beside(self, coarser: u8) -> Self {
        let mut heights_m = self.heights_m;
        let node = |edge: usize, along: usize| match edge {
            0 => along * NODES,
            1 => along * NODES + 256,
            2 => along,
            _ => 256 * NODES + along,
        };
        let mut odd = Vec::new();
        for edge in (0..4).filter(|edge| coarser >> edge & 1 == 1) {
            for along in (1..256).step_by(2) {
                let [before, at, after] =
                    [along - 1, along, along + 1].map(|along| node(edge, along));
                heights_m[at] = f64::midpoint(heights_m[before], heights_m[after]);
                odd.push([before, at, after]);
            }
        }
        let mut leaf = Self::of_heights(&self.ellipsoid, self.tile, heights_m);
        for [before, at, after] in odd {
            leaf.units[at] = (leaf.units[before] + leaf.units[after]).div_euclid(2);
        }
        leaf.errors = pyramid(&leaf.units);
        leaf
    }

    pub fn of_heights(ellipsoid: &Ellipsoid, tile: Tile, heights_m: Vec<f64>) -> Self {
        assert_eq!(heights_m.len(), LATTICE_NODES);
        let low = heights_m.iter().copied().fold(f64::INFINITY, f64::min);
        let high = heights_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let unit_m = height_unit((low, high));
        let units: Vec<i32> = heights_m
            .iter()
            .map(|h| (h / unit_m).round_ties_even() as i32)
            .collect();
        let mut blocks = vec![(f64::INFINITY, f64::NEG_INFINITY); 256];
        for (index, block) in blocks.iter_mut().enumerate() {
            let (x0, y0) = (index % 16 * 16, index / 16 * 16);
            for y in y0..=y0 + 16 {
                for h in &heights_m[y * NODES + x0..=y * NODES + x0 + 16] {
                    *block = (block.0.min(*h), block.1.max(*h));
                }
            }
        }
        let errors = pyramid(&units);
        Self {
            tile,
            heights_m,
            unit_m,
            units,
            blocks: BlockRanges(blocks),
            errors,
            geometry: TileGeometryError::new(ellipsoid, tile),
            ellipsoid: *ellipsoid,
        }
    }

    pub fn range_m(&self) -> (f64, f64) {
        let blocks = self.blocks.0.iter();
        blocks.fold((f64::INFINITY, f64::NEG_INFINITY), |range, block| {
            (range.0.min(block.0), range.1.max(block.1))
        })
    }

    pub fn domain(&self) -> Domain {
        Domain {
            leaves: vec![RefinedLeaf {
                tile: self.tile,
                links: [None, None, None, None],
                finer: 0,
                coarser: 0,
            }],
        }
    }

    pub fn table(&self, view: &RefineView, cell: &EyeCell) -> Vec<u32> {
        allowances(&self.geometry, &self.blocks, self.unit_m, view, cell)
    }

    pub fn refine(&self, table: &[u32]) -> Marks {
        top_down(&self.domain(), &[&self.errors], &[table])
            .pop()
            .unwrap()
    }

    pub fn minimum(&self, view: &RefineView) -> Marks {
        minimum(
            &self.domain(),
            &self.ellipsoid,
            &[&self.heights_m],
            view.eye,
            view.pixels_per_radian,
            view.tau_px,
        )
        .pop()
        .unwrap()
    }

    pub fn vertex(&self, [x, y]: [u16; 2]) -> Vertex {
        let normal = LatticePoint::of_tile(self.tile, i64::from(x), i64::from(y)).normal();
        let height_m = f64::from(self.units[usize::from(y) * NODES + usize::from(x)]) * self.unit_m;
        Vertex {
            position: FixedPoint::from_ecef(self.ellipsoid.point(normal, height_m)).words(),
            normal: [0; 4],
            lattice: [x, y],
        }
    }

    /// The mesh of marks, with three vertices a triangle.
    pub fn mesh(&self, marks: &Marks) -> (Vec<Vertex>, Vec<u32>) {
        let corners = triangles(marks);
        let vertices: Vec<Vertex> = corners
            .as_flattened()
            .iter()
            .map(|corner| self.vertex(*corner))
            .collect();
        let indices = (0..vertices.len() as u32).collect();
        (vertices, indices)
    }

    pub fn measure(&self, marks: &Marks, eye: DVec3, pixels_per_radian: f64) -> Measured {
        let (vertices, indices) = self.mesh(marks);
        measure(
            &self.ellipsoid,
            self.tile,
            &self.heights_m,
            &vertices,
            &indices,
            eye,
            pixels_per_radian,
        )
    }
}

/// The width of a tile along its lower edge in metres.
pub fn width_m(ellipsoid: &Ellipsoid, tile: Tile) -> f64 {
    let corner = |i, j| ellipsoid.point(LatticePoint::of_tile(tile, i, j).normal(), 0.0);
    corner(0, 0)
        .distance(corner(256, 0))
        .max(corner(0, 0).distance(corner(0, 256)))
}

/// A tile of a level: anywhere, or at a corner, an edge or the middle of a face.
pub fn random_tile(random: &mut Random, level: u8) -> Tile {
    let last = (1_u64 << level) - 1;
    let mut index = || {
        (match random.below(4) {
            0 => 0,
            1 => last,
            2 => last / 2,
            _ => random.below(last + 1),
        }) as u32
    };
    let (x, y) = (index(), index());
    Tile::new(random.below(6) as u8, level, x, y).unwrap()
}

/// An eye that sees the tile: `widths` tile widths from some node of it, at an elevation of the given sine above the
/// horizon there, and at least 2 m above that node.
pub fn eye_over(random: &mut Random, leaf: &Leaf, widths: f64, sine: f64) -> DVec3 {
    let node = random.below(LATTICE_NODES as u64) as usize;
    let (x, y) = (node % NODES, node / NODES);
    let normal = LatticePoint::of_tile(leaf.tile, x as i64, y as i64).normal();
    let ground = leaf.ellipsoid.point(normal, leaf.heights_m[node] + 2.0);
    let aside = random.direction().cross(normal).normalize();
    let distance_m = widths * width_m(&leaf.ellipsoid, leaf.tile);
    ground + (normal * sine + aside * (1.0 - sine * sine).sqrt()) * distance_m
}

/// An eye within the ball of a cell.
pub fn eye_in(random: &mut Random, cell: &EyeCell) -> DVec3 {
    let share = random.unit().max(0.5);
    cell.centre + random.direction() * (cell.radius_m * share)
}
