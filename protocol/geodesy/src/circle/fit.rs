//! A weighted least-squares fit of a function by products of Chebyshev polynomials of degree 8.
//! In: samples on grids. Out: 9 × 9 coefficients. Made for functions whose zeros matter: a sample counts
//! the more the smaller its value. It knows nothing of circles and tiles.

use super::polynomial::{MAX_DEGREE, chebyshev};

const SIDE: usize = MAX_DEGREE + 1;
/// Products of two polynomials of degree 8 reach degree 16.
const MOMENTS: usize = 2 * MAX_DEGREE + 1;
const UNKNOWNS: usize = SIDE * SIDE;

/// What is added to the diagonal of the normal equations, as a share of its mean: it keeps them solvable in f64
/// where weights differ much, and moves the rim by less than can be seen.
const RIDGE: f64 = 1e-13;

/// Samples on a grid.
pub(super) struct Samples<'a> {
    /// Columns, each within −1…1.
    pub(super) xs: &'a [f64],
    /// Rows, each within −1…1.
    pub(super) ys: &'a [f64],
    /// The weight of one sample before its value counts.
    pub(super) weight: f64,
    /// Values below this, without their sign, weigh alike; above 0.
    pub(super) floor: f64,
    /// The value at (column, row).
    pub(super) value: &'a dyn Fn(usize, usize) -> f64,
}

/// The sums that the normal equations are made of. A product of two terms is Tᵢ Tₖ = (Tᵢ₊ₖ + T|ᵢ₋ₖ|)/2, so
/// the sums over the terms up to degree 16 give all of the matrix.
pub(super) struct Fit {
    moments: [[f64; MOMENTS]; MOMENTS],
    right: [[f64; SIDE]; SIDE],
}

impl Default for Fit {
    fn default() -> Self {
        Self {
            moments: [[0.0; MOMENTS]; MOMENTS],
            right: [[0.0; SIDE]; SIDE],
        }
    }
}

impl Fit {
    /// Adds the samples of a grid, each with the weight (|value| + floor)⁻³.
    pub(super) fn add(&mut self, samples: &Samples<'_>) {
        let terms: Vec<[f64; MOMENTS]> = samples.xs.iter().map(|x| chebyshev(*x)).collect();
        for (row, y) in samples.ys.iter().enumerate() {
            let mut moments = [0.0; MOMENTS];
            let mut right = [0.0; SIDE];
            for (column, terms) in terms.iter().enumerate() {
                let value = (samples.value)(column, row);
                let size = value.abs() + samples.floor;
                let weight = samples.weight / (size * size * size);
                for (sum, term) in moments.iter_mut().zip(terms) {
                    *sum += weight * term;
                }
                for (sum, term) in right.iter_mut().zip(terms) {
                    *sum += weight * value * term;
                }
            }
            let terms_y: [f64; MOMENTS] = chebyshev(*y);
            for (line, term) in self.moments.iter_mut().zip(terms_y) {
                for (sum, moment) in line.iter_mut().zip(moments) {
                    *sum += term * moment;
                }
            }
            for (line, term) in self.right.iter_mut().zip(terms_y) {
                for (sum, part) in line.iter_mut().zip(right) {
                    *sum += term * part;
                }
            }
        }
    }

    /// The coefficients, line by line for rising degree in y, by Cholesky's factorisation RᵀR.
    pub(super) fn solve(&self) -> Vec<f64> {
        let mut matrix = self.matrix();
        let trace: f64 = (0..UNKNOWNS).map(|n| matrix[n][n]).sum();
        let ridge = RIDGE * trace / UNKNOWNS as f64;
        let mut solution: Vec<f64> = self.right.as_flattened().to_vec();
        for k in 0..UNKNOWNS {
            let (above, below) = matrix.split_at_mut(k + 1);
            let row = &mut above[k];
            // Rounding may make a pivot of a nearly singular matrix too small; it never is in exact numbers.
            let pivot = (row[k] + ridge).max(ridge).sqrt();
            row[k] = pivot;
            for entry in &mut row[k + 1..] {
                *entry /= pivot;
            }
            solution[k] /= pivot;
            let part = solution[k];
            for (offset, target) in below.iter_mut().enumerate() {
                let i = k + 1 + offset;
                let factor = row[i];
                for (entry, from) in target[i..].iter_mut().zip(&row[i..]) {
                    *entry -= factor * from;
                }
                solution[i] -= factor * part;
            }
        }
        for k in (0..UNKNOWNS).rev() {
            let later: f64 = matrix[k][k + 1..]
                .iter()
                .zip(&solution[k + 1..])
                .map(|(entry, value)| entry * value)
                .sum();
            solution[k] = (solution[k] - later) / matrix[k][k];
        }
        solution
    }

    /// The upper triangle of the normal equations.
    fn matrix(&self) -> Vec<[f64; UNKNOWNS]> {
        let mut matrix = vec![[0.0; UNKNOWNS]; UNKNOWNS];
        for (row, line) in matrix.iter_mut().enumerate() {
            let (m, n) = (row / SIDE, row % SIDE);
            for other_m in m..SIDE {
                let (sum, difference) = (&self.moments[m + other_m], &self.moments[other_m - m]);
                for other_n in 0..SIDE {
                    let (far, near) = (n + other_n, n.abs_diff(other_n));
                    line[other_m * SIDE + other_n] =
                        0.25 * (sum[far] + sum[near] + difference[far] + difference[near]);
                }
            }
        }
        matrix
    }
}
