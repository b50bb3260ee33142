// Puts the pictures of both eyes into one output.
// In: two pictures of the output's size, how they share it. Out: the output's pixels.

#import shared::light

// Field for field as in layout/output.rs.
struct Stereo {
    // As render's StereoMode: 0 side by side, 1 top and bottom, 2 by colour, 3 by rows, 4 by columns, 5 checkerboard.
    mode: u32,
    // 1 where each picture takes the other's place.
    swapped: u32,
    size: vec2<u32>,
    // By colour: 1 for each component that is the left eye's. Then the exponent of the display; 0 for the sRGB curve.
    left: vec4<f32>,
}

@group(0) @binding(0) var<uniform> stereo: Stereo;
@group(0) @binding(1) var left_picture: texture_2d<f32>;
@group(0) @binding(2) var right_picture: texture_2d<f32>;

@vertex
fn vertex_main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let corner = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
    return vec4<f32>(corner * 2.0 - 1.0, 0.0, 1.0);
}

fn eye_at(pixel: vec2<u32>, right: bool) -> vec3<f32> {
    let at = min(pixel, stereo.size - 1u);
    if right != (stereo.swapped != 0u) { return textureLoad(right_picture, at, 0).xyz; }
    return textureLoad(left_picture, at, 0).xyz;
}

// The mean light of two pixels: half as many must stand for all.
fn mean(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    let gamma = stereo.left.w;
    if gamma > 0.0 { return to_value(0.5 * (pow(a, vec3<f32>(gamma)) + pow(b, vec3<f32>(gamma))), gamma); }
    return to_value(0.5 * (to_light(a) + to_light(b)), 0.0);
}

@fragment
fn fragment_main(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy);
    var seen = vec3<f32>(0.0);
    switch stereo.mode {
        case 0u: {
            let half_width = stereo.size.x / 2u;
            let right = pixel.x >= half_width;
            let at = vec2<u32>(2u * (pixel.x - select(0u, half_width, right)), pixel.y);
            seen = mean(eye_at(at, right), eye_at(at + vec2<u32>(1u, 0u), right));
        }
        case 1u: {
            let half_height = stereo.size.y / 2u;
            let right = pixel.y >= half_height;
            let at = vec2<u32>(pixel.x, 2u * (pixel.y - select(0u, half_height, right)));
            seen = mean(eye_at(at, right), eye_at(at + vec2<u32>(0u, 1u), right));
        }
        case 2u: {
            seen = select(eye_at(pixel, true), eye_at(pixel, false), stereo.left.xyz > vec3<f32>(0.5));
        }
        case 3u: { seen = eye_at(pixel, (pixel.y & 1u) != 0u); }
        case 4u: { seen = eye_at(pixel, (pixel.x & 1u) != 0u); }
        default: { seen = eye_at(pixel, ((pixel.x + pixel.y) & 1u) != 0u); }
    }
    return vec4<f32>(seen, 1.0);
}
