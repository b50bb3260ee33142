//! What the tests of refinement share: restricted quadtrees of any shape, tables of limits, heights.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "each test binary uses its own part"
)]
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use geodesy::{Ellipsoid, LatticePoint, Tile, TilePosition};
use glam::DVec3;
use terrain::{
    ALLOWANCE_WORDS, BLOCKS, Domain, HeightRanges, LATTICE_NODES, LodLimits, LodView, Selection,
    code_down, pair, select,
};

use crate::common::{Random, mix};

/// Divides the tiles that hold one of some points, down to a level for each.
pub struct Around(pub Vec<(DVec3, u8)>);

impl HeightRanges for Around {
    fn range_m(&self, _: Tile) -> (f64, f64) {
        (0.0, 0.0)
    }

    fn is_worth_dividing(&self, tile: Tile) -> bool {
        self.0.iter().any(|(point, depth)| {
            tile.level() < *depth && TilePosition::of_normal(*point, tile.level()).tile == tile
        })
    }
}

/// The smallest restricted forest in which the tiles around these points have these levels.
pub fn forest(points: Vec<(DVec3, u8)>) -> Selection {
    let view = LodView {
        eye: DVec3::new(3e7, 2e7, 1e7),
        pixels_per_radian: 1e9,
    };
    let limits = LodLimits {
        deepest_level: 20,
        tile_px: 1e-3,
        most_tiles: 100_000,
    };
    select(&Ellipsoid::EARTH, &view, &limits, &Around(points))
}

/// A forest that is deep at a few random places, some of them at corners or on edges of the cube.
pub fn random_forest(random: &mut Random, places: u64, depth: u8) -> Selection {
    let points = (0..=random.below(places))
        .map(|_| {
            let sign = |random: &mut Random| [-1.0, 1.0][random.below(2) as usize];
            let hair = random.direction() * [1e-6, 0.05, 0.2][random.below(3) as usize];
            let point = match random.below(4) {
                0 => DVec3::new(sign(random), sign(random), sign(random)) + hair,
                1 => DVec3::new(sign(random), sign(random), random.between(-1.0, 1.0)) + hair,
                2 => DVec3::new(random.between(-1.0, 1.0), sign(random), sign(random)) + hair,
                _ => random.direction(),
            };
            let level = 1 + random.below(u64::from(depth)) as u8;
            (point.normalize(), level)
        })
        .collect();
    forest(points)
}

/// The domain of all leaves.
pub fn planet(selection: &Selection) -> Domain {
    Domain::new(selection, selection.leaves())
}

/// A table of limits that are nested as they must be: the largest units a triangle may be off.
pub fn random_limits(random: &mut Random, most: u64) -> Vec<u32> {
    let mut table = vec![0; ALLOWANCE_WORDS];
    let limit = |units: u64| u32::from(code_down(units as u32)) + 1;
    for word in &mut table[..BLOCKS] {
        let coarse = random.below(most);
        let fine = coarse + random.below(most);
        *word = match random.below(24) {
            0 => 0,
            1 => limit(fine),
            _ => limit(fine) | limit(coarse) << 16,
        };
    }
    // A triangle's limit is at most its children's.
    let index = |[x, y]: [u16; 2]| BLOCKS + 17 * usize::from(y / 16) + usize::from(x / 16);
    for level in (0..7).rev() {
        for mark in (0..=256)
            .step_by(16)
            .flat_map(|y| (0..=256).step_by(16).map(move |x| [x, y]))
        {
            let Some(own) = pair(8, mark[0], mark[1]).filter(|own| own.level == level) else {
                continue;
            };
            for (side, apex) in own.apexes.into_iter().enumerate() {
                let Some(apex) = apex else { continue };
                let of_child = own.ends.map(|end| {
                    let child = [
                        u16::midpoint(apex[0], end[0]),
                        u16::midpoint(apex[1], end[1]),
                    ];
                    if level == 6 {
                        let [x, y] = [0, 1].map(|c| usize::from((child[c] + mark[c]) / 32));
                        return table[16 * y + x] >> 16;
                    }
                    let facing = pair(8, child[0], child[1]).unwrap().apexes[1] == Some(mark);
                    table[index(child)] >> (16 * u32::from(facing)) & 0xffff
                });
                let less = random.below(200) as u32;
                let limit = of_child[0].min(of_child[1]).saturating_sub(less);
                table[index(mark)] |= limit << (16 * side);
            }
        }
    }
    table
}

/// Heights that are one function of the place for all leaves: hills of all sizes, steeper with `roughness`.
pub fn fractal(tile: Tile, amplitude: f64, roughness: f64, seed: u64) -> Vec<i32> {
    let level = tile.level();
    nodes()
        .map(|[x, y]| {
            let cube = LatticePoint::of_tile(tile, i64::from(x), i64::from(y)).cube();
            let scale = 1.0 / (256_u64 << level) as f64;
            let [p, q, r] = cube.map(|c| c as f64 * scale);
            let mut height = 0.0;
            let mut gain = amplitude;
            let mut frequency = f64::from(1_u32 << level);
            for octave in 0..9 {
                height += gain
                    * value_noise([p * frequency, q * frequency, r * frequency], seed + octave);
                gain *= roughness;
                frequency *= 2.0;
            }
            height as i32
        })
        .collect()
}

/// Noise of −1…1 that is random at whole coordinates and smooth between.
fn value_noise(point: [f64; 3], seed: u64) -> f64 {
    let cell = point.map(f64::floor);
    let weight = [0, 1, 2].map(|c| {
        let t: f64 = point[c] - cell[c];
        t * t * t * (t * (6.0 * t - 15.0) + 10.0)
    });
    (0..8)
        .map(|corner: usize| {
            let mut hash = seed;
            let mut share = 1.0;
            for c in 0..3 {
                let far = corner >> c & 1;
                hash = mix(hash ^ (cell[c] as i64 + far as i64) as u64);
                share *= if far == 1 { weight[c] } else { 1.0 - weight[c] };
            }
            share * ((hash >> 11) as f64 / (1_u64 << 52) as f64 - 1.0)
        })
        .sum()
}

/// All nodes of a leaf, row by row.
pub fn nodes() -> impl Iterator<Item = [u16; 2]> {
    (0..=256).flat_map(|y| (0..=256).map(move |x| [x, y]))
}

/// Heights that try the bound: noise, spikes, cliffs, boards.
pub fn adversarial(random: &mut Random, kind: u64) -> Vec<i32> {
    let most: i64 = if random.below(2) == 0 { 1 << 27 } else { 3000 };
    let mut heights = vec![0; LATTICE_NODES];
    let (a, b) = (random.below(256) as u16, random.below(256) as u16);
    let size = 1 << random.below(6);
    for ([x, y], height) in nodes().zip(&mut heights) {
        *height = match kind {
            0 => (random.below(2 * most as u64 + 1) as i64 - most) as i32,
            1 if random.below(2000) == 0 => most as i32,
            2 if 3 * u32::from(x) + u32::from(y) > 3 * u32::from(a) + u32::from(b) => most as i32,
            3 if (x / size + y / size).is_multiple_of(2) => most as i32,
            3 => -most as i32,
            _ => 0,
        };
    }
    heights
}
