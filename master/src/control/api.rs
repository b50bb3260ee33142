//! What the control API answers: who is let in, and `GET` and `PATCH` of `/api/scene`.
//! In: admitted requests. Out: the scene as JSON, or a change of it for the frame loop, parsed, validated and
//! encoded here. A change is whole or not at all, and no change is lost: each is made of the newest scene, which
//! the frame loop checks when it arrives.

use std::future::poll_fn;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::{Body, HttpBody as _};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse as _, Response};
use axum::routing::{get, post};
use protocol::{Fault, Scene, SceneError};
use serde_json::{Value, json};
use tokio::sync::{Mutex, oneshot};
use tokio::time::timeout;

use super::json::{self, JsonError};
use super::refusal::{Refusal, respond};
use super::{guard, installation};
use crate::change::{Declined, Proposal, Snapshot};
use crate::events::{Event, EventSender};
use crate::master::OpenSurfaces;
use crate::wall_file::WallFile;

/// Longest body of a request, in bytes.
const MAX_BODY_BYTES: usize = 1 << 20;
/// What is read of a longer one, so that its sender gets to read the answer instead of a reset.
const MAX_READ_BYTES: usize = 16 << 20;
/// How long a request may take, its body included.
const PATIENCE: Duration = Duration::from_secs(10);
/// How long the frame loop may take to answer; it takes less than a frame.
const FRAME_LOOP_PATIENCE: Duration = Duration::from_secs(3);
/// How often a change is made anew because another one came before it.
const MOST_RACES: usize = 100;

/// What requests need.
pub(super) struct Api {
    events: EventSender,
    token: Option<String>,
    scene_directory: Option<PathBuf>,
    /// The wall's file, while it may be changed.
    pub(super) wall_file: Mutex<Option<WallFile>>,
    pub(super) open_surfaces: OpenSurfaces,
    /// Changes are made one after the other, so that they only race with pointers.
    turn: Mutex<()>,
}

impl Api {
    pub(super) fn new(
        events: EventSender,
        token: Option<String>,
        scene_directory: Option<PathBuf>,
        wall_file: Option<WallFile>,
        open_surfaces: OpenSurfaces,
    ) -> Self {
        Self {
            events,
            token,
            scene_directory,
            wall_file: Mutex::new(wall_file),
            open_surfaces,
            turn: Mutex::new(()),
        }
    }

    /// Asks the frame loop.
    pub(super) async fn ask<T>(
        &self,
        event: impl FnOnce(oneshot::Sender<T>) -> Event,
    ) -> Result<T, Refusal> {
        let (reply, answer) = oneshot::channel();
        self.events.send(event(reply));
        match timeout(FRAME_LOOP_PATIENCE, answer).await {
            Ok(Ok(answer)) => Ok(answer),
            Ok(Err(_)) => Err(over()),
            Err(_elapsed) => Err(Refusal::new(
                StatusCode::SERVICE_UNAVAILABLE,
                "the master is too busy to answer; try again",
            )),
        }
    }

    async fn snapshot(&self) -> Result<Snapshot, Refusal> {
        self.ask(|reply| Event::LookAtScene { reply }).await
    }

    /// The scene after a patch.
    fn patched(&self, base: &Scene, patch: &Value) -> Result<Scene, Refusal> {
        let invalid = |path: &str, error: String| {
            Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, error).at(path)
        };
        let scene = base
            .patched(patch)
            .map_err(|error| invalid(error.key(), explained(&error, base)))?;
        match &self.scene_directory {
            Some(directory) => scene
                .resolve(directory)
                .map_err(|error| invalid("", error.to_string())),
            None => match scene.layers.iter().find(|layer| lies_nowhere(layer, base)) {
                Some(layer) => {
                    let path = format!("layers.{}.repository", layer.name);
                    let advice = "nodes need the whole path of a repository: write an absolute one";
                    Err(invalid(&path, format!("{path}: {advice}")))
                }
                None => Ok(scene),
            },
        }
    }
}

/// What is wrong with a patched scene. A layer that lacks all that a layer needs is most likely another one, misspelt.
fn explained(error: &SceneError, base: &Scene) -> String {
    let layer = error.key().strip_prefix("layers.");
    let layer = layer.and_then(|key| key.strip_suffix(".kind"));
    let unknown = |name: &&str| !base.layers.iter().any(|layer| layer.name == **name);
    match layer.filter(unknown) {
        Some(name) if error.fault() == Fault::MissingKey => {
            let names: Vec<&str> = base.layers.iter().map(|layer| &*layer.name).collect();
            let known = match names.join(", ") {
                none if none.is_empty() => "the scene has none".to_owned(),
                names => format!("the scene has {names}"),
            };
            format!("there is no layer \"{name}\": {known}; for a new one: {error}")
        }
        _ => error.to_string(),
    }
}

