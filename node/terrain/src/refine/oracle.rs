//! The oracle: the true screen-space error of a drawn mesh, by brute force over every sample.
//! In: a leaf's true heights, the vertices and triangles drawn for it, an eye. Out: the largest error in pixels.
//! It shares no bound and no table with what decides the mesh. For tests and reports.

use geodesy::{Ellipsoid, LATTICE_BITS, NODES, Tile};
use glam::DVec3;

use super::normals::Normals;
use crate::mesh::Vertex;

/// What the oracle found in one leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The largest distance on the screen between a sample and the drawn surface at the same place of the
    /// lattice, in pixels: the angle at the eye times the pixels per radian.
    pub max_px: f64,
    /// The node of the largest distance; (0, 0) where it is 0.
    pub worst: [u16; 2],
    /// How many nodes were measured.
    pub samples: u64,
    /// Nodes that have a height, but that no triangle covers.
    pub uncovered: u64,
}

/// Measures one leaf as it is drawn: `vertices` with their places on the lattice, and `indices`, three a triangle.
///
/// `heights_m` are the true heights of all 257 · 257 nodes, row by row, in metres above the ellipsoid. A node whose
/// height is not a number, or beyond the end of the list, has no sample and is not measured. Between its corners a triangle is
/// drawn flat, so at a node the drawn point is the mean of the corners by the node's barycentric coordinates
/// on the lattice. Nodes on edges count for the triangles on both sides. Triangles without area on the lattice,
/// or with an index that is out of range, cover nothing.
#[must_use]
pub fn measure(
    ellipsoid: &Ellipsoid,
    tile: Tile,
    heights_m: &[f64],
    vertices: &[Vertex],
    indices: &[u32],
    eye: DVec3,
    pixels_per_radian: f64,
) -> Measured {
    let samples = Samples::new(ellipsoid, tile, heights_m, eye);
    let drawn: Vec<(DVec3, [u16; 2])> = vertices
        .iter()
        .map(|vertex| (vertex.point().to_ecef() - eye, vertex.lattice))
        .collect();
    let mut covered = vec![false; samples.points.len()];
    let mut worst = Worst::default();
    for triangle in indices.chunks_exact(3) {
        let corner = |n: usize| drawn.get(*triangle.get(n)? as usize).copied();
        if let (Some(a), Some(b), Some(c)) = (corner(0), corner(1), corner(2)) {
            samples.measure(
                [a.0, b.0, c.0],
                [a.1, b.1, c.1],
                &mut worst,
                Some(&mut covered),
            );
        }
    }
    let (mut measured, mut uncovered) = (0, 0);
    for (point, covered) in samples.points.iter().zip(&covered) {
        if point.is_nan() {
            continue;
        }
        if *covered {
            measured += 1;
        } else {
            uncovered += 1;
        }
    }
    Measured {
        max_px: worst.angle * pixels_per_radian,
        worst: worst.node,
        samples: measured,
        uncovered,
    }
}

/// The worst node so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Worst {
    /// The largest angle at the eye in radians.
    pub(crate) angle: f64,
    pub(crate) node: [u16; 2],
    /// Squared tangent of the angle.
    tangent_squared: f64,
}

/// Where the samples of a leaf truly are, relative to the eye; NaN where there is none.
pub(crate) struct Samples {
    points: Vec<DVec3>,
}

impl Samples {
    pub(crate) fn new(ellipsoid: &Ellipsoid, tile: Tile, heights_m: &[f64], eye: DVec3) -> Self {
        let normals = Normals::new(tile);
        let mut heights = heights_m.iter();
        let mut points = Vec::with_capacity((NODES * NODES) as usize);
        for y in 0..NODES as u16 {
            for x in 0..NODES as u16 {
                let height_m = heights.next().copied().unwrap_or(f64::NAN);
                points.push(ellipsoid.point(normals.at(x, y), height_m) - eye);
            }
        }
        Self { points }
    }

    /// The point of node (x, y), NaN outside.
    pub(crate) fn point(&self, [x, y]: [u16; 2]) -> DVec3 {
        let index = usize::from(y) * NODES as usize + usize::from(x);
        self.points.get(index).copied().unwrap_or(DVec3::NAN)
    }

    /// Measures all samples in the closed triangle that is drawn with its corners at `drawn` (relative to the eye)
    /// and at `places` on the lattice, each 0…256.
    pub(crate) fn measure(
        &self,
        drawn: [DVec3; 3],
        places: [[u16; 2]; 3],
        worst: &mut Worst,
        mut covered: Option<&mut [bool]>,
    ) {
        let last = 1_i32 << LATTICE_BITS;
        let [a, b, c] = places.map(|place| place.map(i32::from));
        // Twice the area of the triangle p, q, r, and by what it grows for steps of r along x and y.
        let area = |p: [i32; 2], q: [i32; 2], r: [i32; 2]| {
            (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        };
        let whole = area(a, b, c);
        if whole == 0 {
            return;
        }
        let sign = whole.signum();
        let per_area = 1.0 / f64::from(whole);
        let x_range = |f: fn(i32, i32) -> i32| f(f(a[0], b[0]), c[0]).clamp(0, last);
        let y_range = |f: fn(i32, i32) -> i32| f(f(a[1], b[1]), c[1]).clamp(0, last);
        let (x0, x1) = (x_range(i32::min), x_range(i32::max));
        let [drawn_a, drawn_b, drawn_c] = drawn;
        for y in y_range(i32::min)..=y_range(i32::max) {
            let start = [x0, y];
            let mut parts = [area(b, c, start), area(c, a, start), area(a, b, start)];
            let steps = [b[1] - c[1], c[1] - a[1], a[1] - b[1]];
            let row = y as usize * NODES as usize;
            for x in x0..=x1 {
                let [of_a, of_b, of_c] = parts;
                for (part, step) in parts.iter_mut().zip(steps) {
                    *part += step;
                }
                if of_a * sign < 0 || of_b * sign < 0 || of_c * sign < 0 {
                    continue;
                }
                let index = row + x as usize;
                if let Some(flag) = covered.as_mut().and_then(|covered| covered.get_mut(index)) {
                    *flag = true;
                }
                let Some(point) = self.points.get(index) else {
                    continue;
                };
                let sum = drawn_a * f64::from(of_a)
                    + drawn_b * f64::from(of_b)
                    + drawn_c * f64::from(of_c);
                // The cross product with the difference, which is small, and not with the sum, which is almost
                // parallel: nothing cancels.
                let difference = sum * per_area - *point;
                let cross = point.cross(difference).length_squared();
                let dot = point.dot(*point + difference);
                // NaN compares as not worse. The arc tangent is only asked for what looks worse.
                if dot <= 0.0 || cross > worst.tangent_squared * dot * dot {
                    let angle = cross.sqrt().atan2(dot);
                    if angle > worst.angle {
                        *worst = Worst {
                            angle,
                            node: [x as u16, y as u16],
                            tangent_squared: if dot > 0.0 {
                                cross / (dot * dot)
                            } else {
                                f64::INFINITY
                            },
                        };
                    }
                }
            }
        }
    }
}
