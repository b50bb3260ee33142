//! How fast the processing stages are on a device, beside copies of the same bytes.
//! In: a device, one tile's words of each form. Out: tiles a second per stage. For the bench; nothing that is drawn
//! passes here.

use std::time::{Duration, Instant};

use bytemuck::bytes_of;
use geodesy::{Ellipsoid, Tile};
use shaders::{INVALID_WORD, ReliefUniform, Stage, SurfaceUniform};

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::layer::{
    Aspect, Blend, Elevation, Fusion, Hillshade, Imagery, Isolines, Process, Ramp, RampStop, Sar,
    SarMapping, Slope,
};
use crate::layers::{LAYER_SIDE, LayerArrays};
use crate::process::{
    Dispatch, Ground, MOST_INPUTS, SLOT_SIDE, Slot, Slots, Stages, fuse, uniforms,
};

/// How long each stage is run.
const MEASURED: Duration = Duration::from_millis(300);
/// Tiles of one submission, each with slots of its own: together more than a processor's caches hold.
const AT_ONCE: usize = 24;

/// The speed of one stage.
#[derive(Clone, Debug, PartialEq)]
pub struct StageTiming {
    /// Name of the stage, or "copy".
    pub name: String,
    /// Tiles a second.
    pub tiles_per_second: f64,
    /// Bytes read and written for one tile.
    pub bytes: u64,
    /// How long the first tile took: compilation for the device included.
    pub first: Duration,
}

/// A tile's words, 275×275 each, as the stages take them.
#[derive(Clone, Debug)]
pub struct SampleWords {
    /// Heights in metres, bits of f32.
    pub heights: Vec<u32>,
    /// Raw colours, 10:10:10:2.
    pub raw_colours: Vec<u32>,
    /// Processed colours, RGBA.
    pub colours: Vec<u32>,
}

impl SampleWords {
    /// Hills with some holes, and colours that follow them: no two neighbours alike, all branches taken.
    #[must_use]
    pub fn hills() -> Self {
        let side = SLOT_SIDE as usize;
        let height = |node: usize| {
            let (x, y) = ((node % side) as f32, (node / side) as f32);
            1500.0 + 900.0 * (x * 0.05).sin() * (y * 0.04).cos() + 40.0 * (x * 0.9).sin()
        };
        let nodes = || 0..side * side;
        let hole = |node: usize| node % 4096 < 8;
        let grey = |node: usize| (height(node) * 0.09) as u32 & 255;
        Self {
            heights: nodes()
                .map(|node| {
                    if hole(node) {
                        INVALID_WORD
                    } else {
                        height(node).to_bits()
                    }
                })
                .collect(),
            raw_colours: nodes()
                .map(|node| {
                    let grey = grey(node) * 4;
                    if hole(node) {
                        0
                    } else {
                        3 << 30 | grey << 20 | (1023 - grey) << 10 | grey
                    }
                })
                .collect(),
            colours: nodes()
                .map(|node| {
                    let grey = grey(node);
                    if hole(node) {
                        0
                    } else {
                        u32::from_le_bytes([grey as u8, 255 - grey as u8, 90, 255])
                    }
                })
                .collect(),
        }
    }
}

