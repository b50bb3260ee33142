// An ancestor's samples on a finer tile's lattice: the ancestor's nodes as they are, means in between.
// In: the ancestor's slot of numbers or raw colours. Out: the tile's slot: bilinear over those of the four
// nodes that are valid, a hole where none is. Places are integers. CPU twin: cpu/resample.rs.

#import shared::slot

struct Resample {
    // Node (0, 0) of the result in the ancestor's lattice, in steps of 2^-shift of its cells.
    origin: vec2<i32>,
    shift: u32,
    // 0: numbers (f32 bits); 1: raw colours (10:10:10:2).
    form: u32,
}

@group(0) @binding(0) var<uniform> parameters: Resample;
@group(0) @binding(1) var result: texture_storage_2d<r32uint, write>;
@group(0) @binding(2) var input_0: texture_2d<u32>;

fn load(texel: vec2<i32>) -> u32 {
    return textureLoad(input_0, clamp(texel, vec2<i32>(0), vec2<i32>(LAST)), 0).x;
}

fn mean(values: vec4<f32>, weights: vec4<f32>, sum: f32) -> f32 {
    let weighted = values * weights;
    return (weighted.x + weighted.y + weighted.z + weighted.w) / sum;
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= SLOT_SIDE || id.y >= SLOT_SIDE { return; }
    let shift = min(parameters.shift, 22u);
    let fine = parameters.origin + vec2<i32>(id.xy) - 9;
    let corner = (fine >> vec2<u32>(shift)) + 9;
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
    let raw_colours = parameters.form == 1u;
    let holes = select(words == vec4<u32>(INVALID), (words >> vec4<u32>(30u)) == vec4<u32>(0u), raw_colours);
    let weights = select(bilinear, vec4<f32>(0.0), holes);
    let sum = weights.x + weights.y + weights.z + weights.w;
    var word = select(INVALID, 0u, raw_colours);
    if sum > 0.0 {
        if raw_colours {
            let red = u32(mean(vec4<f32>(words & vec4<u32>(1023u)), weights, sum) + 0.5);
            let green = u32(mean(vec4<f32>((words >> vec4<u32>(10u)) & vec4<u32>(1023u)), weights, sum) + 0.5);
            let blue = u32(mean(vec4<f32>((words >> vec4<u32>(20u)) & vec4<u32>(1023u)), weights, sum) + 0.5);
            word = red | (green << 10u) | (blue << 20u) | (3u << 30u);
        } else {
            let numbers = bitcast<vec4<f32>>(select(words, vec4<u32>(0u), holes));
            word = bitcast<u32>(mean(numbers, weights, sum));
        }
    }
    textureStore(result, id.xy, vec4<u32>(word));
}
