//! Credentials for `s3://` from a file on the node: TOML, or the INI dialect of the AWS tools.
//!
//! In: a path. Out: settings of the S3 client. Errors name file and line and never what stands there. It must not
//! read a file that others may read too. INI: AWS CLI User Guide, "Configuration and credential file settings".

use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use object_store::aws::AmazonS3ConfigKey as Key;
use thiserror::Error;

/// Longest credentials file.
const MOST_BYTES: u64 = 65_536;

/// Settings of the S3 client. Deliberately without `Debug`: some are secret.
pub(crate) type Settings = Vec<(Key, String)>;

/// Why a credentials file was refused. No message holds anything of its content but names of keys.
#[derive(Debug, Error)]
pub enum CredentialsError {
    /// It cannot be read.
    #[error("cannot read the credentials file {path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Other users of this machine could read it.
    #[error("the credentials file {path} may be read or written by others (mode {mode:03o}): run chmod 600 on it", path = path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// Its permission bits.
        mode: u32,
    },
    /// It is no such file.
    #[error("the credentials file {path} is larger than {MOST_BYTES} bytes or not UTF-8: it cannot be what it should be", path = path.display())]
    NoText {
        /// The file.
        path: PathBuf,
    },
    /// A line cannot be understood.
    #[error("{path}:{line}: {problem}", path = path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        problem: String,
    },
    /// Something is missing.
    #[error("the credentials file {path} {problem}", path = path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// What is missing.
        problem: String,
    },
}

