//! Resolves `#import shared::NAME` lines: each names a file of `wgsl/shared/` whose text takes its place.
//! In: a WGSL text. Out: the text with every import written out, once. It reads no file at run time.

use thiserror::Error;

/// Why a source could not be put together.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum ResolveError {
    /// The imported module is not in `wgsl/shared/`.
    #[error("shader {shader}, line {line}: no shared module \"{module}\"; there are: {known}")]
    Unknown {
        /// The shader that imports.
        shader: String,
        /// The line of the import, from 1.
        line: usize,
        /// The name that was asked for.
        module: String,
        /// The names that exist.
        known: String,
    },
}

const SHARED: [(&str, &str); 17] = [
    ("allowance", include_str!("../wgsl/shared/allowance.wgsl")),
    ("amplitude", include_str!("../wgsl/shared/amplitude.wgsl")),
    ("colour", include_str!("../wgsl/shared/colour.wgsl")),
    ("cube", include_str!("../wgsl/shared/cube.wgsl")),
    ("drawn", include_str!("../wgsl/shared/drawn.wgsl")),
    ("emission", include_str!("../wgsl/shared/emission.wgsl")),
    ("error_code", include_str!("../wgsl/shared/error_code.wgsl")),
    (
        "fixed_point",
        include_str!("../wgsl/shared/fixed_point.wgsl"),
    ),
    ("frame", include_str!("../wgsl/shared/frame.wgsl")),
    ("fusion", include_str!("../wgsl/shared/fusion.wgsl")),
    ("light", include_str!("../wgsl/shared/light.wgsl")),
    ("links", include_str!("../wgsl/shared/links.wgsl")),
    ("marks", include_str!("../wgsl/shared/marks.wgsl")),
    ("slot", include_str!("../wgsl/shared/slot.wgsl")),
    ("tangent", include_str!("../wgsl/shared/tangent.wgsl")),
    ("vertex", include_str!("../wgsl/shared/vertex.wgsl")),
    ("wide", include_str!("../wgsl/shared/wide.wgsl")),
];

/// Writes out the imports of `text`. Shared modules import nothing themselves.
pub(crate) fn resolve(shader: &str, text: &str) -> Result<String, ResolveError> {
    let mut resolved = String::with_capacity(text.len() * 2);
    let mut seen = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let Some(module) = line.trim().strip_prefix("#import shared::") else {
            resolved.push_str(line);
            resolved.push('\n');
            continue;
        };
        let found = SHARED.iter().find(|(name, _)| *name == module.trim());
        let Some((name, body)) = found else {
            return Err(ResolveError::Unknown {
                shader: shader.to_owned(),
                line: index + 1,
                module: module.trim().to_owned(),
                known: SHARED.map(|(name, _)| name).join(", "),
            });
        };
        if !seen.contains(name) {
            seen.push(*name);
            resolved.push_str(body);
        }
    }
    Ok(resolved)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;

    #[test]
    fn an_import_is_written_out_once() {
        let text = resolve("t", "#import shared::cube\n#import shared::cube\nfn f() {}").unwrap();
        assert_eq!(text.matches("fn face_u(").count(), 1);
        assert!(text.ends_with("fn f() {}\n"));
    }

    #[test]
    fn an_unknown_import_is_named() {
        let error = resolve("draw/x", "\n#import shared::nothing")
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("draw/x, line 2") && error.contains("nothing"),
            "{error}"
        );
    }
}
