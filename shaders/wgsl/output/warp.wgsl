// Puts a picture that was drawn on a plane onto a curved screen: each pixel of the output looks for the point of the
// screen that it lights, and takes the colour that is seen there from the eye.
// In: points in room metres, the picture, maps of light. Out: the channel's pixels, blended in linear light.

#import shared::light

// Field for field as in layout/output.rs.
struct Warp {
    finish: Finish,
    // The eye in room metres.
    eye: vec4<f32>,
    // Products with a direction from the eye: pixels to the right times depth, pixels down times depth, depth.
    across: vec4<f32>,
    down: vec4<f32>,
    ahead: vec4<f32>,
    // Pixels of the picture that hold something, and of its whole texture.
    picture_size: vec2<f32>,
    texture_size: vec2<f32>,
}

@group(0) @binding(0) var<uniform> warp: Warp;
// Metres; the fourth component is 0 where the pixel lights nothing.
@group(0) @binding(1) var points: texture_2d<f32>;
// Decoded to linear light by its format.
@group(0) @binding(2) var picture: texture_2d<f32>;
@group(0) @binding(3) var bilinear: sampler;
// Layer 0: the share of light that a pixel keeps; layer 1: its black level.
@group(0) @binding(4) var light: texture_2d_array<f32>;

@vertex
fn vertex_main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let corner = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
    return vec4<f32>(corner * 2.0 - 1.0, 0.0, 1.0);
}

@fragment
fn fragment_main(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy) - warp.finish.place;
    let point = textureLoad(points, pixel, 0);
    let direction = point.xyz - warp.eye.xyz;
    let depth = dot(warp.ahead.xyz, direction);
    let place = vec2<f32>(dot(warp.across.xyz, direction), dot(warp.down.xyz, direction)) / depth;
    let inside = clamp(place, vec2<f32>(0.5), warp.picture_size - 0.5);
    var seen = textureSampleLevel(picture, bilinear, inside / warp.texture_size, 0.0).xyz;
    if point.w == 0.0 || depth <= 0.0 { seen = vec3<f32>(0.0); }
    if warp.finish.has_light != 0u {
        seen = blended(seen, textureLoad(light, pixel, 0, 0).xyz, textureLoad(light, pixel, 1, 0).xyz,
            warp.finish);
    }
    return vec4<f32>(to_value(seen, warp.finish.gamma), 1.0);
}
