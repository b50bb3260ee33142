//! Twin of shared/colour.wgsl: processed colours as words.
//! In: red, green, blue, alpha 0…1. Out: four bytes, red lowest; a colour without coverage is the word 0.

/// Red, green, blue, alpha of a word, 0…1.
pub(crate) fn unpack(word: u32) -> [f32; 4] {
    [word, word >> 8, word >> 16, word >> 24].map(|byte| (byte & 255) as f32 / 255.0)
}

/// The word of a colour; components are cut to 0…1 and rounded to the nearest byte.
pub(crate) fn pack([red, green, blue]: [f32; 3], alpha: f32) -> u32 {
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u32;
    let coverage = byte(alpha);
    let word = byte(red) | byte(green) << 8 | byte(blue) << 16 | coverage << 24;
    if coverage == 0 { 0 } else { word }
}

/// As WGSL's mix.
pub(crate) fn mix(from: f32, to: f32, share: f32) -> f32 {
    from * (1.0 - share) + to * share
}

/// [`mix`] of the first three components.
pub(crate) fn mix_colours(from: [f32; 4], to: [f32; 4], share: f32) -> [f32; 3] {
    [0, 1, 2].map(|part| mix(from[part], to[part], share))
}
