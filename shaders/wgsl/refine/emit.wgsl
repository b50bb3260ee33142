// Vertices and triangles of meshes: one invocation a vertex, which brings the triangles with their right angle there.
// In: the list of vertices, heights, border vertices, anchors of blocks. Out: vertices as terrain::Vertex lays them out,
// indices local to each mesh. Border vertices are copied to the bit. Twin: node/terrain/src/refine/emit.rs.

#import shared::marks
#import shared::emission
#import shared::wide

const BORDER_NODES: u32 = 1024u;
const BORDER_WORDS: u32 = 10u;
const VERTEX_WORDS: u32 = 9u;
// Vectors of a block's anchor, and blocks of a leaf.
const ANCHOR_VECTORS: u32 = 11u;
const BLOCKS: u32 = 256u;
const PER_NORMAL_STEP: f32 = 1.0 / 1073741824.0;
const STEPS_PER_M: f32 = 1048576.0;
// Units of 2^10 metres times normals in 2^-30 are steps.
const UNIT_EXPONENT: i32 = 10;

@group(0) @binding(0) var<storage, read> emissions: array<Emission>;
// Number of the mesh << 18 | y << 9 | x; drawn children << 28 | first triangle.
@group(0) @binding(1) var<storage, read> entries: array<vec2<u32>>;
// Bits; vertices before; triangles before.
@group(0) @binding(2) var<storage, read> summed: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> heights: array<i32>;
@group(0) @binding(4) var<storage, read> borders: array<u32>;
@group(0) @binding(5) var<storage, read> blocks: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read_write> vertices: array<u32>;
@group(0) @binding(7) var<storage, read_write> indices: array<u32>;

// Place of a border node among them: rows 0 and 256, then the rest of columns 0 and 256.
fn border_index(node: vec2<i32>) -> u32 {
    let column = select(513, 768, node.x == SIDE) + node.y;
    return u32(select(select(column, 257 + node.x, node.y == SIDE), node.x, node.y == 0));
}

fn steps(metres: f32) -> vec2<u32> {
    let whole = floor(metres);
    let rest = i32(round((metres - whole) * STEPS_PER_M));
    return wide_sum(vec2<u32>(u32(i32(whole)) << 20u, u32(i32(whole) >> 12u)), wide(rest));
}

fn signed_16(component: f32) -> u32 {
    return u32(i32(floor(0.5 + 32767.0 * clamp(component, -1.0, 1.0)))) & 0xFFFFu;
}

fn write_inner(target_word: u32, node: vec2<i32>, height: i32, geometry: u32, unit_m: f32) {
    let block = min(vec2<u32>(node) >> vec2<u32>(4u), vec2<u32>(15u));
    let first = (geometry * BLOCKS + block.y * 16u + block.x) * ANCHOR_VECTORS;
    let w0 = blocks[first];
    let w1 = blocks[first + 1u];
    let w2 = blocks[first + 2u];
    let w3 = blocks[first + 3u];
    let c4 = bitcast<vec4<f32>>(blocks[first + 4u]);
    let c5 = bitcast<vec4<f32>>(blocks[first + 5u]);
    let c6 = bitcast<vec4<f32>>(blocks[first + 6u]);
    let c7 = bitcast<vec4<f32>>(blocks[first + 7u]);
    let c8 = bitcast<vec4<f32>>(blocks[first + 8u]);
    let c9 = bitcast<vec4<f32>>(blocks[first + 9u]);
    let w10 = blocks[first + 10u];
    let place = node - vec2<i32>(16 * block + 8);
    let along_a = vec3<i32>(vec3<u32>(w1.zw, w2.x));
    let along_b = vec3<i32>(w2.yzw);
    let shift = i32(w3.x);
    let raised = height - i32(w3.y);
    let normal = vec3<i32>(w10.yzw);
    let line = place.x * along_a + place.y * along_b;
    let a = f32(place.x);
    let b = f32(place.y);
    let turn_a = vec3<f32>(c8.w, c9.xy);
    let turn_b = vec3<f32>(c9.zw, bitcast<f32>(w10.x));
    let turn = (c8.xyz + a * turn_a) + b * turn_b;
    let c3 = bitcast<vec2<f32>>(w3.zw);
    var curve = (a * a) * vec3<f32>(c3, c4.x) + (b * b) * c4.yzw;
    curve = curve + (a * b) * c5.xyz;
    curve = curve + (a * a * b) * vec3<f32>(c5.w, c6.xy);
    curve = curve + (a * (b * b)) * vec3<f32>(c6.zw, c7.x);
    curve = curve + ((a * a) * (b * b)) * c7.yzw;
    let metres = curve + (f32(raised) * unit_m) * turn;
    let raise = i32(bitcast<u32>(unit_m) >> 23u) - 127 - UNIT_EXPONENT;
    let x = wide_sum(wide_sum(w0.xy, wide_shifted(wide(line.x), shift)),
        wide_sum(wide_shifted(wide_product(raised, normal.x), raise), steps(metres.x)));
    let y = wide_sum(wide_sum(w0.zw, wide_shifted(wide(line.y), shift)),
        wide_sum(wide_shifted(wide_product(raised, normal.y), raise), steps(metres.y)));
    let z = wide_sum(wide_sum(w1.xy, wide_shifted(wide(line.z), shift)),
        wide_sum(wide_shifted(wide_product(raised, normal.z), raise), steps(metres.z)));
    let n = (vec3<f32>(normal) * PER_NORMAL_STEP + a * turn_a) + b * turn_b;
    vertices[target_word] = x.x;
    vertices[target_word + 1u] = x.y;
    vertices[target_word + 2u] = y.x;
    vertices[target_word + 3u] = y.y;
    vertices[target_word + 4u] = z.x;
    vertices[target_word + 5u] = z.y;
    vertices[target_word + 6u] = signed_16(n.x) | (signed_16(n.y) << 16u);
    vertices[target_word + 7u] = signed_16(n.z);
    vertices[target_word + 8u] = u32(node.x) | (u32(node.y) << 16u);
}

