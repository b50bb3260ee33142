//! A screen's surface as places that can be measured: samples, edges, what is nearest, how dense pixels are there.
//!
//! In: a shape, points of the room in metres. Out: points, distances, shares of the canvas. It judges and draws nothing.

use glam::DVec3;
use screens::{Shape, Sphere, SphereMapping};

/// Samples a side from which the search for the nearest place starts.
const COARSE: u32 = 32;
/// Halvings of its step: a sixteenth of a screen of 10 m becomes 10 µm.
const HALVINGS: u32 = 16;
/// Moves it may make with one step.
const MOVES: u32 = 8;
/// Segments of an edge.
const EDGE_STEPS: u32 = 48;
/// How far apart places are from which slopes are taken, in shares of a canvas.
const SLOPE_SHARE: f64 = 1e-4;
/// The same on points: less than this is within one flat cell.
const POINTS_SLOPE_SHARE: f64 = 1.0 / 512.0;
/// How far slopes of a fisheye are taken from its middle at most, so that its circle has a slope.
const FISHEYE_REACH: f64 = 0.999;

/// A place of a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Parameters of [`Face::point_m`].
    pub(crate) parameters: [f64; 2],
    pub(crate) point_m: DVec3,
}

/// An edge of a surface, from parameters to parameters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    /// Which one, for sentences.
    pub(crate) name: &'static str,
    /// Its ramp in `Blend::ramps_px`; `None` for the circle of a fisheye, which has none.
    pub(crate) ramp: Option<usize>,
    from: [f64; 2],
    to: [f64; 2],
}

/// A surface with samples. Parameters 0…1 are shares of the canvas from its upper left corner; for a fisheye the turn
/// around its middle, and the way from its circle to its middle.
pub(crate) struct Face<'a> {
    pub(crate) shape: &'a Shape,
    samples: Vec<Place>,
    low_m: DVec3,
    high_m: DVec3,
}

impl<'a> Face<'a> {
    pub(crate) fn new(shape: &'a Shape) -> Self {
        let mut face = Self {
            shape,
            samples: Vec::new(),
            low_m: DVec3::INFINITY,
            high_m: DVec3::NEG_INFINITY,
        };
        let share = |index: u32| f64::from(index) / f64::from(COARSE);
        let parameters = (0..=COARSE)
            .flat_map(|row| (0..=COARSE).map(move |column| [share(column), share(row)]));
        face.samples = parameters.filter_map(|at| face.place(at)).collect();
        for sample in &face.samples {
            face.low_m = face.low_m.min(sample.point_m);
            face.high_m = face.high_m.max(sample.point_m);
        }
        face
    }

    pub(crate) fn is_fisheye(&self) -> bool {
        matches!(
            self.shape,
            Shape::Sphere(Sphere {
                mapping: SphereMapping::Fisheye { .. },
                ..
            })
        )
    }

    /// The shares of the canvas of parameters.
    pub(crate) fn shares(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        if !self.is_fisheye() {
            return [u, v];
        }
        let (sine, cosine) = (u * std::f64::consts::TAU).sin_cos();
        let reach = 0.5 * (1.0 - v);
        [0.5 + reach * sine, 0.5 - reach * cosine]
    }

    /// The point of the room; `None` where the surface shows nothing.
    pub(crate) fn point_m(&self, parameters: [f64; 2]) -> Option<DVec3> {
        let [x, y] = self.shares(parameters);
        self.shape.point_m(x, y)
    }

    fn place(&self, parameters: [f64; 2]) -> Option<Place> {
        let point_m = self.point_m(parameters)?;
        Some(Place {
            parameters,
            point_m,
        })
    }

    /// The corners of a box around the surface.
    pub(crate) fn bounds_m(&self) -> [DVec3; 2] {
        [self.low_m, self.high_m]
    }

    /// Whether boxes around two surfaces are within a distance of each other.
    pub(crate) fn is_near(&self, other: &Self, within_m: f64) -> bool {
        let reach = DVec3::splat(within_m);
        (self.low_m - reach).cmple(other.high_m).all()
            && (other.low_m - reach).cmple(self.high_m).all()
    }

    /// Its edges, clockwise as viewers see them: upper, right, lower, left; of a fisheye the circle.
    pub(crate) fn edges(&self) -> Vec<Edge> {
        let edge = |name, ramp, from, to| Edge {
            name,
            ramp,
            from,
            to,
        };
        if self.is_fisheye() {
            return vec![edge("outer", None, [0.0, 0.0], [1.0, 0.0])];
        }
        vec![
            edge("upper", Some(2), [0.0, 0.0], [1.0, 0.0]),
            edge("right", Some(1), [1.0, 0.0], [1.0, 1.0]),
            edge("lower", Some(3), [1.0, 1.0], [0.0, 1.0]),
            edge("left", Some(0), [0.0, 1.0], [0.0, 0.0]),
        ]
    }