/// Measures every compute stage, and last a copy of one slot to another.
pub fn time_stages(gpu: &Gpu, words: &SampleWords) -> Result<Vec<StageTiming>, RenderError> {
    // As deep as global data goes and local data begins.
    let mut tile = Tile::ROOTS[0];
    while let (true, Some(children)) = (tile.level() < 8, tile.children()) {
        tile = children[usize::from(tile.level() % 4)];
    }
    let mut slots = Slots::new(u64::MAX);
    let mut stages = Stages::new(gpu);
    let forms = [
        &words.heights,
        &words.raw_colours,
        &words.colours,
        &words.colours,
    ];
    for (form, words) in forms.into_iter().enumerate() {
        for index in 0..AT_ONCE {
            slots.lend(gpu, (tile, (form * AT_ONCE + index) as u64), 1);
            if let Some(slot) = slots.peek((tile, (form * AT_ONCE + index) as u64)) {
                slot.write(gpu, words);
            }
        }
    }
    let arrays = LayerArrays::new(gpu, 4);
    let of_form = |form: usize| -> Vec<&Slot> {
        let keys = (form * AT_ONCE..(form + 1) * AT_ONCE).map(|content| (tile, content as u64));
        keys.filter_map(|key| slots.peek(key)).collect()
    };
    let [heights, raw, colours, results] = [0, 1, 2, 3].map(of_form);
    let slot_bytes = words.heights.len() as u64 * 4;
    let layer_bytes = u64::from(LAYER_SIDE) * u64::from(LAYER_SIDE) * 4;
    let mut timings = Vec::new();
    for stage in Stage::ALL.into_iter().filter(|stage| stage.is_compute()) {
        let uniform = uniform_of(stage, tile);
        let input = match stage {
            Stage::Imagery => &raw,
            Stage::FuseColour | Stage::Surface | Stage::Lens => &colours,
            _ => &heights,
        };
        let (array, side, written) = match stage {
            Stage::Relief => (Some(&arrays.relief_view), LAYER_SIDE, layer_bytes),
            Stage::Surface => (Some(&arrays.imagery_view), LAYER_SIDE, layer_bytes),
            _ => (None, SLOT_SIDE, slot_bytes),
        };
        let read = stage.inputs().max(1);
        let mut run = |tiles: usize| {
            for index in 0..tiles {
                let inputs: Vec<&wgpu::TextureView> = (0..read)
                    .map(|other| &input[(index + other) % input.len()].view)
                    .collect();
                stages.run(
                    gpu,
                    &Dispatch {
                        stage,
                        uniform: &uniform,
                        result: array.unwrap_or(&results[index].view),
                        inputs: &inputs,
                        side,
                    },
                )?;
            }
            stages.submit(gpu);
            Ok(gpu.wait()?)
        };
        let begin = Instant::now();
        run(1)?;
        let first = begin.elapsed();
        let tiles_per_second = measure(|| run(AT_ONCE))?;
        timings.push(StageTiming {
            name: stage.name().to_owned(),
            tiles_per_second,
            bytes: read as u64 * slot_bytes + written,
            first,
        });
    }
    let tiles_per_second = measure(|| {
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (from, to) in heights.iter().zip(&results) {
            encoder.copy_texture_to_texture(
                from.texture.as_image_copy(),
                to.texture.as_image_copy(),
                from.texture.size(),
            );
        }
        gpu.queue.submit([encoder.finish()]);
        Ok(gpu.wait()?)
    })?;
    timings.push(StageTiming {
        name: "copy".to_owned(),
        tiles_per_second,
        bytes: 2 * slot_bytes,
        first: Duration::ZERO,
    });
    Ok(timings)
}

/// Rounds of [`AT_ONCE`] tiles for a while; tiles a second.
fn measure(mut round: impl FnMut() -> Result<(), RenderError>) -> Result<f64, RenderError> {
    round()?;
    let begin = Instant::now();
    let mut tiles = 0;
    while begin.elapsed() < MEASURED {
        round()?;
        tiles += AT_ONCE;
    }
    Ok(tiles as f64 / begin.elapsed().as_secs_f64())
}

