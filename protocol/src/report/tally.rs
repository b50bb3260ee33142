//! Numbers counted in bounded memory: histograms, and series that are thinned out as they grow.
//! In: one value at a time. Out: quantiles and series for a report. It knows no frames and no nodes.

use hdrhistogram::Histogram;

use super::{Quantiles, QuantilesAndMax, Series};

/// Values of a series before it is thinned out.
const SERIES_LENGTH: usize = 16_384;
/// Largest value of a histogram: ten minutes in microseconds.
const LONGEST_US: u64 = 600_000_000;

/// A histogram with three significant digits that takes no value above ten minutes.
#[derive(Debug)]
pub(super) struct Tally(Option<Histogram<u32>>);

/// Milliseconds and skews of frames, each value the largest of `stride` frames.
#[derive(Debug)]
pub(super) struct SeriesTally {
    stride: u64,
    pending: u64,
    frame_ms: f32,
    skew_us: f32,
    series: Series,
}

impl Tally {
    pub(super) fn new() -> Self {
        // These bounds are always valid; a histogram that cannot be made measures nothing.
        Self(Histogram::new_with_bounds(1, LONGEST_US, 3).ok())
    }

    /// Counts a value; below 0 (clock error) it counts as 0.
    pub(super) fn add(&mut self, value: i64) {
        if let Some(histogram) = &mut self.0 {
            histogram.saturating_record(value.max(0).unsigned_abs());
        }
    }

    fn at(&self, quantile: f64) -> f64 {
        self.0.as_ref().map_or(0.0, |histogram| {
            histogram.value_at_quantile(quantile) as f64
        })
    }

    pub(super) fn quantiles(&self, factor: f64) -> Quantiles {
        Quantiles {
            p50: self.at(0.5) * factor,
            p99: self.at(0.99) * factor,
        }
    }

    /// The same, each times a factor.
    pub(super) fn quantiles_and_max_times(&self, factor: f64) -> QuantilesAndMax {
        let QuantilesAndMax { p50, p99, max } = self.quantiles_and_max();
        QuantilesAndMax {
            p50: p50 * factor,
            p99: p99 * factor,
            max: max * factor,
        }
    }

    pub(super) fn quantiles_and_max(&self) -> QuantilesAndMax {
        let max = self
            .0
            .as_ref()
            .map_or(0.0, |histogram| histogram.max() as f64);
        // A histogram rounds up within its precision; a quantile must not exceed the maximum.
        QuantilesAndMax {
            p50: self.at(0.5).min(max),
            p99: self.at(0.99).min(max),
            max,
        }
    }
}

impl SeriesTally {
    pub(super) fn new() -> Self {
        Self {
            stride: 1,
            pending: 0,
            frame_ms: 0.0,
            skew_us: 0.0,
            series: Series::default(),
        }
    }

    pub(super) fn add(&mut self, frame_ms: f32, skew_us: f32) {
        self.frame_ms = self.frame_ms.max(frame_ms);
        self.skew_us = self.skew_us.max(skew_us);
        self.pending += 1;
        if self.pending < self.stride {
            return;
        }
        self.push();
        if self.series.frame_ms.len() >= SERIES_LENGTH {
            self.stride *= 2;
            halve(&mut self.series.frame_ms);
            halve(&mut self.series.skew_us);
        }
    }

    fn push(&mut self) {
        self.series
            .frame_ms
            .push(std::mem::take(&mut self.frame_ms));
        self.series.skew_us.push(std::mem::take(&mut self.skew_us));
        self.pending = 0;
    }

    pub(super) fn finish(&mut self) -> Series {
        if self.pending > 0 {
            self.push();
        }
        self.series.stride = self.stride;
        self.series.clone()
    }
}

/// Keeps the larger of each pair of values.
fn halve(values: &mut Vec<f32>) {
    *values = values
        .chunks(2)
        .map(|pair| pair.iter().copied().fold(0.0, f32::max))
        .collect();
}
