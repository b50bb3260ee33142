//! Where a part of a map lies for an eye: the axis of its narrowest cone, its picture-up, its extents.
//! In: a sampled map, a part of it, an eye. Out: axes and extents of one view. Only the four basic operations and square
//! roots: it runs in every frame, and all machines must find the same.

use glam::DVec3;

use crate::SampledMap;
use crate::jacobian::singular_squared;
use crate::sampled::Sample;

/// About how many samples along a side give the axis.
const COARSE: usize = 16;
/// About how many pixels of the rim do.
const COARSE_RIM: usize = 64;
/// Steps towards the narrowest cone.
const CONE_STEPS: u32 = 24;
/// Which part of the way to the farthest direction the first of them goes.
const FIRST_STEP: f64 = 0.25;
/// Points nearer to the eye than this, in metres, have no direction that means anything.
const NEAREST_M: f64 = 1e-3;

/// A part of a map: first and last column and row of samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    pub(crate) columns: [usize; 2],
    pub(crate) rows: [usize; 2],
}

/// The axes of a view, unit vectors at right angles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gaze {
    pub(crate) forward: DVec3,
    pub(crate) right: DVec3,
    pub(crate) up: DVec3,
}

/// Some of the samples of a part as directions: enough to choose axes and cuts by.
pub(crate) struct Glance {
    width: usize,
    /// Unit vectors row by row, not numbers where nothing is; then those of the rim.
    directions: Vec<DVec3>,
    grid: usize,
    /// The sum of how directions change upwards in the picture, each of length 1.
    up: DVec3,
}

/// What a view must show of a part. In the plane at distance 1: parts of 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extents {
    /// To the right and up.
    pub(crate) low: [f64; 2],
    pub(crate) high: [f64; 2],
    /// The square of the least that a pixel moves a direction, in the direction in which it moves it least; infinite
    /// if no place has slopes.
    pub(crate) stretch_squared: f64,
    /// Whether all of the part is within the cone.
    pub(crate) whole: bool,
}

/// Every so many of first…=last that at most about `count` remain, both ends among them.
fn sparse([first, last]: [usize; 2], count: usize) -> Vec<usize> {
    let step = (last - first).div_ceil(count).max(1);
    let mut indices: Vec<usize> = (first..last).step_by(step).collect();
    indices.push(last);
    indices
}

impl SampledMap {
    /// Calls `visit` with every sample of a part that is there.
    fn visit(&self, span: &Span, mut visit: impl FnMut(&Sample) -> bool) -> bool {
        let columns = self.columns_px.len();
        for row in span.rows[0]..=span.rows[1] {
            let range = row * columns + span.columns[0]..=row * columns + span.columns[1];
            for sample in self.samples.get(range).unwrap_or_default() {
                if !sample.point_m.x.is_nan() && !visit(sample) {
                    return false;
                }
            }
        }
        self.rim_of(span).all(visit)
    }

    fn rim_of(&self, span: &Span) -> impl Iterator<Item = &Sample> {
        let [columns, rows] = [span.columns, span.rows];
        self.rim
            .iter()
            .filter(move |rim| {
                (columns[0]..columns[1]).contains(&rim.cell[0])
                    && (rows[0]..rows[1]).contains(&rim.cell[1])
            })
            .map(|rim| &rim.sample)
    }

    /// Some of the directions of a part; `None` if it shows nothing.
    pub(crate) fn glance(&self, span: &Span, eye_m: DVec3) -> Option<Glance> {
        let columns = sparse(span.columns, COARSE);
        let rows = sparse(span.rows, COARSE);
        let mut glance = Glance {
            width: columns.len(),
            directions: Vec::with_capacity(columns.len() * rows.len() + COARSE_RIM),
            grid: columns.len() * rows.len(),
            up: DVec3::ZERO,
        };
        for row in &rows {
            for column in &columns {
                let sample = self.samples.get(row * self.columns_px.len() + column)?;
                glance.add(sample, eye_m);
            }
        }
        let step = (self.rim_of(span).count() / COARSE_RIM).max(1);
        for sample in self.rim_of(span).step_by(step) {
            glance.add(sample, eye_m);
        }
        glance
            .directions
            .iter()
            .any(|direction| !direction.x.is_nan())
            .then_some(glance)
    }

