// What both fusion stages share: their uniform and the numbers of the blend modes.
// In: nothing. Out: types and constants. Twin: layout/fuse.rs.

struct FuseInput {
    weight: f32,
    opacity: f32,
    blend: u32,
    // Equal for inputs of equal priority and blend, which lie side by side.
    group: u32,
}

struct Fuse {
    count: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
    inputs: array<FuseInput, 8>,
}

const MULTIPLY: u32 = 1u;
const SCREEN: u32 = 2u;
const ADD: u32 = 3u;