/// Whether a layer has a new repository with a relative path.
fn lies_nowhere(layer: &protocol::scene::Layer, base: &Scene) -> bool {
    let relative = |path: &&String| !path.contains("://") && Path::new(path).is_relative();
    let new = |path: &&String| {
        let known = |layer: &protocol::scene::Layer| layer.repository.as_ref() == Some(*path);
        !base.layers.iter().any(known)
    };
    let repository = layer.repository.as_ref();
    repository.filter(relative).filter(new).is_some()
}

/// All that the control API answers.
pub(super) fn router(api: Api) -> Router {
    let api = Arc::new(api);
    Router::new()
        .route("/api/scene", get(read).patch(change))
        .route(
            "/api/wall",
            get(installation::read_wall).patch(installation::change_wall),
        )
        .route("/api/wall/save", post(installation::save_wall))
        .route(
            "/api/patterns",
            get(installation::read_patterns).patch(installation::change_patterns),
        )
        .fallback(async || {
            let advice = "there is nothing here: the scene is at /api/scene, the wall at /api/wall, patterns at /api/patterns";
            Refusal::new(StatusCode::NOT_FOUND, advice)
        })
        .method_not_allowed_fallback(async || {
            let advice = "what is here is read with GET and changed with PATCH; /api/wall/save takes POST";
            Refusal::new(StatusCode::METHOD_NOT_ALLOWED, advice)
        })
        .layer(from_fn_with_state(Arc::clone(&api), admit))
        .with_state(api)
}

/// Lets a request in, or not, and bounds its time.
async fn admit(State(api): State<Arc<Api>>, request: Request, next: Next) -> Response {
    let token = api.token.as_deref();
    if let Err(refusal) = guard::admit(token, request.uri(), request.headers()) {
        return refusal.into_response();
    }
    let answer = timeout(PATIENCE, next.run(request)).await;
    answer.unwrap_or_else(|_elapsed| {
        let advice = "the request took too long; send it again";
        Refusal::new(StatusCode::REQUEST_TIMEOUT, advice).into_response()
    })
}

/// `GET /api/scene`
async fn read(State(api): State<Arc<Api>>) -> Result<Response, Refusal> {
    let snapshot = api.snapshot().await?;
    let refused = snapshot.refused.map(|refused| {
        json!({ "revision": refused.revision, "node": refused.node, "error": refused.reason })
    });
    let body = json!({
        "revision": snapshot.newest,
        "shown": snapshot.shown,
        "refused": refused,
        "scene": snapshot.revision.scene.to_json(),
    });
    Ok(tagged(snapshot.newest, &body))
}

/// `PATCH /api/scene`
async fn change(
    State(api): State<Arc<Api>>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Refusal> {
    let body = collect(body).await?;
    check_type(&headers)?;
    let patch = json::parse(&body).map_err(|error| {
        let (status, path) = match &error {
            JsonError::Syntax { path, .. } => (StatusCode::BAD_REQUEST, path),
            JsonError::Number { path, .. } => (StatusCode::UNPROCESSABLE_ENTITY, path),
        };
        Refusal::new(status, error.to_string()).at(path)
    })?;
    let _turn = api.turn.lock().await;
    let mut base = api.snapshot().await?;
    for _ in 0..MOST_RACES {
        check_base(&headers, base.newest)?;
        let scene = api.patched(&base.revision.scene, &patch)?;
        if scene == base.revision.scene {
            // Nothing to prepare, nothing to show.
            return Ok(tagged(base.newest, &json!({ "revision": base.newest })));
        }
        let proposal = Proposal::new(&base, scene).map_err(|error| {
            let advice = format!("the scene cannot be sent to the nodes: {error}");
            Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, advice)
        })?;
        let taken = api.ask(|reply| Event::Propose { proposal, reply }).await?;
        match taken {
            Ok(revision) => return Ok(tagged(revision, &json!({ "revision": revision }))),
            Err(Declined::Raced(snapshot)) => base = snapshot,
            Err(Declined::Over) => return Err(over()),
        }
    }
    Err(Refusal::new(
        StatusCode::SERVICE_UNAVAILABLE,
        "the scene changes faster than this request can follow; try again",
    ))
}

/// An answer about a revision, which a later request may name in `If-Match`.
fn tagged(revision: u64, body: &Value) -> Response {
    let mut response = respond(StatusCode::OK, body);
    if let Ok(tag) = HeaderValue::try_from(format!("\"{revision}\"")) {
        response.headers_mut().insert(header::ETAG, tag);
    }
    response
}

fn over() -> Refusal {
    Refusal::new(
        StatusCode::SERVICE_UNAVAILABLE,
        "the run is at its end: the scene changes no more",
    )
}

