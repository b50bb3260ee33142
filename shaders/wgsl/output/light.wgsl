// Blends a channel that is shown pixel for pixel, and turns it into the display's values.
// In: its picture, maps of light. Out: the channel's pixels.

#import shared::light

// Field for field as in layout/output.rs.
struct Lit {
    finish: Finish,
    // What leads from a pixel of the target to the picture's.
    to_picture: vec2<i32>,
    padding: vec2<i32>,
}

@group(0) @binding(0) var<uniform> lit: Lit;
@group(0) @binding(1) var picture: texture_2d<f32>;
// Layer 0: the share of light that a pixel keeps; layer 1: its black level.
@group(0) @binding(2) var light: texture_2d_array<f32>;

@vertex
fn vertex_main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let corner = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
    return vec4<f32>(corner * 2.0 - 1.0, 0.0, 1.0);
}

@fragment
fn fragment_main(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<i32>(position.xy);
    let pixel = at - lit.finish.place;
    var seen = to_light(textureLoad(picture, at + lit.to_picture, 0).xyz);
    if lit.finish.has_light != 0u {
        seen = blended(seen, textureLoad(light, pixel, 0, 0).xyz, textureLoad(light, pixel, 1, 0).xyz,
            lit.finish);
    }
    return vec4<f32>(to_value(seen, lit.finish.gamma), 1.0);
}
