// Whole numbers of 64 bits, two's complement, as pairs of words, the low one first.
// In: words. Out: sums, products and shifts that wrap. Twin: i64 in node/terrain/src/refine/emit.rs.

fn wide(value: i32) -> vec2<u32> {
    return vec2<u32>(u32(value), u32(value >> 31u));
}

fn wide_sum(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn wide_product(a: i32, b: i32) -> vec2<u32> {
    let a_low = u32(a) & 0xFFFFu;
    let a_high = u32(a) >> 16u;
    let b_low = u32(b) & 0xFFFFu;
    let b_high = u32(b) >> 16u;
    let low = a_low * b_low;
    let middle = a_high * b_low + (low >> 16u);
    let cross = a_low * b_high + (middle & 0xFFFFu);
    let high = a_high * b_high + (middle >> 16u) + (cross >> 16u);
    // As of numbers without sign; each negative factor counts 2^32 too much of the other.
    let excess = select(0u, u32(b), a < 0) + select(0u, u32(a), b < 0);
    return vec2<u32>((cross << 16u) | (low & 0xFFFFu), high - excess);
}

// value · 2^shift for shifts of −31…31, rounded to the nearest, halves up.
fn wide_shifted(value: vec2<u32>, shift: i32) -> vec2<u32> {
    let left = u32(clamp(shift, 0, 31));
    let right = u32(clamp(-shift, 0, 31));
    // What a shift by 32 would bring over from the other word is none.
    let up = vec2<u32>(value.x << left, (value.y << left) | ((value.x >> 1u) >> (31u - left)));
    let half = select(0u, 1u << ((right - 1u) & 31u), right > 0u);
    let sum = wide_sum(up, vec2<u32>(half, 0u));
    return vec2<u32>((sum.x >> right) | ((sum.y << 1u) << (31u - right)), u32(i32(sum.y) >> right));
}
