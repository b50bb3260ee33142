//! Allowances: how many units of height the triangles of a leaf may deviate before that shows as more than τ pixels.
//! In: a tile's geometry, height ranges of its blocks, a view. Out: one small table of integers a leaf.
//! Conservative in every step: whatever it lets stay is within τ, for every eye of the cell.

use std::sync::LazyLock;

use geodesy::LATTICE_BITS;
use glam::{DVec3, Vec3};

use super::code::code_down;
use super::eye_cell::EyeCell;
use super::geometry_error::{Chord, Place, TileGeometryError, largest};
use super::marks::pair;
use super::{ALLOWANCE_WORDS, BLOCKS};

/// What a vertex on the GPU may be off its place, in pixels, beside [`POSITION_M`].
const VERTEX_PX: f64 = 0.01;
/// The same in metres: steps of fixed-point positions and their rounding.
const POSITION_M: f64 = 4e-6;
/// Units that a deviation of quantised heights may be short of the true one: half for the sample, half for the
/// vertices, and half again for each along an edge whose odd nodes are means of quantised heights.
const QUANTISATION_UNITS: f64 = 2.0;
/// The largest deviation that a code can hold.
const MOST_UNITS: f64 = 2_147_483_647.0;
/// Normals turn over a triangle of level 9 by this share of their turn over its block: a half, and room for how
/// turns vary within a root's block.
const FINE_TURN: f64 = 0.6;
/// Rows of coarse marks.
const COARSE_ROW: usize = 17;

/// A view and the error that it may show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefineView {
    /// The observer's eye in ECEF metres.
    pub eye: DVec3,
    /// Pixels of the wall's densest channel per radian at the observer's head, > 0.
    pub pixels_per_radian: f64,
    /// The largest error in pixels. At 0.01 and below nothing may deviate and every mark is set.
    pub tau_px: f64,
}

/// Lowest and highest metres of all nodes of each of the 256 blocks of 16 × 16 cells (block Y · 16 + X), the nodes
/// on a block's border included. A range that is too wide costs triangles; one that is too narrow breaks
/// the bound. A block whose range is missing or not finite is always refined to the end.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockRanges(pub Vec<(f64, f64)>);

/// The size of a leaf's unit of height in metres: the smallest power of two, at least 2^-13, in which
/// `range_m` (lowest and highest, in metres) is within ±2^27.
#[must_use]
pub fn height_unit(range_m: (f64, f64)) -> f64 {
    let largest_m = range_m.0.abs().max(range_m.1.abs());
    let mut unit_m = 1.0 / 8192.0;
    while largest_m > unit_m * 134_217_728.0 && unit_m < 1e300 {
        unit_m *= 2.0;
    }
    unit_m
}

/// The allowance table of a leaf for all eyes of `cell`, which must be one that `view.eye` gives; the eye itself does
/// not enter. 545 words. 0…255: for block Y · 16 + X the limits of triangles of levels 9…14 (low half) and of
/// 7 and 8 (high half). 256…544: for coarse mark (x / 16, y / 16), row by row, the limits of its sides 0 (low
/// half) and 1.
/// A limit is 0 where a triangle is always split; else a triangle stays whose error code is below it.
///
/// # The bound
///
/// Let P be a sample, n the surface normal there, h its height, and h̄ the height of the triangle's plane at its
/// place. The drawn point Q is p(n, h̄) plus what chords differ from the curved surface: gₙ along n and gₜ across it.
/// |h − h̄| ≤ E, the error pyramid's bound. Let φ be the angle between n and the ray from the eye to P,
/// and d the distance from the eye to p(n, h̄). Then the angle at the eye between P and Q is at most
///
/// asin( ((E + gₙ) sin φ + gₜ) / (d − gₙ − gₜ) ).
///
/// p(n, h̄) lies above the same triangle and between the lowest and the highest of its heights, so largest sin φ / d
/// and smallest d over that region and the cell give what E may be for τ pixels. gₙ and gₜ are the chords of the
/// surface at one height ([`TileGeometryError`]) and, for heights that differ by Δ while normals turn by ν
/// from the hypotenuse's middle to the corners, at most Δ ν / 2 by Cauchy and Schwarz.
#[must_use]
pub fn allowances(
    geometry: &TileGeometryError,
    blocks: &BlockRanges,
    unit_m: f64,
    view: &RefineView,
    cell: &EyeCell,
) -> Vec<u32> {
    let mut table = vec![0; ALLOWANCE_WORDS];
    let Some(sight) = Sight::new(view, cell, unit_m) else {
        return table;
    };
    // Ranges and limits of triangles: those of each block's largest, then those of each coarse mark's two sides.
    let mut found = vec![Limit::NONE; BLOCKS + 2 * COARSE_ROW * COARSE_ROW];
    for ((place, range_m), (word, limit)) in geometry
        .blocks
        .iter()
        .zip(&blocks.0)
        .zip(table.iter_mut().zip(&mut found))
    {
        let Some(region) = sight.region(place, *range_m) else {
            limit.range_m = *range_m;
            continue;
        };
        let bows = region.bows(&place.chord);
        let coarse_limit = sight.limit(&region, &bows, bows.coarse_m, place.turn);
        let fine_limit = sight
            .limit(&region, &bows, bows.fine_m, FINE_TURN * place.turn)
            .max(coarse_limit);
        *word = u32::from(fine_limit) | u32::from(coarse_limit) << 16;
        *limit = Limit {
            range_m: *range_m,
            limit: coarse_limit,
        };
    }
    for triangle in COARSE.iter() {
        let [first, second] = triangle.children.map(|child| found.get(child).copied());
        let (Some(first), Some(second)) = (first, second) else {
            continue;
        };
        let range_m = (
            first.range_m.0.min(second.range_m.0),
            first.range_m.1.max(second.range_m.1),
        );
        let most = first.limit.min(second.limit);
        let own = if most == 0 {
            0
        } else {
            geometry
                .coarse
                .get(triangle.mark)
                .and_then(|place| Some((sight.region(place, range_m)?, place)))
                .map_or(0, |(region, place)| {
                    let bows = region.bows(&place.chord);
                    sight.limit(&region, &bows, bows.coarse_m, place.turn)
                })
        };
        let limit = own.min(most);
        if let Some(slot) = found.get_mut(BLOCKS + 2 * triangle.mark + triangle.side) {
            *slot = Limit { range_m, limit };
        }
        if let Some(word) = table.get_mut(BLOCKS + triangle.mark) {
            *word |= u32::from(limit) << (16 * triangle.side);
        }
    }
    table
}

