//! Maps from a channel's pixels to room points, sampled once so that views can be laid out for any eye in every frame.
//! In: a map and its size in pixels. Out: samples with their slopes. It knows no eye.

use glam::DVec3;

use crate::jacobian::{oblong_squared, relief_squared};
use crate::rim::rim;

/// The widest and highest map, in pixels.
pub const MOST_MAP_PX: u32 = 16_384;
/// The farthest that samples are apart, in pixels.
const STEP_PX: u32 = 16;
/// The fewest cells between samples along a side: with these, cells of a channel that shows a whole turn are 6° wide, and
/// what lies between samples differs from them by less than 0.5 %.
const FEWEST_CELLS: u32 = 64;
/// Second differences of samples are taken this many times: they too change from sample to sample.
const SAG_RESERVE: f64 = 1.5;

/// One place of a map.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// In room metres; not numbers where the map shows nothing.
    pub(crate) point_m: DVec3,
    /// How the point moves with a pixel to the right, in metres.
    pub(crate) per_x: DVec3,
    /// How the point moves with a pixel down, in metres.
    pub(crate) per_y: DVec3,
    /// What the square of the smaller stretch is multiplied by (`jacobian.rs`); infinite where there are no slopes.
    pub(crate) relief_squared: f64,
    /// How far the surface may be from what is bilinear between samples around here, in metres.
    pub(crate) sag_m: f64,
}

/// A pixel on the rim of what the map shows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RimSample {
    /// Column and row of the cell between samples in which it lies.
    pub(crate) cell: [usize; 2],
    pub(crate) sample: Sample,
}

/// A map from pixels to room points, sampled: every 16 pixels or closer, at least 65 × 65 places, on the edges and corners
/// of the rectangle, and on the rim of what is there. Built once; [`SampledMap::cover`] then lays out views for any eye.
#[derive(Clone, Debug)]
pub struct SampledMap {
    size_px: [u32; 2],
    /// Where the columns of samples are, in pixels from the left edge.
    pub(crate) columns_px: Vec<f64>,
    /// Where the rows of samples are, in pixels from the top edge.
    pub(crate) rows_px: Vec<f64>,
    /// Row by row.
    pub(crate) samples: Vec<Sample>,
    pub(crate) rim: Vec<RimSample>,
}

type Map<'a> = &'a dyn Fn(f64, f64) -> Option<DVec3>;

impl SampledMap {
    /// Samples a map. `map` leads from pixels of a channel's rectangle of `size_px` (the middle of its first pixel is 0.5,
    /// 0.5; asked for 0…width and 0…height) to room metres, or to `None` where the pixel shows nothing. Where a cell between
    /// samples is not wholly there, every pixel of it is asked for.
    ///
    /// `None` for a rectangle without pixels or with more than [`MOST_MAP_PX`] a side.
    #[must_use]
    pub fn new(map: Map<'_>, size_px: [u32; 2]) -> Option<Self> {
        if size_px.iter().any(|side| !(1..=MOST_MAP_PX).contains(side)) {
            return None;
        }
        let finite = |x: f64, y: f64| map(x, y).filter(|point| point.is_finite());
        let sampler = Sampler {
            map: &finite,
            size_px: size_px.map(f64::from),
        };
        let [columns_px, rows_px] = size_px.map(lines);
        let reach = |lines: &[f64]| lines.get(1).map_or(1.0, |step| 0.5 * step);
        let reach_px = [reach(&columns_px), reach(&rows_px)];
        let samples = rows_px
            .iter()
            .flat_map(|y| columns_px.iter().map(|x| sampler.sample(*x, *y, reach_px)))
            .collect();
        let mut sampled = Self {
            size_px,
            columns_px,
            rows_px,
            samples,
            rim: Vec::new(),
        };
        sampled.find_sags();
        sampled.find_rim(&sampler);
        sampled.settle_relief();
        Some(sampled)
    }

    /// Width and height of the channel's rectangle in pixels.
    #[must_use]
    pub const fn size_px(&self) -> [u32; 2] {
        self.size_px
    }