fn copy_border(target_word: u32, source_word: u32) {
    vertices[target_word] = borders[source_word];
    vertices[target_word + 1u] = borders[source_word + 1u];
    vertices[target_word + 2u] = borders[source_word + 2u];
    vertices[target_word + 3u] = borders[source_word + 3u];
    vertices[target_word + 4u] = borders[source_word + 4u];
    vertices[target_word + 5u] = borders[source_word + 5u];
    vertices[target_word + 6u] = borders[source_word + 6u];
    vertices[target_word + 7u] = borders[source_word + 7u];
    vertices[target_word + 8u] = borders[source_word + 8u];
}

// The number of a mark's vertex.
fn vertex_of(first: u32, node: vec2<i32>) -> u32 {
    let word = summed[first + mark_word(node)];
    return word.y + countOneBits(word.x & (mark_bit(node) - 1u));
}

fn write_triangle(index: u32, from_vertex: u32, to_vertex: u32, apex: u32) {
    indices[index] = from_vertex;
    indices[index + 1u] = to_vertex;
    indices[index + 2u] = apex;
}

@compute @workgroup_size(64, 1, 1)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let number = (group.y * groups.x + group.x) * 64u + lane;
    if number >= emissions[0].entries { return; }
    let entry = entries[number];
    let mesh = entry.x >> 18u;
    let node = vec2<i32>(i32(entry.x & 511u), i32((entry.x >> 9u) & 511u));
    let geometry = emissions[mesh].geometry;
    let own = number - emissions[mesh].first_entry;
    let target_word = (emissions[mesh].first_vertex - emissions[mesh].window_vertex + own) * VERTEX_WORDS;
    if any(node == vec2<i32>(0)) | any(node == vec2<i32>(SIDE)) {
        copy_border(target_word, (geometry * BORDER_NODES + border_index(node)) * BORDER_WORDS);
    } else {
        let height = heights[geometry * LATTICE_NODES + node_index(node)];
        write_inner(target_word, node, height, geometry, emissions[mesh].unit_m);
    }
    let drawn = entry.y >> 28u;
    if drawn != 0u {
        let shape = shape_of(node);
        let first = emissions[mesh].place * MARK_WORDS;
        // Corners about the node: two opposite one another, and the other two.
        let centre = shape.level < 0;
        let p = select(shape.apex, vec2<i32>(-128), centre);
        let r = select(-shape.end, vec2<i32>(-128, 128), centre);
        var vertex_p = 0u;
        var vertex_q = 0u;
        if is_inside(node + p) { vertex_p = vertex_of(first, node + p); }
        if is_inside(node - p) { vertex_q = vertex_of(first, node - p); }
        let vertex_r = vertex_of(first, node + r);
        let vertex_s = vertex_of(first, node - r);
        // From p to r is counter-clockwise about the node, and so is from −p to −r; from p to −r is not.
        let turns = p.x * r.y - p.y * r.x > 0;
        let pr = select(vec2<u32>(vertex_r, vertex_p), vec2<u32>(vertex_p, vertex_r), turns);
        let qs = select(vec2<u32>(vertex_s, vertex_q), vec2<u32>(vertex_q, vertex_s), turns);
        let ps = select(vec2<u32>(vertex_p, vertex_s), vec2<u32>(vertex_s, vertex_p), turns);
        let qr = select(vec2<u32>(vertex_q, vertex_r), vec2<u32>(vertex_r, vertex_q), turns);
        // The centre's left, right, down, up.
        let child_1 = select(ps, qs, centre);
        let child_2 = select(qr, ps, centre);
        let child_3 = select(qs, qr, centre);
        var index = emissions[mesh].first_index - emissions[mesh].window_index + 3u * (entry.y & 0xFFFFFFFu);
        if (drawn & 1u) != 0u { write_triangle(index, pr.x, pr.y, own); }
        index += select(0u, 3u, (drawn & 1u) != 0u);
        if (drawn & 2u) != 0u { write_triangle(index, child_1.x, child_1.y, own); }
        index += select(0u, 3u, (drawn & 2u) != 0u);
        if (drawn & 4u) != 0u { write_triangle(index, child_2.x, child_2.y, own); }
        index += select(0u, 3u, (drawn & 4u) != 0u);
        if (drawn & 8u) != 0u { write_triangle(index, child_3.x, child_3.y, own); }
    }
}
