//! Where the nodes of the lattice lie in a source: exact at few nodes, interpolated between them, checked.
//! In: a face, a level, blocks of 16×16 nodes of the face's lattice. Out: positions in the source. A block is placed by
//! itself alone, so a node has one position, whichever tile asks.

use geodesy::{CELLS, Ellipsoid, Face, LatticePoint, Tile};

use crate::grid::{Grid, Position};

/// Nodes along a block's side.
pub(crate) const BLOCK: i64 = 16;
/// Interpolated positions must be this near to exact ones, in samples, where they are compared.
const TOLERANCE: f64 = 0.005;
/// A projection that does not come back to within this many degrees is not to be trusted there.
const RETURN_DEG: f64 = 1e-6;

/// Nodes along a face's side at a level, both edges included, less one.
pub(crate) const fn face_cells(level: u8) -> i64 {
    CELLS << level
}

/// Node (gx, gy) of a face's lattice, both 0…256·2^level.
pub(crate) fn face_point(face: Face, level: u8, gx: i64, gy: i64) -> LatticePoint {
    let last = (1_i64 << level) - 1;
    let (x, y) = ((gx / CELLS).clamp(0, last), (gy / CELLS).clamp(0, last));
    let tile = Tile::new(face.number(), level, x as u32, y as u32).unwrap_or(Tile::root(face));
    LatticePoint::of_tile(tile, gx - x * CELLS, gy - y * CELLS)
}

/// The exact position of a node, outside the grid too. `near` as in [`Grid::position`].
pub(crate) fn exact(grid: &Grid, point: LatticePoint, near: Option<f64>) -> Option<Position> {
    let (latitude, longitude) = Ellipsoid::angles_deg(point.normal());
    grid.position(latitude, longitude, near)
}

/// The positions of the nodes of one block.
pub(crate) enum Placing {
    /// No node of the block lies in the grid.
    Outside,
    /// Column and row are polynomials of second degree in both directions over −1…1.
    Smooth { columns: [f64; 9], rows: [f64; 9] },
    /// Each node must be placed exactly.
    Rough,
}

impl Placing {
    /// Places block (bx, by) of a face at a level.
    pub(crate) fn of_block(grid: &Grid, face: Face, level: u8, bx: i64, by: i64) -> Self {
        let point = |a: i64, b: i64| face_point(face, level, bx * BLOCK + a, by * BLOCK + b);
        let half = BLOCK / 2;
        let Some(middle) = exact(grid, point(half, half), None) else {
            return Self::Rough;
        };
        if !comes_back(grid, point(half, half), middle) {
            return Self::Rough;
        }
        let near = grid.crs.is_geographic().then(|| grid.longitude_of(middle));
        let mut columns = [0.0; 9];
        let mut rows = [0.0; 9];
        for b in 0..3 {
            for a in 0..3 {
                let Some(position) = exact(grid, point(a * half, b * half), near) else {
                    return Self::Rough;
                };
                let at = (b * 3 + a) as usize;
                columns[at] = position.column;
                rows[at] = position.row;
            }
        }
        if misses(grid, &columns, &rows) {
            return Self::Outside;
        }
        let (columns, rows) = (coefficients(columns), coefficients(rows));
        let quarter = half / 2;
        for (a, b) in [(-1, -1), (1, -1), (-1, 1), (1, 1)] {
            let due = exact(grid, point(half + a * quarter, half + b * quarter), near);
            let (s, t) = (0.5 * a as f64, 0.5 * b as f64);
            let near_enough = due.is_some_and(|due| {
                (evaluate(&columns, s, t) - due.column).abs() < TOLERANCE
                    && (evaluate(&rows, s, t) - due.row).abs() < TOLERANCE
            });
            if !near_enough {
                return Self::Rough;
            }
        }
        Self::Smooth { columns, rows }
    }
}

/// The position of a node of a smoothly placed block; a and b are its indices in the block.
#[inline]
pub(crate) fn smooth(columns: &[f64; 9], rows: &[f64; 9], a: i64, b: i64) -> Position {
    let half = (BLOCK / 2) as f64;
    let (s, t) = ((a as f64 - half) / half, (b as f64 - half) / half);
    Position {
        column: evaluate(columns, s, t),
        row: evaluate(rows, s, t),
    }
}

/// Whether the projection of a node leads back to it; far from their home some do not.
fn comes_back(grid: &Grid, point: LatticePoint, position: Position) -> bool {
    if grid.crs.is_plain_degrees() {
        return true;
    }
    let (latitude, longitude) = Ellipsoid::angles_deg(point.normal());
    let Some((back_latitude, back_longitude)) = grid.angles_deg(position.column, position.row)
    else {
        return false;
    };
    let turn = back_longitude - longitude;
    let turn = (turn - 360.0 * (turn / 360.0).round()) * latitude.to_radians().cos();
    (back_latitude - latitude).abs() < RETURN_DEG && turn.abs() < RETURN_DEG
}

