// Heights to colours, linear between stops.
// In: a slot of fused heights. Out: a slot of colours; below the first and above the last stop its colour.
// CPU twin: cpu/ramp.rs.

#import shared::slot
#import shared::colour

struct Ramp {
    count: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
    // Stop n is component n mod 4 of vector n / 4.
    heights: array<vec4<f32>, 8>,
    colours: array<vec4<u32>, 8>,
}

@group(0) @binding(0) var<uniform> parameters: Ramp;
@group(0) @binding(1) var result: texture_storage_2d<r32uint, write>;
@group(0) @binding(2) var input_0: texture_2d<u32>;

fn stop_height(stop: u32) -> f32 {
    return parameters.heights[stop / 4u][stop % 4u];
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= SLOT_SIDE || id.y >= SLOT_SIDE { return; }
    let word = textureLoad(input_0, id.xy, 0).x;
    let here = bitcast<f32>(select(word, 0u, word == INVALID));
    let last = clamp(parameters.count, 1u, 32u) - 1u;
    // The highest stop that is not above, found by halving; the first where all are above.
    var lower = 0u;
    for (var step = 16u; step > 0u; step = step >> 1u) {
        let candidate = lower + step;
        let fits = candidate <= last && stop_height(min(candidate, 31u)) <= here;
        lower = select(lower, candidate, fits);
    }
    let upper = min(lower + 1u, last);
    let lower_m = stop_height(lower);
    let rise = max(stop_height(upper) - lower_m, 1e-20);
    let share = clamp((here - lower_m) / rise, 0.0, 1.0);
    let from_colour = unpack_colour(parameters.colours[lower / 4u][lower % 4u]);
    let to_colour = unpack_colour(parameters.colours[upper / 4u][upper % 4u]);
    let colour = from_colour * (1.0 - share) + to_colour * share;
    textureStore(result, id.xy, vec4<u32>(select(pack_colour(colour.rgb, colour.a), 0u, word == INVALID)));
}
