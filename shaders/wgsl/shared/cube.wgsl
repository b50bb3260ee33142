// The cube of six faces with S2's axes and quadratic projection, in f32, for tangent directions only:
// positions come from the CPU. In: face, cell coordinates. Out: axes, the projection and its slope.

// Direction of growing u on each face.
fn face_u(face: u32) -> vec3<f32> {
    switch face {
        case 0u, 5u: { return vec3<f32>(0.0, 1.0, 0.0); }
        case 1u, 2u: { return vec3<f32>(-1.0, 0.0, 0.0); }
        default: { return vec3<f32>(0.0, 0.0, -1.0); }
    }
}

// Direction of growing v on each face.
fn face_v(face: u32) -> vec3<f32> {
    switch face {
        case 0u, 1u: { return vec3<f32>(0.0, 0.0, 1.0); }
        case 2u, 3u: { return vec3<f32>(0.0, -1.0, 0.0); }
        default: { return vec3<f32>(1.0, 0.0, 0.0); }
    }
}

// Outward direction of each face.
fn face_out(face: u32) -> vec3<f32> {
    switch face {
        case 0u: { return vec3<f32>(1.0, 0.0, 0.0); }
        case 1u: { return vec3<f32>(0.0, 1.0, 0.0); }
        case 2u: { return vec3<f32>(0.0, 0.0, 1.0); }
        case 3u: { return vec3<f32>(-1.0, 0.0, 0.0); }
        case 4u: { return vec3<f32>(0.0, -1.0, 0.0); }
        default: { return vec3<f32>(0.0, 0.0, -1.0); }
    }
}

// Cell space to cube space; continues smoothly a little beyond 0…1, for border nodes.
fn st_to_uv(s: f32) -> f32 {
    let r = 1.0 - s;
    return select((1.0 - 4.0 * r * r) / 3.0, (4.0 * s * s - 1.0) / 3.0, s >= 0.5);
}

// Its derivative.
fn st_to_uv_slope(s: f32) -> f32 {
    return 8.0 / 3.0 * max(s, 1.0 - s);
}
