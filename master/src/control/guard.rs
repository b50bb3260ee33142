//! Who may use the control API.
//! In: the head of a request. Out: admitted, or a refusal. With a token, whoever bears it is trusted; without
//! one, which only a loopback address allows, the processes of this machine are, but not the web pages that a
//! browser on it shows.

use std::hint::black_box;
use std::net::IpAddr;

use axum::http::header::{AUTHORIZATION, HOST, HeaderName, ORIGIN};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, StatusCode, Uri};

use super::refusal::Refusal;

/// Admits a request or says why not.
pub(super) fn admit(token: Option<&str>, uri: &Uri, headers: &HeaderMap) -> Result<(), Refusal> {
    match token {
        Some(token) => bears(token, headers),
        None => comes_from_here(uri, headers),
    }
}

fn bears(token: &str, headers: &HeaderMap) -> Result<(), Refusal> {
    let given = only(headers, &AUTHORIZATION)?.unwrap_or_default();
    let (scheme, given) = given.split_once(' ').unwrap_or((given, ""));
    if scheme.eq_ignore_ascii_case("bearer") && same(given.trim().as_bytes(), token.as_bytes()) {
        return Ok(());
    }
    Err(Refusal::new(
        StatusCode::UNAUTHORIZED,
        "this control API wants its token: send \"Authorization: Bearer TOKEN\" (terrawall set takes it from \
         --token-file FILE)",
    ))
}

/// A page from elsewhere can make a browser on this machine send requests. A foreign page's requests bear its
/// origin; one that has bent its own name to a loopback address (DNS rebinding) bears that name as host.
fn comes_from_here(uri: &Uri, headers: &HeaderMap) -> Result<(), Refusal> {
    let foreign = |what: &str| {
        Refusal::new(
            StatusCode::FORBIDDEN,
            format!(
                "without a token this control API answers only programs on this machine that address it by a \
                 loopback address or as localhost: {what}"
            ),
        )
    };
    let host = only(headers, &HOST)?.ok_or_else(|| foreign("the request names no host"))?;
    let named: Authority = host
        .parse()
        .map_err(|_| foreign("the request's host is none"))?;
    for authority in [Some(&named), uri.authority()].into_iter().flatten() {
        if !is_loopback(authority.host()) {
            return Err(foreign("the request names another host"));
        }
    }
    match only(headers, &ORIGIN)? {
        Some(origin)
            if origin
                .strip_prefix("http://")
                .is_none_or(|origin| !origin.eq_ignore_ascii_case(host)) =>
        {
            Err(foreign(
                "the request comes from a web page of another origin",
            ))
        }
        _ => Ok(()),
    }
}

/// A header's value, which must not be there twice.
fn only<'h>(headers: &'h HeaderMap, name: &HeaderName) -> Result<Option<&'h str>, Refusal> {
    let mut values = headers.get_all(name).iter();
    let value = values.next().map(|value| value.to_str());
    match (value.transpose(), values.next()) {
        (Ok(value), None) => Ok(value),
        _ => Err(Refusal::new(
            StatusCode::BAD_REQUEST,
            format!("the header {name} must be there once, in ASCII"),
        )),
    }
}

fn is_loopback(host: &str) -> bool {
    let address = host
        .strip_prefix('[')
        .and_then(|host| host.strip_suffix(']'));
    let address = address.unwrap_or(host).parse::<IpAddr>();
    host.eq_ignore_ascii_case("localhost")
        || address.is_ok_and(|address| address.to_canonical().is_loopback())
}

/// Whether both are equal, in a time that depends on the length of what was given and on nothing else: how much of
/// a guess was right must not show.
fn same(given: &[u8], token: &[u8]) -> bool {
    let mut difference = given.len() ^ token.len();
    for (given, token) in given.iter().zip(token.iter().cycle()) {
        difference = black_box(difference | usize::from(given ^ token));
    }
    difference == 0
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;

    fn status(token: Option<&str>, uri: &str, headers: &[(HeaderName, &str)]) -> u16 {
        let headers: HeaderMap = headers
            .iter()
            .map(|(name, value)| (name.clone(), value.parse().unwrap()))
            .collect();
        match admit(token, &uri.parse().unwrap(), &headers) {
            Ok(()) => 200,
            Err(refusal) => refusal.status().as_u16(),
        }
    }

    #[test]
    fn a_token_must_be_borne_whole() {
        for (given, expected) in [
            ("Bearer secret", 200),
            ("bearer  secret ", 200),
            ("Bearer secre", 401),
            ("Bearer secrets", 401),
            ("Bearer secretsecret", 401),
            ("Bearer Secret", 401),
            ("Bearer ", 401),
            ("Bearer", 401),
            ("Basic secret", 401),
            ("secret", 401),
        ] {
            let headers = [(HOST, "wall.example"), (AUTHORIZATION, given)];
            assert_eq!(status(Some("secret"), "/", &headers), expected, "{given}");
        }
        assert_eq!(status(Some("secret"), "/", &[(HOST, "localhost")]), 401);
        let twice = [
            (AUTHORIZATION, "Bearer no"),
            (AUTHORIZATION, "Bearer secret"),
        ];
        let mut headers = HeaderMap::new();
        for (name, value) in twice {
            headers.append(name, value.parse().unwrap());
        }
        let refusal = admit(Some("secret"), &Uri::from_static("/"), &headers).unwrap_err();
        assert_eq!(refusal.status(), StatusCode::BAD_REQUEST);
    }

    #[test]
    fn without_a_token_web_pages_are_kept_out() {
        for (host, origin, expected) in [
            ("127.0.0.1:4680", None, 200),
            ("localhost:4680", None, 200),
            ("LocalHost", None, 200),
            ("[::1]:4680", None, 200),
            ("127.0.0.1:4680", Some("http://127.0.0.1:4680"), 200),
            ("wall.example:4680", None, 403),
            ("127.0.0.1.wall.example", None, 403),
            ("192.168.0.7:4680", None, 403),
            ("", None, 403),
            ("127.0.0.1:4680", Some("http://wall.example"), 403),
            ("127.0.0.1:4680", Some("http://127.0.0.1:3000"), 403),
            ("127.0.0.1:4680", Some("https://127.0.0.1:4680"), 403),
            ("127.0.0.1:4680", Some("null"), 403),
        ] {
            let mut headers = vec![(HOST, host)];
            headers.extend(origin.map(|origin| (ORIGIN, origin)));
            let given = status(None, "/api/scene", &headers);
            assert_eq!(given, expected, "{host} {origin:?}");
        }
        assert_eq!(status(None, "/", &[]), 403);
        let headers = [(HOST, "localhost")];
        assert_eq!(status(None, "http://wall.example/api/scene", &headers), 403);
    }
}
