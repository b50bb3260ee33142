//! Triangles over an output, drawn into a grid.
//! In: vertices with values, and triangles. Out: the values at every pixel centre, NaN where no triangle is. Work
//! and memory depend on the output's size, whatever the mesh says.

use crate::MAX_SIZE_PX;
use crate::grid::{Grid, Placement, Sample};

/// Slack at the edges of triangles, as a share of the triangle: neighbours leave no crack.
const SLACK: f64 = 1e-9;
/// How far vertices of a regular mesh may lie off their places, as a share of the output: text files round.
const REGULAR: f64 = 1e-5;

/// Why a mesh was not drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RasteriseError {
    /// The output has no size or too large a size.
    #[error("an output of {width} × {height} pixels is no size. Sizes are 1…{MAX_SIZE_PX}.")]
    BadSize {
        /// Its width.
        width: u32,
        /// Its height.
        height: u32,
    },
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} names a vertex that is not there. Export the mesh again.")]
    NoVertex {
        /// Its place, from 0.
        triangle: usize,
    },
    /// Triangles cover each other over and over.
    #[error("its triangles cover the output more than 16 times over. Remove what overlaps.")]
    TooMuchOverlap,
}

/// A corner of triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Its place on the output: shares from the upper left corner, to the right and down. It may lie outside.
    pub place: [f64; 2],
    /// What is shown there.
    pub values: [f32; 3],
}

/// Triangles over an output.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The corners.
    pub vertices: Vec<Vertex>,
    /// Three indices of corners each, in any sense of rotation.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The values at the pixel centres of an output, linear within each triangle. Centres on an edge belong
    /// to the triangle. Where triangles overlap, the last one counts; where there is none, all values are NaN.
    ///
    /// # Errors
    /// A size out of 1…16384, a vertex that is not there, or more than 16 layers of triangles.
    pub fn rasterise(&self, width: u32, height: u32) -> Result<Grid<[f32; 3]>, RasteriseError> {
        let bad_size = RasteriseError::BadSize { width, height };
        if !(1..=MAX_SIZE_PX).contains(&width) || !(1..=MAX_SIZE_PX).contains(&height) {
            return Err(bad_size);
        }
        let pixels = u64::from(width) * u64::from(height);
        // Rows and pixels that may be looked at: 16 layers, and some for the edges of small triangles.
        let mut budget = 16 * pixels + 64 * self.triangles.len() as u64 + 65_536;
        let mut values = vec![<[f32; 3]>::HOLE; pixels as usize];
        for (index, triangle) in self.triangles.iter().enumerate() {
            let corner = |number: u32| self.vertices.get(number as usize).copied();
            let [Some(a), Some(b), Some(c)] = triangle.map(corner) else {
                return Err(RasteriseError::NoVertex { triangle: index });
            };
            let drawn = Triangle::new([a, b, c], width, height);
            if let Some(drawn) = drawn {
                drawn.draw(&mut values, &mut budget)?;
            }
        }
        Grid::new(width, height, Placement::Centres, values).ok_or(bad_size)
    }
}

/// A triangle in pixels.
struct Triangle {
    corners: [[f64; 2]; 3],
    values: [[f32; 3]; 3],
    area: f64,
    width: u32,
    height: u32,
}

impl Triangle {
    /// `None` for a triangle without area, which covers no pixel centre.
    fn new(vertices: [Vertex; 3], width: u32, height: u32) -> Option<Self> {
        let corners = vertices.map(|vertex| {
            [
                vertex.place[0] * f64::from(width),
                vertex.place[1] * f64::from(height),
            ]
        });
        let [a, b, c] = corners;
        let area = cross(a, b, c);
        (area.is_finite() && area.abs() > 1e-12).then_some(Self {
            corners,
            values: vertices.map(|vertex| vertex.values),
            area,
            width,
            height,
        })
    }

    fn draw(&self, values: &mut [[f32; 3]], budget: &mut u64) -> Result<(), RasteriseError> {
        let [a, b, c] = self.corners;
        let top = a[1].min(b[1]).min(c[1]);
        let bottom = a[1].max(b[1]).max(c[1]);
        let (first, end) = centres(top, bottom, self.height);
        for row in first..end {
            let y = f64::from(row) + 0.5;
            let (left, right) = self.span(y);
            let (start, stop) = centres(left, right, self.width);
            *budget = budget
                .checked_sub(1 + u64::from(stop.saturating_sub(start)))
                .ok_or(RasteriseError::TooMuchOverlap)?;
            for column in start..stop {
                let at = [f64::from(column) + 0.5, y];
                let shares = self.shares(at);
                if shares.iter().all(|share| *share >= -SLACK) {
                    let index = row as usize * self.width as usize + column as usize;
                    if let Some(place) = values.get_mut(index) {
                        let [first, second, third] = self.values;
                        *place = <[f32; 3]>::weighted(&[
                            (first, shares[0]),
                            (second, shares[1]),
                            (third, shares[2]),
                        ]);
                    }
                }
            }
        }
        Ok(())
    }

