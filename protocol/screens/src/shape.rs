//! One screen of any shape: places, rays, normals, outlines.
//! In: a shape, shares of its canvas, rays in room metres. Out: room points and shares. It holds no state.

use glam::DVec3;

use crate::rays::{EDGE_SHARE, in_room};
use crate::{Cylinder, Planar, Points, ShapeError, Sphere, SphereMapping};

/// The most steps along a side of an outline.
const MOST_STEPS: u32 = 4096;

/// The surface that a canvas lies on.
#[derive(Clone, Debug)]
pub enum Shape {
    /// A rectangle.
    Planar(Planar),
    /// A part of a cylinder, seen from inside.
    Cylinder(Cylinder),
    /// A part of a sphere, seen from inside.
    Sphere(Sphere),
    /// Points on a grid.
    Points(Points),
}

impl Shape {
    /// Whether this is a screen that can be shown.
    ///
    /// # Errors
    /// Names the measure that is wrong and its key in a wall file: not finite, without area, left-handed, out of range.
    pub fn check(&self) -> Result<(), ShapeError> {
        match self {
            Self::Planar(planar) => planar.check(),
            Self::Cylinder(cylinder) => cylinder.check(),
            Self::Sphere(sphere) => sphere.check(),
            Self::Points(points) => points.check(),
        }
    }

    /// The point of the room at shares 0…1 of the canvas from its upper left corner. `None` off the canvas and where it
    /// shows nothing: outside a fisheye's circle, in holes between points.
    #[must_use]
    pub fn point_m(&self, x_share: f64, y_share: f64) -> Option<DVec3> {
        let canvas = -EDGE_SHARE..=1.0 + EDGE_SHARE;
        if !(canvas.contains(&x_share) && canvas.contains(&y_share)) {
            return None;
        }
        match self {
            Self::Sphere(sphere) if !sphere.shows(x_share, y_share) => None,
            _ => self.beyond_m(x_share, y_share),
        }
    }

    /// As [`Shape::point_m`], but the surface goes on beyond the edges of the canvas, so that it has slopes there.
    pub(crate) fn beyond_m(&self, x_share: f64, y_share: f64) -> Option<DVec3> {
        let point_m = match self {
            Self::Planar(planar) => planar.frame().point_m(x_share, y_share),
            Self::Cylinder(cylinder) => cylinder.point_m(x_share, y_share)?,
            Self::Sphere(sphere) => sphere.point_m(x_share, y_share),
            Self::Points(points) => points.point_m(x_share, y_share)?,
        };
        point_m.is_finite().then_some(point_m)
    }

    /// Where a ray first meets the canvas, in shares; from behind, too. `from_m` in room metres, `direction` of any
    /// length but 0. On points it meets what is bilinear between them.
    #[must_use]
    pub fn locate(&self, from_m: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        let direction = direction.try_normalize()?;
        if !in_room(from_m) {
            return None;
        }
        match self {
            Self::Planar(planar) => planar.locate(from_m, direction),
            Self::Cylinder(cylinder) => cylinder.locate(from_m, direction),
            Self::Sphere(sphere) => sphere.locate(from_m, direction),
            Self::Points(points) => points.locate(from_m, direction),
        }
    }

    /// The unit normal towards the viewers at shares of the canvas. `None` where [`Shape::point_m`] is.
    #[must_use]
    pub fn normal(&self, x_share: f64, y_share: f64) -> Option<DVec3> {
        let point_m = self.point_m(x_share, y_share)?;
        let normal = match self {
            Self::Planar(planar) => planar.frame().back,
            Self::Cylinder(cylinder) => cylinder.normal(point_m),
            Self::Sphere(sphere) => sphere.normal(point_m),
            Self::Points(points) => points.normal(x_share, y_share)?,
        };
        normal.is_finite().then_some(normal)
    }

    /// The edge of the canvas as a closed line for room plans, in room metres: `steps` (1…4096) a side, from the upper left
    /// corner clockwise as the viewers see it; for a fisheye its circle. Places that show nothing are left out.
    #[must_use]
    pub fn outline_m(&self, steps: u32) -> Vec<DVec3> {
        let steps = steps.clamp(1, MOST_STEPS);
        let share = |step: u32| f64::from(step) / f64::from(steps);
        let sides: [fn(f64) -> [f64; 2]; 4] = [
            |s| [s, 0.0],
            |s| [1.0, s],
            |s| [1.0 - s, 1.0],
            |s| [0.0, 1.0 - s],
        ];
        sides
            .iter()
            .flat_map(|side| (0..steps).map(move |step| side(share(step))))
            .filter_map(|[x, y]| {
                let [x, y] = if self.is_fisheye() {
                    onto_circle(x, y)
                } else {
                    [x, y]
                };
                self.point_m(x, y)
            })
            .collect()
    }

    /// The map of a channel for [`crate::SampledMap::new`]: from pixels of a rectangle (x, y, width, height) of the canvas
    /// (the middle of its first pixel is 0.5, 0.5) to room points. `size_px` is that of the whole canvas.
    pub fn channel_map(
        &self,
        size_px: [u32; 2],
        canvas_px: [u32; 4],
    ) -> impl Fn(f64, f64) -> Option<DVec3> + '_ {
        let [width, height] = size_px.map(f64::from);
        let [left, top] = [canvas_px[0], canvas_px[1]].map(f64::from);
        move |x_px, y_px| self.point_m((left + x_px) / width, (top + y_px) / height)
    }

    /// Whether the canvas is a circle.
    pub(crate) const fn is_fisheye(&self) -> bool {
        matches!(
            self,
            Self::Sphere(Sphere {
                mapping: SphereMapping::Fisheye { .. },
                ..
            })
        )
    }
}

/// From the edge of the canvas towards its middle, onto the circle.
fn onto_circle(x_share: f64, y_share: f64) -> [f64; 2] {
    let (x, y) = (x_share - 0.5, y_share - 0.5);
    let factor = 0.5 / (x * x + y * y).sqrt();
    [0.5 + x * factor, 0.5 + y * factor]
}
