// Positions as 64-bit fixed point (steps of 2^-20 m) in pairs of u32, and their exact difference.
// In: two points. Out: the vector between them in metres, f32. Integers only until the last step, so no
// compiler's liberty with floats can move a vertex, and tiles that share a point get the same bits.

// One component of a − b in metres; `low` and `high` are the words of two's complement numbers.
fn fixed_difference(a_low: u32, a_high: u32, b_low: u32, b_high: u32) -> f32 {
    let borrow = select(0u, 1u, a_low < b_low);
    var low = a_low - b_low;
    var high = a_high - b_high - borrow;
    let negative = (high & 0x80000000u) != 0u;
    if negative {
        low = ~low + 1u;
        high = ~high + select(0u, 1u, low == 0u);
    }
    let metres = f32(high) * 4096.0 + f32(low) * (1.0 / 1048576.0);
    return select(metres, -metres, negative);
}
