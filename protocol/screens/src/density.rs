//! How many pixels of a canvas there are to a radian of view.
//! In: shapes or sampled maps, canvas sizes, heads. Out: the sparsest and the densest place. It knows no level of detail.

use glam::DVec3;

use crate::jacobian::{oblong_squared, relief_squared, singular_squared};
use crate::{Planar, SampledMap, Shape};

/// Places a side that are looked at first.
const PLACES: u32 = 25;
/// Halvings of the step in the search for the extreme from there.
const HALVINGS: u32 = 8;
/// How far apart places are from which slopes are taken, in shares of a smooth canvas.
const SLOPE_SHARE: f64 = 1e-5;
/// The least cosine of the angle between a line of sight and the normal: flatter than this, nobody sees a pixel.
const GRAZING_COSINE: f64 = 0.02;
/// How much more than the densest place that is found is reported, for places between.
const DENSEST_RESERVE: f64 = 1.005;

/// How many pixels there are to a radian of view. On planar screens in closed form, exact for square pixels and never less
/// than the truth for others; on other screens found by a search, and `densest` 0.5 % more than what is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Density {
    /// The fewest, at the sparsest place in the direction in which they are sparsest. On a plane at the foot of the
    /// perpendicular from the head, be it on the canvas or not.
    pub sparsest: f64,
    /// The most, at the densest place in the direction in which they are densest.
    pub densest: f64,
    /// The share of the canvas, 0…1 and roughly, that the head sees from the front and at more than 1.1°. Only that counts
    /// for the others. Below 1 the head is beside or behind a part of the screen.
    pub seen_share: f64,
}

/// The density of a canvas of `size_px` from a head (room metres), over the whole canvas. Pixels that the surface itself
/// squeezes to more than 3:1 (poles of grids), if its least oblong ones are square, count as if they were 3:1. `None` if no
/// place is seen from the front.
#[must_use]
pub fn pixel_density(shape: &Shape, size_px: [u32; 2], head_m: DVec3) -> Option<Density> {
    if !head_m.is_finite() || size_px.contains(&0) {
        return None;
    }
    match shape {
        Shape::Planar(planar) => planar_density(planar, size_px, head_m),
        Shape::Cylinder(_) | Shape::Sphere(_) | Shape::Points(_) => {
            Canvas::new(shape, size_px, head_m).density()
        }
    }
}

/// At distance ρ from the foot of the perpendicular of length d, a radian covers (d² + ρ²)/d metres in radial direction
/// and √(d² + ρ²) across: least at the foot, and convex, so most at a corner.
fn planar_density(planar: &Planar, size_px: [u32; 2], head_m: DVec3) -> Option<Density> {
    let frame = planar.frame();
    let distance_m = frame.in_front_m(head_m);
    if !(distance_m > 0.0 && distance_m.is_finite()) {
        return None;
    }
    let [across, along] = [
        f64::from(size_px[0]) / frame.width_m,
        f64::from(size_px[1]) / frame.height_m,
    ];
    let farthest_squared = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
        .map(|(x, y)| frame.point_m(x, y).distance_squared(head_m))
        .into_iter()
        .fold(0.0, f64::max);
    Some(Density {
        sparsest: across.min(along) * distance_m,
        densest: across.max(along) * farthest_squared / distance_m,
        seen_share: 1.0,
    })
}

/// What one place is like.
#[derive(Clone, Copy)]
enum Look {
    /// From behind, or too flat.
    Unseen,
    /// The squares of how many radians a pixel is: in the sparsest and in the densest direction.
    Seen([f64; 2]),
}

/// The area of a pixel along the line of sight, in square metres times metres; `None` from behind, or too flat.
/// `from_head` leads to the point; `x` and `y` are how the point moves with a pixel to the right and down.
fn depth(from_head: DVec3, x: DVec3, y: DVec3) -> Option<f64> {
    // Right × down is away from the viewers.
    let away = x.cross(y);
    let deep = away.dot(from_head);
    let flat = GRAZING_COSINE * GRAZING_COSINE * away.length_squared();
    (deep > 0.0 && deep * deep * from_head.length_squared().recip() > flat).then_some(deep)
}

