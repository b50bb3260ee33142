//! Surfaces given by points on a grid, bilinear between them.
//! In: points in row order from the upper left, NaN where nothing is. Out: room points, normals, rays' meetings. It reads
//! no file.

use std::fmt;
use std::sync::{Arc, OnceLock};

use glam::DVec3;

use crate::ShapeError;
use crate::points_tree::Tree;
use crate::rays::{in_room, on_canvas};

/// The most points a side.
const MOST_SIDE: u32 = 16_384;
/// The most points: 8192 × 8192.
const MOST_POINTS: u64 = 1 << 26;
/// A corner of a cell with less than this share of a place does not count for it, so that a pixel exactly on a point needs
/// none of its neighbours.
const LEAST_SHARE: f64 = 1e-6;
/// The least area of a cell, in square metres.
const LEAST_AREA_M2: f64 = 1e-12;

/// Where on the canvas the points lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointsAt {
    /// In the middles of width × height cells, as pixels of a picture; the outer half cells continue the inner ones.
    CellCentres,
    /// From edge to edge, the first one on the upper left corner.
    Corners,
}

/// A surface through points. Clones share the points.
#[derive(Clone)]
pub struct Points {
    width: u32,
    height: u32,
    at: PointsAt,
    points_m: Arc<[[f32; 3]]>,
    tree: Arc<OnceLock<Tree>>,
}

impl fmt::Debug for Points {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            width, height, at, ..
        } = self;
        write!(formatter, "Points({width} × {height}, {at:?})")
    }
}

/// The four points around a place: upper left, upper right, lower left, lower right.
pub(crate) type Patch = [DVec3; 4];

impl Points {
    /// A surface of `width` × `height` points in room metres, row 0 at the top, columns from the left as the viewers see
    /// them. NaN in a coordinate: there is nothing, nor in the cells around it.
    ///
    /// # Errors
    /// If the sizes are out of range (2…16384 a side, at most 2²⁶ points) or not those of the points, if a coordinate
    /// is infinite or beyond 10 km, or if no cell has an area.
    pub fn new(
        width: u32,
        height: u32,
        points_m: Vec<[f32; 3]>,
        at: PointsAt,
    ) -> Result<Self, ShapeError> {
        let sides = 2..=MOST_SIDE;
        let count = u64::from(width) * u64::from(height);
        if !(sides.contains(&width) && sides.contains(&height) && count <= MOST_POINTS) {
            return Err(ShapeError::PointSize { width, height });
        }
        if usize::try_from(count) != Ok(points_m.len()) {
            let count = points_m.len();
            return Err(ShapeError::PointCount {
                width,
                height,
                count,
            });
        }
        let outside = |point: &[f32; 3]| {
            let point = DVec3::from(point.map(f64::from));
            !point.is_nan() && !in_room(point)
        };
        if let Some(index) = points_m.iter().position(outside) {
            let columns = width as usize;
            return Err(ShapeError::PointNotInRoom {
                column: index % columns,
                row: index / columns,
            });
        }
        let points = Self {
            width,
            height,
            at,
            points_m: points_m.into(),
            tree: Arc::default(),
        };
        let has_area = |(column, row)| {
            points
                .patch(column, row)
                .is_some_and(|p| area_m2(&p) > LEAST_AREA_M2)
        };
        let mut cells = (0..points.rows() - 1)
            .flat_map(|row| (0..points.columns() - 1).map(move |column| (column, row)));
        if !cells.any(has_area) {
            return Err(ShapeError::NoSurface);
        }
        Ok(points)
    }

    /// Points in a row, 2…16384.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Points in a column, 2…16384.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// Where on the canvas the points lie.
    #[must_use]
    pub const fn at(&self) -> PointsAt {
        self.at
    }

    /// The points in room metres, row by row from the top.
    #[must_use]
    pub fn points_m(&self) -> &[[f32; 3]] {
        &self.points_m
    }

    pub(crate) const fn columns(&self) -> usize {
        self.width as usize
    }

    pub(crate) const fn rows(&self) -> usize {
        self.height as usize
    }

    /// Everything is checked when the points are put together.
    #[expect(clippy::unnecessary_wraps, reason = "all shapes are checked alike")]
    pub(crate) const fn check(&self) -> Result<(), ShapeError> {
        Ok(())
    }

    fn point(&self, column: usize, row: usize) -> Option<DVec3> {
        let point = self.points_m.get(row * self.columns() + column)?;
        Some(DVec3::from(point.map(f64::from))).filter(|point| !point.is_nan())
    }

