//! Layers of a scene: what they are made from and how they meet each other.
//! In: nothing. Out: plain types with their defaults. Keys and ranges are in `keys`; it computes no pixel.

use serde::{Deserialize, Serialize};

use super::process::Process;

/// One layer of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Layer {
    /// Unique among the layers: 1…64 letters of a–z, A–Z, digits, `-` and `_`.
    pub name: String,
    /// Directory of the repository, for exactly the kinds that show data of their own (elevation, imagery, sar);
    /// the others are made from the fused elevation. [`Scene::resolve`](super::Scene::resolve) makes it relative
    /// to the scene's own place.
    pub repository: Option<String>,
    /// How it is processed and fused.
    pub parameters: LayerParameters,
}

/// All that can be adjusted of a layer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LayerParameters {
    /// How it meets other layers.
    pub fusion: Fusion,
    /// From raw samples, or from fused heights, to heights or colours.
    pub process: Process,
}

/// How a layer meets others that yield the same: heights meet heights, colours meet colours.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fusion {
    /// Larger lies above, −1000…1000.
    pub priority: i32,
    /// Share among layers of equal priority and blend, 0…1000; 0 takes the layer away.
    pub weight: f64,
    /// How far it covers what is below, 0…1.
    pub opacity: f64,
    /// How it is laid over what is below.
    pub blend: Blend,
}

/// Blend modes, in the order in which layers of one priority are laid over each other (W3C, "Compositing and
/// Blending Level 1", 2015).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Blend {
    /// Covers what is below.
    Normal,
    /// The product of both.
    Multiply,
    /// The complement of the product of complements. Not for heights, which have no white to approach.
    Screen,
    /// The sum of both.
    Add,
}

/// What a layer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LayerKind {
    /// Heights.
    Elevation,
    /// Colours.
    Imagery,
    /// Radar amplitude.
    Sar,
    /// Colours by height.
    Ramp,
    /// Lines of equal height.
    Isolines,
    /// Colours by steepness.
    Slope,
    /// Colours by the direction of descent.
    Aspect,
    /// Light from one direction.
    Hillshade,
}

impl Default for Fusion {
    fn default() -> Self {
        Self {
            priority: 0,
            weight: 1.0,
            opacity: 1.0,
            blend: Blend::Normal,
        }
    }
}

impl LayerKind {
    /// Whether layers of this kind yield heights; all others yield colours.
    #[must_use]
    pub fn makes_heights(self) -> bool {
        self == Self::Elevation
    }

    /// Whether layers of this kind show data of a repository; all others are made from the fused elevation.
    #[must_use]
    pub fn has_repository(self) -> bool {
        matches!(self, Self::Elevation | Self::Imagery | Self::Sar)
    }
}

impl Layer {
    /// What the layer is.
    #[must_use]
    pub fn kind(&self) -> LayerKind {
        self.parameters.process.kind()
    }
}

impl LayerParameters {
    /// The defaults of a kind: data is shown as it is.
    #[must_use]
    pub fn new(kind: LayerKind) -> Self {
        Self {
            fusion: Fusion::default(),
            process: Process::new(kind),
        }
    }
}
