//! Selection of topics and ticks of a recording, with static messages that it lacks.

use std::collections::{BTreeMap, BTreeSet};

use msgs::cdr::Encoded;
use msgs::ids::{AgentId, Tick};
use msgs::message;
use msgs::topics::{self, Qos, Topic};
use thiserror::Error;

use super::ScheduledMessage;
use crate::map;
use crate::{Channel, End, Message, Recording, SCENARIO_ATTACHMENT};
use simulation::scenario::Scenario;
use simulation::visualisation::{self, StaticFrames};

/// Longest sim time without a message that is played; a longer gap is skipped. A recording has a
/// digest in every second.
const GAP_TICKS_MAX: u64 = 500;

/// Largest messages in all that are sorted, bytes: a recording may be longer than the memory.
const SORTED_BYTES_MAX: u64 = 1 << 30;

/// Samples kept of topics that other programs have added, the default of ROS.
const ADDED_DEPTH: u32 = 10;

/// The user's selection of topics and time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlaybackOptions {
    /// Topic names, or prefixes followed by `*`; all topics if empty.
    pub only: Vec<String>,
    /// Topics to leave out, in the same form.
    pub exclude: Vec<String>,
    /// Start, sim time in s.
    pub start_s: f64,
    /// End, sim time in s; the end of the recording if `None`.
    pub end_s: Option<f64>,
}

/// Why a recording cannot be played as requested.
#[derive(Debug, Error)]
pub enum ReplayError {
    /// The start is no time.
    #[error("--start {0}: expected seconds of sim time, at least 0")]
    Start(f64),
    /// The end is not after the start.
    #[error("--end {end_s}: expected seconds of sim time, more than --start, which is {start_s}")]
    End { end_s: f64, start_s: f64 },
    /// The recording has no tick in that interval.
    #[error("{file}: no tick from {start_s} s on{}: the recording ends at {last_s} s", up_to(.end_s))]
    NoTick { file: String, start_s: f64, end_s: Option<f64>, last_s: f64 },
    /// No topic matches.
    #[error("{flag} {pattern}: no such topic in {file}, which has {}", topics.join(", "))]
    NoTopic {
        /// The flag that names the topic.
        flag: &'static str,
        pattern: String,
        file: String,
        topics: Vec<String>,
    },
    /// The messages of a matching topic cannot be played.
    #[error("{flag} {pattern}: in {file}, but not played: {wrong}")]
    Unplayable { flag: &'static str, pattern: String, file: String, wrong: String },
    /// The messages are in another order than that of their times, and too many to be sorted.
    #[error(
        "{file}: its messages are not in the order of their log times, and with {bytes} bytes too many to sort, \
         allowed are {SORTED_BYTES_MAX}; sort the file by them first"
    )]
    Disorder { file: String, bytes: u64 },
    /// No message is left.
    #[error("{0}: no message is left to play")]
    Nothing(String),
}

fn up_to(end_s: &Option<f64>) -> String {
    end_s.map_or_else(String::new, |end_s| format!(" up to {end_s} s"))
}

/// What is played, with notes for the user.
#[derive(Debug)]
pub struct PlaybackSchedule {
    topics: Vec<Topic>,
    number_of: BTreeMap<String, usize>,
    static_messages: Vec<ScheduledMessage>,
    first: Tick,
    last: Tick,
    /// Later stamps are not played.
    latest: Tick,
    gaps: Vec<Gap>,
    /// Whether the messages are in the order of their ticks.
    is_sorted: bool,
    notes: Vec<String>,
}

/// Ticks without a message that are skipped: those between two others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Gap {
    /// The last tick before it.
    pub(super) from: Tick,
    /// The first tick after it.
    pub(super) to: Tick,
}

