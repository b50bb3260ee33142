// Elevation to relief: per lattice node the surface normal in the node's own tangent frame.
// In: heights of one tile with border, in quanta. Out: one layer of the relief texture array, one border
// node kept: x and y of the unit normal, each as the root of its size with its sign, so that gentle slopes
// keep the finest steps. The tangent frame's first axis follows u, its third the ellipsoid's normal. CPU
// twin: cpu/relief.rs.

#import shared::cube

struct Relief {
    // Cell coordinates of node (0, 0), and the step from node to node.
    origin: vec2<f32>,
    step: f32,
    // Metres in a quantum, and the planet's mean radius in metres.
    quantum_m: f32,
    radius_m: f32,
    face: u32,
    layer: u32,
    // Where the tile's heights begin in the buffer, in words.
    first: u32,
}

const STORED: i32 = 275;
const BORDER: i32 = 9;
const OUT_NODES: u32 = 259u;
const INVALID: i32 = -2147483647 - 1;

@group(0) @binding(0) var<storage, read> heights: array<i32>;
@group(0) @binding(1) var<storage, read> reliefs: array<Relief>;
@group(0) @binding(2) var relief_layers: texture_storage_2d_array<rgba8snorm, write>;

fn height(first: u32, i: i32, j: i32) -> i32 {
    return heights[first + u32((j + BORDER) * STORED + i + BORDER)];
}

// Central difference in quanta per node; one-sided beside a hole; 0 inside one.
fn slope(before: i32, here: i32, after: i32) -> f32 {
    if here == INVALID { return 0.0; }
    if before == INVALID && after == INVALID { return 0.0; }
    if before == INVALID { return f32(after - here); }
    if after == INVALID { return f32(here - before); }
    return 0.5 * f32(after - before);
}

fn encode(value: f32) -> f32 {
    return sign(value) * sqrt(abs(value));
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= OUT_NODES || id.y >= OUT_NODES { return; }
    let tile = reliefs[id.z];
    let i = i32(id.x) - 1;
    let j = i32(id.y) - 1;
    let s = tile.origin.x + f32(i) * tile.step;
    let t = tile.origin.y + f32(j) * tile.step;
    let u = st_to_uv(s);
    let v = st_to_uv(t);
    // Tangents of the unit normal n = c/|c|, c = out + u·U + v·V, for a step of one node.
    let inverse = inverseSqrt(1.0 + u * u + v * v);
    let along_u = u * inverse;
    let along_v = v * inverse;
    let per_u = st_to_uv_slope(s) * tile.step * inverse * tile.radius_m;
    let per_v = st_to_uv_slope(t) * tile.step * inverse * tile.radius_m;
    // In the frame (e1 ∥ projected U, e2 = n × e1, n): tangent_u = (a, 0), tangent_v = (b, c).
    let length_u = sqrt(1.0 - along_u * along_u);
    let a = per_u * length_u;
    let b = per_v * (-along_u * along_v) / length_u;
    let c = per_v * sqrt(max(1.0 - along_v * along_v - along_u * along_u * along_v * along_v / (length_u * length_u), 0.0));
    let here = height(tile.first, i, j);
    let rise_u = tile.quantum_m * slope(height(tile.first, i - 1, j), here, height(tile.first, i + 1, j));
    let rise_v = tile.quantum_m * slope(height(tile.first, i, j - 1), here, height(tile.first, i, j + 1));
    let normal = normalize(vec3<f32>(-rise_u * c, rise_u * b - rise_v * a, a * c));
    let texel = vec4<f32>(encode(normal.x), encode(normal.y), 0.0, 0.0);
    textureStore(relief_layers, vec2<u32>(id.x, id.y), tile.layer, texel);
}
