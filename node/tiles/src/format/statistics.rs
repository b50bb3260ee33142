//! Figures that a tile carries about its own samples.
//! In: samples, channels, validity. Out: range, sums and count. Nodes of the border are left out, so that the
//! figures of neighbours can be added up.

use geodesy::{BORDER, CELLS, STORED_NODES};
use serde::{Deserialize, Serialize};

use super::{Samples, Validity};

/// Figures over the valid nodes 0…256 both ways (no border) and all channels, in sample units: quanta for
/// elevation. All zero where no such node is valid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// The smallest sample.
    pub lowest: f64,
    /// The largest sample.
    pub highest: f64,
    /// The sum of all samples.
    pub sum: f64,
    /// The sum of their squares.
    pub sum_of_squares: f64,
    /// How many samples were counted, at most 257² × channels.
    pub count: u64,
}

impl Statistics {
    /// Counts the valid nodes 0…256 both ways of an array as stored in a tile.
    #[must_use]
    pub fn of(samples: &Samples, channels: u8, validity: &Validity) -> Self {
        match samples {
            Samples::I32(values) => Self::gather(values, channels, validity),
            Samples::U8(values) => Self::gather(values, channels, validity),
            Samples::U16(values) => Self::gather(values, channels, validity),
            Samples::F32(values) => Self::gather(values, channels, validity),
        }
    }

    fn gather<T: Copy + Into<f64>>(values: &[T], channels: u8, validity: &Validity) -> Self {
        let channels = usize::from(channels);
        let border = BORDER as usize;
        let inner = border..border + CELLS as usize + 1;
        let mut total = Self {
            lowest: f64::INFINITY,
            highest: f64::NEG_INFINITY,
            ..Self::default()
        };
        for row in inner.clone() {
            let start = (row * STORED_NODES + inner.start) * channels;
            let Some(line) = values.get(start..start + inner.len() * channels) else {
                break;
            };
            match validity {
                Validity::All => total.add(line),
                Validity::Mask(_) => {
                    for (column, node) in inner.clone().zip(line.chunks_exact(channels)) {
                        if validity.is_valid(row * STORED_NODES + column) {
                            total.add(node);
                        }
                    }
                }
            }
        }
        if total.count == 0 {
            Self::default()
        } else {
            total
        }
    }

    fn add<T: Copy + Into<f64>>(&mut self, values: &[T]) {
        for value in values {
            let value: f64 = (*value).into();
            self.lowest = self.lowest.min(value);
            self.highest = self.highest.max(value);
            self.sum += value;
            self.sum_of_squares += value * value;
        }
        self.count += values.len() as u64;
    }

    pub(super) fn is_sound(&self, channels: u8) -> bool {
        let all = [self.lowest, self.highest, self.sum, self.sum_of_squares];
        let nodes = (CELLS as u64 + 1) * (CELLS as u64 + 1);
        all.iter().all(|number| number.is_finite())
            && self.lowest <= self.highest
            && self.sum_of_squares >= 0.0
            && self.count <= nodes * u64::from(channels)
    }
}
