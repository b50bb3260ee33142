//! What `bench refine` has measured: figures of every second and method, sums over the sequence, and its bars.
//!
//! In: measurements. Out: the JSON report, and the sums that tables and plots show. It measures and prints nothing.

use node::ErrorMeasure;
use serde::Serialize;

use crate::args::RefineMethod;

use super::stage::Passes;

/// Most that refinement and drawing together may cost of what brute force costs.
pub(super) const MOST_COST: f64 = 0.3;
/// Most triangles for each of the smallest mesh.
pub(super) const MOST_TRIANGLES: f64 = 1.3;
/// Lambers (2011), table 3.1: what the top-down method took in one scene, on a GTX 285, in milliseconds.
pub(super) const SEED: [(&str, f64); 11] = [
    ("base mesh", 10.9),
    ("1: marks, initial", 29.5),
    ("1: marks, propagation", 1.2),
    ("1: splitting", 12.0),
    ("2: marks, initial", 5.8),
    ("2: marks, propagation", 3.0),
    ("2: splitting", 11.5),
    ("3: marks, initial", 3.3),
    ("3: marks, propagation", 2.7),
    ("3: splitting", 12.6),
    ("4: marks, no change", 2.3),
];

/// The report.
#[derive(Debug, Serialize)]
pub(crate) struct Figures {
    pub(super) adapter: String,
    pub(super) width: u32,
    pub(super) height: u32,
    /// Seconds of the sequence.
    pub(super) seconds: f64,
    /// Pictures of a second; of brute force there are fewer.
    pub(super) frames: u32,
    pub(super) tau_px: f64,
    /// Over all refined pictures that were measured.
    pub(super) error_px: ErrorPx,
    pub(super) methods: Vec<MethodFigures>,
    pub(super) passes: Option<PassTable>,
    pub(super) sums: Vec<Sums>,
}

/// The error of pictures.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct ErrorPx {
    /// What was asked for, in pixels.
    pub(super) tau: f64,
    /// What the meshes were made for: that, or a multiple of it where the memory for meshes forbade it. 0 where they
    /// were not made for any.
    pub(super) achieved_tau: f64,
    /// The largest of any sample.
    pub(super) measured_max: f64,
    /// Samples that were looked at.
    pub(super) samples: u64,
    /// Samples without any surface. There must be none.
    pub(super) uncovered: u64,
    /// Pictures.
    pub(super) views: u32,
}

/// All that was measured of one method.
#[derive(Debug, Serialize)]
pub(super) struct MethodFigures {
    pub(super) method: &'static str,
    #[serde(skip)]
    pub(super) refine: RefineMethod,
    pub(super) error_px: ErrorPx,
    pub(super) seconds: Vec<SecondFigures>,
}

/// One second of the sequence.
#[derive(Debug, Default, Serialize)]
pub(super) struct SecondFigures {
    pub(super) second: u32,
    pub(super) phase: &'static str,
    /// Pictures that came about.
    pub(super) frames: u32,
    /// Creation and refinement on the device with what earlier pictures left, milliseconds a picture: mean and largest.
    pub(super) reused_ms: f64,
    pub(super) reused_max_ms: f64,
    /// From the wish to the settled picture, loading, fusion and drawing included, milliseconds a picture.
    pub(super) frame_ms: f64,
    /// The picture of the whole second, as it was measured more closely. None where it did not come about.
    pub(super) whole: Option<WholeFigures>,
    /// Why a picture did not come about.
    pub(super) failed: Option<String>,
}

/// The picture at a whole second.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct WholeFigures {
    /// Creation and refinement on the device with what earlier pictures left, milliseconds.
    pub(super) reused_ms: f64,
    /// Creation and refinement of every leaf's mesh on the device, nothing being used again, milliseconds.
    pub(super) anew_ms: f64,
    /// The same by passes.
    pub(super) passes: Vec<PassFigures>,
    /// Selecting and drawing with meshes that are there, milliseconds.
    pub(super) drawing_ms: f64,
    pub(super) triangles: u64,
    pub(super) error_px: ErrorPx,
    /// Of the smallest mesh of the same leaves that keeps every sample within τ.
    pub(super) minimum_triangles: Option<u64>,
}

/// One pass.
#[derive(Clone, Debug, Serialize)]
pub(super) struct PassFigures {
    pub(super) label: String,
    pub(super) ms: f64,
    pub(super) runs: u32,
    /// Of all passes together.
    pub(super) share: f64,
}

/// The passes of one picture.
#[derive(Debug, Serialize)]
pub(super) struct PassTable {
    pub(super) method: &'static str,
    pub(super) second: u32,
    pub(super) passes: Vec<PassFigures>,
    pub(super) total_ms: f64,
}