impl PlaybackSchedule {
    /// Indexes a recording.
    ///
    /// # Errors
    /// If nothing is left to play or an option is not legal.
    pub fn new(recording: &Recording, options: &PlaybackOptions) -> Result<Self, ReplayError> {
        let start_s = options.start_s;
        if !(start_s.is_finite() && start_s >= 0.0) {
            return Err(ReplayError::Start(start_s));
        }
        if let Some(end_s) = options.end_s.filter(|end_s| !(end_s.is_finite() && *end_s > start_s)) {
            return Err(ReplayError::End { end_s, start_s });
        }
        let scenario = scenario_of(recording);
        let latest = scenario.as_ref().map_or(Tick(u64::MAX), Scenario::duration_ticks);
        let mut index = RecordingIndex::of(recording, latest);
        if !index.is_sorted && index.bytes > SORTED_BYTES_MAX {
            return Err(ReplayError::Disorder { file: recording.file().to_owned(), bytes: index.bytes });
        }
        let Some(&last_there) = index.ticks.last() else {
            return Err(ReplayError::Nothing(recording.file().to_owned()));
        };
        let first = Tick(nanoseconds(start_s).div_ceil(Tick::TICK_NS));
        let last = options.end_s.map_or(last_there, |end_s| Tick(nanoseconds(end_s) / Tick::TICK_NS).min(last_there));
        if first > last {
            let (end_s, last_s) = (options.end_s, seconds(last_there));
            return Err(ReplayError::NoTick { file: recording.file().to_owned(), start_s, end_s, last_s });
        }
        let made = index.add_static_messages(recording, scenario);
        index.select(recording, options)?;
        let topics: Vec<Topic> = index.topics.into_values().collect();
        let number_of: BTreeMap<_, _> = topics.iter().map(|topic| topic.name.clone()).zip(0..).collect();
        let static_messages = made.into_iter().filter_map(|(name, message)| {
            let topic = *number_of.get(&name)?;
            Some(ScheduledMessage { topic, message })
        });
        let static_messages = static_messages.collect();
        // A gap may lie before the first message.
        let ticks: Vec<Tick> = std::iter::once(Tick::ZERO).chain(index.ticks).collect();
        let pairs = ticks.windows(2).map(|pair| Gap { from: pair[0], to: pair[1] });
        let gaps = pairs.filter(|gap| gap.to.0 - gap.from.0 > GAP_TICKS_MAX).collect();
        let (is_sorted, notes) = (index.is_sorted, index.notes);
        Ok(Self { static_messages, topics, number_of, first, last, latest, gaps, is_sorted, notes })
    }

    /// The topics, by index.
    #[must_use]
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// The first and the last tick.
    #[must_use]
    pub fn ticks(&self) -> (Tick, Tick) {
        (self.first, self.last)
    }

    /// The gaps that are skipped, in order.
    pub(super) fn gaps(&self) -> &[Gap] {
        &self.gaps
    }

    /// Whether the messages of the file are in the order of their ticks.
    pub(super) fn is_sorted(&self) -> bool {
        self.is_sorted
    }

    /// Whether a message is stamped after the run's duration, so that it is not played.
    pub(super) fn is_too_late(&self, message: &Message) -> bool {
        message.tick() > self.latest
    }

    /// Notes for the user: what is not played, and why.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Index of a channel's topic, if it is played.
    pub(super) fn number_of(&self, channel: &Channel) -> Option<usize> {
        let number = *self.number_of.get(&channel.topic)?;
        is_of_type(&self.topics[number], channel).then_some(number)
    }

