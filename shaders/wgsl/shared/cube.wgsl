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

// Cell space, counted from the face's middle (−½…½), to cube space: S2's quadratic projection. It continues
// smoothly a little beyond, for border nodes.
fn centre_to_uv(d: f32) -> f32 {
    return 4.0 / 3.0 * d * (1.0 + abs(d));
}

// Its derivative.
fn centre_to_uv_slope(d: f32) -> f32 {
    return 4.0 / 3.0 * (1.0 + 2.0 * abs(d));
}
