//! The test patterns that outputs can show instead of the scene.
//! In: names. Out: the same as values that travel. It draws nothing.

use serde::{Deserialize, Serialize};

/// A test pattern. Nodes draw it in the pixels of an output: neither warped nor blended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Pattern {
    /// Lines every 64 and every 256 px, borders, circles, diagonals and pixel coordinates: geometry and bezels.
    Grid,
    /// Bars of 75 % colour, grey steps, patches near black and near white: colours, contrast and brightness.
    Bars,
    /// Greys in steps, ramps even in light and even in value, blend zones hatched: gamma and blending.
    Ramp,
    /// Siemens stars, pairs of lines of 1 and 2 px, small text: focus and pixel-exact scaling.
    Focus,
    /// What the output is called and shows, for people and for machines.
    Identify,
}

impl Pattern {
    /// Every pattern, with its name on command lines and in the master's API.
    pub const NAMES: [(Self, &'static str); 5] = [
        (Self::Grid, "grid"),
        (Self::Bars, "colour-bars"),
        (Self::Ramp, "blend-ramp"),
        (Self::Focus, "focus-star"),
        (Self::Identify, "identify"),
    ];

    /// The pattern of a name. `None` for any other text.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let found = Self::NAMES.iter().find(|(_, known)| *known == name);
        found.map(|(pattern, _)| *pattern)
    }

    /// Its name in [`Self::NAMES`].
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Grid => "grid",
            Self::Bars => "colour-bars",
            Self::Ramp => "blend-ramp",
            Self::Focus => "focus-star",
            Self::Identify => "identify",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pattern_is_found_by_its_name_alone() {
        for (pattern, name) in Pattern::NAMES {
            assert_eq!(pattern.name(), name);
            assert_eq!(Pattern::from_name(name), Some(pattern));
        }
        for other in ["", "Grid", "grid ", "bars"] {
            assert_eq!(Pattern::from_name(other), None);
        }
    }
}
