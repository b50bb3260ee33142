//! What a whole block of pixels has in common, as the shaders read it.
//! In: a scene, a view, a block. Out: the frame uniform. Absolute positions leave here as fixed point only.

use geodesy::frame::{FixedPoint, scalar_f32, vector_f32};
use glam::DVec3;
use shaders::FrameUniform;

use crate::canvas::{Block, to_sphere_space};
use crate::renderer::ViewPoint;
use crate::scene::SceneData;

/// The frame uniform of a block that an eye sees.
pub(crate) fn frame_uniform(
    scene: &SceneData,
    view: &ViewPoint,
    eye: usize,
    block: &Block,
) -> FrameUniform {
    let eye = view.eyes.get(eye).copied().unwrap_or_default();
    let [x0, x1, y0, y1, z0, z1] = FixedPoint::from_ecef(eye).words();
    let ellipsoid = scene.ellipsoid;
    let (a, b) = (ellipsoid.semi_major_m, ellipsoid.semi_minor_m);
    let sun = vector_f32(scene.light.sun);
    let air = scene.air;
    let [red, green, blue] = air.colour.map(scalar_f32);
    // The longest path through a shell of this thickness around a planet of this radius.
    let longest_m = (2.0 * a * air.thickness_m).sqrt();
    let sphere = vector_f32(eye / DVec3::new(a, a, b));
    let [corner, right, down] = block.ray.map(|ray| to_sphere_space(ray, a, b));
    FrameUniform {
        clip_from_relative: block.clip_from_relative.to_cols_array_2d(),
        viewer_xy: [x0, x1, y0, y1],
        viewer_z: [z0, z1, 0, 0],
        sun: [sun.x, sun.y, sun.z, scalar_f32(scene.light.ambient)],
        haze: [red, green, blue, scalar_f32(air.thickness_m)],
        shading: [
            scalar_f32(scene.light.relief),
            scalar_f32(longest_m.max(1.0)),
            0.0,
            0.0,
        ],
        sky_viewer: [
            sphere.x,
            sphere.y,
            sphere.z,
            scalar_f32(air.thickness_m / a),
        ],
        sky_ray: corner,
        sky_ray_x: right,
        sky_ray_y: down,
    }
}