    /// Barycentric shares of a place.
    fn shares(&self, at: [f64; 2]) -> [f64; 3] {
        let [a, b, c] = self.corners;
        let first = cross(at, b, c) / self.area;
        let second = cross(a, at, c) / self.area;
        [first, second, 1.0 - first - second]
    }

    /// From where to where the triangle reaches at a height, half a thousandth of a pixel generous.
    fn span(&self, y: f64) -> (f64, f64) {
        const GENEROUS: f64 = 5e-4;
        let [a, b, c] = self.corners;
        let mut left = f64::INFINITY;
        let mut right = f64::NEG_INFINITY;
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let (low, high) = (from[1].min(to[1]), from[1].max(to[1]));
            if y < low - GENEROUS || y > high + GENEROUS {
                continue;
            }
            if high - low < 2.0 * GENEROUS {
                left = left.min(from[0].min(to[0]));
                right = right.max(from[0].max(to[0]));
            } else {
                let share = ((y - from[1]) / (to[1] - from[1])).clamp(0.0, 1.0);
                let x = from[0] + share * (to[0] - from[0]);
                left = left.min(x);
                right = right.max(x);
            }
        }
        (left - GENEROUS, right + GENEROUS)
    }
}

/// Twice the signed area of a triangle.
fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The pixels whose centres lie in an interval: the first and the one after the last.
fn centres(low: f64, high: f64, size: u32) -> (u32, u32) {
    let size = f64::from(size);
    let first = (low - 0.5 - 1e-6).ceil().clamp(0.0, size);
    let end = ((high - 0.5 + 1e-6).floor() + 1.0).clamp(0.0, size);
    (first as u32, end as u32)
}

/// Vertices in rows, joined to quadrilaterals of two triangles each. A quadrilateral with a hidden corner is
/// left out.
pub(crate) struct Lattice {
    /// Columns, at least 2.
    pub(crate) columns: u32,
    /// Rows, at least 2.
    pub(crate) rows: u32,
    /// `columns · rows` vertices; `None` are hidden.
    pub(crate) vertices: Vec<Option<Vertex>>,
}

impl Lattice {
    /// The lattice as triangles.
    pub(crate) fn mesh(&self) -> Mesh {
        let hidden = Vertex {
            place: [0.0; 2],
            values: [f32::NAN; 3],
        };
        let shown = |index: u32| matches!(self.vertices.get(index as usize), Some(Some(_)));
        let mut triangles = Vec::new();
        for row in 1..self.rows {
            for column in 1..self.columns {
                let below = row * self.columns + column;
                let above = below - self.columns;
                let (upper_left, upper_right, lower_left, lower_right) =
                    (above - 1, above, below - 1, below);
                if [upper_left, upper_right, lower_left, lower_right]
                    .into_iter()
                    .all(shown)
                {
                    triangles.push([upper_left, upper_right, lower_right]);
                    triangles.push([upper_left, lower_right, lower_left]);
                }
            }
        }
        Mesh {
            vertices: self
                .vertices
                .iter()
                .map(|vertex| vertex.unwrap_or(hidden))
                .collect(),
            triangles,
        }
    }

    /// The values as a grid with its samples on the output's corners, where that is where the vertices lie.
    pub(crate) fn regular(&self) -> Option<Grid<[f32; 3]>> {
        let (last_column, last_row) = (f64::from(self.columns - 1), f64::from(self.rows - 1));
        let fits = |from_top: bool| {
            self.vertices.iter().zip(0_u32..).all(|(vertex, index)| {
                let (column, row) = (
                    f64::from(index % self.columns),
                    f64::from(index / self.columns),
                );
                let along = row / last_row;
                let wanted = [
                    column / last_column,
                    if from_top { along } else { 1.0 - along },
                ];
                vertex.is_some_and(|vertex| {
                    vertex
                        .place
                        .iter()
                        .zip(wanted)
                        .all(|(place, wanted)| (place - wanted).abs() <= REGULAR)
                })
            })
        };
        let values =
            |vertex: &Option<Vertex>| vertex.map_or(<[f32; 3]>::HOLE, |vertex| vertex.values);
        let rows = self.vertices.chunks_exact(self.columns as usize);
        let values: Vec<[f32; 3]> = if fits(true) {
            rows.flatten().map(values).collect()
        } else if fits(false) {
            rows.rev().flatten().map(values).collect()
        } else {
            return None;
        };
        Grid::new(self.columns, self.rows, Placement::Corners, values)
    }
}
