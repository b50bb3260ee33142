// A vertex of the planet's surface as terrain::Vertex lays it out, and its place relative to the viewer.
// In: fixed-point words. Out: metres, f32. Needs the modules fixed_point and frame beside it.

struct VertexIn {
    @location(0) position_xy: vec4<u32>,
    @location(1) position_z: vec2<u32>,
    @location(2) normal: vec4<f32>,
    @location(3) lattice: vec2<u32>,
}

fn relative_position(vertex: VertexIn) -> vec3<f32> {
    return vec3<f32>(
        fixed_difference(vertex.position_xy.x, vertex.position_xy.y, frame.viewer_xy.x, frame.viewer_xy.y),
        fixed_difference(vertex.position_xy.z, vertex.position_xy.w, frame.viewer_xy.z, frame.viewer_xy.w),
        fixed_difference(vertex.position_z.x, vertex.position_z.y, frame.viewer_z.x, frame.viewer_z.y),
    );
}