    /// Places along an edge, both ends among them.
    pub(crate) fn along(&self, edge: &Edge, steps: u32) -> Vec<Place> {
        let between =
            |axis: usize, share: f64| edge.from[axis] + (edge.to[axis] - edge.from[axis]) * share;
        (0..=steps)
            .map(|step| f64::from(step) / f64::from(steps))
            .filter_map(|share| self.place([between(0, share), between(1, share)]))
            .collect()
    }

    /// A closed line around the surface: corners for a plane, many points for others.
    pub(crate) fn outline_m(&self) -> Vec<DVec3> {
        let steps = match self.shape {
            Shape::Planar(_) => 1,
            _ => EDGE_STEPS,
        };
        let mut points = Vec::new();
        for edge in self.edges() {
            let mut along = self.along(&edge, steps);
            // The next edge begins where this one ends.
            along.pop();
            points.extend(along.into_iter().map(|place| place.point_m));
        }
        points
    }

    /// From a point to the nearest edge, in metres.
    pub(crate) fn to_edges_m(&self, point_m: DVec3) -> f64 {
        let edges = self.edges();
        let lines = edges.iter().map(|edge| self.along(edge, EDGE_STEPS));
        lines
            .flat_map(|line| {
                let pairs = line.windows(2);
                let distances = pairs.filter_map(|pair| match pair {
                    [from, to] => Some(to_segment_m(point_m, from.point_m, to.point_m)),
                    _ => None,
                });
                distances.collect::<Vec<f64>>()
            })
            .fold(f64::INFINITY, f64::min)
    }

    /// The place that is nearest to a point, if it is within a distance.
    pub(crate) fn nearest(&self, point_m: DVec3, within_m: f64) -> Option<Place> {
        let square = |place: &Place| place.point_m.distance_squared(point_m);
        let coarse = self
            .samples
            .iter()
            .min_by(|a, b| square(a).total_cmp(&square(b)))?;
        let cell_m = (self.high_m - self.low_m).length() / f64::from(COARSE);
        if square(coarse).sqrt() > within_m + 4.0 * cell_m {
            return None;
        }
        let [u, v] = coarse.parameters;
        // A surface that goes all around has a seam, on whose other side the nearest place may be.
        let seam = [0.0, 1.0].contains(&u).then_some([1.0 - u, v]);
        let starts = [Some(*coarse), seam.and_then(|at| self.place(at))];
        let found = starts
            .into_iter()
            .flatten()
            .map(|start| self.descend(start, point_m))
            .min_by(|a, b| square(a).total_cmp(&square(b)))?;
        (square(&found) <= within_m * within_m).then_some(found)
    }

    /// Goes to nearer neighbours, and halves the step each time.
    fn descend(&self, mut here: Place, point_m: DVec3) -> Place {
        let mut step = 1.0 / f64::from(COARSE);
        for _ in 0..HALVINGS {
            step *= 0.5;
            for _ in 0..MOVES {
                let mut better = here;
                for (x, y) in NEIGHBOURS {
                    let [u, v] = here.parameters;
                    let at = [u + step * x, v + step * y].map(|part| part.clamp(0.0, 1.0));
                    if let Some(place) = self.place(at)
                        && place.point_m.distance_squared(point_m)
                            < better.point_m.distance_squared(point_m)
                    {
                        better = place;
                    }
                }
                if better.parameters == here.parameters {
                    break;
                }
                here = better;
            }
        }
        here
    }

    /// The unit normal towards the viewers.
    pub(crate) fn normal(&self, parameters: [f64; 2]) -> Option<DVec3> {
        let [x, y] = self.shares(parameters);
        self.shape.normal(x, y)
    }

