// Errors of one level of marks, 12…0, from those of the levels below: bounds of how far any sample of a triangle lies
// from the plane through its corners. In: heights in units, errors of deeper levels. Out: codes of the errors of both
// sides, never smaller than a descendant's. Levels 12 and 11 look at all samples; those above at a grid of fifteen and
// at the errors of the sixteen triangles between. Twin: node/terrain/src/refine/pyramid.rs.

#import shared::error_code
#import shared::marks

// Which levels: 0 is 12, 1 is 11, 2 is all above.
override KIND: u32 = 2u;

struct Level {
    level: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
}

@group(0) @binding(0) var<uniform> parameters: Level;
// Slots in the geometry buffers, one a job.
@group(0) @binding(1) var<storage, read> jobs: array<u32>;
@group(0) @binding(2) var<storage, read> heights: array<i32>;
@group(0) @binding(3) var<storage, read_write> errors: array<u32>;

fn height(first: u32, node: vec2<i32>) -> i32 {
    return heights[first + node_index(node)];
}

// The code of a mark's error on the side that has this apex.
fn code_at(first: u32, mark: vec2<i32>, apex: vec2<i32>) -> u32 {
    let word = errors[first + node_index(mark)];
    return select(word & 0xFFFFu, word >> 16u, is_second_side(mark, apex));
}

// Level 12: the six samples that are not corners, along the hypotenuse and towards the apex.
fn deviation_12(first: u32, mark: vec2<i32>, end: vec2<i32>, apex: vec2<i32>) -> u32 {
    // Half of the way to an end and to the apex.
    let u = end >> vec2<u32>(1u);
    let w = apex >> vec2<u32>(1u);
    let ha = height(first, mark - end);
    let hb = height(first, mark + end);
    let hq = height(first, mark + apex);
    var most = abs(4 * height(first, mark - u) - 3 * ha - hb);
    most = max(most, abs(4 * height(first, mark) - 2 * ha - 2 * hb));
    most = max(most, abs(4 * height(first, mark + u) - ha - 3 * hb));
    most = max(most, abs(4 * height(first, mark + w - u) - 2 * ha - 2 * hq));
    most = max(most, abs(4 * height(first, mark + w) - ha - hb - 2 * hq));
    most = max(most, abs(4 * height(first, mark + w + u) - 2 * hb - 2 * hq));
    return (u32(most) + 3u) >> 2u;
}

// How far the samples of a grid of quartered legs lie from the plane, times four. The corners are on it.
struct Grid {
    d10: u32, d20: u32, d30: u32,
    d01: u32, d11: u32, d21: u32, d31: u32,
    d02: u32, d12: u32, d22: u32,
    d03: u32, d13: u32,
}

fn off(first: u32, node: vec2<i32>, plane: i32) -> u32 {
    return u32(abs(4 * height(first, node) - plane));
}

// i counts towards a, j towards b.
fn grid_of(first: u32, q: vec2<i32>, a: vec2<i32>, b: vec2<i32>) -> Grid {
    let hq = height(first, q);
    let ha = height(first, q + 4 * a);
    let hb = height(first, q + 4 * b);
    let i = ha - hq;
    let j = hb - hq;
    let o = 4 * hq;
    var grid: Grid;
    grid.d10 = off(first, q + a, o + i);
    grid.d20 = off(first, q + 2 * a, o + 2 * i);
    grid.d30 = off(first, q + 3 * a, o + 3 * i);
    grid.d01 = off(first, q + b, o + j);
    grid.d11 = off(first, q + a + b, o + i + j);
    grid.d21 = off(first, q + 2 * a + b, o + 2 * i + j);
    grid.d31 = off(first, q + 3 * a + b, o + 3 * i + j);
    grid.d02 = off(first, q + 2 * b, o + 2 * j);
    grid.d12 = off(first, q + a + 2 * b, o + i + 2 * j);
    grid.d22 = off(first, q + 2 * a + 2 * b, o + 2 * i + 2 * j);
    grid.d03 = off(first, q + 3 * b, o + 3 * j);
    grid.d13 = off(first, q + a + 3 * b, o + i + 3 * j);
    return grid;
}

fn quarter_up(value: u32) -> u32 {
    return (value + 3u) >> 2u;
}