/// Parameters that leave nothing of a stage out.
fn uniform_of(stage: Stage, tile: Tile) -> Vec<u8> {
    let ground = Ground::new(Ellipsoid::EARTH, 257.0);
    let sar = |mapping| {
        Process::Sar(Sar {
            mapping,
            range: Some([0.0, 3000.0]),
            strength: 100.0,
            exponent: 0.7,
            tint: [1.0; 3],
        })
    };
    let process = match stage {
        Stage::Elevation => Process::Elevation(Elevation {
            scale: 1.5,
            offset_m: 10.0,
            datum_shift_m: 47.0,
            clamp_m: [-11_000.0, 9_000.0],
        }),
        Stage::Imagery => Process::Imagery(Imagery {
            exposure_stops: 0.3,
            contrast: 1.2,
            saturation: 0.8,
            gamma: 1.4,
            channels: [0, 1, 2],
            range: None,
            tint: [1.0, 0.9, 0.8],
        }),
        Stage::SarLinear => sar(SarMapping::Linear),
        Stage::SarLogarithmic => sar(SarMapping::Logarithmic),
        Stage::SarGamma => sar(SarMapping::Gamma),
        Stage::Ramp => Process::Ramp(Ramp {
            stops: (0..16)
                .map(|stop| RampStop {
                    height_m: f64::from(stop) * 200.0,
                    colour: [f64::from(stop) / 16.0, 0.5, 0.3],
                })
                .collect(),
        }),
        Stage::Isolines => Process::Isolines(Isolines {
            spacing_m: 100.0,
            width_px: 1.0,
            bold_every: 5,
            bold_width_px: 2.0,
            colour: [0.2, 0.1, 0.0],
        }),
        Stage::Slope => Process::Slope(Slope {
            range_deg: [0.0, 45.0],
            gentle: [1.0; 3],
            steep: [0.6, 0.0, 0.0],
        }),
        Stage::Aspect => Process::Aspect(Aspect {
            saturation: 0.8,
            brightness: 0.9,
            flat_below_deg: 1.0,
        }),
        Stage::Hillshade => Process::Hillshade(Hillshade {
            azimuth_deg: 315.0,
            altitude_deg: 45.0,
            exaggeration: 1.0,
        }),
        Stage::Resample => {
            let child = tile.children().map_or(tile, |children| children[3]);
            return uniforms::resample(child, tile, false).1;
        }
        Stage::FuseElevation | Stage::FuseColour => {
            let fusion = |priority: i32| Fusion {
                priority: priority / 2,
                weight: 1.0,
                opacity: 0.7,
                blend: Blend::Normal,
            };
            let inputs: Vec<Fusion> = (0..MOST_INPUTS as i32).map(fusion).collect();
            return bytes_of(&fuse(&inputs)).to_vec();
        }
        Stage::Lens => {
            let half = geodesy::CELLS / 2;
            let middle = geodesy::LatticePoint::of_tile(tile, half, half).normal();
            let (latitude_deg, longitude_deg) = Ellipsoid::angles_deg(middle);
            let circle =
                geodesy::Circle::new(&Ellipsoid::EARTH, latitude_deg, longitude_deg, 12_000.0);
            return circle.map_or_else(
                |_| Vec::new(),
                |circle| bytes_of(&uniforms::lens(&circle, tile)).to_vec(),
            );
        }
        Stage::Relief => {
            let uniform = ReliefUniform {
                tile: uniforms::geometry(&Ellipsoid::EARTH, tile),
                layer: 1,
                padding: [0; 3],
            };
            return bytes_of(&uniform).to_vec();
        }
        Stage::Surface => {
            let uniform = SurfaceUniform {
                ground: [0.5, 0.5, 0.5, 1.0],
                layer: 1,
                padding: [0; 3],
            };
            return bytes_of(&uniform).to_vec();
        }
        Stage::Terrain
        | Stage::Wireframe
        | Stage::Atmosphere
        | Stage::Copy
        | Stage::Warp
        | Stage::Light
        | Stage::Stereo => return Vec::new(),
    };
    uniforms::process(&process, &ground, tile, [0.0, 1.0])
        .map_or_else(Vec::new, |(_, uniform)| uniform)
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::print_stderr,
        reason = "a test that panics has failed"
    )]

    use super::*;

    #[test]
    fn every_compute_stage_has_a_speed() {
        let Some(gpu) = crate::device_tests::device() else {
            return;
        };
        let timings = time_stages(&gpu, &SampleWords::hills()).unwrap();
        let stages = Stage::ALL.iter().filter(|stage| stage.is_compute()).count();
        assert_eq!(timings.len(), stages + 1);
        for timing in &timings {
            eprintln!("{timing:?}");
            assert!(timing.tiles_per_second > 1.0, "{timing:?}");
        }
    }
}
