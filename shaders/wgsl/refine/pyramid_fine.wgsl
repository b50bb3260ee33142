// Errors of the two finest levels of marks, 14 and 13: one invocation a square of two cells.
// In: heights in units. Out: codes of the errors of both sides. Part of the pyramid; see pyramid.wgsl.
// Twin: node/terrain/src/refine/pyramid.rs.

#import shared::error_code

const NODES: u32 = 66049u;

// Slots in the geometry buffers, one a job.
@group(0) @binding(0) var<storage, read> jobs: array<u32>;
@group(0) @binding(1) var<storage, read> heights: array<i32>;
@group(0) @binding(2) var<storage, read_write> errors: array<u32>;

// The error of the middle between two nodes: half of this, rounded up.
fn middle(here: i32, before: i32, after: i32) -> u32 {
    return code_up((u32(abs(2 * here - before - after)) + 1u) >> 1u);
}

// The error of the triangle with apex q and legs to a and b, whose middles are given, and that of the hypotenuse.
fn triangle(q: i32, a: i32, b: i32, to_a: i32, to_b: i32, centre: i32) -> u32 {
    let on_legs = max(abs(2 * to_a - q - a), abs(2 * to_b - q - b));
    return code_up((u32(max(on_legs, abs(2 * centre - a - b))) + 1u) >> 1u);
}

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = group.x * 64u + lane;
    let x = 2u * (index & 127u);
    let y = 2u * (index >> 7u);
    let first = jobs[group.y] * NODES + y * 257u + x;
    let h00 = heights[first];
    let h10 = heights[first + 1u];
    let h20 = heights[first + 2u];
    let h01 = heights[first + 257u];
    let h11 = heights[first + 258u];
    let h21 = heights[first + 259u];
    let h02 = heights[first + 514u];
    let h12 = heights[first + 515u];
    let h22 = heights[first + 516u];
    let down = middle(h10, h00, h20);
    let left = middle(h01, h00, h02);
    let right = middle(h21, h20, h22);
    let up = middle(h12, h02, h22);
    // Side 0 lies below or left of a mark, side 1 above or right.
    errors[first + 1u] = select(down | (down << 16u), down << 16u, y == 0u);
    errors[first + 257u] = select(left | (left << 16u), left << 16u, x == 0u);
    if y == 254u { errors[first + 515u] = up; }
    if x == 254u { errors[first + 259u] = right; }
    // The diagonal between the cells rises where their coordinates are alike, counted in these squares.
    let rising = ((x ^ y) & 2u) == 0u;
    var side_0: u32;
    var side_1: u32;
    if rising {
        side_0 = max(triangle(h20, h00, h22, h10, h21, h11), max(down, right));
        side_1 = max(triangle(h02, h00, h22, h01, h12, h11), max(left, up));
    } else {
        side_0 = max(triangle(h00, h20, h02, h10, h01, h11), max(down, left));
        side_1 = max(triangle(h22, h20, h02, h21, h12, h11), max(right, up));
    }
    errors[first + 258u] = side_0 | (side_1 << 16u);
}
