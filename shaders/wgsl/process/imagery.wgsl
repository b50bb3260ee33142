// Raw colours to colours: exposure, contrast, saturation, gamma, tint, in that order.
// In: a slot of raw colours, 10 bits a channel, gamma encoded with exponent 2 (light is the code's square).
// Out: a slot of colours; parameters that change nothing give the codes, rounded. CPU twin: cpu/imagery.rs.

#import shared::slot
#import shared::colour

struct Imagery {
    // Factor on light.
    gain: f32,
    contrast: f32,
    saturation: f32,
    inverse_gamma: f32,
    tint: vec4<f32>,
}

// Luma of red, green and blue (ITU-R BT.709-6, item 3.2).
const LUMA: vec3<f32> = vec3<f32>(0.2126, 0.7152, 0.0722);

@group(0) @binding(0) var<uniform> parameters: Imagery;
@group(0) @binding(1) var result: texture_storage_2d<r32uint, write>;
@group(0) @binding(2) var input_0: texture_2d<u32>;

// from · (1 − share) + to · share: for a share of 1 exactly `to`.
fn between(from_code: f32, to_code: vec3<f32>, share: f32) -> vec3<f32> {
    return from_code * (1.0 - share) + to_code * share;
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= SLOT_SIDE || id.y >= SLOT_SIDE { return; }
    let word = textureLoad(input_0, id.xy, 0).x;
    let raw = vec3<f32>(vec3<u32>(word, word >> 10u, word >> 20u) & vec3<u32>(1023u)) / 1023.0;
    let exposed = raw * sqrt(parameters.gain);
    let contrasted = between(0.5, exposed, parameters.contrast);
    let luma = contrasted.r * LUMA.r + contrasted.g * LUMA.g + contrasted.b * LUMA.b;
    let saturated = between(luma, contrasted, parameters.saturation);
    var codes = clamp(saturated, vec3<f32>(0.0), vec3<f32>(1.0));
    // Powers are not exact on a device, and the exponent 1 is the rule.
    if parameters.inverse_gamma != 1.0 {
        codes = select(vec3<f32>(0.0), pow(codes, vec3<f32>(parameters.inverse_gamma)), codes > vec3<f32>(0.0));
    }
    let tinted = pack_colour(codes * parameters.tint.rgb, 1.0);
    textureStore(result, id.xy, vec4<u32>(select(tinted, 0u, (word >> 30u) == 0u)));
}