    /// Messages made from the map that precede all others.
    pub(super) fn static_messages(&self) -> &[ScheduledMessage] {
        &self.static_messages
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

/// The playable topics of a recording.
struct RecordingIndex {
    /// Playable topics by name.
    topics: BTreeMap<String, Topic>,
    /// The number of messages that cannot be played, by topic, with the reason of the first.
    refused: BTreeMap<String, (u64, String)>,
    /// The ticks with messages.
    ticks: BTreeSet<Tick>,
    is_sorted: bool,
    /// Of all messages.
    bytes: u64,
    notes: Vec<String>,
}

impl RecordingIndex {
    /// The messages up to the tick `latest`.
    fn of(recording: &Recording, latest: Tick) -> Self {
        let mut index = Self {
            topics: BTreeMap::new(),
            refused: BTreeMap::new(),
            ticks: BTreeSet::new(),
            is_sorted: true,
            bytes: 0,
            notes: Vec::new(),
        };
        let mut messages = recording.messages();
        for message in &mut messages {
            let name = &message.channel.topic;
            if message.tick() > latest {
                let wrong = format!("stamped after {} s, the duration of its run", seconds(latest));
                index.refused.entry(name.clone()).or_insert((0, wrong)).0 += 1;
                continue;
            }
            index.reach(&message);
            if *name == topics::clock().name {
                // The replay has a clock of its own.
                continue;
            }
            let known = index.topics.get(name).cloned().or_else(|| topics::named(name));
            let wrong = match known.map_or_else(|| added(&message.channel), Ok) {
                Err(wrong) => wrong,
                Ok(topic) if !is_of_type(&topic, &message.channel) => {
                    format!("its type is {}, not {}", message.channel.type_name, topic.message)
                }
                Ok(topic) => {
                    index.topics.entry(name.clone()).or_insert(topic);
                    match Encoded::new(&message.data) {
                        Ok(_) => continue,
                        Err(error) => error.to_string(),
                    }
                }
            };
            index.refused.entry(name.clone()).or_insert((0, wrong)).0 += 1;
        }
        if !index.is_sorted {
            let text = "the messages are not in the order of their log times; they are played in that order";
            index.notes.push(format!("{}: {text}", recording.file()));
        }
        let notes = index.refused.iter().map(|(name, (count, wrong))| format!("{name}: {count} not played: {wrong}"));
        index.notes.extend(notes);
        if let Some(end @ (End::Missing | End::CutOff { .. } | End::Damage { .. })) = messages.end() {
            let last_s = seconds(index.ticks.last().copied().unwrap_or_default());
            index.notes.push(format!("{} is {end}; it can be played up to {last_s} s", recording.file()));
        }
        index
    }

    /// Counts a message that may be played.
    fn reach(&mut self, message: &Message) {
        let tick = message.tick();
        self.is_sorted &= self.ticks.last().is_none_or(|&last| last <= tick);
        self.ticks.insert(tick);
        self.bytes += message.data.len() as u64;
    }

    /// Makes the static messages (walls, transforms) that the recording lacks, so that there is
    /// always a map to see.
    fn add_static_messages(
        &mut self,
        recording: &Recording,
        scenario: anyhow::Result<Scenario>,
    ) -> Vec<(String, Encoded)> {
        let lacks = |topic: Topic| !self.topics.contains_key(&topic.name);
        if !lacks(topics::map()) && !lacks(topics::tf_static()) {
            return Vec::new();
        }
        let pictures = match static_messages(recording, scenario) {
            Ok(pictures) => pictures,
            Err(error) => {
                self.notes.push(format!("{}: no map to show: {error}", recording.file()));
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

    /// Applies the user's selection of topics.
    fn select(&mut self, recording: &Recording, options: &PlaybackOptions) -> Result<(), ReplayError> {
        for (flag, patterns) in [("--topics", &options.only), ("--exclude", &options.exclude)] {
            let is_there = |pattern: &&String| self.topics.keys().any(|name| fits(pattern, name));
            for pattern in patterns.iter().filter(|pattern| !is_there(pattern)) {
                if let Some((_, (_, wrong))) = self.refused.iter().find(|(name, _)| fits(pattern, name)) {
                    if flag == "--exclude" {
                        continue;
                    }
                    let (pattern, file, wrong) = (pattern.clone(), recording.file().to_owned(), wrong.clone());
                    return Err(ReplayError::Unplayable { flag, pattern, file, wrong });
                }
                let topics = self.topics.keys().cloned().collect();
                let (pattern, file) = (pattern.clone(), recording.file().to_owned());
                return Err(ReplayError::NoTopic { flag, pattern, file, topics });
            }
        }
        let any = |patterns: &[String], name: &str| patterns.iter().any(|pattern| fits(pattern, name));
        self.topics
            .retain(|name, _| (options.only.is_empty() || any(&options.only, name)) && !any(&options.exclude, name));
        if self.topics.is_empty() { Err(ReplayError::Nothing(recording.file().to_owned())) } else { Ok(()) }
    }
}

/// The topic of a channel that another program has added, or why it cannot be played.
fn added(channel: &Channel) -> Result<Topic, String> {
    let is_legal = |part: &str| {
        part.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
            && part.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
    };
    let has_legal_name = channel.topic.strip_prefix('/').is_some_and(|name| name.split('/').all(is_legal));
    if !has_legal_name {
        return Err("not a name of a ROS topic".to_owned());
    }
    let known = message::ALL.iter().copied().find(|message| message.to_string() == channel.type_name);
    let message = known.ok_or_else(|| {
        format!("not a topic of a run, and of another type, {}; `ros2 bag play` plays it", channel.type_name)
    })?;
    let is_latched =
        ["durability: 1", "durability: transient_local"].iter().any(|key| channel.offered_qos.contains(key));
    let qos = if is_latched { Qos::latched(ADDED_DEPTH) } else { Qos::reliable(ADDED_DEPTH) };
    Ok(Topic { name: channel.topic.clone(), message, qos })
}

fn fits(pattern: &str, name: &str) -> bool {
    pattern.strip_suffix('*').map_or(pattern == name, |beginning| name.starts_with(beginning))
}

fn scenario_of(recording: &Recording) -> anyhow::Result<Scenario> {
    if recording.attachment(SCENARIO_ATTACHMENT).is_none() {
        anyhow::bail!("its attachments are missing, because another program has written it again without them");
    }
    Ok(Scenario::parse(SCENARIO_ATTACHMENT, &recording.scenario(), &[])?)
}

fn static_messages(
    recording: &Recording,
    scenario: anyhow::Result<Scenario>,
) -> anyhow::Result<visualisation::VisualisationMessages> {
    let scenario = scenario?;
    let map = map::read(recording, &scenario)?.ok_or_else(|| anyhow::anyhow!("the recording has no map"))?;
    let places = |agent| {
        let lidars = scenario.lidars_of(AgentId(agent));
        lidars.map(|(name, lidar)| (name, lidar.place_on_body())).collect()
    };
    let frames = StaticFrames {
        lidars: (0..scenario.agents.count).map(places).collect(),
        has_drift: !scenario.localisation.noise(scenario.seed).is_exact(),
    };
    Ok(visualisation::static_messages(&map, &frames))
}
