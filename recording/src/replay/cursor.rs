//! Iteration over the scheduled messages of a recording, once from the first tick to the last.

use std::collections::VecDeque;
use std::iter::Peekable;

use msgs::cdr::Encoded;
use msgs::ids::Tick;

use super::{LatchedCache, PlaybackSchedule};
use crate::{Message, Recording};

/// A recorded message with its topic.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScheduledMessage {
    /// Index of its topic in the schedule.
    pub topic: usize,
    /// Encoded as in the file.
    pub message: Encoded,
}

/// One pass over a recording.
pub struct PlaybackCursor<'a> {
    schedule: &'a PlaybackSchedule,
    initial: VecDeque<ScheduledMessage>,
    messages: Peekable<Box<dyn Iterator<Item = Message> + 'a>>,
}

impl<'a> PlaybackCursor<'a> {
    /// Starts at the first tick of the schedule and collects the latched messages from before it.
    #[must_use]
    pub fn new(recording: &'a Recording, schedule: &'a PlaybackSchedule) -> Self {
        let (first, _) = schedule.ticks();
        let mut messages = in_order(recording, schedule).peekable();
        let mut caches: Vec<Option<LatchedCache>> = schedule.topics().iter().map(LatchedCache::for_topic).collect();
        let is_before = |message: &Message| message.tick() < first || schedule.is_too_late(message);
        while let Some(message) = messages.next_if(is_before) {
            if let Some(ScheduledMessage { topic, message }) = scheduled(schedule, &message)
                && let Some(cache) = &mut caches[topic]
            {
                cache.record_published(&message);
            }
        }
        let mut initial: VecDeque<ScheduledMessage> = schedule.static_messages().iter().cloned().collect();
        for (topic, cache) in caches.into_iter().enumerate() {
            let held = cache.map(LatchedCache::into_messages).unwrap_or_default();
            initial.extend(held.into_iter().map(|message| ScheduledMessage { topic, message }));
        }
        Self { schedule, initial, messages }
    }

    /// The next message that precedes the first tick: static messages and latched ones from before
    /// it.
    pub fn next_initial(&mut self) -> Option<ScheduledMessage> {
        self.initial.pop_front()
    }

    /// The next message up to this tick.
    pub fn next_until(&mut self, tick: Tick) -> Option<ScheduledMessage> {
        loop {
            // A stamp that is refused must not hold up what follows.
            let is_due = |message: &Message| message.tick() <= tick || self.schedule.is_too_late(message);
            let message = self.messages.next_if(is_due)?;
            if let Some(scheduled) = scheduled(self.schedule, &message) {
                return Some(scheduled);
            }
        }
    }
}

/// The messages in the order of their ticks, and those of a tick in that of the file.
fn in_order<'a>(recording: &'a Recording, schedule: &PlaybackSchedule) -> Box<dyn Iterator<Item = Message> + 'a> {
    if schedule.is_sorted() {
        return Box::new(recording.messages());
    }
    let mut messages: Vec<Message> = recording.messages().filter(|message| !schedule.is_too_late(message)).collect();
    messages.sort_by_key(Message::tick);
    Box::new(messages.into_iter())
}

/// The message, if the schedule includes it.
fn scheduled(schedule: &PlaybackSchedule, message: &Message) -> Option<ScheduledMessage> {
    if schedule.is_too_late(message) {
        return None;
    }
    let topic = schedule.number_of(&message.channel)?;
    Some(ScheduledMessage { topic, message: Encoded::new(&message.data).ok()? })
}
