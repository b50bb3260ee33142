//! Differences between a device and the twins, counted for each stage.
//! In: runs of stages. Out: a table, and a panic where a difference is larger than allowed.

use std::collections::BTreeMap;

use bytemuck::Pod;
use shaders::{INVALID_WORD, Stage};

use super::harness;
use crate::gpu::Gpu;

/// What a stage's words are, and so what a difference between two of them is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Unit {
    /// f32: metres. A hole on one side alone is endlessly far from anything.
    Metres,
    /// Four bytes.
    Codes,
    /// 10:10:10:2.
    RawCodes,
    /// Four signed bytes.
    Steps,
}

impl Unit {
    fn difference(self, a: u32, b: u32) -> f64 {
        let largest = |a: [i32; 4], b: [i32; 4]| {
            let pairs = a.iter().zip(&b);
            f64::from(pairs.map(|(a, b)| (a - b).abs()).max().unwrap())
        };
        let signed = |word: u32| word.to_le_bytes().map(|byte| i32::from(byte as i8));
        let raw = |word: u32| [0, 10, 20, 30].map(|bits| (word >> bits & 1023) as i32);
        match self {
            Self::Metres if a == b => 0.0,
            Self::Metres if a == INVALID_WORD || b == INVALID_WORD => f64::INFINITY,
            Self::Metres => {
                let apart = (f64::from(f32::from_bits(a)) - f64::from(f32::from_bits(b))).abs();
                if apart.is_nan() { f64::INFINITY } else { apart }
            }
            Self::Codes => largest(
                a.to_le_bytes().map(i32::from),
                b.to_le_bytes().map(i32::from),
            ),
            // A hole has the code 0 in its top bits too, a colour 3: endlessly far.
            Self::RawCodes if a >> 30 != b >> 30 => f64::INFINITY,
            Self::RawCodes => largest(raw(a), raw(b)),
            Self::Steps => largest(signed(a), signed(b)),
        }
    }
}

/// The largest difference that is allowed, and in what.
const fn allowed(stage: Stage, unit: Unit) -> f64 {
    match (stage, unit) {
        (Stage::Lens, _) => 0.0,
        (_, Unit::Metres) => 1e-3,
        _ => 1.0,
    }
}

/// What came out for one stage and unit.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    runs: usize,
    words: usize,
    holes: usize,
    different: usize,
    largest: f64,
}

/// Runs stages on the device and on the CPU, and keeps the differences.
pub(super) struct Comparison {
    gpu: Gpu,
    rows: BTreeMap<(Stage, &'static str), (Unit, Row)>,
}

impl Comparison {
    pub(super) fn new(gpu: Gpu) -> Self {
        Self {
            gpu,
            rows: BTreeMap::new(),
        }
    }

    /// Compares one run, but for words that `left_out` names, and returns what the twin made.
    pub(super) fn run<U: Pod>(
        &mut self,
        stage: Stage,
        unit: Unit,
        uniform: &U,
        inputs: &[&[u32]],
        twin: Vec<u32>,
        left_out: impl Fn(usize) -> bool,
    ) -> Vec<u32> {
        let device = harness::run(&self.gpu, stage, bytemuck::bytes_of(uniform), inputs);
        assert_eq!(device.len(), twin.len(), "{}", stage.name());
        let name = match unit {
            Unit::Metres => "m",
            Unit::Codes => "codes of 255",
            Unit::RawCodes => "codes of 1023",
            Unit::Steps => "steps of 127",
        };
        let (_, row) = self
            .rows
            .entry((stage, name))
            .or_insert((unit, Row::default()));
        row.runs += 1;
        for (index, (a, b)) in device.iter().zip(&twin).enumerate() {
            if left_out(index) {
                continue;
            }
            let difference = unit.difference(*a, *b);
            let hole = if unit == Unit::Metres {
                INVALID_WORD
            } else {
                0
            };
            row.words += 1;
            row.holes += usize::from(*b == hole);
            row.different += usize::from(difference > 0.0);
            row.largest = row.largest.max(difference);
        }
        twin
    }

    /// As [`Comparison::run`], for stages whose twin takes and returns slots.
    pub(super) fn slot<U: Pod>(
        &mut self,
        stage: Stage,
        unit: Unit,
        uniform: &U,
        inputs: &[&[u32]],
        twin: fn(&U, &[&[u32]]) -> Vec<u32>,
    ) -> Vec<u32> {
        let twin = twin(uniform, inputs);
        self.run(stage, unit, uniform, inputs, twin, |_| false)
    }

    pub(super) fn print(&self) {
        eprintln!(
            "stage                     runs     words     holes  different  largest difference"
        );
        for ((stage, name), (_, row)) in &self.rows {
            eprintln!(
                "{:24} {:5} {:9} {:9} {:10}  {:.6} {name}",
                stage.name(),
                row.runs,
                row.words,
                row.holes,
                row.different,
                row.largest
            );
        }
    }

    /// Panics where a stage was never compared, or is further from its twin than it may.
    pub(super) fn check(&self) {
        for stage in Stage::ALL.into_iter().filter(|stage| stage.is_compute()) {
            let rows: Vec<_> = self
                .rows
                .iter()
                .filter(|((of, _), _)| *of == stage)
                .collect();
            assert!(!rows.is_empty(), "{} was not compared", stage.name());
            for ((_, name), (unit, row)) in rows {
                let most = allowed(stage, *unit);
                assert!(
                    row.largest <= most,
                    "{}: {} {name}, at most {most} allowed",
                    stage.name(),
                    row.largest
                );
            }
        }
    }
}
