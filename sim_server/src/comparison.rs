//! Whether two runs say the same: message by message in order, up to the first in which they differ.
//!
//! **What is passed over.** Views (`[views]` of a scenario says which are recorded) are of who looks on, and the counters of refusals
//! in a result of who has disturbed; neither is of the run. Everything else is compared bit by bit.
//!
//! Invariants: nothing is looked at behind the first difference; what a recording without its end does not hold is no difference.
//!
//! This module knows no world, and reads no file.

use std::collections::BTreeMap;
use std::fmt;

use msgs::cdr;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs;
use msgs::tf2_msgs::TFMessage;
use msgs::topics;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::difference::{self, Field};
use crate::recording::{End, Message, Messages, Recording};
use crate::session::Checker;
use simulation::digest::Digest;

/// What the names of the counters of refusals begin with.
const REFUSED: &str = "refused_";

/// What a difference is called that is one of whole messages.
const WHOLE_MESSAGE: &str = "the message";

/// What is said of a message that is not there.
const NONE: &str = "none";

/// Where two runs differ.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// When.
    pub tick: Tick,
    /// Whose topic it is, if it is the topic of an agent.
    pub agent: Option<AgentId>,
    /// The topic.
    pub topic: String,
    /// What differs of the message: a field with its two values, or the message itself.
    pub field: Field,
}

impl Difference {
    fn new(place: &Place<'_>, field: Field) -> Self {
        let agent = topics::split(place.topic).map(|(agent, _)| agent);
        Self { tick: place.tick, agent, topic: place.topic.to_owned(), field }
    }

    /// Whether there is nothing in the place of a message of the recording.
    #[must_use]
    pub fn is_lack(&self) -> bool {
        self.field.name == WHOLE_MESSAGE && self.field.now == NONE
    }

    /// Where it is.
    #[must_use]
    pub fn place(&self) -> String {
        let agent = self.agent.map_or_else(String::new, |agent| format!(", agent {agent}"));
        format!("tick {}{agent}, {}", self.tick, self.topic)
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place(), self.field)
    }
}

/// Where a message stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place<'a> {
    tick: Tick,
    topic: &'a str,
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of tick {}", self.topic, self.tick)
    }
}

/// Compares what is said with a recording.
pub struct Comparison<'a> {
    before: Messages<'a>,
    compared: u64,
    last_tick: Tick,
    found: Option<Difference>,
    refusals: Option<Field>,
    is_closed: bool,
}

impl<'a> Comparison<'a> {
    /// Begins at the start of a recording.
    #[must_use]
    pub fn new(recording: &'a Recording) -> Self {
        let before = recording.messages();
        Self { before, compared: 0, last_tick: Tick::ZERO, found: None, refusals: None, is_closed: false }
    }

    /// How many messages are the same.
    #[must_use]
    pub fn compared(&self) -> u64 {
        self.compared
    }

    /// The tick of the last one that is.
    #[must_use]
    pub fn last_tick(&self) -> Tick {
        self.last_tick
    }

    /// The first difference, as far as is known.
    #[must_use]
    pub fn difference(&self) -> Option<&Difference> {
        self.found.as_ref()
    }

    /// The first counter of refusals that differs. It is no difference of the run.
    #[must_use]
    pub fn refusals(&self) -> Option<&Field> {
        self.refusals.as_ref()
    }

    /// Whether the recording has ended without its end before everything was said.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// Nothing more is said: what the recording has beyond that is a difference.
    pub fn end(&mut self) {
        if !self.is_done()
            && let Some(message) = self.next()
        {
            let place = place(&message);
            self.found = Some(whole(&place, Some(place), None));
        }
    }

    /// The next message of the recording that is of the run.
    fn next(&mut self) -> Option<Message> {
        self.before.find(|message| Kind::of(&message.channel.topic).is_some())
    }
}

impl Checker for Comparison<'_> {
    fn take(&mut self, topic: &str, tick: Tick, cdr: &[u8]) {
        let Some(kind) = Kind::of(topic) else { return };
        if self.is_done() {
            return;
        }
        let now = Place { tick, topic };
        let Some(message) = self.next() else {
            match self.before.end() {
                Some(End::Whole) => self.found = Some(whole(&now, None, Some(now))),
                _ => self.close(),
            }
            return;
        };
        let before = place(&message);
        if before != now {
            let first = if before.tick <= now.tick { before } else { now };
            self.found = Some(whole(&first, Some(before), Some(now)));
            return;
        }
        if message.data != cdr {
            if kind == Kind::Result {
                self.refusals = between_refusals(&message.data, cdr);
            }
            if let Some(field) = kind.between(&message.data, cdr) {
                self.found = Some(Difference::new(&now, field));
                return;
            }
        }
        self.compared += 1;
        self.last_tick = tick;
    }

    fn is_done(&self) -> bool {
        self.found.is_some() || self.is_closed
    }

    fn close(&mut self) {
        self.is_closed = true;
    }
}

/// Where a recorded command is not the one that is given now, if one is.
#[must_use]
pub fn with_command(recorded: &Message, now: Option<&maes_msgs::Command>) -> Option<Difference> {
    let place = place(recorded);
    let Some(now) = now else { return Some(whole(&place, Some(place), None)) };
    let now = cdr::encode(now);
    let field = (recorded.data != now).then(|| Kind::Command.between(&recorded.data, &now)).flatten();
    field.map(|field| Difference::new(&place, field))
}

