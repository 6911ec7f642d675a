//! Once through a recording, from the first tick that is played to the last.

use std::collections::VecDeque;
use std::iter::Peekable;

use msgs::cdr::Encoded;
use msgs::ids::Tick;

use super::{Programme, Shelf};
use crate::recording::{Message, Messages, Recording};

/// A message that is due.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cue {
    /// The number of its topic in the programme.
    pub topic: usize,
    /// As it stands in the file.
    pub message: Encoded,
}

/// Once through a recording.
pub struct Pass<'a> {
    programme: &'a Programme,
    opening: VecDeque<Cue>,
    messages: Peekable<Messages<'a>>,
}

impl<'a> Pass<'a> {
    /// From the beginning of the programme on. What was said before it and holds on is found here.
    #[must_use]
    pub fn begin(recording: &'a Recording, programme: &'a Programme) -> Self {
        let (first, _) = programme.ticks();
        let mut messages = recording.messages().peekable();
        let mut shelves: Vec<Option<Shelf>> = programme.topics().iter().map(Shelf::of).collect();
        while let Some(message) = messages.next_if(|message| message.tick() < first) {
            if let Some(Cue { topic, message }) = cue(programme, &message)
                && let Some(shelf) = &mut shelves[topic]
            {
                shelf.note(&message);
            }
        }
        let mut opening: VecDeque<Cue> = programme.scenery().iter().cloned().collect();
        for (topic, shelf) in shelves.into_iter().enumerate() {
            let held = shelf.map(Shelf::into_messages).unwrap_or_default();
            opening.extend(held.into_iter().map(|message| Cue { topic, message }));
        }
        Self { programme, opening, messages }
    }

    /// The next message that is to be said before the first tick: what was said earlier and holds on.
    pub fn opening(&mut self) -> Option<Cue> {
        self.opening.pop_front()
    }

    /// The next message up to this tick, if there is one.
    pub fn until(&mut self, tick: Tick) -> Option<Cue> {
        loop {
            let message = self.messages.next_if(|message| message.tick() <= tick)?;
            if let Some(cue) = cue(self.programme, &message) {
                return Some(cue);
            }
        }
    }
}

/// The message, if it is part of the programme.
fn cue(programme: &Programme, message: &Message) -> Option<Cue> {
    let topic = programme.number_of(&message.channel)?;
    Some(Cue { topic, message: Encoded::new(&message.data).ok()? })
}
