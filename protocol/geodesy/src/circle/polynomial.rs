//! A circle as a polynomial over a tile's samples, for the GPU, where f32 cannot hold distances.
//! In: a circle, a tile. Out: coefficients whose polynomial is ≤ 0 inside. Levels from 1 are interpolated
//! in closed form; the roots, which straddle the kinks of the projection, go through a weighted fit.

use glam::DVec3;

use super::fit::{Fit, Samples};
use super::{Circle, sine_cosine_deg};
use crate::cube::{Face, st_to_uv, uv_to_st};
use crate::lattice::{BORDER, CELLS};
use crate::tile::Tile;

/// The highest degree in x and in y.
pub(super) const MAX_DEGREE: usize = 8;

/// Half the stored lattice in samples: x and y count in these from the tile's middle.
const HALF_STORED: f64 = (CELLS / 2 + BORDER) as f64;

/// More interpolation nodes than coefficients, along an axis.
const MORE_NODES: usize = 5;

/// Nodes of a root's fit along each axis: over the tile, and over the surroundings of a small circle.
const ROOT_NODES: usize = 24;
const NEAR_NODES: usize = 12;

/// The part of the stored lattice that a root's fit looks at: the tile and two samples around it.
const ROOT_EXTENT: f64 = 130.0 / HALF_STORED;

/// Arc in radians up to which a circle counts as small against a cube face.
const SMALL_ARC: f64 = 0.35;

/// Σ c\[m·(degree+1)+n\] xⁿ yᵐ with x = (i − 128)/137 and y = (j − 128)/137 at node (i, j) of a tile: ≤ 0 inside
/// the circle, with absolute values of at most about 1 over the stored lattice.
///
/// On planets as round as Earth, Moon and Mars its rim is within 0.1 sample of the exact one over the tile and
/// the node around it for levels from 1, and within 0.25 sample on level 0, in f32 too. That holds on the tile's
/// own face: in the border beyond a face edge, where the lattice folds, the polynomial continues smoothly and
/// departs by up to a sample for each node outwards.
#[derive(Clone, Debug, PartialEq)]
pub struct CirclePolynomial {
    /// The degree in x and in y: 8 up to level 2, 6 on levels 3 and 4, 4 from level 5.
    pub degree: usize,
    /// (degree + 1)² coefficients; those of one power of y stand together.
    pub coefficients: Vec<f64>,
}

impl CirclePolynomial {
    /// The polynomial at (x, y).
    #[must_use]
    pub fn at(&self, x: f64, y: f64) -> f64 {
        let along = |c: &[f64]| c.iter().rev().fold(0.0, |sum, c| sum * x + c);
        let rows = self.coefficients.chunks(self.degree + 1).rev();
        rows.fold(0.0, |sum, row| sum * y + along(row))
    }
}

impl Circle {
    /// The squared distance from the centre less the squared chord, as a polynomial over the samples of `tile`,
    /// times a positive factor: a constant, and √(a²(x²+y²) + b²z²) of the cube point, which takes the
    /// worst of its curvature away and leaves the rim where it is.
    ///
    /// Costs 2 to 5 µs; on level 0 about 50 µs.
    #[must_use]
    pub fn polynomial(&self, tile: Tile) -> CirclePolynomial {
        let degree = match tile.level() {
            0..=2 => MAX_DEGREE,
            3 | 4 => 6,
            _ => 4,
        };
        let mut chebyshev = if tile.level() == 0 {
            self.fit_root(tile)
        } else {
            self.interpolate(tile, degree)
        };
        to_powers(&mut chebyshev, degree);
        CirclePolynomial {
            degree,
            coefficients: chebyshev,
        }
    }