/// Reads a credentials file. Names ending in `.toml` are TOML; others have sections, of which `profile` counts.
pub(crate) fn load(path: &Path, profile: &str) -> Result<Settings, CredentialsError> {
    let failed = |source| CredentialsError::Io {
        path: path.to_owned(),
        source,
    };
    let file = File::open(path).map_err(failed)?;
    // Of the opened file, so that nobody exchanges it in between.
    let metadata = file.metadata().map_err(failed)?;
    if !metadata.is_file() {
        return Err(failed(io::Error::other("it is no file")));
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let mode = metadata.permissions().mode() & 0o777;
        if mode & 0o077 != 0 {
            return Err(CredentialsError::Open {
                path: path.to_owned(),
                mode,
            });
        }
    }
    let mut bytes = Vec::new();
    file.take(MOST_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(failed)?;
    let text = String::from_utf8(bytes)
        .ok()
        .filter(|text| text.len() as u64 <= MOST_BYTES)
        .ok_or_else(|| CredentialsError::NoText {
            path: path.to_owned(),
        })?;
    let settings = if path.extension().is_some_and(|ending| ending == "toml") {
        toml(&text, path)?
    } else {
        ini(&text, path, profile)?
    };
    let missing = |problem: String| CredentialsError::Missing {
        path: path.to_owned(),
        problem,
    };
    let has = |wanted: Key| settings.iter().any(|(key, _)| *key == wanted);
    if has(Key::AccessKeyId) != has(Key::SecretAccessKey) {
        return Err(missing(
            "has only one of access_key_id and secret_access_key: both or none are needed"
                .to_owned(),
        ));
    }
    Ok(settings)
}

fn toml(text: &str, path: &Path) -> Result<Settings, CredentialsError> {
    let wrong = |line, problem| {
        Err(CredentialsError::Line {
            path: path.to_owned(),
            line,
            problem,
        })
    };
    let table: toml::Table = match toml::from_str(text) {
        Ok(table) => table,
        Err(error) => {
            // The parser's own message would show the line.
            let at = error.span().map_or(0, |span| span.start);
            let before = text.get(..at).unwrap_or(text);
            let line = before.matches('\n').count() + 1;
            return wrong(
                line,
                "this is no TOML; write access_key_id = \"…\"".to_owned(),
            );
        }
    };
    let mut settings = Settings::new();
    for (name, value) in table {
        let line = text
            .lines()
            .position(|line| line.trim_start().trim_start_matches('"').starts_with(&name))
            .map_or(1, |line| line + 1);
        let Some(key) = key(&name) else {
            return wrong(line, unknown(&name));
        };
        match value {
            toml::Value::String(value) => settings.push((key, value)),
            toml::Value::Boolean(value) => settings.push((key, value.to_string())),
            _ => {
                return wrong(
                    line,
                    format!("the value of {name} must be a text or true or false"),
                );
            }
        }
    }
    Ok(settings)
}

fn ini(text: &str, path: &Path, profile: &str) -> Result<Settings, CredentialsError> {
    let wrong = |line, problem| {
        Err(CredentialsError::Line {
            path: path.to_owned(),
            line,
            problem,
        })
    };
    let mut settings = Settings::new();
    let (mut found, mut inside) = (false, false);
    for (line, content) in text.lines().enumerate() {
        let (line, content) = (line + 1, content.trim());
        if content.is_empty() || content.starts_with(['#', ';']) {
            continue;
        }
        if let Some(section) = content
            .strip_prefix('[')
            .and_then(|rest| rest.strip_suffix(']'))
        {
            let section = section.trim();
            inside = section.strip_prefix("profile ").unwrap_or(section).trim() == profile;
            found |= inside;
            continue;
        }
        if !inside {
            continue;
        }
        let Some((name, value)) = content.split_once('=') else {
            return wrong(
                line,
                "this is neither [a section] nor key = value".to_owned(),
            );
        };
        let name = name.trim().to_ascii_lowercase();
        if name == "output" {
            // For the AWS tools: how they print.
            continue;
        }
        match key(&name) {
            Some(key) => settings.push((key, value.trim().to_owned())),
            None => return wrong(line, unknown(&name)),
        }
    }
    if !found {
        return Err(CredentialsError::Missing {
            path: path.to_owned(),
            problem: format!("has no section [{profile}]: AWS_PROFILE chooses the section"),
        });
    }
    Ok(settings)
}

fn key(name: &str) -> Option<Key> {
    Some(match name {
        "access_key_id" | "aws_access_key_id" => Key::AccessKeyId,
        "secret_access_key" | "aws_secret_access_key" => Key::SecretAccessKey,
        "session_token" | "aws_session_token" => Key::Token,
        "region" | "aws_region" => Key::Region,
        "endpoint_url" | "aws_endpoint_url" => Key::Endpoint,
        "allow_http" | "aws_allow_http" => Key::Client(object_store::ClientConfigKey::AllowHttp),
        "skip_signature" | "aws_skip_signature" => Key::SkipSignature,
        "virtual_hosted_style_request" | "aws_virtual_hosted_style_request" => {
            Key::VirtualHostedStyleRequest
        }
        _ => return None,
    })
}

fn unknown(name: &str) -> String {
    // A key of a wrong line may be a secret that lost its own key.
    let plain = name.len() <= 32 && name.bytes().all(|b| b.is_ascii_lowercase() || b == b'_');
    format!(
        "{} is unknown; known are access_key_id, secret_access_key, session_token, region, endpoint_url, allow_http, \
         skip_signature and virtual_hosted_style_request",
        if plain { name } else { "the key" }
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    fn written(name: &str, text: &str, mode: u32) -> Result<Settings, CredentialsError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
        load(&path, "default")
    }

    fn message(name: &str, text: &str, mode: u32) -> String {
        match written(name, text, mode) {
            Ok(_) => panic!("{name} was taken"),
            Err(error) => {
                assert!(!format!("{error:?} {error}").contains("hush"), "{error:?}");
                error.to_string()
            }
        }
    }

    const DUE: [(Key, &str); 3] = [
        (Key::AccessKeyId, "id"),
        (Key::SecretAccessKey, "hush/+="),
        (Key::Region, "eu-central-1"),
    ];

    fn check(settings: &Settings) {
        assert_eq!(settings.len(), DUE.len());
        for (key, value) in DUE {
            assert!(settings.iter().any(|(k, v)| *k == key && v == value));
        }
    }

    #[test]
    fn both_dialects_are_read() {
        let toml =
            "access_key_id = \"id\"\nsecret_access_key = \"hush/+=\"\nregion = \"eu-central-1\"\n";
        check(&written("a.toml", toml, 0o600).ok().unwrap());
        let ini = "# mine\n[other]\naws_access_key_id = no\n[default]\naws_access_key_id=id\noutput = json\n\
                   aws_secret_access_key = hush/+=\nregion = eu-central-1\n[third]\nregion = no\n";
        check(&written("credentials", ini, 0o400).ok().unwrap());
    }

    #[test]
    fn files_that_others_may_read_are_refused() {
        for mode in [0o640, 0o604, 0o644, 0o620] {
            let message = message("a.toml", "region = \"x\"", mode);
            assert!(message.contains("chmod 600"), "{message}");
            assert!(message.contains(&format!("{mode:03o}")), "{message}");
        }
    }

    #[test]
    fn errors_name_the_line_and_no_secret() {
        for (name, text, part) in [
            (
                "a.toml",
                "region = \"x\"\nsecret_access_key = hush\n",
                ":2: ",
            ),
            ("a.toml", "region = \"x\"\nhush\n", ":2: "),
            (
                "a.toml",
                "region = \"x\"\nsecret_acess_key = \"hush\"\n",
                ":2: secret_acess_key is unknown",
            ),
            ("a.toml", "Hush9hush = 1\n", ":1: the key is unknown"),
            (
                "a.toml",
                "secret_access_key = 5\n",
                ":1: the value of secret",
            ),
            ("a.toml", "secret_access_key = \"hush\"\n", "only one of"),
            ("a", "[default]\nhush\n", ":2: "),
            ("a", "[default]\nHUSH9 = hush\n", ":2: the key is unknown"),
            ("a", "[other]\n", "no section [default]"),
            ("a", "[default]\naws_access_key_id = id\n", "only one of"),
        ] {
            let message = message(name, text, 0o600);
            assert!(message.contains(part), "{text:?}: {message}");
        }
        assert!(message("a", &"x".repeat(70_000), 0o600).contains("larger than"));
        let missing = load(Path::new("/nowhere/at/all"), "default").err().unwrap();
        assert!(missing.to_string().contains("/nowhere/at/all"));
    }
}
