//! From drawn blocks to finished outputs: warps onto curved screens, blends, and brings both eyes together.
//!
//! In: outputs with their maps, views, the block just drawn. Out: passes that write an output's pictures. What is shown
//! pixel for pixel and unblended never comes here: it is copied.

use std::cell::OnceCell;
use std::collections::HashMap;

use geodesy::frame::{scalar_f32, vector_f32};
use glam::{DVec3, Vec3};
use shaders::{FinishUniform, LitUniform, Stage, StereoUniform, WarpUniform};

use crate::canvas::PlanarScreen;
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::outputs::{ChannelPlan, ChannelSource, OutputPlan, StereoMode, StereoPlan};
use crate::recorder::Recorder;
use crate::renderer::{PlannedBlock, ViewPoint};
use crate::scratch::{Growing, write_uniforms};
use crate::target::{COLOUR, ColourTarget, OutputTarget};

mod maps;

use maps::{ChannelMaps, light_texture, no_light};

/// Words of the largest uniform of these passes.
const WORDS: usize = size_of::<WarpUniform>() / 4;
/// The binding of the maps of light in each stage that has them.
const LIGHT_OF_WARP: u32 = 4;
const LIGHT_OF_LIT: u32 = 2;

/// The uniform of one pass.
#[derive(Clone, Copy, Debug)]
enum Job {
    Warp(WarpUniform),
    Lit(LitUniform),
    Stereo(StereoUniform),
}

/// What finishing needs.
#[derive(Debug)]
pub(crate) struct Finisher {
    warp: OnceCell<wgpu::RenderPipeline>,
    lit: OnceCell<wgpu::RenderPipeline>,
    stereo: OnceCell<wgpu::RenderPipeline>,
    sampler: wgpu::Sampler,
    uniforms: Growing,
    stride: u64,
    /// By output and channel.
    maps: HashMap<(usize, usize), ChannelMaps>,
    no_light: wgpu::TextureView,
    /// Which uniform a block has, and which an output.
    of_block: HashMap<usize, u64>,
    of_output: HashMap<usize, u64>,
}

