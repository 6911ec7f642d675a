//! What of a recording is played: topics, times, and the scenery that it does not hold itself.

use std::collections::BTreeMap;

use msgs::cdr::Encoded;
use msgs::ids::Tick;
use msgs::topics::{self, Topic};
use thiserror::Error;

use super::Cue;
use crate::recording::{Channel, End, Recording};
use crate::setup;
use simulation::scenario::Scenario;
use simulation::visualisation;

/// What somebody wants to have played.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wishes {
    /// Names of topics, or beginnings of names with a `*` behind; none: all topics.
    pub only: Vec<String>,
    /// The same of topics that are left out.
    pub exclude: Vec<String>,
    /// Sim time from which on it is played, s.
    pub start_s: f64,
    /// Sim time up to which it is played, s, if not to its end.
    pub end_s: Option<f64>,
}

/// Why a recording cannot be played as it was wished.
#[derive(Debug, Error)]
pub enum ReplayError {
    /// There is no such time.
    #[error("--start {0}: expected seconds of sim time, at least 0")]
    Start(f64),
    /// The end is not behind the start.
    #[error("--end {end_s}: expected seconds of sim time, more than --start, which is {start_s}")]
    End {
        /// What was wished, s.
        end_s: f64,
        /// From which time on, s.
        start_s: f64,
    },
    /// Nothing was recorded in that time.
    #[error("{file}: no tick from {start_s} s on{}: it goes up to {last_s} s", up_to(.end_s))]
    NoTick {
        /// The recording.
        file: String,
        /// From which time on, s.
        start_s: f64,
        /// Up to which time, s.
        end_s: Option<f64>,
        /// Its end, s.
        last_s: f64,
    },
    /// No topic has that name.
    #[error("{flag} {pattern}: no such topic in {file}, which has {}", topics.join(", "))]
    NoTopic {
        /// What the user typed.
        flag: &'static str,
        /// The name.
        pattern: String,
        /// The recording.
        file: String,
        /// The topics that there are.
        topics: Vec<String>,
    },
    /// Nothing is left.
    #[error("{0}: no message of it is to be played")]
    Nothing(String),
}

fn up_to(end_s: &Option<f64>) -> String {
    end_s.map_or_else(String::new, |end_s| format!(" up to {end_s} s"))
}

/// What is played, and what people should know of it.
#[derive(Debug)]
pub struct Programme {
    topics: Vec<Topic>,
    number_of: BTreeMap<String, usize>,
    scenery: Vec<Cue>,
    first: Tick,
    last: Tick,
    notes: Vec<String>,
}

impl Programme {
    /// Looks through a recording for what is to be played.
    ///
    /// # Errors
    /// If nothing would be, or a wish makes no sense.
    pub fn new(recording: &Recording, wishes: &Wishes) -> Result<Self, ReplayError> {
        let start_s = wishes.start_s;
        if !(start_s.is_finite() && start_s >= 0.0) {
            return Err(ReplayError::Start(start_s));
        }
        if let Some(end_s) = wishes.end_s.filter(|end_s| !(end_s.is_finite() && *end_s > start_s)) {
            return Err(ReplayError::End { end_s, start_s });
        }
        let mut found = Found::of(recording);
        let Some(last_there) = found.last else { return Err(ReplayError::Nothing(recording.file().to_owned())) };
        let first = Tick(nanoseconds(start_s).div_ceil(Tick::TICK_NS));
        let last = wishes.end_s.map_or(last_there, |end_s| Tick(nanoseconds(end_s) / Tick::TICK_NS).min(last_there));
        if first > last {
            let (end_s, last_s) = (wishes.end_s, seconds(last_there));
            return Err(ReplayError::NoTick { file: recording.file().to_owned(), start_s, end_s, last_s });
        }
        let made = found.add_scenery(recording);
        found.keep(recording, wishes)?;
        let topics: Vec<Topic> = found.topics.into_values().collect();
        let number_of: BTreeMap<_, _> = topics.iter().map(|topic| topic.name.clone()).zip(0..).collect();
        let scenery = made.into_iter().filter_map(|(name, message)| {
            let topic = *number_of.get(&name)?;
            Some(Cue { topic, message })
        });
        Ok(Self { scenery: scenery.collect(), topics, number_of, first, last, notes: found.notes })
    }

    /// The topics, by their numbers.
    #[must_use]
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// The first and the last tick.
    #[must_use]
    pub fn ticks(&self) -> (Tick, Tick) {
        (self.first, self.last)
    }

    /// What people should know: what is not played, and why.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The number of a topic, if it is played.
    pub(super) fn number_of(&self, channel: &Channel) -> Option<usize> {
        let number = *self.number_of.get(&channel.topic)?;
        is_of_type(&self.topics[number], channel).then_some(number)
    }