    /// What a view along `gaze` must show of a part. `None` if a direction is beyond the cone with this cosine of its half
    /// angle; with `clip` what is beyond is left out instead.
    pub(crate) fn extents(
        &self,
        span: &Span,
        eye_m: DVec3,
        gaze: &Gaze,
        cosine: f64,
        clip: bool,
    ) -> Option<Extents> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let (mut stretch_squared, mut sag, mut whole) = (f64::INFINITY, 0.0_f64, true);
        let cosine_squared = cosine * cosine;
        let within = self.visit(span, |sample| {
            let from_eye = sample.point_m - eye_m;
            let depth = from_eye.dot(gaze.forward);
            let squared = from_eye.length_squared();
            if !(depth > 0.0
                && depth * depth >= cosine_squared * squared
                && squared > NEAREST_M * NEAREST_M)
            {
                whole = false;
                return clip;
            }
            let inverse = 1.0 / depth;
            let u = from_eye.dot(gaze.right) * inverse;
            let v = from_eye.dot(gaze.up) * inverse;
            low = [low[0].min(u), low[1].min(v)];
            high = [high[0].max(u), high[1].max(v)];
            sag = sag.max(sample.sag_m * inverse);
            let slope = |step: DVec3| {
                let deeper = step.dot(gaze.forward);
                [
                    (step.dot(gaze.right) - u * deeper) * inverse,
                    (step.dot(gaze.up) - v * deeper) * inverse,
                ]
            };
            let ([ux, vx], [uy, vy]) = (slope(sample.per_x), slope(sample.per_y));
            let determinant = ux * vy - uy * vx;
            let [smallest, _] = singular_squared(
                ux * ux + vx * vx,
                ux * uy + vx * vy,
                uy * uy + vy * vy,
                determinant * determinant,
            );
            // 0 · ∞ is not a number, which `min` leaves out.
            stretch_squared = stretch_squared.min(smallest * sample.relief_squared);
            true
        });
        if !within || low[0] > high[0] {
            return None;
        }
        // A chord in the room is straight in the view, so only what the surface is off the chord can be beyond the samples.
        for axis in 0..2 {
            let pad = sag * (1.0 + low[axis].abs().max(high[axis].abs()));
            low[axis] -= pad;
            high[axis] += pad;
        }
        Some(Extents {
            low,
            high,
            stretch_squared,
            whole,
        })
    }
}

impl Glance {
    fn add(&mut self, sample: &Sample, eye_m: DVec3) {
        let from_eye = sample.point_m - eye_m;
        let squared = from_eye.length_squared();
        // Not a number where nothing is.
        if squared.is_nan() || squared <= NEAREST_M * NEAREST_M {
            self.directions.push(DVec3::NAN);
            return;
        }
        self.directions.push(from_eye / squared.sqrt());
        let down = sample.per_y - from_eye * (from_eye.dot(sample.per_y) / squared);
        self.up -= down.normalize_or_zero();
    }

    fn there(&self) -> impl Iterator<Item = &DVec3> {
        self.directions
            .iter()
            .filter(|direction| !direction.x.is_nan())
    }

    /// The axis of the narrowest cone, as good as, and the cosine of its half angle: from the mean towards the direction that
    /// is farthest, by ever smaller steps (after Bădoiu and Clarkson 2003), and the best of these.
    fn axis(&self) -> (DVec3, f64) {
        let first = self.there().next().copied().unwrap_or(DVec3::NEG_Z);
        let sum: DVec3 = self.there().sum();
        let mut axis = sum.try_normalize().unwrap_or(first);
        let mut best = (axis, f64::NEG_INFINITY);
        for step in 1..=CONE_STEPS {
            let mut farthest = (f64::INFINITY, axis);
            for direction in self.there() {
                let cosine = direction.dot(axis);
                if cosine < farthest.0 {
                    farthest = (cosine, *direction);
                }
            }
            if farthest.0 > best.1 {
                best = (axis, farthest.0);
            }
            let nearer = axis + (farthest.1 - axis) * (FIRST_STEP / f64::from(step));
            axis = nearer.try_normalize().unwrap_or(first);
        }
        best
    }

    /// The axes of a view of these directions, and the least cosine of an angle between its axis and one of them.
    pub(crate) fn gaze(&self) -> (Gaze, f64) {
        let (forward, least) = self.axis();
        let above = self.up - forward * self.up.dot(forward);
        // A picture whose up turns all around has none; any will do.
        let up = if above.length() > 1e-6 * self.directions.len() as f64 {
            above.normalize()
        } else {
            forward.any_orthonormal_vector()
        };
        let right = forward.cross(up);
        (Gaze { forward, right, up }, least)
    }

    /// How far the part reaches for the eye to the right and down, in radians or a little less: the longest row and column.
    pub(crate) fn reach(&self) -> [f64; 2] {
        let grid = self.directions.get(..self.grid).unwrap_or_default();
        let length = |from: &DVec3, to: &DVec3| {
            let length = from.distance(*to);
            if length.is_nan() { 0.0 } else { length }
        };
        let row = |row: &[DVec3]| row.windows(2).map(|pair| length(&pair[0], &pair[1])).sum();
        let mut columns = vec![0.0; self.width];
        for pair in grid.windows(self.width + 1).enumerate() {
            let (index, [from, .., to]) = pair else {
                continue;
            };
            if let Some(sum) = columns.get_mut(index % self.width) {
                *sum += length(from, to);
            }
        }
        [
            grid.chunks(self.width).map(row).fold(0.0, f64::max),
            columns.into_iter().fold(0.0, f64::max),
        ]
    }
}
