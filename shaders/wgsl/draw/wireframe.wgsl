// The edges of the drawn triangles over the surface: those of the quadtree in one colour, those of the mesh in another
// (Lambers 2011, fig. 1.16). In: the vertices of terrain.wgsl, drawn as lines. Out: opaque colour, a hair nearer than the
// surface. It must place a vertex as terrain.wgsl does.

#import shared::fixed_point
#import shared::frame
#import shared::vertex

// Lines are this share of the distance nearer than the surface that they lie on.
const NEARER: f32 = 1.003;
const QUADTREE_EDGE: vec4<f32> = vec4<f32>(1.0, 0.62, 0.05, 1.0);
const MESH_EDGE: vec4<f32> = vec4<f32>(0.25, 0.8, 0.85, 1.0);

struct LineOut {
    @builtin(position) clip: vec4<f32>,
    @location(0) lattice: vec2<f32>,
}

@vertex
fn vertex_main(vertex: VertexIn) -> LineOut {
    var out: LineOut;
    out.clip = frame.clip_from_relative * vec4<f32>(relative_position(vertex), 1.0);
    // Depth is reversed: nearer is greater.
    out.clip.z *= NEARER;
    out.lattice = vec2<f32>(vertex.lattice);
    return out;
}

@fragment
fn fragment_main(in: LineOut) -> @location(0) vec4<f32> {
    let to_edge = min(in.lattice, vec2<f32>(256.0) - in.lattice);
    let on_quadtree = min(to_edge.x, to_edge.y) < 0.001;
    return select(MESH_EDGE, QUADTREE_EDGE, on_quadtree);
}