    /// The points of the cell whose upper left one is given, if all are there.
    fn patch(&self, column: usize, row: usize) -> Option<Patch> {
        Some([
            self.point(column, row)?,
            self.point(column + 1, row)?,
            self.point(column, row + 1)?,
            self.point(column + 1, row + 1)?,
        ])
    }

    /// Where between points a share of the canvas is: the point before, and the part of the way to the next one.
    fn place(&self, share: f64, count: usize) -> (usize, f64) {
        let points = count as f64;
        let along = match self.at {
            PointsAt::CellCentres => share * points - 0.5,
            PointsAt::Corners => share * (points - 1.0),
        };
        let before = along.floor().clamp(0.0, points - 2.0);
        (before as usize, along - before)
    }

    /// The share of the canvas at which a place between points is.
    fn share(&self, along: f64, count: usize) -> f64 {
        let points = count as f64;
        match self.at {
            PointsAt::CellCentres => (along + 0.5) / points,
            PointsAt::Corners => along / (points - 1.0),
        }
    }

    /// The point at shares; the outermost cells go on beyond the edges.
    pub(crate) fn point_m(&self, x_share: f64, y_share: f64) -> Option<DVec3> {
        let (column, right) = self.place(x_share, self.columns());
        let (row, down) = self.place(y_share, self.rows());
        let mut sum = DVec3::ZERO;
        for (ahead_x, x) in [(0, 1.0 - right), (1, right)] {
            for (ahead_y, y) in [(0, 1.0 - down), (1, down)] {
                let share = x * y;
                if share.abs() > LEAST_SHARE {
                    sum += self.point(column + ahead_x, row + ahead_y)? * share;
                }
            }
        }
        Some(sum)
    }

    pub(crate) fn normal(&self, x_share: f64, y_share: f64) -> Option<DVec3> {
        let (column, right) = self.place(x_share, self.columns());
        let (row, down) = self.place(y_share, self.rows());
        let [along_x, along_y] = slopes(&self.patch(column, row)?, right, down);
        along_y.cross(along_x).try_normalize()
    }

    /// Where the border between cells lies, in points from the first one: on the points, but the outermost cells reach to
    /// the edges of the canvas.
    fn border(&self, index: usize, count: usize) -> f64 {
        match self.at {
            PointsAt::CellCentres if index == 0 => -0.5,
            PointsAt::CellCentres if index + 1 == count => count as f64 - 0.5,
            _ => index as f64,
        }
    }

    /// The corners of a cell of the canvas.
    pub(crate) fn cell(&self, column: usize, row: usize) -> Option<Patch> {
        let patch = self.patch(column, row)?;
        let x = [column, column + 1].map(|x| self.border(x, self.columns()) - column as f64);
        let y = [row, row + 1].map(|y| self.border(y, self.rows()) - row as f64);
        if x == [0.0, 1.0] && y == [0.0, 1.0] {
            return Some(patch);
        }
        let [x0, x1] = x;
        let [y0, y1] = y;
        Some([[x0, y0], [x1, y0], [x0, y1], [x1, y1]].map(|[x, y]| between(&patch, x, y)))
    }

    pub(crate) fn locate(&self, from_m: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        let tree = self.tree.get_or_init(|| Tree::new(self));
        let meeting = tree.first(self, from_m, direction)?;
        let along = |cell: usize, part: f64, count: usize| {
            let (first, last) = (self.border(cell, count), self.border(cell + 1, count));
            on_canvas(
                self.share(first + (last - first) * part, count)
                    .clamp(0.0, 1.0),
            )
        };
        let [column, row] = meeting.cell;
        let [right, down] = meeting.part;
        Some([
            along(column, right, self.columns())?,
            along(row, down, self.rows())?,
        ])
    }
}

/// Twice the greater area of the patch's halves.
fn area_m2(patch: &Patch) -> f64 {
    let [a, b, c, d] = patch;
    let half = |to: DVec3, from: DVec3, other: DVec3| (to - from).cross(other - from).length();
    half(*b, *a, *c).max(half(*b, *d, *c))
}

/// What is bilinear between the points of a patch, parts 0…1 of the way to the right and down, or beyond.
fn between(patch: &Patch, right: f64, down: f64) -> DVec3 {
    let [a, b, c, d] = patch;
    let upper = *a * (1.0 - right) + *b * right;
    let lower = *c * (1.0 - right) + *d * right;
    upper * (1.0 - down) + lower * down
}

/// How the point between the points of a patch moves to the right and down.
fn slopes(patch: &Patch, right: f64, down: f64) -> [DVec3; 2] {
    let [a, b, c, d] = *patch;
    [
        (b - a) * (1.0 - down) + (d - c) * down,
        (c - a) * (1.0 - right) + (d - b) * right,
    ]
}
