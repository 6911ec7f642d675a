//! Servers of services and of an action, waited for together with the subscriptions.
//!
//! Invariants: a request is an item of the inbox like any sample; an answer that cannot be sent is counted and dropped;
//! answering never waits, save once for each caller of each service until the caller is known to hear it, for [`HEARING`] at the
//! most; bytes that are no request are told from requests and stop nothing, and nobody is answered.
//!
//! Answers have to stay below [`msgs::limits::ANSWER_BYTES_MAX`].
//!
//! How a request and its answer are told to belong together is not part of the standard, and implementations differ: Fast DDS
//! and Connext put it beside the message, Cyclone into it. A server speaks one way, which follows `RMW_IMPLEMENTATION` as
//! with every other node.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::pin::pin;
use std::rc::Rc;
use std::task::{Context as TaskContext, Poll};
use std::time::Duration;

use ros2_client::service::{Server, ServiceMapping};
use ros2_client::{CreateError, Name, Node, RmwRequestId, ServiceTypeName};
use rustdds::DomainParticipant;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::{Inbox, RosError, Tally, Workshop, now, qos_profile};
use msgs::service::{Ask, Reply, Service};
use msgs::topics::Qos;

/// Requests and answers kept, more than ROS keeps, because those of several callers may come at once.
const DEPTH: u32 = 64;

/// The environment variable that says with which middleware the ROS nodes here are built.
const RMW_IMPLEMENTATION: &str = "RMW_IMPLEMENTATION";

/// Wall time for which an answer waits for a caller that is not known to listen yet: its request may arrive before the news that
/// it listens, and what is sent then is lost.
const HEARING: Duration = Duration::from_secs(1);

/// Wall time between two looks.
const HEARING_PERIOD: Duration = Duration::from_millis(2);

/// Wall time from the news to when it has got about in the middleware, several times what it needs on a machine that is not busy.
const HEARING_SPREADS: Duration = Duration::from_millis(25);

/// Callers that are remembered.
const CALLERS_MAX: usize = 1024;

/// Bytes of a GUID that tell processes from each other, in both ways to name a caller.
const PROCESS_BYTES: usize = 8;

/// Which callers hear the answers on a topic.
pub(super) struct Hearing {
    participant: Option<DomainParticipant>,
    topic: String,
    known: RefCell<BTreeSet<[u8; PROCESS_BYTES]>>,
}

impl Hearing {
    /// Of the answers of the service with this name.
    pub(super) fn new(participant: Option<&DomainParticipant>, name: &str) -> Self {
        Self::of_topic(participant, format!("rr{name}Reply"))
    }

    /// Of a topic, by its name in the middleware.
    pub(super) fn of_topic(participant: Option<&DomainParticipant>, topic: String) -> Self {
        Hearing { participant: participant.cloned(), topic, known: RefCell::new(BTreeSet::new()) }
    }

    /// Waits until the caller hears the answer, if this is its first one.
    #[expect(clippy::disallowed_methods, reason = "the ROS client does not tell when a reader has been found")]
    pub(super) fn wait(&self, id: &RmwRequestId) {
        let process = process(&id.writer_gid.to_bytes16());
        let mut known = self.known.borrow_mut();
        if known.contains(&process) {
            return;
        }
        if known.len() >= CALLERS_MAX {
            known.clear();
        }
        known.insert(process);
        let begun = now();
        while !self.hears(&process) && begun.elapsed() < HEARING {
            std::thread::sleep(HEARING_PERIOD);
        }
        std::thread::sleep(HEARING_SPREADS);
    }

    fn hears(&self, caller: &[u8; PROCESS_BYTES]) -> bool {
        let readers = self.participant.as_ref().map(DomainParticipant::discovered_readers).unwrap_or_default();
        readers.iter().any(|reader| {
            *reader.subscription_topic_data.topic_name() == self.topic
                && process(&reader.reader_proxy.remote_reader_guid.to_bytes()) == *caller
        })
    }
}

fn process(guid: &[u8; 16]) -> [u8; PROCESS_BYTES] {
    let mut process = [0; PROCESS_BYTES];
    process.copy_from_slice(&guid[..PROCESS_BYTES]);
    process
}

