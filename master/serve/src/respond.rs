//! Answers to requests: what `ServeDir` says of a file, behind a list of what may be asked for.
//!
//! In: requests. Out: answers and counts of them. Every answer that holds a file says `Cache-Control: no-cache`: a
//! cache may keep it and must ask before it hands it out again (RFC 9111, §5.2.2.4), because the path of a tile
//! does not change when an import changes the tile. Asking costs a 304 without a body.

use std::convert::Infallible;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use axum::Router;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::header::{
    ALLOW, CACHE_CONTROL, CONTENT_LENGTH, CONTENT_TYPE, IF_RANGE, RANGE, RETRY_AFTER,
    X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderValue, Method, StatusCode, Uri};
use axum::response::Response;
use tower_http::services::ServeDir;
use tower_http::services::fs::DefaultServeDirFallback;

use crate::files::Beneath;
use crate::paths;

/// What is served, and to what end so far.
pub(crate) struct Site {
    files: ServeDir<DefaultServeDirFallback, Beneath>,
    single: bool,
    tally: Tally,
}

/// What a server has answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Requests.
    pub requests: u64,
    /// Answers with a file or a part of one (or, to HEAD, with their headers).
    pub files: u64,
    /// Answers that what the client has is still right.
    pub not_modified: u64,
    /// Requests for files that do not exist.
    pub missing: u64,
    /// Requests for what nobody may have, or by other methods, or for impossible ranges.
    pub refused: u64,
    /// Files that could not be read.
    pub failed: u64,
    /// Bytes of all files and parts sent, if clients took them to the end.
    pub bytes: u64,
}

#[derive(Default)]
struct Tally {
    requests: AtomicU64,
    files: AtomicU64,
    not_modified: AtomicU64,
    missing: AtomicU64,
    refused: AtomicU64,
    failed: AtomicU64,
    bytes: AtomicU64,
}

impl Site {
    /// The files beneath a directory, which is a repository itself or holds repositories.
    pub(crate) fn new(directory: &Path, single: bool) -> Self {
        let files = ServeDir::with_backend("", Beneath::new(directory))
            .append_index_html_on_directories(false)
            .redirect_to_trailing_slash(false);
        Self {
            files,
            single,
            tally: Tally::default(),
        }
    }

    pub(crate) fn counters(&self) -> Counters {
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Counters {
            requests: count(&self.tally.requests),
            files: count(&self.tally.files),
            not_modified: count(&self.tally.not_modified),
            missing: count(&self.tally.missing),
            refused: count(&self.tally.refused),
            failed: count(&self.tally.failed),
            bytes: count(&self.tally.bytes),
        }
    }

    async fn answer(&self, mut request: Request) -> Response {
        if request.method() != Method::GET && request.method() != Method::HEAD {
            let mut response = plain(StatusCode::METHOD_NOT_ALLOWED, "GET and HEAD only\n");
            response
                .headers_mut()
                .insert(ALLOW, HeaderValue::from_static("GET, HEAD"));
            return response;
        }
        let Some(path) = paths::file(request.uri().path(), self.single) else {
            return plain(
                StatusCode::NOT_FOUND,
                "only the files of a repository are here\n",
            );
        };
        // Without a query, which means nothing here.
        match format!("/{path}").parse::<Uri>() {
            Ok(uri) => *request.uri_mut() = uri,
            Err(_) => return plain(StatusCode::NOT_FOUND, "no such file\n"),
        }
        // A server may ignore ranges (RFC 9110, §14.2), and one that does not compare validators must, where the
        // client will only have the part if the whole is unchanged (§13.1.5).
        if request.headers().contains_key(IF_RANGE) {
            request.headers_mut().remove(RANGE);
        }
        let place = request.uri().path().to_owned();
        let answered = self.files.clone().try_call(request).await;
        match answered {
            Ok(response) => {
                let mut response = response.map(Body::new);
                let headers = response.headers_mut();
                headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
                headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
                response
            }
            Err(error) => refusal(&place, &error),
        }
    }

    fn count(&self, response: &Response, method: &Method) {
        let tally = &self.tally;
        let counter = match response.status().as_u16() {
            200 | 206 => &tally.files,
            304 => &tally.not_modified,
            404 => &tally.missing,
            500.. => &tally.failed,
            _ => &tally.refused,
        };
        counter.fetch_add(1, Ordering::Relaxed);
        tally.requests.fetch_add(1, Ordering::Relaxed);
        let length = response
            .headers()
            .get(CONTENT_LENGTH)
            .and_then(|length| length.to_str().ok()?.parse::<u64>().ok());
        if let Some(length) =
            length.filter(|_| response.status().is_success() && method != Method::HEAD)
        {
            tally.bytes.fetch_add(length, Ordering::Relaxed);
        }
    }
}

/// Answers everything.
pub(crate) fn router(site: Arc<Site>) -> Router {
    Router::new().fallback(respond).with_state(site)
}

async fn respond(State(site): State<Arc<Site>>, request: Request) -> Result<Response, Infallible> {
    let method = request.method().clone();
    let response = site.answer(request).await;
    site.count(&response, &method);
    Ok(response)
}

/// What a file that could not be opened means to a client. "Not there" must be said only of what is not there:
/// a client would draw without the tile for good.
fn refusal(place: &str, error: &io::Error) -> Response {
    match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
            plain(StatusCode::NOT_FOUND, "no such file\n")
        }
        io::ErrorKind::Unsupported => {
            tracing::warn!(place, "a link, which is not followed");
            plain(StatusCode::FORBIDDEN, "links are not followed\n")
        }
        _ => {
            tracing::warn!(place, %error, "a file could not be read");
            let mut response = plain(
                StatusCode::SERVICE_UNAVAILABLE,
                "the file cannot be read at present\n",
            );
            response
                .headers_mut()
                .insert(RETRY_AFTER, HeaderValue::from_static("1"));
            response
        }
    }
}

fn plain(status: StatusCode, text: &'static str) -> Response {
    let mut response = Response::new(Body::from(text));
    *response.status_mut() = status;
    let headers = response.headers_mut();
    headers.insert(
        CONTENT_TYPE,
        HeaderValue::from_static("text/plain; charset=utf-8"),
    );
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}
