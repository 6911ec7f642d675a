//! Publishers and subscriptions.
//!
//! Latched topics are those of the advanced publisher of `zenoh-ext`, which keeps the last messages
//! for late readers, and resends what readers miss.

use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use ::zenoh::Wait;
use ::zenoh::bytes::ZBytes;
use ::zenoh::liveliness::LivelinessToken;
use ::zenoh::pubsub::{Publisher, Subscriber};
use ::zenoh::qos::{CongestionControl, Reliability as ZenohReliability};
use ::zenoh::sample::SourceInfo;
use msgs::cdr;
use msgs::message::Message;
use msgs::topics::{Durability, Qos, Reliability, Topic};
use protocol::limits::OBSERVATION_BYTES_MAX;
use serde::Serialize;
use zenoh_ext::{
    AdvancedPublisher, AdvancedPublisherBuilderExt, AdvancedSubscriber, AdvancedSubscriberBuilderExt, CacheConfig,
    HistoryConfig, MissDetectionConfig, RecoveryConfig,
};

use super::attachment::Attachment;
use super::names::{Endpoint, EndpointKind};
use super::queue::Queue;
use super::{Node, Session, endpoint_error};
use crate::inbox::Sample;
use crate::{RosError, type_hash};

/// Longest sample that is kept: twice that of the longest message of the protocol.
const SAMPLE_BYTES_MAX: usize = 2 * OBSERVATION_BYTES_MAX;

/// Wall time after which a publisher of a latched topic states the number of its last message, as
/// in `rmw_zenoh`, so that readers ask for what they have missed.
const HEARTBEAT_PERIOD: Duration = Duration::from_millis(500);

/// What a topic carries, as tokens have it.
fn endpoint(topic: &Topic) -> Endpoint {
    let message = topic.message;
    Endpoint {
        name: topic.name.clone(),
        type_name: format!("{}::msg::dds_::{}_", message.package, message.name),
        type_hash: type_hash::of(message),
        qos: topic.qos,
    }
}

/// A publisher.
pub(crate) struct Writer {
    publisher: AnyPublisher,
    gid: [u8; 16],
    /// Number of messages so far.
    sequence: i64,
    _token: LivelinessToken,
}