fn place(message: &Message) -> Place<'_> {
    Place { tick: message.tick(), topic: &message.channel.topic }
}

/// A difference of whole messages.
fn whole(at: &Place<'_>, before: Option<Place<'_>>, now: Option<Place<'_>>) -> Difference {
    let words = |place: Option<Place<'_>>| place.map_or_else(|| NONE.to_owned(), |place| place.to_string());
    Difference::new(at, Field { name: WHOLE_MESSAGE.to_owned(), before: words(before), now: words(now) })
}

/// A message of the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Scenario,
    Progress,
    Digest,
    Result,
    Transforms,
    Intervention,
    Join,
    Observation,
    Command,
}

impl Kind {
    /// What is said on a topic, if it is of the run.
    fn of(topic: &str) -> Option<Self> {
        if let Some((_, rest)) = topics::split(topic) {
            return match rest {
                "observation" => Some(Self::Observation),
                "command" => Some(Self::Command),
                "join" => Some(Self::Join),
                _ => None,
            };
        }
        let of_run = [
            (topics::tf(), Self::Transforms),
            (topics::digest(), Self::Digest),
            (topics::progress(), Self::Progress),
            (topics::intervention(), Self::Intervention),
            (topics::scenario(), Self::Scenario),
            (topics::result(), Self::Result),
        ];
        of_run.into_iter().find_map(|(known, kind)| (known.name == topic).then_some(kind))
    }

    /// The first field that is different.
    fn between(self, before: &[u8], now: &[u8]) -> Option<Field> {
        match self {
            Self::Scenario => decoded(before, now, fields::<maes_msgs::Scenario>),
            Self::Progress => decoded(before, now, fields::<maes_msgs::Progress>),
            Self::Digest => decoded(before, now, between_digests),
            Self::Result => decoded(before, now, between_results),
            Self::Transforms => decoded(before, now, fields::<TFMessage>),
            Self::Intervention => decoded(before, now, fields::<maes_msgs::Intervention>),
            Self::Join => decoded(before, now, fields::<maes_msgs::Join>),
            Self::Observation => decoded(before, now, fields::<maes_msgs::Observation>),
            Self::Command => decoded(before, now, fields::<maes_msgs::Command>),
        }
    }
}

/// What is different of two messages, whose bytes are.
fn decoded<M: DeserializeOwned>(
    before: &[u8],
    now: &[u8],
    between: impl FnOnce(&M, &M) -> Option<Field>,
) -> Option<Field> {
    match (cdr::decode(before), cdr::decode(now)) {
        (Ok(before), Ok(now)) => between(&before, &now),
        _ => {
            let words = |bytes: &[u8]| format!("{} that are no such message", bytes.len());
            Some(Field { name: "bytes".to_owned(), before: words(before), now: words(now) })
        }
    }
}

fn fields<M: Serialize>(before: &M, now: &M) -> Option<Field> {
    difference::between(before, now).or_else(|| {
        let name = "the encoding".to_owned();
        Some(Field { name, before: "one".to_owned(), now: "another of the same values".to_owned() })
    })
}

fn between_digests(before: &maes_msgs::Digest, now: &maes_msgs::Digest) -> Option<Field> {
    let named = || hashes(before.digest, now.digest);
    let rest = |digest: &maes_msgs::Digest| maes_msgs::Digest { digest: [0; 32], ..digest.clone() };
    difference::between(&rest(before), &rest(now)).or_else(named)
}

fn hashes(before: [u8; 32], now: [u8; 32]) -> Option<Field> {
    let words = |digest| Digest(digest).to_string();
    (before != now).then(|| Field { name: "digest".to_owned(), before: words(before), now: words(now) })
}

/// The counters of refusals are left out.
fn between_results(before: &maes_msgs::Result, now: &maes_msgs::Result) -> Option<Field> {
    let rest =
        |result: &maes_msgs::Result| maes_msgs::Result { counters: Vec::new(), digest: [0; 32], ..result.clone() };
    difference::between(&rest(before), &rest(now))
        .or_else(|| counters(before, now, |name| !name.starts_with(REFUSED)))
        .or_else(|| hashes(before.digest, now.digest))
}

fn between_refusals(before: &[u8], now: &[u8]) -> Option<Field> {
    let (before, now) = cdr::decode(before).ok().zip(cdr::decode(now).ok())?;
    counters(&before, &now, |name| name.starts_with(REFUSED))
}

/// The first counter by name that is different, of some.
fn counters(before: &maes_msgs::Result, now: &maes_msgs::Result, of: impl Fn(&str) -> bool) -> Option<Field> {
    let by_name = |result: &maes_msgs::Result| -> BTreeMap<String, u64> {
        let counters = result.counters.iter().filter(|counter| of(&counter.name));
        counters.map(|counter| (counter.name.clone(), counter.value)).collect()
    };
    let (before, now) = (by_name(before), by_name(now));
    let different = before.keys().chain(now.keys()).find(|name| before.get(*name) != now.get(*name))?;
    let words = |value: Option<&u64>| value.map_or_else(|| "none".to_owned(), u64::to_string);
    Some(Field {
        name: format!("counters.{different}"),
        before: words(before.get(different)),
        now: words(now.get(different)),
    })
}

#[cfg(test)]
mod tests;
