//! Which level a source is imported at, and which tiles of it the source touches.
//! In: grids. Out: a level, tiles in an order that reads the source evenly. It reads no samples.

use std::collections::BTreeMap;

use geodesy::{Direction, Ellipsoid, MAX_LEVEL, Tile, TilePosition};

use crate::grid::Grid;
use crate::source::Source;

/// Points along each side of a grid at which its spacing is compared with the lattice.
const PROBES: u32 = 17;
/// Tiles are probed for at this fraction of the smallest tile's side.
const PROBE_STEP: f64 = 0.25;
/// The level whose cells are measured to know those of all levels.
const MEASURED_LEVEL: u8 = 12;

/// Sample distances and lattice cells over a grid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spacing {
    /// The widest distance between neighbouring samples in metres, along columns and along rows.
    column_m: f64,
    row_m: f64,
    /// The widest and the narrowest lattice cell in metres, as if at level 0.
    widest_cell_m: f64,
    narrowest_cell_m: f64,
}

impl Spacing {
    /// Measures a grid on a planet.
    pub(crate) fn of(grid: &Grid, planet: &Ellipsoid) -> Self {
        let mut spacing = Self {
            column_m: 0.0,
            row_m: 0.0,
            widest_cell_m: 0.0,
            narrowest_cell_m: f64::INFINITY,
        };
        let place = |column: f64, row: f64| {
            let (latitude, longitude) = grid.angles_deg(column, row)?;
            Some(Ellipsoid::normal(latitude, longitude))
        };
        let step = |last: u32, k: u32| f64::from(last) * f64::from(k) / f64::from(PROBES - 1);
        for k in 0..PROBES {
            for l in 0..PROBES {
                let (column, row) = (step(grid.width - 1, k), step(grid.height - 1, l));
                let Some(normal) = place(column, row) else {
                    continue;
                };
                let here = planet.point(normal, 0.0);
                let distance = |dc: f64, dr: f64| {
                    let beside = place(column + dc, row + dr).or(place(column - dc, row - dr));
                    beside.map_or(0.0, |n| planet.point(n, 0.0).distance(here))
                };
                spacing.column_m = spacing.column_m.max(distance(1.0, 0.0));
                spacing.row_m = spacing.row_m.max(distance(0.0, 1.0));
                let at = TilePosition::of_normal(normal, MEASURED_LEVEL);
                let near = |i: f64, j: f64| {
                    let inward = |k: f64, d: f64| if k + d > 256.0 { k - d } else { k + d };
                    let beside = TilePosition {
                        tile: at.tile,
                        i: inward(at.i, i),
                        j: inward(at.j, j),
                    };
                    let cells = 2.0_f64.powi(i32::from(MEASURED_LEVEL));
                    planet.point(beside.normal(), 0.0).distance(here) * cells
                };
                for cell in [near(1.0, 0.0), near(0.0, 1.0)] {
                    spacing.widest_cell_m = spacing.widest_cell_m.max(cell);
                    spacing.narrowest_cell_m = spacing.narrowest_cell_m.min(cell);
                }
            }
        }
        spacing
    }

    /// The spacing of several grids together.
    pub(crate) fn joined(self, other: Self) -> Self {
        Self {
            column_m: self.column_m.max(other.column_m),
            row_m: self.row_m.max(other.row_m),
            widest_cell_m: self.widest_cell_m.max(other.widest_cell_m),
            narrowest_cell_m: self.narrowest_cell_m.min(other.narrowest_cell_m),
        }
    }

    /// The first level whose widest cell is not wider than the samples are apart.
    pub(crate) fn level(&self) -> u8 {
        let distance = self.column_m.min(self.row_m) * (1.0 + 1e-9);
        (0..MAX_LEVEL)
            .find(|level| self.widest_cell_m / f64::from(1_u32 << level) <= distance)
            .unwrap_or(MAX_LEVEL)
    }
}

