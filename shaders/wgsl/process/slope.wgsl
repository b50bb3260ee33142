// Heights to colours of steepness, linear in the angle from the horizontal.
// In: a slot of fused heights. Out: a slot of colours. CPU twin: cpu/slope.rs.

#import shared::slot
#import shared::colour
#import shared::cube
#import shared::tangent

struct Slope {
    tile: TileGeometry,
    gentle: vec4<f32>,
    steep: vec4<f32>,
    // The angles of both colours.
    range_deg: vec2<f32>,
    padding_0: u32,
    padding_1: u32,
}

@group(0) @binding(0) var<uniform> parameters: Slope;
@group(0) @binding(1) var result: texture_storage_2d<r32uint, write>;
@group(0) @binding(2) var input_0: texture_2d<u32>;

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= SLOT_SIDE || id.y >= SLOT_SIDE { return; }
    let texel = vec2<i32>(id.xy);
    let word = textureLoad(input_0, texel, 0).x;
    let frame = tangent_frame(parameters.tile, texel - 9);
    let normal = surface_normal(frame, differences(input_0, texel, word));
    let horizontal = sqrt(normal.x * normal.x + normal.y * normal.y);
    let angle_deg = degrees(atan2(horizontal, normal.z));
    let range = parameters.range_deg;
    let share = clamp((angle_deg - range.x) / max(range.y - range.x, 1e-6), 0.0, 1.0);
    let colour = parameters.gentle.rgb * (1.0 - share) + parameters.steep.rgb * share;
    textureStore(result, id.xy, vec4<u32>(select(pack_colour(colour, 1.0), 0u, word == INVALID)));
}
