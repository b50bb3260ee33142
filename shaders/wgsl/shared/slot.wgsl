// Slots: textures of 275×275 words, and differences between neighbouring heights in them.
// In: words. Out: changes of height per sample that step around holes. Twin: cpu/support/slot.rs.

const SLOT_SIDE: u32 = 275u;
const LAST: i32 = 274;
// A height or amplitude that is not there. Compared as a word: as a float it is no number.
const INVALID: u32 = 0xFFFFFFFFu;

// Change of height per sample along one axis: the central difference; one-sided beside a hole and at the
// slot's edge (`inner` false), where cut coordinates make a neighbour the sample itself; 0 in a hole.
fn difference(before: u32, here: u32, after: u32, inner: bool) -> f32 {
    let before_is_hole = before == INVALID;
    let after_is_hole = after == INVALID;
    let low = bitcast<f32>(select(before, here, before_is_hole));
    let high = bitcast<f32>(select(after, here, after_is_hole));
    let halved = !before_is_hole && !after_is_hole && inner;
    let change = (high - low) * select(1.0, 0.5, halved);
    return select(change, 0.0, here == INVALID);
}

// Changes of height per sample along x and y at a texel of a slot of heights.
fn differences(slot: texture_2d<u32>, texel: vec2<i32>, here: u32) -> vec2<f32> {
    let before_x = textureLoad(slot, vec2<i32>(max(texel.x - 1, 0), texel.y), 0).x;
    let after_x = textureLoad(slot, vec2<i32>(min(texel.x + 1, LAST), texel.y), 0).x;
    let before_y = textureLoad(slot, vec2<i32>(texel.x, max(texel.y - 1, 0)), 0).x;
    let after_y = textureLoad(slot, vec2<i32>(texel.x, min(texel.y + 1, LAST)), 0).x;
    let inner = texel > vec2<i32>(0) & texel < vec2<i32>(LAST);
    return vec2<f32>(
        difference(before_x, here, after_x, inner.x),
        difference(before_y, here, after_y, inner.y),
    );
}
