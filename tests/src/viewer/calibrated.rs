//! Where the pixels of a calibrated channel fall in the room: its file's samples, laid out as a mesh of room points.
//!
//! In: a calibration, the surface of its screen. Out: the place in the channel's picture that lights what a ray meets. It
//! reads files by `calibration`, and knows nothing of what nodes make of them.

use std::path::Path;

use calibration::{Choice, Frustum, Grid, Mapping, Options, Placement, PointOrigin, Region};
use glam::DVec3;
use protocol::Wall;
use protocol::wall::{Calibration, Channel};
use screens::{Points, PointsAt, Shape};

/// A cell of the mesh has so many pixels of the channel along its sides at most.
const CELL_PX: f64 = 4.0;
/// As far as measured points may be off what the wall says of their screen, in metres.
const NEAR_SCREEN_M: f64 = 0.05;
/// Columns and rows at which the mesh of a screen is drawn.
const SURFACE_SIDE: u32 = 1024;

/// A mesh of room points over a channel's picture.
#[derive(Debug)]
pub(super) struct Mesh {
    /// Cells from left to right, and down.
    cells: [usize; 2],
    /// Width and height of the channel in pixels.
    size_px: [f64; 2],
    /// At the corners of cells; none where nothing is lit.
    points_m: Vec<Option<DVec3>>,
    /// Boxes around points, for rectangles of cells that are halved down to one: the halves of number n are 2n + 1 and
    /// 2n + 2. None around nothing.
    boxes: Vec<Option<[DVec3; 2]>>,
}

/// The points of a screen's file, in metres.
///
/// # Panics
/// For files without points.
pub(super) fn surface(file: &str, unit_m: f64) -> Points {
    let options = Options {
        obj: calibration::ObjMeaning::Surface,
        size_px: file.ends_with(".obj").then_some([SURFACE_SIDE; 2]),
        unit_m: unit_m as f32,
        ..Options::default()
    };
    let read = calibration::load(Path::new(file), &options).expect("a file of points");
    let Some(Mapping::Points { points_m, .. }) = read.regions.first().map(|region| &region.mapping)
    else {
        panic!("{file} holds no points");
    };
    let at = match points_m.placement {
        Placement::Centres => PointsAt::CellCentres,
        Placement::Corners => PointsAt::Corners,
    };
    Points::new(points_m.width, points_m.height, points_m.values.clone(), at).expect("a surface")
}

impl Mesh {
    /// The mesh of a channel whose calibration is `named`, on a screen of this shape.
    ///
    /// # Panics
    /// For files that cannot be read, and for points of which nobody knows where they count from.
    pub(super) fn of(wall: &Wall, channel: &Channel, named: &Calibration, shape: &Shape) -> Self {
        let options = Options {
            region: named.region.clone().map(Choice::Name),
            size_px: Some(channel.size_px),
            ..Options::default()
        };
        let read = calibration::load(Path::new(&named.file), &options).expect("a calibration");
        let [region] = &read.regions[..] else {
            panic!("{} has several regions", named.file);
        };
        let screen = &wall.screens[channel.screen];
        let head_m = DVec3::from(wall.observers[screen.observer].head_m);
        let canvas_px = screen.size_px.map(f64::from);
        let point_m = |place: [f64; 2]| point_m(region, channel, canvas_px, shape, head_m, place);
        let size_px = channel.size_px.map(f64::from);
        let cells = size_px.map(|side| (side / CELL_PX).ceil() as usize);
        let corners = (0..=cells[1]).flat_map(|y| (0..=cells[0]).map(move |x| [x, y]));
        let points_m = corners
            .map(|[x, y]| point_m([x as f64 / cells[0] as f64, y as f64 / cells[1] as f64]))
            .collect();
        let mut mesh = Self {
            cells,
            size_px,
            points_m,
            boxes: Vec::new(),
        };
        mesh.bound(0, [0, 0], cells);
        assert!(mesh.boxes[0].is_some(), "{} lights nothing", named.file);
        mesh
    }

    /// The place in the channel's picture, in pixels, that lights what a ray meets so near to `distance_m` as a measured
    /// screen is to what the wall says of it. `direction` is a unit vector.
    pub(super) fn place_px(
        &self,
        from_m: DVec3,
        direction: DVec3,
        distance_m: f64,
    ) -> Option<[f64; 2]> {
        let mut best: Option<(f64, [f64; 2])> = None;
        let mut open = vec![(0, [0, 0], self.cells)];
        while let Some((number, first, end)) = open.pop() {
            let Some(Some(bounds)) = self.boxes.get(number) else {
                continue;
            };
            if !meets(bounds, from_m, direction) {
                continue;
            }
            if let Some([left, right]) = halves(first, end) {
                open.push((2 * number + 1, left.0, left.1));
                open.push((2 * number + 2, right.0, right.1));
                continue;
            }
            let off = |met_m: f64| (met_m - distance_m).abs();
            for (met_m, place) in self.cell(first, from_m, direction) {
                let is_better = best.is_none_or(|(known_m, _)| off(met_m) < off(known_m));
                if off(met_m) <= NEAR_SCREEN_M && is_better {
                    best = Some((met_m, place));
                }
            }
        }
        best.map(|(_, place)| place)
    }