/// What is known of a triangle.
#[derive(Clone, Copy)]
struct Limit {
    range_m: (f64, f64),
    limit: u16,
}

impl Limit {
    /// Of a block whose range is missing.
    const NONE: Self = Self {
        range_m: (f64::NEG_INFINITY, f64::INFINITY),
        limit: 0,
    };
}

/// A triangle of levels 0…6: its mark as (y / 16) · 17 + x / 16, its side, and where its children's limits are.
struct CoarseTriangle {
    mark: usize,
    side: usize,
    children: [usize; 2],
}

/// All triangles of levels 6 … 0, children before parents.
static COARSE: LazyLock<Vec<CoarseTriangle>> = LazyLock::new(|| {
    let coarse_index = |[x, y]: [u16; 2]| usize::from(y / 16) * COARSE_ROW + usize::from(x / 16);
    let mut triangles = Vec::with_capacity(508);
    for level in (0..=6).rev() {
        for mark in (0..=256)
            .step_by(16)
            .flat_map(|y| (0..=256).step_by(16).map(move |x| [x, y]))
        {
            let Some(own) = pair(LATTICE_BITS, mark[0], mark[1]).filter(|own| own.level == level)
            else {
                continue;
            };
            for (side, apex) in own.apexes.iter().enumerate() {
                let Some(apex) = apex else { continue };
                let children = own.ends.map(|end| {
                    let child = [
                        u16::midpoint(apex[0], end[0]),
                        u16::midpoint(apex[1], end[1]),
                    ];
                    if level == 6 {
                        // The child's apex is this mark.
                        let [x, y] = [0, 1].map(|c| usize::from((child[c] + mark[c]) >> 5));
                        return y * 16 + x;
                    }
                    let facing = pair(LATTICE_BITS, child[0], child[1])
                        .is_some_and(|child| child.apexes[1] == Some(mark));
                    BLOCKS + 2 * coarse_index(child) + usize::from(facing)
                });
                triangles.push(CoarseTriangle {
                    mark: coarse_index(mark),
                    side,
                    children,
                });
            }
        }
    }
    triangles
});

/// How eyes of a cell see a region.
struct Region {
    /// No point is nearer to any of the eyes, in metres; > 0.
    distance_m: f64,
    /// The largest sine of the angle between normal and ray, divided by the distance, per metre.
    sine_per_m: f64,
    /// The largest height above or below the ellipsoid in metres, and the range of heights.
    largest_height_m: f64,
    relief_m: f64,
    /// The unit vector from the middle of the eyes to the middle of the region, and the largest sine of the angle
    /// between it and a ray from an eye to a point of the region.
    ray: DVec3,
    spread: f64,
}

/// How far chords seem to be from the surface, across the ray, in metres.
struct Bows {
    /// For a block's triangles of levels 7 and 8, or a coarse mark's.
    coarse_m: f64,
    /// For a block's triangles of levels 9 … 14.
    fine_m: f64,
    /// How far they are at most, along the ray too.
    whole_m: f64,
}

impl Region {
    fn bows(&self, chord: &Chord) -> Bows {
        // Only what is across the ray shows. Rays of the region differ from the middle one by the spread; that part
        // is added at the end, because what `largest` makes of sums is no more than the sum of what it makes.
        let seen = |bow: Vec3| bow.as_dvec3().cross(self.ray).length();
        let whole_m = f64::from(chord.norm_m);
        let spread_m = self.spread * whole_m;
        let [first, second] = chord.legs.map(seen);
        let [hypotenuse, other] = chord.diagonals.map(seen);
        let side = first.max(second);
        let rest =
            |[base, per_m]: [f32; 2]| f64::from(base) + f64::from(per_m) * self.largest_height_m;
        // Levels 7 and 8; then 9 and 10, of half the length. Bows grow with its square.
        let coarse =
            largest(first, second, hypotenuse).max(largest(0.25 * hypotenuse, 0.25 * other, side));
        let fine = largest(first, second, hypotenuse.max(other)).max(coarse);
        Bows {
            coarse_m: coarse + spread_m + rest(chord.rest),
            fine_m: 0.25 * (fine + spread_m) + rest(chord.fine_rest),
            whole_m: whole_m + rest(chord.rest),
        }
    }
}

