//! A client of a running master's control API.
//!
//! In: where it listens, a token, requests as JSON. Out: its answers, or what they say is wrong. It knows no scene and no
//! wall.

use std::time::Duration;

use anyhow::Context as _;
use serde_json::Value;
use ureq::http::{StatusCode, header, uri::Authority};
use ureq::{Agent, RequestBuilder};

use crate::args::RunningMaster;
use crate::failure::{Failure, OrConfiguration as _};

use super::control;

/// How long the master may take to answer.
const PATIENCE: Duration = Duration::from_secs(15);
/// Longest answer that is read, in bytes.
const MAX_ANSWER_BYTES: u64 = 1 << 20;

/// What a request does.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Method {
    /// Changes what is there, by a JSON merge patch.
    Patch,
    /// Has something done.
    Post,
}

/// The control API of one master.
pub(crate) struct Client {
    agent: Agent,
    address: Authority,
    token: Option<String>,
}

impl Client {
    /// A client of the master that the command line names.
    pub(crate) fn new(master: &RunningMaster) -> Result<Self, Failure> {
        let token = master
            .token_file
            .as_deref()
            .map(control::token)
            .transpose()?;
        let address = &master.control;
        let address: Authority = address
            .parse()
            .ok()
            .filter(|authority: &Authority| authority.port().is_some())
            .with_context(|| format!("\"{address}\" is no address: write HOST:PORT"))
            .or_configuration()?;
        let agent = Agent::config_builder()
            .timeout_global(Some(PATIENCE))
            .http_status_as_error(false)
            .max_redirects(0)
            // The master is on this machine or in the same room: no proxy stands between.
            .proxy(None)
            .build()
            .into();
        Ok(Self {
            agent,
            address,
            token,
        })
    }

    /// Sends a request, and returns what is answered to it.
    pub(crate) fn ask(&self, method: Method, path: &str, body: &Value) -> Result<Value, Failure> {
        let address = &self.address;
        let url = format!("http://{address}{path}");
        let (request, kind) = match method {
            Method::Patch => (self.agent.patch(url), "application/merge-patch+json"),
            Method::Post => (self.agent.post(url), "application/json"),
        };
        let request = request.header(header::CONTENT_TYPE, kind);
        let answer = self.bearing(request).send(body.to_string()).with_context(|| {
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
        self.explain(status, &body)
    }

    fn bearing<B>(&self, request: RequestBuilder<B>) -> RequestBuilder<B> {
        match &self.token {
            Some(token) => request.header(header::AUTHORIZATION, format!("Bearer {token}")),
            None => request,
        }
    }

    /// What an answer says, or what it says is wrong: what the operator has set up or written wrongly has another exit
    /// status than what failed.
    fn explain(&self, status: StatusCode, body: &str) -> Result<Value, Failure> {
        let answer: Value = serde_json::from_str(body).unwrap_or_default();
        if status.is_success() && answer.is_object() {
            return Ok(answer);
        }
        let Some(error) = answer.get("error").and_then(Value::as_str) else {
            return Err(self.not_ours(&format!("it answered {status}")));
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

    /// What listens there is something else.
    pub(crate) fn not_ours(&self, answer: &str) -> Failure {
        Failure::configuration(format!(
            "what listens at {} is no control API of Terrawall: {answer}",
            self.address
        ))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;
    use crate::failure::{FAILED, USAGE};

    #[test]
    fn answers_become_values_or_failures() {
        let client = Client::new(&RunningMaster {
            control: "127.0.0.1:4680".to_owned(),
            token_file: None,
        })
        .unwrap();
        let explain =
            |status: u16, body: &str| client.explain(StatusCode::from_u16(status).unwrap(), body);
        assert_eq!(explain(200, r#"{"revision": 7}"#).unwrap()["revision"], 7);
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
}