    fn point(&self, [x, y]: [usize; 2]) -> Option<DVec3> {
        self.points_m[y * (self.cells[0] + 1) + x]
    }

    /// The corners of a cell: upper left, upper right, lower left, lower right.
    fn corners(&self, [x, y]: [usize; 2]) -> Option<[DVec3; 4]> {
        Some([
            self.point([x, y])?,
            self.point([x + 1, y])?,
            self.point([x, y + 1])?,
            self.point([x + 1, y + 1])?,
        ])
    }

    /// Fills in the box around a rectangle of cells and those within it.
    fn bound(&mut self, number: usize, first: [usize; 2], end: [usize; 2]) -> Option<[DVec3; 2]> {
        let bounds = match halves(first, end) {
            Some([left, right]) => {
                let left = self.bound(2 * number + 1, left.0, left.1);
                let right = self.bound(2 * number + 2, right.0, right.1);
                match (left, right) {
                    (Some(a), Some(b)) => Some([a[0].min(b[0]), a[1].max(b[1])]),
                    (one, other) => one.or(other),
                }
            }
            None => self.corners(first).map(|corners| {
                let around = |step: fn(DVec3, DVec3) -> DVec3| {
                    corners.into_iter().reduce(step).unwrap_or_default()
                };
                // Rays along a flat box must meet it.
                [around(DVec3::min) - 1e-9, around(DVec3::max) + 1e-9]
            }),
        };
        if self.boxes.len() <= number {
            self.boxes.resize(number + 1, None);
        }
        self.boxes[number] = bounds;
        bounds
    }