    /// Pixels to a radian at a place as a head sees it, mean of both directions: the root of the pixels to a steradian.
    /// `None` from behind, and where the surface has no slope.
    pub(crate) fn pixels_per_radian(
        &self,
        [u, v]: [f64; 2],
        size_px: [u32; 2],
        head_m: DVec3,
    ) -> Option<f64> {
        let at = if self.is_fisheye() {
            [u, v.max(1.0 - FISHEYE_REACH)]
        } else {
            [u, v]
        };
        let [x, y] = self.shares(at);
        let point_m = self.shape.point_m(x, y)?;
        let step = match self.shape {
            Shape::Points(_) => POINTS_SLOPE_SHARE,
            _ => SLOPE_SHARE,
        };
        let slope = |axis: usize| {
            let ends = [-step, step].map(|step| {
                let mut at = [x, y];
                at[axis] = (at[axis] + step).clamp(0.0, 1.0);
                at
            });
            let [before, after] = ends;
            let moved = self.shape.point_m(after[0], after[1])?
                - self.shape.point_m(before[0], before[1])?;
            Some(moved / ((after[axis] - before[axis]) * f64::from(size_px[axis])))
        };
        screens::pixels_per_radian(point_m - head_m, slope(0)?, slope(1)?)
    }
}

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

fn to_segment_m(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    let along = to - from;
    let length_squared = along.length_squared();
    let share = if length_squared > 0.0 {
        ((point - from).dot(along) / length_squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    point.distance(from + along * share)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that panics has failed")]
mod tests {
    use screens::{Cylinder, CylinderMapping, Planar};

    use super::*;

    fn shapes() -> [Shape; 3] {
        [
            Shape::Planar(Planar {
                bottom_left_m: DVec3::new(-2.0, 0.0, -3.0),
                bottom_right_m: DVec3::new(2.0, 0.0, -3.0),
                top_left_m: DVec3::new(-2.0, 2.0, -3.0),
            }),
            Shape::Cylinder(Cylinder {
                foot_m: DVec3::ZERO,
                axis: DVec3::Y,
                radius_m: 3.0,
                mapping: CylinderMapping::Arc {
                    azimuth_deg: [-180.0, 180.0],
                    height_m: [0.0, 2.0],
                },
            }),
            Shape::Sphere(Sphere {
                centre_m: DVec3::ZERO,
                radius_m: 3.0,
                tilt_deg: 0.0,
                mapping: SphereMapping::Fisheye { field_deg: 180.0 },
            }),
        ]
    }

    #[test]
    fn the_nearest_place_is_found_within_a_tenth_of_a_millimetre() {
        let [plane, cylinder, dome] = shapes();
        let beside = DVec3::new(2.1, 1.0, -3.0);
        // On the seam of the cylinder, and close to that of the fisheye.
        let cases = [
            (&plane, DVec3::new(0.3, 0.7, -2.95), 0.05),
            (&plane, beside, 0.1),
            (&cylinder, DVec3::new(0.0, 1.0, 3.1), 0.1),
            (&cylinder, DVec3::new(0.01, 2.1, 3.0), 0.1),
            (&dome, DVec3::new(1.0, 2.7, -0.01).normalize() * 2.9, 0.1),
            (&dome, DVec3::new(0.0, -0.1, 3.0), 0.1),
        ];
        for (shape, point_m, distance_m) in cases {
            let face = Face::new(shape);
            let found = face.nearest(point_m, 0.2).unwrap();
            let off_m = found.point_m.distance(point_m) - distance_m;
            assert!(off_m.abs() < 1e-4, "{shape:?} {point_m}: {off_m}");
            assert!(face.nearest(point_m, 0.04).is_none());
        }
        let plane = Face::new(&plane);
        assert!((plane.to_edges_m(beside) - 0.1).abs() < 1e-9);
        assert!((plane.to_edges_m(DVec3::new(0.0, 0.5, -3.0)) - 0.5).abs() < 1e-9);
    }

    #[test]
    fn the_density_is_that_of_the_whole_screen_where_it_is_the_same_everywhere() {
        let [plane, cylinder, dome] = shapes();
        let head_m = DVec3::ZERO;
        // 500 a metre, 3 m away; 1500 a turn; 900 over half a turn, at the middle.
        let cases = [
            (&plane, [2000, 1000], [0.5, 1.0], 1500.0),
            (&cylinder, [9425, 1000], [0.2, 1.0], 1500.0),
            (
                &dome,
                [900, 900],
                [0.1, 0.999],
                900.0 / std::f64::consts::PI,
            ),
        ];
        for (shape, size_px, parameters, expected) in cases {
            let face = Face::new(shape);
            let found = face.pixels_per_radian(parameters, size_px, head_m).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-3, "{shape:?}: {found}");
            // From behind nobody sees a pixel.
            let behind_m = DVec3::new(0.0, 0.0, -9.0);
            let at = if face.is_fisheye() {
                [0.5, 0.1]
            } else {
                [0.5, 0.5]
            };
            assert!(face.pixels_per_radian(at, size_px, behind_m).is_none());
        }
    }
}
