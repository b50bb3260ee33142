// Processed colours as words: four bytes, red lowest, alpha (coverage) highest, not premultiplied.
// In: components 0…1. Out: words; a colour without coverage is the word 0. Twin: cpu/support/colour.rs.

fn unpack_colour(word: u32) -> vec4<f32> {
    let bytes = vec4<u32>(word, word >> 8u, word >> 16u, word >> 24u) & vec4<u32>(255u);
    return vec4<f32>(bytes) / 255.0;
}

// Components are cut to 0…1 and rounded to the nearest byte.
fn pack_colour(colour: vec3<f32>, alpha: f32) -> u32 {
    let bytes = vec4<u32>(clamp(vec4<f32>(colour, alpha), vec4<f32>(0.0), vec4<f32>(1.0)) * 255.0 + 0.5);
    let word = bytes.x | (bytes.y << 8u) | (bytes.z << 16u) | (bytes.w << 24u);
    return select(word, 0u, bytes.w == 0u);
}
