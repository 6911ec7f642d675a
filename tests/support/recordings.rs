//! Recordings as they are in the file.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use mcap::MessageStream;
use mcap::read::Options;
use msgs::cdr;
use msgs::ids::Tick;
use msgs::maes_msgs;
use serde::de::DeserializeOwned;

/// A file that a recording may replace: it begins as a recording does.
pub(crate) const OLDER_RECORDING: &[u8] = b"\x89MCAP0\r\nan older recording";

/// The messages of a recording up to its end or its damage.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Recording {
    /// In the order of the file.
    pub(crate) messages: Vec<Message>,
}

/// A message.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Message {
    pub(crate) topic: String,
    /// The tick of its stamp.
    pub(crate) tick: u64,
    /// CDR with its encapsulation header.
    pub(crate) data: Vec<u8>,
}

impl Recording {
    /// Reads a file, complete or cut.
    #[track_caller]
    pub(crate) fn read(file: &Path) -> Self {
        let bytes = std::fs::read(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        Self::from_bytes(&bytes)
    }

    /// Reads bytes, complete or cut.
    #[track_caller]
    pub(crate) fn from_bytes(bytes: &[u8]) -> Self {
        Self::parse(bytes).expect("it begins as MCAP")
    }

    /// What a file holds that is still written to, if it exists and begins as MCAP.
    pub(crate) fn read_so_far(file: &Path) -> Option<Self> {
        std::fs::read(file).ok().and_then(|bytes| Self::parse(&bytes))
    }

    fn parse(bytes: &[u8]) -> Option<Self> {
        let stream = MessageStream::new_with_options(bytes, Options::IgnoreEndMagic.into()).ok()?;
        let messages = stream.map_while(Result::ok).map(|message| {
            assert_eq!(message.log_time % Tick::TICK_NS, 0, "stamps are sim time");
            assert_eq!(message.log_time, message.publish_time);
            Message {
                topic: message.channel.topic.clone(),
                tick: message.log_time / Tick::TICK_NS,
                data: message.data.into_owned(),
            }
        });
        Some(Self { messages: messages.collect() })
    }

    /// The messages of a topic, decoded.
    pub(crate) fn of<M: DeserializeOwned>(&self, topic: &str) -> Vec<M> {
        let messages = self.messages.iter().filter(|message| message.topic == topic);
        messages.map(|message| cdr::decode(&message.data).expect("a recorded message can be decoded")).collect()
    }

    /// The result, which is the last message.
    #[track_caller]
    pub(crate) fn result(&self) -> maes_msgs::Result {
        let results = self.of("/sim/result");
        let [result] = <[maes_msgs::Result; 1]>::try_from(results).expect("there is one result");
        assert_eq!(self.messages.last().map(|message| message.topic.as_str()), Some("/sim/result"));
        result
    }

    /// The digest of the result, as it is printed.
    #[track_caller]
    pub(crate) fn result_digest(&self) -> String {
        self.result().digest.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// The digests of whole seconds, by tick.
    pub(crate) fn digests(&self) -> BTreeMap<u64, [u8; 32]> {
        let digests = self.of("/sim/digest").into_iter();
        digests
            .map(|digest: maes_msgs::Digest| (digest.tick, digest.digest))
            .filter(|(tick, _)| tick.is_multiple_of(50))
            .collect()
    }

    /// Whether these are the first messages of `whole`.
    pub(crate) fn is_beginning_of(&self, whole: &Self) -> bool {
        whole.messages.starts_with(&self.messages)
    }

    /// Fails unless the digests are the first ones of `whole`, and at least `seconds` of them.
    #[track_caller]
    pub(crate) fn assert_begins(&self, whole: &Self, seconds: usize) {
        let (part, whole) = (self.digests(), whole.digests());
        assert!(part.len() >= seconds, "{} digests, at least {seconds} were expected", part.len());
        for (tick, digest) in part {
            assert_eq!(Some(&digest), whole.get(&tick), "diverged at tick {tick}, or up to a second before");
        }
    }

    /// Describes the first difference between two recordings.
    pub(crate) fn first_difference(&self, other: &Self) -> String {
        let number = self.messages.iter().zip(&other.messages).take_while(|(one, two)| one == two).count();
        let name = |recording: &Self| {
            let message = recording.messages.get(number);
            message.map_or("nothing".to_owned(), |message| format!("{} of tick {}", message.topic, message.tick))
        };
        let counters = |recording: &Self| -> BTreeSet<(String, u64)> {
            let results = recording.of("/sim/result").into_iter();
            let counters = results.flat_map(|result: maes_msgs::Result| result.counters);
            counters.map(|counter| (counter.name, counter.value)).collect()
        };
        let (one, two) = (counters(self), counters(other));
        let (only_one, only_two): (Vec<_>, Vec<_>) = (one.difference(&two).collect(), two.difference(&one).collect());
        format!("message {number}: {} or {}; counters: {only_one:?} or {only_two:?}", name(self), name(other))
    }
}

/// The value of a counter.
#[track_caller]
pub(crate) fn counter(result: &maes_msgs::Result, name: &str) -> u64 {
    let counter = result.counters.iter().find(|counter| counter.name == name);
    counter.unwrap_or_else(|| panic!("no counter {name} in {:?}", result.counters)).value
}

/// The counters of refusals that are not zero, by name.
pub(crate) fn refusals(result: &maes_msgs::Result) -> BTreeMap<&str, u64> {
    let refusals = result.counters.iter().filter(|counter| counter.is_refusal() && counter.value > 0);
    refusals.map(|counter| (counter.name.as_str(), counter.value)).collect()
}
