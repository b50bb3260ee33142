// Vertices and triangles of each leaf, and before each of its words. One workgroup a leaf.
// In: vertices and triangles of words. Out: what comes before each word in its place, and each leaf's totals.
// Part of count; its twin is node/terrain/src/refine/count.rs.

const MARK_WORDS: u32 = 2313u;
const LANES: u32 = 256u;
// Words of one invocation.
const RUN: u32 = 10u;

// Bits; vertices; triangles.
@group(0) @binding(0) var<storage, read_write> summed: array<vec4<u32>>;
// Vertices and triangles of leaves.
@group(0) @binding(1) var<storage, read_write> counts: array<vec2<u32>>;

var<workgroup> sums: array<vec2<u32>, LANES>;

@compute @workgroup_size(256, 1, 1)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * MARK_WORDS;
    let start = min(lane * RUN, MARK_WORDS);
    let end = min(start + RUN, MARK_WORDS);
    var sum = vec2<u32>(0u);
    for (var word = start; word < end; word++) {
        sum += summed[first + word].yz;
    }
    sums[lane] = sum;
    workgroupBarrier();
    // Few enough for one.
    if lane == 0u {
        var before = vec2<u32>(0u);
        for (var index = 0u; index < LANES; index++) {
            let here = sums[index];
            sums[index] = before;
            before += here;
        }
        counts[group.x] = before;
    }
    workgroupBarrier();
    var before = sums[lane];
    for (var word = start; word < end; word++) {
        let here = summed[first + word];
        summed[first + word] = vec4<u32>(here.x, before, 0u);
        before += here.yz;
    }
}
