//! Every key of a scene that sets a value, with its range: the only place where they are listed.
//! In: a thing of the scene. Out: its keys and where their values are. Defaults are those of the types.

use super::fields::{Field, Keyed};
use super::layer::{Blend, Fusion, LayerKind, LayerParameters};
use super::lens::Lens;
use super::process::{
    Aspect, Elevation, Hillshade, Imagery, Isolines, Process, RampName, Sar, SarMapping, Slope,
};
use super::slot::{ABOVE_ZERO, Named, Slot};
use super::{Atmosphere, Light, MeshOptions, Refine, Sun};
use crate::camera::{Orbit, Place};

/// Farthest viewpoint: far enough for any picture, near enough for fixed-point positions.
const MAX_ALTITUDE_M: f64 = 1e11;
/// Lowest viewpoint: below the deepest sea floor.
const MIN_ALTITUDE_M: f64 = -12_000.0;
/// Largest lens: an eighth of the way around the Earth.
const MAX_RADIUS_M: f64 = 5e6;
/// Farthest results of elevation from the ellipsoid: what tiles can store.
const MAX_HEIGHT_M: f64 = 500_000.0;
/// Largest samples and amplitudes that a range may name.
const MAX_SAMPLE: f64 = 1e12;
/// Last channel that can be picked.
const MAX_CHANNEL: u8 = 15;

impl Named for LayerKind {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Elevation, "elevation"),
        (Self::Imagery, "imagery"),
        (Self::Sar, "sar"),
        (Self::Ramp, "ramp"),
        (Self::Isolines, "isolines"),
        (Self::Slope, "slope"),
        (Self::Aspect, "aspect"),
        (Self::Hillshade, "hillshade"),
    ];
}

impl Named for Blend {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Normal, "normal"),
        (Self::Multiply, "multiply"),
        (Self::Screen, "screen"),
        (Self::Add, "add"),
    ];
}

impl Named for SarMapping {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Linear, "linear"),
        (Self::Logarithmic, "logarithmic"),
        (Self::Gamma, "gamma"),
    ];
}

impl Named for RampName {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::LandAndSea, "land-and-sea"),
        (Self::Land, "land"),
        (Self::Sea, "sea"),
        (Self::Grey, "grey"),
        (Self::Hypsometric, "hypsometric"),
    ];
}

impl Named for Refine {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Off, "off"),
        (Self::Fine, "fine"),
        (Self::BottomUp, "bottom-up"),
        (Self::TopDown, "top-down"),
    ];
}

impl Keyed for LayerParameters {
    fn fields(&mut self) -> Vec<Field<'_>> {
        let mut fields = self.fusion.fields();
        fields.extend(self.process.fields());
        fields
    }
}

impl Keyed for Fusion {
    fn fields(&mut self) -> Vec<Field<'_>> {
        vec![
            Field::whole("priority", &mut self.priority, -1000..=1000),
            Field::number("weight", &mut self.weight, 0.0..=1000.0),
            Field::number("opacity", &mut self.opacity, 0.0..=1.0),
            Field::new("blend", Slot::Choice(&mut self.blend)),
        ]
    }
}

impl Keyed for Process {
    fn fields(&mut self) -> Vec<Field<'_>> {
        match self {
            Self::Elevation(elevation) => elevation.fields(),
            Self::Imagery(imagery) => imagery.fields(),
            Self::Sar(sar) => sar.fields(),
            Self::Ramp(ramp) => vec![Field::new("ramp", Slot::Ramp(ramp))],
            Self::Isolines(isolines) => isolines.fields(),
            Self::Slope(slope) => slope.fields(),
            Self::Aspect(aspect) => aspect.fields(),
            Self::Hillshade(hillshade) => hillshade.fields(),
        }
    }
}

impl Keyed for Elevation {
    fn fields(&mut self) -> Vec<Field<'_>> {
        let heights_m = -MAX_HEIGHT_M..=MAX_HEIGHT_M;
        vec![
            Field::number("scale", &mut self.scale, 0.0..=100.0),
            Field::number("offset_m", &mut self.offset_m, -100_000.0..=100_000.0),
            Field::number("datum_shift_m", &mut self.datum_shift_m, -1000.0..=1000.0),
            Field::new("clamp_m", Slot::Interval(&mut self.clamp_m, heights_m)),
        ]
    }
}

impl Keyed for Imagery {
    fn fields(&mut self) -> Vec<Field<'_>> {
        let samples = -MAX_SAMPLE..=MAX_SAMPLE;
        let channels = Slot::Channels(&mut self.channels, MAX_CHANNEL);
        vec![
            Field::number("exposure_stops", &mut self.exposure_stops, -16.0..=16.0),
            Field::number("contrast", &mut self.contrast, 0.0..=8.0),
            Field::number("saturation", &mut self.saturation, 0.0..=8.0),
            Field::number("gamma", &mut self.gamma, 0.1..=10.0),
            Field::new("channels", channels),
            Field::new("range", Slot::OptionalInterval(&mut self.range, samples)),
            Field::colour("tint", &mut self.tint),
        ]
    }
}