    /// Where a ray meets the two triangles of a cell: how far away, and the place in pixels.
    fn cell(
        &self,
        first: [usize; 2],
        from_m: DVec3,
        direction: DVec3,
    ) -> impl Iterator<Item = (f64, [f64; 2])> {
        let triangles = self.corners(first).map(|[a, b, c, d]| {
            // Each with the shares of the cell at its corners.
            [
                ([a, b, c], [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
                ([d, c, b], [[1.0, 1.0], [0.0, 1.0], [1.0, 0.0]]),
            ]
        });
        triangles
            .into_iter()
            .flatten()
            .filter_map(move |(points_m, shares)| {
                let (met_m, [second, third]) = triangle(points_m, from_m, direction)?;
                let weights = [1.0 - second - third, second, third];
                let place = [0, 1].map(|axis| {
                    let within: f64 = weights.iter().zip(shares).map(|(w, s)| w * s[axis]).sum();
                    (first[axis] as f64 + within) / self.cells[axis] as f64 * self.size_px[axis]
                });
                Some((met_m, place))
            })
    }
}

/// First and last cells of both halves of a rectangle of cells; none for a single one.
type Half = ([usize; 2], [usize; 2]);
fn halves(first: [usize; 2], end: [usize; 2]) -> Option<[Half; 2]> {
    let [width, height] = [end[0] - first[0], end[1] - first[1]];
    if width <= 1 && height <= 1 {
        return None;
    }
    let axis = usize::from(height > width);
    let middle = (first[axis] + end[axis]) / 2;
    let (mut left_end, mut right_first) = (end, first);
    left_end[axis] = middle;
    right_first[axis] = middle;
    Some([(first, left_end), (right_first, end)])
}

/// Whether a ray meets a box (Kay and Kajiya, "Ray tracing complex scenes", 1986).
fn meets([least, most]: &[DVec3; 2], from_m: DVec3, direction: DVec3) -> bool {
    let (one, other) = ((*least - from_m) / direction, (*most - from_m) / direction);
    let enters = one.min(other).max_element();
    let leaves = one.max(other).min_element();
    leaves >= enters.max(0.0)
}

/// Where a ray meets a triangle: how far away, and the weights of its second and third corner (Möller and Trumbore, "Fast,
/// minimum storage ray/triangle intersection", 1997).
fn triangle([a, b, c]: [DVec3; 3], from_m: DVec3, direction: DVec3) -> Option<(f64, [f64; 2])> {
    /// Neighbours leave no crack.
    const SLACK: f64 = 1e-9;
    let (to_b, to_c) = (b - a, c - a);
    let across = direction.cross(to_c);
    let scale = 1.0 / to_b.dot(across);
    let from_a = from_m - a;
    let second = from_a.dot(across) * scale;
    let along = from_a.cross(to_b);
    let third = direction.dot(along) * scale;
    let met_m = to_c.dot(along) * scale;
    let is_in = second >= -SLACK && third >= -SLACK && second + third <= 1.0 + SLACK;
    (is_in && met_m > 0.0).then_some((met_m, [second, third]))
}

/// The point of the room that a place in a channel's picture lights, by its file.
fn point_m(
    region: &Region,
    channel: &Channel,
    canvas_px: [f64; 2],
    shape: &Shape,
    head_m: DVec3,
    place: [f64; 2],
) -> Option<DVec3> {
    let place = match &region.distortion {
        Some(lens) => between(lens, place)?,
        None => place,
    };
    let on_canvas = |own: [f64; 2]| {
        if !own.iter().all(|share| (0.0..=1.0).contains(share)) {
            return None;
        }
        let part = region.canvas.as_ref();
        let part = part.map_or([0.0, 0.0, 1.0, 1.0], |part| {
            [part.x, part.y, part.width, part.height]
        });
        let rect = channel.canvas_px;
        let (first, size) = ([rect.x, rect.y], [rect.width, rect.height]);
        let [x, y] = [0, 1].map(|axis| {
            let on_part = part[axis] + own[axis] * part[axis + 2];
            (f64::from(first[axis]) + on_part * f64::from(size[axis])) / canvas_px[axis]
        });
        shape.point_m(x, y)
    };
    match &region.mapping {
        Mapping::Identity => on_canvas(place),
        Mapping::Canvas(uv) => on_canvas(between(uv, place)?),
        Mapping::Frustum { frustum, uv } => {
            let [x, y] = shape.locate(head_m, through(frustum, between(uv, place)?))?;
            shape.point_m(x, y)
        }
        Mapping::Points {
            points_m, origin, ..
        } => {
            let from_m = match origin {
                PointOrigin::IdealEyePoint => head_m,
                PointOrigin::FloorCentre | PointOrigin::Unknown => DVec3::ZERO,
                PointOrigin::CentreOfMass => panic!("nobody knows where that is"),
            };
            Some(from_m + DVec3::from(between(points_m, place)?))
        }
    }
}

/// The direction of a place in a frustum's picture: the pilot's axes, turned by yaw, pitch and roll in this order
/// (tvaneerd/mpcdi, `MPCDI_explained.md`).
fn through(frustum: &Frustum, [u, v]: [f64; 2]) -> DVec3 {
    let turned = |one: DVec3, towards: DVec3, degrees: f64| {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        (one * cosine + towards * sine, towards * cosine - one * sine)
    };
    let (ahead, right) = turned(DVec3::NEG_Z, DVec3::X, frustum.yaw_deg);
    let (ahead, up) = turned(ahead, DVec3::Y, frustum.pitch_deg);
    let (up, right) = turned(up, right, frustum.roll_deg);
    let tangent = |degrees: f64| degrees.to_radians().tan();
    let (left, top) = (tangent(frustum.left_deg), tangent(frustum.up_deg));
    let x = left + u * (tangent(frustum.right_deg) - left);
    let y = top + v * (tangent(frustum.down_deg) - top);
    ahead + right * x + up * y
}

/// What a grid says at shares of the picture: bilinear between its samples, going on beyond the outer ones. None beside
/// holes.
fn between<const N: usize>(grid: &Grid<[f32; N]>, place: [f64; 2]) -> Option<[f64; N]> {
    let sides = [grid.width, grid.height];
    let [(column, right), (row, down)] = [0, 1].map(|axis| {
        let count = f64::from(sides[axis]);
        let along = match grid.placement {
            Placement::Centres => place[axis] * count - 0.5,
            Placement::Corners => place[axis] * (count - 1.0),
        };
        let first = along.floor().clamp(0.0, (count - 2.0).max(0.0));
        (first as u32, along - first)
    });
    let mut sum = [0.0; N];
    for (across, along, weight) in [
        (0, 0, (1.0 - right) * (1.0 - down)),
        (1, 0, right * (1.0 - down)),
        (0, 1, (1.0 - right) * down),
        (1, 1, right * down),
    ] {
        let sample = grid.at(column + across, row + along)?;
        for (total, value) in sum.iter_mut().zip(sample) {
            *total += f64::from(value) * weight;
        }
    }
    Some(sum)
}
