//! A stream of frames over a socket that never blocks.
//!
//! A frame is its length after these four bytes, an address, and its content. The address is a kind
//! and an agent; all three integers have four bytes, the least significant first.
//!
//! Invariants: a frame arrives whole or not at all, and in order; what is queued has a bound; a
//! stream that breaks the format is closed.

use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

use msgs::cdr;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use protocol::limits::OBSERVATION_BYTES_MAX;
use serde::Serialize;

use system::wall_clock::now;

/// Longest content of a frame, bytes: a message, and what signs it.
const CONTENT_BYTES_MAX: usize = OBSERVATION_BYTES_MAX + 1024;

/// Bytes of the length, and with the address.
const LENGTH_BYTES: usize = 4;
const HEADER_BYTES: usize = 3 * LENGTH_BYTES;

/// Bytes that are read at once.
pub(super) const READ_BYTES: usize = 65_536;

/// Queued bytes from which on they are written without waiting for more.
const WRITE_BYTES: usize = 65_536;

/// Queued bytes from which on a sender waits for the other end.
const QUEUED_BYTES_MAX: usize = 8 << 20;

/// Longest wall time without progress that a sender waits.
const PATIENCE: Duration = Duration::from_millis(100);

/// A connection. See the module.
pub(super) struct Connection {
    stream: UnixStream,
    received: Buffer,
    queued: Buffer,
    is_open: bool,
    /// Whether the other end has sent what is no frame.
    is_broken: bool,
    /// Whether the other end has not read for [`PATIENCE`]; then nothing waits for it until it
    /// does.
    is_stuck: bool,
}

/// Bytes of which the first ones are done with.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    done: usize,
}

impl Buffer {
    fn left(&self) -> &[u8] {
        &self.bytes[self.done..]
    }

    /// Marks bytes as done with. Moves the rest to the front now and then, so that the buffer does
    /// not grow.
    fn advance(&mut self, count: usize) {
        self.done += count;
        if self.done == self.bytes.len() {
            self.bytes.clear();
            self.done = 0;
        } else if self.done >= self.bytes.len() / 2 && self.done >= READ_BYTES {
            drop(self.bytes.drain(..self.done));
            self.done = 0;
        }
    }
}

impl Connection {
    pub(super) fn new(stream: UnixStream) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        Ok(Self {
            stream,
            received: Buffer::default(),
            queued: Buffer::default(),
            is_open: true,
            is_broken: false,
            is_stuck: false,
        })
    }

    pub(super) fn fd(&self) -> BorrowedFd<'_> {
        self.stream.as_fd()
    }

    /// Whether the other end can still send.
    pub(super) fn is_open(&self) -> bool {
        self.is_open
    }

    /// Whether the other end has sent what is no frame, which has closed the connection.
    pub(super) fn is_broken(&self) -> bool {
        self.is_broken
    }

    /// Whether there is something to write.
    pub(super) fn has_queued(&self) -> bool {
        self.is_open && !self.queued.left().is_empty()
    }

    /// Queues a frame; returns whether there was room.
    pub(super) fn queue<M: Serialize>(&mut self, address: Address, message: &M) -> bool {
        if !self.is_open || !self.has_room() {
            return false;
        }
        let bytes = &mut self.queued.bytes;
        let start = bytes.len();
        bytes.extend_from_slice(&[0; LENGTH_BYTES]);
        bytes.extend_from_slice(&address.kind.to_le_bytes());
        bytes.extend_from_slice(&address.agent.to_le_bytes());
        cdr::append(bytes, message);
        let length = u32::try_from(bytes.len() - start - LENGTH_BYTES).unwrap_or(u32::MAX);
        bytes[start..start + LENGTH_BYTES].copy_from_slice(&length.to_le_bytes());
        if self.queued.left().len() >= WRITE_BYTES {
            self.flush();
        }
        true
    }

    /// Waits until the queue is below its bound, unless the other end is stuck.
    fn has_room(&mut self) -> bool {
        let mut since = now();
        while self.queued.left().len() >= QUEUED_BYTES_MAX {
            let before = self.queued.left().len();
            self.flush();
            if self.queued.left().len() < before {
                (since, self.is_stuck) = (now(), false);
            } else if self.is_stuck || !self.wait_until_writable(since) {
                self.is_stuck = self.is_open;
                return false;
            }
        }
        self.is_open
    }

    /// Waits for at most [`PATIENCE`] after `since`; returns whether that is not yet over.
    fn wait_until_writable(&self, since: Instant) -> bool {
        let left = PATIENCE.saturating_sub(since.elapsed());
        let timeout = PollTimeout::try_from(left).unwrap_or(PollTimeout::ZERO);
        // An interruption is a wait that was shorter.
        let _ = poll(&mut [PollFd::new(self.fd(), PollFlags::POLLOUT)], timeout);
        !left.is_zero()
    }

    /// Writes what the other end takes.
    pub(super) fn flush(&mut self) {
        while self.has_queued() {
            match self.stream.write(self.queued.left()) {
                Ok(0) => self.is_open = false,
                Ok(written) => self.queued.advance(written),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(_) => self.is_open = false,
            }
        }
    }

    /// Writes what is queued before the connection ends, unless the other end does not read.
    pub(super) fn finish(&mut self) {
        let since = now();
        self.flush();
        while self.has_queued() && self.wait_until_writable(since) {
            self.flush();
        }
    }

    /// Reads once what has arrived, at most as much as `space` holds.
    pub(super) fn read(&mut self, space: &mut [u8]) {
        match self.stream.read(space) {
            Ok(length @ 1..) => self.received.bytes.extend_from_slice(&space[..length]),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Ok(0) | Err(_) => self.is_open = false,
        }
    }

    /// The next whole frame that has arrived; its content is for [`Self::content`]. A frame that is
    /// too long closes the connection.
    pub(super) fn next(&mut self) -> Option<Frame> {
        let received = self.received.left();
        let [length, kind, agent] = integers(received.first_chunk()?);
        let end = LENGTH_BYTES + length as usize;
        if !(HEADER_BYTES..=HEADER_BYTES + CONTENT_BYTES_MAX).contains(&end) {
            (self.is_open, self.is_broken) = (false, true);
            self.received = Buffer::default();
            return None;
        }
        (received.len() >= end).then_some(Frame { address: Address { kind, agent }, end })
    }

    /// What the frame carries that [`Self::next`] has returned.
    pub(super) fn content(&self, frame: Frame) -> &[u8] {
        &self.received.left()[HEADER_BYTES..frame.end]
    }

    /// Removes that frame.
    pub(super) fn remove(&mut self, frame: Frame) {
        self.received.advance(frame.end);
    }
}

