// The list of vertices to be written, and the arguments that draw them. One invocation a word of marks.
// In: marks with what comes before each word. Out: per vertex its mesh and node, and which triangles it brings, from
// which on; per mesh the arguments of its indirect draw. Part of emit; its twin is node/terrain/src/refine/emit.rs.

#import shared::marks
#import shared::drawn
#import shared::emission

@group(0) @binding(0) var<storage, read> emissions: array<Emission>;
// Bits; vertices before; triangles before.
@group(0) @binding(1) var<storage, read> summed: array<vec4<u32>>;
// Number of the mesh << 18 | y << 9 | x; drawn children << 28 | first triangle.
@group(0) @binding(2) var<storage, read_write> entries: array<vec2<u32>>;
// Index count, instance count, first index, base vertex, first instance.
@group(0) @binding(3) var<storage, read_write> arguments: array<u32>;

fn marks_at(word: u32) -> u32 {
    return summed[word].x;
}

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let word = group.x * 64u + lane;
    if word >= MARK_WORDS { return; }
    let emission = emissions[group.y];
    let first = emission.place * MARK_WORDS;
    let here = summed[first + word];
    let origin = origin_of(word);
    var entry = emission.first_entry + here.y;
    var triangle = here.z;
    var rest = here.x;
    while rest != 0u {
        let mark = origin + vec2<i32>(i32(firstTrailingBit(rest)), 0);
        let drawn = drawn_children(first, mark, shape_of(mark));
        entries[entry] = vec2<u32>((group.y << 18u) | (u32(mark.y) << 9u) | u32(mark.x), (drawn << 28u) | triangle);
        entry += 1u;
        triangle += countOneBits(drawn);
        rest &= rest - 1u;
    }
    if word == 0u {
        let argument = 5u * emission.argument;
        arguments[argument] = 3u * emission.triangles;
        arguments[argument + 1u] = 1u;
        arguments[argument + 2u] = emission.first_index;
        arguments[argument + 3u] = emission.first_vertex;
        arguments[argument + 4u] = emission.record;
    }
}
