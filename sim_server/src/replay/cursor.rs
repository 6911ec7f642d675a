//! Once through a recording, from the first tick that is played to the last.

use std::collections::VecDeque;
use std::iter::Peekable;

use msgs::cdr::Encoded;
use msgs::ids::Tick;

use super::{LatchedCache, PlaybackSchedule};
use crate::recording::{Message, Messages, Recording};

/// A message that is due.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScheduledMessage {
    /// The number of its topic in the schedule.
    pub topic: usize,
    /// As it stands in the file.
    pub message: Encoded,
}

/// Once through a recording.
pub struct PlaybackCursor<'a> {
    schedule: &'a PlaybackSchedule,
    opening: VecDeque<ScheduledMessage>,
    messages: Peekable<Messages<'a>>,
}

impl<'a> PlaybackCursor<'a> {
    /// From the beginning of the schedule on. What was said before it and holds on is found here.
    #[must_use]
    pub fn begin(recording: &'a Recording, schedule: &'a PlaybackSchedule) -> Self {
        let (first, _) = schedule.ticks();
        let mut messages = recording.messages().peekable();
        let mut caches: Vec<Option<LatchedCache>> = schedule.topics().iter().map(LatchedCache::for_topic).collect();
        while let Some(message) = messages.next_if(|message| message.tick() < first) {
            if let Some(ScheduledMessage { topic, message }) = cue(schedule, &message)
                && let Some(cache) = &mut caches[topic]
            {
                cache.record_published(&message);
            }
        }
        let mut opening: VecDeque<ScheduledMessage> = schedule.static_messages().iter().cloned().collect();
        for (topic, cache) in caches.into_iter().enumerate() {
            let held = cache.map(LatchedCache::into_messages).unwrap_or_default();
            opening.extend(held.into_iter().map(|message| ScheduledMessage { topic, message }));
        }
        Self { schedule, opening, messages }
    }

    /// The next message that is to be said before the first tick: what was said earlier and holds on.
    pub fn opening(&mut self) -> Option<ScheduledMessage> {
        self.opening.pop_front()
    }

    /// The next message up to this tick, if there is one.
    pub fn until(&mut self, tick: Tick) -> Option<ScheduledMessage> {
        loop {
            let message = self.messages.next_if(|message| message.tick() <= tick)?;
            if let Some(cue) = cue(self.schedule, &message) {
                return Some(cue);
            }
        }
    }
}

/// The message, if it is part of the schedule.
fn cue(schedule: &PlaybackSchedule, message: &Message) -> Option<ScheduledMessage> {
    let topic = schedule.number_of(&message.channel)?;
    Some(ScheduledMessage { topic, message: Encoded::new(&message.data).ok()? })
}
