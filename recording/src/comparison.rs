//! Comparison of two runs: tick by tick and message by message, up to the first difference.
//!
//! **What is ignored.** Visualisation messages (`[views]` of a scenario selects which are recorded)
//! depend on observers, and so do the transforms that precede them; the refusal counters of a
//! result depend on foreign traffic; none of them belongs to the run. Everything else is compared
//! bitwise.
//!
//! **Order.** Tools that rewrite recordings keep the order of times, and of the messages of a
//! topic, but not always that of topics within a tick. Neither does it belong to the run.
//!
//! Invariants: nothing behind the first difference is compared; what a recording without an end
//! does not hold is no difference.
//!
//! This module knows no world, and reads no file.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::sync::LazyLock;

use msgs::cdr;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{self, Counter};
use msgs::tf2_msgs::TFMessage;
use msgs::topics::{self, Topic};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::difference::{self, Field};
use crate::{End, Message, Messages, Recording};
use simulation::digest::Digest;
use simulation::scenario::RecordingSection;

/// Field name of a difference between whole messages.
const WHOLE_MESSAGE: &str = "the message";

/// Text for a missing message.
const NONE: &str = "none";

/// Where two runs differ.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    pub tick: Tick,
    /// The agent, if it is the topic of an agent.
    pub agent: Option<AgentId>,
    pub topic: String,
    /// The field with its two values, or the whole message.
    pub field: Field,
}

impl Difference {
    fn new(place: &MessagePosition<'_>, field: Field) -> Self {
        let agent = topics::split(place.topic).map(|(agent, _)| agent);
        Self { tick: place.tick, agent, topic: place.topic.to_owned(), field }
    }

    /// Whether the other run lacks a message of the recording.
    #[must_use]
    pub fn is_lack(&self) -> bool {
        self.field.name == WHOLE_MESSAGE && self.field.now == NONE
    }

    /// Tick, agent and topic.
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

/// Position of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct MessagePosition<'a> {
    tick: Tick,
    topic: &'a str,
}

impl fmt::Display for MessagePosition<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of tick {}", self.topic, self.tick)
    }
}

/// A checker of everything that a run writes, in order.
pub trait Checker {
    /// Checks a message, given as CDR with its encapsulation header.
    fn take(&mut self, topic: &str, tick: Tick, cdr: &[u8]);
    /// Whether a difference was found, so that the rest of the run need not be executed.
    fn is_done(&self) -> bool;
    /// Stops checking: later messages are ignored.
    fn close(&mut self);
}

/// Compares the messages of a run with a recording.
pub struct Comparison<'a> {
    before: Messages<'a>,
    /// Messages of the present tick of the recording that are still to come in the run.
    of_tick: VecDeque<Message>,
    /// The first message of a later tick.
    ahead: Option<Message>,
    compared: u64,
    /// Messages of the recording on topics of the run that do not belong to it.
    left_out: u64,
    last_tick: Tick,
    found: Option<Difference>,
    refusals: Option<Field>,
    is_closed: bool,
    ignores_stages: bool,
    /// Ticks between two messages of the run on `/tf`; 0: it has none.
    poses_period_ticks: u64,
}

impl<'a> Comparison<'a> {
    /// Starts at the beginning of a recording.
    #[must_use]
    pub fn new(recording: &'a Recording) -> Self {
        let before = recording.messages_on(is_of_run);
        Self {
            before,
            of_tick: VecDeque::new(),
            ahead: None,
            compared: 0,
            left_out: 0,
            last_tick: Tick::ZERO,
            found: None,
            refusals: None,
            is_closed: false,
            ignores_stages: false,
            poses_period_ticks: poses_period_ticks(&recording.scenario()),
        }
    }

    /// Without the stages of commands, which recordings of earlier builds do not have.
    #[must_use]
    pub fn without_stages(self) -> Self {
        Self { ignores_stages: true, ..self }
    }

    /// Number of equal messages.
    #[must_use]
    pub fn compared(&self) -> u64 {
        self.compared
    }

    /// Number of messages so far that are there for observers and were not compared.
    #[must_use]
    pub fn left_out(&self) -> u64 {
        self.left_out + self.before.left_out()
    }

    /// Tick of the last equal message.
    #[must_use]
    pub fn last_tick(&self) -> Tick {
        self.last_tick
    }

    /// The first difference found so far.
    #[must_use]
    pub fn difference(&self) -> Option<&Difference> {
        self.found.as_ref()
    }

    /// The first refusal counter that differs, which is no difference of the run.
    #[must_use]
    pub fn refusals(&self) -> Option<&Field> {
        self.refusals.as_ref()
    }

    /// Whether the recording ended, without an end record, before the run did.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// Ends the run: further messages of the recording are a difference.
    pub fn end(&mut self) {
        if !self.is_done()
            && let Some(message) = self.next(None)
        {
            let place = place(&message);
            self.found = Some(message_difference(&place, Some(place), None));
        }
    }

