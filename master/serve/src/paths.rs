//! Which paths of a URL may name a file: those that a repository has, spelt in one way only.
//!
//! In: the path of a request. Out: the relative path of a file, or nothing. What is not on this list, `%` and `..`
//! included, never reaches the file system.

use tiles::{DATASET_FILE, INDEX_FILE};

/// The deepest level of a tile: two digits.
const DEEPEST_LEVEL: u8 = 22;
/// Blocks of 12 bits in the path of the deepest tile (3 + 2 · 22 bits).
const MOST_BLOCKS: usize = 4;
/// Longest name of a repository.
const MOST_NAME_BYTES: usize = 128;

/// What a request's path names. The relative path has no empty, dot or dot-dot element.
pub(crate) fn file(path: &str, single: bool) -> Option<&str> {
    let path = path.strip_prefix('/')?;
    let inner = if single {
        path
    } else {
        let (name, inner) = path.split_once('/')?;
        is_name(name).then_some(inner)?
    };
    (inner == DATASET_FILE || inner == INDEX_FILE || is_tile(inner)).then_some(path)
}

/// Whether a repository of this name is served. Such names need no escaping in URLs.
pub(crate) fn is_name(name: &str) -> bool {
    (1..=MOST_NAME_BYTES).contains(&name.len())
        && !name.starts_with('.')
        && name
            .bytes()
            .all(|byte| byte.is_ascii_alphanumeric() || b".-_".contains(&byte))
}

/// `LEVEL/BLOCK/…/BLOCK.tile`, as `tiles::Repository` lays tiles out.
fn is_tile(path: &str) -> bool {
    let Some((level, blocks)) = path
        .strip_suffix(".tile")
        .and_then(|path| path.split_once('/'))
    else {
        return false;
    };
    let is_level = level
        .parse::<u8>()
        .is_ok_and(|number| number <= DEEPEST_LEVEL && number.to_string() == level);
    let is_block = |block: &str| {
        block.len() == 3
            && block
                .bytes()
                .all(|byte| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte))
    };
    is_level && blocks.split('/').count() <= MOST_BLOCKS && blocks.split('/').all(is_block)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use geodesy::Tile;
    use tiles::Repository;

    #[test]
    fn every_file_of_a_repository_is_one() {
        for name in [DATASET_FILE, INDEX_FILE] {
            assert_eq!(file(&format!("/{name}"), true), Some(name));
            let inner = format!("etopo-5.v2_x/{name}");
            assert_eq!(file(&format!("/{inner}"), false), Some(inner.as_str()));
        }
        for level in 0..=DEEPEST_LEVEL {
            let last = (1_u32 << level) - 1;
            for (face, x, y) in [(0, 0, 0), (5, last, last), (3, last, 0)] {
                let tile = Tile::new(face, level, x, y).unwrap();
                let path = Repository::relative_path_of(tile).display().to_string();
                assert_eq!(file(&format!("/{path}"), true), Some(path.as_str()));
            }
        }
    }

    #[test]
    fn nothing_else_is_one() {
        for path in [
            "",
            "/",
            "dataset.toml",
            "//dataset.toml",
            "/./dataset.toml",
            "/../dataset.toml",
            "/Dataset.toml",
            "/dataset.toml/",
            "/dataset.toml~",
            "/.dataset.toml.tmp",
            "/index%2ebin",
            "/0/00%35.tile",
            "/0/..%2f005.tile",
            "/0/../0/005.tile",
            "/00/005.tile",
            "/23/005.tile",
            "/+1/005.tile",
            "/0/05.tile",
            "/0/0005.tile",
            "/0/00F.tile",
            "/0/005.tile.tmp",
            "/0/.tile",
            "/0/",
            "/0",
            "/22/000/000/000/000/000.tile",
            "/0//005.tile",
            "/etopo/dataset.toml",
        ] {
            assert_eq!(file(path, true), None, "{path}");
        }
        for path in [
            "/dataset.toml",
            "/../dataset.toml",
            "/.hidden/dataset.toml",
            "/a b/dataset.toml",
            "/a%20b/dataset.toml",
            "/a/b/dataset.toml",
            "//dataset.toml",
            "/a/../dataset.toml",
            "/a/.git/index.bin",
        ] {
            assert_eq!(file(path, false), None, "{path}");
        }
        assert!(!is_name(&"x".repeat(129)));
    }
}
