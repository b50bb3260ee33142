//! What a scene asks of its layers: where data lies, how it is processed and fused, and lenses.
//! Plain data in f64, as an operator gives it. It opens nothing and knows no GPU: uniforms are made of it in
//! `process`.

use std::path::PathBuf;

/// One layer of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerData {
    /// Unique among the layers.
    pub name: String,
    /// Directory of the repository; `None` for layers that are made from elevation.
    pub repository: Option<PathBuf>,
    /// How it is shown.
    pub parameters: LayerParameters,
}

/// A circle on the ellipsoid within which layers have other parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct LensData {
    /// Unique among the lenses.
    pub name: String,
    /// Geodetic latitude of the centre, −90…90.
    pub latitude_deg: f64,
    /// Longitude of the centre, −180…180.
    pub longitude_deg: f64,
    /// Radius along the ground in metres, > 0.
    pub radius_m: f64,
    /// Index of a layer, and all its parameters within the lens.
    pub layers: Vec<(usize, LayerParameters)>,
}

/// All that can be adjusted of a layer.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerParameters {
    /// How it meets other layers.
    pub fusion: Fusion,
    /// From raw samples to heights or colours.
    pub process: Process,
}

/// How a layer meets others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fusion {
    /// Larger lies above.
    pub priority: i32,
    /// Share among layers of equal priority and blend, ≥ 0; 0 takes the layer away.
    pub weight: f64,
    /// 0…1.
    pub opacity: f64,
    /// How it is laid over what is below.
    pub blend: Blend,
}

/// Blend modes, in the order in which layers of one priority are laid over each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Blend {
    /// Covers what is below.
    Normal,
    /// Product.
    Multiply,
    /// Complement of the product of complements. Not for heights.
    Screen,
    /// Sum.
    Add,
}

/// What is done with a layer's samples.
#[derive(Clone, Debug, PartialEq)]
pub enum Process {
    /// Heights.
    Elevation(Elevation),
    /// Colours.
    Imagery(Imagery),
    /// Radar amplitude.
    Sar(Sar),
    /// Colours by height.
    Ramp(Ramp),
    /// Lines of equal height.
    Isolines(Isolines),
    /// Colours by steepness.
    Slope(Slope),
    /// Colours by the direction of descent.
    Aspect(Aspect),
    /// Light from one direction.
    Hillshade(Hillshade),
}

/// Heights: clamp((raw + datum_shift_m) · scale + offset_m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elevation {
    /// Exaggeration, ≥ 0.
    pub scale: f64,
    /// Added last, metres.
    pub offset_m: f64,
    /// From the data's vertical datum to the ellipsoid, metres.
    pub datum_shift_m: f64,
    /// Lowest and highest result, metres.
    pub clamp_m: [f64; 2],
}

/// Colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imagery {
    /// Light is multiplied by 2 to this power.
    pub exposure_stops: f64,
    /// About the middle grey; 1 changes nothing.
    pub contrast: f64,
    /// 0 is grey, 1 changes nothing.
    pub saturation: f64,
    /// Exponent 1/gamma of the result; 1 changes nothing.
    pub gamma: f64,
    /// The data's channels that are shown as red, green and blue.
    pub channels: [u8; 3],
    /// Samples shown as 0 and 1; `None`: 0…255 for bytes, else the data's own range.
    pub range: Option<[f64; 2]>,
    /// Factors of red, green and blue.
    pub tint: [f64; 3],
}

/// Radar amplitude to grey (Lambers, §2.2.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sar {
    /// Which equation.
    pub mapping: SarMapping,
    /// Amplitudes shown as 0 and 1; `None`: 0 to mean + 3 deviations.
    pub range: Option<[f64; 2]>,
    /// c of eq. 2.4, ≥ 1.
    pub strength: f64,
    /// γ of eq. 2.5, 0…1.
    pub exponent: f64,
    /// Factors of red, green and blue.
    pub tint: [f64; 3],
}

/// Mappings of radar amplitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SarMapping {
    /// Eq. 2.3.
    Linear,
    /// Eq. 2.4.
    Logarithmic,
    /// Eq. 2.5.
    Gamma,
}

/// Colours by height, linear between stops.
#[derive(Clone, Debug, PartialEq)]
pub struct Ramp {
    /// 2…32 stops, rising.
    pub stops: Vec<RampStop>,
}

/// The colour of a height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RampStop {
    /// Metres.
    pub height_m: f64,
    /// Gamma encoded red, green, blue, 0…1.
    pub colour: [f64; 3],
}

/// Lines of equal height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Isolines {
    /// Metres between lines.
    pub spacing_m: f64,
    /// Width in wall pixels.
    pub width_px: f64,
    /// Each how-manieth line is bold; 0: none.
    pub bold_every: u32,
    /// Width of bold lines in wall pixels.
    pub bold_width_px: f64,
    /// Gamma encoded red, green, blue, 0…1.
    pub colour: [f64; 3],
}

/// Colours by steepness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slope {
    /// Steepness of the gentle and of the steep colour, degrees.
    pub range_deg: [f64; 2],
    /// Gamma encoded red, green, blue, 0…1.
    pub gentle: [f64; 3],
    /// Gamma encoded red, green, blue, 0…1.
    pub steep: [f64; 3],
}

/// Colours by the direction of descent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aspect {
    /// 0…1.
    pub saturation: f64,
    /// 0…1.
    pub brightness: f64,
    /// Gentler ground has no direction and stays transparent, degrees.
    pub flat_below_deg: f64,
}

/// Light from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hillshade {
    /// Where the light stands, clockwise from north, degrees.
    pub azimuth_deg: f64,
    /// How high it stands, degrees.
    pub altitude_deg: f64,
    /// Factor on slopes.
    pub exaggeration: f64,
}

impl Imagery {
    /// Whether bytes are shown as they are.
    pub(crate) fn changes_nothing(&self) -> bool {
        (self.exposure_stops, self.contrast, self.saturation) == (0.0, 1.0, 1.0)
            && (self.gamma, self.tint) == (1.0, [1.0; 3])
            && self.range.is_none_or(|range| range == [0.0, 255.0])
    }
}

impl Process {
    /// Whether the result is heights.
    pub(crate) fn makes_heights(&self) -> bool {
        matches!(self, Self::Elevation(_))
    }

    /// What a repository must hold, where one is needed.
    pub(crate) fn data_kind(&self) -> Option<tiles::Kind> {
        match self {
            Self::Elevation(_) => Some(tiles::Kind::Elevation),
            Self::Imagery(_) => Some(tiles::Kind::Imagery),
            Self::Sar(_) => Some(tiles::Kind::Sar),
            _ => None,
        }
    }
}