/// The body of a request.
pub(super) async fn collect(mut body: Body) -> Result<Vec<u8>, Refusal> {
    let mut bytes = Vec::new();
    let mut length = 0_usize;
    while let Some(frame) = poll_fn(|context| Pin::new(&mut body).poll_frame(context)).await {
        let frame = frame.map_err(|error| {
            let advice = format!("the request did not arrive whole: {error}");
            Refusal::new(StatusCode::BAD_REQUEST, advice)
        })?;
        if let Ok(data) = frame.into_data() {
            length = length.saturating_add(data.len());
            if length <= MAX_BODY_BYTES {
                bytes.extend_from_slice(&data);
            } else if length > MAX_READ_BYTES {
                break;
            }
        }
    }
    if length > MAX_BODY_BYTES {
        return Err(Refusal::new(
            StatusCode::PAYLOAD_TOO_LARGE,
            format!("the body is longer than {MAX_BODY_BYTES} bytes: send only what changes"),
        ));
    }
    Ok(bytes)
}

/// A patch comes as JSON, uncompressed, in UTF-8.
pub(super) fn check_type(headers: &HeaderMap) -> Result<(), Refusal> {
    let text = |name| headers.get(name).map(|value| value.to_str().unwrap_or("?"));
    let kind = text(header::CONTENT_TYPE).unwrap_or_default();
    let (kind, parameters) = kind.split_once(';').unwrap_or((kind, ""));
    let json = ["application/merge-patch+json", "application/json"]
        .iter()
        .any(|known| kind.trim().eq_ignore_ascii_case(known));
    let utf8 = parameters.split(';').all(|parameter| {
        let (name, value) = parameter.split_once('=').unwrap_or((parameter, ""));
        let value = value.trim().trim_matches('"');
        !name.trim().eq_ignore_ascii_case("charset") || value.eq_ignore_ascii_case("utf-8")
    });
    let plain = text(header::CONTENT_ENCODING)
        .is_none_or(|encoding| encoding.trim().eq_ignore_ascii_case("identity"));
    if json && utf8 && plain {
        return Ok(());
    }
    Err(Refusal::new(
        StatusCode::UNSUPPORTED_MEDIA_TYPE,
        "a change is a JSON merge patch (RFC 7396): send it with Content-Type: application/merge-patch+json, \
         uncompressed, in UTF-8",
    ))
}

/// A client that names the revision it has read wants to change that one and no other.
fn check_base(headers: &HeaderMap, newest: u64) -> Result<(), Refusal> {
    let mut named = headers.get_all(header::IF_MATCH).iter().peekable();
    let matches = |value: &HeaderValue| {
        value.to_str().is_ok_and(|tags| {
            tags.split(',').map(str::trim).any(|tag| {
                let bare = tag.strip_prefix('"').and_then(|tag| tag.strip_suffix('"'));
                tag == "*" || bare.unwrap_or(tag).parse() == Ok(newest)
            })
        })
    };
    if named.peek().is_none() || named.any(matches) {
        return Ok(());
    }
    Err(Refusal::new(
        StatusCode::CONFLICT,
        format!(
            "the newest revision is {newest}, and If-Match names another: read the scene again"
        ),
    ))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;

    fn headers(name: header::HeaderName, value: &str) -> HeaderMap {
        HeaderMap::from_iter([(name, value.parse().unwrap())])
    }

    #[test]
    fn only_json_is_taken() {
        for (kind, taken) in [
            ("application/json", true),
            ("Application/Merge-Patch+JSON", true),
            ("application/json; charset=UTF-8", true),
            ("application/json; charset=\"utf-8\"", true),
            ("application/json; charset=latin-1", false),
            ("application/json-patch+json", false),
            ("text/plain", false),
            ("", false),
        ] {
            let given = check_type(&headers(header::CONTENT_TYPE, kind)).is_ok();
            assert_eq!(given, taken, "{kind}");
        }
        assert!(check_type(&HeaderMap::new()).is_err());
        let mut packed = headers(header::CONTENT_TYPE, "application/json");
        packed.insert(header::CONTENT_ENCODING, "gzip".parse().unwrap());
        assert!(check_type(&packed).is_err());
    }

    #[test]
    fn a_named_revision_must_be_the_newest() {
        for (tags, good) in [
            ("\"7\"", true),
            ("7", true),
            ("*", true),
            ("\"6\", \"7\"", true),
            ("\"6\"", false),
            ("W/\"7\"", false),
            ("seven", false),
            ("", false),
        ] {
            let given = check_base(&headers(header::IF_MATCH, tags), 7).is_ok();
            assert_eq!(given, good, "{tags}");
        }
        assert!(check_base(&HeaderMap::new(), 7).is_ok());
    }
}
