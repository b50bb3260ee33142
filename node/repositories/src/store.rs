//! The object store of an address: plain HTTP, or S3 with the credentials of this node.
//!
//! In: an address, the environment. Out: a store that sends each request once; retrying is the caller's. It must
//! not send anything and must not show a setting.

use std::path::Path as FilePath;
use std::sync::Arc;

use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey as Key};
use object_store::http::HttpBuilder;
use object_store::path::Path;
use object_store::{ClientConfigKey, ObjectStore, RetryConfig};
use thiserror::Error;
use url::Url;

use crate::credentials::{self, CredentialsError, Settings};
use crate::transport::Connector;

/// Why a store could not be set up.
#[derive(Debug, Error)]
pub enum StoreError {
    /// No server could be trusted.
    #[error(
        "this system has no certificates to check an https:// server by: install its ca-certificates, or name a file of \
         them in SSL_CERT_FILE"
    )]
    NoCertificates,
    /// The credentials file was refused.
    #[error(transparent)]
    Credentials(#[from] CredentialsError),
    /// Nothing to sign with.
    #[error(
        "there are no credentials for s3://: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or name a credentials \
         file in TERRAWALL_CREDENTIALS, or set AWS_SKIP_SIGNATURE=true for a public bucket; the role of a cloud machine is asked for only if \
         AWS_METADATA_ENDPOINT is set"
    )]
    NoCredentials,
    /// Requests would be readable on the way.
    #[error(
        "the endpoint of s3:// is plain http: use https, or set AWS_ALLOW_HTTP=true if the network is trusted"
    )]
    PlainEndpoint,
    /// The endpoint is no URL.
    #[error(
        "the endpoint of s3:// (AWS_ENDPOINT_URL) must be http(s)://host[:port], without user name or password"
    )]
    Endpoint,
    /// Another setting was refused.
    #[error("the settings for s3:// (environment AWS_… and credentials file) are refused: {0}")]
    Settings(String),
}

/// A store for `http(s)://`.
pub(crate) fn http(
    url: &Url,
    connector: Connector,
    trusts_anybody: bool,
) -> Result<Arc<dyn ObjectStore>, StoreError> {
    if url.scheme() == "https" && !trusts_anybody {
        return Err(StoreError::NoCertificates);
    }
    let store = HttpBuilder::new()
        .with_url(url.as_str())
        .with_retry(once())
        .with_http_connector(connector)
        .build()
        .map_err(|error| StoreError::Settings(error.to_string()))?;
    Ok(Arc::new(store))
}

/// A store for `s3://`. `environment` are the variables of the process; what the file says wins over them.
pub(crate) fn s3(
    bucket: &str,
    environment: impl Iterator<Item = (String, String)>,
    file: Option<&FilePath>,
    connector: Connector,
    trusts_anybody: bool,
) -> Result<Arc<dyn ObjectStore>, StoreError> {
    let settings = settings(environment, file)?;
    let last = |wanted: Key| {
        let found = settings.iter().rev().find(|(key, _)| *key == wanted);
        found.map(|(_, value)| value.as_str())
    };
    let yes = |key| last(key).is_some_and(|value| matches!(value, "true" | "1" | "yes" | "on"));
    let endpoint = last(Key::S3Endpoint).or(last(Key::Endpoint));
    let mut encrypted = true;
    if let Some(endpoint) = endpoint {
        let url = Url::parse(endpoint).map_err(|_| StoreError::Endpoint)?;
        if !matches!(url.scheme(), "http" | "https")
            || !url.username().is_empty()
            || url.password().is_some()
        {
            return Err(StoreError::Endpoint);
        }
        encrypted = url.scheme() == "https";
    }
    if !encrypted && !yes(Key::Client(ClientConfigKey::AllowHttp)) {
        return Err(StoreError::PlainEndpoint);
    }
    if encrypted && !trusts_anybody {
        return Err(StoreError::NoCertificates);
    }
    let some = [
        Key::AccessKeyId,
        Key::WebIdentityTokenFile,
        Key::ContainerCredentialsRelativeUri,
        Key::ContainerCredentialsFullUri,
        Key::MetadataEndpoint,
    ];
    if !yes(Key::SkipSignature) && !some.into_iter().any(|key| last(key).is_some()) {
        return Err(StoreError::NoCredentials);
    }
    let mut builder = AmazonS3Builder::new();
    for (key, value) in settings {
        builder = builder.with_config(key, value);
    }
    let store = builder
        .with_bucket_name(bucket)
        .with_retry(once())
        .with_http_connector(connector)
        .build()
        .map_err(|error| StoreError::Settings(error.to_string()))?;
    Ok(Arc::new(store))
}