/// Means over the whole seconds that every method has.
#[derive(Debug, Serialize)]
pub(super) struct Sums {
    pub(super) method: &'static str,
    /// Pictures that are compared.
    pub(super) pictures: u32,
    pub(super) anew_ms: f64,
    pub(super) drawing_ms: f64,
    /// Over all pictures of the sequence.
    pub(super) reused_ms: f64,
    pub(super) reused_max_ms: f64,
    pub(super) triangles: f64,
    /// Creation, refinement and drawing over those of brute force, everything being made anew.
    pub(super) anew_ratio: Option<f64>,
    /// The same with what earlier pictures left.
    pub(super) reused_ratio: Option<f64>,
    /// Triangles over those of the smallest mesh: over all whole seconds, and in the worst picture.
    pub(super) triangles_ratio: Option<f64>,
    pub(super) triangles_ratio_max: Option<f64>,
}

impl RefineMethod {
    /// As the scene's `refine` names it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Fine => "fine",
            Self::TopDown => "top-down",
            Self::BottomUp => "bottom-up",
        }
    }

    /// Whether τ bounds its error.
    pub(super) fn is_bounded(self) -> bool {
        matches!(self, Self::TopDown | Self::BottomUp)
    }
}

impl ErrorPx {
    /// What one picture has that was to keep to `tau`.
    pub(super) fn of(measure: &ErrorMeasure, tau: f64) -> Self {
        Self {
            tau,
            achieved_tau: measure.tau_px,
            measured_max: measure.max_px,
            samples: measure.samples,
            uncovered: measure.uncovered,
            views: 1,
        }
    }

    /// Adds other pictures. An error that is no number stays one.
    pub(super) fn add(&mut self, other: &Self) {
        self.tau = self.tau.max(other.tau);
        self.achieved_tau = self.achieved_tau.max(other.achieved_tau);
        if self.measured_max.is_nan() || other.measured_max <= self.measured_max {
            // The larger one stands.
        } else {
            self.measured_max = other.measured_max;
        }
        self.samples += other.samples;
        self.uncovered += other.uncovered;
        self.views += other.views;
    }

    /// Whether the surface is whole and nowhere further off than its meshes were made for.
    pub(super) fn holds(&self) -> bool {
        self.uncovered == 0 && self.measured_max <= self.achieved_tau
    }
}

/// Passes with their shares.
pub(super) fn shares(passes: &Passes) -> Vec<PassFigures> {
    let total_ms = passes.sum_ms();
    let figures = passes.0.iter().map(|(label, ms, runs)| PassFigures {
        label: label.clone(),
        ms: *ms,
        runs: *runs,
        share: if total_ms > 0.0 { ms / total_ms } else { 0.0 },
    });
    figures.collect()
}

/// The passes of the last picture of the zoom, by the first refined method.
pub(super) fn pass_table(methods: &[MethodFigures]) -> Option<PassTable> {
    let method = methods.iter().find(|method| method.refine.is_bounded())?;
    let mut zoom = method.seconds.iter().rev();
    let second = zoom.find(|second| second.phase == "zoom" && second.whole.is_some())?;
    let whole = second.whole.as_ref()?;
    Some(PassTable {
        method: method.method,
        second: second.second,
        passes: whole.passes.clone(),
        total_ms: whole.anew_ms,
    })
}

