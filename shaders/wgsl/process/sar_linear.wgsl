// Radar amplitude to grey, linear: g = a / t (Lambers 2011, eq. 2.3); t is the upper end of the range.
// In: a slot of amplitudes. Out: a slot of tinted greys. CPU twin: cpu/sar_linear.rs.

#import shared::slot
#import shared::colour
#import shared::amplitude

@group(0) @binding(0) var<uniform> parameters: Sar;
@group(0) @binding(1) var result: texture_storage_2d<r32uint, write>;
@group(0) @binding(2) var input_0: texture_2d<u32>;

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= SLOT_SIDE || id.y >= SLOT_SIDE { return; }
    let word = textureLoad(input_0, id.xy, 0).x;
    let amplitude = normalised_amplitude(parameters, word);
    let grey = amplitude;
    textureStore(result, id.xy, vec4<u32>(tinted(parameters, grey, word)));
}
