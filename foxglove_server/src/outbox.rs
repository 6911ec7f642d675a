//! The messages that wait to be sent to one client of the WebSocket, bounded by number and bytes.
//!
//! Two lanes: *replies* answer the client or describe the server and are never dropped; *data* are
//! messages of topics and the time, of which the oldest are dropped.
//!
//! Invariants: adding never blocks. A client that does not read its replies gets no further
//! requests served ([`Outbox::wait_for_room`]), and one whose replies exceed the maximum loses its
//! connection.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;
use tokio_tungstenite::tungstenite::Message;

/// Replies, and their bytes, beyond which no further request of the client is read.
const REPLIES_SOFT_MAX: usize = 64;
const REPLY_BYTES_SOFT_MAX: usize = 4 << 20;

/// Maximum replies, and their bytes. The list of the topics of 1000 agents, with the text of their
/// message definitions, has some 20 MB.
const REPLIES_MAX: usize = 1024;
const REPLY_BYTES_MAX: usize = 48 << 20;

/// Maximum messages of topics, and their bytes. A single larger message is sent if nothing else
/// waits. What a client that pauses costs once, the process keeps.
pub(super) const DATA_MAX: usize = 1024;
pub(super) const DATA_BYTES_MAX: usize = 8 << 20;

/// Maximum service calls of one client that wait for their reply.
pub(super) const CALLS_MAX: usize = 32;

/// The messages for one client.
#[derive(Default)]
pub(super) struct Outbox {
    lanes: Mutex<Lanes>,
    /// Signalled when a message was added, or the client is to be disconnected.
    added: Notify,
    /// Signalled when a reply was taken.
    taken: Notify,
}

#[derive(Default)]
struct Lanes {
    replies: Lane,
    data: Lane,
    /// Service calls that wait for their reply.
    calls: usize,
    is_closed: bool,
}

/// Messages with the sum of their bytes.
#[derive(Default)]
struct Lane {
    messages: VecDeque<Message>,
    bytes: usize,
}

impl Lane {
    fn push(&mut self, message: Message) {
        self.bytes += message.len();
        self.messages.push_back(message);
    }

    fn pop(&mut self) -> Option<Message> {
        let message = self.messages.pop_front()?;
        self.bytes -= message.len();
        Some(message)
    }

    fn exceeds(&self, messages_max: usize, bytes_max: usize) -> bool {
        self.messages.len() > messages_max || self.bytes > bytes_max
    }
}

impl Outbox {
    fn lanes(&self) -> MutexGuard<'_, Lanes> {
        self.lanes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a reply, or closes the outbox if too many wait.
    pub(super) fn reply(&self, message: impl Into<Message>) {
        let mut lanes = self.lanes();
        if lanes.is_closed {
            return;
        }
        lanes.replies.push(message.into());
        if lanes.replies.exceeds(REPLIES_MAX, REPLY_BYTES_MAX) {
            *lanes = Lanes { is_closed: true, ..Lanes::default() };
        }
        drop(lanes);
        self.added.notify_one();
    }

    /// Adds a message of a topic; the oldest ones make room for it.
    pub(super) fn publish(&self, message: impl Into<Message>) {
        let mut lanes = self.lanes();
        if lanes.is_closed {
            return;
        }
        lanes.data.push(message.into());
        while lanes.data.exceeds(DATA_MAX, DATA_BYTES_MAX) && lanes.data.messages.len() > 1 {
            lanes.data.pop();
        }
        drop(lanes);
        self.added.notify_one();
    }

    /// Bytes of the messages that wait.
    #[cfg(test)]
    pub(super) fn bytes(&self) -> usize {
        let lanes = self.lanes();
        lanes.replies.bytes + lanes.data.bytes
    }

    /// Registers a service call, unless too many wait for their reply.
    pub(super) fn begin_call(&self) -> bool {
        let mut lanes = self.lanes();
        let has_room = lanes.calls < CALLS_MAX;
        lanes.calls += usize::from(has_room);
        has_room
    }

    /// Ends a registered service call with its reply.
    pub(super) fn end_call(&self, message: impl Into<Message>) {
        let mut lanes = self.lanes();
        lanes.calls = lanes.calls.saturating_sub(1);
        drop(lanes);
        self.reply(message);
    }

    /// The next message; `None` once the client is to be disconnected.
    pub(super) async fn next(&self) -> Option<Message> {
        loop {
            {
                let mut lanes = self.lanes();
                if lanes.is_closed {
                    return None;
                }
                if let Some(message) = lanes.replies.pop() {
                    self.taken.notify_one();
                    return Some(message);
                }
                if let Some(message) = lanes.data.pop() {
                    return Some(message);
                }
            }
            self.added.notified().await;
        }
    }

    /// Waits until the client has read enough of its replies.
    pub(super) async fn wait_for_room(&self) {
        loop {
            {
                let lanes = self.lanes();
                if lanes.is_closed || !lanes.replies.exceeds(REPLIES_SOFT_MAX, REPLY_BYTES_SOFT_MAX) {
                    return;
                }
            }
            self.taken.notified().await;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(bytes: usize) -> Message {
        Message::binary(vec![7; bytes])
    }

    fn drained(outbox: &Outbox) -> Vec<usize> {
        let mut lanes = outbox.lanes();
        let lanes = &mut *lanes;
        std::iter::from_fn(|| lanes.replies.pop().or_else(|| lanes.data.pop())).map(|message| message.len()).collect()
    }

    #[test]
    fn oldest_data_is_dropped() {
        let outbox = Outbox::default();
        (0..=DATA_MAX).for_each(|bytes| outbox.publish(message(bytes)));
        assert_eq!(drained(&outbox), (1..=DATA_MAX).collect::<Vec<_>>());
        for bytes in [1, DATA_BYTES_MAX - 1, 2] {
            outbox.publish(message(bytes));
        }
        assert_eq!(drained(&outbox), [2]);
        outbox.publish(message(DATA_BYTES_MAX + 1));
        assert_eq!(drained(&outbox), [DATA_BYTES_MAX + 1]);
        assert_eq!(outbox.lanes().data.bytes, 0);
    }

    #[test]
    fn unread_replies_close_the_outbox() {
        let outbox = Outbox::default();
        (0..REPLIES_MAX).for_each(|_| outbox.reply(message(1)));
        assert!(!outbox.lanes().is_closed);
        outbox.reply(message(1));
        assert!(outbox.lanes().is_closed);
        assert_eq!(drained(&outbox), [0; 0], "what it held is freed");
        let outbox = Outbox::default();
        outbox.reply(message(REPLY_BYTES_MAX + 1));
        assert!(outbox.lanes().is_closed);
    }

    #[test]
    fn service_calls_are_bounded() {
        let outbox = Outbox::default();
        assert!((0..CALLS_MAX).all(|_| outbox.begin_call()));
        assert!(!outbox.begin_call());
        outbox.end_call(message(1));
        assert!(outbox.begin_call());
    }
}
