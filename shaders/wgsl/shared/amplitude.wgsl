// What the radar mappings share: their uniform, the cut of amplitudes to a range, tinted greys.
// In: words of amplitudes. Out: 0…1, and words of colours. Twin: cpu/support/amplitude.rs.

struct Sar {
    // Amplitudes shown as 0 and 1.
    lowest: f32,
    highest: f32,
    // c of eq. 2.4 and γ of eq. 2.5 (Lambers 2011).
    strength: f32,
    exponent: f32,
    tint: vec4<f32>,
}

// The amplitude in its range, 0…1. Holes are read as 0 here and taken out by `tinted`.
fn normalised_amplitude(sar: Sar, word: u32) -> f32 {
    let amplitude = bitcast<f32>(select(word, 0u, word == INVALID));
    let range = max(sar.highest - sar.lowest, 1e-20);
    return clamp((amplitude - sar.lowest) / range, 0.0, 1.0);
}

// The word of a grey 0…1; that of a hole, for a hole.
fn tinted(sar: Sar, grey: f32, word: u32) -> u32 {
    return select(pack_colour(grey * sar.tint.rgb, 1.0), 0u, word == INVALID);
}
