// The marks that are always set: corners, centre, midpoints of edges beside finer leaves. One invocation a leaf.
// In: records of leaves, cleared marks. Out: those marks, and the worklist's first entries: all of them but corners.
// Part of top_down; its twin is in node/terrain/src/refine/top_down.rs.

#import shared::marks
#import shared::links

struct Worklist {
    // Entries that were added, whether or not there was room.
    length: atomic<u32>,
    // Place of the leaf << 18 | y << 9 | x.
    entries: array<u32>,
}

@group(0) @binding(0) var<storage, read> leaves: array<Leaf>;
@group(0) @binding(1) var<storage, read_write> marks: array<u32>;
@group(0) @binding(2) var<storage, read_write> worklist: Worklist;

fn add(place: u32, node: vec2<i32>) {
    let entry = atomicAdd(&worklist.length, 1u);
    if entry < arrayLength(&worklist.entries) {
        worklist.entries[entry] = (place << 18u) | (u32(node.y) << 9u) | u32(node.x);
    }
}

fn set_mark(place: u32, node: vec2<i32>) {
    // No two of these share a word, and none of them is in its word's upper bits.
    marks[place * MARK_WORDS + mark_word(node)] = 1u;
}

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let place = id.x;
    if place >= arrayLength(&leaves) { return; }
    set_mark(place, vec2<i32>(0, 0));
    set_mark(place, vec2<i32>(SIDE, 0));
    set_mark(place, vec2<i32>(0, SIDE));
    set_mark(place, vec2<i32>(SIDE, SIDE));
    set_mark(place, CENTRE);
    add(place, CENTRE);
    let flags = leaves[place].flags;
    for (var edge = 0u; edge < 4u; edge++) {
        if ((flags >> edge) & 1u) != 0u {
            let middle = on_edge(edge, 128);
            set_mark(place, middle);
            add(place, middle);
        }
    }
}
