//! What data set the sources make, and whether they go with the one that a repository holds already.
//! In: opened sources, options, perhaps a repository's description. Out: the description to import into, or why there
//! is none, naming both sides and the remedy. It writes nothing.

use tiles::{Dataset, Kind, SampleType};

use crate::error::ImportError;
use crate::options::ImportOptions;
use crate::progress::Progress;
use crate::source::Source;

/// The quantum for whole metres, and the coarsest there is.
const COARSEST_QUANTUM_M: f64 = 1.0 / 16.0;
/// The finest quantum that is chosen without being asked for.
const FINEST_QUANTUM_M: f64 = 1.0 / 4096.0;
/// The quantum for heights that are no whole numbers.
const FRACTIONAL_QUANTUM_M: f64 = 1.0 / 256.0;

/// Number type and channels of a data set's nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Shape {
    sample_type: SampleType,
    channels: u8,
}

impl Shape {
    fn of(source: &Source) -> Self {
        Self {
            sample_type: source.description.sample_type,
            // A source has 1…16 channels.
            channels: source.description.channels as u8,
        }
    }
}

impl std::fmt::Display for Shape {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let name = match self.sample_type {
            SampleType::I32 => "signed 32-bit",
            SampleType::U8 => "unsigned 8-bit",
            SampleType::U16 => "unsigned 16-bit",
            SampleType::F32 => "32-bit floating-point",
        };
        let plural = if self.channels == 1 { "" } else { "s" };
        write!(
            formatter,
            "{} channel{plural} of {name} samples",
            self.channels
        )
    }
}

/// The data set that the sources make, or the existing one if they go with it.
pub(crate) fn describe(
    options: &ImportOptions,
    sources: &[Source],
    existing: Option<&Dataset>,
    progress: &dyn Progress,
) -> Result<Dataset, ImportError> {
    let shape = shape_of(options, sources)?;
    let Some(dataset) = existing else {
        let fallback = options
            .into
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        let name = options
            .name
            .clone()
            .or(fallback)
            .unwrap_or_else(|| options.kind.to_string());
        let mut dataset = Dataset::new(&name, options.kind, shape.sample_type, shape.channels);
        dataset.ellipsoid = options.planet;
        if options.kind == Kind::Elevation {
            dataset.quantum_m = Some(options.quantum_m.unwrap_or_else(|| quantum_of(sources)));
        }
        return Ok(dataset);
    };
    let refuse = |problem: String| {
        Err(ImportError::Repository {
            directory: options.into.clone(),
            problem,
        })
    };
    let name = &dataset.name;
    if dataset.kind != options.kind {
        return refuse(format!(
            "the repository \"{name}\" holds {}, and {} was to be imported. Choose another directory.",
            dataset.kind, options.kind
        ));
    }
    let held = Shape {
        sample_type: dataset.sample_type,
        channels: dataset.channels,
    };
    // Amplitudes of any type stay what they are in floating point. Imagery does not: white is 255 in bytes, and
    // nowhere in particular in the numbers of another sensor.
    let widened = held.channels == shape.channels
        && held.sample_type == SampleType::F32
        && dataset.kind == Kind::Sar;
    if held != shape && !widened {
        return refuse(format!(
            "the repository \"{name}\" holds {held}, and this import makes {shape}. {}",
            remedy(held, shape, options)
        ));
    }
    if dataset.ellipsoid != options.planet {
        return refuse(format!(
            "the repository \"{name}\" is of another planet. Choose another directory, or name its planet."
        ));
    }
    let asked = options
        .quantum_m
        .filter(|quantum| Some(*quantum) != dataset.quantum_m);
    if let (Some(asked), Some(quantum)) = (asked, dataset.quantum_m) {
        progress.note(&format!(
            "{}: heights are stored in steps of {quantum} m, as in the repository, not of {asked} m",
            options.into.display()
        ));
    }
    Ok(dataset.clone())
}

/// What the sources make together. Amplitudes take the widest type; imagery of several types or channel counts has
/// no common meaning and is refused.
fn shape_of(options: &ImportOptions, sources: &[Source]) -> Result<Shape, ImportError> {
    let shapes = || sources.iter().map(Shape::of);
    match options.kind {
        Kind::Elevation => Ok(Shape {
            sample_type: SampleType::I32,
            channels: 1,
        }),
        Kind::Sar => {
            let any = |wanted| shapes().any(|shape| shape.sample_type == wanted);
            let sample_type = match (any(SampleType::F32), any(SampleType::U16)) {
                (true, _) => SampleType::F32,
                (_, true) => SampleType::U16,
                _ => SampleType::U8,
            };
            Ok(Shape {
                sample_type,
                channels: 1,
            })
        }
        Kind::Imagery => {
            let Some(first) = sources.first() else {
                return Err(ImportError::Options(
                    "the sources hold no raster: give at least one file to import.".to_owned(),
                ));
            };
            let shape = Shape::of(first);
            match sources.iter().find(|source| Shape::of(source) != shape) {
                None => Ok(shape),
                Some(other) => Err(ImportError::Options(format!(
                    "{} makes {shape}, and {} makes {}: one repository holds one sort. {}",
                    first.description.file,
                    other.description.file,
                    Shape::of(other),
                    remedy(shape, Shape::of(other), options)
                ))),
            }
        }
    }
}

/// What makes the second shape the first, as far as anything does.
fn remedy(held: Shape, made: Shape, options: &ImportOptions) -> String {
    let mut ways = Vec::new();
    if options.kind == Kind::Imagery {
        if held.sample_type == SampleType::U8 && made.sample_type != SampleType::U8 {
            ways.push(
                "say with --range LOW,HIGH which samples become 0 and 255 of 8 bits".to_owned(),
            );
        }
        if options.range.is_some() && held.sample_type != SampleType::U8 {
            ways.push("leave out --range".to_owned());
        }
        if held.channels < made.channels {
            ways.push(format!("name {} bands with --bands", held.channels));
        }
    }
    let ways = ways.join(" and ");
    let mut letters = ways.chars();
    match letters.next() {
        Some(first) => format!(
            "{}{}, or choose another directory.",
            first.to_uppercase(),
            letters.as_str()
        ),
        None => "Choose another directory.".to_owned(),
    }
}

/// A sixteenth of the sources' finest step.
fn quantum_of(sources: &[Source]) -> f64 {
    let of_source = |source: &Source| {
        if source.description.integer {
            let step = source.description.scale.abs() * COARSEST_QUANTUM_M;
            2.0_f64
                .powf(step.log2().floor())
                .clamp(FINEST_QUANTUM_M, COARSEST_QUANTUM_M)
        } else {
            FRACTIONAL_QUANTUM_M
        }
    };
    sources
        .iter()
        .map(of_source)
        .fold(COARSEST_QUANTUM_M, f64::min)
}
