//! The transport over a socket that a program inherits as its standard input, from a run in memory
//! that has started it.
//!
//! A message is a byte for its type, its length as a little-endian `u32`, and its CDR. The socket
//! is private to the two processes, so that nothing is signed.

use std::io::{self, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use msgs::cdr;
use msgs::maes_msgs::{Command, Join, JoinReply, Observation, Scenario};

use protocol::signed::{JoinRequest, Signed};

use crate::transport::{Inbound, ServerTransport};

/// Upper bound on the CDR of a message, bytes: more than any message of the protocol has.
const BYTES_MAX: u32 = 1 << 20;

/// A message of either direction.
#[derive(Debug, Clone, PartialEq)]
pub enum Frame {
    /// From the server: the scenario.
    Scenario(Scenario),
    /// From the server: the reply to a join.
    JoinReply(JoinReply),
    /// From the server: a fragment of an observation.
    Observation(Observation),
    /// From an agent: a join.
    Join(Join),
    /// From an agent: a command.
    Command(Command),
}

impl Frame {
    /// Writes the message.
    ///
    /// # Errors
    /// If the other side is gone.
    pub fn write(&self, stream: &mut impl Write) -> io::Result<()> {
        let (kind, payload) = match self {
            Self::Scenario(message) => (0, cdr::encode(message)),
            Self::JoinReply(message) => (1, cdr::encode(message)),
            Self::Observation(message) => (2, cdr::encode(message)),
            Self::Join(message) => (3, cdr::encode(message)),
            Self::Command(message) => (4, cdr::encode(message)),
        };
        let length = u32::try_from(payload.len()).map_err(io::Error::other)?;
        // One write for all: each would wake the other side.
        let mut bytes = Vec::with_capacity(payload.len() + 5);
        bytes.push(kind);
        bytes.extend(length.to_le_bytes());
        bytes.extend(payload);
        stream.write_all(&bytes)
    }

    /// Reads the next message; `None` if the other side has closed the socket.
    ///
    /// # Errors
    /// If the socket fails, or what came is no message.
    pub fn read(stream: &mut impl Read) -> io::Result<Option<Self>> {
        let mut head = [0; 5];
        if stream.read(&mut head[..1])? == 0 {
            return Ok(None);
        }
        stream.read_exact(&mut head[1..])?;
        let [kind, length @ ..] = head;
        let length = u32::from_le_bytes(length);
        let invalid = |what: String| io::Error::new(io::ErrorKind::InvalidData, what);
        if length > BYTES_MAX {
            return Err(invalid(format!("a message of {length} bytes; expected at most {BYTES_MAX}")));
        }
        let mut payload = vec![0; length as usize];
        stream.read_exact(&mut payload)?;
        let frame = match kind {
            0 => cdr::decode(&payload).map(Self::Scenario),
            1 => cdr::decode(&payload).map(Self::JoinReply),
            2 => cdr::decode(&payload).map(Self::Observation),
            3 => cdr::decode(&payload).map(Self::Join),
            4 => cdr::decode(&payload).map(Self::Command),
            _ => return Err(invalid(format!("a message of type {kind}; expected 0 to 4"))),
        };
        frame.map(Some).map_err(|error| invalid(error.to_string()))
    }
}

/// The end of a program whose standard input is the socket.
pub struct PipeTransport {
    stream: UnixStream,
    inbox: Receiver<Inbound>,
    is_closed: bool,
}

impl PipeTransport {
    /// The transport over the standard input of this process.
    ///
    /// # Errors
    /// If the standard input is no socket.
    pub fn on_stdin() -> io::Result<Self> {
        let stream = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
        stream.peer_addr()?;
        let mut from_server = io::BufReader::new(stream.try_clone()?);
        let (sender, inbox) = channel();
        std::thread::spawn(move || {
            while let Ok(Some(frame)) = Frame::read(&mut from_server) {
                let message = match frame {
                    Frame::Scenario(scenario) => Inbound::Scenario(scenario),
                    Frame::JoinReply(reply) => Inbound::JoinReply(reply),
                    Frame::Observation(fragment) => Inbound::Observation(Signed::unsigned(fragment)),
                    Frame::Join(_) | Frame::Command(_) => break,
                };
                if sender.send(message).is_err() {
                    break;
                }
            }
        });
        Ok(Self { stream, inbox, is_closed: false })
    }

    /// Whether the server has closed the socket.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.is_closed
    }

    fn send(&mut self, frame: &Frame) {
        self.is_closed |= frame.write(&mut self.stream).is_err();
    }
}

impl ServerTransport for PipeTransport {
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        self.send(&Frame::Join(join.claimed().join.clone()));
    }

    fn send_command(&mut self, command: &Signed<Command>) {
        self.send(&Frame::Command(command.claimed().clone()));
    }

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        match self.inbox.recv_timeout(timeout) {
            Ok(message) => Some(message),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                self.is_closed = true;
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_round_trip_and_others_are_refused() {
        let frames = [
            Frame::Scenario(Scenario { run: 7, ..Scenario::default() }),
            Frame::JoinReply(JoinReply { agent: 3, ..JoinReply::default() }),
            Frame::Observation(Observation { tick: 5, ..Observation::default() }),
            Frame::Join(Join { agent: 2, ..Join::default() }),
            Frame::Command(Command { tick: 9, ..Command::default() }),
        ];
        let mut bytes = Vec::new();
        frames.iter().for_each(|frame| frame.write(&mut bytes).unwrap());
        let mut rest = bytes.as_slice();
        for frame in frames {
            assert_eq!(Frame::read(&mut rest).unwrap(), Some(frame));
        }
        assert_eq!(Frame::read(&mut rest).unwrap(), None);
        let cut = Frame::read(&mut &bytes[..bytes.len() / 2 - 1]);
        assert!(cut.is_ok(), "the first one is whole");
        let error = |bytes: &[u8]| Frame::read(&mut &*bytes).unwrap_err().to_string();
        assert_eq!(error(&[9, 0, 0, 0, 0]), "a message of type 9; expected 0 to 4");
        assert_eq!(error(&[4, 255, 255, 255, 255]), "a message of 4294967295 bytes; expected at most 1048576");
        assert!(Frame::read(&mut &bytes[..7]).is_err() && Frame::read(&mut &bytes[..3]).is_err());
    }
}