    /// What is said before everything else, although it does not stand in the recording.
    pub(super) fn scenery(&self) -> &[Cue] {
        &self.scenery
    }
}

fn seconds(tick: Tick) -> f64 {
    tick.time_ns() as f64 / 1e9
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

fn is_of_type(topic: &Topic, channel: &Channel) -> bool {
    topic.message.to_string() == channel.type_name
}

/// What stands in a recording.
struct Found {
    /// By name, those that can be played.
    topics: BTreeMap<String, Topic>,
    last: Option<Tick>,
    notes: Vec<String>,
}

impl Found {
    fn of(recording: &Recording) -> Self {
        let mut found = Self { topics: BTreeMap::new(), last: None, notes: Vec::new() };
        let mut refused: BTreeMap<String, (u64, String)> = BTreeMap::new();
        let mut messages = recording.messages();
        for message in &mut messages {
            found.last = found.last.max(Some(message.tick()));
            let name = &message.channel.topic;
            let wrong = match found.topics.get(name).cloned().or_else(|| topics::named(name)) {
                None => "no topic of a run".to_owned(),
                Some(topic) if !is_of_type(&topic, &message.channel) => {
                    format!("its type is {}, not {}", message.channel.type_name, topic.message)
                }
                Some(topic) => {
                    found.topics.entry(name.clone()).or_insert(topic);
                    match Encoded::new(&message.data) {
                        Ok(_) => continue,
                        Err(error) => error.to_string(),
                    }
                }
            };
            refused.entry(name.clone()).or_insert((0, wrong)).0 += 1;
        }
        let told = refused.iter().map(|(name, (count, wrong))| format!("{name}: {count} not played: {wrong}"));
        found.notes.extend(told);
        if let Some(end @ (End::Missing | End::CutOff { .. } | End::Damage { .. })) = messages.end() {
            let last_s = seconds(found.last.unwrap_or_default());
            found.notes.push(format!("{} is {end}; it can be played up to {last_s} s", recording.file()));
        }
        found
    }

    /// Makes what does not change in the run, and what the recording does not hold, so that there is always a cave to look at.
    fn add_scenery(&mut self, recording: &Recording) -> Vec<(String, Encoded)> {
        let lacks = |topic: Topic| !self.topics.contains_key(&topic.name);
        if !lacks(topics::map()) && !lacks(topics::tf_static()) {
            return Vec::new();
        }
        let pictures = match scenery(recording) {
            Ok(pictures) => pictures,
            Err(error) => {
                self.notes.push(format!("{}: there is no map to look at: {error}", recording.file()));
                return Vec::new();
            }
        };
        let mut made = Vec::new();
        for (topic, picture) in pictures.into_iter().map(|(view, picture)| (view.topic(), picture)) {
            if lacks(topic.clone()) {
                made.push((topic, Encoded::of(&picture)));
            }
        }
        self.topics.extend(made.iter().map(|(topic, _)| (topic.name.clone(), topic.clone())));
        made.into_iter().map(|(topic, message)| (topic.name, message)).collect()
    }

    /// Leaves out what nobody wants.
    fn keep(&mut self, recording: &Recording, wishes: &Wishes) -> Result<(), ReplayError> {
        for (flag, patterns) in [("--topics", &wishes.only), ("--exclude", &wishes.exclude)] {
            let is_there = |pattern: &&String| self.topics.keys().any(|name| fits(pattern, name));
            if let Some(pattern) = patterns.iter().find(|pattern| !is_there(pattern)) {
                let topics = self.topics.keys().cloned().collect();
                let (pattern, file) = (pattern.clone(), recording.file().to_owned());
                return Err(ReplayError::NoTopic { flag, pattern, file, topics });
            }
        }
        let any = |patterns: &[String], name: &str| patterns.iter().any(|pattern| fits(pattern, name));
        self.topics
            .retain(|name, _| (wishes.only.is_empty() || any(&wishes.only, name)) && !any(&wishes.exclude, name));
        if self.topics.is_empty() { Err(ReplayError::Nothing(recording.file().to_owned())) } else { Ok(()) }
    }
}

fn fits(pattern: &str, name: &str) -> bool {
    pattern.strip_suffix('*').map_or(pattern == name, |beginning| name.starts_with(beginning))
}

fn scenery(recording: &Recording) -> anyhow::Result<visualisation::VisualisationMessages> {
    let scenario = Scenario::parse(setup::SCENARIO_ATTACHMENT, &recording.scenario(), &[])?;
    let map = setup::recorded_map(recording, &scenario)?.ok_or_else(|| anyhow::anyhow!("it has no attachment"))?;
    Ok(visualisation::static_messages(&map, scenario.agents.count))
}