    /// Whether no pixel shows anything.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rim.is_empty() && self.samples.iter().all(|sample| sample.point_m.is_nan())
    }

    /// A sample that is lit.
    pub(crate) fn sample_at(&self, column: usize, row: usize) -> Option<&Sample> {
        let sample = self.samples.get(row * self.columns_px.len() + column);
        sample.filter(|sample| !sample.point_m.is_nan())
    }

    fn point(&self, column: usize, row: usize) -> Option<DVec3> {
        Some(self.sample_at(column, row)?.point_m)
    }

    /// The chord between two points of a curve is off it by an eighth of the second difference; across a cell, both add up.
    fn find_sags(&mut self) {
        let (columns, rows) = (self.columns_px.len(), self.rows_px.len());
        let mut sags = Vec::with_capacity(self.samples.len());
        for row in 0..rows {
            for column in 0..columns {
                let x = column.clamp(1, columns - 2);
                let y = row.clamp(1, rows - 2);
                let across = [
                    self.point(x - 1, row),
                    self.point(x, row),
                    self.point(x + 1, row),
                ];
                let along = [
                    self.point(column, y - 1),
                    self.point(column, y),
                    self.point(column, y + 1),
                ];
                sags.push((sag_m(across) + sag_m(along)) * SAG_RESERVE);
            }
        }
        for (sample, sag_m) in self.samples.iter_mut().zip(sags) {
            sample.sag_m = sag_m;
        }
    }

    /// Until here samples have how oblong their pixels are; how much of that counts depends on all others.
    fn settle_relief(&mut self) {
        let rim = self.rim.iter_mut().map(|rim| &mut rim.sample);
        let mut samples: Vec<&mut Sample> = self.samples.iter_mut().chain(rim).collect();
        let oblong = samples.iter().map(|sample| sample.relief_squared);
        let least_squared = oblong.fold(f64::INFINITY, f64::min);
        for sample in &mut samples {
            sample.relief_squared = relief_squared(sample.relief_squared, least_squared);
        }
    }

    fn find_rim(&mut self, sampler: &Sampler<'_>) {
        for row in 0..self.rows_px.len() - 1 {
            for column in 0..self.columns_px.len() - 1 {
                let corners = [[0, 0], [1, 0], [0, 1], [1, 1]];
                if corners
                    .iter()
                    .all(|[x, y]| self.point(column + x, row + y).is_some())
                {
                    continue;
                }
                let pixels = |lines: &[f64], index: usize| {
                    let line = |index| lines.get(index).copied().unwrap_or(0.0);
                    [line(index).floor() as u32, line(index + 1).ceil() as u32]
                };
                let middle = |pixel: u32| f64::from(pixel) + 0.5;
                let there = |x, y| (sampler.map)(middle(x), middle(y)).is_some();
                let places = rim(
                    pixels(&self.columns_px, column),
                    pixels(&self.rows_px, row),
                    there,
                );
                self.rim.extend(places.into_iter().map(|[x, y]| RimSample {
                    cell: [column, row],
                    sample: sampler.sample(middle(x), middle(y), [1.0; 2]),
                }));
            }
        }
    }
}

struct Sampler<'a> {
    map: Map<'a>,
    size_px: [f64; 2],
}

impl Sampler<'_> {
    fn sample(&self, x: f64, y: f64, reach_px: [f64; 2]) -> Sample {
        let nothing = Sample {
            point_m: DVec3::NAN,
            per_x: DVec3::ZERO,
            per_y: DVec3::ZERO,
            relief_squared: f64::INFINITY,
            sag_m: 0.0,
        };
        let Some(point_m) = (self.map)(x, y) else {
            return nothing;
        };
        let [width, height] = self.size_px;
        let across = |off: f64| (self.map)(x + off, y);
        let along = |off: f64| (self.map)(x, y + off);
        let per_x = slope(&across, point_m, reach_px[0], [-x, width - x]);
        let per_y = slope(&along, point_m, reach_px[1], [-y, height - y]);
        match (per_x, per_y) {
            (Some(per_x), Some(per_y)) => Sample {
                point_m,
                per_x,
                per_y,
                relief_squared: oblong_squared(per_x, per_y),
                sag_m: 0.0,
            },
            _ => Sample { point_m, ..nothing },
        }
    }
}

