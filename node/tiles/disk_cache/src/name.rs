//! Names of files in the cache: a group and a relative path, checked before either meets a file system.
//!
//! In: two texts. Out: a [`Name`] that can leave neither the directory nor its group, or an error that names the
//! part and the remedy. It must not touch the file system.

use std::fmt;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::layout::SUFFIX;

/// Longest component of a name in bytes; with the ending it stays below the 255 that Linux file systems allow.
const MAX_COMPONENT_BYTES: usize = 128;
/// Longest name in bytes, the group and the strokes between components included.
pub(crate) const MAX_NAME_BYTES: usize = 512;
/// Most components of a path.
pub(crate) const MAX_COMPONENTS: usize = 16;

/// Why a name was refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum NameError {
    /// A component that is no plain file name.
    #[error(
        "cached file {whole:?}: the part {part:?} is no plain name; use 1…128 of the letters A–Z a–z, the digits, \
         '-', '_' and '.', not beginning with '.' and not ending with '.cached'"
    )]
    Component {
        /// The name as it was given.
        whole: String,
        /// The offending part.
        part: String,
    },
    /// Too long, or too deep.
    #[error(
        "cached file: a name of {bytes} bytes and {components} components; at most 512 bytes and 16 components are \
         allowed below a group: shorten it"
    )]
    TooLong {
        /// Its length in bytes.
        bytes: usize,
        /// Its components below the group.
        components: usize,
    },
}

/// The name of one immutable file. Two contents must never share a name: what changes gets another group.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Name {
    group: String,
    /// Group and path with strokes between components.
    whole: String,
}

impl Name {
    /// A name in `group` (one component, e.g. `"{data set id}-{revision}"`) with a relative `path` of 1…16 components.
    ///
    /// # Errors
    /// [`NameError`] where a component is not plain (absolute, `..`, hidden, control characters, strokes) or too long.
    pub fn new(group: &str, path: &Path) -> Result<Self, NameError> {
        // Paths that are no UTF-8 hold a replacement character here, which no plain component may.
        Self::parse(&format!("{group}/{}", path.to_string_lossy()), group)
    }

    fn parse(whole: &str, group: &str) -> Result<Self, NameError> {
        let components = whole.matches('/').count();
        if whole.len() > MAX_NAME_BYTES || components > MAX_COMPONENTS {
            return Err(NameError::TooLong {
                bytes: whole.len(),
                components,
            });
        }
        let refused = |part: &str| NameError::Component {
            whole: whole.to_owned(),
            part: part.to_owned(),
        };
        if !plain(group) {
            return Err(refused(group));
        }
        match whole.split('/').find(|part| !plain(part)) {
            Some(part) => Err(refused(part)),
            None => Ok(Self {
                group: group.to_owned(),
                whole: whole.to_owned(),
            }),
        }
    }

    /// The name of a file of the cache, from its path below the root; none for a foreign file.
    pub(crate) fn of_file(relative: &Path) -> Option<Self> {
        let whole = relative.to_str()?.strip_suffix(SUFFIX)?.strip_suffix('.')?;
        let (group, _) = whole.split_once('/')?;
        Self::parse(whole, group).ok()
    }

    /// The group.
    #[must_use]
    pub fn group(&self) -> &str {
        &self.group
    }

    /// Group and path as they stand in a file's header.
    pub(crate) fn whole(&self) -> &str {
        &self.whole
    }

    /// The file's path below the root of the cache.
    #[must_use]
    pub fn file(&self) -> PathBuf {
        PathBuf::from(format!("{}.{SUFFIX}", self.whole))
    }

    /// A short stand-in for the name: keys of leases and of memories. The file itself carries the whole name.
    pub(crate) fn key(&self) -> u128 {
        fnv1a_128(self.whole.as_bytes())
    }
}

impl fmt::Display for Name {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.whole)
    }
}

/// Whether a text may be one component of a path. Letters of other scripts are left out because file systems
/// disagree on how they are normalised.
pub(crate) fn plain(part: &str) -> bool {
    let letters = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    !part.is_empty()
        && part.len() <= MAX_COMPONENT_BYTES
        && !part.starts_with('.')
        && part.bytes().all(letters)
        // A directory of this name could stand where a file belongs.
        && Path::new(part).extension().is_none_or(|ending| ending != SUFFIX)
}

/// FNV-1a of 128 bits: Fowler, Noll, Vo, Eastlake, Hansen, "The FNV Non-Cryptographic Hash Algorithm" (Internet
/// draft draft-eastlake-fnv), sections 2 and 5.
pub(crate) fn fnv1a_128(bytes: &[u8]) -> u128 {
    const OFFSET_BASIS: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    const PRIME: u128 = (1 << 88) + (1 << 8) + 0x3b;
    bytes.iter().fold(OFFSET_BASIS, |hash, byte| {
        (hash ^ u128::from(*byte)).wrapping_mul(PRIME)
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn hostile_names_are_refused() {
        for group in [
            "", ".", "..", ".leases", "a/b", "/etc", "a\0b", "a b", "a\nb", "ä", "x.cached",
        ] {
            let refused = Name::new(group, Path::new("1/2"));
            assert!(
                matches!(refused, Err(NameError::Component { .. })),
                "{group:?}"
            );
        }
        for path in [
            "",
            "/etc/passwd",
            "../x",
            "a/../../x",
            "a//b",
            "a/./b",
            "a/",
            ".hidden",
            "a.cached/b",
        ] {
            assert!(Name::new("dem-1", Path::new(path)).is_err(), "{path:?}");
        }
        let long = "a/".repeat(17) + "a";
        assert!(matches!(
            Name::new("dem-1", Path::new(&long)),
            Err(NameError::TooLong { .. })
        ));
        assert!(Name::new(&"a".repeat(129), Path::new("b")).is_err());
    }

    #[test]
    fn hashes_as_the_draft_says() {
        // Its section on test vectors: "" and "a".
        assert_eq!(fnv1a_128(b""), 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d);
        assert_eq!(fnv1a_128(b"a"), 0xd228_cb69_6f1a_8caf_7891_2b70_4e4a_8964);
    }

    proptest! {
        #[test]
        fn what_is_accepted_stays_inside_and_is_found_again(group in ".{0,12}", path in "[a-c./\\\\]{0,12}") {
            if let Ok(name) = Name::new(&group, Path::new(&path)) {
                let file = name.file();
                prop_assert!(file.components().all(|part| matches!(part, std::path::Component::Normal(_))));
                prop_assert!(file.starts_with(&group));
                prop_assert_eq!(Name::of_file(&file), Some(name));
            }
        }
    }
}
