//! Who listens: what nobody can hear need not be said. A fast run could say thousands of things a second, and each costs more than
//! ten microseconds even if it is sent to nobody.
//!
//! Invariant: looking takes at most a fiftieth of the time, unless it is asked for. One look tells of all topics; it goes through all
//! readers that the middleware has heard of, some tens of microseconds in a small network, and is put off in a large one.
//!
//! A reader is known here before it can hear everything: the two ends of a topic find each other in their own time. So it has *settled*
//! only after a while, and what is to be shown to new readers from the start waits for that. Readers of other types, or that ask
//! for more than the topic offers, count as well.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use ros2_client::Context;

use super::now;
use msgs::topics::Topic;

/// Wall time between two looks.
const PERIOD: Duration = Duration::from_millis(50);

/// How many times as long as a look the time to the next one is, at the least.
const SPARINGLY: u32 = 50;

/// Wall time after which a reader can hear everything.
const SETTLING: Duration = Duration::from_millis(200);

/// The readers of some topics.
pub struct Audience {
    number_of: BTreeMap<String, usize>,
    topics: Vec<Readers>,
    next_look: Option<Instant>,
}

/// The readers of a topic.
#[derive(Default)]
struct Readers {
    /// Since when each is known, and whether it has settled; by the number that the middleware gives it.
    known: BTreeMap<[u8; 16], (Instant, bool)>,
    settled: u64,
}

impl Audience {
    /// The audience of these topics, which are numbered in this order.
    pub fn new<'a>(topics: impl IntoIterator<Item = &'a Topic>) -> Self {
        let number_of: BTreeMap<String, usize> =
            topics.into_iter().zip(0..).map(|(topic, number)| (dds_name(topic), number)).collect();
        let topics = number_of.iter().map(|_| Readers::default()).collect();
        Audience { number_of, topics, next_look: None }
    }

    /// Looks who is there, unless that was done a moment ago; says whether it has looked.
    pub fn look(&mut self, context: &Context) -> bool {
        let begun = now();
        if self.next_look.is_some_and(|next| begun < next) {
            return false;
        }
        let readers = context.domain_participant().discovered_readers();
        let there = readers.iter().map(|reader| {
            let data = &reader.subscription_topic_data;
            (data.topic_name().as_str(), reader.reader_proxy.remote_reader_guid.to_bytes())
        });
        self.note(there, begun);
        self.next_look = Some(now() + PERIOD.max(begun.elapsed() * SPARINGLY));
        true
    }

    /// Has the next look taken at once: somebody may have just come.
    pub fn look_anew(&mut self) {
        self.next_look = None;
    }

    fn note<'a>(&mut self, there: impl Iterator<Item = (&'a str, [u8; 16])>, now: Instant) {
        let mut before: Vec<_> = self.topics.iter_mut().map(|topic| std::mem::take(&mut topic.known)).collect();
        for (name, reader) in there {
            let Some(&number) = self.number_of.get(name) else { continue };
            let topic = &mut self.topics[number];
            let (since, mut has_settled) = before[number].remove(&reader).unwrap_or((now, false));
            if !has_settled && now.duration_since(since) >= SETTLING {
                has_settled = true;
                topic.settled += 1;
            }
            topic.known.insert(reader, (since, has_settled));
        }
    }

    /// Whether anybody listens to a topic.
    #[must_use]
    pub fn listens(&self, number: usize) -> bool {
        self.topics.get(number).is_some_and(|topic| !topic.known.is_empty())
    }

    /// Whether everybody who listens to any of the topics can hear everything.
    #[must_use]
    pub fn has_settled(&self) -> bool {
        self.topics.iter().flat_map(|topic| topic.known.values()).all(|&(_, has_settled)| has_settled)
    }

    /// How many readers of a topic have ever settled, if any of them is there still: more than before means that there is a new one.
    #[must_use]
    pub fn arrivals(&self, number: usize) -> Option<u64> {
        let topic = self.topics.get(number)?;
        topic.known.values().any(|&(_, has_settled)| has_settled).then_some(topic.settled)
    }
}

/// The name that ROS gives a topic in the middleware.
pub fn dds_name(topic: &Topic) -> String {
    format!("rt{}", topic.name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use msgs::topics;

    #[test]
    fn readers_come_settle_and_go() {
        let mut audience = Audience::new(&[topics::clock(), topics::map()]);
        let begun = now();
        let (one, other) = (("rt/sim/map", [1; 16]), ("rt/sim/map", [2; 16]));
        let strange = ("rt/chatter", [3; 16]);
        let mut at = |there: &[(&str, [u8; 16])], passed: u32| {
            audience.note(there.iter().copied(), begun + SETTLING * passed / 2);
            assert!(!audience.listens(0));
            (audience.listens(1), audience.has_settled(), audience.arrivals(1))
        };
        assert_eq!(at(&[one, strange], 0), (true, false, None));
        assert_eq!(at(&[one, other], 2), (true, false, Some(1)));
        assert_eq!(at(&[one, other], 3), (true, false, Some(1)));
        assert_eq!(at(&[other], 4), (true, true, Some(2)));
        assert_eq!(at(&[], 5), (false, true, None));
        // It comes back: it has to settle again, and is a new one then.
        assert_eq!(at(&[one], 6), (true, false, None));
        assert_eq!(at(&[one], 8), (true, true, Some(3)));
    }
}