/// How a curve moves at 0, where it is `here`, from its places within `room`: central differences, or one-sided ones of the
/// second order at an end, or what is there, if only within a lone pixel. As wide as half a cell, so that noise in a measured
/// map counts little.
fn slope(
    curve: &dyn Fn(f64) -> Option<DVec3>,
    here: DVec3,
    reach: f64,
    room: [f64; 2],
) -> Option<DVec3> {
    let at = |off: f64| (room[0]..=room[1]).contains(&off).then(|| curve(off))?;
    for reach in [reach, reach.min(1.0), reach.min(0.25)] {
        let [before, after] = [at(-reach), at(reach)];
        if let (Some(before), Some(after)) = (before, after) {
            return Some((after - before) / (2.0 * reach));
        }
        for (step, near) in [(reach, after), (-reach, before)] {
            let Some(near) = near else { continue };
            return Some(match at(2.0 * step) {
                Some(far) => (near * 4.0 - here * 3.0 - far) / (2.0 * step),
                None => (near - here) / step,
            });
        }
    }
    None
}

fn sag_m(points: [Option<DVec3>; 3]) -> f64 {
    match points {
        [Some(before), Some(here), Some(after)] => (before - here * 2.0 + after).length() / 8.0,
        _ => 0.0,
    }
}

/// Where samples lie along a side: on borders between pixels, as long as there are enough pixels.
fn lines(size_px: u32) -> Vec<f64> {
    let cells = size_px.div_ceil(STEP_PX).max(FEWEST_CELLS);
    (0..=cells)
        .map(|index| {
            if size_px >= cells {
                // Below 2¹⁴ · 2¹⁰.
                f64::from(index * size_px / cells)
            } else {
                f64::from(index) * f64::from(size_px) / f64::from(cells)
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_close_and_reach_the_edges() {
        for size_px in [
            1,
            7,
            63,
            64,
            65,
            1000,
            1024,
            1025,
            1200,
            1920,
            4097,
            MOST_MAP_PX,
        ] {
            let lines = lines(size_px);
            assert_eq!(lines.first(), Some(&0.0));
            assert_eq!(lines.last(), Some(&f64::from(size_px)));
            assert!(lines.len() >= 65 && lines.len() <= 1025);
            assert!(
                lines
                    .windows(2)
                    .all(|pair| pair[0] < pair[1] && pair[1] - pair[0] <= 16.0)
            );
            if size_px >= 64 {
                assert!(lines.iter().all(|line| line.fract() == 0.0));
            }
        }
    }

    #[test]
    fn slopes_are_of_the_second_order_at_ends_too() {
        let curve = |x: f64| Some(DVec3::new(x * x, 3.0 * x, 1.0));
        for room in [[-5.0, 5.0], [0.0, 5.0], [-5.0, 0.0]] {
            let slope = slope(&curve, DVec3::new(0.0, 0.0, 1.0), 2.0, room).unwrap();
            assert!(slope.distance(DVec3::new(0.0, 3.0, 0.0)) < 1e-14, "{slope}");
        }
        assert!(slope(&|_| None, DVec3::ZERO, 2.0, [-5.0, 5.0]).is_none());
    }

    #[test]
    fn maps_without_pixels_or_with_too_many_are_refused() {
        let map = |x: f64, y: f64| Some(DVec3::new(x, -y, -1.0));
        for size_px in [[0, 4], [4, 0], [MOST_MAP_PX + 1, 4], [4, u32::MAX]] {
            assert!(SampledMap::new(&map, size_px).is_none());
        }
        let sampled = SampledMap::new(&map, [1, 1]).unwrap();
        assert_eq!(sampled.size_px(), [1, 1]);
        assert!(sampled.rim.is_empty() && !sampled.is_empty());
    }

    #[test]
    fn a_map_is_empty_if_not_a_single_pixel_shows_anything() {
        let lone = |x: f64, y: f64| {
            let is_there = (100.0..101.0).contains(&x) && (77.0..78.0).contains(&y);
            is_there.then_some(DVec3::new(x, -y, -1.0))
        };
        assert!(
            SampledMap::new(&|_, _| None, [640, 480])
                .unwrap()
                .is_empty()
        );
        assert!(!SampledMap::new(&lone, [640, 480]).unwrap().is_empty());
    }
}