/// How requests and answers are told to belong together.
pub(super) fn mapping() -> ServiceMapping {
    mapping_of(std::env::var(RMW_IMPLEMENTATION).ok().as_deref())
}

fn mapping_of(middleware: Option<&str>) -> ServiceMapping {
    match middleware {
        Some("rmw_cyclonedds_cpp") => ServiceMapping::Cyclone,
        _ => ServiceMapping::Enhanced,
    }
}

/// The quality of service of requests and answers.
pub(super) fn qos() -> ros2_client::QosProfile {
    qos_profile(&Qos::reliable(DEPTH))
}

/// A message as the ROS client wants it.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Wire<M>(pub(super) M);

impl<M: Serialize + DeserializeOwned> ros2_client::Message for Wire<M> {}

/// Both ends of a service.
pub(super) type ServerOf<S> = Server<Wire<<S as Service>::Request>, Wire<<S as Service>::Response>>;

impl Workshop {
    /// Offers a service: its requests come out of the inbox as what `convert` makes of them. Of bytes that are no request it
    /// is told why.
    ///
    /// # Errors
    /// If the middleware refuses it.
    pub fn service<S: Service, T>(
        &mut self,
        node: &mut Node,
        name: &str,
        inbox: &mut Inbox<T>,
        convert: impl Fn(Result<Ask<S>, String>) -> T + 'static,
    ) -> Result<(), RosError> {
        // Two endpoints.
        self.pause();
        self.pause();
        let failed = |source| endpoint_error::<S>(name, source);
        let parsed =
            Name::parse(name).map_err(|error| failed(CreateError::BadParameter { reason: error.to_string() }))?;
        let kind = ServiceTypeName::new(S::PACKAGE, S::NAME);
        let server: ServerOf<S> = node.create_server(mapping(), &parsed, &kind, qos(), qos()).map_err(failed)?;
        let server = Rc::new(server);
        let unsent = Rc::new(RefCell::new(Tally::new(format!("{name}: answer not sent"))));
        let hearing = Rc::new(Hearing::new(self.participant.as_ref(), name));
        inbox.add(Box::new(move |context| {
            take_request(&server, context).map(|taken| {
                convert(taken.map(|(id, request)| {
                    let (server, unsent, hearing) = (Rc::clone(&server), Rc::clone(&unsent), Rc::clone(&hearing));
                    Ask {
                        request,
                        reply: Reply::new(move |response| {
                            hearing.wait(&id);
                            answer(&server, id, response, &unsent);
                        }),
                    }
                }))
            })
        }));
        Ok(())
    }
}

pub(super) fn endpoint_error<S: Service>(name: &str, source: CreateError) -> RosError {
    RosError::Endpoint { topic: format!("{name} [{}/srv/{}]", S::PACKAGE, S::NAME), source }
}

/// Takes the next request, or leaves the waker with the server.
pub(super) fn take_request<Q, R>(
    server: &Server<Wire<Q>, Wire<R>>,
    context: &mut TaskContext<'_>,
) -> Poll<Result<(RmwRequestId, Q), String>>
where
    Q: Serialize + DeserializeOwned + 'static,
    R: Serialize + DeserializeOwned + 'static,
{
    let taken = pin!(server.async_receive_request()).poll(context);
    taken.map(|taken| taken.map(|(id, Wire(request))| (id, request)).map_err(|error| error.to_string()))
}

/// Answers a request, or counts the answer as not sent.
pub(super) fn answer<Q, R>(server: &Server<Wire<Q>, Wire<R>>, id: RmwRequestId, response: R, unsent: &RefCell<Tally>)
where
    Q: Serialize + DeserializeOwned + 'static,
    R: Serialize + DeserializeOwned + 'static,
{
    if let Err(error) = server.send_response(id, Wire(response)) {
        unsent.borrow_mut().add(&error);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_of_cyclone_is_spoken_on_request_only() {
        assert_eq!(mapping_of(None), ServiceMapping::Enhanced);
        assert_eq!(mapping_of(Some("rmw_fastrtps_cpp")), ServiceMapping::Enhanced);
        assert_eq!(mapping_of(Some("rmw_cyclonedds_cpp")), ServiceMapping::Cyclone);
    }
}
