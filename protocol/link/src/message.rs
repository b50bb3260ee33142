//! Framed messages on a stream: a length of four bytes, little endian, then as many bytes.
//! In and out: whole messages. A length above the cap ends the stream before a byte of it is stored.

use std::time::Duration;

use quinn::{ReadError, RecvStream, SendStream, VarInt, WriteError};

use tokio::time::{Instant, sleep_until};

use crate::closed::{CloseCode, Closed};

const LENGTH_BYTES: usize = 4;
/// Read at a time; also written at a time where a pace is kept.
const CHUNK_BYTES: usize = 32 << 10;

/// Why no message went out or came in.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MessageError {
    /// The connection is over.
    #[error(transparent)]
    Closed(#[from] Closed),
    /// A frame is longer than the cap: the peer is broken or hostile, or the message must be cut.
    #[error("a message of {bytes} bytes; at most {cap} are allowed")]
    TooLong {
        /// Its length.
        bytes: usize,
        /// The longest allowed.
        cap: usize,
    },
    /// The other side ended the stream but not the connection.
    #[error("the other side ended the stream")]
    Ended,
}

/// The sending end of a stream of messages.
pub struct MessageSender {
    stream: SendStream,
    cap: usize,
    pace: Option<Pace>,
}

/// Keeps a stream below a rate. QUIC alone would fill the queues of the path, behind which every view of
/// the wall then waits.
struct Pace {
    bytes_per_second: f64,
    /// When the next byte may leave.
    next: Instant,
}

impl MessageSender {
    pub(crate) const fn new(stream: SendStream, cap: usize) -> Self {
        Self {
            stream,
            cap,
            pace: None,
        }
    }

    pub(crate) fn paced(stream: SendStream, cap: usize, bytes_per_second: u32) -> Self {
        let bytes_per_second = f64::from(bytes_per_second.max(1));
        Self {
            stream,
            cap,
            pace: Some(Pace {
                bytes_per_second,
                next: Instant::now(),
            }),
        }
    }

    /// Sends one message. Waits while the peer does not read: never call it from a frame loop.
    ///
    /// # Errors
    /// [`MessageError::TooLong`] sends nothing.
    pub async fn send(&mut self, message: &[u8]) -> Result<(), MessageError> {
        if message.len() > self.cap {
            return Err(MessageError::TooLong {
                bytes: message.len(),
                cap: self.cap,
            });
        }
        // One write, so that a short message is one packet.
        let mut frame = Vec::with_capacity(LENGTH_BYTES + message.len());
        frame.extend_from_slice(&(message.len() as u32).to_le_bytes());
        frame.extend_from_slice(message);
        let Some(pace) = &mut self.pace else {
            return self.stream.write_all(&frame).await.map_err(write_error);
        };
        for chunk in frame.chunks(CHUNK_BYTES) {
            sleep_until(pace.next).await;
            self.stream.write_all(chunk).await.map_err(write_error)?;
            let spent = Duration::from_secs_f64(chunk.len() as f64 / pace.bytes_per_second);
            pace.next = pace.next.max(Instant::now() - spent) + spent;
        }
        Ok(())
    }

    /// Says that nothing more will come, and waits until the peer has everything.
    pub async fn finish(mut self) {
        if self.stream.finish().is_ok() {
            let _acknowledged = self.stream.stopped().await;
        }
    }
}

fn write_error(error: WriteError) -> MessageError {
    match error {
        WriteError::ConnectionLost(error) => MessageError::Closed(error.into()),
        WriteError::Stopped(_) | WriteError::ClosedStream | WriteError::ZeroRttRejected => {
            MessageError::Ended
        }
    }
}

/// The receiving end of a stream of messages.
pub struct MessageReceiver {
    stream: RecvStream,
    cap: usize,
    buffer: Vec<u8>,
}

impl MessageReceiver {
    pub(crate) const fn new(stream: RecvStream, cap: usize) -> Self {
        Self {
            stream,
            cap,
            buffer: Vec::new(),
        }
    }

    /// The next message. Dropping the future loses nothing, so it may stand in a `select!`.
    ///
    /// # Errors
    /// After [`MessageError::TooLong`] the stream is over: its frames can no longer be found.
    pub async fn receive(&mut self) -> Result<Vec<u8>, MessageError> {
        loop {
            if let Some(message) = self.take_message()? {
                return Ok(message);
            }
            match self.stream.read_chunk(CHUNK_BYTES, true).await {
                Ok(Some(chunk)) => self.buffer.extend_from_slice(&chunk.bytes),
                Ok(None) => return Err(MessageError::Ended),
                Err(ReadError::ConnectionLost(error)) => {
                    return Err(MessageError::Closed(error.into()));
                }
                Err(_reset_or_stopped) => return Err(MessageError::Ended),
            }
        }
    }

    fn take_message(&mut self) -> Result<Option<Vec<u8>>, MessageError> {
        let Some((length, rest)) = self.buffer.split_first_chunk::<LENGTH_BYTES>() else {
            return Ok(None);
        };
        let bytes = u32::from_le_bytes(*length) as usize;
        if bytes > self.cap {
            let _already_over = self
                .stream
                .stop(VarInt::from_u32(CloseCode::Protocol as u32));
            return Err(MessageError::TooLong {
                bytes,
                cap: self.cap,
            });
        }
        let Some(message) = rest.get(..bytes) else {
            return Ok(None);
        };
        let message = message.to_vec();
        self.buffer.drain(..LENGTH_BYTES + bytes);
        Ok(Some(message))
    }
}
