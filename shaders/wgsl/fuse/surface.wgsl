// Fused colour over bare ground: what the terrain shader samples.
// In: a slot of fused colours. Out: one layer of the colour texture array, opaque, one border node kept.
// CPU twin: cpu/surface.rs.

#import shared::colour

struct Surface {
    ground: vec4<f32>,
    layer: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
}

const LAYER_SIDE: u32 = 259u;

@group(0) @binding(0) var<uniform> parameters: Surface;
@group(0) @binding(1) var result: texture_storage_2d_array<rgba8unorm, write>;
@group(0) @binding(2) var input_0: texture_2d<u32>;

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= LAYER_SIDE || id.y >= LAYER_SIDE { return; }
    let fused = unpack_colour(textureLoad(input_0, id.xy + 8u, 0).x);
    let colour = parameters.ground.rgb * (1.0 - fused.a) + fused.rgb * fused.a;
    textureStore(result, id.xy, parameters.layer, vec4<f32>(colour, 1.0));
}
