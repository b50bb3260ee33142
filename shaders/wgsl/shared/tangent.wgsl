// Surface normals in the tangent frames of lattice nodes: e1 along the projected u axis, e2 = n × e1, n the
// ellipsoid's normal. In: a tile's place, a node, changes of height per sample. Out: unit normals, and where
// east is. Uses shared::cube. Twin: cpu/support/tangent.rs.

struct TileGeometry {
    // Cell coordinates of node (0, 0) less ½: counted from the face's middle, because there, at the poles,
    // directions turn fastest and f32 must be finest. Then the step from node to node.
    from_centre: vec2<f32>,
    step: f32,
    // The planet's mean radius in metres.
    radius_m: f32,
    face: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
}

struct TangentFrame {
    // Tangents for a step of one node, in metres: (a, 0) along u and (b, c) along v.
    a: f32,
    b: f32,
    c: f32,
    // Components of east along e1 and e2.
    east: vec2<f32>,
}

fn tangent_frame(tile: TileGeometry, node: vec2<i32>) -> TangentFrame {
    let s = tile.from_centre.x + f32(node.x) * tile.step;
    let t = tile.from_centre.y + f32(node.y) * tile.step;
    let u = centre_to_uv(s);
    let v = centre_to_uv(t);
    // Tangents of the unit normal n = m/|m|, m = out + u·U + v·V, for a step of one node.
    let inverse = 1.0 / sqrt(1.0 + u * u + v * v);
    let along_u = u * inverse;
    let along_v = v * inverse;
    let per_u = centre_to_uv_slope(s) * tile.step * inverse * tile.radius_m;
    let per_v = centre_to_uv_slope(t) * tile.step * inverse * tile.radius_m;
    let length_u = sqrt(1.0 - along_u * along_u);
    let rest = 1.0 - along_v * along_v - along_u * along_u * along_v * along_v / (length_u * length_u);
    // East is Z × n; its products with e1 and e2, up to one factor, by the rules of triple products.
    let axis_u = face_u(tile.face);
    let n = (face_out(tile.face) + u * axis_u + v * face_v(tile.face)) * inverse;
    let east = vec2<f32>(n.x * axis_u.y - n.y * axis_u.x, n.z * along_u - axis_u.z);
    let east_length = sqrt(east.x * east.x + east.y * east.y);
    var frame: TangentFrame;
    frame.a = per_u * length_u;
    frame.b = per_v * (-along_u * along_v) / length_u;
    frame.c = per_v * sqrt(max(rest, 0.0));
    // At a pole every direction is as good.
    frame.east = select(vec2<f32>(1.0, 0.0), east / max(east_length, 1e-30), east_length > 0.0);
    return frame;
}

// The surface's unit normal along e1, e2, n for these changes of height per sample along u and v.
fn surface_normal(frame: TangentFrame, rise: vec2<f32>) -> vec3<f32> {
    let x = -rise.x * frame.c;
    let y = rise.x * frame.b - rise.y * frame.a;
    let z = frame.a * frame.c;
    return vec3<f32>(x, y, z) / sqrt(x * x + y * y + z * z);
}

// A vector along e1, e2 as components along east and north.
fn east_north(frame: TangentFrame, along: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(
        along.x * frame.east.x + along.y * frame.east.y,
        along.y * frame.east.x - along.x * frame.east.y,
    );
}
