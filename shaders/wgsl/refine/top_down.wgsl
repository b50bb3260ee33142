// One pass over what the worklist's window shows: marks that were set in the pass before. Each sets its twin in the
// neighbour, the two marks that must be set where it is, and those of its child triangles whose error is more than is
// allowed. Whatever is set for the first time is added to the list. In: errors, allowances, links. Out: marks.
// Twin: node/terrain/src/refine/top_down.rs.

#import shared::marks
#import shared::links
#import shared::allowance

struct Window {
    groups: u32,
    groups_y: u32,
    groups_z: u32,
    start: u32,
    end: u32,
    passes: u32,
}

struct Worklist {
    // Entries that were added, whether or not there was room.
    length: atomic<u32>,
    // Place of the leaf << 18 | y << 9 | x.
    entries: array<u32>,
}

@group(0) @binding(0) var<storage, read> leaves: array<Leaf>;
@group(0) @binding(1) var<storage, read> allowances: array<u32>;
@group(0) @binding(2) var<storage, read> errors: array<u32>;
@group(0) @binding(3) var<storage, read> window: Window;
@group(0) @binding(4) var<storage, read_write> marks: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> worklist: Worklist;

// Sets a mark; true where it was not set. Most marks that are forced are set already, and reading costs less.
fn set_mark(place: u32, node: vec2<i32>) -> bool {
    let word = place * MARK_WORDS + mark_word(node);
    let bit = mark_bit(node);
    var before = atomicLoad(&marks[word]);
    if (before & bit) == 0u {
        before = atomicOr(&marks[word], bit);
    }
    return (before & bit) == 0u;
}

// What a mark's children have in common.
struct Parent {
    mark: vec2<i32>,
    place: u32,
    flags: u32,
    // Of the children.
    level: i32,
    // The leaf's first error, and its first word of marks.
    errors: u32,
    marks: u32,
    // A word of its table, and what it holds: mostly that of all children.
    word: u32,
    allowance: u32,
}

// Sets the mark of a child triangle if it fails; true where it was not set.
fn try_child(parent: Parent, child: vec2<i32>) -> bool {
    var added = false;
    if (parent.level <= 14) & is_inside(child) {
        let error = errors[parent.errors + node_index(child)];
        let word = allowance_word(parent.level, child, parent.mark);
        var allowance = parent.allowance;
        if word != parent.word {
            allowance = allowances[parent.place * ALLOWANCE_WORDS + word];
        }
        let failing = fails(parent.level, error, allowance, is_second_side(child, parent.mark));
        if failing & !((parent.level == 14) & is_beside_coarser(parent.flags, child)) {
            let bit = mark_bit(child);
            added = (atomicOr(&marks[parent.marks + mark_word(child)], bit) & bit) == 0u;
        }
    }
    return added;
}

fn add(position: u32, place: u32, node: vec2<i32>, added: bool) -> u32 {
    if added & (position < arrayLength(&worklist.entries)) {
        worklist.entries[position] = (place << 18u) | (u32(node.y) << 9u) | u32(node.x);
    }
    return position + select(0u, 1u, added);
}

fn follow(entry: u32) {
    let place = entry >> 18u;
    let mark = vec2<i32>(i32(entry & 511u), i32((entry >> 9u) & 511u));
    let shape = shape_of(mark);
    let flags = leaves[place].flags;
    // The twin.
    let edge = edge_of(mark);
    var twin: Twin;
    var twin_added = false;
    if edge < 4u {
        twin = twin_of(leaves[place].links[edge], along_edge(edge, mark));
        if twin.exists & (twin.place < arrayLength(&leaves)) {
            twin_added = set_mark(twin.place, twin.node);
        }
    }
    // The marks that this one needs.
    let apex_0 = mark + shape.apex;
    let apex_1 = mark - shape.apex;
    var apex_0_added = false;
    var apex_1_added = false;
    if (shape.level >= 0) & is_inside(apex_0) { apex_0_added = set_mark(place, apex_0); }
    if (shape.level >= 0) & is_inside(apex_1) { apex_1_added = set_mark(place, apex_1); }
    // The triangles that it makes.
    let children = children_of(shape);
    var parent: Parent;
    parent.mark = mark;
    parent.place = place;
    parent.flags = flags;
    parent.level = shape.level + 1;
    parent.errors = leaves[place].geometry * LATTICE_NODES;
    parent.marks = place * MARK_WORDS;
    if parent.level <= 14 {
        // Of some child that is inside: on the lower and the left edge the first two are not.
        let some = mark + select(children.step_3, children.step_0, is_inside(mark + children.step_0));
        parent.word = allowance_word(parent.level, some, mark);
        parent.allowance = allowances[place * ALLOWANCE_WORDS + parent.word];
    }
    let added_0 = try_child(parent, mark + children.step_0);
    let added_1 = try_child(parent, mark + children.step_1);
    let added_2 = try_child(parent, mark + children.step_2);
    let added_3 = try_child(parent, mark + children.step_3);
    let forced = vec3<u32>(vec3<bool>(twin_added, apex_0_added, apex_1_added));
    let split = vec4<u32>(vec4<bool>(added_0, added_1, added_2, added_3));
    let count = forced.x + forced.y + forced.z + split.x + split.y + split.z + split.w;
    if count > 0u {
        var position = atomicAdd(&worklist.length, count);
        position = add(position, twin.place, twin.node, twin_added);
        position = add(position, place, apex_0, apex_0_added);
        position = add(position, place, apex_1, apex_1_added);
        position = add(position, place, mark + children.step_0, added_0);
        position = add(position, place, mark + children.step_1, added_1);
        position = add(position, place, mark + children.step_2, added_2);
        position = add(position, place, mark + children.step_3, added_3);
    }
}

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let end = window.end;
    for (var index = window.start + id.x; index < end; index += groups.x * 64u) {
        follow(worklist.entries[index]);
    }
}