    /// The next message of the recording that belongs to the run: the one of this place if its tick
    /// has one.
    fn next(&mut self, wanted: Option<MessagePosition<'_>>) -> Option<Message> {
        if self.of_tick.is_empty() {
            self.of_tick.extend(self.ahead.take());
            let period = self.poses_period_ticks;
            let left_out = &mut self.left_out;
            let mut is_of_run = |message: &Message| {
                let is_of_run = belongs_to_run(message, period);
                *left_out += u64::from(!is_of_run);
                is_of_run
            };
            while let Some(message) = self.before.find(&mut is_of_run) {
                if self.of_tick.front().is_some_and(|first| first.tick() != message.tick()) {
                    self.ahead = Some(message);
                    break;
                }
                self.of_tick.push_back(message);
            }
        }
        let at = self.of_tick.iter().position(|message| Some(place(message)) == wanted);
        self.of_tick.remove(at.unwrap_or_default())
    }

    /// Whether the recording ends, without an end record, in the present tick.
    fn is_cut_in_tick(&self) -> bool {
        self.ahead.is_none() && self.before.end().is_some_and(|end| *end != End::Whole)
    }
}

impl Checker for Comparison<'_> {
    fn take(&mut self, topic: &str, tick: Tick, cdr: &[u8]) {
        let Some(kind) = MessageKind::of(topic) else { return };
        if self.is_done() || !kind.is_of_run(tick, cdr, self.poses_period_ticks) {
            return;
        }
        let now = MessagePosition { tick, topic };
        let Some(message) = self.next(Some(now)) else {
            match self.before.end() {
                Some(End::Whole) => self.found = Some(message_difference(&now, None, Some(now))),
                _ => self.close(),
            }
            return;
        };
        let before = place(&message);
        if before.tick == now.tick && before != now && self.is_cut_in_tick() {
            self.close();
            return;
        }
        if before != now {
            let first = if before.tick <= now.tick { before } else { now };
            self.found = Some(message_difference(&first, Some(before), Some(now)));
            return;
        }
        let is_same = if self.ignores_stages && kind == MessageKind::Command {
            digested(&message.data) == digested(cdr)
        } else {
            message.data == cdr
        };
        if !is_same {
            if kind == MessageKind::Result {
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

/// The difference between a recorded command and the present one, if any. A recorded command that
/// names no stage may be of an earlier build, or of a run that has continued such a recording: then
/// the present one may name one.
#[must_use]
pub fn compare_command(recorded: &Message, now: Option<&maes_msgs::Command>) -> Option<Difference> {
    let place = place(recorded);
    let Some(now) = now else { return Some(message_difference(&place, Some(place), None)) };
    let names_stage = !recorded.data.ends_with(&[maes_msgs::Command::SAME; maes_msgs::Command::UNDIGESTED_BYTES]);
    let stage = if names_stage { now.stage } else { maes_msgs::Command::SAME };
    let now = cdr::encode(&maes_msgs::Command { stage, ..now.clone() });
    let field = (recorded.data != now).then(|| MessageKind::Command.between(&recorded.data, &now)).flatten();
    field.map(|field| Difference::new(&place, field))
}

/// The bytes of a command that the digest covers.
fn digested(command: &[u8]) -> &[u8] {
    &command[..command.len().saturating_sub(maes_msgs::Command::UNDIGESTED_BYTES)]
}

fn place(message: &Message) -> MessagePosition<'_> {
    MessagePosition { tick: message.tick(), topic: &message.channel.topic }
}

/// A difference between whole messages.
fn message_difference(
    at: &MessagePosition<'_>,
    before: Option<MessagePosition<'_>>,
    now: Option<MessagePosition<'_>>,
) -> Difference {
    let text = |place: Option<MessagePosition<'_>>| place.map_or_else(|| NONE.to_owned(), |place| place.to_string());
    Difference::new(at, Field { name: WHOLE_MESSAGE.to_owned(), before: text(before), now: text(now) })
}

/// Ticks between two messages of a run on `/tf`, by its scenario.
fn poses_period_ticks(scenario: &str) -> u64 {
    let default = RecordingSection::default().poses_period_ticks.into();
    let Ok(table) = scenario.parse::<toml::Table>() else { return default };
    let section = table.get("recording").and_then(toml::Value::as_table);
    let period = section.and_then(|section| section.get("poses_period_ticks")).and_then(toml::Value::as_integer);
    period.and_then(|period| u64::try_from(period).ok()).unwrap_or(default)
}

/// Whether a message belongs to the run, and is not there for observers alone.
fn belongs_to_run(message: &Message, poses_period_ticks: u64) -> bool {
    MessageKind::of(&message.channel.topic)
        .is_some_and(|kind| kind.is_of_run(message.tick(), &message.data, poses_period_ticks))
}

/// Whether the messages of a topic belong to the run.
#[must_use]
pub fn is_of_run(topic: &str) -> bool {
    MessageKind::of(topic).is_some()
}

/// The kinds of messages that belong to the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum MessageKind {
    Scenario,
    Progress,
    Digest,
    Result,
    Transforms,
    Intervention,
    MapChange,
    Join,
    Observation,
    Command,
}

impl MessageKind {
    /// The kind of a topic's messages, if they belong to the run.
    fn of(topic: &str) -> Option<Self> {
        if let Some((_, rest)) = topics::split(topic) {
            return match rest {
                "observation" => Some(Self::Observation),
                "command" => Some(Self::Command),
                "join" => Some(Self::Join),
                _ => None,
            };
        }
        // Kept, because each message of a file is looked up.
        static OF_SIM: LazyLock<[(Topic, MessageKind); 7]> = LazyLock::new(|| {
            [
                (topics::tf(), MessageKind::Transforms),
                (topics::digest(), MessageKind::Digest),
                (topics::progress(), MessageKind::Progress),
                (topics::intervention(), MessageKind::Intervention),
                (topics::map_change(), MessageKind::MapChange),
                (topics::scenario(), MessageKind::Scenario),
                (topics::result(), MessageKind::Result),
            ]
        });
        OF_SIM.iter().find_map(|(known, kind)| (known.name == topic).then_some(*kind))
    }

    /// Whether a message of the kind belongs to the run, whose recording has all poses every
    /// `poses_period_ticks`: other transforms, and those of scans, which have an earlier stamp, are
    /// there for visualisation messages.
    fn is_of_run(self, tick: Tick, cdr: &[u8], poses_period_ticks: u64) -> bool {
        if self != Self::Transforms {
            return true;
        }
        if poses_period_ticks == 0 || !tick.0.is_multiple_of(poses_period_ticks) {
            return false;
        }
        let Ok(TFMessage { transforms }) = cdr::decode(cdr) else { return true };
        transforms.first().is_none_or(|first| first.header.stamp == tick.into())
    }

    /// The first field that differs.
    fn between(self, before: &[u8], now: &[u8]) -> Option<Field> {
        match self {
            Self::Scenario => decoded(before, now, fields::<maes_msgs::Scenario>),
            Self::Progress => decoded(before, now, fields::<maes_msgs::Progress>),
            Self::Digest => decoded(before, now, between_digests),
            Self::Result => decoded(before, now, between_results),
            Self::Transforms => decoded(before, now, fields::<TFMessage>),
            Self::Intervention => decoded(before, now, fields::<maes_msgs::Intervention>),
            Self::MapChange => decoded(before, now, fields::<maes_msgs::MapChange>),
            Self::Join => decoded(before, now, fields::<maes_msgs::Join>),
            Self::Observation => decoded(before, now, fields::<maes_msgs::Observation>),
            Self::Command => decoded(before, now, fields::<maes_msgs::Command>),
        }
    }
}

/// The first difference of two messages with different bytes.
fn decoded<M: DeserializeOwned>(
    before: &[u8],
    now: &[u8],
    between: impl FnOnce(&M, &M) -> Option<Field>,
) -> Option<Field> {
    match (cdr::decode::<M>(before), cdr::decode::<M>(now)) {
        (Ok(before), Ok(now)) => between(&before, &now),
        (of_before, of_now) => {
            let text = |bytes: &[u8], is_sound| {
                let sound = if is_sound { "" } else { " that cannot be decoded" };
                format!("{} bytes{sound}", bytes.len())
            };
            let (before, now) = (text(before, of_before.is_ok()), text(now, of_now.is_ok()));
            Some(Field { name: WHOLE_MESSAGE.to_owned(), before, now })
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
    let text = |digest| Digest(digest).to_string();
    (before != now).then(|| Field { name: "digest".to_owned(), before: text(before), now: text(now) })
}

/// Ignores the refusal counters.
fn between_results(before: &maes_msgs::Result, now: &maes_msgs::Result) -> Option<Field> {
    let rest =
        |result: &maes_msgs::Result| maes_msgs::Result { counters: Vec::new(), digest: [0; 32], ..result.clone() };
    difference::between(&rest(before), &rest(now))
        .or_else(|| counters(before, now, |counter| !counter.is_refusal()))
        .or_else(|| hashes(before.digest, now.digest))
}

fn between_refusals(before: &[u8], now: &[u8]) -> Option<Field> {
    let (before, now) = cdr::decode(before).ok().zip(cdr::decode(now).ok())?;
    counters(&before, &now, Counter::is_refusal)
}

/// The first counter by its present name that differs, among those that `of` selects.
fn counters(before: &maes_msgs::Result, now: &maes_msgs::Result, of: impl Fn(&Counter) -> bool) -> Option<Field> {
    let by_name = |result: &maes_msgs::Result| -> BTreeMap<String, u64> {
        let counters = result.counters.iter().filter(|counter| of(counter));
        counters.map(|counter| (counter.present_name(), counter.value)).collect()
    };
    let (before, now) = (by_name(before), by_name(now));
    let different = before.keys().chain(now.keys()).find(|name| before.get(*name) != now.get(*name))?;
    let text = |value: Option<&u64>| value.map_or_else(|| "none".to_owned(), u64::to_string);
    Some(Field {
        name: format!("counters.{different}"),
        before: text(before.get(different)),
        now: text(now.get(different)),
    })
}

#[cfg(test)]
mod tests;
