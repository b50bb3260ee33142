//! Twin of shared/tangent.wgsl and of what it uses of shared/cube.wgsl: surface normals in tangent frames.
//! In: a tile's place, a node, changes of height per sample. Out: unit normals, and where east is.

use crate::cpu::support::slot;
use crate::layout::TileGeometry;

/// The tangent frame of a node: e1 along the projected u axis, e2 = n × e1, n the ellipsoid's normal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    // Tangents for a step of one node, in metres: (a, 0) along u and (b, c) along v.
    a: f32,
    b: f32,
    c: f32,
    /// Components of east along e1 and e2.
    east: [f32; 2],
}

const U: [[f32; 3]; 6] = [
    [0.0, 1.0, 0.0],
    [-1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 0.0, -1.0],
    [0.0, 0.0, -1.0],
    [0.0, 1.0, 0.0],
];
const V: [[f32; 3]; 6] = [
    [0.0, 0.0, 1.0],
    [0.0, 0.0, 1.0],
    [0.0, -1.0, 0.0],
    [0.0, -1.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
];
const OUT: [[f32; 3]; 6] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [-1.0, 0.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, -1.0],
];

/// Cell coordinate, counted from the face's middle, to cube space.
fn centre_to_uv(d: f32) -> f32 {
    4.0 / 3.0 * d * (1.0 + d.abs())
}

/// Its derivative.
fn centre_to_uv_slope(d: f32) -> f32 {
    4.0 / 3.0 * (1.0 + 2.0 * d.abs())
}

/// The frame of node (i, j).
pub(crate) fn frame(tile: &TileGeometry, [i, j]: [i32; 2]) -> Frame {
    let s = tile.from_centre[0] + i as f32 * tile.step;
    let t = tile.from_centre[1] + j as f32 * tile.step;
    let (u, v) = (centre_to_uv(s), centre_to_uv(t));
    let inverse = 1.0 / (1.0 + u * u + v * v).sqrt();
    let (along_u, along_v) = (u * inverse, v * inverse);
    let per_u = centre_to_uv_slope(s) * tile.step * inverse * tile.radius_m;
    let per_v = centre_to_uv_slope(t) * tile.step * inverse * tile.radius_m;
    let length_u = (1.0 - along_u * along_u).sqrt();
    let rest =
        1.0 - along_v * along_v - along_u * along_u * along_v * along_v / (length_u * length_u);
    // East is Z × n; its products with e1 and e2, up to one factor, by the rules of triple products.
    let face = tile.face.min(5) as usize;
    let [ux, uy, uz] = U[face];
    let n =
        [0, 1, 2].map(|axis| (OUT[face][axis] + u * U[face][axis] + v * V[face][axis]) * inverse);
    let east = [n[0] * uy - n[1] * ux, n[2] * along_u - uz];
    let length = (east[0] * east[0] + east[1] * east[1]).sqrt();
    Frame {
        a: per_u * length_u,
        b: per_v * (-along_u * along_v) / length_u,
        c: per_v * rest.max(0.0).sqrt(),
        // At a pole every direction is as good.
        east: if length > 0.0 {
            [east[0] / length, east[1] / length]
        } else {
            [1.0, 0.0]
        },
    }
}

impl Frame {
    /// The surface's unit normal along e1, e2, n for these changes of height per sample along u and v.
    pub(crate) fn normal(&self, [rise_u, rise_v]: [f32; 2]) -> [f32; 3] {
        let x = -rise_u * self.c;
        let y = rise_u * self.b - rise_v * self.a;
        let z = self.a * self.c;
        let length = (x * x + y * y + z * z).sqrt();
        [x / length, y / length, z / length]
    }

    /// A vector along e1, e2 as components along east and north.
    pub(crate) fn east_north(&self, x: f32, y: f32) -> [f32; 2] {
        let [cosine, sine] = self.east;
        [x * cosine + y * sine, y * cosine - x * sine]
    }
}

/// The frame and the unit normal at a texel of the first input, a slot of heights.
pub(crate) fn surface(
    tile: &TileGeometry,
    inputs: &[&[u32]],
    [x, y]: [i32; 2],
) -> (Frame, [f32; 3]) {
    let frame = frame(tile, [x - 9, y - 9]);
    (frame, frame.normal(slot::differences(inputs, [x, y])))
}
