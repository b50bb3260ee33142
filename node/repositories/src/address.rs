//! Where a repository is: a path, `file://`, `http(s)://` or `s3://`.
//!
//! In: text. Out: a checked address whose text holds no secret. It must not look at what is there, and must not
//! repeat a refused address that may hold a password.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use thiserror::Error;
use url::Url;

/// Longest address in bytes.
const MOST_BYTES: usize = 4_096;

/// A repository's address. Its [`Display`](fmt::Display) can be shown to anybody.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Address(Place);

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Place {
    /// A directory of this file system.
    Directory(PathBuf),
    /// A base URL with scheme, host, port and path; no slash at its end.
    Http(Url),
    /// A bucket and the part of the keys before a file's relative path: no slash at either end.
    Bucket { bucket: String, prefix: String },
}

/// Why an address was refused. No message repeats what may be secret.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum AddressError {
    /// Nothing, or a novel.
    #[error(
        "a repository's address has {bytes} bytes, but 1…{MOST_BYTES} are allowed: give a directory, http://, https:// or s3://"
    )]
    Length {
        /// Its length.
        bytes: usize,
    },
    /// `ftp://` and the like.
    #[error(
        "repositories cannot be reached by {scheme}://: give a directory, file://, http://, https:// or s3://"
    )]
    Scheme {
        /// What it began with.
        scheme: String,
    },
    /// `user:password@` before the host.
    #[error(
        "the {scheme}:// address of a repository holds a user name or password, which everybody could read in scenes and logs: \
         leave it out; credentials for s3:// belong into the environment or a credentials file on the node"
    )]
    Credentials {
        /// The scheme.
        scheme: String,
    },
    /// `?…` or `#…` at the end.
    #[error(
        "the {scheme}:// address of a repository must end with its path: leave out what follows ? or #"
    )]
    Query {
        /// The scheme.
        scheme: String,
    },
    /// It cannot be understood.
    #[error(
        "the {scheme}:// address of a repository is malformed ({problem}): write {scheme}://{example}"
    )]
    Malformed {
        /// The scheme.
        scheme: String,
        /// What is wrong.
        problem: String,
        /// What could follow.
        example: &'static str,
    },
}

impl Address {
    /// The address of a directory.
    #[must_use]
    pub fn of_directory(path: &Path) -> Self {
        Self(Place::Directory(path.to_owned()))
    }

    /// The directory, unless it is on the network.
    #[must_use]
    pub fn directory(&self) -> Option<&Path> {
        match &self.0 {
            Place::Directory(path) => Some(path),
            Place::Http(_) | Place::Bucket { .. } => None,
        }
    }

    /// The same address with a relative directory taken from `base`.
    #[must_use]
    pub fn relative_to(self, base: &Path) -> Self {
        match self.0 {
            Place::Directory(path) => Self(Place::Directory(base.join(path))),
            place => Self(place),
        }
    }

    pub(crate) fn place(&self) -> &Place {
        &self.0
    }
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        if text.is_empty() || text.len() > MOST_BYTES {
            return Err(AddressError::Length { bytes: text.len() });
        }
        let Some((scheme, rest)) = text.split_once("://").filter(|(scheme, _)| {
            scheme.starts_with(|first: char| first.is_ascii_alphabetic())
                && scheme
                    .chars()
                    .all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
        }) else {
            return Ok(Self(Place::Directory(PathBuf::from(text))));
        };
        let scheme = scheme.to_ascii_lowercase();
        match scheme.as_str() {
            "http" | "https" => http(&scheme, text),
            "file" => file(rest),
            "s3" => bucket(rest),
            _ => Err(AddressError::Scheme { scheme }),
        }
        .map(Self)
    }
}

fn http(scheme: &str, text: &str) -> Result<Place, AddressError> {
    let scheme = scheme.to_owned();
    let mut url = Url::parse(text).map_err(|error| AddressError::Malformed {
        scheme: scheme.clone(),
        problem: error.to_string(),
        example: "host:8080/path",
    })?;
    if !url.username().is_empty() || url.password().is_some() {
        return Err(AddressError::Credentials { scheme });
    }
    if url.query().is_some() || url.fragment().is_some() {
        return Err(AddressError::Query { scheme });
    }
    // One place has one address, however many slashes end it.
    while url.path().len() > 1 && url.path().ends_with('/') {
        let Ok(mut segments) = url.path_segments_mut() else {
            break;
        };
        segments.pop_if_empty();
    }
    Ok(Place::Http(url))
}

fn file(rest: &str) -> Result<Place, AddressError> {
    let malformed = |problem: &str| AddressError::Malformed {
        scheme: "file".to_owned(),
        problem: problem.to_owned(),
        example: "/directory",
    };
    if !rest.starts_with('/') {
        return Err(malformed("it names a host"));
    }
    let url =
        Url::parse(&format!("file://{rest}")).map_err(|error| malformed(&error.to_string()))?;
    if url.query().is_some() || url.fragment().is_some() {
        return Err(AddressError::Query {
            scheme: "file".to_owned(),
        });
    }
    let path = url
        .to_file_path()
        .map_err(|()| malformed("it is no path of this system"))?;
    Ok(Place::Directory(path))
}

