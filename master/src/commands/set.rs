//! `terrawall set LAYER.PARAM=VALUE…`: changes the scene of a running wall.
//!
//! In: assignments, where the control API listens. Out: the number of the new revision. All assignments are one
//! request: the wall takes all of them or none.

use std::time::Duration;

use anyhow::Context as _;
use protocol::Scene;
use serde_json::{Value, json};
use ureq::http::{StatusCode, header, uri::Authority};
use ureq::{Agent, RequestBuilder};

use crate::args::Set;
use crate::failure::{Failure, OrConfiguration as _};
use crate::output;

use super::control;

/// How long the master may take to answer.
const PATIENCE: Duration = Duration::from_secs(15);
/// Longest answer that is read, in bytes.
const MAX_ANSWER_BYTES: u64 = 1 << 20;

/// Changes the scene.
pub(crate) fn run(args: &Set) -> Result<(), Failure> {
    let assignments = args.assignments.iter().map(String::as_str);
    let patch = Scene::assignments(assignments).or_configuration()?;
    let token = args.token_file.as_deref().map(control::token).transpose()?;
    let revision = send(&args.control, token.as_deref(), &patch)?;
    if args.json {
        output::json(&json!({ "revision": revision }))
    } else {
        output::line(format!("revision {revision}"))
    }
}

/// Sends a patch; returns the revision.
fn send(address: &str, token: Option<&str>, patch: &Value) -> Result<u64, Failure> {
    let address: Authority = address
        .parse()
        .ok()
        .filter(|authority: &Authority| authority.port().is_some())
        .with_context(|| format!("\"{address}\" is no address: write HOST:PORT"))
        .or_configuration()?;
    let agent: Agent = Agent::config_builder()
        .timeout_global(Some(PATIENCE))
        .http_status_as_error(false)
        .max_redirects(0)
        // The master is on this machine or in the same room: no proxy stands between.
        .proxy(None)
        .build()
        .into();
    let request = agent
        .patch(format!("http://{address}/api/scene"))
        .header(header::CONTENT_TYPE, "application/merge-patch+json");
    let answer = bearing(request, token)
        .send(patch.to_string())
        .with_context(|| {
            format!(
                "cannot reach the control API at {address}; is the wall running, and did it say this address at \
                 its start?"
            )
        })?;
    let status = answer.status();
    let body = answer
        .into_body()
        .with_config()
        .limit(MAX_ANSWER_BYTES)
        .read_to_string()
        .with_context(|| format!("the answer of {address} did not arrive whole"))?;
    explain(status, &body, &address)
}

fn bearing<B>(request: RequestBuilder<B>, token: Option<&str>) -> RequestBuilder<B> {
    match token {
        Some(token) => request.header(header::AUTHORIZATION, format!("Bearer {token}")),
        None => request,
    }
}

/// The revision in an answer, or what the answer says is wrong: what the operator has set up or written wrongly has
/// another exit status than what failed.
fn explain(status: StatusCode, body: &str, address: &Authority) -> Result<u64, Failure> {
    let answer: Value = serde_json::from_str(body).unwrap_or_default();
    if status.is_success()
        && let Some(revision) = answer.get("revision").and_then(Value::as_u64)
    {
        return Ok(revision);
    }
    let Some(error) = answer.get("error").and_then(Value::as_str) else {
        return Err(Failure::configuration(format!(
            "what listens at {address} is no control API of Terrawall: it answered {status}"
        )));
    };
    match status {
        StatusCode::BAD_REQUEST
        | StatusCode::UNAUTHORIZED
        | StatusCode::FORBIDDEN
        | StatusCode::PAYLOAD_TOO_LARGE
        | StatusCode::UNPROCESSABLE_ENTITY => Err(Failure::configuration(error)),
        _ => Err(Failure::failed(error)),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;
    use crate::failure::{FAILED, USAGE};

    #[test]
    fn answers_become_revisions_or_failures() {
        let address = Authority::from_static("127.0.0.1:4680");
        let explain = |status: u16, body: &str| {
            explain(StatusCode::from_u16(status).unwrap(), body, &address)
        };
        assert_eq!(explain(200, r#"{"revision": 7}"#).unwrap(), 7);
        for (status, body, code, words) in [
            (
                422,
                r#"{"error": "layers.relief.scale: no", "path": "layers.relief.scale"}"#,
                USAGE,
                "layers.relief.scale: no",
            ),
            (
                401,
                r#"{"error": "wants its token"}"#,
                USAGE,
                "wants its token",
            ),
            (503, r#"{"error": "at its end"}"#, FAILED, "at its end"),
            (409, r#"{"error": "newest is 3"}"#, FAILED, "newest is 3"),
            (200, "<html>", USAGE, "no control API"),
            (404, "not here", USAGE, "127.0.0.1:4680"),
        ] {
            let failure = explain(status, body).unwrap_err();
            assert_eq!(failure.exit_code(), code, "{status}");
            assert!(failure.to_string().contains(words), "{failure}");
        }
    }

    #[test]
    fn wrong_words_and_absent_masters_are_told_apart() {
        let set = |control: &str, assignment: &str| {
            run(&Set {
                assignments: vec![assignment.to_owned()],
                control: control.to_owned(),
                token_file: None,
                json: false,
            })
            .unwrap_err()
        };
        let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let nobody = free.local_addr().unwrap().to_string();
        drop(free);
        for (control, assignment, code, words) in [
            (&*nobody, "relief.scale", USAGE, "relief.scale"),
            (&*nobody, "relief.scale=2", FAILED, &*nobody),
            ("localhost", "relief.scale=2", USAGE, "HOST:PORT"),
            ("a b:1", "relief.scale=2", USAGE, "HOST:PORT"),
        ] {
            let failure = set(control, assignment);
            assert_eq!(failure.exit_code(), code, "{failure}");
            assert!(failure.to_string().contains(words), "{failure}");
        }
    }
}