    /// Chebyshev interpolation with more nodes than coefficients: the coefficients of a longer
    /// interpolation, cut off (J. C. Mason, D. C. Handscomb, Chebyshev Polynomials, 2003, §6.3).
    fn interpolate(&self, tile: Tile, degree: usize) -> Vec<f64> {
        let count = degree + 1 + MORE_NODES;
        let nodes = chebyshev_nodes(count);
        let axes = Axes::new(tile);
        let terms: Vec<[f64; MAX_DEGREE + 1]> = nodes.iter().map(|x| chebyshev(*x)).collect();
        let u: Vec<f64> = nodes.iter().map(|x| axes.u(*x)).collect();
        let side = degree + 1;
        let mut coefficients = vec![0.0; side * side];
        let mut largest = 0.0_f64;
        for (y, terms_y) in nodes.iter().zip(&terms) {
            let v = axes.v(*y);
            let mut row = [0.0; MAX_DEGREE + 1];
            for (u, terms_x) in u.iter().zip(&terms) {
                let value = self.value(tile.face(), *u, v);
                largest = largest.max(value.abs());
                for (sum, term) in row.iter_mut().zip(terms_x) {
                    *sum += value * term;
                }
            }
            for (line, term_y) in coefficients.chunks_mut(side).zip(terms_y) {
                for (coefficient, sum) in line.iter_mut().zip(row) {
                    *coefficient += term_y * sum;
                }
            }
        }
        let share = |n: usize| (if n == 0 { 1.0 } else { 2.0 }) / count as f64;
        for (m, line) in coefficients.chunks_mut(side).enumerate() {
            for (n, coefficient) in line.iter_mut().enumerate() {
                *coefficient *= share(m) * share(n) / largest.max(f64::MIN_POSITIVE);
            }
        }
        coefficients
    }

    /// The fit of a whole face. The second derivative of the projection jumps in its middle, so that no
    /// polynomial of this degree is near everywhere; least squares that weigh samples by the inverse of
    /// their value find one that is near along the rim, and elsewhere of the right sign.
    fn fit_root(&self, tile: Tile) -> Vec<f64> {
        let face = tile.face();
        let (a, r) = (self.ellipsoid.semi_major_m, self.mean_radius_m);
        let scale = 1.0 / (a * r * r);
        // A third of what the value changes by over a sample at the rim: nearer values weigh no more.
        let sample = std::f64::consts::FRAC_PI_2 / CELLS as f64;
        let floor = (0.3 * sample * self.arc).max(1e-6);
        let mut fit = Fit::default();
        let mut add = |xs: &[f64], ys: &[f64], weight: f64| {
            let u: Vec<f64> = xs.iter().map(|x| st_to_uv(to_share(*x))).collect();
            let v: Vec<f64> = ys.iter().map(|y| st_to_uv(to_share(*y))).collect();
            fit.add(&Samples {
                xs,
                ys,
                weight,
                floor,
                value: &|column, row| match (u.get(column), v.get(row)) {
                    (Some(u), Some(v)) => scale * self.value(face, *u, *v),
                    _ => 0.0,
                },
            });
        };
        let nodes: Vec<f64> = chebyshev_nodes(ROOT_NODES)
            .into_iter()
            .map(|x| x * ROOT_EXTENT)
            .collect();
        add(&nodes, &nodes, 1.0);
        let outward = self.normal.dot(face.cube_point(0.0, 0.0));
        if self.arc < SMALL_ARC && outward > 0.0 {
            // Half the side of a square around the circle; a face's samples are nowhere less than 0.94 apart.
            let reach = 1.08 * self.arc * CELLS as f64 / HALF_STORED + 2.0 / HALF_STORED;
            let around = |w: f64| {
                let middle = (uv_to_st(w) * CELLS as f64 - 128.0) / HALF_STORED;
                let low = (middle - reach).clamp(-ROOT_EXTENT, ROOT_EXTENT);
                let high = (middle + reach).clamp(-ROOT_EXTENT, ROOT_EXTENT);
                let nodes = chebyshev_nodes(NEAR_NODES);
                let place = |x: f64| 0.5 * (low + high) + 0.5 * (high - low) * x;
                (nodes.into_iter().map(place).collect::<Vec<_>>(), high - low)
            };
            let (u, v) = face.uv_of(self.normal);
            let ((xs, width), (ys, height)) = (around(u), around(v));
            let density = (ROOT_NODES / NEAR_NODES) as f64;
            let area = 0.25 * width * height * density * density;
            if area > 0.0 {
                add(&xs, &ys, area);
            }
        }
        fit.solve()
    }

