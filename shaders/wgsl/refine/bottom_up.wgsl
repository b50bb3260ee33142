// One step of marking from the finest marks up: every mark of one level in leaves of one level. A mark is set where a
// side fails or a mark below it is set, and its twin with it. Steps of equal absolute level, twice the leaves' and the
// marks', go together, after all deeper ones. In: errors, allowances, links, marks of deeper levels. Out: marks. Twin: node/terrain/src/refine/bottom_up.rs.

#import shared::marks
#import shared::links
#import shared::allowance

struct Step {
    // Of the marks.
    level: u32,
    // The step's leaves lie from here on, one a row of workgroups.
    first_place: u32,
    padding_0: u32,
    padding_1: u32,
}

@group(0) @binding(0) var<uniform> parameters: Step;
@group(0) @binding(1) var<storage, read> leaves: array<Leaf>;
@group(0) @binding(2) var<storage, read> allowances: array<u32>;
@group(0) @binding(3) var<storage, read> errors: array<u32>;
@group(0) @binding(4) var<storage, read_write> marks: array<atomic<u32>>;

fn is_set(place: u32, node: vec2<i32>) -> bool {
    var word = 0u;
    if is_inside(node) {
        word = atomicLoad(&marks[place * MARK_WORDS + mark_word(node)]);
    }
    return (word & mark_bit(node)) != 0u;
}

fn side_fails(place: u32, level: i32, mark: vec2<i32>, apex: vec2<i32>, errors_here: u32) -> bool {
    var failing = false;
    if is_inside(apex) {
        let allowance = allowances[place * ALLOWANCE_WORDS + allowance_word(level, mark, apex)];
        failing = fails(level, errors_here, allowance, is_second_side(mark, apex));
    }
    return failing;
}

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let place = parameters.first_place + group.y;
    let level = i32(parameters.level);
    let number = group.x * 64u + lane;
    if number >= marks_of_level(u32(level)) { return; }
    let mark = mark_of(u32(level), number);
    let flags = leaves[place].flags;
    if (level == 14) & is_beside_coarser(flags, mark) { return; }
    let shape = shape_of(mark);
    var split = false;
    if level < 14 {
        let children = children_of(shape);
        split = is_set(place, mark + children.step_0) | is_set(place, mark + children.step_1)
            | is_set(place, mark + children.step_2) | is_set(place, mark + children.step_3);
    }
    let errors_here = errors[leaves[place].geometry * LATTICE_NODES + node_index(mark)];
    split = split | side_fails(place, level, mark, mark + shape.apex, errors_here);
    split = split | side_fails(place, level, mark, mark - shape.apex, errors_here);
    if split {
        atomicOr(&marks[place * MARK_WORDS + mark_word(mark)], mark_bit(mark));
        let edge = edge_of(mark);
        if edge < 4u {
            let twin = twin_of(leaves[place].links[edge], along_edge(edge, mark));
            if twin.exists & (twin.place < arrayLength(&leaves)) {
                atomicOr(&marks[twin.place * MARK_WORDS + mark_word(twin.node)], mark_bit(twin.node));
            }
        }
    }
}
