// What a whole block of pixels has in common: transform, viewer, light, air.
// In: nothing. Out: the uniform `frame` at group 0, binding 0. Matches layout.rs, field for field.

struct Frame {
    clip_from_relative: mat4x4<f32>,
    // The viewer: x low, x high, y low, y high; z low, z high.
    viewer_xy: vec4<u32>,
    viewer_z: vec4<u32>,
    // Direction to the sun, and the share of light that is ambient.
    sun: vec4<f32>,
    // Haze colour, and the thickness of the haze layer in metres (0: none).
    haze: vec4<f32>,
    // Slope factor for shading; the longest path through the haze layer in metres.
    shading: vec4<f32>,
    // Viewer in the space where the ellipsoid is the unit sphere; w: scale height there (0: no air).
    sky_viewer: vec4<f32>,
    // Ray through the block's corner, and its change per pixel to the right and down, in that space.
    sky_ray: vec4<f32>,
    sky_ray_x: vec4<f32>,
    sky_ray_y: vec4<f32>,
}

@group(0) @binding(0) var<uniform> frame: Frame;
