//! The bytes of VRPN: cookies, headers, names. In: fields. Out: bytes, and back. It knows no connection.

/// The port of VRPN servers (`vrpn_DEFAULT_LISTEN_PORT_NO`).
pub const DEFAULT_PORT: u16 = 3883;
/// Length of a cookie (`vrpn_COOKIE_SIZE`).
pub const COOKIE_BYTES: usize = 24;
/// Length of a header with its sequence number.
pub const HEADER_BYTES: usize = 24;
/// Largest body that a server may send (`vrpn_CONNECTION_TCP_BUFLEN`).
pub const LARGEST_BODY_BYTES: usize = 64_000;
/// Longest name of a sender or a type, with its final zero (`cName`).
pub const LONGEST_NAME_BYTES: usize = 100;

/// Type of a message that names a sender.
pub(crate) const SENDER_DESCRIPTION: i32 = -1;
/// Type of a message that names a type.
pub(crate) const TYPE_DESCRIPTION: i32 = -2;
/// Everything is padded to a multiple of this.
const ALIGNMENT_BYTES: usize = 8;
/// What cookies of one major version have in common.
const COOKIE_BEGINNING: &[u8] = b"vrpn: ver. 07.";

/// The cookie that this client sends: version 07.35, no logging.
#[must_use]
pub fn cookie() -> [u8; COOKIE_BYTES] {
    let mut cookie = [0; COOKIE_BYTES];
    for (byte, text) in cookie.iter_mut().zip(b"vrpn: ver. 07.35  0") {
        *byte = *text;
    }
    cookie
}

/// Whether a server with this cookie speaks the same major version.
pub(crate) fn is_compatible(cookie: &[u8]) -> bool {
    cookie.starts_with(COOKIE_BEGINNING)
}

/// The words before a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    /// Length of the body without padding.
    pub(crate) body_bytes: usize,
    /// `None` where the sender stamps nothing.
    pub(crate) stamp_us: Option<i64>,
    pub(crate) sender: i32,
    pub(crate) kind: i32,
}

impl Header {
    /// Reads a header. `Err` is the length that it claims, where no message is as long.
    pub(crate) fn decode(bytes: &[u8; HEADER_BYTES]) -> Result<Self, u32> {
        let words = bytes.as_chunks::<4>().0;
        let word = |index: usize| words.get(index).map_or(0, |word| u32::from_be_bytes(*word));
        let length = word(0);
        let body_bytes = usize::try_from(length)
            .ok()
            .and_then(|length| length.checked_sub(HEADER_BYTES))
            .filter(|body| *body <= LARGEST_BODY_BYTES)
            .ok_or(length)?;
        let stamp_us = i64::from(word(1)) * 1_000_000 + i64::from(word(2));
        Ok(Self {
            body_bytes,
            stamp_us: (stamp_us > 0).then_some(stamp_us),
            sender: word(3).cast_signed(),
            kind: word(4).cast_signed(),
        })
    }
}

/// Length with padding.
pub(crate) fn padded(bytes: usize) -> usize {
    bytes.next_multiple_of(ALIGNMENT_BYTES)
}

/// Appends a message to `out`. The body must not be larger than [`LARGEST_BODY_BYTES`].
pub(crate) fn encode(
    out: &mut Vec<u8>,
    stamp_us: i64,
    sender: i32,
    kind: i32,
    sequence: u32,
    body: &[u8],
) {
    let stamp_us = stamp_us.max(0);
    let length = HEADER_BYTES + body.len();
    let words = [
        u32::try_from(length).unwrap_or(u32::MAX),
        u32::try_from(stamp_us / 1_000_000).unwrap_or(u32::MAX),
        u32::try_from(stamp_us % 1_000_000).unwrap_or(0),
        sender.cast_unsigned(),
        kind.cast_unsigned(),
        sequence,
    ];
    for word in words {
        out.extend_from_slice(&word.to_be_bytes());
    }
    out.extend_from_slice(body);
    out.resize(out.len() + padded(body.len()) - body.len(), 0);
}

/// The body of a message that gives a name.
pub(crate) fn description(name: &str) -> Vec<u8> {
    let length = u32::try_from(name.len() + 1).unwrap_or(u32::MAX);
    let mut body = length.to_be_bytes().to_vec();
    body.extend_from_slice(name.as_bytes());
    body.push(0);
    body
}

/// The name in the body of such a message; `None` where there is none.
pub(crate) fn described(body: &[u8]) -> Option<String> {
    let (length, name) = body.split_first_chunk::<4>()?;
    let length = usize::try_from(u32::from_be_bytes(*length)).ok()?;
    if length == 0 || length > LONGEST_NAME_BYTES {
        return None;
    }
    let name = name.get(..length)?;
    let end = name.iter().position(|byte| *byte == 0).unwrap_or(length);
    let name = std::str::from_utf8(name.get(..end)?).ok()?;
    (!name.is_empty()).then(|| name.to_owned())
}

/// Reads big-endian numbers.
pub(crate) struct Numbers<'a>(pub(crate) &'a [u8]);

impl Numbers<'_> {
    pub(crate) fn i32(&mut self) -> Option<i32> {
        let (number, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(i32::from_be_bytes(*number))
    }

    pub(crate) fn f64(&mut self) -> Option<f64> {
        let (number, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(f64::from_be_bytes(*number))
    }
}
