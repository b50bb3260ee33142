//! Colours for pixel densities: from dark blue (sparse) to yellow (dense), as even in lightness on paper.
//!
//! In: densities. Out: SVG colours. It draws nothing.

/// Steps of the scale: cells of one colour are drawn together.
pub(super) const STEPS: usize = 24;

/// Red, green and blue at even distances of the scale: the map "viridis" (van der Walt and Smith 2015), read at ninths.
const STOPS: [[f64; 3]; 9] = [
    [68.0, 1.0, 84.0],
    [71.0, 44.0, 122.0],
    [59.0, 81.0, 139.0],
    [44.0, 113.0, 142.0],
    [33.0, 144.0, 141.0],
    [39.0, 173.0, 129.0],
    [92.0, 200.0, 99.0],
    [170.0, 220.0, 50.0],
    [253.0, 231.0, 37.0],
];

/// The densities that a plan shows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    pub(super) sparsest: f64,
    pub(super) densest: f64,
}

impl Scale {
    /// A scale for all of these; `None` if there are none.
    pub(super) fn new(densities: impl Iterator<Item = f64>) -> Option<Self> {
        let [sparsest, densest] = densities
            .filter(|density| density.is_finite())
            .fold([f64::INFINITY, 0.0], |[low, high], density| {
                [low.min(density), high.max(density)]
            });
        (sparsest <= densest).then_some(Self { sparsest, densest })
    }

    /// Which of the [`STEPS`] a density is in.
    pub(super) fn step(&self, density: f64) -> usize {
        let range = self.densest - self.sparsest;
        // Where all are the same there is nothing to tell apart.
        if range < 1e-3 * self.densest {
            return STEPS / 2;
        }
        let share = ((density - self.sparsest) / range).clamp(0.0, 1.0);
        ((share * STEPS as f64) as usize).min(STEPS - 1)
    }
}

/// The colour of a step.
pub(super) fn of_step(step: usize) -> String {
    let last = STOPS.len() - 1;
    let place = (step as f64 / (STEPS - 1) as f64).clamp(0.0, 1.0) * last as f64;
    let below = (place.floor() as usize).min(last - 1);
    let share = place - below as f64;
    let [red, green, blue] = std::array::from_fn(|part| {
        let (from, to) = (STOPS[below][part], STOPS[below + 1][part]);
        (from + (to - from) * share).round() as u8
    });
    format!("#{red:02x}{green:02x}{blue:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_reaches_from_the_sparsest_to_the_densest() {
        let scale = Scale::new([800.0, f64::NAN, 400.0, 1200.0].into_iter());
        let steps = scale.map(|scale| [400.0, 800.0, 1200.0, 9000.0].map(|d| scale.step(d)));
        assert_eq!(steps, Some([0, STEPS / 2, STEPS - 1, STEPS - 1]));
        assert!(Scale::new([f64::INFINITY].into_iter()).is_none());
        let even = Scale::new([500.0].into_iter()).map(|scale| scale.step(500.0));
        assert_eq!(even, Some(STEPS / 2));
        assert_eq!(of_step(0), "#440154");
        assert_eq!(of_step(STEPS - 1), "#fde725");
    }
}
