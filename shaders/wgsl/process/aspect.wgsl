// Heights to colours of the direction of descent: north red, then clockwise through the hues.
// In: a slot of fused heights. Out: a slot of colours; flat ground has none. CPU twin: cpu/aspect.rs.

#import shared::slot
#import shared::colour
#import shared::cube
#import shared::tangent

struct Aspect {
    tile: TileGeometry,
    saturation: f32,
    brightness: f32,
    // Sine of the steepness up to which ground is flat.
    flat_sine: f32,
    padding_0: u32,
}

@group(0) @binding(0) var<uniform> parameters: Aspect;
@group(0) @binding(1) var result: texture_storage_2d<r32uint, write>;
@group(0) @binding(2) var input_0: texture_2d<u32>;

// The colour of a hue given in turns (Smith 1978, the hexcone model).
fn hue(turn: f32, saturation: f32, brightness: f32) -> vec3<f32> {
    let position = turn + vec3<f32>(1.0, 2.0 / 3.0, 1.0 / 3.0);
    let place = position - floor(position);
    let pure = clamp(abs(place * 6.0 - 3.0) - 1.0, vec3<f32>(0.0), vec3<f32>(1.0));
    return brightness * (1.0 - saturation + pure * saturation);
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= SLOT_SIDE || id.y >= SLOT_SIDE { return; }
    let texel = vec2<i32>(id.xy);
    let word = textureLoad(input_0, texel, 0).x;
    let frame = tangent_frame(parameters.tile, texel - 9);
    let normal = surface_normal(frame, differences(input_0, texel, word));
    let is_flat = sqrt(normal.x * normal.x + normal.y * normal.y) <= parameters.flat_sine;
    // An upward normal leans to where the ground falls.
    let descent = east_north(frame, normal.xy);
    // Flat ground has no direction, and the arc tangent of nothing no value.
    let turn = atan2(select(descent.x, 0.0, is_flat), select(descent.y, 1.0, is_flat)) / 6.2831853071795864;
    let colour = pack_colour(hue(turn, parameters.saturation, parameters.brightness), 1.0);
    textureStore(result, id.xy, vec4<u32>(select(colour, 0u, is_flat || word == INVALID)));
}
