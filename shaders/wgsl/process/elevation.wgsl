// Raw heights to heights: datum shift, exaggeration, offset, clamp.
// In: a slot of heights in metres. Out: clamp((h + datum shift) · scale + offset); holes stay holes.
// CPU twin: cpu/elevation.rs.

#import shared::slot

struct Elevation {
    scale: f32,
    datum_shift_m: f32,
    offset_m: f32,
    lowest_m: f32,
    highest_m: f32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
}

@group(0) @binding(0) var<uniform> parameters: Elevation;
@group(0) @binding(1) var result: texture_storage_2d<r32uint, write>;
@group(0) @binding(2) var input_0: texture_2d<u32>;

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= SLOT_SIDE || id.y >= SLOT_SIDE { return; }
    let word = textureLoad(input_0, id.xy, 0).x;
    let raw_m = bitcast<f32>(select(word, 0u, word == INVALID));
    let moved = (raw_m + parameters.datum_shift_m) * parameters.scale + parameters.offset_m;
    let height_m = min(max(moved, parameters.lowest_m), parameters.highest_m);
    textureStore(result, id.xy, vec4<u32>(select(bitcast<u32>(height_m), INVALID, word == INVALID)));
}
