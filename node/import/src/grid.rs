//! Where the samples of a source lie: from a latitude and longitude to a column and row, and back.
//! In: a coordinate system and an affine map. Out: fractional sample positions, (0, 0) being the first sample itself.
//! It reads no samples.

use std::sync::Arc;

use crate::crs::Crs;
use crate::options::Extent;

/// x = x0 + column·dx_column + row·dx_row, and the same for y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Affine {
    pub(crate) x0: f64,
    pub(crate) dx_column: f64,
    pub(crate) dx_row: f64,
    pub(crate) y0: f64,
    pub(crate) dy_column: f64,
    pub(crate) dy_row: f64,
}

impl Affine {
    pub(crate) fn apply(&self, column: f64, row: f64) -> (f64, f64) {
        (
            self.x0 + column * self.dx_column + row * self.dx_row,
            self.y0 + column * self.dy_column + row * self.dy_row,
        )
    }

    /// The same map with its origin moved by a step in columns and rows.
    pub(crate) fn moved(self, columns: f64, rows: f64) -> Self {
        let (x0, y0) = self.apply(columns, rows);
        Self { x0, y0, ..self }
    }

    fn inverted(&self) -> Option<Self> {
        let determinant = self.dx_column * self.dy_row - self.dx_row * self.dy_column;
        let scale = self.dx_column.hypot(self.dy_column) * self.dx_row.hypot(self.dy_row);
        // NaN fails this comparison too.
        if !(determinant.abs() > 1e-9 * scale && scale.is_finite() && scale > 0.0) {
            return None;
        }
        let (a, b) = (self.dy_row / determinant, -self.dx_row / determinant);
        let (c, d) = (-self.dy_column / determinant, self.dx_column / determinant);
        Some(Self {
            x0: -(a * self.x0 + b * self.y0),
            dx_column: a,
            dx_row: b,
            y0: -(c * self.x0 + d * self.y0),
            dy_column: c,
            dy_row: d,
        })
    }
}

/// A fractional position among the samples of a source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Position {
    pub(crate) column: f64,
    pub(crate) row: f64,
}

/// The lattice of a source's samples on the planet.
#[derive(Clone)]
pub(crate) struct Grid {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) crs: Arc<Crs>,
    /// Samples lie on the outer edges of the area; otherwise each is the middle of a cell, and the area
    /// reaches half a cell beyond the outer samples.
    pub(crate) node_registered: bool,
    to_crs: Affine,
    to_sample: Affine,
    /// Columns after which a geographic grid meets itself again, 0 for other grids.
    period: f64,
    /// The longitude (for geographic systems) of the middle of the grid.
    middle_longitude: f64,
}

impl Grid {
    /// A grid whose sample (column, row) lies at `to_crs`. Fails with a clause where no grid can lie so.
    pub(crate) fn new(
        width: u32,
        height: u32,
        crs: Arc<Crs>,
        to_crs: Affine,
        node_registered: bool,
    ) -> Result<Self, String> {
        let Some(to_sample) = to_crs.inverted() else {
            return Err("its georeference gives the samples no area".to_owned());
        };
        let mut grid = Self {
            width,
            height,
            crs,
            node_registered,
            to_crs,
            to_sample,
            period: 0.0,
            middle_longitude: 0.0,
        };
        let last = (f64::from(width) - 1.0, f64::from(height) - 1.0);
        let (x, y) = to_crs.apply(last.0 / 2.0, last.1 / 2.0);
        if grid.crs.is_geographic() {
            grid.middle_longitude = x;
            if to_crs.dx_row == 0.0 && to_crs.dy_column == 0.0 {
                grid.period = 360.0 / to_crs.dx_column.abs();
            }
            let margin = if node_registered { 0.0 } else { 0.5 };
            for row in [-margin, last.1 + margin] {
                let (_, latitude) = to_crs.apply(last.0 / 2.0, row);
                let slack = 0.51 * to_crs.dy_row.abs().max(to_crs.dy_column.abs());
                if latitude.abs() > 90.0 + slack {
                    return Err(format!(
                        "its georeference reaches latitude {latitude:.3}, beyond a pole"
                    ));
                }
            }
            if f64::from(width - 1) * to_crs.dx_column.abs() > 360.0 + 1e-6 {
                return Err("its georeference spans more than 360 degrees of longitude".to_owned());
            }
        } else if grid.crs.inverse(x, y).is_none() {
            return Err(format!(
                "its georeference lies outside the area of its coordinate system {}",
                grid.crs.name()
            ));
        }
        Ok(grid)
    }

    /// A grid that fills a rectangle in degrees, first row in the north.
    pub(crate) fn of_extent(
        width: u32,
        height: u32,
        extent: Extent,
        node_registered: bool,
    ) -> Result<Self, String> {
        let Extent {
            west,
            south,
            east,
            north,
        } = extent;
        let span = if east > west {
            east - west
        } else {
            east + 360.0 - west
        };
        let fine = [west, south, east, north].iter().all(|v| v.is_finite())
            && west.abs() <= 360.0
            && east.abs() <= 360.0
            && (-90.0..=90.0).contains(&south)
            && (-90.0..=90.0).contains(&north)
            && south < north
            && span > 0.0
            && span <= 360.0;
        if !fine {
            return Err(format!(
                "the extent {west},{south},{east},{north} is no rectangle in degrees"
            ));
        }
        let cells = |samples: u32| {
            f64::from(if node_registered {
                samples - 1
            } else {
                samples
            })
        };
        if node_registered && (width < 2 || height < 2) {
            return Err("a grid of less than 2×2 samples cannot be node-registered".to_owned());
        }
        let (dx, dy) = (span / cells(width), (south - north) / cells(height));
        let first = Affine {
            x0: west,
            dx_column: dx,
            dx_row: 0.0,
            y0: north,
            dy_column: 0.0,
            dy_row: dy,
        };
        let to_crs = if node_registered {
            first
        } else {
            first.moved(0.5, 0.5)
        };
        Self::new(
            width,
            height,
            Arc::new(Crs::degrees()),
            to_crs,
            node_registered,
        )
    }