fn bucket(rest: &str) -> Result<Place, AddressError> {
    let scheme = || "s3".to_owned();
    let malformed = |problem: &str| AddressError::Malformed {
        scheme: scheme(),
        problem: problem.to_owned(),
        example: "bucket/prefix",
    };
    let (bucket, prefix) = rest.split_once('/').unwrap_or((rest, ""));
    if bucket.contains('@') {
        return Err(AddressError::Credentials { scheme: scheme() });
    }
    if rest.contains(['?', '#']) {
        return Err(AddressError::Query { scheme: scheme() });
    }
    // Amazon S3 User Guide, "General purpose bucket naming rules"; other servers allow no more.
    let name = (3..=63).contains(&bucket.len())
        && bucket.bytes().all(|byte| {
            byte.is_ascii_lowercase() || byte.is_ascii_digit() || b".-".contains(&byte)
        });
    if !name {
        return Err(malformed(
            "a bucket's name is 3…63 lower-case letters, digits, dots and hyphens",
        ));
    }
    let prefix = prefix.trim_matches('/');
    object_store::path::Path::parse(prefix)
        .map_err(|_| malformed("the prefix holds characters that keys cannot have"))?;
    Ok(Place::Bucket {
        bucket: bucket.to_owned(),
        prefix: prefix.to_owned(),
    })
}

impl fmt::Display for Address {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Place::Directory(path) => write!(formatter, "{}", path.display()),
            Place::Http(url) => formatter.write_str(url.as_str().trim_end_matches('/')),
            Place::Bucket { bucket, prefix } if prefix.is_empty() => {
                write!(formatter, "s3://{bucket}")
            }
            Place::Bucket { bucket, prefix } => write!(formatter, "s3://{bucket}/{prefix}"),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use proptest::prelude::*;

    fn shown(text: &str) -> String {
        text.parse::<Address>().unwrap().to_string()
    }

    #[test]
    fn all_kinds_are_told_apart() {
        for (text, due) in [
            ("data/etopo", "data/etopo"),
            ("/data/a b", "/data/a b"),
            ("C:data", "C:data"),
            ("file:///data/a%20b", "/data/a b"),
            ("http://host", "http://host"),
            ("HTTP://Host:8080/a/b/", "http://host:8080/a/b"),
            ("https://host:443/x", "https://host/x"),
            ("http://[::1]:80/x", "http://[::1]/x"),
            ("s3://bucket", "s3://bucket"),
            ("s3://bucket.of-mine/", "s3://bucket.of-mine"),
            ("s3://bucket/earth/etopo/", "s3://bucket/earth/etopo"),
        ] {
            assert_eq!(shown(text), due, "{text}");
        }
        let directory = |text: &str| text.parse::<Address>().unwrap().directory().is_some();
        assert!(directory("data") && directory("file:///data"));
        assert!(!directory("http://host") && !directory("s3://bucket"));
    }

    #[test]
    fn equal_places_are_equal() {
        let address = |text: &str| text.parse::<Address>().unwrap();
        assert_eq!(address("http://h/x/"), address("HTTP://H:80/x"));
        assert_eq!(address("http://h/x///"), address("http://h/x"));
        assert_eq!(address("http://h///"), address("http://h"));
        assert_eq!(address("s3://bucket/a"), address("s3://bucket//a/"));
        assert_eq!(
            address("data").relative_to(Path::new("/base")),
            address("/base/data")
        );
        assert_eq!(
            address("s3://bucket").relative_to(Path::new("/base")),
            address("s3://bucket")
        );
    }

    #[test]
    fn secrets_are_refused_and_not_repeated() {
        for text in [
            "http://me:hush@host/x",
            "https://hush@host/x",
            "s3://me:hush@bucket/x",
            "https://host/x?token=hush",
            "http://host/#hush",
            "s3://bucket/x?hush",
            "http://hush:hush@host:99999/",
            "file:///x?hush",
            "s3://BUCKET:hush",
        ] {
            let error = text.parse::<Address>().unwrap_err();
            assert!(!error.to_string().contains("hush"), "{text}: {error}");
            assert!(!format!("{error:?}").contains("hush"), "{text}");
        }
        let error = "http://me:hush@host/x".parse::<Address>().unwrap_err();
        assert!(error.to_string().contains("credentials file"), "{error}");
    }

    #[test]
    fn what_is_malformed_is_named_with_the_remedy() {
        for (text, part) in [
            ("", "0 bytes"),
            ("ftp://host/x", "ftp://"),
            ("http://", "http://host:8080/path"),
            ("http://host:port/", "host:8080"),
            ("file://host/x", "it names a host"),
            ("s3://", "3…63"),
            ("s3://No/x", "3…63"),
            ("s3://bucket/a//b", "prefix"),
            ("s3://bucket/../b", "prefix"),
        ] {
            let error = text.parse::<Address>().unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
        let long = "x".repeat(5_000).parse::<Address>().unwrap_err();
        assert_eq!(long, AddressError::Length { bytes: 5_000 });
    }

    proptest! {
        #[test]
        fn any_text_is_an_address_or_an_error(text in ".{0,60}", scheme in "(|http://|https://|s3://|file://)") {
            if let Ok(address) = format!("{scheme}{text}").parse::<Address>() {
                // What it shows means the same, but for directories, whose names may look like anything.
                if address.directory().is_none() {
                    prop_assert_eq!(address.to_string().parse::<Address>().unwrap(), address);
                }
            }
        }
    }
}
