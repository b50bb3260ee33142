// The rim of air around the planet, and the sky above a viewer inside it.
// In: the frame's viewer and rays, in a space where the ellipsoid is the unit sphere. Out: colour where no
// terrain was drawn (depth 0). Rays are linear in the pixel's position, so every node computes the same.

#import shared::frame

@vertex
fn vertex_main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let corner = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
    return vec4<f32>(corner * 2.0 - 1.0, 0.0, 1.0);
}

@fragment
fn fragment_main(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    if frame.sky_viewer.w <= 0.0 { return vec4<f32>(0.0, 0.0, 0.0, 1.0); }
    let ray = normalize(frame.sky_ray.xyz + position.x * frame.sky_ray_x.xyz + position.y * frame.sky_ray_y.xyz);
    let viewer = frame.sky_viewer.xyz;
    let rising = dot(viewer, ray);
    // The lowest point of the ray ahead: its foot on the axis, or the viewer where the ray only climbs.
    let lowest = viewer + ray * max(-rising, 0.0);
    let radius = length(lowest);
    let height = max(radius - 1.0, 0.0);
    let density = exp(-height / frame.sky_viewer.w);
    // A climbing ray leaves the air sooner the steeper it is.
    let climb = max(rising, 0.0) / max(length(viewer), 1e-6);
    let path = 1.0 / (1.0 + 6.0 * climb);
    let day = smoothstep(-0.25, 0.2, dot(lowest, frame.sun.xyz) / max(radius, 1e-6));
    return vec4<f32>(frame.haze.rgb * density * path * day, 1.0);
}
