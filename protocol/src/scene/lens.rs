//! Lenses: circles on the ellipsoid within which layers have parameters of their own.
//! In: nothing. Out: plain types. Which point lies within is decided by `geodesy` and not here.

use serde::{Deserialize, Serialize};

use super::layer::LayerParameters;

/// A circle on the ellipsoid with its own parameters of any layers. Where lenses overlap, the last by name wins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lens {
    /// Unique among the lenses: 1…64 letters of a–z, A–Z, digits, `-` and `_`.
    pub name: String,
    /// Geodetic latitude of the centre, −90…90.
    pub latitude_deg: f64,
    /// Longitude of the centre, −180…180.
    pub longitude_deg: f64,
    /// Radius along the ground in metres, above 0, at most 5,000,000.
    pub radius_m: f64,
    /// The layers that differ within, in the order of the scene's layers.
    pub layers: Vec<LensLayer>,
}

/// What a lens makes of one layer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LensLayer {
    /// Index into the scene's layers.
    pub layer: usize,
    /// All the layer's parameters within the lens: the layer's own with the lens's values put in.
    pub parameters: LayerParameters,
    /// The keys that the lens gives, in the order of the kind's keys. All other values are the layer's.
    pub given: Vec<String>,
}
