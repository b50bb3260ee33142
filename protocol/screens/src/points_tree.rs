//! Where a ray meets a surface of points: a pyramid of boxes over its cells, and the bilinear patches.
//! In: points, rays. Out: cells and places in them. It is built once, when the first ray asks.

use glam::DVec3;

use crate::points::{Patch, Points};
use crate::rays::NEAREST_M;

/// Cells along a side of the smallest boxes.
const LEAF: usize = 4;
/// How far beyond a cell a ray still meets it, in its shares, so that none slips between two.
const SLACK: f64 = 1e-9;

/// A box along the axes; the lower corner above the upper one where nothing is.
#[derive(Clone, Copy)]
struct Bounds {
    low: DVec3,
    high: DVec3,
}

/// One level of the pyramid.
struct Level {
    columns: usize,
    rows: usize,
    bounds: Vec<Bounds>,
}

/// A pyramid of boxes, the smallest first.
pub(crate) struct Tree {
    levels: Vec<Level>,
}

/// Where a ray meets the surface.
pub(crate) struct Meeting {
    /// Column and row of the cell.
    pub(crate) cell: [usize; 2],
    /// Parts of the cell, to the right and down.
    pub(crate) part: [f64; 2],
    distance_m: f64,
}

impl Bounds {
    const NOTHING: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
    };

    fn with(self, point: DVec3) -> Self {
        Self {
            low: self.low.min(point),
            high: self.high.max(point),
        }
    }

    /// Where a ray enters, if it does.
    fn entry(&self, from_m: DVec3, inverse: DVec3) -> Option<f64> {
        if self.low.x > self.high.x {
            return None;
        }
        let (near, far) = (
            (self.low - from_m) * inverse,
            (self.high - from_m) * inverse,
        );
        let (mut entry, mut exit) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            // For a ray in the plane of a side 0 · ∞ is not a number, which `min` and `max` leave out.
            entry = entry.max(near[axis].min(far[axis]));
            exit = exit.min(near[axis].max(far[axis]));
        }
        (entry <= exit * (1.0 + 1e-12) + 1e-9).then_some(entry)
    }
}

impl Level {
    fn get(&self, column: usize, row: usize) -> Option<&Bounds> {
        (column < self.columns).then(|| self.bounds.get(row * self.columns + column))?
    }
}

impl Tree {
    pub(crate) fn new(points: &Points) -> Self {
        let (columns, rows) = (points.columns() - 1, points.rows() - 1);
        let mut level = Level {
            columns: columns.div_ceil(LEAF),
            rows: rows.div_ceil(LEAF),
            bounds: Vec::new(),
        };
        for row in 0..level.rows {
            for column in 0..level.columns {
                let corners = leaf_cells(points, column, row)
                    .filter_map(|[x, y]| points.cell(x, y))
                    .flatten();
                level
                    .bounds
                    .push(corners.fold(Bounds::NOTHING, Bounds::with));
            }
        }
        let mut levels = vec![level];
        while let Some(finer) = levels.last().filter(|level| level.bounds.len() > 1) {
            let (columns, rows) = (finer.columns.div_ceil(2), finer.rows.div_ceil(2));
            let mut bounds = Vec::with_capacity(columns * rows);
            for row in 0..rows {
                for column in 0..columns {
                    let children = children(column, row).into_iter();
                    bounds.push(
                        children
                            .filter_map(|[x, y]| finer.get(x, y))
                            .fold(Bounds::NOTHING, |all, one| all.with(one.low).with(one.high)),
                    );
                }
            }
            levels.push(Level {
                columns,
                rows,
                bounds,
            });
        }
        Self { levels }
    }

    /// The first meeting of a ray with a direction of unit length.
    pub(crate) fn first(
        &self,
        points: &Points,
        from_m: DVec3,
        direction: DVec3,
    ) -> Option<Meeting> {
        let inverse = direction.recip();
        let mut best: Option<Meeting> = None;
        let top = self.levels.len() - 1;
        let mut open = vec![(top, [0, 0], 0.0)];
        while let Some((level, [column, row], entry)) = open.pop() {
            if best.as_ref().is_some_and(|best| best.distance_m < entry) {
                continue;
            }
            let Some(finer) = level.checked_sub(1) else {
                for cell in leaf_cells(points, column, row) {
                    let Some(patch) = points.cell(cell[0], cell[1]) else {
                        continue;
                    };
                    if let Some((distance_m, part)) = meet(&patch, from_m, direction)
                        && best
                            .as_ref()
                            .is_none_or(|best| distance_m < best.distance_m)
                    {
                        best = Some(Meeting {
                            cell,
                            part,
                            distance_m,
                        });
                    }
                }
                continue;
            };
            let mut entered = Vec::with_capacity(4);
            for [x, y] in children(column, row) {
                let bounds = self.levels.get(finer).and_then(|level| level.get(x, y));
                if let Some(entry) = bounds.and_then(|bounds| bounds.entry(from_m, inverse)) {
                    entered.push((finer, [x, y], entry));
                }
            }
            // The nearest is taken from the end.
            entered.sort_by(|first, second| second.2.total_cmp(&first.2));
            open.extend(entered);
        }
        best
    }
}

fn children(column: usize, row: usize) -> [[usize; 2]; 4] {
    [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[x, y]| [2 * column + x, 2 * row + y])
}

/// The cells of a smallest box.
fn leaf_cells(points: &Points, column: usize, row: usize) -> impl Iterator<Item = [usize; 2]> {
    let columns = column * LEAF..((column + 1) * LEAF).min(points.columns() - 1);
    let rows = row * LEAF..((row + 1) * LEAF).min(points.rows() - 1);
    rows.flat_map(move |y| columns.clone().map(move |x| [x, y]))
}

/// Where a ray first meets what is bilinear between four points: distance, and the parts of the patch. In two planes that hold
/// the ray, the patch is off it by a + b·x + c·y + d·x·y; y from one of them in the other leaves a quadratic for x (as
/// Ramsey, Potter and Hansen 2004, "Ray bilinear patch intersections").
fn meet(patch: &Patch, from_m: DVec3, direction: DVec3) -> Option<(f64, [f64; 2])> {
    let (first, second) = direction.any_orthonormal_pair();
    let origin = patch[0] - from_m;
    let [right, down] = [patch[1] - patch[0], patch[2] - patch[0]];
    let twist = patch[3] - patch[1] - down;
    let along = |plane: DVec3| [origin, right, down, twist].map(|vector| vector.dot(plane));
    let ([a, b, c, d], [e, f, g, h]) = (along(first), along(second));
    let [square, linear, constant] = [b * h - f * d, a * h + b * g - e * d - f * c, a * g - e * c];
    let discriminant = linear * linear - 4.0 * square * constant;
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    let larger = -0.5 * (linear + discriminant.sqrt().copysign(linear));
    // For a flat patch one of them is infinite; for a patch seen from its edge they may not be numbers.
    [constant / larger, larger / square]
        .into_iter()
        .filter_map(|x| {
            let (below_first, below_second) = (c + d * x, g + h * x);
            let y = if below_first.abs() > below_second.abs() {
                -(a + b * x) / below_first
            } else {
                -(e + f * x) / below_second
            };
            let within = -SLACK..=1.0 + SLACK;
            let distance_m = (origin + right * x + down * y + twist * (x * y)).dot(direction);
            let met = within.contains(&x) && within.contains(&y) && distance_m > NEAREST_M;
            met.then_some((distance_m, [x, y]))
        })
        .min_by(|first, second| first.0.total_cmp(&second.0))
}