    /// The squared distance less the squared chord at cube coordinates (u, v), times the length that the
    /// surface point is divided by.
    fn value(&self, face: Face, u: f64, v: f64) -> f64 {
        let (a, b) = (self.ellipsoid.semi_major_m, self.ellipsoid.semi_minor_m);
        let (a2, b2) = (a * a, b * b);
        let n = face.cube_point(u, v);
        let length = (a2 * (n.x * n.x + n.y * n.y) + b2 * n.z * n.z).sqrt();
        let point = DVec3::new(a2 * n.x, a2 * n.y, b2 * n.z) / length;
        (point.distance_squared(self.centre) - self.chord_squared_m2) * length
    }
}

/// From −1…1 over the stored lattice to the share of the tile's side, 0…1 within the tile.
fn to_share(x: f64) -> f64 {
    (x * HALF_STORED + 128.0) / CELLS as f64
}

/// A tile's cube coordinates, continued smoothly beyond the middle of the face and beyond its edges.
struct Axes {
    x: f64,
    y: f64,
    per_tile: f64,
    upper: [bool; 2],
}

impl Axes {
    fn new(tile: Tile) -> Self {
        let tiles = f64::from(1_u32 << tile.level());
        let [x, y] = [tile.x(), tile.y()].map(f64::from);
        Self {
            x,
            y,
            per_tile: 1.0 / tiles,
            upper: [x, y].map(|c| 2.0 * c >= tiles),
        }
    }

    fn u(&self, x: f64) -> f64 {
        branch((self.x + to_share(x)) * self.per_tile, self.upper[0])
    }

    fn v(&self, y: f64) -> f64 {
        branch((self.y + to_share(y)) * self.per_tile, self.upper[1])
    }
}

/// One of the two parabolas of [`st_to_uv`].
fn branch(s: f64, upper: bool) -> f64 {
    if upper {
        (4.0 * s * s - 1.0) / 3.0
    } else {
        let r = 1.0 - s;
        (1.0 - 4.0 * r * r) / 3.0
    }
}

/// The zeros of the Chebyshev polynomial of degree `count`.
fn chebyshev_nodes(count: usize) -> Vec<f64> {
    let step_deg = 180.0 / count as f64;
    (0..count)
        .map(|k| sine_cosine_deg((k as f64 + 0.5) * step_deg).1)
        .collect()
}

/// T₀…T_{N−1} at x.
pub(super) fn chebyshev<const N: usize>(x: f64) -> [f64; N] {
    let mut terms = [1.0; N];
    let (mut before, mut last) = (x, 1.0);
    for term in terms.iter_mut().skip(1) {
        (before, last) = (last, 2.0 * x * last - before);
        *term = last;
    }
    terms
}

/// Coefficients of products of Chebyshev polynomials to those of powers, in place.
fn to_powers(coefficients: &mut [f64], degree: usize) {
    let side = degree + 1;
    for row in coefficients.chunks_mut(side) {
        powers_of_line(row);
    }
    for n in 0..side {
        let mut column = [0.0; MAX_DEGREE + 1];
        let entries = coefficients.iter().skip(n).step_by(side);
        for (entry, value) in column.iter_mut().zip(entries) {
            *entry = *value;
        }
        powers_of_line(&mut column[..side]);
        for (value, entry) in coefficients.iter_mut().skip(n).step_by(side).zip(column) {
            *value = entry;
        }
    }
}

/// One line of Chebyshev coefficients, at most MAX_DEGREE + 1, to powers: Σ c_k T_k, with the powers of T_k from its recurrence.
fn powers_of_line(line: &mut [f64]) {
    let mut sum = [0.0; MAX_DEGREE + 1];
    let (mut before, mut current) = ([0.0; MAX_DEGREE + 1], [0.0; MAX_DEGREE + 1]);
    current[0] = 1.0;
    for (k, coefficient) in line.iter().enumerate() {
        for (sum, power) in sum.iter_mut().zip(current) {
            *sum += coefficient * power;
        }
        let factor = if k == 0 { 1.0 } else { 2.0 };
        let mut next = [0.0; MAX_DEGREE + 1];
        for n in 0..=MAX_DEGREE {
            let raised = if n == 0 { 0.0 } else { current[n - 1] };
            next[n] = factor * raised - before[n];
        }
        (before, current) = (current, next);
    }
    for (coefficient, sum) in line.iter_mut().zip(sum) {
        *coefficient = sum;
    }
}
