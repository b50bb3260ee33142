// Fused heights to relief: per lattice node the surface normal in the node's own tangent frame.
// In: a slot of fused heights. Out: one layer of the relief texture array, one border node kept: x and y of
// the unit normal, each as the root of its size with its sign, so that gentle slopes keep the finest steps.
// The tangent frame's first axis follows u, its third the ellipsoid's normal. CPU twin: cpu/relief.rs.

#import shared::slot
#import shared::cube
#import shared::tangent

struct Relief {
    tile: TileGeometry,
    layer: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
}

const LAYER_SIDE: u32 = 259u;

@group(0) @binding(0) var<uniform> parameters: Relief;
@group(0) @binding(1) var result: texture_storage_2d_array<rgba8snorm, write>;
@group(0) @binding(2) var input_0: texture_2d<u32>;

fn encode(value: vec2<f32>) -> vec2<f32> {
    return sign(value) * sqrt(abs(value));
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= LAYER_SIDE || id.y >= LAYER_SIDE { return; }
    let texel = vec2<i32>(id.xy) + 8;
    let word = textureLoad(input_0, texel, 0).x;
    let frame = tangent_frame(parameters.tile, texel - 9);
    let normal = surface_normal(frame, differences(input_0, texel, word));
    textureStore(result, id.xy, parameters.layer, vec4<f32>(encode(normal.xy), 0.0, 0.0));
}
