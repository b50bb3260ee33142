//! What is done with a layer's samples: one type a kind, with its defaults, which show data as it is.
//! In: nothing. Out: plain types. Keys and ranges are in `keys`; it computes no pixel.
//! Colours are gamma encoded red, green, blue, each 0…1, as in pictures.

use serde::{Deserialize, Serialize};

use super::layer::LayerKind;
pub use super::ramps::{Ramp, RampName, RampStop};

/// What is done with a layer's samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Elevation {
    /// Exaggeration, 0…100.
    pub scale: f64,
    /// Added last, metres, −100,000…100,000.
    pub offset_m: f64,
    /// Height of the data's vertical datum above the ellipsoid, metres, −1000…1000.
    pub datum_shift_m: f64,
    /// Lowest and highest result, metres, within −500,000…500,000.
    pub clamp_m: [f64; 2],
}

/// Colours.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Imagery {
    /// Light is multiplied by 2 to this power, −16…16.
    pub exposure_stops: f64,
    /// About the middle grey, 0…8; 1 changes nothing.
    pub contrast: f64,
    /// 0…8: 0 is grey, 1 changes nothing.
    pub saturation: f64,
    /// The result's exponent is 1/gamma, 0.1…10; 1 changes nothing.
    pub gamma: f64,
    /// The data's channels that are shown as red, green and blue, each 0…15. Data of one channel shows it in all
    /// three with the default.
    pub channels: [u8; 3],
    /// Samples shown as 0 and 1; `None`: 0 and 255 for bytes, else the data's own range.
    pub range: Option<[f64; 2]>,
    /// Factors of red, green and blue, each 0…1.
    pub tint: [f64; 3],
}

/// Radar amplitude to grey (Lambers 2011, §2.2.3).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sar {
    /// Which equation.
    pub mapping: SarMapping,
    /// Amplitudes shown as 0 and 1 (t_min and t_max); `None`: 0 and the mean + 3 standard deviations.
    pub range: Option<[f64; 2]>,
    /// c of eq. 2.4, 1…10⁶.
    pub strength: f64,
    /// γ of eq. 2.5, 0.01…1.
    pub exponent: f64,
    /// Factors of red, green and blue, each 0…1.
    pub tint: [f64; 3],
}

/// Mappings of radar amplitude (Lambers 2011, §2.2.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum SarMapping {
    /// Eq. 2.3.
    Linear,
    /// Eq. 2.4.
    Logarithmic,
    /// Eq. 2.5.
    Gamma,
}

/// Lines of equal height.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Isolines {
    /// Metres between lines, 0.01…100,000.
    pub spacing_m: f64,
    /// Width in wall pixels, 0.1…20.
    pub width_px: f64,
    /// Each how-manieth line is bold, 0…100; 0: none.
    pub bold_every: u32,
    /// Width of bold lines in wall pixels, 0.1…20.
    pub bold_width_px: f64,
    /// Colour of all lines.
    pub colour: [f64; 3],
}

/// Colours by steepness.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Slope {
    /// Steepness that has the gentle and that has the steep colour, degrees, within 0…90.
    pub range_deg: [f64; 2],
    /// Colour of gentle ground.
    pub gentle: [f64; 3],
    /// Colour of steep ground.
    pub steep: [f64; 3],
}

/// Colours by the direction of descent: north red, then clockwise through the hues.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Aspect {
    /// Of the colours, 0…1.
    pub saturation: f64,
    /// Of the colours, 0…1.
    pub brightness: f64,
    /// Gentler ground has no direction and stays transparent, degrees, 0…90.
    pub flat_below_deg: f64,
}

/// Light from one direction, as on printed maps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hillshade {
    /// Where the light stands, clockwise from north, degrees, 0…360.
    pub azimuth_deg: f64,
    /// How high it stands, degrees, 0…90.
    pub altitude_deg: f64,
    /// Factor on slopes, 0…100.
    pub exaggeration: f64,
}

impl Process {
    /// The defaults of a kind.
    #[must_use]
    pub fn new(kind: LayerKind) -> Self {
        match kind {
            LayerKind::Elevation => Self::Elevation(Elevation::default()),
            LayerKind::Imagery => Self::Imagery(Imagery::default()),
            LayerKind::Sar => Self::Sar(Sar::default()),
            LayerKind::Ramp => Self::Ramp(Ramp::default()),
            LayerKind::Isolines => Self::Isolines(Isolines::default()),
            LayerKind::Slope => Self::Slope(Slope::default()),
            LayerKind::Aspect => Self::Aspect(Aspect::default()),
            LayerKind::Hillshade => Self::Hillshade(Hillshade::default()),
        }
    }

    /// The kind of a layer that has this process.
    #[must_use]
    pub fn kind(&self) -> LayerKind {
        match self {
            Self::Elevation(_) => LayerKind::Elevation,
            Self::Imagery(_) => LayerKind::Imagery,
            Self::Sar(_) => LayerKind::Sar,
            Self::Ramp(_) => LayerKind::Ramp,
            Self::Isolines(_) => LayerKind::Isolines,
            Self::Slope(_) => LayerKind::Slope,
            Self::Aspect(_) => LayerKind::Aspect,
            Self::Hillshade(_) => LayerKind::Hillshade,
        }
    }
}

impl Default for Elevation {
    fn default() -> Self {
        Self {
            scale: 1.0,
            offset_m: 0.0,
            datum_shift_m: 0.0,
            clamp_m: [-500_000.0, 500_000.0],
        }
    }
}

impl Default for Imagery {
    fn default() -> Self {
        Self {
            exposure_stops: 0.0,
            contrast: 1.0,
            saturation: 1.0,
            gamma: 1.0,
            channels: [0, 1, 2],
            range: None,
            tint: [1.0; 3],
        }
    }
}

impl Default for Sar {
    fn default() -> Self {
        Self {
            mapping: SarMapping::Logarithmic,
            range: None,
            strength: 100.0,
            exponent: 0.7,
            tint: [1.0; 3],
        }
    }
}

impl Default for Isolines {
    fn default() -> Self {
        Self {
            spacing_m: 100.0,
            width_px: 1.0,
            bold_every: 5,
            bold_width_px: 2.0,
            colour: [0.35, 0.22, 0.1],
        }
    }
}

impl Default for Slope {
    fn default() -> Self {
        Self {
            range_deg: [0.0, 45.0],
            gentle: [1.0, 1.0, 0.85],
            steep: [0.65, 0.1, 0.05],
        }
    }
}

impl Default for Aspect {
    fn default() -> Self {
        Self {
            saturation: 0.8,
            brightness: 0.9,
            flat_below_deg: 1.0,
        }
    }
}

impl Default for Hillshade {
    fn default() -> Self {
        Self {
            azimuth_deg: 315.0,
            altitude_deg: 45.0,
            exaggeration: 1.0,
        }
    }
}
