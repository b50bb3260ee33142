//! Wall configurations of other systems as wall files of Terrawall.
//! In: the text of a QVR, SGCT or Equalizer configuration. Out: TOML with comments, and a list of all that it cannot
//! say. It opens no file and asks nobody; a value of the source that is neither carried over nor listed is a defect.

mod draft;
mod eqc;
mod error;
mod ledger;
mod place;
mod qvr;
mod room;
mod sgct;
mod source;
mod stereo;
mod trackers;
mod write;

pub use error::ConvertError;
pub use ledger::Lost;

use draft::Builder;
use source::Tree;

/// Longest text that is read, in bytes.
pub const MAX_TEXT_BYTES: usize = 1 << 20;
/// Deepest nesting of blocks, objects and arrays.
pub const MAX_DEPTH: usize = 64;
/// Most hosts that a wall file may have.
pub const MAX_HOSTS: usize = 256;
/// Most screens that a wall file may have.
pub const MAX_SCREENS: usize = 256;

/// A system whose configurations can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// QVR: lines of keys and words (`.qvr`; marlam/qvr, libqvr/config.hpp).
    Qvr,
    /// SGCT: JSON (`.json`; sgct/sgct, sgct.schema.json of 2024–2026).
    Sgct,
    /// Equalizer: nested braces (`.eqc`; Eyescale/Equalizer, "File Format" of its programming guide).
    Equalizer,
}

impl Format {
    /// Every format with the name that a command line may use.
    pub const NAMES: [(Self, &'static str); 3] = [
        (Self::Qvr, "qvr"),
        (Self::Sgct, "sgct"),
        (Self::Equalizer, "eqc"),
    ];

    /// The format that a file's extension tells: `.qvr`, `.json` or `.eqc`, in any case.
    #[must_use]
    pub fn of_file_name(name: &str) -> Option<Self> {
        let (_, extension) = name.rsplit_once('.')?;
        match extension.to_ascii_lowercase().as_str() {
            "qvr" => Some(Self::Qvr),
            "json" => Some(Self::Sgct),
            "eqc" => Some(Self::Equalizer),
            _ => None,
        }
    }

    /// What the system calls itself.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::Qvr => "QVR",
            Self::Sgct => "SGCT",
            Self::Equalizer => "Equalizer",
        }
    }
}

/// A converted configuration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Converted {
    /// The wall file. Comments at its head say what `lost` says.
    pub toml: String,
    /// What is not carried over as it was, and what was assumed, in the order of the source.
    pub lost: Vec<Lost>,
}

/// Converts a configuration. `origin_name` names the text in errors and comments, usually the file's path; the wall is
/// named after it unless the source names itself.
///
/// # Errors
/// Text that is not of this format (with line, column and what was expected), a value of the wrong type or out of
/// range, sizes beyond the limits above, or a source of which no picture is left.
pub fn convert(text: &str, origin_name: &str, format: Format) -> Result<Converted, ConvertError> {
    if text.len() > MAX_TEXT_BYTES {
        return Err(ConvertError::TooLong {
            origin: origin_name.to_owned(),
            bytes: text.len(),
        });
    }
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let at_origin = |trouble: error::Trouble| trouble.at_origin(origin_name);
    let tree: Tree = match format {
        Format::Qvr => qvr::parse(text),
        Format::Sgct => sgct::parse(text),
        Format::Equalizer => eqc::parse(text),
    }
    .map_err(at_origin)?;
    let mut builder = Builder::new(origin_name);
    match format {
        Format::Qvr => qvr::read(&tree, &mut builder),
        Format::Sgct => sgct::read(&tree, &mut builder),
        Format::Equalizer => eqc::read(&tree, &mut builder),
    }
    .map_err(at_origin)?;
    let reason = match format {
        Format::Qvr => qvr::reason,
        Format::Sgct => sgct::reason,
        Format::Equalizer => eqc::reason,
    };
    builder.ledger.sweep(&tree, reason);
    let (draft, lost) = builder.finish();
    if draft.hosts.is_empty() {
        return Err(ConvertError::NothingLeft {
            origin: origin_name.to_owned(),
            lost,
        });
    }
    let toml = write::toml(&draft, &lost, origin_name, format);
    Ok(Converted { toml, lost })
}