    /// x and y of a position.
    pub(crate) fn to_crs(&self) -> Affine {
        self.to_crs
    }

    /// True where the last column is followed by the first.
    pub(crate) fn wraps(&self) -> bool {
        self.period > 0.0 && (self.period - f64::from(self.width)).abs() < 0.01
    }

    /// Columns around the planet, 0 where columns are not longitudes.
    pub(crate) fn period(&self) -> f64 {
        self.period
    }

    /// The position of a latitude and longitude in degrees. In a geographic grid the longitude is taken in
    /// the turn nearest to `near` (a longitude), or to the grid's middle.
    pub(crate) fn position(
        &self,
        latitude_deg: f64,
        longitude_deg: f64,
        near: Option<f64>,
    ) -> Option<Position> {
        let (mut x, y) = self.crs.forward(latitude_deg, longitude_deg)?;
        if self.crs.is_geographic() {
            let near = near.unwrap_or(self.middle_longitude);
            x += 360.0 * ((near - x) / 360.0).round();
        }
        let (column, row) = self.to_sample.apply(x, y);
        Some(Position { column, row })
    }

    /// The longitude at which [`Grid::position`] of this position was taken.
    pub(crate) fn longitude_of(&self, position: Position) -> f64 {
        self.to_crs.apply(position.column, position.row).0
    }

    /// Latitude and longitude in degrees of a position.
    pub(crate) fn angles_deg(&self, column: f64, row: f64) -> Option<(f64, f64)> {
        let (x, y) = self.to_crs.apply(column, row);
        let y = if self.crs.is_plain_degrees() {
            y.clamp(-90.0, 90.0)
        } else {
            y
        };
        self.crs.inverse(x, y)
    }

    /// Half a cell where the area reaches beyond the outer samples, otherwise 0.
    pub(crate) fn margin(&self) -> f64 {
        if self.node_registered { 0.0 } else { 0.5 }
    }

    /// Brings a position into the grid: by a whole turn where columns are longitudes, and onto the outer
    /// samples from within the margin. `None` outside. A millionth of a sample counts as inside.
    pub(crate) fn place(&self, position: Position) -> Option<Position> {
        let Position {
            mut column,
            mut row,
        } = position;
        let margin = self.margin() + 1e-6;
        let (last_column, last_row) = (f64::from(self.width - 1), f64::from(self.height - 1));
        if self.wraps() {
            if !(0.0..self.period).contains(&column) {
                column = column.rem_euclid(self.period);
            }
        } else {
            if self.period > 0.0 {
                if column < -margin {
                    column += self.period;
                } else if column > last_column + margin {
                    column -= self.period;
                }
            }
            if !(column >= -margin && column <= last_column + margin) {
                return None;
            }
            column = column.clamp(0.0, last_column);
        }
        // A global grid of cells ends half a cell short of the poles; its margin reaches them.
        if !(row >= -margin && row <= last_row + margin) {
            return None;
        }
        row = row.clamp(0.0, last_row);
        Some(Position { column, row })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    fn extent(west: f64, south: f64, east: f64, north: f64) -> Extent {
        Extent {
            west,
            south,
            east,
            north,
        }
    }

    #[test]
    fn positions_come_back_and_wrap() {
        let globe = Grid::of_extent(360, 180, extent(-180.0, -90.0, 180.0, 90.0), false).unwrap();
        assert!(globe.wraps());
        let place = |latitude, longitude| {
            globe
                .place(globe.position(latitude, longitude, None).unwrap())
                .unwrap()
        };
        assert_eq!(
            place(89.5, -179.5),
            Position {
                column: 0.0,
                row: 0.0
            }
        );
        let west_of_the_first = place(0.0, 179.9);
        assert!((west_of_the_first.column - 359.4).abs() < 1e-9);
        assert_eq!(place(90.0, 0.5).row, 0.0);
        let (latitude, longitude) = globe.angles_deg(10.0, 20.0).unwrap();
        let back = place(latitude, longitude);
        assert!((back.column - 10.0).abs() < 1e-9 && (back.row - 20.0).abs() < 1e-9);
    }

    #[test]
    fn an_extent_may_cross_the_antimeridian() {
        let grid = Grid::of_extent(21, 11, extent(170.0, -5.0, -170.0, 5.0), true).unwrap();
        let column = |longitude| {
            grid.position(0.0, longitude, None)
                .and_then(|p| grid.place(p))
                .map(|p| p.column)
        };
        assert_eq!(column(175.0), Some(5.0));
        assert_eq!(column(-175.0), Some(15.0));
        assert_eq!(column(-165.0), None);
        assert_eq!(column(0.0), None);
    }

    #[test]
    fn senseless_extents_are_refused() {
        for (west, south, east, north) in [
            (0.0, 10.0, 10.0, 0.0),
            (0.0, -91.0, 10.0, 0.0),
            (f64::NAN, 0.0, 1.0, 1.0),
        ] {
            assert!(Grid::of_extent(10, 10, extent(west, south, east, north), false).is_err());
        }
    }
}