/// The eyes, and what they may see.
struct Sight {
    centre: DVec3,
    radius_m: f64,
    unit_m: f64,
    /// The sine of the allowed angle, from below.
    sine: f64,
}

impl Sight {
    /// `None` if nothing may deviate.
    fn new(view: &RefineView, cell: &EyeCell, unit_m: f64) -> Option<Self> {
        let angle = (view.tau_px - VERTEX_PX) / view.pixels_per_radian;
        if !(angle > 0.0 && view.pixels_per_radian > 0.0) {
            return None;
        }
        let angle = angle.min(1.0);
        // The first two terms of the sine's series, which is below it.
        let sine = (angle - angle * angle * angle / 6.0) * (1.0 - 1e-9);
        let sane = sine > 0.0
            && unit_m > 0.0
            && unit_m.is_finite()
            && cell.centre.is_finite()
            && cell.radius_m >= 0.0;
        sane.then_some(Self {
            centre: cell.centre,
            radius_m: cell.radius_m,
            unit_m,
            sine,
        })
    }

    /// How a place with heights in a range is seen; `None` where an eye may be inside, or the range is none.
    fn region(&self, place: &Place, (lowest_m, highest_m): (f64, f64)) -> Option<Region> {
        let relief_m = highest_m - lowest_m;
        if !(relief_m >= 0.0 && relief_m.is_finite()) {
            return None;
        }
        // In the frame of the normal in the middle, the place lies in an upright cylinder.
        let largest_height_m = lowest_m.abs().max(highest_m.abs());
        let turn = place.turn;
        let tilt = 0.5 * turn * turn * (1.0 + turn * turn); // ≥ 1 − cosine of the turn
        let bottom = lowest_m - place.sag_m - tilt * lowest_m.max(0.0);
        let top = highest_m + tilt * (-highest_m).max(0.0);
        let radius_m = place.radius_m + turn * largest_height_m;
        let to_eye = self.centre - place.base;
        let above = to_eye.dot(place.normal);
        let aside = (to_eye - place.normal * above).length();
        let vertical = (bottom - above).max(above - top).max(0.0);
        let horizontal = (aside - radius_m).max(0.0);
        let reach = self.radius_m + 2.0 * self.unit_m;
        let distance_m =
            (vertical * vertical + horizontal * horizontal).sqrt() * (1.0 - 1e-9) - reach;
        if distance_m <= 1e-6 {
            return None;
        }
        // sin φ / d = H / (H² + V²) for horizontal and vertical distances H and V. It falls with V, and with H
        // rises until H = V and then falls.
        let v = (vertical - reach).max(0.0);
        let h = v
            .max(horizontal - self.radius_m)
            .min(aside + radius_m + reach);
        let square = h * h + v * v;
        // Normals of the place differ from that in its middle; and sample and triangle are not quite one above
        // the other in its frame.
        let skew = 1.0 - turn * relief_m / distance_m;
        let sine_per_m = if skew > 0.1 && square > 0.0 {
            (h / square + turn / distance_m) / skew
        } else {
            f64::INFINITY
        };
        let middle = place.base + place.normal * (0.5 * (bottom + top)) - self.centre;
        let middle_m = middle.length();
        let half_m = 0.5 * (top - bottom);
        let around_m = (radius_m * radius_m + half_m * half_m).sqrt() + reach;
        Some(Region {
            ray: middle / middle_m,
            spread: (around_m / middle_m).min(1.0),
            distance_m,
            sine_per_m: sine_per_m.min(1.0 / distance_m) * (1.0 + 1e-9),
            largest_height_m,
            relief_m,
        })
    }

    /// The limit of triangles whose chords seem to be up to `bow_m` from the surface, and over which normals turn by
    /// no more than `turn`.
    fn limit(&self, region: &Region, bows: &Bows, bow_m: f64, turn: f64) -> u16 {
        let crossed = 0.5 * region.relief_m * turn * (1.0 + 0.5 * turn * turn);
        let shift_m = bow_m + crossed + POSITION_M;
        let per_m = 1.0 / region.distance_m;
        // The drawn point may be nearer to the eye than its place in the region, by no more than all of this.
        let nearer_m = bows.whole_m + crossed + POSITION_M;
        let room = self.sine * (1.0 - nearer_m * per_m) - shift_m * per_m;
        let units = room / (region.sine_per_m * self.unit_m) - QUANTISATION_UNITS;
        if room > 0.0 && units >= 0.0 {
            // The cast rounds down.
            code_down(units.min(MOST_UNITS) as u32).saturating_add(1)
        } else {
            0
        }
    }
}
