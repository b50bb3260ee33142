// Which triangles of a mark are drawn. Needs the module marks and a function marks_at(word) beside it.
// In: marks. Out: four bits in the order of emission. Twin: node/terrain/src/refine/triangles.rs.

// Node of a word's first bit.
fn origin_of(word: u32) -> vec2<i32> {
    let y = (word * 7282u) >> 16u;
    return vec2<i32>(i32((word - y * 9u) << 5u), i32(y));
}

// Whether the child triangle whose mark this is exists and is not split.
fn is_drawn(first: u32, child: vec2<i32>) -> bool {
    var drawn = false;
    if is_inside(child) {
        drawn = (marks_at(first + mark_word(child)) & mark_bit(child)) == 0u;
    }
    return drawn;
}

// Bits of the children of a set mark that are drawn; `first` is the first word of its leaf. None for corners.
fn drawn_children(first: u32, mark: vec2<i32>, shape: Shape) -> u32 {
    let children = children_of(shape);
    var drawn = 0u;
    if shape.level == 14 {
        drawn = select(0u, 3u, is_inside(mark + shape.apex)) | select(0u, 12u, is_inside(mark - shape.apex));
    } else if any((mark & vec2<i32>(255)) != vec2<i32>(0)) {
        drawn = select(0u, 1u, is_drawn(first, mark + children.step_0))
            | select(0u, 2u, is_drawn(first, mark + children.step_1))
            | select(0u, 4u, is_drawn(first, mark + children.step_2))
            | select(0u, 8u, is_drawn(first, mark + children.step_3));
    }
    return drawn;
}
