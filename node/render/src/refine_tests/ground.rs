//! Heights that are hard in different ways, in units, and random numbers that are the same everywhere.

/// Nodes along a side.
const SIDE: usize = 257;

/// A linear congruential generator's upper bits.
#[derive(Clone, Copy)]
pub(super) struct Noise(pub(super) u64);

impl Noise {
    /// 0…2^31 − 1.
    pub(super) fn next(&mut self) -> u32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as u32
    }

    /// −`range`…`range`.
    pub(super) fn within(&mut self, range: i32) -> i32 {
        (i64::from(self.next()) % (2 * i64::from(range) + 1)) as i32 - range
    }
}

/// Kinds of ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ground {
    Flat,
    Random,
    /// As far up and down as heights go.
    Extreme,
    Fractal,
    Spikes,
    Cliffs,
    Checkerboard,
}

impl Ground {
    pub(super) const ALL: [Self; 7] = [
        Self::Flat,
        Self::Random,
        Self::Extreme,
        Self::Fractal,
        Self::Spikes,
        Self::Cliffs,
        Self::Checkerboard,
    ];

    /// 257² heights. All have at most 24 significant bits, so that f32 holds them.
    pub(super) fn heights(self, seed: u64) -> Vec<i32> {
        let mut noise = Noise(seed * 977 + 13);
        let nodes = SIDE * SIDE;
        match self {
            Self::Flat => vec![noise.within(100_000); nodes],
            Self::Random => (0..nodes).map(|_| noise.within(1 << 20)).collect(),
            Self::Extreme => (0..nodes).map(|_| noise.within(1 << 23) << 4).collect(),
            Self::Fractal => fractal(&mut noise),
            Self::Spikes => {
                let mut heights = vec![500; nodes];
                for _ in 0..6 {
                    heights[noise.next() as usize % nodes] += noise.within(1 << 18);
                }
                heights
            }
            Self::Cliffs => {
                let (a, b, c) = (noise.within(50), noise.within(50), noise.within(6000));
                let above = |n: usize| a * (n % SIDE) as i32 + b * (n / SIDE) as i32 > c;
                (0..nodes)
                    .map(|n| if above(n) { 90_000 } else { -70_000 })
                    .collect()
            }
            Self::Checkerboard => {
                let shift = noise.next() % 5;
                let odd = |n: usize| ((n % SIDE) >> shift) + ((n / SIDE) >> shift);
                (0..nodes).map(|n| (odd(n) % 2) as i32 * 4_000).collect()
            }
        }
    }
}

/// Hills on hills: noise on grids of 64, 32 … 1 cells, each half as high as the one before.
fn fractal(noise: &mut Noise) -> Vec<i32> {
    let mut heights = vec![0_i64; SIDE * SIDE];
    for octave in 0..7 {
        let cell = 64 >> octave;
        let columns = 256 / cell + 1;
        let range = 1 << (16 - octave);
        let grid: Vec<i64> = (0..columns * columns)
            .map(|_| i64::from(noise.within(range)))
            .collect();
        for (n, height) in heights.iter_mut().enumerate() {
            let (x, y) = (n % SIDE, n / SIDE);
            let (i, j) = ((x / cell).min(columns - 2), (y / cell).min(columns - 2));
            let (fx, fy) = ((x - i * cell) as i64, (y - j * cell) as i64);
            let size = cell as i64;
            let at = |i: usize, j: usize| grid[j * columns + i];
            let low = at(i, j) * (size - fx) + at(i + 1, j) * fx;
            let high = at(i, j + 1) * (size - fx) + at(i + 1, j + 1) * fx;
            *height += (low * (size - fy) + high * fy) / (size * size);
        }
    }
    heights.into_iter().map(|height| height as i32).collect()
}