impl Finisher {
    /// Brings the maps of all channels to the device.
    pub(crate) fn new(gpu: &Gpu, outputs: &[OutputPlan]) -> Result<Self, RenderError> {
        let mut maps = HashMap::new();
        for (output, plan) in outputs.iter().enumerate() {
            for (channel, planned) in plan.channels.iter().enumerate() {
                if !planned.is_plain(plan) {
                    maps.insert((output, channel), ChannelMaps::new(gpu, plan, planned)?);
                }
            }
        }
        Ok(Self {
            warp: OnceCell::new(),
            lit: OnceCell::new(),
            stereo: OnceCell::new(),
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("warp"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..wgpu::SamplerDescriptor::default()
            }),
            uniforms: Growing::new("finish", wgpu::BufferUsages::UNIFORM),
            stride: 0,
            maps,
            no_light: light_texture(gpu, [1, 1], &no_light()),
            of_block: HashMap::new(),
            of_output: HashMap::new(),
        })
    }

    /// Writes what all passes of a frame need. `texture_size` tells the size of what an output's blocks are drawn to.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        outputs: &[&OutputPlan],
        view: &ViewPoint,
        blocks: &[PlannedBlock],
        texture_size: &dyn Fn(usize) -> [u32; 2],
    ) {
        let mut jobs = Vec::new();
        self.of_block.clear();
        self.of_output.clear();
        for (index, planned) in blocks.iter().enumerate() {
            let Some(plan) = outputs.get(planned.output) else {
                continue;
            };
            let Some(channel) = plan.channels.get(planned.channel) else {
                continue;
            };
            if channel.is_plain(plan) {
                continue;
            }
            let size = texture_size(planned.output);
            if let Some(job) = job_of(plan, channel, view, planned, size) {
                self.of_block.insert(index, jobs.len() as u64);
                jobs.push(job);
            }
        }
        for (index, plan) in outputs.iter().enumerate() {
            if let Some(stereo) = plan.stereo {
                self.of_output.insert(index, jobs.len() as u64);
                jobs.push(Job::Stereo(stereo_uniform(stereo, plan)));
            }
        }
        let words: Vec<[u32; WORDS]> = jobs.iter().map(words_of).collect();
        self.stride = write_uniforms(gpu, &mut self.uniforms, &words);
    }

    /// Brings a block that was drawn to its channel's place.
    pub(crate) fn finish_block(
        &self,
        gpu: &Gpu,
        recorder: &mut Recorder<'_>,
        (index, planned): (usize, &PlannedBlock),
        (channel, view): (&ChannelPlan, &ViewPoint),
        drawn: &ColourTarget,
        target: &OutputTarget,
    ) -> Result<(), RenderError> {
        let (Some(job), Some(maps)) = (
            self.of_block.get(&index),
            self.maps.get(&(planned.output, planned.channel)),
        ) else {
            return Ok(());
        };
        let light = maps.light.as_ref().unwrap_or(&self.no_light);
        let texture = wgpu::BindingResource::TextureView;
        let place = channel.output_px;
        let (stage, resources, rect) = match (&channel.source, &maps.points) {
            (ChannelSource::Warped { warp, .. }, Some(points)) => {
                let part = planned
                    .part
                    .and_then(|part| view.warps.get(*warp)?.get(part));
                let Some(part) = part else { return Ok(()) };
                let resources = vec![
                    (0, self.uniform(*job, size_of::<WarpUniform>())?),
                    (1, texture(points)),
                    (2, texture(&drawn.light_view)),
                    (3, wgpu::BindingResource::Sampler(&self.sampler)),
                    (LIGHT_OF_WARP, texture(light)),
                ];
                let rect = part.rect_px;
                let rect = [place.x + rect.x, place.y + rect.y, rect.width, rect.height];
                (Stage::Warp, resources, rect)
            }
            _ => {
                let resources = vec![
                    (0, self.uniform(*job, size_of::<LitUniform>())?),
                    (1, texture(&drawn.view)),
                    (LIGHT_OF_LIT, texture(light)),
                ];
                let [x, y] = on_target(channel, planned);
                let wanted = planned.block.wanted;
                let rect = [x, y, wanted.width, wanted.height];
                (Stage::Light, resources, rect)
            }
        };
        let into = target.picture(channel.picture);
        let made = if stage == Stage::Warp {
            &self.warp
        } else {
            &self.lit
        };
        let pipeline = self.pipeline(gpu, made, stage)?;
        draw(gpu, recorder, stage, pipeline, &resources, into, rect)
    }

    /// Brings the pictures of both eyes together, where an output has two.
    pub(crate) fn finish_output(
        &self,
        gpu: &Gpu,
        recorder: &mut Recorder<'_>,
        index: usize,
        plan: &OutputPlan,
        target: &OutputTarget,
    ) -> Result<(), RenderError> {
        let Some(job) = self.of_output.get(&index) else {
            return Ok(());
        };
        let texture = wgpu::BindingResource::TextureView;
        let resources = [
            (0, self.uniform(*job, size_of::<StereoUniform>())?),
            (1, texture(target.picture(0))),
            (2, texture(target.picture(1))),
        ];
        let pipeline = self.pipeline(gpu, &self.stereo, Stage::Stereo)?;
        let [width, height] = plan.size_px;
        let rect = [0, 0, width, height];
        draw(
            gpu,
            recorder,
            Stage::Stereo,
            pipeline,
            &resources,
            &target.view,
            rect,
        )
    }

    fn uniform(&self, job: u64, bytes: usize) -> Result<wgpu::BindingResource<'_>, RenderError> {
        self.uniforms
            .part(job, self.stride, bytes as u64)
            .ok_or_else(|| RenderError::Mesh("a pass lacks its uniform".to_owned()))
    }

    fn pipeline<'a>(
        &self,
        gpu: &Gpu,
        cell: &'a OnceCell<wgpu::RenderPipeline>,
        stage: Stage,
    ) -> Result<&'a wgpu::RenderPipeline, RenderError> {
        if let Some(made) = cell.get() {
            return Ok(made);
        }
        let made = full_screen_pipeline(gpu, stage, COLOUR)?;
        Ok(cell.get_or_init(|| made))
    }
}

/// A pipeline that draws one triangle over everything.
pub(crate) fn full_screen_pipeline(
    gpu: &Gpu,
    stage: Stage,
    format: wgpu::TextureFormat,
) -> Result<wgpu::RenderPipeline, RenderError> {
    let module = gpu
        .device
        .create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(stage.name()),
            source: wgpu::ShaderSource::Wgsl(stage.source()?.into()),
        });
    Ok(gpu
        .device
        .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(stage.name()),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex_main"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment_main"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        }))
}

