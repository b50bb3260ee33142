//! The text of the house: every source file of the workspace, for tests that hold it to its own rules.
//!
//! In: nothing. Out: paths and contents of tracked kinds of files. It must not look into build folders.

use std::path::{Path, PathBuf};

/// One source file.
#[derive(Debug)]
pub struct Source {
    /// Path relative to the workspace, with forward slashes.
    pub path: String,
    /// Its text.
    pub text: String,
}

/// Root of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the tests stand in the workspace")
        .to_owned()
}

/// All files of the workspace whose name ends in one of `endings`, sorted by path.
pub fn all(endings: &[&str]) -> Vec<Source> {
    let root = root();
    let mut found = Vec::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a readable folder") {
            let path = entry.expect("a folder entry").path();
            let name = path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            let generated = folder == root && (name == "target" || name == "out");
            if path.is_dir() && !generated && !name.starts_with('.') {
                folders.push(path);
            } else if path.is_file() && endings.iter().any(|ending| name.ends_with(ending)) {
                let text = std::fs::read_to_string(&path).expect("text in UTF-8");
                let relative = path.strip_prefix(&root).expect("a path in the workspace");
                found.push(Source {
                    path: relative.to_string_lossy().replace('\\', "/"),
                    text,
                });
            }
        }
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    found
}

impl Source {
    /// Whether the whole file is test code.
    pub fn is_test(&self) -> bool {
        self.path.starts_with("tests/")
            || self.path.contains("/tests/")
            || self.path.contains("/benches/")
    }

    /// The text above the test module, which by custom ends the file.
    pub fn without_tests(&self) -> &str {
        let end = self
            .text
            .find("#[cfg(test)]")
            .into_iter()
            .chain(self.text.find("#[cfg(all(test"))
            .min();
        &self.text[..end.unwrap_or(self.text.len())]
    }
}
