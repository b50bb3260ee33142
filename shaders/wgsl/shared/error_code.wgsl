// Errors in 16 bits: a number with eleven leading bits, rounded up. Codes compare as what they stand for.
// In: units, below 2^31. Out: codes. Twin: node/terrain/src/refine/code.rs.

fn code_up(value: u32) -> u32 {
    let shift = u32(max(i32(firstLeadingBit(value)) - 10, 0));
    let rounded = (value + (1u << shift) - 1u) >> shift;
    return (shift << 10u) + rounded;
}

fn decode(code: u32) -> u32 {
    let shift = u32(max(i32(code >> 10u) - 1, 0));
    return (code - (shift << 10u)) << shift;
}