/// Draws into a rectangle of a picture, and leaves the rest of it as it is.
fn draw(
    gpu: &Gpu,
    recorder: &mut Recorder<'_>,
    stage: Stage,
    pipeline: &wgpu::RenderPipeline,
    resources: &[(u32, wgpu::BindingResource<'_>)],
    into: &wgpu::TextureView,
    [x, y, width, height]: [u32; 4],
) -> Result<(), RenderError> {
    let entries: Vec<_> = resources
        .iter()
        .map(|(binding, resource)| wgpu::BindGroupEntry {
            binding: *binding,
            resource: resource.clone(),
        })
        .collect();
    let bindings = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("finish"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    });
    recorder.render_pass(stage.name(), into, |pass| {
        pass.set_scissor_rect(x, y, width, height);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.draw(0..3, 0..1);
    })
}

/// Where the wanted part of a block lies in its channel's picture.
pub(crate) fn on_target(channel: &ChannelPlan, planned: &PlannedBlock) -> [u32; 2] {
    let (wanted, area) = (planned.block.wanted, planned.block.area);
    let origin_px = match channel.source {
        ChannelSource::Canvas { origin_px, .. } => origin_px,
        ChannelSource::Warped { .. } => [0, 0],
    };
    [
        channel.output_px.x + area.x + wanted.x - origin_px[0],
        channel.output_px.y + area.y + wanted.y - origin_px[1],
    ]
}

fn job_of(
    plan: &OutputPlan,
    channel: &ChannelPlan,
    view: &ViewPoint,
    planned: &PlannedBlock,
    texture_size: [u32; 2],
) -> Option<Job> {
    let place = [channel.output_px.x as i32, channel.output_px.y as i32];
    let uplift = channel.light.as_ref().map(|light| light.uplift);
    let uplift = uplift.unwrap_or_default();
    let finish = FinishUniform {
        dark: uplift.dark,
        bright: uplift.bright,
        padding: [0; 2],
        place,
        gamma: plan.gamma.map_or(0.0, scalar_f32),
        has_light: u32::from(channel.light.is_some()),
    };
    match &channel.source {
        ChannelSource::Warped { warp, .. } => {
            let part = view.warps.get(*warp)?.get(planned.part?)?;
            let screen = &view.views.get(part.view)?.screen;
            let [across, down, ahead] = rows_of(screen);
            Some(Job::Warp(WarpUniform {
                finish,
                eye: with_zero(vector_f32(part.eye_m)),
                across: with_zero(across),
                down: with_zero(down),
                ahead: with_zero(ahead),
                picture_size: screen.size_px.map(|side| side as f32),
                texture_size: texture_size.map(|side| side as f32),
            }))
        }
        ChannelSource::Canvas { .. } => {
            let wanted = planned.block.wanted;
            let [x, y] = on_target(channel, planned);
            Some(Job::Lit(LitUniform {
                finish,
                to_picture: [wanted.x as i32 - x as i32, wanted.y as i32 - y as i32],
                padding: [0; 2],
            }))
        }
    }
}

fn with_zero(vector: Vec3) -> [f32; 4] {
    vector.extend(0.0).to_array()
}

/// Products with a direction from the eye: pixels to the right and down in the view's picture, each times the depth,
/// and the depth itself (R. Kooima, "Generalized Perspective Projection", 2008, solved for pixels).
fn rows_of(screen: &PlanarScreen) -> [Vec3; 3] {
    let out = screen.right.cross(screen.up);
    let distance = -screen.lower_left_m.dot(out);
    let left = screen.lower_left_m.dot(screen.right);
    let top = screen.lower_left_m.dot(screen.up) + screen.size_m[1];
    let per_m = |axis: usize| f64::from(screen.size_px[axis]) / screen.size_m[axis];
    let across: DVec3 = (screen.right * distance + out * left) * per_m(0);
    let down: DVec3 = (screen.up * distance + out * top) * -per_m(1);
    // Distances of the plane scale all three alike, and f32 keeps them all.
    [across, down, -out].map(vector_f32)
}

fn stereo_uniform(stereo: StereoPlan, plan: &OutputPlan) -> StereoUniform {
    let (mode, left) = match stereo.mode {
        StereoMode::SideBySide => (0, [false; 3]),
        StereoMode::TopBottom => (1, [false; 3]),
        StereoMode::Anaglyph { left } => (2, left),
        StereoMode::Rows => (3, [false; 3]),
        StereoMode::Columns => (4, [false; 3]),
        StereoMode::Checkerboard => (5, [false; 3]),
    };
    let [red, green, blue] = left.map(|own| f32::from(u8::from(own)));
    StereoUniform {
        mode,
        swapped: u32::from(stereo.swapped),
        size: plan.size_px,
        left: [red, green, blue, plan.gamma.map_or(0.0, scalar_f32)],
    }
}

fn words_of(job: &Job) -> [u32; WORDS] {
    let bytes = match job {
        Job::Warp(uniform) => bytemuck::bytes_of(uniform),
        Job::Lit(uniform) => bytemuck::bytes_of(uniform),
        Job::Stereo(uniform) => bytemuck::bytes_of(uniform),
    };
    let mut words = [0; WORDS];
    for (word, bytes) in words.iter_mut().zip(bytes.chunks_exact(4)) {
        *word = bytemuck::pod_read_unaligned(bytes);
    }
    words
}