/// An exact position that is trusted, for nodes that are placed alone.
pub(crate) fn trusted(grid: &Grid, point: LatticePoint) -> Option<Position> {
    exact(grid, point, None).filter(|position| comes_back(grid, point, *position))
}

/// True where the hull of the placed nodes, widened by itself, lies beside the grid.
fn misses(grid: &Grid, columns: &[f64; 9], rows: &[f64; 9]) -> bool {
    let beside = |values: &[f64; 9], last: f64| {
        let lowest = values.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let reach = highest - lowest + 1.0;
        highest + reach < 0.0 || lowest - reach > last
    };
    let (last_column, last_row) = (f64::from(grid.width - 1), f64::from(grid.height - 1));
    if beside(rows, last_row) {
        return true;
    }
    if grid.period() == 0.0 {
        return beside(columns, last_column);
    }
    // Columns come around again.
    let turned = |turns: f64| columns.map(|column| column + turns * grid.period());
    !grid.wraps()
        && [-1.0, 0.0, 1.0]
            .iter()
            .all(|turns| beside(&turned(*turns), last_column))
}

/// Values at −1, 0, 1 both ways to the coefficients of 1, s, s² by 1, t, t².
fn coefficients(values: [f64; 9]) -> [f64; 9] {
    let line = |low: f64, middle: f64, high: f64| {
        [middle, 0.5 * (high - low), 0.5 * (low + high) - middle]
    };
    let [a, b, c, d, e, f, g, h, i] = values;
    let rows = [line(a, b, c), line(d, e, f), line(g, h, i)];
    let mut result = [0.0; 9];
    for s in 0..3 {
        let column = line(rows[0][s], rows[1][s], rows[2][s]);
        for t in 0..3 {
            result[t * 3 + s] = column[t];
        }
    }
    result
}

#[inline]
fn evaluate(c: &[f64; 9], s: f64, t: f64) -> f64 {
    let line = |k: usize| c[k] + s * (c[k + 1] + s * c[k + 2]);
    line(0) + t * (line(3) + t * line(6))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use crate::crs::Crs;
    use crate::grid::Affine;
    use crate::options::Extent;
    use std::sync::Arc;

    /// The largest distance in samples between placed and exact nodes that lie in the grid, over blocks
    /// scattered over all faces, and how many blocks were smooth.
    fn worst(grid: &Grid, level: u8) -> (f64, usize) {
        let (mut worst, mut smooth_blocks) = (0.0_f64, 0);
        let blocks = face_cells(level) / BLOCK;
        for face in geodesy::FACES {
            for step in 0..900_i64 {
                let (bx, by) = (step % 30 * (blocks - 1) / 29, step / 30 * (blocks - 1) / 29);
                let Placing::Smooth { columns, rows } =
                    Placing::of_block(grid, face, level, bx, by)
                else {
                    continue;
                };
                smooth_blocks += 1;
                for (a, b) in [(0, 0), (3, 3), (12, 4), (15, 1), (4, 12), (8, 15)] {
                    let place = smooth(&columns, &rows, a, b);
                    let point = face_point(face, level, bx * BLOCK + a, by * BLOCK + b);
                    let due = exact(grid, point, None);
                    let (Some(due), Some(place)) =
                        (due.and_then(|p| grid.place(p)), grid.place(place))
                    else {
                        continue;
                    };
                    let mut across = (place.column - due.column).abs();
                    if grid.wraps() {
                        across = across.min(f64::from(grid.width) - across);
                    }
                    worst = worst.max(across.max((place.row - due.row).abs()));
                }
            }
        }
        (worst, smooth_blocks)
    }

    #[test]
    fn interpolated_positions_are_near_exact_ones() {
        let whole = Extent {
            west: -180.0,
            south: -90.0,
            east: 180.0,
            north: 90.0,
        };
        let globe = Grid::of_extent(4320, 2160, whole, false).unwrap();
        let (error, blocks) = worst(&globe, 3);
        assert!(error < 0.01 && blocks > 4000, "{error} {blocks}");
        let crs = Arc::new(Crs::from_epsg(3031, &Ellipsoid::EARTH).unwrap());
        let to_crs = Affine {
            x0: -3_000_000.0,
            dx_column: 2000.0,
            dx_row: 0.0,
            y0: 3_000_000.0,
            dy_column: 0.0,
            dy_row: -2000.0,
        };
        let polar = Grid::new(3001, 3001, crs, to_crs, true).unwrap();
        let (error, blocks) = worst(&polar, 5);
        assert!(error < 0.01 && blocks > 300, "{error} {blocks}");
    }
}
