// Whether a triangle may stay: its error against what its leaf allows. Needs the module marks beside it.
// In: codes of errors, tables of allowances. Out: yes or no, by integers alone. Twin: node/terrain/src/refine/top_down.rs.

const ALLOWANCE_WORDS: u32 = 545u;
const BLOCKS: u32 = 256u;

// The word of a leaf's table that holds what is allowed to the triangle of a mark with this apex.
fn allowance_word(level: i32, mark: vec2<i32>, apex: vec2<i32>) -> u32 {
    let block = vec2<u32>(mark + apex) >> vec2<u32>(5u);
    let coarse = vec2<u32>(mark) >> vec2<u32>(4u);
    return select(BLOCKS + coarse.y * 17u + coarse.x, block.y * 16u + block.x, level >= 7);
}

// A triangle fails where its error's code reaches what the table says; 0 there means that it always fails.
fn fails(level: i32, error_word: u32, allowance: u32, second_side: bool) -> bool {
    let code = select(error_word & 0xFFFFu, error_word >> 16u, second_side);
    let high = ((level >= 7) & (level <= 8)) | ((level <= 6) & second_side);
    return code >= select(allowance & 0xFFFFu, allowance >> 16u, high);
}