/// Tiles of a level with the sources that may touch each, in reading order.
pub(crate) fn touched(
    sources: &[Source],
    members: &[usize],
    spacings: &[Spacing],
    level: u8,
) -> Vec<(Tile, Vec<usize>)> {
    let mut found: BTreeMap<u64, (u64, Vec<usize>)> = BTreeMap::new();
    for number in members {
        let (Some(source), Some(spacing)) = (sources.get(*number), spacings.get(*number)) else {
            continue;
        };
        let mut tiles = BTreeMap::new();
        probe(source.grid(), *spacing, level, |tile, row| {
            tiles.entry(tile.id()).or_insert((tile, row));
        });
        // Probes can miss the tip of a corner: neighbours come along and are dropped if they stay empty.
        for (tile, row) in tiles.values() {
            let beside = Direction::ALL
                .into_iter()
                .filter_map(|direction| tile.neighbour(direction));
            for tile in beside.chain([*tile]) {
                let order = reading_order(source, *number, *row);
                let entry = found.entry(tile.id()).or_insert((order, Vec::new()));
                if entry.1.last() != Some(number) {
                    entry.1.push(*number);
                }
            }
        }
    }
    let mut tiles: Vec<_> = found
        .into_iter()
        .filter_map(|(id, (order, numbers))| Some((order, Tile::from_id(id)?, numbers)))
        .collect();
    tiles.sort_by_key(|(order, tile, _)| (*order, tile.id()));
    tiles
        .into_iter()
        .map(|(_, tile, numbers)| (tile, numbers))
        .collect()
}

/// Sources in whole rows are read from first to last row, tiled ones along the quadtree's curve.
fn reading_order(source: &Source, number: usize, row: f64) -> u64 {
    let (across, down) = source.description.chunk;
    if across < source.grid().width || down >= source.grid().height {
        return 0;
    }
    let band = (row.max(0.0) / f64::from(down.max(256))) as u64;
    (number as u64) << 32 | band
}

/// About how many tiles of a level a grid touches.
pub(crate) fn tile_estimate(grid: &Grid, spacing: Spacing, level: u8) -> f64 {
    let (across, down) = probe_steps(grid, spacing, level);
    across * PROBE_STEP * down * PROBE_STEP
}

/// Steps of probes along columns and rows.
fn probe_steps(grid: &Grid, spacing: Spacing, level: u8) -> (f64, f64) {
    let tile_m = 256.0 * spacing.narrowest_cell_m / f64::from(1_u32 << level);
    let steps = |samples: u32, distance_m: f64| {
        let reach = f64::from(samples - 1) + 2.0 * grid.margin();
        (reach * distance_m / (PROBE_STEP * tile_m)).ceil().max(1.0)
    };
    (
        steps(grid.width, spacing.column_m),
        steps(grid.height, spacing.row_m),
    )
}

/// Calls `visit` with the tile and row under each of many positions, the edges of the grid included.
fn probe(grid: &Grid, spacing: Spacing, level: u8, mut visit: impl FnMut(Tile, f64)) {
    let (across, down) = probe_steps(grid, spacing, level);
    let (across, down) = (across as u32, down as u32);
    let at = |samples: u32, k: u32, steps: u32| {
        let reach = f64::from(samples - 1) + 2.0 * grid.margin();
        reach * f64::from(k) / f64::from(steps) - grid.margin()
    };
    for l in 0..=down {
        let row = at(grid.height, l, down);
        for k in 0..=across {
            let column = at(grid.width, k, across);
            if let Some((latitude, longitude)) = grid.angles_deg(column, row) {
                let normal = Ellipsoid::normal(latitude, longitude);
                visit(TilePosition::of_normal(normal, level).tile, row);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use crate::options::Extent;

    #[test]
    fn levels_are_the_next_finer_ones() {
        let globe = |width, height| {
            let extent = Extent {
                west: -180.0,
                south: -90.0,
                east: 180.0,
                north: 90.0,
            };
            let grid = Grid::of_extent(width, height, extent, false).unwrap();
            Spacing::of(&grid, &Ellipsoid::EARTH).level()
        };
        // The widest cell of level L is about 1.705 / (256·2^L) of the radius.
        assert_eq!(globe(4320, 2160), 3);
        assert_eq!(globe(5400, 2700), 3);
        assert_eq!(globe(360, 180), 0);
        assert_eq!(globe(43_200, 21_600), 6);
    }
}
