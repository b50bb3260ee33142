//! From a layer's parameters to the stage that applies them and its uniform.
//! In: parameters as an operator gives them, a tile where geometry counts. Out: stage and uniform. No
//! device, no data.

use bytemuck::{Pod, bytes_of};
use geodesy::frame::scalar_f32;
use geodesy::{Ellipsoid, Tile};
use shaders::{
    AspectUniform, ElevationUniform, FuseInput, FuseUniform, HillshadeUniform, ImageryUniform,
    IsolinesUniform, LensUniform, RampUniform, ResampleUniform, SampleForm, SarUniform,
    SlopeUniform, Stage, TileGeometry,
};

use crate::layer::{Blend, Elevation, Fusion, Imagery, Process, Ramp, Sar, SarMapping};
use crate::process::stages::MOST_INPUTS;

/// A stage and its uniform's bytes.
pub(crate) type Step = (Stage, Vec<u8>);

/// What all tiles of a scene have in common.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ground {
    pub(crate) ellipsoid: Ellipsoid,
    /// Samples of a tile in a wall pixel, on average over the distances at which tiles split.
    pub(crate) samples_per_px: f64,
}

impl Ground {
    pub(crate) fn new(ellipsoid: Ellipsoid, tile_px: f64) -> Self {
        // A tile splits when it covers tile_px pixels a side, so it covers between half of that and all of it.
        let at_most = geodesy::CELLS as f64 / tile_px.max(1.0);
        Self {
            ellipsoid,
            samples_per_px: at_most * std::f64::consts::SQRT_2,
        }
    }
}

fn step<T: Pod>(stage: Stage, uniform: &T) -> Step {
    (stage, bytes_of(uniform).to_vec())
}

/// The stage that turns samples of a layer into heights or colours. `sar_range` is that of the data, used where
/// the parameters give none. `None` where nothing has to be done.
pub(crate) fn process(
    process: &Process,
    ground: &Ground,
    tile: Tile,
    sar_range: [f64; 2],
) -> Option<Step> {
    Some(match process {
        Process::Elevation(elevation) => {
            let identity = elevation.scale == 1.0
                && elevation.offset_m == 0.0
                && elevation.datum_shift_m == 0.0
                && elevation.clamp_m[0] <= -100_000.0
                && elevation.clamp_m[1] >= 100_000.0;
            if identity {
                return None;
            }
            step(Stage::Elevation, &elevation_uniform(elevation))
        }
        Process::Imagery(imagery) => step(Stage::Imagery, &imagery_uniform(imagery)),
        Process::Sar(sar) => {
            let stage = match sar.mapping {
                SarMapping::Linear => Stage::SarLinear,
                SarMapping::Logarithmic => Stage::SarLogarithmic,
                SarMapping::Gamma => Stage::SarGamma,
            };
            step(stage, &sar_uniform(sar, sar_range))
        }
        Process::Ramp(ramp) => step(Stage::Ramp, &ramp_uniform(ramp)),
        Process::Isolines(lines) => {
            let half = |width_px: f64| scalar_f32(0.5 * width_px * ground.samples_per_px);
            step(
                Stage::Isolines,
                &IsolinesUniform {
                    spacing_m: scalar_f32(lines.spacing_m),
                    half_width: half(lines.width_px),
                    bold_half_width: half(lines.bold_width_px),
                    bold_every: lines.bold_every,
                    colour: colour(lines.colour),
                },
            )
        }
        Process::Slope(slope) => step(
            Stage::Slope,
            &SlopeUniform {
                tile: geometry(&ground.ellipsoid, tile),
                range_deg: slope.range_deg.map(scalar_f32),
                padding: [0; 2],
                gentle: colour(slope.gentle),
                steep: colour(slope.steep),
            },
        ),
        Process::Aspect(aspect) => step(
            Stage::Aspect,
            &AspectUniform {
                tile: geometry(&ground.ellipsoid, tile),
                saturation: scalar_f32(aspect.saturation),
                brightness: scalar_f32(aspect.brightness),
                flat_sine: scalar_f32(aspect.flat_below_deg.to_radians().sin()),
                padding: 0,
            },
        ),
        Process::Hillshade(shade) => {
            let (east, north) = shade.azimuth_deg.to_radians().sin_cos();
            let (up, level) = shade.altitude_deg.to_radians().sin_cos();
            step(
                Stage::Hillshade,
                &HillshadeUniform {
                    tile: geometry(&ground.ellipsoid, tile),
                    light: [east * level, north * level, up].map(scalar_f32),
                    exaggeration: scalar_f32(shade.exaggeration),
                },
            )
        }
    })
}

/// Heights.
pub(crate) fn elevation_uniform(elevation: &Elevation) -> ElevationUniform {
    ElevationUniform {
        scale: scalar_f32(elevation.scale),
        datum_shift_m: scalar_f32(elevation.datum_shift_m),
        offset_m: scalar_f32(elevation.offset_m),
        lowest_m: scalar_f32(elevation.clamp_m[0]),
        highest_m: scalar_f32(elevation.clamp_m[1]),
        padding: [0; 3],
    }
}