/// Means and bars.
pub(super) fn sums(methods: &[MethodFigures]) -> Vec<Sums> {
    let whole = |method: &MethodFigures, number: u32| {
        let mut seconds = method.seconds.iter();
        let second = seconds.find(|second| second.second == number)?;
        second.whole.clone()
    };
    let common: Vec<u32> = methods
        .first()
        .map(|first| first.seconds.iter().map(|second| second.second).collect())
        .unwrap_or_default();
    let common: Vec<u32> = common
        .into_iter()
        .filter(|number| {
            methods
                .iter()
                .all(|method| whole(method, *number).is_some())
        })
        .collect();
    let count = common.len().max(1) as f64;
    let mean = |method: &MethodFigures, of: &dyn Fn(&WholeFigures) -> f64| {
        let values = common.iter().filter_map(|number| whole(method, *number));
        values.map(|whole| of(&whole)).sum::<f64>() / count
    };
    let fine = methods
        .iter()
        .find(|method| method.refine == RefineMethod::Fine);
    let cost_ms = |method: &MethodFigures| {
        [
            mean(method, &|whole| whole.anew_ms + whole.drawing_ms),
            mean(method, &|whole| whole.reused_ms + whole.drawing_ms),
        ]
    };
    let fine_ms = fine.filter(|_| !common.is_empty()).map(cost_ms);
    // The same leaves whatever the method: the smallest mesh counts for all that keep to τ.
    let minimum = |number: u32| {
        methods
            .iter()
            .find_map(|method| whole(method, number)?.minimum_triangles)
            .filter(|minimum| *minimum > 0)
    };
    let sums = methods.iter().map(|method| {
        let anew_ms = mean(method, &|whole| whole.anew_ms);
        let drawing_ms = mean(method, &|whole| whole.drawing_ms);
        let pictures: u32 = method.seconds.iter().map(|second| second.frames).sum();
        let reused = method
            .seconds
            .iter()
            .map(|second| second.reused_ms * f64::from(second.frames));
        let reused_ms = reused.sum::<f64>() / f64::from(pictures.max(1));
        let ratios: Vec<(f64, f64)> = method
            .seconds
            .iter()
            .filter_map(|second| {
                Some((
                    second.whole.as_ref()?.triangles as f64,
                    minimum(second.second)? as f64,
                ))
            })
            .collect();
        let all = ratios
            .iter()
            .fold((0.0, 0.0), |sum, pair| (sum.0 + pair.0, sum.1 + pair.1));
        let worst = ratios
            .iter()
            .map(|(triangles, minimum)| triangles / minimum);
        let counts = method.refine != RefineMethod::Off && all.1 > 0.0;
        Sums {
            method: method.method,
            pictures: common.len() as u32,
            anew_ms,
            drawing_ms,
            reused_ms,
            reused_max_ms: method
                .seconds
                .iter()
                .map(|second| second.reused_max_ms)
                .fold(0.0, f64::max),
            triangles: mean(method, &|whole| whole.triangles as f64),
            anew_ratio: fine_ms.map(|fine_ms| cost_ms(method)[0] / fine_ms[0]),
            reused_ratio: fine_ms.map(|fine_ms| cost_ms(method)[1] / fine_ms[1]),
            triangles_ratio: counts.then_some(all.0 / all.1),
            triangles_ratio_max: counts.then(|| worst.fold(0.0, f64::max)),
        }
    });
    sums.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn method(
        refine: RefineMethod,
        anew_ms: f64,
        triangles: u64,
        minimum: Option<u64>,
    ) -> MethodFigures {
        let second = |number: u32| SecondFigures {
            second: number,
            phase: if number < 2 { "zoom" } else { "scale" },
            frames: 4,
            reused_ms: anew_ms / 10.0,
            reused_max_ms: anew_ms / 5.0,
            // Brute force has no room for the last one.
            whole: (number < 2 || refine != RefineMethod::Fine).then(|| WholeFigures {
                anew_ms,
                reused_ms: anew_ms / 10.0,
                drawing_ms: 10.0,
                triangles,
                minimum_triangles: minimum,
                ..WholeFigures::default()
            }),
            ..SecondFigures::default()
        };
        MethodFigures {
            method: refine.name(),
            refine,
            error_px: ErrorPx::default(),
            seconds: (0..3).map(second).collect(),
        }
    }

    #[test]
    fn sums_compare_only_what_every_method_has() {
        let methods = [
            method(RefineMethod::Fine, 190.0, 5000, None),
            method(RefineMethod::TopDown, 20.0, 600, Some(500)),
        ];
        let sums = sums(&methods);
        assert_eq!(sums[0].pictures, 2);
        assert_eq!(sums[0].triangles_ratio, Some(10.0));
        assert_eq!(sums[1].anew_ratio, Some(0.15));
        assert_eq!(sums[1].reused_ratio, Some(12.0 / 29.0));
        assert_eq!(sums[1].triangles_ratio_max, Some(1.2));
        let passes = pass_table(&methods);
        assert_eq!(
            passes.map(|table| (table.method, table.second)),
            Some(("top-down", 1))
        );
    }

    #[test]
    fn an_error_that_is_no_number_or_too_large_does_not_hold() {
        let picture = |measured_max, uncovered| ErrorPx {
            tau: 1.0,
            achieved_tau: 1.0,
            measured_max,
            samples: 1,
            uncovered,
            views: 1,
        };
        let sum = |pictures: &[ErrorPx]| {
            let mut sum = ErrorPx::default();
            pictures.iter().for_each(|picture| sum.add(picture));
            sum
        };
        assert!(sum(&[picture(0.5, 0), picture(1.0, 0)]).holds());
        assert!(!sum(&[picture(1.01, 0), picture(0.5, 0)]).holds());
        assert!(!sum(&[picture(0.5, 1), picture(0.5, 0)]).holds());
        assert!(!sum(&[picture(f64::NAN, 0), picture(0.5, 0)]).holds());
        assert!(!sum(&[picture(0.5, 0), picture(f64::NAN, 0)]).holds());
    }

    #[test]
    fn the_seeds_table_adds_up() {
        let total: f64 = SEED.iter().map(|(_, ms)| ms).sum();
        assert!((total - 94.8).abs() < 1e-9);
    }
}
