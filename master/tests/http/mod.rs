//! A small HTTP client for tests of the control API: it sends what it is told to, wrong things too.
//! In: a request's parts. Out: status, headers and the JSON of the answer.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use serde_json::Value;

/// What a server has answered.
#[derive(Clone, Debug)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    head: String,
    pub(crate) body: Value,
}

impl Answer {
    /// A header's value.
    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        let line = |line: &'_ &str| {
            let (found, _) = line.split_once(':').unwrap_or_default();
            found.eq_ignore_ascii_case(name)
        };
        let line = self.head.lines().find(line)?;
        line.split_once(':').map(|(_, value)| value.trim())
    }

    /// The revision in a good answer.
    #[track_caller]
    pub(crate) fn revision(&self) -> u64 {
        assert_eq!(self.status, 200, "{}", self.body);
        self.body["revision"].as_u64().unwrap()
    }
}

/// Sends one request, in a connection of its own, and reads the answer. `headers` come after those that every
/// request has; one of the same name takes its place, and an empty value leaves it out.
pub(crate) fn request(
    address: SocketAddr,
    method: &str,
    path: &str,
    headers: &[(&str, &str)],
    body: &[u8],
) -> Answer {
    let host = address.to_string();
    let length = body.len().to_string();
    let usual = [
        ("Host", &*host),
        ("Content-Length", &*length),
        ("Connection", "close"),
    ];
    let given = |name: &str| {
        headers
            .iter()
            .any(|(other, _)| other.eq_ignore_ascii_case(name))
    };
    let mut text = format!("{method} {path} HTTP/1.1\r\n").into_bytes();
    let usual = usual.iter().filter(|(name, _)| !given(name));
    for (name, value) in usual.chain(headers).filter(|(_, value)| !value.is_empty()) {
        text.extend(format!("{name}: {value}\r\n").bytes());
    }
    text.extend(b"\r\n");
    text.extend(body);
    let mut stream = TcpStream::connect(address).unwrap();
    let patience = Some(Duration::from_secs(20));
    stream.set_read_timeout(patience).unwrap();
    stream.write_all(&text).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    Answer {
        status: head.split(' ').nth(1).unwrap().parse().unwrap(),
        head: head.to_owned(),
        body: serde_json::from_str(body).unwrap_or_default(),
    }
}

/// Reads the scene.
pub(crate) fn get(address: SocketAddr) -> Answer {
    request(address, "GET", "/api/scene", &[], b"")
}

/// Changes the scene.
pub(crate) fn patch(address: SocketAddr, patch: &Value) -> Answer {
    let headers = [("Content-Type", "application/merge-patch+json")];
    request(
        address,
        "PATCH",
        "/api/scene",
        &headers,
        patch.to_string().as_bytes(),
    )
}