impl Keyed for Sar {
    fn fields(&mut self) -> Vec<Field<'_>> {
        let amplitudes = 0.0..=MAX_SAMPLE;
        vec![
            Field::new("mapping", Slot::Choice(&mut self.mapping)),
            Field::new("range", Slot::OptionalInterval(&mut self.range, amplitudes)),
            Field::number("strength", &mut self.strength, 1.0..=1e6),
            Field::number("exponent", &mut self.exponent, 0.01..=1.0),
            Field::colour("tint", &mut self.tint),
        ]
    }
}

impl Keyed for Isolines {
    fn fields(&mut self) -> Vec<Field<'_>> {
        let widths_px = 0.1..=20.0;
        vec![
            Field::number("spacing_m", &mut self.spacing_m, 0.01..=100_000.0),
            Field::number("width_px", &mut self.width_px, widths_px.clone()),
            Field::whole("bold_every", &mut self.bold_every, 0..=100),
            Field::number("bold_width_px", &mut self.bold_width_px, widths_px),
            Field::colour("colour", &mut self.colour),
        ]
    }
}

impl Keyed for Slope {
    fn fields(&mut self) -> Vec<Field<'_>> {
        let steepness_deg = Slot::Interval(&mut self.range_deg, 0.0..=90.0);
        vec![
            Field::new("range_deg", steepness_deg),
            Field::colour("gentle", &mut self.gentle),
            Field::colour("steep", &mut self.steep),
        ]
    }
}

impl Keyed for Aspect {
    fn fields(&mut self) -> Vec<Field<'_>> {
        vec![
            Field::number("saturation", &mut self.saturation, 0.0..=1.0),
            Field::number("brightness", &mut self.brightness, 0.0..=1.0),
            Field::number("flat_below_deg", &mut self.flat_below_deg, 0.0..=90.0),
        ]
    }
}

impl Keyed for Hillshade {
    fn fields(&mut self) -> Vec<Field<'_>> {
        vec![
            Field::number("azimuth_deg", &mut self.azimuth_deg, 0.0..=360.0),
            Field::number("altitude_deg", &mut self.altitude_deg, 0.0..=90.0),
            Field::number("exaggeration", &mut self.exaggeration, 0.0..=100.0),
        ]
    }
}

impl Keyed for Lens {
    fn fields(&mut self) -> Vec<Field<'_>> {
        vec![
            Field::latitude(&mut self.latitude_deg),
            Field::longitude(&mut self.longitude_deg),
            Field::number("radius_m", &mut self.radius_m, ABOVE_ZERO..=MAX_RADIUS_M),
        ]
    }
}

impl Keyed for Place {
    fn fields(&mut self) -> Vec<Field<'_>> {
        let altitudes_m = MIN_ALTITUDE_M..=MAX_ALTITUDE_M;
        vec![
            Field::latitude(&mut self.latitude_deg),
            Field::longitude(&mut self.longitude_deg),
            Field::number("altitude_m", &mut self.altitude_m, altitudes_m),
            Field::number("heading_deg", &mut self.heading_deg, -360.0..=360.0),
            Field::number("pitch_deg", &mut self.pitch_deg, -90.0..=90.0),
            Field::number("roll_deg", &mut self.roll_deg, -180.0..=180.0),
        ]
    }
}

/// The centre of an orbit.
impl Keyed for Orbit {
    fn fields(&mut self) -> Vec<Field<'_>> {
        vec![
            Field::latitude(&mut self.centre_latitude_deg),
            Field::longitude(&mut self.centre_longitude_deg),
        ]
    }
}

impl Keyed for Sun {
    fn fields(&mut self) -> Vec<Field<'_>> {
        match self {
            Self::Camera => Vec::new(),
            Self::Fixed {
                latitude_deg,
                longitude_deg,
            } => vec![
                Field::latitude(latitude_deg),
                Field::longitude(longitude_deg),
            ],
        }
    }
}

impl Keyed for Light {
    fn fields(&mut self) -> Vec<Field<'_>> {
        vec![
            Field::number("ambient", &mut self.ambient, 0.0..=1.0),
            Field::number("relief", &mut self.relief, 0.0..=100.0),
        ]
    }
}

impl Keyed for Atmosphere {
    fn fields(&mut self) -> Vec<Field<'_>> {
        vec![
            Field::new("enabled", Slot::Flag(&mut self.enabled)),
            Field::number("thickness_m", &mut self.thickness_m, 1.0..=1e6),
            Field::colour("colour", &mut self.colour),
        ]
    }
}

impl Keyed for MeshOptions {
    fn fields(&mut self) -> Vec<Field<'_>> {
        // Coarser tiles are too curved to be drawn within τ from near.
        let levels = 8..=i64::from(geodesy::MAX_LEVEL);
        vec![
            Field::new("refine", Slot::Choice(&mut self.refine)),
            Field::number("tau", &mut self.tau, 0.05..=100.0),
            Field::new("wireframe", Slot::Flag(&mut self.wireframe)),
            Field::whole("refinement", &mut self.refinement, 0..=7),
            Field::number("tile_px", &mut self.tile_px, 16.0..=4096.0),
            Field::whole("deepest_level", &mut self.deepest_level, levels),
        ]
    }
}
