//! Colour ramps: heights in metres to colours, given stop by stop or by name.
//! In: a name. Out: its stops. The named ramps are this project's own; it computes no pixel.

use serde::{Deserialize, Serialize};

/// Colours by height, linear between stops, the end stops' colours beyond them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ramp {
    /// The name of the ramp, where it was given by name; `stops` are then those of the name.
    pub name: Option<RampName>,
    /// 2…32 stops whose heights rise strictly.
    pub stops: Vec<RampStop>,
}

/// The colour of a height.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RampStop {
    /// Metres, −500,000…500,000.
    pub height_m: f64,
    /// Gamma encoded red, green, blue, each 0…1.
    pub colour: [f64; 3],
}

/// Ramps with a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum RampName {
    /// Blue depths, a sharp shore at 0 m, green plains, brown and white mountains: `"land-and-sea"`.
    LandAndSea,
    /// The land of `LandAndSea`, with its lowest colour below 0 m: `"land"`.
    Land,
    /// The depths of `LandAndSea`, with its highest colour above 0 m: `"sea"`.
    Sea,
    /// Black at −11,000 m to white at 9000 m: `"grey"`.
    Grey,
    /// Narrow steps of equal colour, as on printed maps: `"hypsometric"`.
    Hypsometric,
}

impl RampName {
    /// The stops of the name, rising strictly.
    #[must_use]
    pub fn stops(self) -> Vec<RampStop> {
        let stops: Vec<(f64, u32)> = match self {
            Self::LandAndSea => SEA.iter().chain(LAND).copied().collect(),
            Self::Land => LAND.to_vec(),
            Self::Sea => SEA.to_vec(),
            Self::Grey => GREY.to_vec(),
            Self::Hypsometric => stepped(STEPS),
        };
        stops
            .into_iter()
            .map(|(height_m, code)| RampStop {
                height_m,
                colour: colour(code),
            })
            .collect()
    }
}

impl Ramp {
    /// The ramp of a name.
    #[must_use]
    pub fn named(name: RampName) -> Self {
        Self {
            name: Some(name),
            stops: name.stops(),
        }
    }
}

impl Default for Ramp {
    fn default() -> Self {
        Self::named(RampName::LandAndSea)
    }
}

/// From the deepest trench to the shore; the shelf above −200 m is much lighter than the deep sea.
const SEA: &[(f64, u32)] = &[
    (-11_000.0, 0x04_0B_26),
    (-8000.0, 0x08_1A_45),
    (-6000.0, 0x0D_2C_66),
    (-4000.0, 0x17_46_86),
    (-2500.0, 0x24_62_A2),
    (-1000.0, 0x3C_86_BD),
    (-200.0, 0x6C_B0_D3),
    (-50.0, 0x96_CD_E2),
    (-0.1, 0xBF_E3_EC),
];

/// From the shore to the highest summit.
const LAND: &[(f64, u32)] = &[
    (0.0, 0x55_8A_4F),
    (100.0, 0x6E_A0_58),
    (300.0, 0x97_B8_66),
    (600.0, 0xC4_CB_7C),
    (1000.0, 0xDC_C9_86),
    (1500.0, 0xC9_A4_67),
    (2200.0, 0xA8_7D_4E),
    (3000.0, 0x8C_66_4A),
    (3800.0, 0xA8_93_86),
    (4600.0, 0xDA_D4_D0),
    (6000.0, 0xF7_F7_F8),
    (9000.0, 0xFF_FF_FF),
];

/// Linear in height.
const GREY: &[(f64, u32)] = &[(-11_000.0, 0x00_00_00), (9000.0, 0xFF_FF_FF)];

/// From which height each colour holds; the first holds below, too.
const STEPS: &[(f64, u32)] = &[
    (-11_000.0, 0x0F_35_6B),
    (-6000.0, 0x1F_56_91),
    (-4000.0, 0x3A_7A_B4),
    (-2000.0, 0x68_A2_CE),
    (-1000.0, 0x94_C2_E1),
    (-200.0, 0xC3_E0_F0),
    (0.0, 0x7F_B0_77),
    (100.0, 0xA3_C5_86),
    (200.0, 0xC9_D9_9A),
    (500.0, 0xEE_E4_AE),
    (1000.0, 0xE2_C6_8A),
    (1500.0, 0xD0_A4_69),
    (2000.0, 0xB8_83_52),
    (3000.0, 0x9B_67_42),
    (4000.0, 0xC7_B3_A8),
    (5000.0, 0xF4_F1_EF),
];

/// Stops of steps: every colour but the last also holds just below the next step, so that the change takes one
/// part in a thousand of the step, at least 0.1 m.
fn stepped(steps: &[(f64, u32)]) -> Vec<(f64, u32)> {
    let mut stops: Vec<(f64, u32)> = Vec::with_capacity(2 * steps.len());
    for (height_m, code) in steps {
        if let Some((below_m, below)) = stops.last().copied() {
            let change_m = ((height_m - below_m) * 0.001).max(0.1);
            stops.push((height_m - change_m, below));
        }
        stops.push((*height_m, *code));
    }
    stops
}

/// Red, green and blue, each 0…1, of 0xRRGGBB.
fn colour(code: u32) -> [f64; 3] {
    [16, 8, 0].map(|shift| f64::from((code >> shift) & 0xFF) / 255.0)
}
