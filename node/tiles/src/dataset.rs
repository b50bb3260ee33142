//! What a repository says of itself: `dataset.toml`, the one file at its root that people read.
//! In: the text. Out: a checked [`Dataset`]. It must not look at tiles.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use geodesy::{Ellipsoid, EllipsoidError, MAX_LEVEL};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::format::{Kind, SampleType};
use crate::publish::{Durability, PublishError, publish, random_u64};

/// The version of the repository's layout that this program writes and reads.
pub const DATASET_VERSION: u32 = 1;
/// The file's name under the repository's root.
pub const DATASET_FILE: &str = "dataset.toml";

/// A number made at random when a repository is created; written as 32 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct DatasetId(u128);

/// A repository's description.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dataset {
    /// [`DATASET_VERSION`].
    pub format_version: u32,
    /// Tells this data set from every other.
    pub id: DatasetId,
    /// Counts the imports; caches keep tiles of different revisions apart.
    pub revision: u32,
    /// For people.
    pub name: String,
    /// What the samples mean.
    pub kind: Kind,
    /// Their number type.
    pub sample_type: SampleType,
    /// Channels a node, 1…16.
    pub channels: u8,
    /// Metres in one elevation quantum, > 0; absent for other kinds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quantum_m: Option<f64>,
    /// The deepest level with tiles, 0…22.
    pub deepest_level: u8,
    /// The planet.
    pub ellipsoid: Ellipsoid,
    /// What was imported, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<SourceNote>,
}

/// One imported source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SourceNote {
    /// The file's name, without its directory.
    pub file: String,
    /// Format, size and reference system, for people.
    pub description: String,
}

/// Why a `dataset.toml` was refused.
#[derive(Debug, Error)]
pub enum DatasetError {
    /// There is none.
    #[error("{path} is no repository: it has no {DATASET_FILE}; make one with `terrawall import`", path = path.display())]
    NoRepository {
        /// The directory.
        path: PathBuf,
    },
    /// It cannot be read.
    #[error("cannot read {path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// It is not TOML, or has unknown or missing keys.
    #[error("{path}: {problem}", path = path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// What is wrong, with line and column.
        problem: String,
    },
    /// Another version made it.
    #[error("{path} was made by another version: its format_version is {found}, this program reads {DATASET_VERSION}; import the sources again into a new directory, or use the program that made it", path = path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: i64,
    },
    /// A value is out of range.
    #[error("{path}: {problem}", path = path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// Which value, and what is allowed.
        problem: String,
    },
    /// It could not be written.
    #[error(transparent)]
    Write(#[from] PublishError),
}

impl Dataset {
    /// A new description with a new id, revision 0, no source and no tile.
    #[must_use]
    pub fn new(name: &str, kind: Kind, sample_type: SampleType, channels: u8) -> Self {
        Self {
            format_version: DATASET_VERSION,
            id: DatasetId::random(),
            revision: 0,
            name: name.to_owned(),
            kind,
            sample_type,
            channels,
            quantum_m: (kind == Kind::Elevation).then_some(1.0 / 16.0),
            deepest_level: 0,
            ellipsoid: Ellipsoid::EARTH,
            sources: Vec::new(),
        }
    }

    /// What one sample unit is in natural units: metres for elevation, 1 otherwise.
    #[must_use]
    pub fn unit(&self) -> f64 {
        self.quantum_m.unwrap_or(1.0)
    }

    /// Reads the description of the repository at `root`.
    pub fn load(root: &Path) -> Result<Self, DatasetError> {
        let path = root.join(DATASET_FILE);
        match std::fs::read_to_string(&path) {
            Ok(text) => Self::parse(&text, &path),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                Err(DatasetError::NoRepository {
                    path: root.to_owned(),
                })
            }
            Err(source) => Err(DatasetError::Io { path, source }),
        }
    }

    /// Writes the description of the repository at `root`, atomically and flushed.
    pub fn store(&self, root: &Path) -> Result<(), DatasetError> {
        let path = root.join(DATASET_FILE);
        self.check(&path)?;
        let text = toml::to_string(self).map_err(|error| DatasetError::Syntax {
            path: path.clone(),
            problem: error.to_string(),
        })?;
        Ok(publish(root, &path, text.as_bytes(), Durability::Synced)?)
    }

    /// Reads a description that was fetched from elsewhere. `place` is the address of its file, for messages.
    ///
    /// # Errors
    /// [`DatasetError`], with `place` where a path would stand.
    pub fn from_text(text: &str, place: &str) -> Result<Self, DatasetError> {
        Self::parse(text, Path::new(place))
    }

    fn parse(text: &str, path: &Path) -> Result<Self, DatasetError> {
        let syntax = |error: toml::de::Error| DatasetError::Syntax {
            path: path.to_owned(),
            problem: error.to_string(),
        };
        // The version comes first: keys of another version must not be called unknown.
        let table: toml::Table = toml::from_str(text).map_err(syntax)?;
        if let Some(found) = table
            .get("format_version")
            .and_then(toml::Value::as_integer)
            && found != i64::from(DATASET_VERSION)
        {
            return Err(DatasetError::Version {
                path: path.to_owned(),
                found,
            });
        }
        let dataset: Self = toml::from_str(text).map_err(syntax)?;
        dataset.check(path)?;
        Ok(dataset)
    }

    fn check(&self, path: &Path) -> Result<(), DatasetError> {
        let wrong = |problem| {
            Err(DatasetError::Value {
                path: path.to_owned(),
                problem,
            })
        };
        let Self {
            kind,
            sample_type,
            channels,
            quantum_m,
            deepest_level,
            ..
        } = self;
        if !kind.takes(*sample_type, *channels) {
            return wrong(format!(
                "{channels} channels of {sample_type:?} cannot be {kind}"
            ));
        }
        match quantum_m {
            Some(quantum) if *kind != Kind::Elevation => {
                return wrong(format!("quantum_m = {quantum} is for elevation only"));
            }
            Some(quantum) if !(quantum.is_finite() && *quantum > 0.0) => {
                return wrong(format!("quantum_m = {quantum} must be positive and finite"));
            }
            None if *kind == Kind::Elevation => {
                return wrong(
                    "elevation needs quantum_m, the metres in one sample unit".to_owned(),
                );
            }
            _ => {}
        }
        if *deepest_level > MAX_LEVEL {
            return wrong(format!(
                "deepest_level = {deepest_level} must be 0…{MAX_LEVEL}"
            ));
        }
        let Ellipsoid {
            semi_major_m,
            semi_minor_m,
        } = self.ellipsoid;
        Ellipsoid::new(semi_major_m, semi_minor_m)
            .map(|_| ())
            .or_else(|error: EllipsoidError| wrong(format!("ellipsoid: {error}")))
    }
}

