//! 16-bit codes of deviations: a logarithmic scale with 1024 steps an octave, exact below 2048.
//! In: whole units of height. Out: a code that compares as the units do, and back. Errors round up and allowances
//! down, so that comparing codes never lets more stay than comparing units would.

/// Codes an octave, and the octave at which they begin to round.
const STEPS: u32 = 1024;

/// The code of the smallest representable number that is not below `units`.
///
/// Below 1024 the code is the number; else with s = ⌊log₂ units⌋ − 10 it is 1024 s + units / 2^s, rounded. It is
/// monotone, and exact below 2048. Pyramids and allowances keep below 2^31; all others have a code too.
#[must_use]
pub const fn code_up(units: u32) -> u16 {
    let shift = shift(units);
    let rest = units & ((1 << shift) - 1);
    let rounded = (units >> shift) + (rest > 0) as u32;
    (shift * STEPS + rounded) as u16
}

/// The code of the largest representable number that is not above `units`: as [`code_up`], rounded down.
#[must_use]
pub const fn code_down(units: u32) -> u16 {
    let shift = shift(units);
    (shift * STEPS + (units >> shift)) as u16
}

/// The number of units that a code stands for; codes of more than 32 bits stand for the largest `u32`.
#[must_use]
pub const fn decode(code: u16) -> u32 {
    let code = code as u32;
    if code < 2 * STEPS {
        return code;
    }
    let shift = code / STEPS - 1;
    let units = ((code - shift * STEPS) as u128) << shift;
    if units > u32::MAX as u128 {
        u32::MAX
    } else {
        units as u32
    }
}

/// Binary places that a number loses in its code.
const fn shift(units: u32) -> u32 {
    (u32::BITS - units.leading_zeros()).saturating_sub(11)
}
