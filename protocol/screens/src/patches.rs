//! What a channel's map lights, in pieces that can be drawn and compared.
//! In: a sampled map, an eye. Out: quadrilaterals of room points with their pixel densities, an outline. It lays out no view.

use glam::DVec3;

use crate::{SampledMap, pixels_per_radian};

/// A quadrilateral between samples of a map.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    /// Its corners in room metres, clockwise for its viewers from the upper left one on.
    pub corners_m: [DVec3; 4],
    /// A sample in its midst.
    pub middle_m: DVec3,
    /// Pixels to a radian there, mean of both directions: the root of the pixels to a steradian. `None` where the eye sees
    /// it from behind or too flat.
    pub pixels_per_radian: Option<f64>,
}

impl SampledMap {
    /// What the map lights as quadrilaterals, at most `most_a_side` in a row or a column, which must be 1 or more, and smaller
    /// ones where those would be only partly lit.
    #[must_use]
    pub fn patches(&self, eye_m: DVec3, most_a_side: usize) -> Vec<Patch> {
        let ends = |lines: &[f64]| -> Vec<usize> {
            let last = lines.len().saturating_sub(1);
            let step = last.div_ceil(most_a_side.max(1)).max(1);
            let mut ends: Vec<usize> = (0..last).step_by(step).collect();
            ends.push(last);
            ends
        };
        let (columns, rows) = (ends(&self.columns_px), ends(&self.rows_px));
        let mut patches = Vec::new();
        for row in rows.windows(2) {
            for column in columns.windows(2) {
                if let ([top, bottom], [left, right]) = (row, column) {
                    self.divide([*left, *right], [*top, *bottom], eye_m, &mut patches);
                }
            }
        }
        patches
    }

    /// Adds what is between these columns and rows of samples, as one patch if all of its corners are lit.
    fn divide(
        &self,
        columns: [usize; 2],
        rows: [usize; 2],
        eye_m: DVec3,
        patches: &mut Vec<Patch>,
    ) {
        if let Some(patch) = self.patch(columns, rows, eye_m) {
            patches.push(patch);
            return;
        }
        let halves = |[first, last]: [usize; 2]| {
            let middle = (first + last) / 2;
            // A single cell has one half.
            [[first, middle], [middle, last]]
                .into_iter()
                .filter(|[first, last]| first < last)
        };
        if columns[1] - columns[0] <= 1 && rows[1] - rows[0] <= 1 {
            return;
        }
        for rows in halves(rows) {
            for columns in halves(columns) {
                self.divide(columns, rows, eye_m, patches);
            }
        }
    }

    fn patch(
        &self,
        [left, right]: [usize; 2],
        [top, bottom]: [usize; 2],
        eye_m: DVec3,
    ) -> Option<Patch> {
        let middle = self.sample_at((left + right) / 2, (top + bottom) / 2)?;
        let point = |column, row| Some(self.sample_at(column, row)?.point_m);
        Some(Patch {
            corners_m: [
                point(left, top)?,
                point(right, top)?,
                point(right, bottom)?,
                point(left, bottom)?,
            ],
            middle_m: middle.point_m,
            pixels_per_radian: pixels_per_radian(
                middle.point_m - eye_m,
                middle.per_x,
                middle.per_y,
            ),
        })
    }

    /// Once around the samples that are lit, clockwise for their viewers, in room metres: all of the first row, the last one
    /// of each row, all of the last row, the first one of each row. The way back to the first point is left out.
    #[must_use]
    pub fn outline_m(&self) -> Vec<DVec3> {
        let rows: Vec<Vec<DVec3>> = (0..self.rows_px.len())
            .map(|row| {
                let columns = 0..self.columns_px.len();
                let lit = columns.filter_map(|column| self.sample_at(column, row));
                lit.map(|sample| sample.point_m).collect()
            })
            .filter(|row: &Vec<DVec3>| !row.is_empty())
            .collect();
        let all = |row: Option<&Vec<DVec3>>| row.cloned().unwrap_or_default();
        let mut outline = all(rows.first());
        outline.extend(rows.iter().filter_map(|row| row.last()));
        outline.extend(all(rows.last()).iter().rev());
        outline.extend(rows.iter().rev().filter_map(|row| row.first()));
        outline.dedup();
        if outline.len() > 1 && outline.first() == outline.last() {
            outline.pop();
        }
        outline
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;

    /// A metre of a plane for 100 pixels, 2 m before the origin, of which a part of 640 × 480 pixels is lit.
    fn map(lit: impl Fn(f64, f64) -> bool) -> SampledMap {
        let point =
            |x: f64, y: f64| lit(x, y).then(|| DVec3::new(x / 100.0 - 3.2, 2.4 - y / 100.0, -2.0));
        SampledMap::new(&point, [640, 480]).unwrap()
    }

    /// The area of a polygon that is clockwise seen from +z.
    fn area_m2(corners: &[DVec3]) -> f64 {
        let ends = corners.iter().zip(corners.iter().cycle().skip(1));
        let doubled = ends.map(|(from, to)| to.x * from.y - from.x * to.y);
        0.5 * doubled.sum::<f64>()
    }

    type Lit = fn(f64, f64) -> bool;

    /// What is lit, with its area, and how much of it may be missing along its rim.
    const LIT: [(Lit, f64, f64); 3] = [
        (|_, _| true, 6.4 * 4.8, 1e-9),
        (|x, _| x <= 320.0, 3.2 * 4.8, 1e-9),
        // A corner is cut off.
        (|x, y| x + y >= 300.0, 6.4 * 4.8 - 4.5, 0.4),
    ];

    #[test]
    fn patches_tile_what_is_lit_and_know_how_dense_they_are() {
        for (lit, lit_m2, missing_m2) in LIT {
            let patches = map(lit).patches(DVec3::ZERO, 16);
            let areas = patches.iter().map(|patch| area_m2(&patch.corners_m));
            let missing = lit_m2 - areas.sum::<f64>();
            assert!((-1e-9..=missing_m2).contains(&missing), "{missing} m²");
            for patch in &patches {
                // A square centimetre across the line of sight, over the distance squared.
                let distance = patch.middle_m.length();
                let steradians = 1e-4 * (2.0 / distance) / (distance * distance);
                let density = patch.pixels_per_radian.unwrap();
                assert!((density * steradians.sqrt() - 1.0).abs() < 1e-9);
            }
            let from_behind = map(lit).patches(DVec3::new(0.0, 0.0, -4.0), 7);
            assert!(!from_behind.is_empty());
            assert!(
                from_behind
                    .iter()
                    .all(|patch| patch.pixels_per_radian.is_none())
            );
        }
        assert_eq!(map(|_, _| true).patches(DVec3::ZERO, 7).len(), 49);
    }

    #[test]
    fn an_outline_goes_once_around_what_is_lit() {
        for (lit, lit_m2, missing_m2) in LIT {
            let missing = lit_m2 - area_m2(&map(lit).outline_m());
            assert!((-1e-9..=missing_m2).contains(&missing), "{missing} m²");
        }
        let nothing = map(|_, _| false);
        assert!(nothing.outline_m().is_empty() && nothing.patches(DVec3::ZERO, 8).is_empty());
    }
}