/// Pixels to a radian at one place, mean of both directions: the root of the pixels to a steradian. `from_head` leads to the
/// place, `per_x` and `per_y` are how it moves with a pixel to the right and down, in metres. `None` from behind, and for
/// pixels that are seen too flat, or have no size.
#[must_use]
pub fn pixels_per_radian(from_head: DVec3, per_x: DVec3, per_y: DVec3) -> Option<f64> {
    // The area of a pixel across the line of sight, over the distance squared.
    let steradians = depth(from_head, per_x, per_y)? / from_head.length().powi(3);
    Some(steradians.sqrt().recip()).filter(|density| density.is_finite())
}

fn look(from_head: DVec3, x: DVec3, y: DVec3, relief_squared: f64) -> Look {
    let Some(deep) = depth(from_head, x, y) else {
        return Look::Unseen;
    };
    let inverse = from_head.length_squared().recip();
    // What of a step is across the line of sight turns it; the area across it is what is seen of the pixel.
    let (along_x, along_y) = (x.dot(from_head), y.dot(from_head));
    let turns = |product: f64, along: f64| (product - along * inverse) * inverse;
    let [smallest, largest] = singular_squared(
        turns(x.length_squared(), along_x * along_x),
        turns(x.dot(y), along_x * along_y),
        turns(y.length_squared(), along_y * along_y),
        deep * deep * inverse * inverse * inverse,
    );
    Look::Seen([largest, (smallest * relief_squared).min(largest)])
}

/// Collects places.
#[derive(Default)]
struct Census {
    there: u32,
    seen: u32,
    /// The largest and the smallest pixel, as [`Look::Seen`] has them.
    range: Option<[f64; 2]>,
}

impl Census {
    fn add(&mut self, look: Look) {
        match look {
            Look::Unseen => self.there += 1,
            Look::Seen([large, small]) => {
                self.there += 1;
                self.seen += 1;
                let [largest, smallest] = self.range.unwrap_or([0.0, f64::INFINITY]);
                self.range = Some([largest.max(large), smallest.min(small)]);
            }
        }
    }

    fn density(&self) -> Option<Density> {
        let [largest, smallest] = self.range?;
        Some(Density {
            sparsest: largest.sqrt().recip(),
            densest: smallest.sqrt().recip() * DENSEST_RESERVE,
            seen_share: f64::from(self.seen) / f64::from(self.there),
        })
    }
}

impl SampledMap {
    /// As [`pixel_density`], for the samples of a channel's map: without a search, but by basic operations and square roots
    /// alone. It serves channels whose pixels a calibration file puts in place.
    #[must_use]
    pub fn density(&self, eye_m: DVec3) -> Option<Density> {
        if !eye_m.is_finite() {
            return None;
        }
        let mut census = Census::default();
        let rim = self.rim.iter().map(|rim| &rim.sample);
        for sample in self.samples.iter().chain(rim) {
            if sample.relief_squared.is_finite() {
                let from_eye = sample.point_m - eye_m;
                census.add(look(
                    from_eye,
                    sample.per_x,
                    sample.per_y,
                    sample.relief_squared,
                ));
            }
        }
        census.density()
    }
}

/// A place of a canvas as a head sees it.
struct Place {
    parameters: [f64; 2],
    from_head: DVec3,
    /// How the point moves with a pixel to the right and down.
    per_x: DVec3,
    per_y: DVec3,
    oblong_squared: f64,
}

/// The places around one, in steps.
const NEIGHBOURS: [(f64, f64); 8] = [
    (1.0, 0.0),
    (-1.0, 0.0),
    (0.0, 1.0),
    (0.0, -1.0),
    (1.0, 1.0),
    (1.0, -1.0),
    (-1.0, 1.0),
    (-1.0, -1.0),
];

/// A canvas as it is searched: over two parameters 0…1, shares or, for a fisheye, distance from its middle and turn.
struct Canvas<'a> {
    shape: &'a Shape,
    size_px: [f64; 2],
    head_m: DVec3,
    slope_share: [f64; 2],
}