impl DatasetId {
    /// A number of a tile of this data set that is the same in every process, and another for every other tile of any.
    #[must_use]
    pub fn number(self, tile: geodesy::Tile) -> u64 {
        // A product with an odd number takes no two tiles to one place (Knuth's multiplicative hashing, with 2^64/φ).
        (self.0 as u64).wrapping_add(tile.id().wrapping_mul(0x9E37_79B9_7F4A_7C15))
    }

    /// A new id.
    #[must_use]
    pub fn random() -> Self {
        Self(u128::from(random_u64()) << 64 | u128::from(random_u64()))
    }
}

impl fmt::Display for DatasetId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:032x}", self.0)
    }
}

impl fmt::Debug for DatasetId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "DatasetId({self})")
    }
}

impl FromStr for DatasetId {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let digits = text.len() == 32 && text.bytes().all(|b| b.is_ascii_hexdigit());
        match u128::from_str_radix(text, 16) {
            Ok(number) if digits => Ok(Self(number)),
            _ => Err(format!(
                "\"{text}\" is no data set id: 32 hexadecimal digits"
            )),
        }
    }
}

impl Serialize for DatasetId {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for DatasetId {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?
            .parse()
            .map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    #[test]
    fn comes_back_from_its_file() {
        let root = tempfile::tempdir().unwrap();
        let mut dataset = Dataset::new("land \"and\" sea", Kind::Elevation, SampleType::I32, 1);
        let description = "GeoTIFF 4320×2161, EPSG:4326".to_owned();
        dataset.sources.push(SourceNote {
            file: "etopo5.tif".to_owned(),
            description,
        });
        dataset.deepest_level = 3;
        dataset.store(root.path()).unwrap();
        assert_eq!(Dataset::load(root.path()).unwrap(), dataset);
    }

    #[test]
    fn another_version_is_named_with_the_remedy() {
        let root = tempfile::tempdir().unwrap();
        std::fs::write(
            root.path().join(DATASET_FILE),
            "format_version = 7\nnovel = true\n",
        )
        .unwrap();
        let message = Dataset::load(root.path()).unwrap_err().to_string();
        for part in ["format_version is 7", "reads 1", "import the sources again"] {
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn bad_values_and_unknown_keys_are_refused() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join(DATASET_FILE);
        let good = Dataset::new("x", Kind::Elevation, SampleType::I32, 1);
        let text = toml::to_string(&good).unwrap();
        for (from, to, due) in [
            ("channels = 1", "channels = 3", "3 channels"),
            ("quantum_m = 0.0625", "quantum_m = -1.0", "quantum_m = -1"),
            ("quantum_m = 0.0625\n", "", "needs quantum_m"),
            ("deepest_level = 0", "deepest_level = 23", "0…22"),
            (
                "semi_minor_m = 6356752.314245179",
                "semi_minor_m = 1.0",
                "ellipsoid",
            ),
            ("name = \"x\"", "name = \"x\"\nnaem = 2", "naem"),
            ("revision = 0", "revision = -1", "revision"),
        ] {
            assert!(text.contains(from), "{text}");
            std::fs::write(&path, text.replace(from, to)).unwrap();
            let message = Dataset::load(root.path()).unwrap_err().to_string();
            assert!(message.contains(due), "{message}");
        }
        let nowhere = Dataset::load(&root.path().join("nowhere")).unwrap_err();
        assert!(nowhere.to_string().contains("no repository"));
    }

    #[test]
    fn ids_are_different_and_readable() {
        let (one, other) = (DatasetId::random(), DatasetId::random());
        assert_ne!(one, other);
        assert_eq!(one.to_string().parse::<DatasetId>().unwrap(), one);
        assert!(
            "+123456789abcdef0123456789abcdef"
                .parse::<DatasetId>()
                .is_err()
        );
    }
}