// Both triangles of a cell of the grid: the samples at two corners that share the diagonal, and at the others.
// `mark` is the cell's middle, `apex` the corner of `first_corner`.
fn cell(first: u32, mark: vec2<i32>, apex: vec2<i32>, shared_corners: u32, first_corner: u32, other_corner: u32) -> u32 {
    let word = errors[first + node_index(mark)];
    let second = is_second_side(mark, apex);
    let near = select(word & 0xFFFFu, word >> 16u, second);
    let far = select(word >> 16u, word & 0xFFFFu, second);
    let near_bound = quarter_up(max(shared_corners, first_corner)) + decode(near);
    return max(near_bound, quarter_up(max(shared_corners, other_corner)) + decode(far));
}

// The triangle of a cell that the hypotenuse cuts: only that of this apex.
fn half_cell(first: u32, mark: vec2<i32>, apex: vec2<i32>, corners: u32) -> u32 {
    return quarter_up(corners) + decode(code_at(first, mark, apex));
}

fn deviation_11(first: u32, q: vec2<i32>, a: vec2<i32>, b: vec2<i32>) -> u32 {
    let g = grid_of(first, q, a, b);
    let low = max(max(max(g.d10, g.d20), max(g.d30, g.d01)), max(g.d11, g.d21));
    let high = max(max(max(g.d31, g.d02), max(g.d12, g.d22)), max(g.d03, g.d13));
    return quarter_up(max(low, high));
}

// Levels up to 10. The diagonals of the grid's cells join corners whose coordinates are both even or both odd.
fn deviation_coarse(first: u32, q: vec2<i32>, a: vec2<i32>, b: vec2<i32>) -> u32 {
    let g = grid_of(first, q, a, b);
    let m = (a + b) >> vec2<u32>(1u);
    // Cells (0, 0), (1, 1), (2, 0), (0, 2): the diagonal starts at the corner next to q.
    var most = cell(first, q + m, q + a, g.d11, g.d10, g.d01);
    most = max(most, cell(first, q + 2 * a + m, q + 3 * a, max(g.d20, g.d31), g.d30, g.d21));
    most = max(most, cell(first, q + 2 * b + m, q + a + 2 * b, max(g.d02, g.d13), g.d12, g.d03));
    most = max(most, cell(first, q + a + b + m, q + 2 * a + b, max(g.d11, g.d22), g.d21, g.d12));
    // Cells (1, 0), (0, 1).
    most = max(most, cell(first, q + a + m, q + a, max(g.d20, g.d11), g.d10, g.d21));
    most = max(most, cell(first, q + b + m, q + b, max(g.d11, g.d02), g.d01, g.d12));
    // Cells along the hypotenuse.
    most = max(most, half_cell(first, q + 3 * a + m, q + 3 * a, max(g.d30, g.d31)));
    most = max(most, half_cell(first, q + 2 * a + b + m, q + 2 * a + b, max(g.d21, max(g.d31, g.d22))));
    most = max(most, half_cell(first, q + a + 2 * b + m, q + a + 2 * b, max(g.d12, max(g.d22, g.d13))));
    most = max(most, half_cell(first, q + 3 * b + m, q + 3 * b, max(g.d03, g.d13)));
    return most;
}

// The code of the error of one side; 0 where the side is not in this leaf.
fn side_code(first: u32, mark: vec2<i32>, end: vec2<i32>, apex: vec2<i32>) -> u32 {
    var code = 0u;
    if is_inside(mark + apex) {
        let q = mark + apex;
        var most: u32;
        if KIND == 0u {
            most = deviation_12(first, mark, end, apex);
        } else {
            let a = (-end - apex) >> vec2<u32>(2u);
            let b = (end - apex) >> vec2<u32>(2u);
            if KIND == 1u {
                most = deviation_11(first, q, a, b);
            } else {
                most = deviation_coarse(first, q, a, b);
            }
        }
        let child_0 = code_at(first, mark + ((apex - end) >> vec2<u32>(1u)), mark);
        let child_1 = code_at(first, mark + ((apex + end) >> vec2<u32>(1u)), mark);
        code = max(code_up(most), max(child_0, child_1));
    }
    return code;
}

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let number = group.x * 64u + lane;
    if number >= marks_of_level(parameters.level) { return; }
    let mark = mark_of(parameters.level, number);
    let shape = shape_of(mark);
    let first = jobs[group.y] * LATTICE_NODES;
    let side_0 = side_code(first, mark, shape.end, shape.apex);
    let side_1 = side_code(first, mark, shape.end, -shape.apex);
    errors[first + node_index(mark)] = side_0 | (side_1 << 16u);
}
