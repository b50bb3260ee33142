//! Blocks of all outputs: which there are, where they go, and what ground lies under a pixel of them.
//! In: outputs, a view. Out: blocks in a fixed order, layouts, copies. It draws nothing.

use geodesy::Ellipsoid;
use glam::DVec3;

use crate::canvas::{Block, PixelRect};
use crate::finish::on_target;
use crate::loaded::LoadedScene;
use crate::outputs::{ChannelPlan, ChannelSource, OutputPlan};
use crate::ranges::Ranges;
use crate::renderer::{Renderer, ViewPoint};
use crate::target::{BlockLayout, BlockTarget, OutputTarget};

/// A block, and which channel of which output it is drawn for.
pub(crate) struct PlannedBlock {
    pub(crate) output: usize,
    pub(crate) channel: usize,
    /// Which part of a channel that is warped.
    pub(crate) part: Option<usize>,
    /// Which eye sees it.
    pub(crate) eye: usize,
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
            let rect = channel.output_px;
            let (left, top) = (f64::from(rect.x), f64::from(rect.y));
            (left..left + f64::from(rect.width)).contains(&x)
                && (top..top + f64::from(rect.height)).contains(&y)
        })?;
        let [x, y] = [
            x - f64::from(channel.output_px.x),
            y - f64::from(channel.output_px.y),
        ];
        let (seen, ray) = match &channel.source {
            ChannelSource::Canvas {
                view: number,
                origin_px,
            } => {
                let seen = view.views.get(*number)?;
                let [left, top] = origin_px.map(f64::from);
                (seen, seen.screen.ray_through([x + left, y + top]))
            }
            ChannelSource::Warped { warp, map } => {
                let (column, row) = (x as u32, y as u32);
                let part = view.warps.get(*warp)?.iter().find(|part| {
                    let rect = part.rect_px;
                    (rect.x..rect.x + rect.width).contains(&column)
                        && (rect.y..rect.y + rect.height).contains(&row)
                })?;
                (
                    view.views.get(part.view)?,
                    map.point_m(column, row)? - part.eye_m,
                )
            }
        };
        let eye = *view.eyes.get(seen.eye)?;
        let ray = view.room * ray;
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
            let mut add = |eye: usize, part: Option<usize>, block: Block| {
                blocks.push(PlannedBlock {
                    output,
                    channel: index,
                    part,
                    eye,
                    block,
                });
            };
            match &channel.source {
                ChannelSource::Canvas {
                    view: number,
                    origin_px,
                } => {
                    let Some(seen) = view.views.get(*number) else {
                        continue;
                    };
                    let wanted = PixelRect {
                        x: origin_px[0],
                        y: origin_px[1],
                        ..channel.output_px
                    };
                    for block in seen.screen.blocks(wanted, view.room) {
                        add(seen.eye, None, block);
                    }
                }
                ChannelSource::Warped { warp, .. } => {
                    let parts = view.warps.get(*warp).map_or(&[][..], Vec::as_slice);
                    for (number, part) in parts.iter().enumerate() {
                        let seen = view.views.get(part.view);
                        if let Some(seen) = seen
                            && let Some(block) = seen.screen.whole(view.room)
                        {
                            add(seen.eye, Some(number), block);
                        }
                    }
                }
            }
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
            .get(planned.eye)
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
        let plan = &outputs[output].0;
        let plain = plan
            .channels
            .get(planned.channel)
            .is_some_and(|channel| channel.is_plain(plan));
        layout.direct = counts[output] == 1
            && plain
            && plan.stereo.is_none()
            && (wanted.x, wanted.y) == (0, 0)
            && plan.size_px == [wanted.width, wanted.height];
    }
    layouts
}

/// Copies a block's wanted part to its place in its channel's picture.
pub(super) fn copy_block(
    encoder: &mut wgpu::CommandEncoder,
    drawn: &wgpu::Texture,
    target: &wgpu::Texture,
    channel: &ChannelPlan,
    planned: &PlannedBlock,
) {
    let wanted = planned.block.wanted;
    let [x, y] = on_target(channel, planned);
    encoder.copy_texture_to_texture(
        wgpu::TexelCopyTextureInfo {
            origin: wgpu::Origin3d {
                x: wanted.x,
                y: wanted.y,
                z: 0,
            },
            ..drawn.as_image_copy()
        },
        wgpu::TexelCopyTextureInfo {
            origin: wgpu::Origin3d { x, y, z: 0 },
            ..target.as_image_copy()
        },
        wgpu::Extent3d {
            width: wanted.width,
            height: wanted.height,
            depth_or_array_layers: 1,
        },
    );
}

/// Pictures of outputs of which some channel has no block in this frame, by output and number: a head that a tracker
/// puts behind a screen sees nothing there.
pub(super) fn dark_pictures(
    outputs: &[(OutputPlan, OutputTarget, Option<BlockTarget>)],
    blocks: &[PlannedBlock],
) -> Vec<(usize, usize)> {
    let mut dark = Vec::new();
    for (output, (plan, _, _)) in outputs.iter().enumerate() {
        for (index, channel) in plan.channels.iter().enumerate() {
            let drawn =
                |planned: &PlannedBlock| (planned.output, planned.channel) == (output, index);
            if !blocks.iter().any(drawn) && !dark.contains(&(output, channel.picture)) {
                dark.push((output, channel.picture));
            }
        }
    }
    dark
}
