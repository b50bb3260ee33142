//! The error of pictures in pixels, as every report has it.
//! In: what was measured of single pictures. Out: an [`ErrorReport`], which holds measured numbers or says that there are
//! none. It measures nothing.

use serde::{Deserialize, Serialize};

use crate::message::ErrorMeasured;

/// The largest distance on the wall between a sample of elevation and the surface that was drawn, over pictures.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorReport {
    /// The scene's `mesh.tau`, in wall pixels.
    pub tau: f64,
    /// The largest distance in wall pixels; absent where nothing was measured.
    pub measured_max: Option<f64>,
    /// Samples that were looked at.
    pub samples: u64,
    /// Samples beside them that no triangle covers. There must be none.
    pub uncovered: u64,
    /// Pictures that were measured; one without ground in view is not counted.
    pub views: u64,
    /// Nodes that did not measure their picture.
    pub unmeasured: Vec<String>,
}

impl ErrorReport {
    /// Nothing was measured yet.
    #[must_use]
    pub fn new(tau: f64) -> Self {
        Self {
            tau,
            ..Self::default()
        }
    }

    /// Adds a picture.
    pub fn add(&mut self, measured: &ErrorMeasured) {
        if measured.samples == 0 && measured.uncovered == 0 {
            return;
        }
        let largest = self.measured_max.unwrap_or(0.0);
        // What is no number is worse than any.
        let worse = measured.max_px.is_nan() || measured.max_px > largest;
        self.measured_max = Some(if worse { measured.max_px } else { largest });
        self.samples = self.samples.saturating_add(measured.samples);
        self.uncovered = self.uncovered.saturating_add(measured.uncovered);
        self.views += 1;
    }

    /// Whether something was measured, the surface is whole, and no sample is further off than τ.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.uncovered == 0 && self.measured_max.is_some_and(|max_px| max_px <= self.tau)
    }
}
