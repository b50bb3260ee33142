//! The HTTP client beneath the object stores: connections, TLS, and answers that are no files.
//!
//! In: signed requests. Out: answers with status 200; every other answer becomes an error of which the status,
//! `Retry-After` and an S3 error code are kept and no other byte. It must not retry and must not log headers.

use std::fmt;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use async_trait::async_trait;
use http::header::{CACHE_CONTROL, RETRY_AFTER};
use http::{HeaderValue, StatusCode};
use object_store::ClientOptions;
use object_store::client::{
    HttpClient, HttpConnector, HttpError, HttpErrorKind, HttpRequest, HttpResponse, HttpService,
};
use rustls::crypto::ring;
use rustls::{ClientConfig, RootCertStore};
use thiserror::Error;

use crate::backoff::retry_after;
use crate::options::Options;
use crate::remote::Tally;

/// The longest time to make a connection, names looked up and TLS agreed upon.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// How long an unused connection is kept: not as long as servers do, so that none is closed while it is used again.
const IDLE: Duration = Duration::from_secs(20);
/// So much of a refusal is read to find its error code.
const MOST_REFUSAL_BYTES: usize = 4_096;
/// And for so long.
const REFUSAL_TIMEOUT: Duration = Duration::from_secs(1);
/// Redirects that are followed.
const REDIRECTS: usize = 4;

/// An HTTP client with its connections, shared by all repositories.
#[derive(Clone)]
pub(crate) struct Transport {
    client: reqwest::Client,
    /// Whether this system has certificates to check an `https://` server by.
    trusts_anybody: bool,
}

/// An answer other than 200.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("status {status}")]
pub(crate) struct Refused {
    pub(crate) status: StatusCode,
    pub(crate) retry_after: Option<Duration>,
    pub(crate) code: String,
}

impl Transport {
    /// A client without connections. The certificates are those of the system (`SSL_CERT_FILE` names others).
    pub(crate) fn new(options: &Options) -> Result<Self, String> {
        let mut roots = RootCertStore::empty();
        let found = rustls_native_certs::load_native_certs();
        let (trusted, _) = roots.add_parsable_certificates(found.certs);
        let tls = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
            .with_safe_default_protocol_versions()
            .map_err(|error| error.to_string())?
            .with_root_certificates(roots)
            .with_no_client_auth();
        let client = reqwest::Client::builder()
            .tls_backend_preconfigured(tls)
            .http1_only()
            .connect_timeout(CONNECT_TIMEOUT.min(options.attempt_timeout))
            .pool_idle_timeout(IDLE)
            .pool_max_idle_per_host(options.requests_in_flight)
            .redirect(reqwest::redirect::Policy::limited(REDIRECTS))
            .user_agent(concat!("terrawall/", env!("CARGO_PKG_VERSION")))
            .build()
            .map_err(|error| error.to_string())?;
        Ok(Self {
            client,
            trusts_anybody: trusted > 0,
        })
    }

    pub(crate) fn trusts_anybody(&self) -> bool {
        self.trusts_anybody
    }

    /// For one repository, whose requests are counted in `tally`.
    pub(crate) fn connector(&self, tally: Arc<Tally>) -> Connector {
        Connector {
            wire: Wire {
                client: HttpClient::new(self.client.clone()),
                tally,
            },
        }
    }
}

/// Gives object stores the one client.
#[derive(Debug)]
pub(crate) struct Connector {
    wire: Wire,
}

impl HttpConnector for Connector {
    fn connect(&self, _options: &ClientOptions) -> object_store::Result<HttpClient> {
        Ok(HttpClient::new(self.wire.clone()))
    }
}

#[derive(Clone)]
struct Wire {
    client: HttpClient,
    tally: Arc<Tally>,
}

impl fmt::Debug for Wire {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Wire")
    }
}

#[async_trait]
impl HttpService for Wire {
    async fn call(&self, mut request: HttpRequest) -> Result<HttpResponse, HttpError> {
        // A proxy that still holds a tile from before the last import must ask the server: a tile's address does
        // not carry the revision (RFC 9111, §5.2.1.4).
        request
            .headers_mut()
            .entry(CACHE_CONTROL)
            .or_insert(HeaderValue::from_static("no-cache"));
        self.tally.count_request();
        let response = self.client.execute(request).await?;
        if response.status() == StatusCode::OK {
            return Ok(response);
        }
        let wait = response
            .headers()
            .get(RETRY_AFTER)
            .and_then(|value| value.to_str().ok())
            .and_then(|text| retry_after(text, SystemTime::now()));
        let status = response.status();
        let beginning = tokio::time::timeout(REFUSAL_TIMEOUT, beginning(response)).await;
        let refused = Refused {
            status,
            retry_after: wait,
            code: error_code(&beginning.unwrap_or_default()).to_owned(),
        };
        Err(HttpError::new(HttpErrorKind::Unknown, refused))
    }
}

/// The first bytes of a body, as far as they arrive.
async fn beginning(response: HttpResponse) -> String {
    use futures_util::StreamExt as _;
    let mut bytes = Vec::new();
    let mut stream = response.into_body().bytes_stream();
    while bytes.len() < MOST_REFUSAL_BYTES
        && let Some(Ok(chunk)) = stream.next().await
    {
        let room = MOST_REFUSAL_BYTES - bytes.len();
        bytes.extend(chunk.iter().take(room));
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// The `Code` of an S3 error (Amazon S3 API Reference, "Error responses"): one word, else nothing. The rest of
/// such a body may repeat what was signed.
fn error_code(body: &str) -> &str {
    let word = |code: &&str| {
        (1..=64).contains(&code.len()) && code.bytes().all(|byte| byte.is_ascii_alphanumeric())
    };
    body.split_once("<Code>")
        .and_then(|(_, rest)| rest.split_once("</Code>"))
        .map(|(code, _)| code)
        .filter(word)
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_codes_are_single_words() {
        let body =
            "<?xml version=\"1.0\"?><Error><Code>NoSuchKey</Code><Message>hush</Message></Error>";
        assert_eq!(error_code(body), "NoSuchKey");
        for nothing in [
            "",
            "<html>503</html>",
            "<Code></Code>",
            "<Code>two words</Code>",
            "<Code>cut",
        ] {
            assert_eq!(error_code(nothing), "", "{nothing}");
        }
        let long = format!("<Code>{}</Code>", "x".repeat(65));
        assert_eq!(error_code(&long), "");
    }
}
