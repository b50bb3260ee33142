// Leaves at hand, and which marks of neighbours are the same as theirs. Needs the module marks beside it.
// In: records of leaves, a border mark. Out: the twin's leaf and node. Twin: node/terrain/src/refine/links.rs.

struct Leaf {
    // What lies beyond the edges left, right, down, up: RefineLeaf in layout/refine.rs says which bits are what.
    links: array<vec2<u32>, 4>,
    flags: u32,
    geometry: u32,
    level: u32,
    padding: u32,
}

const SAME: u32 = 1u;
const COARSER: u32 = 2u;
const FINER: u32 = 3u;

// The edge that a border node lies on: 0…3; 4 for inner nodes. Not for corners.
fn edge_of(node: vec2<i32>) -> u32 {
    var edge = select(4u, 3u, node.y == SIDE);
    edge = select(edge, 2u, node.y == 0);
    edge = select(edge, 1u, node.x == SIDE);
    return select(edge, 0u, node.x == 0);
}

// The coordinate along an edge.
fn along_edge(edge: u32, node: vec2<i32>) -> i32 {
    return select(node.x, node.y, edge < 2u);
}

fn on_edge(edge: u32, t: i32) -> vec2<i32> {
    let far = select(0, SIDE, (edge & 1u) != 0u);
    return select(vec2<i32>(t, far), vec2<i32>(far, t), edge < 2u);
}

// Whether a node lies on an edge beyond which a coarser leaf lies. Marks of level 14 there are odd along the edge: the
// coarser leaf has no such node, and they are never vertices.
fn is_beside_coarser(flags: u32, node: vec2<i32>) -> bool {
    let low = vec2<u32>(node == vec2<i32>(0));
    let high = vec2<u32>(node == vec2<i32>(SIDE));
    return ((flags >> 4u) & (low.x | (high.x << 1u) | (low.y << 2u) | (high.y << 3u))) != 0u;
}

struct Twin {
    exists: bool,
    place: u32,
    node: vec2<i32>,
}

// The node of a neighbour that is this border node, neither a corner here nor there. `link` is that of its edge.
fn twin_of(link: vec2<u32>, t: i32) -> Twin {
    let kind = (link.x >> 16u) & 3u;
    let edge = (link.x >> 18u) & 3u;
    let flip = ((link.x >> 20u) & 1u) != 0u;
    let half = i32((link.x >> 21u) & 1u);
    let second = (kind == FINER) & (t > 128);
    var s = select(t, 2 * t, kind == FINER);
    s = select(s, s - SIDE, second);
    s = select(s, SIDE - s, flip);
    s = select(s, 128 * half + (s >> 1u), kind == COARSER);
    var twin: Twin;
    twin.place = select(link.x & 0xFFFFu, link.y & 0xFFFFu, second);
    // Beside a coarser leaf odd nodes have none; the middle beside finer ones is their corner.
    let none = (kind == 0u) | ((kind == COARSER) & ((t & 1) != 0)) | ((kind == FINER) & (t == 128));
    twin.exists = !none;
    twin.node = on_edge(edge, s);
    return twin;
}
