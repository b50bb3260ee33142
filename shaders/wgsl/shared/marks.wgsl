// Marks of a leaf's lattice: where they lie, what they split, who shares them (Lambers 2011, §3.3.3).
// In: nodes (x, y), each 0…256. Out: places in memory, levels, ends, apexes, children. Integers only.
// Twin: node/terrain/src/refine/marks.rs.

const MARK_WORDS: u32 = 2313u;
const LATTICE_NODES: u32 = 66049u;
const SIDE: i32 = 256;
const CENTRE: vec2<i32> = vec2<i32>(128, 128);

// The word of a mark within a leaf.
fn mark_word(node: vec2<i32>) -> u32 {
    return u32(node.y) * 9u + (u32(node.x) >> 5u);
}

fn mark_bit(node: vec2<i32>) -> u32 {
    return 1u << (u32(node.x) & 31u);
}

fn node_index(node: vec2<i32>) -> u32 {
    return u32(node.y) * 257u + u32(node.x);
}

fn is_inside(node: vec2<i32>) -> bool {
    return (u32(node.x) <= 256u) & (u32(node.y) <= 256u);
}

// The hypotenuse that a mark is the midpoint of, and what lies about it, as steps from the mark. Neither for corners.
struct Shape {
    // 0…14; −1 for the centre.
    level: i32,
    // From the mark to the second end; the first end lies opposite.
    end: vec2<i32>,
    // To the apex of side 0; side 1's lies opposite.
    apex: vec2<i32>,
    // To the midpoints of the legs at side 0: towards the first end and the second. Those of side 1 lie opposite,
    // towards the second and the first. The centre's are left and down.
    leg_0: vec2<i32>,
    leg_1: vec2<i32>,
}

fn shape_of(node: vec2<i32>) -> Shape {
    let exponent = i32(firstTrailingBit(u32(node.x | node.y) | 128u));
    let s = 1 << u32(exponent);
    let odd_x = (node.x & s) != 0;
    let odd_y = (node.y & s) != 0;
    let diagonal = odd_x & odd_y;
    let rising = ((node.x ^ node.y) & (2 * s)) == 0;
    var shape: Shape;
    shape.level = 14 - 2 * exponent - select(0, 1, diagonal);
    let straight_end = select(vec2<i32>(0, s), vec2<i32>(s, 0), odd_x);
    let straight_apex = select(vec2<i32>(-s, 0), vec2<i32>(0, -s), odd_x);
    shape.end = select(straight_end, vec2<i32>(s, select(-s, s, rising)), diagonal);
    shape.apex = select(straight_apex, vec2<i32>(select(-s, s, rising), -s), diagonal);
    shape.leg_0 = (shape.apex - shape.end) >> vec2<u32>(1u);
    shape.leg_1 = (shape.apex + shape.end) >> vec2<u32>(1u);
    return shape;
}

// The four children in the order of emission, as steps from the mark: side 0 first end, second end, side 1 first end,
// second end; the centre's left, right, down, up. Those of level 14 are no marks.
struct Children {
    step_0: vec2<i32>,
    step_1: vec2<i32>,
    step_2: vec2<i32>,
    step_3: vec2<i32>,
}

fn children_of(shape: Shape) -> Children {
    var children = Children(shape.leg_0, shape.leg_1, -shape.leg_1, -shape.leg_0);
    if shape.level < 0 {
        children = Children(vec2<i32>(-128, 0), vec2<i32>(128, 0), vec2<i32>(0, -128), vec2<i32>(0, 128));
    }
    return children;
}

// Whether a mark's side that has this apex is side 1.
fn is_second_side(mark: vec2<i32>, apex: vec2<i32>) -> bool {
    return (apex.y > mark.y) | ((apex.y == mark.y) & (apex.x > mark.x));
}

// The mark of a level with a number: those of horizontal hypotenuses, then of vertical ones, or all diagonal ones.
fn mark_of(level: u32, number: u32) -> vec2<i32> {
    // Half of the cells of 2^exponent nodes along a side: 2^half.
    let exponent = (14u - level) >> 1u;
    let half = 7u - exponent;
    let cells = 1u << half;
    let diagonal = (level & 1u) != 0u;
    let lines = (cells + 1u) << half;
    let vertical = !diagonal & (number >= lines);
    let n = select(number, number - lines, vertical);
    let odd = 2u * (n & (cells - 1u)) + 1u;
    let other = 2u * (n >> half) + select(0u, 1u, diagonal);
    return vec2<i32>(select(vec2<u32>(odd, other), vec2<u32>(other, odd), vertical) << vec2<u32>(exponent));
}

// How many marks a level has.
fn marks_of_level(level: u32) -> u32 {
    let half = 7u - ((14u - level) >> 1u);
    let cells = 1u << half;
    return select(2u * ((cells + 1u) << half), cells << half, (level & 1u) != 0u);
}