fn imagery_uniform(imagery: &Imagery) -> ImageryUniform {
    ImageryUniform {
        gain: scalar_f32(imagery.exposure_stops.exp2()),
        contrast: scalar_f32(imagery.contrast),
        saturation: scalar_f32(imagery.saturation),
        inverse_gamma: scalar_f32(1.0 / imagery.gamma),
        tint: colour(imagery.tint),
    }
}

fn sar_uniform(sar: &Sar, of_data: [f64; 2]) -> SarUniform {
    let [lowest, highest] = sar.range.unwrap_or(of_data);
    SarUniform {
        lowest: scalar_f32(lowest),
        highest: scalar_f32(highest),
        strength: scalar_f32(sar.strength),
        exponent: scalar_f32(sar.exponent),
        tint: colour(sar.tint),
    }
}

fn ramp_uniform(ramp: &Ramp) -> RampUniform {
    let mut heights = [[0.0; 4]; 8];
    let mut colours = [[0; 4]; 8];
    let places = heights
        .as_flattened_mut()
        .iter_mut()
        .zip(colours.as_flattened_mut());
    let mut count = 0;
    for ((height, colour), stop) in places.zip(&ramp.stops) {
        *height = scalar_f32(stop.height_m);
        let [red, green, blue] = stop
            .colour
            .map(|part| (part.clamp(0.0, 1.0) * 255.0).round() as u8);
        *colour = u32::from_le_bytes([red, green, blue, 255]);
        count += 1;
    }
    RampUniform {
        count,
        padding: [0; 3],
        heights,
        colours,
    }
}

fn colour(colour: [f64; 3]) -> [f32; 4] {
    let [red, green, blue] = colour.map(scalar_f32);
    [red, green, blue, 1.0]
}

/// Where a tile's nodes lie on its face.
pub(crate) fn geometry(ellipsoid: &Ellipsoid, tile: Tile) -> TileGeometry {
    let radius_m = 0.5 * (ellipsoid.semi_major_m + ellipsoid.semi_minor_m);
    TileGeometry::new(
        tile.face().number(),
        tile.level(),
        tile.x(),
        tile.y(),
        scalar_f32(radius_m),
    )
}

/// Brings an ancestor's samples to a tile's lattice.
pub(crate) fn resample(tile: Tile, source: Tile, colours: bool) -> Step {
    let shift = u32::from(tile.level().saturating_sub(source.level()));
    let cells = geodesy::CELLS;
    let along = |fine: u32, coarse: u32| {
        let first = (i64::from(fine) - (i64::from(coarse) << shift)) * cells;
        i32::try_from(first).unwrap_or(i32::MAX)
    };
    step(
        Stage::Resample,
        &ResampleUniform {
            origin: [along(tile.x(), source.x()), along(tile.y(), source.y())],
            shift,
            form: if colours {
                SampleForm::RawColour as u32
            } else {
                SampleForm::Number as u32
            },
        },
    )
}

/// Fuses layers that are sorted by priority and blend.
pub(crate) fn fuse(inputs: &[Fusion]) -> FuseUniform {
    let mut uniform = FuseUniform {
        count: 0,
        padding: [0; 3],
        inputs: [FuseInput {
            weight: 0.0,
            opacity: 0.0,
            blend: 0,
            group: 0,
        }; MOST_INPUTS],
    };
    let mut group = 0;
    let mut last: Option<(i32, Blend)> = None;
    for (slot, fusion) in uniform.inputs.iter_mut().zip(inputs) {
        let of = (fusion.priority, fusion.blend);
        group += u32::from(last.is_some_and(|last| last != of));
        last = Some(of);
        *slot = FuseInput {
            weight: scalar_f32(fusion.weight),
            opacity: scalar_f32(fusion.opacity),
            blend: match fusion.blend {
                Blend::Normal => shaders::Blend::Normal,
                Blend::Multiply => shaders::Blend::Multiply,
                Blend::Screen => shaders::Blend::Screen,
                Blend::Add => shaders::Blend::Add,
            } as u32,
            group,
        };
        uniform.count += 1;
    }
    uniform
}

/// A circle on a tile's lattice.
pub(crate) fn lens(circle: &geodesy::Circle, tile: Tile) -> LensUniform {
    let polynomial = circle.polynomial(tile);
    let mut coefficients = [[0.0; 4]; 21];
    for (place, coefficient) in coefficients
        .as_flattened_mut()
        .iter_mut()
        .zip(&polynomial.coefficients)
    {
        *place = scalar_f32(*coefficient);
    }
    LensUniform {
        degree: polynomial.degree as u32,
        padding: [0; 3],
        coefficients,
    }
}
