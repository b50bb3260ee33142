// Light: from the bytes of pictures to linear light and back, and what blending does to a channel on the way.
// In: linear colours, maps of what each pixel keeps and what is added. Out: values for the display.

// What a channel's pixels have in common. Field for field as in layout/output.rs.
struct Finish {
    // Where the channel's first pixel lies in the target.
    place: vec2<i32>,
    // Exponent of the display; 0 for the sRGB curve.
    gamma: f32,
    // 1 where the channel has maps of light.
    has_light: u32,
    // How black is lifted: 1 and 1 lift the whole range, as MPCDI wants it.
    dark: f32,
    bright: f32,
    padding: vec2<u32>,
}

// IEC 61966-2-1.
fn to_light(value: vec3<f32>) -> vec3<f32> {
    let low = value / 12.92;
    let high = pow((max(value, vec3<f32>(0.0)) + 0.055) / 1.055, vec3<f32>(2.4));
    return select(high, low, value <= vec3<f32>(0.04045));
}

fn to_value(light: vec3<f32>, gamma: f32) -> vec3<f32> {
    let cut = clamp(light, vec3<f32>(0.0), vec3<f32>(1.0));
    if gamma > 0.0 { return pow(cut, vec3<f32>(1.0 / gamma)); }
    let low = cut * 12.92;
    let high = 1.055 * pow(cut, vec3<f32>(1.0 / 2.4)) - 0.055;
    return select(high, low, cut <= vec3<f32>(0.0031308));
}

// A pixel keeps the share `alpha` of its light; `beta` is the black level that it is raised to: the whole range of it
// (VESA MPCDI 1.0), or what lies below (VIOSO), or something between.
fn blended(light: vec3<f32>, alpha: vec3<f32>, beta: vec3<f32>, finish: Finish) -> vec3<f32> {
    let lifted = light * alpha * (vec3<f32>(1.0) - finish.dark * finish.bright * beta) + finish.dark * beta;
    return max(lifted, beta);
}