/// All settings, the weakest first.
fn settings(
    environment: impl Iterator<Item = (String, String)>,
    file: Option<&FilePath>,
) -> Result<Settings, StoreError> {
    let mut settings = Settings::new();
    let mut profile = "default".to_owned();
    for (name, value) in environment.filter(|(name, _)| name.starts_with("AWS_")) {
        if name == "AWS_PROFILE" {
            profile = value;
        } else if let Ok(key) = name.to_ascii_lowercase().parse::<Key>() {
            // The address names the bucket.
            if key != Key::Bucket {
                settings.push((key, value));
            }
        }
    }
    // The region proper wins over the default region, whatever the order of the variables.
    settings.sort_by_key(|(key, _)| u8::from(*key != Key::DefaultRegion));
    if let Some(file) = file {
        let stated = credentials::load(file, &profile)?;
        if stated.iter().any(|(key, _)| *key == Key::AccessKeyId) {
            // A session token of the environment belongs to other keys.
            let keys = [Key::AccessKeyId, Key::SecretAccessKey, Key::Token];
            settings.retain(|(key, _)| !keys.contains(key));
        }
        if stated.iter().any(|(key, _)| *key == Key::Endpoint) {
            settings.retain(|(key, _)| *key != Key::S3Endpoint);
        }
        settings.extend(stated);
    }
    Ok(settings)
}

/// The path of a file beneath the prefix of an address.
pub(crate) fn key(prefix: &Path, file: &str) -> Path {
    let parts = file.split('/').map(object_store::path::PathPart::from);
    prefix.parts().chain(parts).collect()
}

/// Stores send each request once.
fn once() -> RetryConfig {
    RetryConfig {
        max_retries: 0,
        ..RetryConfig::default()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use crate::options::Options;
    use crate::transport::Transport;

    fn s3_of(
        environment: &[(&str, &str)],
        file: Option<&FilePath>,
    ) -> Result<Arc<dyn ObjectStore>, StoreError> {
        let connector = Transport::new(&Options::default())
            .unwrap()
            .connector(Arc::default());
        let environment = environment
            .iter()
            .map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
        s3("bucket", environment, file, connector, true)
    }

    const KEYS: [(&str, &str); 2] = [
        ("AWS_ACCESS_KEY_ID", "id"),
        ("AWS_SECRET_ACCESS_KEY", "hush"),
    ];

    #[test]
    fn keys_are_needed_unless_the_bucket_is_public() {
        assert!(s3_of(&KEYS, None).is_ok());
        assert!(s3_of(&[("AWS_SKIP_SIGNATURE", "true")], None).is_ok());
        let error = s3_of(&[("AWS_REGION", "x")], None).err().unwrap();
        assert!(matches!(error, StoreError::NoCredentials), "{error}");
    }

    #[test]
    fn plain_http_must_be_allowed() {
        let with = |more: &[(&'static str, &'static str)]| s3_of(&[&KEYS[..], more].concat(), None);
        let plain = ("AWS_ENDPOINT_URL", "http://127.0.0.1:9000");
        assert!(matches!(with(&[plain]), Err(StoreError::PlainEndpoint)));
        assert!(with(&[plain, ("AWS_ALLOW_HTTP", "true")]).is_ok());
        assert!(with(&[("AWS_ENDPOINT_URL", "https://host")]).is_ok());
        for endpoint in ["host:9000", "http://me:hush@host", "ftp://host"] {
            let error = with(&[("AWS_ENDPOINT_URL", endpoint)]).err().unwrap();
            assert!(matches!(error, StoreError::Endpoint), "{error}");
            assert!(!format!("{error} {error:?}").contains("hush"));
        }
    }

    #[test]
    fn the_file_wins_and_keys_are_not_mixed() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("keys.toml");
        std::fs::write(
            &file,
            "access_key_id = \"mine\"\nsecret_access_key = \"hush\"\n",
        )
        .unwrap();
        std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o600)).unwrap();
        let environment = [
            ("AWS_ACCESS_KEY_ID", "other"),
            ("AWS_SESSION_TOKEN", "other"),
            ("AWS_REGION", "here"),
            ("AWS_DEFAULT_REGION", "there"),
            ("AWS_BUCKET", "elsewhere"),
            ("HOME", "x"),
        ]
        .map(|(name, value)| (name.to_owned(), value.to_owned()));
        let settings = settings(environment.into_iter(), Some(&file)).ok().unwrap();
        let values: Vec<(Key, &str)> = settings
            .iter()
            .map(|(key, value)| (*key, value.as_str()))
            .collect();
        assert_eq!(
            values,
            [
                (Key::DefaultRegion, "there"),
                (Key::Region, "here"),
                (Key::AccessKeyId, "mine"),
                (Key::SecretAccessKey, "hush"),
            ]
        );
    }

    #[test]
    fn keys_lie_beneath_the_prefix() {
        let key = |prefix: &str, file| key(&Path::parse(prefix).unwrap(), file).to_string();
        assert_eq!(key("", "dataset.toml"), "dataset.toml");
        assert_eq!(
            key("earth/etopo", "5/001/7ff.tile"),
            "earth/etopo/5/001/7ff.tile"
        );
    }
}
