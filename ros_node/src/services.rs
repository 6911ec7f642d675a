//! Service servers, whose requests arrive in the inbox.
//!
//! Invariants: a request is an item of the inbox like any sample; a response that cannot be sent is
//! counted and dropped; responding never blocks, except once per caller and service until the
//! caller's response reader is discovered, for at most [`CALLER_TIMEOUT`]; undecodable bytes are an
//! error without a response.
//!
//! Responses must stay below [`msgs::service::ANSWER_BYTES_MAX`].
//!
//! DDS-RPC leaves the correlation of request and response to the vendor: Fast DDS and Connext send
//! it beside the message, Cyclone inside it. A server supports one mapping, which follows
//! `RMW_IMPLEMENTATION` as in every other node. Over Zenoh a service is a queryable (`zenoh`).

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::pin::pin;
use std::rc::Rc;
use std::task::{Context as TaskContext, Poll};
use std::time::Duration;

use ros2_client::service::{Server, ServiceMapping};
use ros2_client::{CreateError, Name, RmwRequestId, ServiceTypeName};
use rustdds::DomainParticipant;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::dds::qos_profile;
use super::network::Network;
use super::ros_env::RMW_IMPLEMENTATION;
use super::{EndpointFactory, Inbox, Node, RosError, ThrottledWarning};
use msgs::service::{Ask, Reply, Service};
use msgs::topics::Qos;
use system::wall_clock::now;

/// Queue depth of requests and responses; deeper than the ROS default, because several callers may
/// ask at once.
pub(super) const QUEUE_DEPTH: u32 = 64;

/// Maximum wall time to wait for the response reader of a new caller: its request may arrive before
/// its reader is discovered, and a response sent before that is lost.
const CALLER_TIMEOUT: Duration = Duration::from_secs(1);

/// Wall time between two polls of the discovered readers.
const CALLER_POLL_PERIOD: Duration = Duration::from_millis(2);

/// Wall time from discovery of a reader until the middleware has matched it, several times what it
/// needs on an idle machine.
const CALLER_SETTLING: Duration = Duration::from_millis(25);

/// Maximum number of callers that are remembered.
const CALLERS_MAX: usize = 1024;

/// Bytes of a GUID that identify a process, in both mappings.
const PROCESS_BYTES: usize = 8;

/// The callers whose response reader on a topic has been discovered.
pub(super) struct CallerDiscovery {
    participant: DomainParticipant,
    topic: String,
    known: RefCell<BTreeSet<[u8; PROCESS_BYTES]>>,
}

impl CallerDiscovery {
    /// For the responses of the service with this name.
    pub(super) fn new(participant: &DomainParticipant, name: &str) -> Self {
        Self::of_topic(participant, format!("rr{name}Reply"))
    }

    /// For a topic, by its DDS name.
    pub(super) fn of_topic(participant: &DomainParticipant, topic: String) -> Self {
        CallerDiscovery { participant: participant.clone(), topic, known: RefCell::new(BTreeSet::new()) }
    }

    /// Waits until the caller's response reader is discovered, if this is its first request.
    #[expect(clippy::disallowed_methods, reason = "the ROS client has no event for a matched reader")]
    pub(super) fn wait_for(&self, id: &RmwRequestId) {
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
        while !self.has_reader(&process) && begun.elapsed() < CALLER_TIMEOUT {
            std::thread::sleep(CALLER_POLL_PERIOD);
        }
        std::thread::sleep(CALLER_SETTLING);
    }

    fn has_reader(&self, caller: &[u8; PROCESS_BYTES]) -> bool {
        let readers = self.participant.discovered_readers();
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

/// How requests and responses are correlated.
pub(super) fn mapping() -> ServiceMapping {
    mapping_of(std::env::var(RMW_IMPLEMENTATION).ok().as_deref())
}

fn mapping_of(middleware: Option<&str>) -> ServiceMapping {
    match middleware {
        Some("rmw_cyclonedds_cpp") => ServiceMapping::Cyclone,
        _ => ServiceMapping::Enhanced,
    }
}

/// QoS of requests and responses.
pub(super) fn qos() -> ros2_client::QosProfile {
    qos_profile(&Qos::reliable(QUEUE_DEPTH))
}

/// A message wrapped for the ROS client.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Wire<M>(pub(super) M);

impl<M: Serialize + DeserializeOwned> ros2_client::Message for Wire<M> {}

/// The server of a service type.
pub(super) type ServerOf<S> = Server<Wire<<S as Service>::Request>, Wire<<S as Service>::Response>>;

impl EndpointFactory {
    /// Offers a service: the inbox yields `convert` of each request, or of the reason why bytes are
    /// no request.
    ///
    /// # Errors
    /// If the middleware refuses it.
    pub fn service<S: Service + 'static, T>(
        &mut self,
        node: &mut Node,
        name: &str,
        inbox: &mut Inbox<T>,
        convert: impl Fn(Result<Ask<S>, String>) -> T + 'static,
    ) -> Result<(), RosError> {
        match &self.context.network {
            Network::Dds(_) => self.dds_service(node.dds(), name, inbox, convert),
            #[cfg(feature = "zenoh")]
            Network::Zenoh(_) => {
                let server = node.zenoh().server::<S>(name)?;
                inbox.add(Box::new(move |context| {
                    let taken = server.take(context);
                    taken.map(|taken| convert(taken.map(|(request, reply)| Ask { request, reply })))
                }));
                Ok(())
            }
        }
    }

    fn dds_service<S: Service, T>(
        &mut self,
        node: &mut ros2_client::Node,
        name: &str,
        inbox: &mut Inbox<T>,
        convert: impl Fn(Result<Ask<S>, String>) -> T + 'static,
    ) -> Result<(), RosError> {
        // A service has two endpoints.
        self.pause();
        self.pause();
        let failed = |source| endpoint_error::<S>(name, source);
        let parsed =
            Name::parse(name).map_err(|error| failed(CreateError::BadParameter { reason: error.to_string() }))?;
        let kind = ServiceTypeName::new(S::PACKAGE, S::NAME);
        let server: ServerOf<S> = node.create_server(mapping(), &parsed, &kind, qos(), qos()).map_err(failed)?;
        let server = Rc::new(server);
        let unsent = Rc::new(RefCell::new(ThrottledWarning::new(format!("{name}: answer not sent"))));
        let callers = Rc::new(CallerDiscovery::new(&self.context.participant(), name));
        inbox.add(Box::new(move |context| {
            take_request(&server, context).map(|taken| {
                convert(taken.map(|(id, request)| {
                    let (server, unsent, callers) = (Rc::clone(&server), Rc::clone(&unsent), Rc::clone(&callers));
                    Ask {
                        request,
                        reply: Reply::new(move |response| {
                            callers.wait_for(&id);
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

/// Takes the next request, or registers the waker with the server.
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

/// Sends a response, or counts it as not sent.
pub(super) fn answer<Q, R>(
    server: &Server<Wire<Q>, Wire<R>>,
    id: RmwRequestId,
    response: R,
    unsent: &RefCell<ThrottledWarning>,
) where
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
    fn cyclone_mapping_is_chosen_by_rmw_implementation() {
        assert_eq!(mapping_of(None), ServiceMapping::Enhanced);
        assert_eq!(mapping_of(Some("rmw_fastrtps_cpp")), ServiceMapping::Enhanced);
        assert_eq!(mapping_of(Some("rmw_cyclonedds_cpp")), ServiceMapping::Cyclone);
    }
}
