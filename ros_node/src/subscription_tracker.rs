//! Tracking of the remote subscriptions of some topics, so that messages without a reader need not
//! be published. A fast run could publish thousands of messages per second, and each costs more
//! than ten microseconds even without a reader.
//!
//! Invariant: polling takes at most a fiftieth of the time, unless it is requested. One poll covers
//! all topics; it goes through every reader that the middleware has discovered, which takes tens of
//! microseconds in a small network, is done less often in a large one, and only now and then while
//! the middleware reports no discovery: a hundred processes that poll have two cores between them.
//!
//! A reader is discovered before it is matched: the two ends of a topic find each other at their
//! own pace. It counts as *settled* only after a while, and messages for new readers wait for that.
//! Readers with another type or incompatible QoS count as well.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use super::dds;
use super::inbox::participant_of;
use super::network::{Context, Network};
use super::unix_sockets::Connected;
use msgs::topics::Topic;
use system::wall_clock::now;

/// Minimum wall time between two polls.
const POLL_PERIOD: Duration = Duration::from_millis(50);

/// Minimum ratio of the time between two polls to the duration of a poll.
const POLL_COST_FACTOR: u32 = 50;

/// Greatest wall time between two polls while nothing is discovered, in case that an event was
/// lost.
const QUIET_PERIOD: Duration = Duration::from_secs(2);

/// Wall time after discovery from which on a reader receives everything.
const SETTLING_TIME: Duration = Duration::from_millis(200);

/// The remote readers of some topics.
pub struct SubscriptionTracker {
    number_of: BTreeMap<String, usize>,
    topics: Vec<Readers>,
    next_poll: Option<Instant>,
    /// When the readers were last gone through, and after how many events of discovery.
    looked: Option<(Instant, u64)>,
}

#[derive(Default)]
struct Readers {
    /// By GUID.
    known: BTreeMap<[u8; 16], Reader>,
    settled: u64,
}

struct Reader {
    participant: [u8; 16],
    discovered_at: Instant,
    has_settled: bool,
}

/// A reader that the middleware knows at present.
struct Discovered<'a> {
    topic: &'a str,
    guid: [u8; 16],
    participant: [u8; 16],
}

impl SubscriptionTracker {
    /// Tracks these topics, which are numbered in this order.
    pub fn new<'a>(topics: impl IntoIterator<Item = &'a Topic>) -> Self {
        let number_of: BTreeMap<String, usize> =
            topics.into_iter().zip(0..).map(|(topic, number)| (topic.name.clone(), number)).collect();
        let topics = number_of.iter().map(|_| Readers::default()).collect();
        SubscriptionTracker { number_of, topics, next_poll: None, looked: None }
    }

    /// Polls the discovered readers unless that was done a moment ago; returns whether it has
    /// polled.
    pub fn poll(&mut self, context: &Context) -> bool {
        let begun = now();
        if self.next_poll.is_some_and(|next| begun < next) {
            return false;
        }
        // Before the readers are gone through: what comes in between is found by the next poll.
        let events = context.discovery_events();
        let is_quiet = self
            .looked
            .is_some_and(|(looked, before)| events == Some(before) && begun.duration_since(looked) < QUIET_PERIOD);
        if is_quiet && self.all_settled() {
            self.next_poll = Some(begun + POLL_PERIOD);
            return false;
        }
        self.looked = events.map(|events| (begun, events));
        match &context.network {
            Network::Dds(context) => {
                let readers = context.domain_participant().discovered_readers();
                let there = readers.iter().filter_map(|reader| {
                    let data = &reader.subscription_topic_data;
                    let topic = dds::ros_topic(data.topic_name())?;
                    let guid = reader.reader_proxy.remote_reader_guid.to_bytes();
                    Some(Discovered { topic, guid, participant: participant_of(guid) })
                });
                self.update(there, begun);
            }
            #[cfg(feature = "zenoh")]
            Network::Zenoh(session) => {
                let readers = session.subscriptions();
                let there =
                    readers.iter().map(|(topic, gid, session)| Discovered { topic, guid: *gid, participant: *session });
                self.update(there, begun);
            }
        }
        self.next_poll = Some(now() + POLL_PERIOD.max(begun.elapsed() * POLL_COST_FACTOR));
        true
    }

    /// Makes the next [`Self::poll`] effective at once, because a reader may have just joined.
    pub fn poll_immediately(&mut self) {
        (self.next_poll, self.looked) = (None, None);
    }

    fn update<'a>(&mut self, there: impl Iterator<Item = Discovered<'a>>, now: Instant) {
        let mut before: Vec<_> = self.topics.iter_mut().map(|topic| std::mem::take(&mut topic.known)).collect();
        for Discovered { topic, guid, participant } in there {
            let Some(&number) = self.number_of.get(topic) else { continue };
            let topic = &mut self.topics[number];
            let new = Reader { participant, discovered_at: now, has_settled: false };
            let mut reader = before[number].remove(&guid).unwrap_or(new);
            if !reader.has_settled && now.duration_since(reader.discovered_at) >= SETTLING_TIME {
                reader.has_settled = true;
                topic.settled += 1;
            }
            topic.known.insert(guid, reader);
        }
    }

    /// Whether a topic has a reader.
    #[must_use]
    pub fn has_subscribers(&self, number: usize) -> bool {
        self.topics.get(number).is_some_and(|topic| !topic.known.is_empty())
    }

    /// Whether a topic has a reader of a participant that is not one of these.
    #[must_use]
    pub fn has_other_subscribers(&self, number: usize, than: &Connected) -> bool {
        let is_other = |reader: &Reader| !than.contains(&reader.participant);
        self.topics.get(number).is_some_and(|topic| topic.known.values().any(is_other))
    }

    /// Whether every reader of every topic has settled.
    #[must_use]
    pub fn all_settled(&self) -> bool {
        self.topics.iter().flat_map(|topic| topic.known.values()).all(|reader| reader.has_settled)
    }

    /// How many readers of a topic have ever settled, or `None` if none of them is left. A larger
    /// number than before means a new reader.
    #[must_use]
    pub fn arrivals(&self, number: usize) -> Option<u64> {
        let topic = self.topics.get(number)?;
        topic.known.values().any(|reader| reader.has_settled).then_some(topic.settled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use msgs::topics;

    #[test]
    fn readers_join_settle_and_leave() {
        let mut tracker = SubscriptionTracker::new(&[topics::clock(), topics::map()]);
        let begun = now();
        let (one, other) = (("/sim/map", [1; 16]), ("/sim/map", [2; 16]));
        let strange = ("/chatter", [3; 16]);
        let mut at = |there: &[(&str, [u8; 16])], passed: u32| {
            let there =
                there.iter().map(|&(topic, guid)| Discovered { topic, guid, participant: participant_of(guid) });
            tracker.update(there, begun + SETTLING_TIME * passed / 2);
            assert!(!tracker.has_subscribers(0));
            (tracker.has_subscribers(1), tracker.all_settled(), tracker.arrivals(1))
        };
        assert_eq!(at(&[one, strange], 0), (true, false, None));
        assert_eq!(at(&[one, other], 2), (true, false, Some(1)));
        assert_eq!(at(&[one, other], 3), (true, false, Some(1)));
        assert_eq!(at(&[other], 4), (true, true, Some(2)));
        assert_eq!(at(&[], 5), (false, true, None));
        // A reader that returns settles again and counts as new.
        assert_eq!(at(&[one], 6), (true, false, None));
        assert_eq!(at(&[one], 8), (true, true, Some(3)));
    }
}
