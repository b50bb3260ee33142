//! What can go wrong with one request, and whether another try may help.
//!
//! In: errors of the object store. Out: a [`Failure`]. No message holds a URL with a query, a header or a key.

use std::error::Error as StdError;
use std::io;
use std::time::Duration;

use http::StatusCode;
use object_store::client::{HttpError, HttpErrorKind};
use thiserror::Error;

use crate::transport::Refused;

/// Why a file of a repository could not be had.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Failure {
    /// It does not exist.
    #[error("there is no such file")]
    NotFound,
    /// It is as it was.
    #[error("it has not changed")]
    NotModified,
    /// The server refused.
    #[error("the server answered {status}{}{}", detail(code), remedy(*status))]
    Refused {
        /// The HTTP status.
        status: u16,
        /// The error code of an S3 server; empty for others.
        code: String,
        /// For how long the server wants to be left alone.
        retry_after: Option<Duration>,
    },
    /// The connection could not be made.
    #[error("no connection: {0}")]
    Connection(String),
    /// The connection broke.
    #[error("the connection broke: {0}")]
    Broken(String),
    /// No answer in time.
    #[error("no answer within {0:?}")]
    TimedOut(Duration),
    /// More bytes than such a file can have.
    #[error(
        "it has {bytes} bytes, but such a file has at most {most}: it is not what it should be"
    )]
    TooLarge {
        /// Its size as far as it is known.
        bytes: u64,
        /// The most.
        most: u64,
    },
    /// Fewer bytes than announced.
    #[error("only {bytes} of {due} bytes arrived")]
    Short {
        /// What arrived.
        bytes: u64,
        /// What was announced.
        due: u64,
    },
    /// An answer that HTTP or S3 do not allow, or credentials that cannot be had.
    #[error("the answer cannot be understood: {0}")]
    Protocol(String),
    /// The repository failed several times in a row; it is probed until it answers.
    #[error("the repository has not answered for {0:?}; it is probed until it does")]
    Unreachable(Duration),
    /// The program ends.
    #[error("repositories are being closed")]
    Closing,
}

impl Failure {
    /// From an error of the object store.
    pub(crate) fn of(error: &object_store::Error) -> Self {
        let mut causes = Vec::new();
        let mut next: Option<&(dyn StdError + 'static)> = Some(error);
        while let Some(cause) = next {
            causes.push(cause);
            next = cause.source();
        }
        if let Some(refused) = causes.iter().find_map(|c| c.downcast_ref::<Refused>()) {
            return match refused.status {
                StatusCode::NOT_FOUND => Self::NotFound,
                StatusCode::NOT_MODIFIED => Self::NotModified,
                status => Self::Refused {
                    status: status.as_u16(),
                    code: refused.code.clone(),
                    retry_after: refused.retry_after,
                },
            };
        }
        // The innermost cause says what happened; those around it say that something did.
        let deepest = causes.last().map(ToString::to_string).unwrap_or_default();
        match causes.iter().find_map(|c| c.downcast_ref::<HttpError>()) {
            Some(http) if http.kind() == HttpErrorKind::Connect => Self::Connection(deepest),
            Some(_) => Self::Broken(deepest),
            None => Self::Protocol(deepest),
        }
    }

    /// Whether the same request may succeed later: the server is overloaded, in trouble, or away.
    pub(crate) fn may_pass(&self) -> bool {
        match self {
            Self::Refused { status, .. } => {
                matches!(status, 408 | 425 | 429)
                    || (500..=599).contains(status) && !matches!(status, 501 | 505)
            }
            Self::Connection(_) | Self::Broken(_) | Self::TimedOut(_) | Self::Short { .. } => true,
            Self::NotFound
            | Self::NotModified
            | Self::TooLarge { .. }
            | Self::Protocol(_)
            | Self::Unreachable(_)
            | Self::Closing => false,
        }
    }

    /// What the server asked for by `Retry-After`.
    pub(crate) fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::Refused { retry_after, .. } => *retry_after,
            _ => None,
        }
    }

    /// As the error of a [`tiles::Source`]. `NotConnected`, `ConnectionRefused` and `TimedOut` mean that the whole
    /// repository is away.
    pub(crate) fn into_io(self) -> io::Error {
        let kind = match &self {
            Self::NotFound => io::ErrorKind::NotFound,
            Self::Refused {
                status: 401 | 403, ..
            } => io::ErrorKind::PermissionDenied,
            Self::Connection(_) => io::ErrorKind::ConnectionRefused,
            Self::Broken(_) => io::ErrorKind::ConnectionReset,
            Self::TimedOut(_) => io::ErrorKind::TimedOut,
            Self::TooLarge { .. } | Self::Protocol(_) => io::ErrorKind::InvalidData,
            Self::Short { .. } => io::ErrorKind::UnexpectedEof,
            Self::Unreachable(_) => io::ErrorKind::NotConnected,
            Self::Closing => io::ErrorKind::Interrupted,
            Self::NotModified | Self::Refused { .. } => io::ErrorKind::Other,
        };
        io::Error::new(kind, self)
    }
}

fn detail(code: &str) -> String {
    if code.is_empty() {
        String::new()
    } else {
        format!(" ({code})")
    }
}

fn remedy(status: u16) -> &'static str {
    match status {
        301 | 302 | 307 | 308 => {
            ": it redirects elsewhere; use that address, and for s3:// set AWS_REGION to the bucket's region"
        }
        401 | 403 => {
            ": check the credentials of this node; S3 servers say so for a missing file too unless ListBucket is allowed"
        }
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_may_pass_is_tried_again() {
        let refused = |status| Failure::Refused {
            status,
            code: String::new(),
            retry_after: None,
        };
        for status in [408, 425, 429, 500, 502, 503, 504, 599] {
            assert!(refused(status).may_pass(), "{status}");
        }
        for status in [206, 301, 400, 401, 403, 405, 410, 416, 501, 505] {
            assert!(!refused(status).may_pass(), "{status}");
        }
        let text = String::new;
        for failure in [
            Failure::Connection(text()),
            Failure::Broken(text()),
            Failure::TimedOut(Duration::ZERO),
            Failure::Short { bytes: 1, due: 2 },
        ] {
            assert!(failure.may_pass(), "{failure}");
        }
        for failure in [
            Failure::NotFound,
            Failure::NotModified,
            Failure::TooLarge { bytes: 2, most: 1 },
            Failure::Protocol(text()),
            Failure::Unreachable(Duration::ZERO),
            Failure::Closing,
        ] {
            assert!(!failure.may_pass(), "{failure}");
        }
    }

    #[test]
    fn messages_name_the_remedy() {
        let message = Failure::Refused {
            status: 403,
            code: "AccessDenied".to_owned(),
            retry_after: None,
        }
        .to_string();
        assert!(
            message.starts_with("the server answered 403 (AccessDenied): check the credentials")
        );
    }
}
