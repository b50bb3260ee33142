//! Why a connection is over. In: quinn's reasons. Out: reasons that an operator can act on.

use quinn::{ConnectionError, VarInt};

/// TLS alerts travel as QUIC errors 0x100 + alert (RFC 9001, section 4.8).
const TLS_ALERTS: std::ops::RangeInclusive<u64> = 0x100..=0x1ff;
/// The alert `no_application_protocol` (RFC 7301): the other side speaks something else over QUIC.
const NO_APPLICATION_PROTOCOL: u64 = 0x178;

/// Why one side closed a connection on purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum CloseCode {
    /// The work is done.
    Finished = 0,
    /// The peer is a member of the cluster but not welcome; the text says why.
    Refused = 1,
    /// The peer sent what this version of the protocol cannot be.
    Protocol = 2,
    /// The same node has connected again; this older connection is obsolete.
    Replaced = 3,
}

impl CloseCode {
    pub(crate) const fn wire(self) -> VarInt {
        VarInt::from_u32(self as u32)
    }

    fn from_wire(code: u64) -> Self {
        match code {
            0 => Self::Finished,
            1 => Self::Refused,
            3 => Self::Replaced,
            _ => Self::Protocol,
        }
    }
}

/// Why a connection is over, as its text says to an operator.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Closed {
    /// The other side closed it on purpose.
    #[error("the other side closed the connection ({code:?}): {reason}")]
    ByPeer {
        /// Its reason as a code.
        code: CloseCode,
        /// Its reason in words, at most a line.
        reason: String,
    },
    /// A certificate on one side is not of the cluster of the other side.
    #[error(
        "certificate refused ({detail}): the two sides hold identities of different clusters, or one \
         of them none; copy the identity directory of the master to this host"
    )]
    CertificateRefused {
        /// The alert as TLS words it.
        detail: String,
    },
    /// The other side answers QUIC but is no terrawall.
    #[error("the other side is not a terrawall: it speaks another protocol over QUIC")]
    NotTerrawall,
    /// Nothing came for the idle timeout.
    #[error("nothing was heard for the idle timeout of two seconds")]
    TimedOut,
    /// The other side has forgotten this connection: it was restarted, or had given up on us.
    #[error("the other side no longer knows this connection")]
    Reset,
    /// This side closed it.
    #[error("closed by this side")]
    Here,
    /// The transport failed in some other way.
    #[error("the transport failed: {0}")]
    Transport(String),
}

impl From<ConnectionError> for Closed {
    fn from(error: ConnectionError) -> Self {
        let by_tls = |code: u64, detail: String| match code {
            NO_APPLICATION_PROTOCOL => Self::NotTerrawall,
            code if TLS_ALERTS.contains(&code) => Self::CertificateRefused { detail },
            _ => Self::Transport(detail),
        };
        match error {
            ConnectionError::ApplicationClosed(close) => Self::ByPeer {
                code: CloseCode::from_wire(close.error_code.into_inner()),
                reason: one_line(&close.reason),
            },
            ConnectionError::ConnectionClosed(close) => {
                by_tls(close.error_code.into(), close.to_string())
            }
            ConnectionError::TransportError(error) => by_tls(error.code.into(), error.to_string()),
            ConnectionError::TimedOut => Self::TimedOut,
            ConnectionError::Reset => Self::Reset,
            ConnectionError::LocallyClosed => Self::Here,
            ConnectionError::VersionMismatch => Self::NotTerrawall,
            other @ ConnectionError::CidsExhausted => Self::Transport(other.to_string()),
        }
    }
}

/// A peer's words as one printable line of at most 300 characters.
fn one_line(words: &[u8]) -> String {
    let words = String::from_utf8_lossy(words);
    words
        .chars()
        .take(300)
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_of_a_peer_stay_on_one_line() {
        assert_eq!(one_line(b"a\nb\x1b[31m\xff"), "a b [31m\u{fffd}");
        assert_eq!(one_line(&[b'x'; 5_000]).len(), 300);
    }

    #[test]
    fn codes_survive_the_wire() {
        for code in [
            CloseCode::Finished,
            CloseCode::Refused,
            CloseCode::Protocol,
            CloseCode::Replaced,
        ] {
            assert_eq!(CloseCode::from_wire(code.wire().into_inner()), code);
        }
        assert_eq!(CloseCode::from_wire(77), CloseCode::Protocol);
    }
}
