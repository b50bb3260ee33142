//! Blocks of all outputs: which there are, where they go, and what ground lies under a pixel of them.
//! In: outputs, a view. Out: blocks in a fixed order, layouts, copies. It draws nothing.

use geodesy::Ellipsoid;
use glam::DVec3;

use crate::canvas::{Block, ChannelPlan, OutputPlan};
use crate::loaded::LoadedScene;
use crate::ranges::Ranges;
use crate::renderer::{Renderer, ViewPoint};
use crate::target::{BlockLayout, BlockTarget, OutputTarget};

/// A block, and which channel of which output it is drawn for.
pub(crate) struct PlannedBlock {
    pub(crate) output: usize,
    pub(super) channel: usize,
    pub(crate) screen: usize,
    pub(crate) block: Block,
}

impl Renderer {
    /// Latitude and longitude in degrees on the ellipsoid under a pixel of an output, y down, in the view drawn last.
    /// `None` beside the planet, and where nothing is drawn.
    #[must_use]
    pub fn ground_under(&self, output: usize, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let (view, scene) = (&self.last.as_ref()?.view, self.scene.as_ref()?);
        let (plan, _, _) = self.outputs.get(output)?;
        let [x, y] = pixel;
        let channel = plan.channels.iter().find(|channel| {
            let [left, top] = channel.output_px.map(f64::from);
            let (width, height) = (
                f64::from(channel.canvas_px.width),
                f64::from(channel.canvas_px.height),
            );
            (left..left + width).contains(&x) && (top..top + height).contains(&y)
        })?;
        let on_canvas = [
            x - f64::from(channel.output_px[0]) + f64::from(channel.canvas_px.x),
            y - f64::from(channel.output_px[1]) + f64::from(channel.canvas_px.y),
        ];
        let eye = *view.eyes.get(channel.screen)?;
        let ray = view.room * view.screens.get(channel.screen)?.ray_through(on_canvas);
        let normal = ground_hit(&scene.data.ellipsoid, eye, ray)?;
        let (latitude_deg, longitude_deg) = Ellipsoid::angles_deg(normal);
        Some([latitude_deg, longitude_deg])
    }
}

/// The geodetic normal where a ray from an eye first meets the ellipsoid.
fn ground_hit(ellipsoid: &Ellipsoid, eye: DVec3, ray: DVec3) -> Option<DVec3> {
    let (a, b) = (ellipsoid.semi_major_m, ellipsoid.semi_minor_m);
    // In units of the semi-axes the ellipsoid is the unit sphere.
    let (from, along) = (eye / DVec3::new(a, a, b), ray / DVec3::new(a, a, b));
    let (square, half, rest) = (
        along.length_squared(),
        from.dot(along),
        from.length_squared() - 1.0,
    );
    let discriminant = half * half - square * rest;
    let distance = (-half - discriminant.sqrt()) / square;
    // NaN where the ray misses.
    (distance > 0.0).then(|| {
        let hit = eye + ray * distance;
        (hit / DVec3::new(a * a, a * a, b * b)).normalize()
    })
}

/// All blocks of all channels of all outputs, in a fixed order.
pub(super) fn plan_blocks(
    outputs: &[(OutputPlan, OutputTarget, Option<BlockTarget>)],
    view: &ViewPoint,
) -> Vec<PlannedBlock> {
    let mut blocks = Vec::new();
    for (output, (plan, _, _)) in outputs.iter().enumerate() {
        for (index, channel) in plan.channels.iter().enumerate() {
            let Some(screen) = view.screens.get(channel.screen) else {
                continue;
            };
            let of_channel = screen.blocks(channel.canvas_px, view.room);
            blocks.extend(of_channel.into_iter().map(|block| PlannedBlock {
                output,
                channel: index,
                screen: channel.screen,
                block,
            }));
        }
    }
    blocks
}

/// Whether the planet, at its lowest, fills each block.
pub(super) fn filled_blocks(
    scene: &LoadedScene,
    view: &ViewPoint,
    blocks: &[PlannedBlock],
) -> Vec<bool> {
    let floor_m = Ranges(scene).floor_m();
    let (a, b) = (
        scene.data.ellipsoid.semi_major_m,
        scene.data.ellipsoid.semi_minor_m,
    );
    let semi_axes_m = DVec3::new(a, a, b) + floor_m;
    let filled = |planned: &PlannedBlock| {
        view.eyes
            .get(planned.screen)
            .is_some_and(|eye| planned.block.is_filled_by(semi_axes_m, *eye))
    };
    blocks.iter().map(filled).collect()
}

/// How large each output's block target must be, and whether it can be drawn to directly.
pub(super) fn block_layouts(
    outputs: &[(OutputPlan, OutputTarget, Option<BlockTarget>)],
    blocks: &[PlannedBlock],
) -> Vec<BlockLayout> {
    let mut layouts = vec![BlockLayout::default(); outputs.len()];
    let mut counts = vec![0_u32; outputs.len()];
    for planned in blocks {
        let output = planned.output;
        let layout = &mut layouts[output];
        let wanted = planned.block.wanted;
        layout.size[0] = layout.size[0].max(wanted.x + wanted.width);
        layout.size[1] = layout.size[1].max(wanted.y + wanted.height);
        counts[output] += 1;
        layout.direct = counts[output] == 1
            && (wanted.x, wanted.y) == (0, 0)
            && outputs[output].0.size_px == [wanted.width, wanted.height];
    }
    layouts
}

/// Copies a block's wanted part to its place in the output.
pub(super) fn copy_block(
    encoder: &mut wgpu::CommandEncoder,
    block_texture: &wgpu::Texture,
    target: &OutputTarget,
    channel: &ChannelPlan,
    block: &Block,
) {
    let wanted = block.wanted;
    let on_canvas = (block.area.x + wanted.x, block.area.y + wanted.y);
    let [left, top] = channel.output_px;
    let place = wgpu::Origin3d {
        x: left + on_canvas.0 - channel.canvas_px.x,
        y: top + on_canvas.1 - channel.canvas_px.y,
        z: 0,
    };
    encoder.copy_texture_to_texture(
        wgpu::TexelCopyTextureInfo {
            origin: wgpu::Origin3d {
                x: wanted.x,
                y: wanted.y,
                z: 0,
            },
            ..block_texture.as_image_copy()
        },
        wgpu::TexelCopyTextureInfo {
            origin: place,
            ..target.texture.as_image_copy()
        },
        wgpu::Extent3d {
            width: wanted.width,
            height: wanted.height,
            depth_or_array_layers: 1,
        },
    );
}
