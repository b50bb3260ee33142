// Vertices and triangles of each word of marks. A mark's triangles are those that it makes of the two it splits, less
// those that are split again. In: marks. Out: per word its bits, vertices and triangles.
// Part of count; its twin is node/terrain/src/refine/count.rs.

#import shared::marks
#import shared::drawn

// Marks as they are set.
@group(0) @binding(0) var<storage, read> marks: array<u32>;
// Bits; vertices; triangles.
@group(0) @binding(1) var<storage, read_write> summed: array<vec4<u32>>;

fn marks_at(word: u32) -> u32 {
    return marks[word];
}

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let word = group.x * 64u + lane;
    if word >= MARK_WORDS { return; }
    let first = group.y * MARK_WORDS;
    let bits = marks[first + word];
    let origin = origin_of(word);
    var triangles = 0u;
    var rest = bits;
    while rest != 0u {
        let mark = origin + vec2<i32>(i32(firstTrailingBit(rest)), 0);
        triangles += countOneBits(drawn_children(first, mark, shape_of(mark)));
        rest &= rest - 1u;
    }
    summed[first + word] = vec4<u32>(bits, countOneBits(bits), triangles, 0u);
}
