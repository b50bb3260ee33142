// Heights of a leaf's nodes in units.
// In: fused heights of the leaf's tile or an ancestor's, border heights. Out: i32 units; holes are 0; between an
// ancestor's nodes the mean of process/resample.wgsl. Border nodes have what all leaves around agree on.
// CPU twin: shaders/src/cpu/leaf_heights.rs.

#import shared::slot

struct LeafHeights {
    // Node (0, 0) of the leaf in the input's lattice, in steps of 2^-shift of its cells.
    origin: vec2<i32>,
    shift: u32,
    // Units of height in a metre, a power of two.
    units_per_m: f32,
    // Slot in the geometry buffers.
    slot: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
}

// Whether nodes may lie between the input's. Else only one is read of it.
override RESAMPLED: bool = true;

const NODES: u32 = 66049u;
const BORDER_NODES: u32 = 1024u;
const BORDER_WORDS: u32 = 10u;
// The largest height in units.
const LARGEST: f32 = 134217728.0;

@group(0) @binding(0) var<uniform> parameters: LeafHeights;
@group(0) @binding(1) var input_0: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> borders: array<u32>;
@group(0) @binding(3) var<storage, read_write> heights: array<i32>;

fn load(texel: vec2<i32>) -> u32 {
    return textureLoad(input_0, clamp(texel, vec2<i32>(0), vec2<i32>(LAST)), 0).x;
}

// Place of a border node among them: rows 0 and 256, then the rest of columns 0 and 256.
fn border_index(node: vec2<u32>) -> u32 {
    let column = select(514u, 769u, node.x == 256u) + node.y - 1u;
    return select(select(column, 257u + node.x, node.y == 256u), node.x, node.y == 0u);
}

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= NODES { return; }
    // Division by 257: the quotient is this or one less, but for the last node's.
    var y = min(id.x >> 8u, 257u);
    y = select(y, y - 1u, y * 257u > id.x);
    let node = vec2<u32>(id.x - y * 257u, y);
    let shift = min(parameters.shift, 22u);
    let fine = parameters.origin + vec2<i32>(node);
    let corner = (fine >> vec2<u32>(shift)) + 9;
    var height_m = 0.0;
    if RESAMPLED {
        // 2^-shift by its bits: exact.
        let scale = bitcast<f32>((127u - shift) << 23u);
        let f = vec2<f32>(fine & vec2<i32>((1i << shift) - 1)) * scale;
        let words = vec4<u32>(
            load(corner),
            load(corner + vec2<i32>(1, 0)),
            load(corner + vec2<i32>(0, 1)),
            load(corner + vec2<i32>(1, 1)),
        );
        let bilinear = vec4<f32>((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
        let holes = words == vec4<u32>(INVALID);
        let weights = select(bilinear, vec4<f32>(0.0), holes);
        let sum = weights.x + weights.y + weights.z + weights.w;
        let weighted = bitcast<vec4<f32>>(select(words, vec4<u32>(0u), holes)) * weights;
        let mean = (weighted.x + weighted.y + weighted.z + weighted.w) / max(sum, 1e-30);
        height_m = select(0.0, mean, sum > 0.0);
    } else {
        let word = load(corner);
        height_m = bitcast<f32>(select(word, 0u, word == INVALID));
    }
    var units = i32(clamp(round(height_m * parameters.units_per_m), -LARGEST, LARGEST));
    if any(node == vec2<u32>(0u)) | any(node == vec2<u32>(256u)) {
        units = i32(borders[(parameters.slot * BORDER_NODES + border_index(node)) * BORDER_WORDS + 9u]);
    }
    heights[parameters.slot * NODES + id.x] = units;
}