impl<'a> Canvas<'a> {
    fn new(shape: &'a Shape, size_px: [u32; 2], head_m: DVec3) -> Self {
        let slope_share = match shape {
            // Across a kink the mean of both sides counts.
            Shape::Points(points) => {
                [points.columns(), points.rows()].map(|count| 0.5 / count as f64)
            }
            _ => [SLOPE_SHARE; 2],
        };
        Self {
            shape,
            size_px: size_px.map(f64::from),
            head_m,
            slope_share,
        }
    }

    fn place(&self, parameters: [f64; 2]) -> Option<Place> {
        let [x, y] = if self.shape.is_fisheye() {
            let [distance, turn] = parameters;
            let (sine, cosine) = (turn * std::f64::consts::TAU).sin_cos();
            [0.5 + 0.5 * distance * cosine, 0.5 + 0.5 * distance * sine]
        } else {
            parameters
        };
        let point_m = self.shape.beyond_m(x, y)?;
        let [dx, dy] = self.slope_share;
        let slope = |after: Option<DVec3>, before: Option<DVec3>, share: f64, size_px: f64| {
            Some((after? - before?) / (2.0 * share * size_px))
        };
        let per_x = slope(
            self.shape.beyond_m(x + dx, y),
            self.shape.beyond_m(x - dx, y),
            dx,
            self.size_px[0],
        );
        let per_y = slope(
            self.shape.beyond_m(x, y + dy),
            self.shape.beyond_m(x, y - dy),
            dy,
            self.size_px[1],
        );
        let (per_x, per_y) = (per_x?, per_y?);
        Some(Place {
            parameters,
            from_head: point_m - self.head_m,
            per_x,
            per_y,
            oblong_squared: oblong_squared(per_x, per_y),
        })
        .filter(|place| place.oblong_squared.is_finite())
    }

    fn density(&self) -> Option<Density> {
        let last = PLACES - 1;
        let share = |index: u32| f64::from(index) / f64::from(last);
        let places: Vec<Place> = (0..PLACES)
            .flat_map(|row| (0..PLACES).map(move |column| [share(column), share(row)]))
            .filter_map(|parameters| self.place(parameters))
            .collect();
        let oblong = places.iter().map(|place| place.oblong_squared);
        let least_squared = oblong.fold(f64::INFINITY, f64::min);
        let mut census = Census::default();
        // The largest pixel, and the smallest one by its negative, so that both are searched for upwards.
        let mut best: [Option<([f64; 2], f64)>; 2] = [None; 2];
        for place in &places {
            let look = place.look(least_squared);
            census.add(look);
            if let Look::Seen([large, small]) = look {
                for (best, value) in best.iter_mut().zip([large, -small]) {
                    if best.is_none_or(|(_, most)| value > most) {
                        *best = Some((place.parameters, value));
                    }
                }
            }
        }
        let (there, seen) = (census.there, census.seen);
        for (best, pick) in best.into_iter().zip([largest, smallest]) {
            self.climb(best?, pick, least_squared, &mut census);
        }
        // Where the search went says nothing about shares.
        (census.there, census.seen) = (there, seen);
        census.density()
    }

    /// Goes to better neighbours, and halves the step each time. `pick` is what is to become large.
    fn climb(
        &self,
        (mut place, mut value): ([f64; 2], f64),
        pick: fn([f64; 2]) -> f64,
        least_squared: f64,
        census: &mut Census,
    ) {
        let mut step = f64::from(PLACES - 1).recip();
        for _ in 0..HALVINGS {
            step *= 0.5;
            let mut better = place;
            for (x, y) in NEIGHBOURS {
                let near =
                    [place[0] + step * x, place[1] + step * y].map(|part| part.clamp(0.0, 1.0));
                let Some(found) = self.place(near) else {
                    continue;
                };
                let look = found.look(least_squared);
                census.add(look);
                if let Look::Seen(range) = look
                    && pick(range) > value
                {
                    (value, better) = (pick(range), near);
                }
            }
            place = better;
        }
    }
}

const fn largest([large, _]: [f64; 2]) -> f64 {
    large
}

fn smallest([_, small]: [f64; 2]) -> f64 {
    -small
}

impl Place {
    fn look(&self, least_squared: f64) -> Look {
        let relief = relief_squared(self.oblong_squared, least_squared);
        look(self.from_head, self.per_x, self.per_y, relief)
    }
}
