// Heights to light and shade: the cosine between the ground's normal and the light (Horn 1981).
// In: a slot of fused heights. Out: a slot of greys, not gamma encoded, as maps have it; 0 where the ground
// turns away. CPU twin: cpu/hillshade.rs.

#import shared::slot
#import shared::colour
#import shared::cube
#import shared::tangent

struct Hillshade {
    tile: TileGeometry,
    // Unit vector to the light along east, north, up.
    light: vec3<f32>,
    // Factor on slopes.
    exaggeration: f32,
}

@group(0) @binding(0) var<uniform> parameters: Hillshade;
@group(0) @binding(1) var result: texture_storage_2d<r32uint, write>;
@group(0) @binding(2) var input_0: texture_2d<u32>;

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= SLOT_SIDE || id.y >= SLOT_SIDE { return; }
    let texel = vec2<i32>(id.xy);
    let word = textureLoad(input_0, texel, 0).x;
    let frame = tangent_frame(parameters.tile, texel - 9);
    let normal = surface_normal(frame, differences(input_0, texel, word));
    let tilt = east_north(frame, normal.xy) * parameters.exaggeration;
    let length = sqrt(tilt.x * tilt.x + tilt.y * tilt.y + normal.z * normal.z);
    let light = parameters.light;
    let shade = (tilt.x * light.x + tilt.y * light.y + normal.z * light.z) / length;
    textureStore(result, id.xy, vec4<u32>(select(pack_colour(vec3<f32>(shade), 1.0), 0u, word == INVALID)));
}