enum AnyPublisher {
    Volatile(Publisher<'static>),
    Latched(Box<AdvancedPublisher<'static>>),
}

impl Node {
    /// Makes a publisher, which drops what the connection to a reader has no room for.
    pub(crate) fn writer(&self, topic: &Topic) -> Result<Writer, RosError> {
        self.writer_with(&endpoint(topic), CongestionControl::Drop)
    }

    /// Makes a publisher that waits for room.
    pub(crate) fn blocking_writer(&self, topic: &Topic) -> Result<Writer, RosError> {
        self.writer_with(&endpoint(topic), CongestionControl::Block)
    }

    /// Makes a publisher of a type that is no message of this project, by its name in DDS.
    pub(crate) fn writer_of(
        &self,
        topic: &str,
        type_name: String,
        type_hash: String,
        qos: Qos,
    ) -> Result<Writer, RosError> {
        let endpoint = Endpoint { name: topic.to_owned(), type_name, type_hash, qos };
        self.writer_with(&endpoint, CongestionControl::Drop)
    }

    fn writer_with(&self, endpoint: &Endpoint, congestion: CongestionControl) -> Result<Writer, RosError> {
        let declare = || {
            let reliability = match endpoint.qos.reliability {
                Reliability::Reliable => ZenohReliability::Reliable,
                Reliability::BestEffort => ZenohReliability::BestEffort,
            };
            let builder = self
                .session
                .0
                .session
                .declare_publisher(endpoint.key(self.names.domain_id))
                .congestion_control(congestion)
                .reliability(reliability);
            let publisher = match endpoint.qos.durability {
                Durability::Volatile => AnyPublisher::Volatile(builder.wait()?),
                Durability::TransientLocal => {
                    let latched = builder
                        .advanced()
                        .publisher_detection()
                        .cache(CacheConfig::default().max_samples(endpoint.qos.depth as usize))
                        .sample_miss_detection(MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT_PERIOD));
                    AnyPublisher::Latched(Box::new(latched.wait()?))
                }
            };
            let (gid, token) = self.announce(EndpointKind::Publisher, endpoint)?;
            Ok(Writer { publisher, gid, sequence: 0, _token: token })
        };
        declare().map_err(|error: ::zenoh::Error| endpoint_error(&endpoint.to_string(), &error))
    }

    /// Makes a subscription.
    pub(crate) fn subscription(&self, topic: &Topic) -> Result<Subscription, RosError> {
        let endpoint = endpoint(topic);
        let queue = Arc::new(Queue::new(topic.qos.depth));
        let declare = || {
            let (session, received) = (&self.session.0.session, Arc::clone(&queue));
            let builder = session
                .declare_subscriber(endpoint.key(self.names.domain_id))
                .callback(move |sample| received.push(sample));
            let subscriber = match topic.qos.durability {
                Durability::Volatile => AnySubscriber::Volatile(builder.wait()?),
                Durability::TransientLocal => {
                    let history =
                        HistoryConfig::default().detect_late_publishers().max_samples(topic.qos.depth as usize);
                    let recovery = RecoveryConfig::default().heartbeat();
                    let latched = builder.advanced().history(history).recovery(recovery).subscriber_detection();
                    AnySubscriber::Latched(Box::new(latched.wait()?))
                }
            };
            let (_, token) = self.announce(EndpointKind::Subscription, &endpoint)?;
            Ok((subscriber, token))
        };
        let (subscriber, token) =
            declare().map_err(|error: ::zenoh::Error| endpoint_error(&endpoint.to_string(), &error))?;
        Ok(Subscription { queue, session: self.session.clone(), _subscriber: subscriber, _token: token })
    }
}

impl Writer {
    /// Publishes a message, or says why that is not possible.
    pub(crate) fn publish<M: Serialize>(&mut self, message: &M) -> Result<(), String> {
        self.sequence += 1;
        let attachment = Attachment::now(self.sequence, self.gid).to_bytes();
        let bytes = cdr::encode(message);
        let published = match &self.publisher {
            AnyPublisher::Volatile(publisher) => {
                let number = u32::try_from(self.sequence - 1).unwrap_or(u32::MAX);
                let source = SourceInfo::new(publisher.id(), number);
                publisher.put(bytes).attachment(&attachment[..]).source_info(source).wait()
            }
            AnyPublisher::Latched(publisher) => publisher.put(bytes).attachment(&attachment[..]).wait(),
        };
        published.map_err(|error| error.to_string())
    }
}

/// A subscription.
pub(crate) struct Subscription {
    queue: Arc<Queue<::zenoh::sample::Sample>>,
    session: Session,
    _subscriber: AnySubscriber,
    _token: LivelinessToken,
}

#[expect(dead_code, reason = "they are kept for as long as they receive")]
enum AnySubscriber {
    Volatile(Subscriber<()>),
    Latched(Box<AdvancedSubscriber<()>>),
}

impl Subscription {
    /// The next sample, or registers the waker.
    pub(crate) fn take<M: Message>(&self, context: &Context<'_>) -> Poll<Sample<M>> {
        self.queue.take(context).map(|sample| Sample {
            message: decoded(sample.payload()),
            source: self.source(&sample).unwrap_or_default(),
        })
    }

    /// The session of the process that has sent a sample: by the sample, or else by the graph. For
    /// a publisher that is in neither, its own id.
    fn source(&self, sample: &::zenoh::sample::Sample) -> Option<[u8; 16]> {
        if let Some(source) = sample.source_info() {
            return Some(source.source_id().zid().to_le_bytes());
        }
        let gid = Attachment::from_bytes(&sample.attachment()?.to_bytes())?.gid;
        Some(self.session.0.graph.session_of(&gid).unwrap_or(gid))
    }
}

/// The message in a payload, or why there is none.
pub(super) fn decoded<M: serde::de::DeserializeOwned>(payload: &ZBytes) -> Result<M, String> {
    if payload.len() > SAMPLE_BYTES_MAX {
        return Err(format!("{} bytes, where {SAMPLE_BYTES_MAX} are allowed", payload.len()));
    }
    cdr::decode(&payload.to_bytes()).map_err(|error| error.to_string())
}
