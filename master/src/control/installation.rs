//! The running wall over HTTP: its measures at `/api/wall`, test patterns at `/api/patterns`.
//! In: admitted requests. Out: measures as JSON, changes for the frame loop, the wall file with its comments. A change is
//! whole or not at all.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use protocol::Wall;
use protocol::pattern::Pattern;
use serde_json::{Map, Value, json};

use super::api::{Api, check_type, collect};
use super::json;
use super::refusal::{Refusal, respond};
use crate::events::Event;
use crate::installation::{AdjustedWall, Installation};
use crate::wall_file::WallFile;

/// `GET /api/wall`
pub(super) async fn read_wall(State(api): State<Arc<Api>>) -> Result<Response, Refusal> {
    let file = api.wall_file.lock().await;
    Ok(respond(StatusCode::OK, &of_file(file.as_ref())?.to_json()))
}

/// `PATCH /api/wall`
pub(super) async fn change_wall(
    State(api): State<Arc<Api>>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Refusal> {
    let patch = patch_of(&headers, body).await?;
    let mut file = api.wall_file.lock().await;
    let (changed, measures) = of_file(file.as_ref())?.patched(&patch).map_err(|error| {
        Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, error.to_string()).at(&error.path)
    })?;
    // Nobody else measures the wall while its file is held.
    let adjusted = adjusted(&api, measures).await?;
    let revision = api
        .ask(|reply| Event::AdjustWall { adjusted, reply })
        .await?;
    *file = Some(changed);
    Ok(respond(
        StatusCode::OK,
        &json!({ "wall_revision": revision }),
    ))
}

/// The running wall with other measures, and what its files make of them: read here, so that no frame waits for a disk.
async fn adjusted(api: &Api, measures: Wall) -> Result<Box<AdjustedWall>, Refusal> {
    let refuse = |reason| Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, reason);
    let installation = api.ask(|reply| Event::LookAtWall { reply }).await?;
    let wall = installation.wall.with_measures_of(&measures);
    let wall = Arc::new(wall.map_err(|error| refuse(error.to_string()))?);
    let (open, of_wall) = (Arc::clone(&api.open_surfaces), Arc::clone(&wall));
    let opened = tokio::task::spawn_blocking(move || open(&of_wall)).await;
    let surfaces = opened.map_err(|_panicked| {
        let reason = "the files of the wall cannot be read by a defect of the program";
        Refusal::new(StatusCode::INTERNAL_SERVER_ERROR, reason)
    })?;
    Ok(Box::new(AdjustedWall {
        wall,
        surfaces: surfaces.map_err(refuse)?,
    }))
}

/// `POST /api/wall/save`
pub(super) async fn save_wall(State(api): State<Arc<Api>>) -> Result<Response, Refusal> {
    let mut file = api.wall_file.lock().await;
    let Some(file) = file.as_mut() else {
        return Err(no_file());
    };
    let path = file.path().display().to_string();
    file.save().map_err(|error| {
        let reason = format!("{path} cannot be written: {error}");
        Refusal::new(StatusCode::INTERNAL_SERVER_ERROR, reason)
    })?;
    Ok(respond(StatusCode::OK, &json!({ "saved": path })))
}

/// `GET /api/patterns`
pub(super) async fn read_patterns(State(api): State<Arc<Api>>) -> Result<Response, Refusal> {
    let installation = api.ask(|reply| Event::LookAtWall { reply }).await?;
    Ok(respond(StatusCode::OK, &patterns_json(&installation)))
}

/// `PATCH /api/patterns`: names of outputs, or `*` for all of them, and a pattern or null for each.
pub(super) async fn change_patterns(
    State(api): State<Arc<Api>>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Refusal> {
    let patch = patch_of(&headers, body).await?;
    let refuse = |path: &str, advice: String| {
        Refusal::new(
            StatusCode::UNPROCESSABLE_ENTITY,
            format!("{path}: {advice}"),
        )
        .at(path)
    };
    let Some(patch) = patch.as_object() else {
        let advice = "write an object: HOST/OUTPUT, or * for all, and a pattern or null".to_owned();
        return Err(refuse("", advice));
    };
    let installation = api.ask(|reply| Event::LookAtWall { reply }).await?;
    let mut wishes = Vec::with_capacity(patch.len());
    for (output, wish) in patch {
        let place = match output.as_str() {
            "*" => None,
            name => Some(installation.place(name).ok_or_else(|| {
                let known: Vec<String> = installation.shown().map(|(name, _)| name).collect();
                refuse(
                    name,
                    format!(
                        "there is no such output; write * or one of {}",
                        known.join(", ")
                    ),
                )
            })?),
        };
        let pattern = match wish {
            Value::Null => None,
            wish => Some(wish.as_str().and_then(Pattern::from_name).ok_or_else(|| {
                let known = Pattern::NAMES.map(|(_, name)| name);
                refuse(output, format!("write null or one of {}", known.join(", ")))
            })?),
        };
        wishes.push((place, pattern));
    }
    // What is said of all comes before what is said of one.
    wishes.sort_by_key(|(place, _)| place.is_some());
    let installation = api
        .ask(|reply| Event::ShowPatterns { wishes, reply })
        .await?;
    Ok(respond(StatusCode::OK, &patterns_json(&installation)))
}

fn patterns_json(installation: &Installation) -> Value {
    let shown = installation.shown();
    let entries = shown.map(|(name, pattern)| (name, json!(pattern.map(Pattern::name))));
    Value::Object(entries.collect::<Map<String, Value>>())
}

async fn patch_of(headers: &HeaderMap, body: Body) -> Result<Value, Refusal> {
    let body = collect(body).await?;
    check_type(headers)?;
    json::parse(&body).map_err(|error| Refusal::new(StatusCode::BAD_REQUEST, error.to_string()))
}

fn of_file(file: Option<&WallFile>) -> Result<&WallFile, Refusal> {
    file.ok_or_else(no_file)
}

fn no_file() -> Refusal {
    Refusal::new(
        StatusCode::NOT_FOUND,
        "this wall did not come from a file that can be changed",
    )
}