/// What a frame carries, and whom that concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Address {
    pub(super) kind: u32,
    pub(super) agent: u32,
}

/// A frame at the front of what has arrived.
#[derive(Clone, Copy)]
pub(super) struct Frame {
    pub(super) address: Address,
    /// Where it ends.
    end: usize,
}

fn integers(header: &[u8; HEADER_BYTES]) -> [u32; 3] {
    let (integers, _) = header.as_chunks();
    std::array::from_fn(|index| u32::from_le_bytes(integers[index]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use msgs::maes_msgs::AgentMessage;

    /// A connection and the raw other end.
    fn half() -> (Connection, UnixStream) {
        let (one, other) = UnixStream::pair().unwrap();
        (Connection::new(one).unwrap(), other)
    }

    fn pair() -> (Connection, Connection) {
        let (one, other) = half();
        (one, Connection::new(other).unwrap())
    }

    fn of(agent: u32) -> Address {
        Address { kind: 2, agent }
    }

    fn message(bytes: usize) -> AgentMessage {
        AgentMessage { data: vec![7; bytes].into(), ..AgentMessage::default() }
    }

    /// The agents and lengths of the messages that have arrived.
    fn received(connection: &mut Connection) -> Vec<(u32, usize)> {
        connection.read(&mut [0; READ_BYTES]);
        let mut all = Vec::new();
        while let Some(frame) = connection.next() {
            let message: AgentMessage = cdr::decode(connection.content(frame)).unwrap();
            assert_eq!(frame.address.kind, 2);
            all.push((frame.address.agent, message.data.len()));
            connection.remove(frame);
        }
        all
    }

    #[test]
    fn frames_arrive_whole_and_in_order() {
        let (mut one, mut other) = pair();
        assert!(one.queue(of(3), &message(5)) && one.queue(of(0), &message(0)));
        assert_eq!(received(&mut other), [], "queued, and not yet sent");
        one.flush();
        assert_eq!(received(&mut other), [(3, 5), (0, 0)]);
        drop(one);
        assert_eq!(received(&mut other), []);
        assert!(!other.is_open());
    }

    #[test]
    fn a_frame_in_pieces_is_one_frame() {
        let (mut one, mut raw) = half();
        let content = cdr::encode(&message(9));
        let length = u32::try_from(HEADER_BYTES - LENGTH_BYTES + content.len()).unwrap();
        let bytes = [&length.to_le_bytes()[..], &2_u32.to_le_bytes(), &6_u32.to_le_bytes(), &content].concat();
        for byte in &bytes[..bytes.len() - 1] {
            raw.write_all(&[*byte]).unwrap();
            assert_eq!(received(&mut one), []);
        }
        raw.write_all(&bytes[bytes.len() - 1..]).unwrap();
        assert_eq!(received(&mut one), [(6, 9)]);
    }

    #[test]
    fn a_frame_of_an_illegal_length_closes_the_connection() {
        for length in [0, 7, u32::try_from(CONTENT_BYTES_MAX).unwrap() + 9, u32::MAX] {
            let (mut one, mut raw) = half();
            raw.write_all(&length.to_le_bytes()).unwrap();
            raw.write_all(&[0; 8]).unwrap();
            assert_eq!(received(&mut one), []);
            assert!(one.is_broken() && !one.is_open(), "{length}");
            assert!(!one.queue(of(0), &message(1)), "{length}");
        }
    }

    #[test]
    fn more_than_the_socket_holds_arrives() {
        let (mut one, mut other) = pair();
        let sent: Vec<_> = (0..100).map(|agent| (agent, 50_000)).collect();
        assert!(sent.iter().all(|&(agent, bytes)| one.queue(of(agent), &message(bytes))));
        let mut arrived = Vec::new();
        while arrived.len() < sent.len() {
            one.flush();
            arrived.extend(received(&mut other));
        }
        assert_eq!(arrived, sent);
        assert!(other.received.bytes.capacity() <= 4 * READ_BYTES, "what is done with does not stay");
    }

    #[test]
    fn an_end_that_does_not_read_is_waited_for_once() {
        let (mut one, mut other) = pair();
        let mut queued = 0;
        while one.queue(of(1), &message(50_000)) {
            queued += 1;
        }
        assert!(one.is_stuck && queued * 50_000 >= QUEUED_BYTES_MAX);
        let begun = now();
        assert!((0..1000).all(|_| !one.queue(of(1), &message(50_000))));
        assert!(begun.elapsed() < PATIENCE * 1000 / 2, "it is not waited for again");
        // What was queued arrives, and then there is room.
        let mut arrived = 0;
        while arrived < queued {
            one.flush();
            arrived += received(&mut other).len();
        }
        assert!(one.queue(of(1), &message(50_000)));
    }
}
